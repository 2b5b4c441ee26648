//! The stages of a warp that stays on a device, each against its reference, and the whole.

use barymap::engine::{Backend, DeviceLimits, Engine, EngineOptions, Gpu};
use barymap::geometry::Polygon;
use barymap::mapping::plane::{CompositeMap, Coordinates, Found, Leaf, Mapped, Maps, NOWHERE, PatchOptions, Patches};
use barymap::picture::Filter;
use barymap::picture::{Depth, Image, Pixels};
use barymap::progress::Quiet;
use barymap::tools::transfer::{Alpha, Encoding};
use barymap::tools::warp::band::Band;
use barymap::tools::warp::footprint::{Footprint, Footprints};
use barymap::tools::warp::gpu::picture::StoredPicture;
use barymap::tools::warp::gpu::pixels::{Finish, Finisher, PixelCounts, count_pixels};
use barymap::tools::warp::gpu::place::{LeftRecord, PlaceRecord, Placer, UNMAPPED};
use barymap::tools::warp::pyramid::{Pyramid, Window};
use barymap::tools::warp::store::{Colors, store};
use barymap::tools::warp::{Outside, WarpOptions, WarpOutput, warp_picture};
use glam::{DVec2, UVec2};

use super::{devices, downlevel, engine};

/// A rounding of single precision.
const UNIT: f32 = 1.0 / 16_777_216.0;

/// A star whose tips turn, in a picture of this size.
fn star(size: DVec2, turn: f64) -> Polygon {
    let at = |k: usize| {
        let (r, turn) = if k.is_multiple_of(2) { (0.48, turn) } else { (0.36, 0.0) };
        size * (DVec2::splat(0.5) + r * DVec2::from_angle(std::f64::consts::TAU * k as f64 / 24.0 + turn))
    };
    Polygon::from_loops(vec![(0..24).map(at).collect()])
}

fn turning(size: DVec2, turn: f64) -> CompositeMap {
    let polygons = (0..=3).map(|k| star(size, turn * f64::from(k) / 3.0)).collect();
    CompositeMap::new(Coordinates::MeanValue, polygons).unwrap()
}

/// A map on the CPU, in pixels.
struct OnCpu<'a>(&'a CompositeMap);

impl Maps for OnCpu<'_> {
    fn exact(&self, points: &[DVec2]) -> barymap::Result<Vec<Mapped>> {
        Ok(points.iter().map(|p| self.0.forward(*p)).collect())
    }
}

/// The most error of a pre-image times the derivative there that a warp of this size has.
fn tolerance(size: UVec2) -> f64 {
    4.8e-7 * f64::from(size.max_element())
}

fn patches(map: &CompositeMap, size: UVec2) -> Patches {
    let options = PatchOptions {
        cell: 64.0,
        tolerance: tolerance(size),
        worth: 8.0,
        canvas: [DVec2::ZERO, size.as_dvec2()],
        vertices: map.source().vertices().collect(),
        evaluations: 1 << 17,
    };
    Patches::new(DVec2::splat(-16.0), size.as_dvec2() + 16.0, &options, &OnCpu(map)).unwrap()
}

fn noise(width: u32, height: u32, channels: u32, depth: Depth) -> Image {
    let count = (width * height * channels) as usize;
    let value = |i: usize| (i.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40) as u32;
    let pixels = match depth {
        Depth::U8 => Pixels::U8((0..count).map(|i| value(i) as u8).collect()),
        Depth::U16 => Pixels::U16((0..count).map(|i| value(i) as u16).collect()),
        Depth::F32 => Pixels::F32((0..count).map(|i| (value(i) & 0xffff) as f32 / 65535.0).collect()),
    };
    Image::new(width, height, channels, pixels).unwrap()
}

fn read<T: bytemuck::Pod>(gpu: &Gpu, buffer: &barymap::engine::Buffer<T>) -> Vec<T> {
    gpu.read(buffer, 0..buffer.len()).unwrap()
}

