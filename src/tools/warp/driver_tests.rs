use glam::DVec2;

use super::*;
use crate::geometry::Polygon;
use crate::mapping::plane::Coordinates;
use crate::picture::{Depth, Pixels};
use crate::progress::Quiet;

fn square(x0: f64, y0: f64, x1: f64, y1: f64) -> Vec<DVec2> {
    vec![DVec2::new(x0, y0), DVec2::new(x1, y0), DVec2::new(x1, y1), DVec2::new(x0, y1)]
}

fn map(source: Vec<DVec2>, target: Vec<DVec2>) -> CompositeMap {
    let polygons = vec![Polygon::from_loops(vec![source]), Polygon::from_loops(vec![target])];
    CompositeMap::new(Coordinates::MeanValue, polygons).unwrap()
}

fn pattern(width: u32, height: u32, channels: u32, depth: Depth) -> Image {
    let mut image = Image::zeros(width, height, channels, depth).unwrap();
    for y in 0..height {
        for x in 0..width {
            for c in 0..channels {
                image.set(x, y, c, ((x * 37 + y * 91 + c * 53) % 256) as f32 / 255.0);
            }
        }
    }
    image
}

fn warp(image: &Image, map: &CompositeMap, options: &WarpOptions) -> WarpOutput {
    warp_picture(&Engine::cpu(), image, map, options, &Quiet).unwrap()
}

#[test]
fn the_identity_keeps_every_kind_of_picture() {
    let cage = square(3.0, 2.0, 30.0, 20.0);
    let identity = map(cage.clone(), cage);
    for depth in [Depth::U8, Depth::U16, Depth::F32] {
        for channels in 1..=4 {
            let mut image = pattern(37, 23, channels, depth);
            // What is transparent has no colour to keep.
            if image.has_alpha() {
                for i in 0..37 * 23 {
                    image.set(i % 37, i / 37, channels - 1, ((i % 5) + 1) as f32 / 5.0);
                }
            }
            for filter in [Filter::Ewa, Filter::Bilinear, Filter::Lanczos] {
                for outside in [Outside::Map, Outside::Keep] {
                    for linear_light in [false, true] {
                        let encoding = Encoding { linear_light, ..Encoding::default() };
                        let out =
                            warp(&image, &identity, &WarpOptions { filter, outside, encoding, ..Default::default() });
                        assert_eq!((out.image.channels, out.image.depth()), (channels, depth));
                        let worst = (0..image.pixels.len())
                            .map(|i| (out.image.sample(i) - image.sample(i)).abs())
                            .fold(0.0, f32::max);
                        assert!(
                            worst < if depth == Depth::U8 { 1e-7 } else { 4e-5 },
                            "{depth:?} {channels} {filter:?} {outside:?}: {worst}"
                        );
                        assert_eq!((out.stats.failed_inside, out.stats.empty), (0, 0));
                    }
                }
            }
        }
    }
}

#[test]
fn whole_pixels_move_exactly() {
    let image = pattern(40, 30, 3, Depth::U8);
    let shift = map(square(0.0, 0.0, 40.0, 30.0), square(7.0, -4.0, 47.0, 26.0));
    let out = warp(&image, &shift, &WarpOptions { canvas: Some([50, 28]), ..Default::default() });
    for y in 0..28 {
        for x in 0..50 {
            let inside = (7..47).contains(&x) && y < 26;
            let expected = if inside { image.get(x - 7, y + 4, 1) } else { 0.0 };
            assert!((out.image.get(x, y, 1) - expected).abs() < 1e-6, "{x} {y}");
        }
    }
    assert_eq!(out.stats.empty, 50 * 28 - 40 * 26);
}

