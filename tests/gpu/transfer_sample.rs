//! The kernel `sample_texture` against its reference, and whole transfers where the device runs all
//! stages.

use barymap::engine::{Backend, Engine, EngineOptions, Gpu};
use barymap::geometry::{Material, Mesh, MeshBuilder, NONE, Wrap};
use barymap::picture::{Depth, Image, Pixels};
use barymap::progress::Quiet;
use barymap::surface::Status;
use barymap::tools::transfer::footprint::Footprint;
use barymap::tools::transfer::gpu::{DeviceTexture, Sampler};
use barymap::tools::transfer::mip::MipChain;
use barymap::tools::transfer::sample::{SampleParams, sample_texture};
use barymap::tools::transfer::{
    Alpha, Background, Encoding, Filter, Layer, LayerKind, Pyramids, TransferOptions, TransferOutput, memory_needed,
    transfer, transfer_on, transfer_with,
};
use glam::DVec2;

use crate::common::flat::{Planar, Random, grid, noise};
use crate::{devices, downlevel, engine};

const EPSILON: f64 = f32::EPSILON as f64;

/// Noise in any depth; floats to 100.
pub(crate) fn picture(width: u32, height: u32, channels: u32, depth: Depth, r: &mut Random) -> Image {
    let count = (width * height * channels) as usize;
    let pixels = match depth {
        Depth::U8 => Pixels::U8((0..count).map(|_| r.next() as u8).collect()),
        Depth::U16 => Pixels::U16((0..count).map(|_| r.next() as u16).collect()),
        Depth::F32 => Pixels::F32((0..count).map(|_| (100.0 * r.unit()) as f32).collect()),
    };
    Image::new(width, height, channels, pixels).unwrap()
}

/// Footprints of all sizes and shapes on a picture, near and far, and some that mean nothing.
fn footprints(image: &Image, count: usize, r: &mut Random) -> Vec<Footprint> {
    let size = [f64::from(image.width), f64::from(image.height)];
    let vector = |r: &mut Random| {
        let length = (r.unit() * 11.0 - 3.0).exp2();
        let (x, y) = (r.unit() - 0.5, r.unit() - 0.5);
        let scale = length / x.hypot(y).max(1e-3);
        [(x * scale / size[0]) as f32, (y * scale / size[1]) as f32]
    };
    let mut found: Vec<Footprint> = (0..count)
        .map(|i| {
            let centre = [(r.unit() * 7.0 - 3.0) as f32, (r.unit() * 7.0 - 3.0) as f32];
            let (dx, dy) = (vector(r), vector(r));
            // Triangle 0 has this texture, triangle 1 another one.
            let face = if i % 11 == 5 { NONE } else { u32::from(i % 13 == 7) };
            Footprint { centre, dx, dy, face }
        })
        .collect();
    let odd = [
        ([0.0; 2], [0.0; 2], [0.0; 2]),
        ([0.5; 2], [1e30; 2], [0.0; 2]),
        ([0.5; 2], [f32::NAN, 0.0], [0.0, 1.0]),
        ([0.25, 0.75], [f32::INFINITY, 0.0], [0.0, 1.0]),
        ([1e7, -1e7], [1e-3; 2], [1e-3, -1e-3]),
        ([0.999_999_94, 0.0], [1e-4, 0.0], [0.0, 1e-4]),
    ];
    for (f, (centre, dx, dy)) in found.iter_mut().zip(odd) {
        *f = Footprint { centre, dx, dy, face: 0 };
    }
    found
}

