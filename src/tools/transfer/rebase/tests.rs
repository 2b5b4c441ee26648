//! Maps whose fate is known: the identity between equal, turned, scaled, stretched and differently
//! unwrapped meshes.

use std::f64::consts::TAU;

use glam::{DMat3, DVec2, DVec3};

use super::*;
use crate::models::shapes::{Diagonal, plane_grid, torus};
use crate::picture::{Image, Pixels};
use crate::progress::Quiet;
use crate::surface::{PackedImage, PackedPoint};
use crate::tools::transfer::atlas::{AtlasTexel, Tile, rasterize_atlas};
use crate::tools::transfer::bins::{Atlas, Bins};
use crate::tools::transfer::{
    Background, Layer, TransferOptions, TransferOutput, UvRegion, coverage, memory_needed, transfer,
};

const SIZE: u32 = 192;
const RELIEFS: [Relief; 3] = [Relief::Turned, Relief::Local, Relief::Mesh];

/// Every point is its own image.
struct Identity;

impl PointMap for Identity {
    fn map(&self, points: &[PackedPoint], images: &mut Vec<PackedImage>) -> Result<()> {
        images.clear();
        images.extend(points.iter().map(|p| PackedImage {
            face: p.face,
            b0: p.b0,
            b1: p.b1,
            confidence: 1.0,
            status: Status::Valid as u32,
        }));
        Ok(())
    }
}

fn options() -> TransferOptions {
    TransferOptions {
        width: SIZE,
        height: SIZE,
        background: Background::Color([0.0; 4]),
        margin: 0,
        ..TransferOptions::default()
    }
}

fn run(source: &Mesh, image: &Image, kind: LayerKind, target: &Mesh) -> TransferOutput {
    let layer = Layer { kind, ..Layer::single("layer", image) };
    transfer(source, &[layer], target, &Identity, &options(), &Quiet).unwrap()
}

/// Normals of waves that run around a torus a whole number of times.
fn waves(p: DVec2) -> DVec3 {
    let (a, b) = (TAU * (3.0 * p.x + 2.0 * p.y), TAU * (p.x - 2.0 * p.y));
    DVec3::new(0.4 * a.sin() + 0.2 * b.cos(), 0.3 * b.sin(), 1.0).normalize()
}

fn picture(depth: Depth, f: impl Fn(DVec2) -> DVec3) -> Image {
    let mut image = Image::zeros(SIZE, SIZE, 3, depth).unwrap();
    for y in 0..SIZE {
        for x in 0..SIZE {
            let p = DVec2::new((f64::from(x) + 0.5) / f64::from(SIZE), 1.0 - (f64::from(y) + 0.5) / f64::from(SIZE));
            let n = f(p);
            for c in 0..3 {
                image.set(x, y, c, (0.5 * n[c as usize] + 0.5) as f32);
            }
        }
    }
    image
}

fn ring() -> Mesh {
    torus(2.0, 1.0, 48, 24, Diagonal::Forward)
}

fn smooth(mesh: &Mesh) -> TangentFrames {
    TangentFrames::new(mesh, &vertex_normals(mesh, &Topology::new(mesh)))
}

/// Texels whose centre lies in a chart, with the point they show.
fn texels(mesh: &Mesh) -> Vec<AtlasTexel> {
    let tile = Tile { x: 0, y: 0, width: SIZE, height: SIZE };
    let atlas = Atlas::new(mesh, SIZE, SIZE, UvRegion::Repeat, None, 1 << 20).unwrap();
    let bins = Bins::new(&tile, &atlas, 1 << 20).unwrap();
    let mut out = vec![AtlasTexel::EMPTY; tile.texels()];
    rasterize_atlas(&tile, &bins, &atlas.triangles, &mut out);
    out
}

