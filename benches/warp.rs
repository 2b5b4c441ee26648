//! Warping at 1920 x 1080: the filters by themselves, pre-images given, against copying as many
//! pixels one by one, and the whole with exact pre-images through a cage of 64 vertices.
//!
//! `cargo bench --bench warp`, or `-- filters` for the first of these, `-- dragged` for frames of a
//! dragged cage; `python3
//! benches/warp_peers.py` puts OpenCV beside them. CPU time / 2.

mod support;

use barymap::engine::{Backend, Engine, EngineOptions};
use barymap::mapping::plane::{
    Cage, CompositeMap, LivePartition, PartitionKind, PartitionOptions, PathKind, partition,
};
use barymap::models::polygons;
use barymap::picture::{Depth, Image, Pixels};
use barymap::progress::Quiet;
use barymap::tools::transfer::Encoding;
use barymap::tools::warp::band::Band;
use barymap::tools::warp::footprint::{Footprint, Footprints, Seen};
use barymap::tools::warp::gpu::warp_image;
use barymap::tools::warp::pyramid::Pyramid;
use barymap::tools::warp::store::{Colors, gather_and_store};
use barymap::tools::warp::{DevicePreview, Filter, Preview, WarpOptions, warp_picture};
use glam::{DVec2, UVec2};
use support::{Result, best, once};

const WIDTH: usize = 1920;
const HEIGHT: usize = 1080;
const MIDDLE: DVec2 = DVec2::new(960.0, 540.0);

fn noise(channels: u32, depth: Depth) -> Result<Image> {
    let mut image = Image::zeros(WIDTH as u32, HEIGHT as u32, channels, depth)?;
    let value = |i: usize| i.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40;
    match &mut image.pixels {
        Pixels::U8(v) => v.iter_mut().enumerate().for_each(|(i, s)| *s = value(i) as u8),
        Pixels::U16(v) => v.iter_mut().enumerate().for_each(|(i, s)| *s = value(i) as u16),
        Pixels::F32(v) => v.iter_mut().enumerate().for_each(|(i, s)| *s = (value(i) & 0xffff) as f32 / 65535.0),
    }
    Ok(image)
}

/// Waves of ten pixels, as `warp_peers.py` has them, on a picture reduced `zoom` times.
fn footprints(band: Band, zoom: f32, filter: Filter) -> (Vec<[i32; 2]>, Footprints) {
    let mut all = Footprints::new(band.len(), filter.averages());
    let mut bases = Vec::new();
    for place in band.places() {
        bases.push([place.x as i32, (band.first + place.y) as i32]);
        for j in 0..place.height {
            for i in 0..place.width {
                let (x, y) = ((place.x + i) as f32 + 0.5, (band.first + place.y + j) as f32 + 0.5);
                let at = [
                    960.0 + (x + 10.0 * (0.02 * y).sin() - 960.0) * zoom - place.x as f32,
                    540.0 + (y + 10.0 * (0.02 * x).cos() - 540.0) * zoom - (band.first + place.y) as f32,
                ];
                let footprint = Footprint {
                    at,
                    dx: [zoom, -0.2 * (0.02 * x).sin() * zoom],
                    dy: [0.2 * (0.02 * y).cos() * zoom, zoom],
                    cover: 1.0,
                };
                all.set(place.start + j * place.width + i, footprint);
            }
        }
    }
    (bases, all)
}

