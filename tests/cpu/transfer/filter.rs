//! How well footprints are averaged, against dense point samples.

use barymap::geometry::Mesh;
use barymap::picture::{Image, Pixels};
use barymap::surface::Status;
use barymap::tools::transfer::{Background, Filter, TransferOptions, coverage};
use glam::{DMat2, DVec2};

use super::whole::{Planar, bytes, options, run};
use super::{FILTERS, grid, soup};

/// A picture of squares of `size` texels with soft values that the mean does not hide.
fn checker(side: u32, size: u32) -> Image {
    let at = |i: u32| if (i % side / size + i / side / size).is_multiple_of(2) { 240 } else { 20 };
    Image::new(side, side, 1, Pixels::U8((0..side * side).map(at).collect())).expect("picture")
}

/// Bilinear sample of a repeating grey picture at texture coordinates.
fn lookup(image: &Image, uv: DVec2) -> f64 {
    let (w, h) = (i64::from(image.width), i64::from(image.height));
    let (x, y) = (uv.x * w as f64 - 0.5, (1.0 - uv.y) * h as f64 - 0.5);
    let at = |i: i64, j: i64| f64::from(bytes(image)[(j.rem_euclid(h) * w + i.rem_euclid(w)) as usize]);
    let (i, j) = (x.floor() as i64, y.floor() as i64);
    let (s, t) = (x - x.floor(), y - y.floor());
    (at(i, j) * (1.0 - s) + at(i + 1, j) * s) * (1.0 - t) + (at(i, j + 1) * (1.0 - s) + at(i + 1, j + 1) * s) * t
}

/// Signal-to-noise ratio of a grey result against 8 x 8 samples per texel through `function`, in
/// dB, over valid texels.
fn quality(result: &Image, cover: &Image, image: &Image, function: impl Fn(DVec2) -> DVec2) -> f64 {
    let (w, h) = (result.width, result.height);
    let (mut error, mut count) = (0.0, 0);
    for (i, &value) in bytes(result).iter().enumerate().filter(|&(i, _)| bytes(cover)[i] == coverage::VALID) {
        let (x, y) = (i as u32 % w, i as u32 / w);
        let mut truth = 0.0;
        for k in 0..64 {
            let at = DVec2::new(
                (f64::from(x) + (f64::from(k % 8) + 0.5) / 8.0) / f64::from(w),
                1.0 - (f64::from(y) + (f64::from(k / 8) + 0.5) / 8.0) / f64::from(h),
            );
            truth += lookup(image, function(at)) / 64.0;
        }
        error += (truth - f64::from(value)).powi(2);
        count += 1;
    }
    10.0 * (255.0_f64.powi(2) * f64::from(count) / f64::max(error, 1e-9)).log10()
}

fn measure(filter: Filter, supersample: u32, function: impl Fn(DVec2) -> DVec2 + Sync + Copy) -> f64 {
    let (source, target) = (grid(2, 0.4, 1), grid(4, 0.6, 2));
    let image = checker(512, 5);
    let map = Planar { source: &source, target: &target, function: |p| (function(p), Status::Valid) };
    let options = TransferOptions { filter, supersample, background: Background::Color([0.0; 4]), ..options(64, 64) };
    let out = run(&source, &image, &target, &map, &options);
    assert!(bytes(&out.coverage).iter().all(|&c| c == coverage::VALID));
    quality(&out.layers[0], &out.coverage, &image, function)
}