/// Angles in degrees, sorted, between the normals that `image` shades `mesh` with and `truth`, a
/// function of points.
fn errors(mesh: &Mesh, image: &Image, truth: impl Fn(u32, [f64; 3]) -> DVec3) -> Vec<f64> {
    let frames = smooth(mesh);
    let mut errors = Vec::new();
    for (i, t) in texels(mesh).iter().enumerate().filter(|(_, t)| t.is_centre()) {
        let n = DVec3::from_array([0, 1, 2].map(|c| 2.0 * f64::from(image.sample(3 * i + c)) - 1.0));
        let p = t.point().unpack();
        let shaded = frames.at(p.face, p.barycentric).to_space(n);
        errors.push(shaded.angle_between(truth(p.face, p.barycentric)).to_degrees());
    }
    errors.sort_by(f64::total_cmp);
    errors
}

fn median(errors: &[f64]) -> f64 {
    errors[errors.len() / 2]
}

fn p99(errors: &[f64]) -> f64 {
    errors[errors.len() * 99 / 100]
}

/// Largest difference of samples at valid texels whose centre is covered, in steps of `most`.
fn steps_off(mesh: &Mesh, a: &Image, b: &Image, most: f32) -> f32 {
    let centres = texels(mesh);
    let n = a.channels as usize;
    let of = |i: usize| (0..n).map(move |c| (a.sample(n * i + c) - b.sample(n * i + c)).abs() * most);
    (0..centres.len()).filter(|&i| centres[i].is_centre()).flat_map(of).fold(0.0, f32::max)
}

#[test]
fn the_identity_keeps_every_byte() {
    let mesh = ring();
    for (depth, most, slack) in [(Depth::U8, 255.0, 0.0), (Depth::U16, 65535.0, 1.0), (Depth::F32, 1.0, 1e-5)] {
        let (tangent, object) = (picture(depth, waves), picture(depth, |p| DMat3::from_rotation_x(2.0) * waves(p)));
        for relief in RELIEFS {
            let out = run(&mesh, &tangent, LayerKind::TangentNormal { y: NormalY::Up, relief }, &mesh);
            let off = steps_off(&mesh, &tangent, &out.layers[0], most);
            assert!(off <= slack + 1e-3, "{depth:?} {relief:?}: off by {off}");
            assert!((out.stats.size_ratio.unwrap() - 1.0).abs() < 1e-6);
            let heights = run(&mesh, &tangent, LayerKind::Displacement { relief }, &mesh);
            let off = steps_off(&mesh, &tangent, &heights.layers[0], most);
            assert!(off <= slack + 1e-3, "{depth:?} {relief:?}: heights off by {off}");
        }
        // Object-space normals are kept where they are within the limit of steepness.
        let outward = smooth(&mesh);
        let points = texels(&mesh);
        let mut gentle = object.clone();
        for (i, t) in points.iter().enumerate().filter(|(_, t)| t.is_covered()) {
            let p = t.point().unpack();
            let n = (outward.normal(p.face, p.barycentric) + 0.3 * waves(DVec2::splat(i as f64))).normalize();
            let at = (i as u32 % SIZE, i as u32 / SIZE);
            (0..3).for_each(|c| gentle.set(at.0, at.1, c, (0.5 * n[c as usize] + 0.5) as f32));
        }
        let out = run(&mesh, &gentle, LayerKind::object_normal(), &mesh);
        let off = steps_off(&mesh, &gentle, &out.layers[0], most);
        assert!(off <= slack + 1e-3, "{depth:?}: object-space off by {off}");
    }
}