/// The least time of a few rounds over all bands of a picture, whose pre-images are made before the
/// clock runs: as in a warp, they are fresh when they are used.
fn by_bands(zoom: f32, filter: Filter, mut job: impl FnMut(Band, &[[i32; 2]], Seen<'_>)) -> f64 {
    const ROWS: usize = 135;
    let mut sum = 0.0;
    for first in (0..HEIGHT).step_by(ROWS) {
        let band = Band { first, rows: ROWS, width: WIDTH };
        let (bases, all) = footprints(band, zoom, filter);
        let mut least = f64::INFINITY;
        for _ in 0..20 {
            let ((), spent) = once(|| job(band, &bases, all.seen()));
            least = least.min(spent.per_item(WIDTH * HEIGHT));
        }
        sum += least;
    }
    sum
}

fn filters() -> Result<()> {
    let pixels = WIDTH * HEIGHT;
    println!("| picture | filter | reduced | Mpixel/s, CPU / 2 | ns per pixel | filter alone |");
    println!("|---|---|---|---|---|---|");
    let kinds = [("u8x3", 3, Depth::U8), ("u8x4", 4, Depth::U8), ("u16x4", 4, Depth::U16), ("f32x4", 4, Depth::F32)];
    for (name, channels, depth) in kinds {
        let image = noise(channels, depth)?;
        let pyramid = Pyramid::new(&image, Encoding::default())?;
        let mut out = Image::zeros(WIDTH as u32, HEIGHT as u32, channels, depth)?;
        let mut colors = vec![[0.0; 4]; pixels];
        let copy = best(5, || {
            for y in 0..HEIGHT as u32 {
                for x in 0..WIDTH as u32 {
                    for c in 0..channels {
                        out.set(x, y, c, image.get(x, y, c));
                    }
                }
            }
            Ok(())
        })?;
        println!(
            "| {name} | copied one by one | 1 | {:.1} | {:.1} | |",
            1e3 / copy.per_item(pixels),
            copy.per_item(pixels)
        );
        use Filter::{Bilinear, Ewa, Lanczos, Lanczos4};
        for (filter, zoom) in [(Bilinear, 1.0), (Lanczos, 1.0), (Lanczos4, 1.0), (Ewa, 1.0), (Ewa, 3.0)] {
            let alone = by_bands(zoom, filter, |band, bases, seen| {
                band.gather(&pyramid, filter, bases, seen, &mut colors[..band.len()]);
            });
            let ns = by_bands(zoom, filter, |band, bases, seen| {
                gather_and_store(&pyramid, filter, bases, &Colors { band, seen, keep: None }, &mut out);
            });
            println!("| {name} | {} | {zoom} | {:.1} | {ns:.1} | {alone:.1} |", filter.word(), 1e3 / ns);
        }
    }
    Ok(())
}

fn on_a_device() -> Result<()> {
    let Ok(engine) = Engine::new(EngineOptions { backend: Backend::Gpu, ..EngineOptions::default() }) else {
        println!("no adapter: the kernel is not timed");
        return Ok(());
    };
    let Some(gpu) = engine.gpu() else { return Ok(()) };
    println!("\n{}: one band of 128 rows, u8x3, both ways over the bus included", engine.description());
    println!("| filter | first dispatch, wall ms | ns per pixel, CPU / 2 |");
    println!("|---|---|---|");
    let image = noise(3, Depth::U8)?;
    let pyramid = Pyramid::new(&image, Encoding::default())?;
    let band = Band { first: 0, rows: 128, width: WIDTH };
    let mut colors = vec![[0.0; 4]; band.len()];
    for filter in [Filter::Bilinear, Filter::Lanczos, Filter::Ewa] {
        let (bases, all) = footprints(band, 1.0, filter);
        let (done, first) = once(|| warp_image(gpu, &pyramid, filter, band, &bases, all.seen(), &mut colors));
        done?;
        let spent = best(5, || {
            warp_image(gpu, &pyramid, filter, band, &bases, all.seen(), &mut colors)?;
            Ok(())
        })?;
        println!("| {} | {:.0} | {:.1} |", filter.word(), 1e3 * first.wall, spent.per_item(band.len()));
    }
    Ok(())
}

/// A star of 64 vertices that fills the picture and turns.
fn whole() -> Result<()> {
    let star = |turn: f64| -> Vec<Vec<DVec2>> {
        let at = |k: usize| {
            let r = if k.is_multiple_of(2) { 520.0 } else { 380.0 };
            let (s, c) =
                f64::sin_cos(std::f64::consts::TAU * k as f64 / 64.0 + if k.is_multiple_of(2) { turn } else { 0.0 });
            DVec2::new(960.0 + 1.6 * r * c, 540.0 + r * s)
        };
        vec![(0..64).map(at).collect()]
    };
    let cage = Cage::new(star(0.0), star(0.08))?;
    let options =
        PartitionOptions { kind: PartitionKind::Uniform(9), path: PathKind::Linear, ..PartitionOptions::default() };
    let image = noise(3, Depth::U8)?;
    println!("\n1920 x 1080, 64 vertices, 9 steps, exact pre-images, ewa; seconds of CPU time / 2");
    println!("| back end | smallest Jacobians, 9 steps | whole warp | pre-images | filter and store |");
    println!("|---|---|---|---|---|");
    for backend in [Backend::Cpu, Backend::Gpu] {
        let Ok(engine) = Engine::new(EngineOptions { backend, ..EngineOptions::default() }) else { continue };
        let (found, search) = once(|| partition(&engine, &cage, &options, &Quiet));
        let map = CompositeMap::new(options.coordinates, found?.polygons)?;
        let (warped, spent) = once(|| warp_picture(&engine, &image, &map, &WarpOptions::default(), &Quiet));
        let stages = warped?.stats.stages;
        let stage = |name: &str| {
            let time = stages.iter().find(|s| s.name == name).and_then(|s| s.cpu_seconds);
            time.map_or("".into(), |t| format!("{:.2}", t / 2.0))
        };
        println!(
            "| {} | {:.2} | {:.2} | {} | {} |",
            engine.description().backend,
            search.cpu / 2.0,
            spent.cpu / 2.0,
            stage("preimages"),
            stage("filter")
        );
    }
    Ok(())
}

/// Dragging: the map at the nodes of the lattice again, and a frame from them, against the frame
/// with exact pre-images.
fn preview() -> Result<()> {
    let star = |turn: f64| -> Vec<Vec<DVec2>> {
        vec![
            polygons::star(64, &[1.0], turn, DVec2::ZERO)
                .iter()
                .map(|v| *v * DVec2::new(860.0, 500.0) + MIDDLE)
                .collect(),
        ]
    };
    let cage = Cage::new(star(0.0), star(0.5))?;
    let options =
        PartitionOptions { kind: PartitionKind::Uniform(9), path: PathKind::Linear, ..PartitionOptions::default() };
    let image = noise(3, Depth::U8)?;
    println!("\n1920 x 1080, 64 vertices, 9 steps, a preview; milliseconds of CPU time / 2");
    println!("| back end | nodes | lattice again | picture from it | both | exact, bilinear / both |");
    println!("|---|---|---|---|---|---|");
    for backend in [Backend::Cpu, Backend::Gpu] {
        let Ok(engine) = Engine::new(EngineOptions { backend, ..EngineOptions::default() }) else { continue };
        let map = CompositeMap::new(options.coordinates, partition(&engine, &cage, &options, &Quiet)?.polygons)?;
        let mut preview = Preview::new(&engine, &image, &map, UVec2::new(WIDTH as u32, HEIGHT as u32))?;
        let lattice = best(7, || Ok(preview.drag(&engine, &map)?))?;
        let frame = best(7, || {
            preview.frame()?;
            Ok(())
        })?;
        let exact = WarpOptions { filter: Filter::Bilinear, ..WarpOptions::default() };
        let (done, spent) = once(|| warp_picture(&engine, &image, &map, &exact, &Quiet));
        done?;
        let ms = |cpu: f64| 500.0 * cpu;
        println!(
            "| {} | {} | {:.1} | {:.1} | {:.1} | {:.0} |",
            engine.description().backend,
            preview.lattice().points.len(),
            ms(lattice.cpu),
            ms(frame.cpu),
            ms(lattice.cpu + frame.cpu),
            spent.cpu / (lattice.cpu + frame.cpu)
        );
    }
    Ok(())
}

/// Frames of a dragged cage, the partition included, as a window of 1280 x 720 makes them.
fn dragged() -> Result<()> {
    let canvas = UVec2::new(1280, 720);
    let image = Image::from_fn(canvas.x, canvas.y, |x, y| [(x * 7) as u8, (y * 5) as u8, (x ^ y) as u8, 255])?;
    println!("\n1280 x 720, 5 steps, a dragged vertex; milliseconds of CPU time / 2 per frame");
    println!("| back end | vertices | partition | lattice | picture | frames/s |");
    println!("|---|---|---|---|---|---|");
    for backend in [Backend::Cpu, Backend::Gpu] {
        let Ok(engine) = Engine::new(EngineOptions { backend, ..EngineOptions::default() }) else { continue };
        for vertices in [64, 200] {
            let star = |turn: f64, pull: f64| -> Vec<Vec<DVec2>> {
                let mut ring = polygons::star(vertices, &[1.0], turn, DVec2::ZERO);
                ring[0] *= pull;
                vec![ring.iter().map(|v| *v * DVec2::new(570.0, 330.0) + canvas.as_dvec2() / 2.0).collect()]
            };
            let options = PartitionOptions {
                kind: PartitionKind::Uniform(5),
                path: PathKind::Linear,
                ..PartitionOptions::default()
            };
            let cage = |frame: usize| Cage::new(star(0.0, 1.0), star(0.3, 1.0 - 0.002 * frame as f64));
            let mut live = LivePartition::new(&engine, &cage(0)?, &options, &Quiet)?;
            let mut made = |frame: usize| -> Result<CompositeMap> {
                Ok(CompositeMap::new(options.coordinates, live.drag(&cage(frame)?)?.polygons.clone())?)
            };
            let mut preview = Preview::new(&engine, &image, &made(0)?, canvas)?;
            let mut spent = [0.0; 3];
            for frame in 0..FRAMES {
                let (map, a) = once(|| made(frame));
                let map = map?;
                let (moved, b) = once(|| preview.drag(&engine, &map));
                moved?;
                let (shown, c) = once(|| preview.frame());
                shown?;
                [a, b, c].iter().zip(&mut spent).for_each(|(t, s)| *s += 500.0 * t.cpu / FRAMES as f64);
            }
            let [a, b, c] = spent;
            let backend = engine.description().backend.clone();
            println!("| {backend} | {vertices} | {a:.1} | {b:.1} | {c:.1} | {:.1} |", 1e3 / (a + b + c));
            let Some(gpu) = engine.gpu() else { continue };
            let mut drawn = DevicePreview::new(&engine, &image, &made(0)?, canvas)?;
            gpu.wait(&drawn.draw(&made(0)?)?)?;
            let mut spent = [0.0; 2];
            for frame in 0..FRAMES {
                let (map, a) = once(|| made(frame));
                let map = map?;
                let (shown, b) = once(|| drawn.draw(&map).and_then(|submission| gpu.wait(&submission)));
                shown?;
                [a, b].iter().zip(&mut spent).for_each(|(t, s)| *s += 500.0 * t.cpu / FRAMES as f64);
            }
            let [a, b] = spent;
            println!("| {backend}, canvas too | {vertices} | {a:.1} | | {b:.1} | {:.1} |", 1e3 / (a + b));
        }
    }
    Ok(())
}

/// Frames of a drag.
const FRAMES: usize = 20;

fn main() -> Result<()> {
    let only = |part: &str| std::env::args().any(|word| word == part);
    if only("dragged") {
        return dragged();
    }
    filters()?;
    if only("filters") {
        return Ok(());
    }
    on_a_device()?;
    whole()?;
    preview()?;
    dragged()
}