#[test]
fn what_lies_outside_is_what_was_asked_for() {
    let image = pattern(32, 32, 3, Depth::U8);
    let halved = map(square(8.0, 8.0, 24.0, 24.0), square(12.0, 12.0, 20.0, 20.0));
    let at = |outside: Outside| warp(&image, &halved, &WarpOptions { outside, ..Default::default() }).image;
    let (all, keep, clear) = (at(Outside::Map), at(Outside::Keep), at(Outside::Transparent));
    assert_eq!((all.channels, keep.channels, clear.channels), (3, 3, 4));
    for y in 0..32 {
        for x in 0..32 {
            let inside = (12..20).contains(&x) && (12..20).contains(&y);
            assert_eq!(clear.get(x, y, 3), if inside { 1.0 } else { 0.0 });
            for c in 0..3 {
                if inside {
                    assert!((keep.get(x, y, c) - all.get(x, y, c)).abs() < 1e-6);
                    assert!((clear.get(x, y, c) - all.get(x, y, c)).abs() < 1e-6);
                } else {
                    assert_eq!(keep.get(x, y, c), image.get(x, y, c));
                    assert_eq!(clear.get(x, y, c), 0.0);
                }
            }
        }
    }
    // The map goes on: the halved picture fills the middle 16 x 16.
    assert!(all.get(9, 9, 0) > 0.0 && all.get(3, 3, 0) == 0.0);
}

#[test]
fn half_covered_pixels_are_mixed() {
    let image = Image::new(16, 16, 1, Pixels::F32(vec![1.0; 256])).unwrap();
    let shifted = map(square(4.0, 4.0, 12.0, 12.0), square(4.5, 4.0, 12.5, 12.0));
    let clear = warp(&image, &shifted, &WarpOptions { outside: Outside::Transparent, ..Default::default() }).image;
    assert!((clear.get(4, 8, 1) - 0.5).abs() < 1e-5 && (clear.get(4, 8, 0) - 1.0).abs() < 1e-5);
    let keep = warp(&image, &shifted, &WarpOptions { outside: Outside::Keep, ..Default::default() }).image;
    assert!((0..256).all(|i| (keep.sample(i) - 1.0).abs() < 1e-5));
}

#[test]
fn light_is_averaged_as_light() {
    let mut image = Image::zeros(64, 64, 1, Depth::U8).unwrap();
    for i in 0..64 * 64 {
        image.set(i % 64, i / 64, 0, ((i + i / 64) % 2) as f32);
    }
    let eighth = map(square(0.0, 0.0, 64.0, 64.0), square(0.0, 0.0, 8.0, 8.0));
    let at = |linear_light: bool| {
        let encoding = Encoding { linear_light, ..Encoding::default() };
        let out = warp(&image, &eighth, &WarpOptions { encoding, canvas: Some([8, 8]), ..Default::default() });
        (out.image.get(4, 4, 0) * 255.0).round()
    };
    assert!((at(false) - 127.5).abs() <= 2.0 && (at(true) - 188.0).abs() <= 2.0, "{} {}", at(false), at(true));
}

#[test]
fn units_that_count_upwards_turn_nothing_over() {
    let image = pattern(30, 20, 1, Depth::F32);
    // One height is 20 pixels: the cage moves right by 0.2 (4 pixels) and up by 0.1 (2 pixels).
    let moved = map(square(0.0, 0.0, 1.5, 1.0), square(0.2, 0.1, 1.7, 1.1));
    let unit = Placement::upward(20, 20);
    let out = warp(&image, &moved, &WarpOptions { source: unit, target: unit, jacobian: true, ..Default::default() });
    for y in 0..18 {
        for x in 4..30 {
            assert!((out.image.get(x, y, 0) - image.get(x - 4, y + 2, 0)).abs() < 1e-4, "{x} {y}");
        }
    }
    assert!(out.jacobian.unwrap()[5 * 30 + 10] > 0.999);
}

#[test]
fn odd_sizes_and_cages() {
    let cages = [
        (square(-1e4, -1e4, 1e4, 1e4), square(-1e4, -1e4, 1.1e4, 1e4)),
        (square(0.4, 0.4, 0.6, 0.6), square(0.4, 0.4, 0.7, 0.65)),
    ];
    for (source, target) in cages {
        let m = map(source, target);
        for (w, h) in [(1, 1), (1, 40), (33, 1), (64, 65)] {
            let image = pattern(w, h, 4, Depth::U8);
            for outside in [Outside::Map, Outside::Keep, Outside::Transparent] {
                for canvas in [None, Some([3, 200])] {
                    let out = warp(&image, &m, &WarpOptions { outside, canvas, ..Default::default() });
                    assert_eq!(out.stats.failed_inside, 0);
                    out.image.check("out").unwrap();
                }
            }
        }
    }
}