/// What rounding may do to a colour: the error allowed, in the range of the samples, and whether
/// the filter is about to decide otherwise (number of taps, level).
fn allowed(f: &Footprint, chain: &MipChain<'_>, params: &SampleParams) -> (f64, bool) {
    let image = chain.image;
    let size = [f64::from(image.width), f64::from(image.height)];
    let scaled = |v: [f32; 2]| [f64::from(v[0]) * size[0], f64::from(v[1]) * size[1]];
    let (dx, dy) = (scaled(f.dx), scaled(f.dy));
    let (a, b, c) = (dx[0] * dx[0] + dy[0] * dy[0], dx[0] * dx[1] + dy[0] * dy[1], dx[1] * dx[1] + dy[1] * dy[1]);
    let root = (0.25 * (a - c) * (a - c) + b * b).sqrt();
    let wide = (0.5 * (a + c) + root).sqrt();
    let narrow = (dx[0] * dy[1] - dx[1] * dy[0]).abs() / wide;
    let slack = 1.0 / 64.0;
    let step = (0.5 * narrow).max(wide / f64::from(params.taps)).max(1.0);
    // A few roundings of sums of squares, and of the determinant's products.
    let near = |x: f64, limit: f64, scale: f64| (x - limit).abs() <= 16.0 * EPSILON * scale.max(1.0);
    // Repeats are taken to the picture, mirrored ones to it and the next; a picture that ends is
    // left where the footprint lies.
    let sides = [0, 1].map(|a| match chain.wrap[a] {
        Wrap::Repeat => size[a],
        Wrap::Mirror => 2.0 * size[a],
        Wrap::Clamp => size[a] * f64::from(f.centre[a].abs()).clamp(1.0, 1000.0),
    });
    let places = 4.0 * EPSILON * (sides[0].max(sides[1]) + 1.0);
    // Places are sums of the centre in texels and of offsets along the axes, which turn by the
    // rounding of sums of squares: any axis will do for an ellipse that is almost round.
    let turn = (4.0 * EPSILON * wide * wide / root.max(f64::MIN_POSITIVE)).min(1.0);
    match params.filter {
        Filter::Nearest => {
            // The texel is that of either side of an edge.
            let near = |a: usize| {
                let x = f64::from(f.centre[a]) * size[a];
                (x - x.round()).abs() <= places
            };
            return (32.0 * EPSILON, near(0) || near(1));
        }
        Filter::Lanczos | Filter::Lanczos4 => return (windowed_error(params.filter, places), false),
        Filter::Ewa => {
            let share = (wide - (1.0 + slack)) / (1.5 - (1.0 + slack));
            let (wide, narrow) = (wide.max(1.0), narrow.max(1.0).max(wide / 16.0));
            // The level is chosen by halvings of the narrow side, which is a difference of
            // products over the wide one.
            let ratio = wide / narrow;
            let rounds = 16.0 * EPSILON * ratio;
            let halvings = (narrow / 3.0).log2();
            let decides = narrow >= 2.9 && (halvings - halvings.round()).abs() <= 4.0 * rounds;
            // On the border of the ellipse the form is 1 by terms of up to the square of the
            // ratio, which hold the rounding of the axis and of the widths; the kernel's mean
            // changes by less than six times as much. A step of the place is one of less than two
            // thirds of the radius.
            let form = (8.0 * rounds + 2.0 * turn) * ratio * ratio;
            let averaged = 6.0 * form + 4.0 * places + 256.0 * EPSILON;
            let mixed = if share < 1.0 { windowed_error(Filter::Lanczos, places) + 8.0 * rounds } else { 0.0 };
            return (if share > 0.0 { averaged.min(2.0) } else { 0.0 } + mixed, decides);
        }
        Filter::Anisotropic | Filter::Trilinear | Filter::Bilinear => {}
    }
    let level = match params.filter {
        Filter::Trilinear => wide.max(1.0).log2(),
        Filter::Anisotropic => step.log2(),
        _ => 0.0,
    };
    // WGSL promises log2 to 2^-21, or three units in the last place.
    let log = 4.0 * 2.0_f64.powi(-20);
    let along = (wide / step - slack).fract();
    let decides = match params.filter {
        Filter::Bilinear => false,
        _ if near(wide, 1.0 + slack, 1.0) => true,
        _ if (level.fract() - slack).abs() <= log => true,
        Filter::Anisotropic => {
            near(along.min(1.0 - along), 0.0, wide / step) || near(narrow / step, 1.0 + slack, wide / step)
        }
        _ => false,
    };
    let offsets =
        if params.filter == Filter::Anisotropic { turn * (wide - narrow) + 4.0 * EPSILON * wide } else { 0.0 };
    // From texel to texel a colour may change by all of its range, along either axis, at the level
    // it is read from.
    let colour = 2.0 * (places + offsets / step);
    (colour + 2.0 * log + 32.0 * EPSILON, decides)
}

/// Of the mean of n x n texels weighed by windowed sincs: each weight is off by 2e-6 of the
/// reference's table and 4e-7 of the kernel's series; a step of the place changes all of an axis by
/// less than four; the weights of the other axis sum up to less than 1.3 without their signs.
fn windowed_error(filter: Filter, places: f64) -> f64 {
    let n = if filter == Filter::Lanczos { 6.0 } else { 8.0 };
    2.0 * 1.3 * (n * 2.4e-6 + 4.0 * places) + 64.0 * EPSILON
}