#[test]
fn footprints_beat_points_on_stretched_and_turned_maps() {
    // The square is squeezed and turned within the source's square: 8 source texels per texel at
    // most.
    for (name, x, y, angle) in [
        ("even", 0.7, 0.7, 0.3_f64),
        ("six to one", 0.9, 0.15, 0.4),
        ("along an axis", 0.12, 0.95, 0.0),
        ("near 1", 0.15, 0.13, 0.7),
    ] {
        let turn = DMat2::from_angle(angle) * DMat2::from_diagonal(DVec2::new(x, y) * 0.7);
        let function = move |p: DVec2| turn * (p - 0.5) + 0.5;
        let bilinear = measure(Filter::Bilinear, 1, function);
        let trilinear = measure(Filter::Trilinear, 1, function);
        let anisotropic = measure(Filter::Anisotropic, 1, function);
        let ellipse = measure(Filter::Ewa, 1, function);
        let reference = measure(Filter::Anisotropic, 4, function);
        println!(
            "{name}: bilinear {bilinear:.1}, trilinear {trilinear:.1}, anisotropic {anisotropic:.1}, ewa {ellipse:.1}, \
             4x4 {reference:.1} dB"
        );
        // Where nothing is reduced the truth is what linear interpolation makes of the squares,
        // whose borders sincs show sharper.
        let reduced = name != "near 1";
        assert!(ellipse > if reduced { bilinear + 3.0 } else { 20.0 }, "{name}: {ellipse} against {bilinear} dB");
        assert!(!reduced || ellipse > trilinear - 0.5, "{name}: {ellipse} against {trilinear} dB");
        assert!(anisotropic > bilinear + 3.0 || anisotropic > 30.0, "{name}: {anisotropic} against {bilinear} dB");
        assert!(anisotropic > trilinear - 0.5, "{name}: {anisotropic} against {trilinear} dB");
        assert!(reference > anisotropic, "{name}: {reference} against {anisotropic} dB");
    }
}

#[test]
fn curved_maps_are_filtered_as_well() {
    let function = |p: DVec2| DVec2::new(0.05 + 0.9 * p.x * p.x, 0.1 + 0.6 * p.y + 0.2 * (3.0 * p.x).sin() * p.y);
    let bilinear = measure(Filter::Bilinear, 1, function);
    let anisotropic = measure(Filter::Anisotropic, 1, function);
    println!("curved: bilinear {bilinear:.1}, anisotropic {anisotropic:.1} dB");
    assert!(anisotropic > bilinear + 4.0, "{anisotropic} against {bilinear} dB");
}

/// The square cut at x = 1/2 in its texture: the right half lies on the left in the texture and the
/// other way round.
fn cut(n: usize) -> Mesh {
    let whole = grid(2 * n, 0.0, 0);
    let triangles: Vec<[[f64; 2]; 3]> =
        (0..whole.triangle_count()).map(|t| whole.triangle_positions(t).map(|p| [p.x, p.y])).collect();
    let mut mesh = soup(&triangles);
    for t in 0..mesh.triangle_count() {
        let corners = mesh.triangle_corners(t);
        let middle = corners.iter().map(|c| mesh.positions[c.vertex as usize].x).sum::<f64>() / 3.0;
        for c in corners {
            let p = mesh.positions[c.vertex as usize];
            mesh.texcoords[c.texcoord as usize] = DVec2::new(p.x + if middle < 0.5 { 0.5 } else { -0.5 }, p.y);
        }
    }
    mesh
}

#[test]
fn seams_of_the_source_do_not_widen_footprints() {
    let source = cut(4);
    let target = grid(4, 0.6, 2);
    // Smooth over the repeat, so that both halves meet their neighbours over the texture's border;
    // rough within.
    let image = checker(256, 8);
    let function = |p: DVec2| p * 0.98 + 0.01;
    let map = Planar { source: &source, target: &target, function: |p| (function(p), Status::Valid) };
    let out = run(
        &source,
        &image,
        &target,
        &map,
        &TransferOptions { background: Background::Color([0.0; 4]), ..options(256, 256) },
    );
    let in_texture = |p: DVec2| {
        let q = function(p);
        DVec2::new(q.x + if q.x < 0.5 { 0.5 } else { -0.5 }, q.y)
    };
    let db = quality(&out.layers[0], &out.coverage, &image, in_texture);
    assert!(db > 28.0, "{db} dB");
    // The column at the seam is as sharp as the others.
    let contrast = |x: usize| {
        let column: Vec<u8> = (0..256).map(|y| bytes(&out.layers[0])[y * 256 + x]).collect();
        column.iter().max().zip(column.iter().min()).map_or(0, |(a, b)| a - b)
    };
    assert!((120..136).all(|x| contrast(x) > 180));
}

