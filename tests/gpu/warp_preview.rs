//! Previews that stay on a device, against those of the CPU.

use barymap::engine::{Backend, Engine, EngineOptions, Traffic};
use barymap::geometry::Polygon;
use barymap::mapping::plane::{CompositeMap, Coordinates, Lattice};
use barymap::picture::{Depth, Image, Pixels};
use barymap::tools::warp::{DevicePreview, Preview};
use barymap::{Error, wgpu};
use glam::{DVec2, UVec2};

use super::{downlevel, engine};

const SIZE: UVec2 = UVec2::new(200, 120);

/// A ring of `count` vertices in a picture, every other one turned.
fn ring(size: DVec2, count: usize, turn: f64) -> Vec<Vec<DVec2>> {
    let at = |k: usize| {
        let (r, turn) = if k.is_multiple_of(2) { (0.48, turn) } else { (0.36, 0.0) };
        size * (DVec2::splat(0.5) + r * DVec2::from_angle(std::f64::consts::TAU * k as f64 / count as f64 + turn))
    };
    vec![(0..count).map(at).collect()]
}

fn turned(count: usize, turn: f64, steps: u32) -> CompositeMap {
    let at = |k: u32| Polygon::from_loops(ring(SIZE.as_dvec2(), count, turn * f64::from(k) / f64::from(steps)));
    CompositeMap::new(Coordinates::MeanValue, (0..=steps).map(at).collect()).unwrap()
}

/// A map of squares of this size onto one another, `moved` by corner.
fn square(side: f64, moved: [DVec2; 4], coordinates: Coordinates) -> CompositeMap {
    let corners = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y].map(|c| c * side);
    let to = [0, 1, 2, 3].map(|k| corners[k] + moved[k]);
    let polygon = |p: [DVec2; 4]| Polygon::from_loops(vec![p.to_vec()]);
    CompositeMap::new(coordinates, vec![polygon(corners), polygon(to)]).unwrap()
}

/// Waves of at most two levels a pixel.
fn waves(size: UVec2) -> Image {
    let wave = |x: u32, t: f64| (127.5 + 80.0 * (f64::from(x) * 0.02 + t).sin()) as u8;
    Image::from_fn(size.x, size.y, |x, y| [wave(x, 0.0), wave(y, 1.0), wave(x + y, 2.0), 255]).unwrap()
}

/// Distance of a pixel's centre to the nearest edge of the images of a lattice.
fn to_edge(lattice: &Lattice, pixel: DVec2) -> f64 {
    let to = |a: DVec2, b: DVec2| {
        let t = ((pixel - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
        (a + (b - a) * t - pixel).length()
    };
    let edges = lattice.triangles.iter().flat_map(|t| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])]);
    edges.map(|(a, b)| to(lattice.images[a as usize], lattice.images[b as usize])).fold(f64::INFINITY, f64::min)
}

/// Levels that a colour is off at most: one where its place rounds to the next 256th of a pixel, as
/// waves have no step of 256 levels, and one for its own rounding.
const LEVELS: u8 = 2;

/// Images are rounded to 2^-24 of coordinates up to 1,024, four times on the way to the canvas; at
/// edges this near another triangle may be taken.
const EDGE: f64 = 4.0 * 1024.0 / 16_777_216.0;

/// The pixels that differ more than they may.
fn faults(found: &Image, truth: &Image, lattice: &Lattice) -> usize {
    let (Pixels::U8(a), Pixels::U8(b)) = (&found.pixels, &truth.pixels) else { panic!("other depth") };
    assert_eq!(a.len(), b.len());
    let differ = |i: &usize| (0..4).any(|c| a[4 * i + c].abs_diff(b[4 * i + c]) > LEVELS);
    let width = truth.width as usize;
    let centre = |i: usize| DVec2::new((i % width) as f64 + 0.5, (i / width) as f64 + 0.5);
    (0..a.len() / 4).filter(differ).filter(|&i| to_edge(lattice, centre(i)) > EDGE).take(50).count()
}