#[test]
fn turning_and_scaling_the_target_leaves_tangent_maps_and_turns_object_maps() {
    let source = ring();
    let turn = DMat3::from_axis_angle(DVec3::new(0.3, -1.0, 0.6).normalize(), 1.3);
    let mut target = source.clone();
    target.positions.iter_mut().for_each(|p| *p = turn * *p * 5.0 + DVec3::new(3.0, 0.0, -1.0));
    let tangent = picture(Depth::U8, waves);
    for relief in RELIEFS {
        let out = run(&source, &tangent, LayerKind::TangentNormal { y: NormalY::Up, relief }, &target);
        let off = steps_off(&source, &tangent, &out.layers[0], 255.0);
        assert!(off < 1.5, "{relief:?}: off by {off}");
        assert!((out.stats.size_ratio.unwrap() - 5.0).abs() < 1e-4);
        let heights = run(&source, &tangent, LayerKind::Displacement { relief }, &target);
        assert!(steps_off(&source, &tangent, &heights.layers[0], 255.0) < 1.5);
    }
    let outward = smooth(&source);
    let points = texels(&source);
    let mut object = Image::zeros(SIZE, SIZE, 3, Depth::U16).unwrap();
    for (i, t) in points.iter().enumerate().filter(|(_, t)| t.is_covered()) {
        let p = t.point().unpack();
        let n = (outward.normal(p.face, p.barycentric) + DVec3::new(0.2, -0.1, 0.3)).normalize();
        (0..3).for_each(|c| object.set(i as u32 % SIZE, i as u32 / SIZE, c, (0.5 * n[c as usize] + 0.5) as f32));
    }
    let out = run(&source, &object, LayerKind::object_normal(), &target);
    let read =
        |image: &Image, i: usize| DVec3::from_array([0, 1, 2].map(|c| 2.0 * f64::from(image.sample(3 * i + c)) - 1.0));
    let mut worst = [0.0_f64; 2];
    for (i, _) in points.iter().enumerate().filter(|(_, t)| t.is_centre()) {
        let (before, after) = (read(&object, i), read(&out.layers[0], i));
        worst[0] = worst[0].max((turn * before).angle_between(after).to_degrees());
        worst[1] = worst[1].max(before.angle_between(after).to_degrees());
    }
    // What is not turned would be far off.
    assert!(worst[0] < 0.1 && worst[1] > 30.0, "{worst:?}");
}

/// The same surface unwrapped in other ways: a quarter turn, mirrored, both, half the size.
#[test]
fn other_texture_coordinates_shade_the_same() {
    let source = ring();
    let image = picture(Depth::U8, waves);
    let frames = smooth(&source);
    let truth = |face: u32, b: [f64; 3]| {
        let [p, q, r] = source.triangle_texcoords(face as usize).unwrap();
        frames.at(face, b).to_space(waves(p * b[0] + q * b[1] + r * b[2]))
    };
    let unwrappings: [fn(DVec2) -> DVec2; 4] = [
        |p| DVec2::new(1.0 - p.y, p.x),
        |p| DVec2::new(1.0 - p.x, p.y),
        |p| DVec2::new(p.y, p.x),
        |p| p * 0.5 + DVec2::new(0.25, 0.1),
    ];
    for unwrap in unwrappings {
        let mut target = source.clone();
        target.texcoords.iter_mut().for_each(|p| *p = unwrap(*p));
        for relief in RELIEFS {
            let out = run(&source, &image, LayerKind::TangentNormal { y: NormalY::Up, relief }, &target);
            let good = errors(&target, &out.layers[0], truth);
            assert!(median(&good) < 0.6 && p99(&good) < 2.0, "{relief:?}: {} {}", median(&good), p99(&good));
        }
        // The test would notice a green channel that points the other way, and a map that is only
        // resampled.
        let mut flipped = run(&source, &image, LayerKind::tangent_normal(), &target).layers.remove(0);
        for i in 0..SIZE * SIZE {
            let (x, y) = (i % SIZE, i / SIZE);
            let green = flipped.get(x, y, 1);
            flipped.set(x, y, 1, 1.0 - green);
        }
        assert!(median(&errors(&target, &flipped, truth)) > 10.0);
        let resampled = run(&source, &image, LayerKind::Color, &target);
        let shrunk = unwrap(DVec2::X).y == unwrap(DVec2::ZERO).y && unwrap(DVec2::X).x > unwrap(DVec2::ZERO).x;
        assert_eq!(median(&errors(&target, &resampled.layers[0], truth)) < 1.0, shrunk);
    }
}