/// How two sets of colours differ.
#[derive(Debug, Default)]
struct Comparison {
    same: usize,
    decided: usize,
    worst: f64,
}

/// Compares colours, `channels` per footprint, of a picture whose samples reach to `range`.
fn compare(
    chain: &MipChain<'_>,
    params: &SampleParams,
    range: f64,
    footprints: &[Footprint],
    expected: &[f32],
    found: &[f32],
) -> Result<Comparison, String> {
    let mut c = Comparison::default();
    let n = params.channels as usize;
    for (i, f) in footprints.iter().enumerate() {
        let (e, g) = (&expected[i * n..(i + 1) * n], &found[i * n..(i + 1) * n]);
        let equal = |(a, b): (&f32, &f32)| a == b || (a.is_nan() && b.is_nan());
        if e.iter().zip(g).all(equal) {
            c.same += 1;
            continue;
        }
        let (allowed, decides) = allowed(f, chain, params);
        if f.face != 0 || !allowed.is_finite() {
            return Err(format!("footprint {i}, {f:?}: {g:?}, expected {e:?}"));
        }
        if decides {
            c.decided += 1;
            continue;
        }
        for (a, b) in e.iter().zip(g) {
            let off = f64::from((a - b).abs()) / range;
            if !(off <= allowed) {
                return Err(format!("footprint {i}, {f:?}: {g:?}, expected {e:?}, {:e} are allowed", allowed * range));
            }
            c.worst = c.worst.max(off);
        }
    }
    // Random footprints seldom lie on the edge of a decision.
    if c.decided * 100 > footprints.len() { Err(format!("{c:?} of {}", footprints.len())) } else { Ok(c) }
}

/// Colours by the reference and by the kernel, and how many the kernel left.
fn both(gpu: &Gpu, chain: &MipChain<'_>, params: &SampleParams, footprints: &[Footprint]) -> (Vec<f32>, Vec<f32>, u64) {
    // Triangle 1 has another texture.
    let texture_of = [params.texture, params.texture + 1];
    let mut expected = vec![-1.0; footprints.len() * params.channels as usize];
    let mut found = expected.clone();
    sample_texture(chain, params, &texture_of, footprints, &mut expected);
    let mut sampler = Sampler::new(gpu).unwrap();
    let texture = sampler.texture(chain, params.filter, params.taps).unwrap();
    sampler.sample(&texture, chain, params, &texture_of, footprints, &mut found).unwrap();
    (expected, found, sampler.left_to_reference())
}

const FILTERS: [Filter; 7] = [
    Filter::Anisotropic,
    Filter::Trilinear,
    Filter::Bilinear,
    Filter::Nearest,
    Filter::Lanczos,
    Filter::Lanczos4,
    Filter::Ewa,
];

#[test]
fn colours_are_the_reference_s() {
    let mut r = Random(5);
    let (mut same, mut count, mut decided, mut worst) = (0, 0, 0, 0.0_f64);
    for gpu in devices() {
        for (k, (w, h)) in [(1, 1), (2, 1), (3, 5), (17, 33), (64, 64), (100, 3)].into_iter().enumerate() {
            for channels in 1..=4 {
                for (d, depth) in [Depth::U8, Depth::U16, Depth::F32].into_iter().enumerate() {
                    let image = picture(w, h, channels, depth, &mut r);
                    let encoding = Encoding {
                        linear_light: (k + d) % 2 == 0,
                        alpha: if (k + channels as usize).is_multiple_of(3) { Alpha::Data } else { Alpha::Opacity },
                    };
                    let modes = [Wrap::Repeat, Wrap::Clamp, Wrap::Mirror];
                    let wrap = [modes[(k + d) % 3], modes[(k + channels as usize) % 3]];
                    let chain = MipChain { wrap, ..MipChain::new(&image, encoding).unwrap() };
                    let widened = (channels..=4).filter(|&c| c == channels || c == 4 || c == channels + 1);
                    for (turn, (wide, taps)) in widened.zip([16, 1, 5]).enumerate() {
                        let filter = FILTERS[(3 * k + d + channels as usize + 2 * turn) % FILTERS.len()];
                        // Colour is not made grey.
                        if (channels, wide) == (2, 3) {
                            continue;
                        }
                        let params = SampleParams { filter, taps, channels: wide, texture: 3 };
                        let places = footprints(&image, 300, &mut r);
                        let (expected, found, left) = both(gpu, &chain, &params, &places);
                        let range = if depth == Depth::F32 { 100.0 } else { 1.0 };
                        // Opacity multiplies floats with one another.
                        let range = if image.has_alpha() { range * range } else { range };
                        let c = compare(&chain, &params, range, &places, &expected, &found).unwrap_or_else(|e| {
                            panic!("{w} x {h} x {channels} {depth:?} {encoding:?} {params:?}: {e}")
                        });
                        assert!(left <= 5, "{left} left to the reference");
                        (same, count, decided) = (same + c.same, count + places.len(), decided + c.decided);
                        worst = worst.max(c.worst);
                    }
                }
            }
        }
    }
    eprintln!("{same} of {count} equal to the bit, {decided} on the edge of a decision, others within {worst:e}");
}