/// What the device draws of `map` after `before`, and what the CPU does.
fn both(engine: &Engine, image: &Image, [before, map]: [&CompositeMap; 2], canvas: UVec2) -> (Image, Preview) {
    let mut drawn = DevicePreview::new(engine, image, before, canvas).unwrap();
    drawn.draw(before).unwrap();
    drawn.draw(map).unwrap();
    let mut truth = Preview::new(engine, image, before, canvas).unwrap();
    truth.drag(engine, map).unwrap();
    (drawn.frame().unwrap(), truth)
}

#[test]
fn pixels_are_those_of_the_cpu() {
    let image = waves(SIZE);
    for engine in [engine(), downlevel()].into_iter().flatten() {
        for (count, steps) in [(24, 3), (24, 4), (90, 1), (1100, 2)] {
            let maps = [turned(count, 0.02, steps), turned(count, 0.3 / count as f64, steps)];
            let (found, truth) = both(engine, &image, [&maps[0], &maps[1]], SIZE);
            assert_eq!(faults(&found, &truth.frame().unwrap(), truth.lattice()), 0, "{count} vertices, {steps} steps");
            let other = Preview::new(engine, &image, &turned(count, 0.2, steps), SIZE).unwrap();
            assert!(faults(&found, &other.frame().unwrap(), other.lattice()) > 40, "the measure sees another map");
        }
    }
}

#[test]
fn large_triangles_folds_and_odd_canvases_are_painted() {
    let Some(engine) = engine() else { return };
    let image = waves(UVec2::splat(30));
    let still = square(30.0, [DVec2::ZERO; 4], Coordinates::MeanValue);
    // Thirty times as large: triangles have 240 pixels a side. Two corners change places: a fold.
    let grown = [[0.0, 0.0], [870.0, 10.0], [900.0, 850.0], [-10.0, 870.0]].map(DVec2::from);
    let folded = [[0.0, 0.0], [0.0, 0.0], [-30.0, 20.0], [40.0, 10.0]].map(DVec2::from);
    for moved in [grown, folded] {
        let map = square(30.0, moved, Coordinates::MeanValue);
        for canvas in [UVec2::new(333, 301), UVec2::new(1, 1), UVec2::new(65, 17)] {
            let (found, truth) = both(engine, &image, [&still, &map], canvas);
            let frame = truth.frame().unwrap();
            let shown = (0..canvas.x * canvas.y).filter(|i| frame.get(i % canvas.x, i / canvas.x, 3) > 0.0).count();
            assert!(shown > 0, "something is shown");
            assert_eq!(faults(&found, &frame, truth.lattice()), 0, "{canvas}");
        }
    }
}

#[test]
fn alpha_and_coordinates_of_the_host_are_those_of_the_cpu() {
    let Some(engine) = engine() else { return };
    let mut image = waves(UVec2::splat(40));
    if let Pixels::U8(samples) = &mut image.pixels {
        samples.iter_mut().skip(3).step_by(4).enumerate().for_each(|(i, a)| *a = (i % 40) as u8 * 3 + 138);
    }
    let moved = [[1.0, 2.0], [-3.0, 1.0], [2.0, 2.5], [0.5, -2.0]].map(DVec2::from);
    for coordinates in [Coordinates::MeanValue, Coordinates::Wachspress] {
        let map = square(40.0, moved, coordinates);
        let mut drawn = DevicePreview::new(engine, &image, &map, UVec2::splat(40)).unwrap();
        drawn.draw(&map).unwrap();
        let truth = Preview::new(engine, &image, &map, UVec2::splat(40)).unwrap();
        assert_eq!(faults(&drawn.frame().unwrap(), &truth.frame().unwrap(), truth.lattice()), 0, "{coordinates:?}");
    }
}

/// A device of the test, and two engines that borrow it.
struct Window {
    device: wgpu::Device,
    queue: wgpu::Queue,
    engines: [Engine; 2],
}

impl Window {
    fn open() -> Option<Self> {
        engine()?;
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
        let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default())).unwrap();
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor::default())).unwrap();
        let borrow = || Engine::from_device(&adapter.get_info(), device.clone(), queue.clone()).unwrap();
        let engines = [borrow(), borrow()];
        Some(Self { device, queue, engines })
    }

    fn commands(&self) -> wgpu::CommandEncoder {
        self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
    }
}