#[test]
fn levels_are_those_of_the_host() {
    for gpu in devices() {
        for (k, (w, h)) in [(1, 1), (2, 1), (7, 5), (64, 64), (100, 3), (1, 37), (301, 203)].into_iter().enumerate() {
            let depth = [Depth::U8, Depth::U16, Depth::F32][k % 3];
            let image = noise(w, h, 1 + k as u32 % 4, depth);
            let encoding = Encoding { linear_light: k % 2 == 0, alpha: [Alpha::Opacity, Alpha::Data][k / 2 % 2] };
            let pyramid = Pyramid::new(&image, encoding).unwrap();
            let found = read(gpu, &StoredPicture::new(gpu, &image, encoding, true).unwrap().halvings);
            let mut expected = Vec::new();
            let mut window = Window::default();
            for level in 1..pyramid.levels() {
                let [columns, rows] = pyramid.size(level);
                pyramid.read(level, [0, 0], [columns as usize, rows as usize], &mut window);
                expected.extend_from_slice(&window.texels);
            }
            // Means of values up to 1. A device sums four terms with weights and divides, on nine
            // levels at most: 54 roundings. The host sums 64 pixels at once, and then the same: 63
            // and 36.
            let allowed = (54.0 + 63.0 + 36.0) * UNIT;
            let apart = |a: &[[f32; 4]], b: &[[f32; 4]]| {
                a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
            };
            assert_eq!(found.len(), expected.len().max(1));
            let worst = apart(&expected, &found);
            assert!(worst <= allowed, "{w} x {h}: {worst}");
            if let Some(texel) = expected.last_mut() {
                texel[0] += 2.0 * allowed;
                assert!(apart(&expected, &found) > allowed, "the comparison sees one texel");
            }
        }
    }
}

/// Places of the first rows of a canvas on a device, with their shares.
fn placed(
    gpu: &Gpu,
    patches: &Patches,
    size: UVec2,
    (first, rows): (usize, usize),
    cover: &[f32],
    left: &[LeftRecord],
) -> (Vec<PlaceRecord>, Vec<[f32; 2]>) {
    let mut placer = Placer::new(gpu, patches, size.into(), size.into(), rows, !cover.is_empty()).unwrap();
    placer.write(cover, left).unwrap();
    let mut batch = gpu.batch().unwrap();
    placer.record(&mut batch, first, rows).unwrap();
    batch.submit().unwrap();
    (read(gpu, &placer.places), read(gpu, &placer.shares))
}

#[test]
fn places_are_those_of_the_polynomials() {
    let size = UVec2::new(203, 118);
    let map = turning(size.as_dvec2(), 0.1);
    let patches = patches(&map, size);
    let (first, rows) = (16, 48);
    let band = UVec2::new(size.x, rows as u32);
    let (mut all, mut open) = (Found::default(), Found::default());
    patches.find(first, band, &mut all);
    patches.find_open(first, band, &mut open);
    // The polygon shows a slanted half, and parts of the pixels between.
    let cover: Vec<f32> = (0..rows * size.x as usize)
        .map(|i| ((i % size.x as usize + i / size.x as usize) as f32 / 4.0 - 30.0).clamp(0.0, 1.0))
        .collect();
    for gpu in devices() {
        for cover in [&[][..], &cover] {
            let (places, shares) = placed(gpu, &patches, size, (first, rows), cover, &[]);
            let (mut compared, mut worst) = (0, 0.0_f32);
            for (i, leaf) in all.leaf.iter().enumerate() {
                let share = cover.get(i).copied().unwrap_or(1.0);
                assert_eq!(shares[i][1], share);
                if share == 0.0 {
                    assert_eq!(shares[i][0], UNMAPPED);
                    continue;
                }
                // What depends on a rounding, and what has no polynomial, is the host's.
                if open.leaf[i] != NOWHERE || *leaf == NOWHERE {
                    continue;
                }
                let Leaf::Bounded(_) = &patches.leaves[*leaf as usize] else { panic!("{i} is open") };
                let leaf = &patches.leaves[*leaf as usize];
                let (solved, half) = (&all.solved[i], leaf.half());
                let expected = leaf.point(solved.at);
                let place = &places[i];
                let found = DVec2::new(
                    f64::from(place.whole[0]) + f64::from(place.part[0]),
                    f64::from(place.whole[1]) + f64::from(place.part[1]),
                );
                // Both keep the tolerance, so they are no farther apart than twice that; the least
                // stretch of this map is above 1 / 4.
                let off = ((found - expected).abs().max_element()) as f32;
                assert!(f64::from(off) <= 8.0 * tolerance(size), "{i}: {found} {expected}");
                worst = worst.max(off);
                for (slope, expected) in [(place.dx, solved.dx), (place.dy, solved.dy)] {
                    for c in 0..2 {
                        // Slopes are products of numbers of about 1 / half and half; the second
                        // derivative times the distance of two last corrections is far below.
                        let expected = half as f32 * expected[c];
                        assert!((slope[c] - expected).abs() <= 1e-4, "{i}: {} {expected}", slope[c]);
                    }
                }
                let sides = size.as_dvec2();
                if (expected.cmpgt(DVec2::splat(4.0)) & expected.cmplt(sides - 4.0)).all() {
                    assert_eq!(shares[i][0], share, "{i} sees the picture");
                }
                if (expected.cmplt(DVec2::splat(-4.0)) | expected.cmpgt(sides + 4.0)).any() {
                    assert_eq!(shares[i][0], 0.0, "{i} sees nothing");
                }
                compared += 1;
            }
            assert!(compared * 3 > all.leaf.len(), "{compared}");
            // The comparison would see a wrong term: displacements of the polynomials are larger.
            assert!(f64::from(worst) < 8.0 * tolerance(size));
        }
    }
}