#[test]
fn more_footprints_than_a_dispatch_takes() {
    let Some(gpu) = engine().and_then(Engine::gpu) else { return };
    let mut r = Random(8);
    let image = picture(200, 130, 3, Depth::U8, &mut r);
    let chain = MipChain::new(&image, Encoding::default()).unwrap();
    let params = SampleParams { filter: Filter::Anisotropic, taps: 16, channels: 4, texture: 0 };
    let places = footprints(&image, 300_001, &mut r);
    let (expected, found, _) = both(gpu, &chain, &params, &places);
    eprintln!("{:?}", compare(&chain, &params, 1.0, &places, &expected, &found).unwrap());
    // None at all.
    let (expected, found, _) = both(gpu, &chain, &params, &[]);
    assert!(expected.is_empty() && found.is_empty());
}

#[test]
fn the_comparison_of_colours_finds_wrong_ones() {
    let mut r = Random(9);
    let image = picture(40, 40, 4, Depth::U8, &mut r);
    let chain = MipChain::new(&image, Encoding::default()).unwrap();
    let params = SampleParams { filter: Filter::Anisotropic, taps: 16, channels: 4, texture: 0 };
    let places = footprints(&image, 200, &mut r);
    let mut good = vec![0.0; 800];
    sample_texture(&chain, &params, &[0, 1], &places, &mut good);
    let check = |colors: &[f32]| compare(&chain, &params, 1.0, &places, &good, colors);
    assert_eq!(check(&good).unwrap().same, 200);
    let plain =
        places.iter().enumerate().skip(10).find(|(_, f)| f.face == 0 && !allowed(f, &chain, &params).1).unwrap().0;
    let none = places.iter().position(|f| f.face == NONE).unwrap();
    for (at, wrong) in [(plain, good[4 * plain] + 1e-3), (plain, f32::NAN), (none, 0.5)] {
        let mut bad = good.clone();
        bad[4 * at] = wrong;
        assert!(check(&bad).is_err(), "{wrong} at {at}");
    }
    // Another filter, a texel further, fewer taps.
    for other in [
        SampleParams { filter: Filter::Trilinear, ..params },
        SampleParams { filter: Filter::Bilinear, ..params },
        SampleParams { taps: 4, ..params },
        SampleParams { filter: Filter::Nearest, ..params },
        SampleParams { filter: Filter::Lanczos, ..params },
        SampleParams { filter: Filter::Lanczos4, ..params },
        SampleParams { filter: Filter::Ewa, ..params },
    ] {
        let mut bad = vec![0.0; 800];
        sample_texture(&chain, &other, &[0, 1], &places, &mut bad);
        assert!(check(&bad).is_err(), "{other:?}");
    }
    let mut moved = places.clone();
    moved.iter_mut().for_each(|f| f.centre[0] += 1.0 / 4000.0);
    let mut bad = vec![0.0; 800];
    sample_texture(&chain, &params, &[0, 1], &moved, &mut bad);
    assert!(check(&bad).is_err(), "a hundredth of a texel");
}

/// A source with a curved map onto it, some of it doubtful or failed, and coordinates that repeat.
struct Scene {
    source: Mesh,
    target: Mesh,
    images: Vec<Image>,
}