#[test]
fn jumps_of_the_map_do_not_blur() {
    // Left and right half go to far-apart places.
    let (source, target) = (grid(2, 0.4, 1), grid(4, 0.6, 2));
    let image = checker(256, 8);
    let function = |p: DVec2| DVec2::new(if p.x < 0.5 { 0.5 * p.x } else { 1.0 - 0.5 * (p.x - 0.5) }, 0.25 + 0.5 * p.y);
    let map = Planar { source: &source, target: &target, function: |p| (function(p), Status::Valid) };
    let out = run(
        &source,
        &image,
        &target,
        &map,
        &TransferOptions { background: Background::Color([0.0; 4]), ..options(128, 128) },
    );
    let contrast = |x: usize| {
        let column: Vec<u8> = (0..128).map(|y| bytes(&out.layers[0])[y * 128 + x]).collect();
        column.iter().max().zip(column.iter().min()).map_or(0, |(a, b)| a - b)
    };
    for x in 0..128 {
        assert!(contrast(x) > 150, "column {x}: {}", contrast(x));
    }
}

/// A result whose texels lie on those of the picture, moved by `shift` texels.
fn moved(image: &Image, filter: Filter, shift: DVec2) -> Image {
    let (source, target) = (grid(2, 0.4, 1), grid(4, 0.6, 2));
    let by = shift / DVec2::new(f64::from(image.width), -f64::from(image.height));
    let function = move |p: DVec2| (p + by, Status::Valid);
    let map = Planar { source: &source, target: &target, function };
    let options =
        TransferOptions { filter, background: Background::Color([0.0; 4]), ..options(image.width, image.height) };
    run(&source, image, &target, &map, &options).layers.remove(0)
}

/// Grey levels of `side` x `side` texels by column and row.
fn grey(side: u32, value: impl Fn(f64, f64) -> f64) -> Image {
    let at = |i: u32| value(f64::from(i % side), f64::from(i / side)) as f32;
    Image::new(side, side, 1, Pixels::F32((0..side * side).map(at).collect())).expect("picture")
}

#[test]
fn every_filter_gives_back_what_is_only_moved_by_whole_texels() {
    let image = grey(32, |x, y| 0.5 + 0.4 * (x * 0.9).sin() * (y * 1.3).cos());
    for filter in FILTERS {
        let out = moved(&image, filter, DVec2::ZERO);
        for i in 0..32 * 32 {
            // Places of texels are off by the rounding of coordinates; neighbours differ by less
            // than one.
            let off = (out.sample(i) - image.sample(i)).abs();
            assert!(off < 1e-3, "{filter}, sample {i}: {off}");
        }
    }
}

#[test]
fn between_texels_sincs_are_nearer_to_a_smooth_picture_than_two_texels_and_those_than_one() {
    let wave = |x: f64, y: f64| 0.5 + 0.4 * (x * 0.7).sin() * (y * 0.6).cos();
    let image = grey(48, wave);
    let shift = DVec2::new(0.4, 0.3);
    let error = |filter: Filter| {
        let out = moved(&image, filter, shift);
        let inside = (8..40).flat_map(|y| (8..40).map(move |x| (x, y)));
        let off = |(x, y): (u32, u32)| {
            (f64::from(out.get(x, y, 0)) - wave(f64::from(x) + shift.x, f64::from(y) + shift.y)).abs()
        };
        inside.map(off).fold(0.0, f64::max)
    };
    let [ewa, sharp, sharper, two, one] =
        [Filter::Ewa, Filter::Lanczos, Filter::Lanczos4, Filter::Bilinear, Filter::Nearest].map(error);
    println!("nearest {one:.4}, bilinear {two:.4}, lanczos {sharp:.4}, lanczos4 {sharper:.4}, ewa {ewa:.4}");
    assert!(sharper < sharp && sharp < 0.5 * two && two < 0.5 * one);
    assert_eq!(ewa, sharp);
    // The nearest texel of (0.4, 0.3) further is the same one.
    assert_eq!(moved(&image, Filter::Nearest, shift), moved(&image, Filter::Nearest, DVec2::ZERO));
}