#[test]
fn what_the_host_found_takes_its_place() {
    let size = UVec2::new(70, 40);
    let map = turning(size.as_dvec2(), 0.05);
    let patches = patches(&map, size);
    let record = |pixel: u32, share: f32| LeftRecord {
        pixel,
        share,
        place: PlaceRecord { whole: [-3, pixel as i32], part: [0.25, 0.5], dx: [1.0, 2.0], dy: [3.0, pixel as f32] },
    };
    for gpu in devices() {
        // None, one, and more than there is room for at first, in a canvas of any size.
        for count in [0, 1, 2800] {
            let left: Vec<LeftRecord> = (0..count).map(|k| record(2799 - k, (k % 3) as f32 - 1.0)).collect();
            let (places, shares) = placed(gpu, &patches, size, (0, 40), &[], &left);
            for l in &left {
                let i = l.pixel as usize;
                assert_eq!((places[i], shares[i]), (l.place, [l.share, 1.0]));
            }
            let (before, _) = placed(gpu, &patches, size, (0, 40), &[], &[]);
            let same = (0..2800 - count as usize).all(|i| places[i] == before[i]);
            assert!(same, "the others stay");
        }
    }
}

/// A band whose pixels are moved, turned, reduced and stretched, more towards the right, as the
/// host has it and as a device has it.
fn band(rows: usize, width: usize, strength: f32) -> (Band, Vec<[i32; 2]>, Footprints, Vec<LeftRecord>) {
    let band = Band { first: 0, rows, width };
    let mut seen = Footprints::new(band.len(), true);
    let (mut bases, mut left) = (Vec::new(), Vec::new());
    for place in band.places() {
        bases.push([place.x as i32, place.y as i32]);
        for j in 0..place.height {
            for i in 0..place.width {
                let (x, y) = ((place.x + i) as f32 + 0.5, (place.y + j) as f32 + 0.5);
                let s = 1.0 + strength * x / width as f32;
                let p =
                    [x * s + 5.0 * (0.1 * y).sin() - place.x as f32, y * s - 4.0 * (0.07 * x).cos() - place.y as f32];
                // To 1/256, so that the same number is held in both forms.
                let at = p.map(|v| (v * 256.0).round() / 256.0);
                let footprint = Footprint {
                    at,
                    dx: [s, 0.28 * (0.07 * x).sin()],
                    dy: [0.5 * (0.1 * y).cos() * s * 3.0, s],
                    cover: [1.0, 0.3, 0.0, 1.0, 1.0][(place.x + i + place.y + j) % 5],
                };
                seen.set(place.start + j * place.width + i, footprint);
                let whole = at.map(f32::floor);
                left.push(LeftRecord {
                    pixel: ((place.y + j) * width + place.x + i) as u32,
                    share: footprint.cover,
                    place: PlaceRecord {
                        whole: [place.x as i32 + whole[0] as i32, place.y as i32 + whole[1] as i32],
                        part: [at[0] - whole[0], at[1] - whole[1]],
                        dx: footprint.dx,
                        dy: footprint.dy,
                    },
                });
            }
        }
    }
    (band, bases, seen, left)
}

/// Patches of nothing, so that all places are given.
fn nothing() -> Patches {
    Patches { leaves: Vec::new(), evaluations: Default::default() }
}