impl Scene {
    fn new() -> Self {
        let plain = grid(5, 0.6, 1);
        // Two materials, and texture coordinates over several repeats.
        let mut builder = MeshBuilder::new("two materials");
        builder.mesh.materials = vec![Material::default(); 2];
        builder.mesh.positions = plain.positions.clone();
        builder.mesh.texcoords = plain.texcoords.clone();
        for t in 0..plain.triangle_count() {
            builder.material = (t % 2) as u32;
            builder.polygon(plain.triangle_corners(t));
        }
        let mut source = builder.build().unwrap();
        for uv in &mut source.texcoords {
            *uv = *uv * 2.5 - 0.7;
        }
        let mut target = grid(8, 0.8, 2);
        for uv in &mut target.texcoords {
            *uv = *uv * 0.9 + DVec2::new(0.3, -0.2);
        }
        let mut r = Random(4);
        let images = vec![
            noise(64, 48, 3, 3),
            noise(31, 31, 4, 4),
            picture(50, 20, 1, Depth::U16, &mut r),
            picture(16, 16, 3, Depth::F32, &mut r),
        ];
        Self { source, target, images }
    }

    fn layers(&self) -> Vec<Layer<'_>> {
        let of = |name: &str, images: &[usize]| Layer {
            name: name.into(),
            images: images.iter().map(|&i| &self.images[i]).collect(),
            material_texture: (0..images.len() as u32).collect(),
            default_texture: NONE,
            // As tiles: these pictures end at their borders.
            placements: Vec::new(),
            vertices: None,
            face_texture: (name == "rough").then(|| (0..self.source.triangle_count() as u32).map(|t| t % 2).collect()),
            encoding: Encoding { linear_light: images.len() == 2, ..Encoding::default() },
            kind: LayerKind::Color,
        };
        vec![of("colour", &[0, 1]), of("rough", &[2, 2]), Layer::single("light", &self.images[3])]
    }

    fn run(&self, engine: &Engine, options: &TransferOptions) -> barymap::Result<TransferOutput> {
        self.run_with(&Pyramids::new(engine), options)
    }

    fn run_with<'a>(&'a self, pyramids: &Pyramids<'a>, options: &TransferOptions) -> barymap::Result<TransferOutput> {
        let map = Planar {
            source: &self.source,
            target: &self.target,
            function: |p: DVec2| {
                let status = match p.x + p.y {
                    s if s > 1.6 => Status::Failed,
                    s if s > 1.2 => Status::Doubtful,
                    _ => Status::Valid,
                };
                (DVec2::new(0.1 + 0.7 * p.y, 0.9 - 0.8 * p.x * p.x), status)
            },
        };
        transfer_with(pyramids, &self.source, &self.layers(), &self.target, &map, options, &Quiet)
    }
}

/// Whether two transfers are the same but for the rounding of colours: integers by one step on the
/// edge between two.
pub(crate) fn same_transfer(a: &TransferOutput, b: &TransferOutput) -> Result<(), String> {
    if a.coverage != b.coverage {
        return Err("coverage differs".into());
    }
    let counts = |t: &TransferOutput| {
        let s = &t.stats;
        [s.texels, s.covered, s.covered_centre, s.overlapping, s.valid, s.doubtful, s.colorless, s.padded]
    };
    if counts(a) != counts(b) || a.stats.valid_fraction != b.stats.valid_fraction {
        return Err(format!("{:?}, expected {:?}", counts(b), counts(a)));
    }
    for (layer, (x, y)) in a.layers.iter().zip(&b.layers).enumerate() {
        if (x.width, x.height, x.channels, x.depth()) != (y.width, y.height, y.channels, y.depth()) {
            return Err(format!("layer {layer} has another format"));
        }
        let steps = match x.depth() {
            Depth::U8 => 255.0,
            Depth::U16 => 65535.0,
            Depth::F32 => 1.0,
        };
        let mut apart = 0;
        for i in 0..x.pixels.len() {
            let off = f64::from((x.sample(i) - y.sample(i)).abs()) * steps;
            // One step of integers; floats to 100 within the error of the logarithm times that.
            let most = if x.depth() == Depth::F32 { 1e-3 } else { 1.01 };
            if !(off <= most) {
                return Err(format!("layer {layer}, sample {i}: {} and {}", x.sample(i), y.sample(i)));
            }
            apart += usize::from(off > 0.0);
        }
        // Rounding of 1e-6 shows in a step of 1/255 once in thousands, in one of 1/65535 more
        // often.
        let share = match x.depth() {
            Depth::U8 => 1000,
            Depth::U16 => 10,
            Depth::F32 => 1,
        };
        if apart * share > x.pixels.len() {
            return Err(format!("layer {layer}: {apart} samples of {} are a step apart", x.pixels.len()));
        }
    }
    Ok(())
}