#[test]
fn a_frame_is_one_submission_of_the_caller_without_waits_or_allocations() {
    let Some(window) = Window::open() else { return };
    let image = waves(SIZE);
    let map = |frame: u32| turned(24, 0.02 + 0.001 * f64::from(frame), 5);
    let mut previews =
        window.engines.each_ref().map(|engine| DevicePreview::new(engine, &image, &map(0), SIZE).unwrap());
    let mut commands = window.commands();
    previews.iter_mut().for_each(|p| p.drag(&map(0), &mut commands).unwrap());
    window.queue.submit([commands.finish()]);
    let gpus = window.engines.each_ref().map(|e| e.gpu().unwrap());
    let before = gpus.map(|gpu| gpu.traffic());
    for frame in 1..=20 {
        let mut commands = window.commands();
        // The second engine shows the frames in reverse.
        previews[0].drag(&map(frame), &mut commands).unwrap();
        previews[1].drag(&map(20 - frame), &mut commands).unwrap();
        window.queue.submit([commands.finish()]);
    }
    for (gpu, before) in gpus.into_iter().zip(before) {
        let spent = gpu.traffic() - before;
        // Of five steps the parameters and a loop, 48 bytes, and 48 of each vertex; the parameters
        // of the lattice, and 16 of each dispatch.
        let bytes = 20 * (5 * (48 + 48 * 24) + 32) + 16 * spent.dispatches;
        let expected = Traffic { bytes_up: bytes, dispatches: spent.dispatches, ..Traffic::default() };
        assert_eq!(spent, expected);
        assert!(spent.dispatches <= 20 * 10, "{spent:?}");
    }
    for (preview, last) in previews.iter().zip([map(20), map(0)]) {
        let mut truth = Preview::new(&window.engines[0], &image, &map(0), SIZE).unwrap();
        truth.drag(&window.engines[0], &last).unwrap();
        assert_eq!(faults(&preview.frame().unwrap(), &truth.frame().unwrap(), truth.lattice()), 0);
    }
    // More steps than ever need room, once.
    let longer = turned(24, 0.02, 7);
    let allocations = [(); 3].map(|()| {
        let before = window.engines[0].gpu().unwrap().traffic();
        let mut commands = window.commands();
        previews[0].drag(&longer, &mut commands).unwrap();
        window.queue.submit([commands.finish()]);
        (window.engines[0].gpu().unwrap().traffic() - before).allocations
    });
    assert!(allocations[0] > 0 && allocations[1..] == [0, 0], "{allocations:?}");
}

#[test]
fn a_device_that_is_lost_while_dragging_is_an_error() {
    if engine().is_none() {
        return;
    }
    let own = Engine::new(EngineOptions { backend: Backend::Gpu, ..Default::default() }).unwrap();
    let map = turned(24, 0.02, 3);
    let mut preview = DevicePreview::new(&own, &waves(SIZE), &map, SIZE).unwrap();
    preview.draw(&map).unwrap();
    own.gpu().unwrap().destroy();
    assert!(matches!(preview.draw(&map), Err(Error::Device { .. })));
    assert!(matches!(preview.frame(), Err(Error::Device { .. })));
}

#[test]
fn what_cannot_be_drawn_is_refused() {
    let (image, map) = (waves(SIZE), turned(24, 0.02, 3));
    let none = DevicePreview::new(&Engine::cpu(), &image, &map, SIZE).unwrap_err();
    assert!(matches!(none, Error::Capability { .. }), "{none}");
    let Some(engine) = engine() else { return };
    assert!(DevicePreview::new(engine, &image, &map, UVec2::new(0, 5)).is_err());
    let empty = Image::zeros(1, 1, 3, Depth::U8).unwrap();
    let wide = DevicePreview::new(engine, &empty, &map, UVec2::new(1 << 20, 1)).unwrap_err();
    assert!(matches!(wide, Error::Capability { .. }), "{wide}");
}