#[test]
fn colours_samples_and_counts_are_the_references() {
    for gpu in devices() {
        for filter in [Filter::Bilinear, Filter::Lanczos, Filter::Ewa] {
            for (k, (rows, width, strength)) in
                [(8, 1, 0.0), (8, 63, 0.2), (16, 13, 1.0), (72, 97, 2.0), (40, 33, 30.0)].into_iter().enumerate()
            {
                for keeps in [false, true] {
                    let depth = [Depth::U8, Depth::U16, Depth::F32][k % 3];
                    let channels = 1 + k as u32 % 4;
                    let image = noise(60 + k as u32, 41, channels, depth);
                    let encoding = Encoding { linear_light: k % 2 == 1, ..Encoding::default() };
                    let wide = channels + u32::from(!image.has_alpha() && !keeps);
                    let pyramid = Pyramid::new(&image, encoding).unwrap();
                    let (band, bases, seen, left) = band(rows, width, strength);
                    let picture = StoredPicture::new(gpu, &image, encoding, filter == Filter::Ewa).unwrap();
                    let canvas = [width as u32, rows as u32];
                    // Half of what a pixel does not see is outside the polygon.
                    let share = |i: usize| seen.seen().cover()[band.index(i % width, i / width)];
                    let cover: Vec<f32> = (0..band.len()).map(|i| 0.5 + 0.5 * share(i)).collect();
                    let cover: Vec<f32> = cover.iter().map(|c| if *c == 0.5 { 0.0 } else { *c }).collect();
                    let mut placer =
                        Placer::new(gpu, &nothing(), canvas, [image.width, image.height], rows, true).unwrap();
                    placer.write(&cover, &left).unwrap();
                    let finish = Finish { filter, encoding, channels: wide, keeps };
                    let finisher = Finisher::new(gpu, &image, &picture, &placer, width, &finish).unwrap().unwrap();
                    let mut batch = gpu.batch().unwrap();
                    placer.record(&mut batch, 0, rows).unwrap();
                    finisher.record_colors(&mut batch, band.len()).unwrap();
                    finisher.record_samples(&mut batch, 0, band.len()).unwrap();
                    batch.submit().unwrap();

                    let mut expected = vec![[0.0; 4]; band.len()];
                    band.gather(&pyramid, filter, &bases, seen.seen(), &mut expected);
                    let colors = read(gpu, &finisher.colors);
                    let apart = |found: &[[f32; 4]]| {
                        (0..band.len())
                            .filter(|i| share(*i) > 0.0)
                            .flat_map(|i| {
                                let e = expected[band.index(i % width, i / width)];
                                (0..channels as usize).map(move |c| (i, c, e[c]))
                            })
                            .map(|(i, c, e)| (e - found[i][c]).abs())
                            .fold(0.0, f32::max)
                    };
                    // As of `warp_image`: sums of up to a thousand weighted samples below 1, in
                    // another order.
                    assert!(apart(&colors) < 2e-5, "{filter:?} {k}: {}", apart(&colors));
                    let mut broken = colors.clone();
                    broken.iter_mut().for_each(|c| c[0] += 1e-3);
                    assert!(apart(&broken) > 2e-5, "the comparison sees another sample");

                    // Samples of the colours that the device has.
                    let mut given = vec![[0.0; 4]; band.len()];
                    for i in (0..band.len()).filter(|i| share(*i) > 0.0) {
                        given[band.index(i % width, i / width)] = colors[i];
                    }
                    let mut out = Image::zeros(canvas[0], canvas[1], wide, depth).unwrap();
                    let pixels = Colors { band, seen: seen.seen(), keep: keeps.then_some(&cover) };
                    store(&pyramid, &given, &pixels, &mut out);
                    let words = read(gpu, &finisher.result);
                    let [samples, counts] = finisher.ranges(band.len());
                    let mut found = Image::zeros(canvas[0], canvas[1], wide, depth).unwrap();
                    finisher.unpack(&words[samples], &mut found, 0);
                    // What lies halfway between two samples goes either way; of floats, products
                    // with shares and quotients by alpha, in another order.
                    let step = match depth {
                        Depth::U8 => 1.0 / 255.0,
                        Depth::U16 => 1.0 / 65535.0,
                        Depth::F32 => 16.0 * UNIT,
                    };
                    let count = found.pixels.len();
                    let off = |i: usize| (found.sample(i) - out.sample(i)).abs() / out.sample(i).abs().max(1.0);
                    let worst = (0..count).map(off).fold(0.0, f32::max);
                    assert!(worst <= 1.001 * step, "{filter:?} {k} {keeps}: {worst} {step}");
                    let others = (0..count).filter(|i| off(*i) > 0.5 * step).count();
                    assert!(others * 50 <= count, "{others} of {count}");

                    let shares: Vec<[f32; 2]> = (0..band.len()).map(|i| [share(i), cover[i]]).collect();
                    assert_eq!(PixelCounts::of(&words[counts]), count_pixels(&shares));
                }
            }
        }
    }
}

