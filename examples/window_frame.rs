//! Frames of a dragged cage on the device of a window: each is written into the window's own
//! commands, and the picture is a view that the window draws.
//!
//! `cargo run --release --example window_frame`

use std::error::Error;

use barymap::engine::Engine;
use barymap::geometry::Polygon;
use barymap::glam::{DVec2, UVec2};
use barymap::mapping::plane::{CompositeMap, Coordinates};
use barymap::picture::Image;
use barymap::tools::warp::DevicePreview;
use barymap::wgpu;

/// A square about the middle of the picture whose first corner is dragged.
fn map(drag: f64) -> Result<CompositeMap, barymap::Error> {
    let corners = [[80.0, 60.0], [240.0, 60.0], [240.0, 180.0], [80.0, 180.0]].map(DVec2::from);
    let dragged = [corners[0] + DVec2::splat(drag), corners[1], corners[2], corners[3]];
    let polygons = [corners, dragged].map(|p| Polygon::from_loops(vec![p.to_vec()]));
    CompositeMap::new(Coordinates::MeanValue, polygons.into())
}

fn main() -> Result<(), Box<dyn Error>> {
    // What a window has: a device, its queue, and commands that it submits once a frame.
    let instance = wgpu::Instance::default();
    let Ok(adapter) = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default())) else {
        println!("no adapter: install a driver (barymap devices says which)");
        return Ok(());
    };
    let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor::default()))?;
    let engine = Engine::from_device(&adapter.get_info(), device.clone(), queue.clone())?;
    println!("runs on {}", engine.description());

    let picture = Image::from_fn(320, 240, |x, y| [x as u8, y as u8, (x ^ y) as u8, 255])?;
    let mut preview = DevicePreview::new(&engine, &picture, &map(0.0)?, UVec2::new(320, 240))?;
    for frame in 1..=10 {
        let mut commands = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        preview.drag(&map(f64::from(frame))?, &mut commands)?;
        // Here the window draws `preview.view()`, in the same commands.
        let _shown: &wgpu::TextureView = preview.view();
        queue.submit([commands.finish()]);
    }
    let last = preview.frame()?;
    println!("{} x {} pixels, the corner of the cage is now at 90, 70", last.width, last.height);
    Ok(())
}
