//! A texture that follows a dragged anchor on the device of a window: each frame is written into
//! the window's own commands, and the texture is a view that the window draws.
//!
//! `cargo run --release --example window_texture`

use std::error::Error;

use barymap::engine::Engine;
use barymap::geometry::{SurfacePoint, Topology};
use barymap::models::character_pair;
use barymap::progress::Quiet;
use barymap::surface::correspondence::Shape;
use barymap::surface::field::{Edit, Field, FieldOptions, FieldPair, FieldSession};
use barymap::surface::gpu::DeviceMap;
use barymap::surface::{AnchorPairs, Embedding, EmbeddingOptions};
use barymap::tools::transfer::{DeviceLiveTransfer, Layer, LiveFrame, TransferOptions};
use barymap::wgpu;

/// Texels that a frame does again at most.
const BUDGET: usize = 1 << 16;

fn main() -> Result<(), Box<dyn Error>> {
    let instance = wgpu::Instance::default();
    let Ok(adapter) = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default())) else {
        println!("no adapter: install a driver (barymap devices says which)");
        return Ok(());
    };
    let asked = wgpu::DeviceDescriptor { required_limits: adapter.limits(), ..Default::default() };
    let (device, queue) = pollster::block_on(adapter.request_device(&asked))?;
    let engine = Engine::from_device(&adapter.get_info(), device.clone(), queue.clone())?;
    println!("runs on {}", engine.description());

    // One mesh, whose anchors are their own images to begin with: its texture is carried to itself.
    let pair = character_pair();
    let mesh = &pair.source.mesh;
    let topology = Topology::new(mesh);
    let few = EmbeddingOptions { landmarks: 200, ..EmbeddingOptions::default() };
    let embedding = Embedding::compute(mesh, &topology, &few, &Quiet)?;
    let shape = Shape { mesh, topology: &topology, embedding: Some(&embedding) };
    let (points, _) = pair.anchors(60);
    let anchors = AnchorPairs { source: points.clone(), target: points.clone() };
    let both = FieldPair::<8>::new(shape, shape)?;
    let mut session = FieldSession::<f32, 8, 12>::new(both, anchors, &FieldOptions::default())?;
    let mut map = DeviceMap::<Field<f32, 12>>::new(&engine, session.field().clone())?;
    let picture = pair.source.texture(512);
    let layers = [Layer::single("colour", &picture)];
    let options = TransferOptions { width: 512, height: 512, ..TransferOptions::default() };
    let mut live = DeviceLiveTransfer::new(&engine, mesh, &layers, mesh, &map, &options)?;

    // An anchor is dragged within its triangle.
    let start = points[7];
    let (mut frames, mut recolored, mut left) = (0, 0, 0);
    for step in 1..=10_u32 {
        let t = 0.5 * f64::from(step) / 10.0;
        let [a, b, c] = start.barycentric;
        let to = SurfacePoint::new(start.face, [a * (1.0 - t) + t, b * (1.0 - t), c * (1.0 - t)]);
        let triangles = session.edit(&[Edit::Move(7, start, to)])?;
        map.follow(session.field(), &triangles)?;
        live.update(&triangles)?;
        // A frame for each step, and after the last one until nothing is left.
        while step == 10 && left > 0 || frames < step {
            let mut commands = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            let frame: LiveFrame = live.frame(&map, BUDGET, &mut commands)?;
            // Here the window draws the first of `live.views()`, in the same commands.
            let _shown: Option<&wgpu::TextureView> = live.views().next();
            queue.submit([commands.finish()]);
            // As a window waits for its screen.
            device.poll(wgpu::PollType::wait_indefinitely())?;
            (frames, recolored, left) = (frames + 1, recolored + frame.recolored, frame.left);
        }
    }
    println!("{frames} frames, {} texels coloured in each", recolored / frames as usize);
    Ok(())
}