#[test]
fn limits_are_told() {
    let image = pattern(8, 8, 3, Depth::U8);
    let m = map(square(0.0, 0.0, 8.0, 8.0), square(0.0, 0.0, 8.0, 8.0));
    let error =
        |options: WarpOptions| warp_picture(&Engine::cpu(), &image, &m, &options, &Quiet).unwrap_err().to_string();
    assert!(error(WarpOptions { canvas: Some([0, 8]), ..Default::default() }).contains("option canvas"));
    assert!(error(WarpOptions { canvas: Some([8, u32::MAX]), ..Default::default() }).contains("option canvas"));
    assert!(error(WarpOptions { memory: 1000, ..Default::default() }).contains("--memory"));
}

#[test]
fn sides_beyond_the_limits_of_others() {
    // OpenCV's remap ends at 32,767 pixels a side.
    let mut image = Image::zeros(40_000, 12, 1, Depth::U8).unwrap();
    for i in 0..40_000 * 12 {
        image.set(i % 40_000, i / 40_000, 0, (i % 40_000 % 251) as f32 / 255.0);
    }
    let shift = map(square(0.0, 0.0, 40_000.0, 12.0), square(5.0, 0.0, 40_005.0, 12.0));
    let out = warp(&image, &shift, &WarpOptions::default()).image;
    for x in [5, 6, 20_000, 32_767, 32_768, 39_999] {
        assert!((out.get(x, 6, 0) - image.get(x - 5, 6, 0)).abs() < 2.5 / 255.0, "{x}");
    }
}

#[test]
fn polynomials_show_what_the_map_itself_shows() {
    // A map that does not fold, so that every pixel has one pre-image.
    let pair = crate::models::polygons::square_corner(0.3);
    let at = |t: f64| {
        let (a, b) = (pair.source.vertices(), pair.target.vertices());
        let place = |(a, b): (DVec2, DVec2)| a.lerp(b, t) * 280.0 + DVec2::new(20.0, 10.0);
        Polygon::from_loops(vec![a.zip(b).map(place).collect()])
    };
    let map = CompositeMap::new(Coordinates::MeanValue, (0..=6).map(|k| at(f64::from(k) / 6.0)).collect()).unwrap();
    let image = pattern(320, 300, 3, Depth::U8);
    let found = warp(&image, &map, &WarpOptions { jacobian: true, ..Default::default() });
    let options = WarpOptions { jacobian: true, ..Default::default() };
    let truth = warp_picture(&Engine::reference(), &image, &map, &options, &Quiet).unwrap();
    let (Pixels::U8(a), Pixels::U8(b)) = (&found.image.pixels, &truth.image.pixels) else { panic!("other depth") };
    // The bound is on pre-images. Their derivatives, which make footprints and Jacobians, have none
    // of their own; in squares that are bounded they are right to a hundredth. Weights of a
    // footprint, and so colours of noise, move by as much of 255 levels, 2.55, and are rounded.
    const DERIVATIVE: f32 = 1e-2;
    let apart = |least: u8| a.iter().zip(b).filter(|(a, b)| a.abs_diff(**b) >= least).count();
    assert_eq!(apart(4), 0);
    assert!(apart(2) < a.len() / 10_000 && apart(1) < a.len() / 500, "{} {}", apart(2), apart(1));
    let (mine, exact) = (found.jacobian.unwrap(), truth.jacobian.unwrap());
    // Where they belong: beyond the first block of pixels, in both directions.
    for (x, y) in [(150, 140), (181, 97), (100, 201)] {
        let there = map.inverse(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5)).unwrap().jacobian();
        assert!((f64::from(exact[y as usize * 320 + x as usize]) - there).abs() < 1e-3 * there.max(1.0), "{x} {y}");
    }
    let off = |(a, b): (&f32, &f32)| if b.is_nan() { 0.0 } else { (a - b).abs() / b.abs().max(1.0) };
    let worst = mine.iter().zip(&exact).map(off).fold(0.0, f32::max);
    assert!(worst < DERIVATIVE, "{worst}");
    assert_eq!((found.stats.failed_inside, found.stats.mapped), (0, truth.stats.mapped));
    let (few, all) = (found.stats.evaluations, truth.stats.evaluations);
    assert!(few.pixels * 4 < all.pixels && all.pixels >= truth.stats.mapped && few.squares == all.squares);
}