#[test]
fn green_down_in_is_green_down_out() {
    let source = ring();
    let mut target = source.clone();
    target.texcoords.iter_mut().for_each(|p| *p = DVec2::new(p.y, p.x));
    let up = picture(Depth::U16, waves);
    let down = picture(Depth::U16, |p| waves(p) * DVec3::new(1.0, -1.0, 1.0));
    let of = |image: &Image, y| {
        run(&source, image, LayerKind::TangentNormal { y, relief: Relief::Turned }, &target).layers.remove(0)
    };
    let (a, b) = (of(&up, NormalY::Up), of(&down, NormalY::Down));
    let mut mirrored = b.clone();
    for i in 0..SIZE * SIZE {
        let (x, y) = (i % SIZE, i / SIZE);
        mirrored.set(x, y, 1, 65536.0 / 65535.0 - b.get(x, y, 1));
    }
    assert!(steps_off(&target, &a, &mirrored, 65535.0) < 3.0);
    assert!(steps_off(&target, &a, &b, 65535.0) > 1000.0);
}

/// A flat sheet with waves along x, stretched to twice its length.
#[test]
fn slopes_of_a_stretched_height_field() {
    let source = plane_grid(8, 8, 1.0, 1.0, Diagonal::Forward);
    let mut target = source.clone();
    target.positions.iter_mut().for_each(|p| p.x *= 2.0);
    // h = sin(k x) / (2 k) in units of the source has the slope cos(k x) / 2.
    let slope = |p: DVec2| 0.5 * (TAU * 2.0 * p.x).cos();
    let image = picture(Depth::U16, |p| DVec3::new(-slope(p), 0.0, 1.0).normalize());
    for (relief, factor) in
        [(Relief::Turned, 1.0), (Relief::Local, 2.0_f64.sqrt() / 2.0), (Relief::Mesh, 2.0_f64.sqrt() / 2.0)]
    {
        let out = run(&source, &image, LayerKind::TangentNormal { y: NormalY::Up, relief }, &target);
        let truth = |face: u32, b: [f64; 3]| {
            let [p, q, r] = source.triangle_texcoords(face as usize).unwrap();
            DVec3::new(-factor * slope(p * b[0] + q * b[1] + r * b[2]), 0.0, 1.0)
        };
        let e = errors(&target, &out.layers[0], truth);
        assert!(p99(&e) < 0.1, "{relief:?}: {}", p99(&e));
    }
    // Half of the sheet stretched: the whole is 1.5 times as large, this half 2 times.
    let mut target = source.clone();
    target.positions.iter_mut().for_each(|p| p.x = if p.x > 0.5 { 2.0 * p.x - 0.5 } else { p.x });
    let heights = picture(Depth::F32, |_| DVec3::splat(0.6));
    for (relief, expected) in [(Relief::Mesh, 0.8), (Relief::Local, 0.8 * (2.0_f64 / 1.5).sqrt())] {
        let out = run(&source, &heights, LayerKind::Displacement { relief }, &target);
        let at = f64::from(out.layers[0].get(3 * SIZE / 4, SIZE / 2, 0));
        assert!((at - expected).abs() < 1e-4, "{relief:?}: {at}");
        assert!((out.stats.size_ratio.unwrap() - 1.5_f64.sqrt()).abs() < 1e-6);
    }
}

#[test]
fn bands_and_samples_do_not_change_normals() {
    let source = ring();
    let mut target = source.clone();
    target.texcoords.iter_mut().for_each(|p| *p = DVec2::new(p.y, p.x));
    let image = picture(Depth::U8, waves);
    let layer = || Layer { kind: LayerKind::tangent_normal(), ..Layer::single("normals", &image) };
    let whole = transfer(&source, &[layer()], &target, &Identity, &options(), &Quiet).unwrap();
    let memory = memory_needed(&source, &[layer()], &target, &options()) + (1 << 18);
    let narrow = TransferOptions { memory, ..options() };
    let banded = transfer(&source, &[layer()], &target, &Identity, &narrow, &Quiet).unwrap();
    assert!(banded.stats.bands > 3, "{}", banded.stats.bands);
    assert_eq!((whole.layers[0].clone(), whole.coverage), (banded.layers[0].clone(), banded.coverage));
    let fine = TransferOptions { supersample: 2, ..options() };
    let fine = transfer(&source, &[layer()], &target, &Identity, &fine, &Quiet).unwrap();
    assert!(steps_off(&target, &whole.layers[0], &fine.layers[0], 255.0) < 8.0);
    let length = |i: usize| {
        DVec3::from_array([0, 1, 2].map(|c| 2.0 * f64::from(fine.layers[0].sample(3 * i + c)) - 1.0)).length()
    };
    assert!((0..(SIZE * SIZE) as usize).all(|i| (length(i) - 1.0).abs() < 0.013));
}