#[test]
fn counts_are_those_of_shares() {
    let shares = [[1.0, 1.0], [0.0, 1.0], [-1.0, 1.0], [-1.0, 0.0], [0.0, 0.0], [0.5, 0.5]];
    assert_eq!(count_pixels(&shares), PixelCounts { mapped: 4, empty: 2, lost: 1 });
    let words = [64 | 3 << 8, 1 | 2 << 8 | 1 << 16];
    assert_eq!(PixelCounts::of(&words), PixelCounts { mapped: 65, empty: 5, lost: 1 });
}

fn engines() -> Vec<&'static Engine> {
    [engine(), downlevel()].into_iter().flatten().collect()
}

fn warp(engine: &Engine, image: &Image, map: &CompositeMap, options: &WarpOptions) -> WarpOutput {
    warp_picture(engine, image, map, options, &Quiet).unwrap()
}

/// Samples that are farther apart than `step`.
fn apart(a: &Image, b: &Image, step: f32) -> usize {
    (0..a.pixels.len()).filter(|i| (a.sample(*i) - b.sample(*i)).abs() > step).count()
}

#[test]
fn whole_warps_are_the_hosts_and_keep_to_their_bytes() {
    let [width, height] = [640, 360];
    let map = turning(DVec2::new(640.0, 360.0), 0.1);
    let smooth = |channels: u32, depth: Depth| {
        let mut image = Image::zeros(width, height, channels, depth).unwrap();
        for i in 0..width * height {
            let (x, y) = (i % width, i / width);
            for c in 0..channels {
                let value = 0.5 + 0.4 * (0.02 * (x as f32) * (1.0 + c as f32) + 0.03 * y as f32).sin();
                image.set(x, y, c, value);
            }
        }
        image
    };
    if engines().is_empty() {
        return;
    }
    for limits in [DeviceLimits::Adapter, DeviceLimits::Downlevel] {
        // Its own, on which nothing else counts.
        let own = EngineOptions { backend: Backend::Gpu, limits, ..EngineOptions::default() };
        let engine = &Engine::new(own).unwrap();
        for (channels, depth) in [(3, Depth::U8), (4, Depth::U8), (1, Depth::U16), (2, Depth::F32)] {
            let image = smooth(channels, depth);
            for outside in [Outside::Map, Outside::Keep, Outside::Transparent] {
                for filter in [Filter::Bilinear, Filter::Lanczos, Filter::Ewa] {
                    let canvas = if filter == Filter::Ewa { Some([333, 200]) } else { None };
                    let options = WarpOptions { filter, outside, canvas, ..WarpOptions::default() };
                    let traffic = |e: &Engine| e.gpu().map(Gpu::traffic).unwrap_or_default();
                    let before = traffic(engine);
                    let found = warp(engine, &image, &map, &options);
                    let spent = traffic(engine) - before;
                    let expected = warp(&Engine::cpu(), &image, &map, &options);
                    let what = format!("{channels} {depth:?} {outside:?} {filter:?}");
                    assert!(found.stats.resident && !expected.stats.resident);
                    assert_eq!((found.stats.failed_inside, found.stats.empty), (0, expected.stats.empty), "{what}");
                    assert_eq!(found.stats.evaluations.squares, expected.stats.evaluations.squares);
                    // Pre-images are within a tolerance of 3e-4 pixels; colours change by 0.04 a
                    // pixel, alpha divides them.
                    let step = if depth == Depth::U8 { 1.01 / 255.0 } else { 2e-4 };
                    let count = found.image.pixels.len();
                    assert!(apart(&found.image, &expected.image, step) * 1000 <= count, "{what}");
                    let mut broken = found.image.clone();
                    for y in 100..140 {
                        broken.set(150, y, 0, 1.0 - broken.get(150, y, 0));
                    }
                    assert!(apart(&broken, &expected.image, step) > 5, "the comparison sees a column");
                    // Up once go the samples of level 0, squares and tiles; down come samples.
                    let pixels = found.stats.pixels;
                    let words = match depth {
                        Depth::U8 => 1,
                        Depth::U16 => u64::from(found.image.channels.div_ceil(2)),
                        Depth::F32 => u64::from(found.image.channels),
                    };
                    assert_eq!(spent.bytes_down, bytes_down(pixels, words), "{what}");
                    assert!(spent.bytes_up <= 8 * pixels, "{what}: {}", spent.bytes_up);
                    assert!(spent.waits <= 2 + pixels.div_ceil(1 << 17), "{what}: {}", spent.waits);
                }
            }
        }
    }
}