#[test]
fn a_whole_transfer_is_the_same_on_a_device() {
    let scene = Scene::new();
    for (width, height, supersample, filter) in [
        (150, 130, 1, Filter::Anisotropic),
        (1, 1, 1, Filter::Anisotropic),
        (63, 65, 2, Filter::Anisotropic),
        (700, 600, 1, Filter::Trilinear),
        (129, 8, 3, Filter::Bilinear),
        (140, 90, 1, Filter::Ewa),
        (90, 140, 2, Filter::Lanczos),
        (91, 60, 1, Filter::Lanczos4),
        (80, 60, 1, Filter::Nearest),
    ] {
        let options = TransferOptions { width, height, supersample, filter, margin: 5, ..TransferOptions::default() };
        let expected = scene.run(&Engine::cpu(), &options).unwrap();
        assert!(expected.stats.device_stages.is_empty());
        for engine in [engine(), downlevel()].into_iter().flatten() {
            let found = scene.run(engine, &options).unwrap();
            assert_eq!(found.stats.device_stages, ["rasterize_atlas", "sample_texture", "pad_seams"]);
            assert_eq!(found.stats.notes, Vec::<String>::new());
            same_transfer(&expected, &found).unwrap_or_else(|e| panic!("{width} x {height}: {e}"));
        }
    }
}

#[test]
fn bands_and_repetition_do_not_show_on_a_device() {
    let Some(engine) = engine() else { return };
    let scene = Scene::new();
    let options = TransferOptions { width: 300, height: 200, ..TransferOptions::default() };
    let all = scene.run(engine, &options).unwrap();
    let again = scene.run(engine, &options).unwrap();
    assert_eq!((&all.layers, &all.coverage), (&again.layers, &again.coverage));
    // As little as keeps the device at work.
    let mut memory = memory_needed(&scene.source, &scene.layers(), &scene.target, &options) + (1 << 20);
    let banded = loop {
        let out = scene.run(engine, &TransferOptions { memory, ..options.clone() }).unwrap();
        if !out.stats.device_stages.is_empty() {
            break out;
        }
        assert!(out.stats.notes[0].contains("are allowed"), "{:?}", out.stats.notes);
        memory += 8 << 20;
        assert!(memory < 1 << 30, "the device is never used");
    };
    assert!(banded.stats.bands > 1 && banded.stats.memory <= memory);
    assert_eq!((&all.layers, &all.coverage), (&banded.layers, &banded.coverage));
}

#[test]
fn pictures_go_to_the_device_once_for_several_targets() {
    if engine().is_none() {
        return;
    }
    // Its own, so that nothing else is counted.
    let engine = Engine::new(EngineOptions { backend: Backend::Gpu, ..EngineOptions::default() }).unwrap();
    let scene = Scene::new();
    let options = TransferOptions { width: 90, height: 80, ..TransferOptions::default() };
    let pyramids = Pyramids::new(&engine);
    let counted = |options: &TransferOptions| {
        let before = engine.gpu().unwrap().traffic();
        let out = scene.run_with(&pyramids, options).unwrap();
        assert_eq!(out.stats.device_stages.len(), 3, "{:?}", out.stats.notes);
        (out, engine.gpu().unwrap().traffic() - before)
    };
    let (first, up) = counted(&options);
    let (second, again) = counted(&options);
    assert_eq!((&first.layers, &first.coverage), (&second.layers, &second.coverage));
    // Two layers read one picture twice: four pictures in all, whatever the target.
    assert_eq!(pyramids.count(), [4, 4]);
    let pictures: u64 = scene.images.iter().map(DeviceTexture::bytes).sum();
    assert!(up.bytes_up_once >= pictures + again.bytes_up_once, "{up:?}, then {again:?}, of {pictures}");
    assert!(again.allocations < up.allocations);
    // Another part or size of a target needs no other pyramid.
    let (_, other) = counted(&TransferOptions { width: 40, ..options.clone() });
    assert_eq!((other.bytes_up_once, pyramids.count()), (again.bytes_up_once, [4, 4]));
    let fresh = scene.run(&engine, &options).unwrap();
    assert_eq!((&first.layers, &first.coverage), (&fresh.layers, &fresh.coverage));
}

