//! Live transfers that stay on a device: what follows an edit is what a whole transfer gives there.

use barymap::conformance::Scene;
use barymap::engine::{Backend, Engine, EngineOptions};
use barymap::geometry::{Mesh, SurfacePoint};
use barymap::picture::{Depth, Image, Pixels};
use barymap::progress::Quiet;
use barymap::surface::AnchorPairs;
use barymap::surface::field::{Edit, Field, FieldOptions, FieldPair, FieldSession};
use barymap::surface::gpu::DeviceMap;
use barymap::tools::transfer::{DeviceLiveTransfer, Layer, LayerKind, TransferOptions, transfer_on};
use barymap::{Error, wgpu};

use super::engine;

/// A ball with texture coordinates and points on it.
struct Subject {
    scene: Scene,
    points: Vec<SurfacePoint>,
}

impl Subject {
    fn new() -> Self {
        let scene = Scene::textured(40);
        let points = scene.anchors.source.clone();
        Self { scene, points }
    }

    fn mesh(&self) -> &Mesh {
        &self.scene.source.0
    }

    fn session(&self) -> FieldSession<'_, f32, 8, 12> {
        let (shape, _) = self.scene.shapes();
        let anchors = AnchorPairs { source: self.points.clone(), target: self.points.clone() };
        FieldSession::new(FieldPair::new(shape, shape).unwrap(), anchors, &FieldOptions::default()).unwrap()
    }

    /// An anchor goes to a corner of its triangle.
    fn edit(&self, anchor: usize) -> Edit {
        let start = self.points[anchor];
        let far = |k: &usize| start.barycentric[*k];
        let corner = (0..3).min_by(|a, b| far(a).total_cmp(&far(b))).unwrap();
        let mut barycentric = [0.0; 3];
        barycentric[corner] = 1.0;
        Edit::Move(anchor, start, SurfacePoint { barycentric, ..start })
    }
}

fn noise(side: u32, seed: usize) -> Image {
    let mut image = Image::zeros(side, side, 3, Depth::U8).unwrap();
    let value = |i: usize| ((i + seed).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40) as u8;
    if let Pixels::U8(v) = &mut image.pixels {
        v.iter_mut().enumerate().for_each(|(i, s)| *s = value(i));
    }
    image
}

fn options(side: u32) -> TransferOptions {
    TransferOptions { width: side, height: side, margin: 4, ..TransferOptions::default() }
}

type Device = DeviceMap<Field<f32, 12>>;

/// Whether a live transfer is the whole one, made anew.
fn same(live: &DeviceLiveTransfer<'_>, engine: &Engine, subject: &Subject, layers: &[Layer<'_>], map: &Device) -> bool {
    let mesh = subject.mesh();
    let whole = transfer_on(engine, mesh, layers, mesh, map, &options(256), &Quiet).unwrap();
    let (pictures, coverage) = live.read().unwrap();
    pictures == whole.layers && coverage == whole.coverage
}

#[test]
fn it_is_a_whole_transfer_once_nothing_is_left() {
    let Some(engine) = engine() else { return };
    let subject = Subject::new();
    let mesh = subject.mesh();
    let mut session = subject.session();
    let (a, b) = (noise(128, 1), noise(64, 2));
    let layers = [Layer::single("colour", &a), Layer::single("shade", &b)];
    let mut map = Device::new(engine, session.field().clone()).unwrap();
    let mut live = DeviceLiveTransfer::new(engine, mesh, &layers, mesh, &map, &options(256)).unwrap();
    assert!(same(&live, engine, &subject, &layers, &map), "before any edit");
    for (anchor, budget) in [(7, 1 << 20), (11, 3000), (7, 700)] {
        let triangles = session.edit(&[subject.edit(anchor)]).unwrap();
        map.follow(session.field(), &triangles).unwrap();
        live.update(&triangles).unwrap();
        assert!(!same(&live, engine, &subject, &layers, &map), "the comparison notices what is left");
        let mut frames = 0;
        loop {
            let (frame, submission) = live.draw(&map, budget).unwrap();
            engine.gpu().unwrap().wait(&submission).unwrap();
            assert!(frame.mapped <= budget.max(8) && frames < 10_000, "{frame:?}");
            frames += 1;
            if frame.left == 0 {
                break;
            }
        }
        assert!(budget > 1 << 16 || frames > 2, "{frames} frames of {budget} texels");
        assert!(same(&live, engine, &subject, &layers, &map), "anchor {anchor}, {frames} frames");
        // A map that followed is one that was made anew.
        let anew = Device::new(engine, session.field().clone()).unwrap();
        assert!(same(&live, engine, &subject, &layers, &anew));
    }
}