/// Words of pixels, and one for each run of 64 of a band.
fn bytes_down(pixels: u64, words: u64) -> u64 {
    let width = if pixels == 640 * 360 { 640 } else { 333 };
    let band = (1 << 17) / width / 8 * 8 * width;
    let runs = pixels / band * u64::div_ceil(band, 64) + (pixels % band).div_ceil(64);
    4 * (pixels * words + runs)
}

#[test]
fn what_is_not_for_the_device_goes_elsewhere() {
    let map = turning(DVec2::new(96.0, 64.0), 0.1);
    let image = noise(96, 64, 3, Depth::U8);
    for engine in engines() {
        for options in [
            WarpOptions { jacobian: true, ..WarpOptions::default() },
            WarpOptions { filter: Filter::Lanczos4, ..WarpOptions::default() },
        ] {
            assert!(!warp(engine, &image, &map, &options).stats.resident);
        }
        assert!(warp(engine, &image, &map, &WarpOptions::default()).stats.resident);
        // A cage of a hundredth of a pixel has a tolerance that a device does not keep.
        let tiny = |d: f64| {
            let (a, b) = (DVec2::new(40.0, 30.0), DVec2::new(0.01 + d, 0.01));
            Polygon::from_loops(vec![vec![a, a + b * DVec2::X, a + b, a + b * DVec2::Y]])
        };
        let tiny = CompositeMap::new(Coordinates::MeanValue, vec![tiny(0.0), tiny(0.002)]).unwrap();
        assert!(!warp(engine, &image, &tiny, &WarpOptions::default()).stats.resident);
    }
    // Any stage can be kept on the host.
    for stage in ["halve_texels", "place_pixels", "place_left", "filter_pixels", "store_pixels", "count_pixels"] {
        let options =
            EngineOptions { backend: Backend::Gpu, cpu_stages: vec![stage.into()], ..EngineOptions::default() };
        let Ok(engine) = Engine::new(options) else { continue };
        assert!(!warp(&engine, &image, &map, &WarpOptions::default()).stats.resident, "{stage}");
    }
}

#[test]
fn folding_maps_show_what_the_host_shows() {
    // A square turned inside out: the map folds, and pixels inside the target have no pre-image.
    let size = DVec2::new(160.0, 120.0);
    let ring = |f: &dyn Fn(DVec2) -> DVec2| {
        let corners = [DVec2::new(0.2, 0.2), DVec2::new(0.8, 0.2), DVec2::new(0.8, 0.8), DVec2::new(0.2, 0.8)];
        Polygon::from_loops(vec![corners.map(|c| f(c) * size).to_vec()])
    };
    let fold = ring(&|c| if c.x < 0.5 && c.y < 0.5 { DVec2::new(0.7, 0.75) } else { c });
    let map = CompositeMap::new(Coordinates::MeanValue, vec![ring(&|c| c), fold]).unwrap();
    let image = noise(160, 120, 3, Depth::U8);
    for engine in engines() {
        for outside in [Outside::Map, Outside::Keep] {
            let options = WarpOptions { outside, filter: Filter::Bilinear, ..WarpOptions::default() };
            let (found, expected) =
                (warp(engine, &image, &map, &options), warp(&Engine::cpu(), &image, &map, &options));
            // Which of two sheets is shown depends on a rounding at the sides of squares.
            let different = apart(&found.image, &expected.image, 1.01 / 255.0);
            assert!(different * 100 <= found.image.pixels.len(), "{outside:?}: {different}");
            assert_eq!(found.stats.failed_inside, expected.stats.failed_inside, "{outside:?}");
        }
    }
}