#[test]
fn single_stages_stay_on_the_cpu_where_asked() {
    let Some(shared) = engine() else { return };
    let scene = Scene::new();
    let options = TransferOptions { width: 90, height: 80, ..TransferOptions::default() };
    let expected = scene.run(shared, &options).unwrap();
    for stage in ["rasterize_atlas", "sample_texture", "pad_seams"] {
        let engine = Engine::new(EngineOptions {
            backend: Backend::Gpu,
            cpu_stages: vec![stage.into()],
            ..EngineOptions::default()
        })
        .unwrap();
        let found = scene.run(&engine, &options).unwrap();
        assert!(found.stats.device_stages.len() == 2 && !found.stats.device_stages.contains(&stage));
        same_transfer(&expected, &found).unwrap();
    }
}

#[test]
fn what_a_device_cannot_hold_is_done_on_the_cpu() {
    let Some(small) = downlevel() else { return };
    let mesh = grid(2, 0.3, 1);
    // One texel wider than the smallest devices' textures.
    let image = noise(2049, 2, 3, 1);
    let layers = [Layer::single("wide", &image)];
    let options = TransferOptions { width: 64, height: 64, ..TransferOptions::default() };
    let map = crate::common::flat::Identity;
    let out = transfer_on(small, &mesh, &layers, &mesh, &map, &options, &Quiet).unwrap();
    assert_eq!(out.stats.device_stages, ["rasterize_atlas", "pad_seams"]);
    assert!(out.stats.notes[0].contains("2049") && out.stats.notes[0].contains("2048"), "{:?}", out.stats.notes);
    let expected = transfer(&mesh, &layers, &mesh, &map, &options, &Quiet).unwrap();
    same_transfer(&expected, &out).unwrap();

    // A device with little memory, then with enough for some stages.
    let mut last = 0;
    for memory in [1 << 20, 8 << 20, 24 << 20, 1 << 30] {
        let options = EngineOptions { backend: Backend::Gpu, memory: Some(memory), ..EngineOptions::default() };
        let engine = Engine::new(options).unwrap();
        let scene = Scene::new();
        let options = TransferOptions { width: 200, height: 140, ..TransferOptions::default() };
        let out = scene.run(&engine, &options).unwrap();
        let (stages, notes) = (&out.stats.device_stages, &out.stats.notes);
        assert_eq!(stages.len() + notes.len(), 3, "{stages:?} {notes:?}");
        assert!(stages.len() >= last && notes.iter().all(|n| n.contains("on the CPU")), "{stages:?} {notes:?}");
        last = stages.len();
        same_transfer(&scene.run(&Engine::cpu(), &options).unwrap(), &out).unwrap();
        assert_eq!(engine.gpu().map(Gpu::memory_held), Some(0), "everything is given back");
    }
    assert_eq!(last, 3);
}

#[test]
fn the_comparison_of_transfers_finds_differences() {
    let scene = Scene::new();
    let options = TransferOptions {
        width: 64,
        height: 64,
        background: Background::Color([0.0; 4]),
        ..TransferOptions::default()
    };
    let good = scene.run(&Engine::cpu(), &options).unwrap();
    same_transfer(&good, &good).unwrap();
    let bytes = |image: &mut Image| match &mut image.pixels {
        Pixels::U8(v) => std::mem::take(v),
        _ => panic!("8 bits expected"),
    };
    let mut bad = good.clone();
    let mut v = bytes(&mut bad.layers[0]);
    v[500] = v[500].wrapping_add(2);
    bad.layers[0].pixels = Pixels::U8(v);
    assert!(same_transfer(&good, &bad).is_err());
    // A step everywhere is no rounding.
    let mut bad = good.clone();
    let v = bytes(&mut bad.layers[0]);
    bad.layers[0].pixels = Pixels::U8(v.into_iter().map(|x| x ^ 1).collect());
    assert!(same_transfer(&good, &bad).is_err());
    let mut bad = good.clone();
    let mut v = bytes(&mut bad.coverage);
    v[77] ^= 128;
    bad.coverage.pixels = Pixels::U8(v);
    assert!(same_transfer(&good, &bad).is_err());
    let mut bad = good.clone();
    bad.stats.padded += 1;
    assert!(same_transfer(&good, &bad).is_err());
}