#[test]
fn labels_are_never_mixed() {
    let source = ring();
    let mut target = source.clone();
    target.texcoords.iter_mut().for_each(|p| *p = *p * 0.37 + DVec2::new(0.2, 0.31));
    // Two channels of 16 bits, the second of which is no opacity.
    let values = [[7_u16, 0], [300, 65535], [65535, 12345], [0, 1]];
    let n = (SIZE * SIZE) as usize;
    let samples: Vec<u16> = (0..n).flat_map(|i| values[(i % SIZE as usize / 5 + i / SIZE as usize / 7) % 4]).collect();
    let image = Image::new(SIZE, SIZE, 2, Pixels::U16(samples)).unwrap();
    for supersample in [1, 3] {
        let layer = Layer { kind: LayerKind::Labels, ..Layer::single("labels", &image) };
        let options = TransferOptions { supersample, ..options() };
        let out = transfer(&source, &[layer], &target, &Identity, &options, &Quiet).unwrap();
        let (Pixels::U16(labels), Pixels::U8(cover)) = (&out.layers[0].pixels, &out.coverage.pixels) else { panic!() };
        let known = |pair: &[u16]| values.iter().any(|v| v == pair);
        assert!(labels.chunks(2).zip(cover).all(|(pair, c)| *c != coverage::VALID || known(pair)));
        assert!(values.iter().all(|v| labels.chunks(2).any(|pair| pair == v)));
    }
    // As colours they are mixed.
    let mixed = run(&source, &image, LayerKind::Color, &target);
    let Pixels::U16(mixed) = &mixed.layers[0].pixels else { panic!() };
    assert!(mixed.chunks(2).any(|pair| !values.iter().any(|v| v == pair)));
    // The identity keeps all of them.
    let out = run(&source, &image, LayerKind::Labels, &source);
    assert_eq!(steps_off(&source, &image, &out.layers[0], 1.0), 0.0);
}

#[test]
fn layers_that_cannot_be_what_they_are_called_are_refused() {
    let mesh = ring();
    let grey = Image::zeros(4, 4, 1, Depth::U8).unwrap();
    let deep = Image::zeros(4, 4, 1, Depth::U16).unwrap();
    for (kind, images, words) in [
        (LayerKind::tangent_normal(), vec![&grey], "normal map of 1 channels"),
        (LayerKind::object_normal(), vec![&grey], "normal map of 1 channels"),
        (LayerKind::Labels, vec![&grey, &deep], "different channels or depths"),
    ] {
        let layer = Layer { kind, images, ..Layer::single("layer", &grey) };
        let message = transfer(&mesh, &[layer], &mesh, &Identity, &options(), &Quiet).unwrap_err().to_string();
        assert!(message.contains(words), "{message}");
    }
}

#[test]
fn samples_without_meaning_become_smooth_normals() {
    let mesh = ring();
    let mut image = picture(Depth::F32, waves);
    let Pixels::F32(samples) = &mut image.pixels else { panic!() };
    samples[..3 * 40 * SIZE as usize].fill(f32::NAN);
    samples[3 * 60 * SIZE as usize..3 * 70 * SIZE as usize].fill(0.5);
    for kind in [LayerKind::tangent_normal(), LayerKind::object_normal()] {
        let out = run(&mesh, &image, kind, &mesh);
        assert!((0..out.layers[0].pixels.len()).all(|i| out.layers[0].sample(i).is_finite()));
        if kind == LayerKind::tangent_normal() {
            assert_eq!([0, 1, 2].map(|c| out.layers[0].get(9, 65, c)), [0.5, 0.5, 1.0]);
        }
    }
}