#[test]
fn a_drag_on_a_borrowed_device_waits_for_nothing_and_brings_up_what_changed() {
    if engine().is_none() {
        return;
    }
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default())).unwrap();
    let asked = wgpu::DeviceDescriptor { required_limits: adapter.limits(), ..Default::default() };
    let (device, queue) = pollster::block_on(adapter.request_device(&asked)).unwrap();
    let borrow = || Engine::from_device(&adapter.get_info(), device.clone(), queue.clone()).unwrap();
    let engines = [borrow(), borrow()];
    let subject = Subject::new();
    let mesh = subject.mesh();
    let image = noise(128, 3);
    let layers = [Layer::single("colour", &image)];
    for engine in &engines {
        let mut session = subject.session();
        let mut map = Device::new(engine, session.field().clone()).unwrap();
        let mut live = DeviceLiveTransfer::new(engine, mesh, &layers, mesh, &map, &options(256)).unwrap();
        let gpu = engine.gpu().unwrap();
        for anchor in [7, 3] {
            let triangles = session.edit(&[subject.edit(anchor)]).unwrap();
            let before = gpu.traffic();
            map.follow(session.field(), &triangles).unwrap();
            live.update(&triangles).unwrap();
            let (mut mapped, mut recolored, mut frames) = (0, 0, 0);
            loop {
                let mut commands = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
                let frame = live.frame(&map, 1 << 16, &mut commands).unwrap();
                queue.submit([commands.finish()]);
                // As a window waits for its screen.
                device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
                (mapped, recolored, frames) = (mapped + frame.mapped, recolored + frame.recolored, frames + 1);
                if frame.left == 0 {
                    break;
                }
            }
            let spent = gpu.traffic() - before;
            assert_eq!((spent.submissions, spent.waits, spent.allocations), (0, 0, 0), "{spent:?}");
            // Of runs of eight texels a word in three lists; of the map 48 bytes a vertex and 16 a
            // triangle, with up to 32 others between two that changed.
            let lists = 4 * (mapped + 6 * recolored) as u64 / 8;
            let of_map = 33 * (48 * 3 + 16) * triangles.len() as u64;
            let beside = 16 * spent.dispatches + frames * 16 + 28 * 512 * frames;
            assert!(spent.bytes_up <= lists + of_map + beside, "{spent:?}");
            assert!(spent.bytes_down <= frames * 16 * 513, "{spent:?}");
            assert!(same(&live, engine, &subject, &layers, &map));
        }
    }
}

#[test]
fn what_cannot_follow_on_a_device_is_refused() {
    let Some(engine) = engine() else { return };
    let subject = Subject::new();
    let mesh = subject.mesh();
    let session = subject.session();
    let image = noise(32, 1);
    let map = Device::new(engine, session.field().clone()).unwrap();
    let new = |engine: &'static Engine, layers: &[Layer<'_>]| {
        DeviceLiveTransfer::new(engine, mesh, layers, mesh, &map, &options(64)).err()
    };
    let label = Layer { kind: LayerKind::Labels, ..Layer::single("labels", &image) };
    assert!(matches!(new(engine, &[label]), Some(Error::Input { .. })));
    let layers = [Layer::single("colour", &image)];
    assert!(new(engine, &layers).is_none());
    let on_cpu = DeviceLiveTransfer::new(engine, mesh, &layers, mesh, session.field(), &options(64)).err();
    assert!(matches!(on_cpu, Some(Error::Input { .. })), "{on_cpu:?}");
    let mut live = DeviceLiveTransfer::new(engine, mesh, &layers, mesh, &map, &options(64)).unwrap();
    assert!(matches!(live.update(&[u32::MAX]), Err(Error::Input { .. })));
    assert!(matches!(live.draw(session.field(), 100), Err(Error::Input { .. })));
}

#[test]
fn a_device_lost_while_editing_is_an_error() {
    if engine().is_none() {
        return;
    }
    let own = Engine::new(EngineOptions { backend: Backend::Gpu, ..Default::default() }).unwrap();
    let subject = Subject::new();
    let mesh = subject.mesh();
    let mut session = subject.session();
    let image = noise(32, 1);
    let layers = [Layer::single("colour", &image)];
    let mut map = Device::new(&own, session.field().clone()).unwrap();
    let mut live = DeviceLiveTransfer::new(&own, mesh, &layers, mesh, &map, &options(64)).unwrap();
    let triangles = session.edit(&[subject.edit(7)]).unwrap();
    live.update(&triangles).unwrap();
    own.gpu().unwrap().destroy();
    assert!(matches!(map.follow(session.field(), &triangles), Err(Error::Device { .. })));
    assert!(matches!(live.draw(&map, 1000), Err(Error::Device { .. })));
    assert!(matches!(live.read(), Err(Error::Device { .. })));
}
