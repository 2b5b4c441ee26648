//! What a transfer does with holes, failures, repeats, mirrored charts, materials and bad input.

use barymap::Error;
use barymap::geometry::{Corner, Mesh, MeshBuilder, NONE};
use barymap::picture::{Image, Pixels};
use barymap::progress::Quiet;
use barymap::surface::{PackedImage, PackedPoint, PointMap, Status};
use barymap::tools::transfer::{Background, Layer, TransferOptions, TransferOutput, UvRegion, coverage, transfer};
use glam::{DVec2, DVec3};

use super::whole::{Identity, Planar, bytes, noise, options, run};
use super::{grid, soup};

fn opaque(width: u32, height: u32) -> TransferOptions {
    TransferOptions { background: Background::Color([0.0; 4]), ..options(width, height) }
}

fn attempt(source: &Mesh, image: &Image, target: &Mesh, options: &TransferOptions) -> barymap::Result<TransferOutput> {
    transfer(source, &[Layer::single("colour", image)], target, &Identity, options, &Quiet)
}

#[test]
fn coverage_tells_valid_doubtful_padding_and_nothing() {
    let source = grid(2, 0.0, 0);
    // A square from 1/4 to 3/4 of the texture.
    let mut target = grid(4, 0.0, 0);
    for uv in &mut target.texcoords {
        *uv = *uv * 0.5 + 0.25;
    }
    let image = noise(64, 64, 3, 1);
    let map = Planar {
        source: &source,
        target: &target,
        function: |p: DVec2| {
            let status = match (p.x * 4.0) as i32 {
                0 => Status::Failed,
                1 => Status::Doubtful,
                _ => Status::Valid,
            };
            (p, status)
        },
    };
    let out = run(&source, &image, &target, &map, &TransferOptions { margin: 3, ..options(64, 64) });
    let c = bytes(&out.coverage);
    let count = |v: u8| c.iter().filter(|&&c| c == v).count() as u64;
    let s = &out.stats;
    assert_eq!((s.covered, s.covered_centre, s.valid, s.doubtful, s.colorless), (1024, 1024, 512, 256, 256));
    assert_eq!((count(255), count(128), count(64)), (s.valid, s.doubtful, s.padded));
    assert!((s.valid_fraction - 0.5).abs() < 1e-9 && (s.doubtful_fraction - 0.25).abs() < 1e-9);
    // Three texels around what has colour; failed texels are holes in the chart, which padding
    // leaves alone.
    let coloured = |x: i32, y: i32| (24..48).contains(&x) && (16..48).contains(&y);
    let hole = |x: i32, y: i32| (16..24).contains(&x) && (16..48).contains(&y);
    for (i, &c) in c.iter().enumerate() {
        let (x, y) = (i as i32 % 64, i as i32 / 64);
        let near = (-3..=3).any(|dy: i32| (-3..=3).any(|dx: i32| dx * dx + dy * dy <= 9 && coloured(x + dx, y + dy)));
        let expected = match (coloured(x, y), near) {
            (true, _) if x < 32 => coverage::DOUBTFUL,
            (true, _) => coverage::VALID,
            (false, true) if !hole(x, y) => coverage::PADDING,
            (false, _) => coverage::NOTHING,
        };
        assert_eq!(c, expected, "texel {x},{y}");
        let alpha = bytes(&out.layers[0])[4 * i + 3];
        assert_eq!(alpha, if expected == coverage::NOTHING { 0 } else { 255 }, "texel {x},{y}");
    }
    // The texel beyond the right border repeats its neighbour.
    let at = |x: usize, y: usize| &bytes(&out.layers[0])[4 * (y * 64 + x)..4 * (y * 64 + x) + 4];
    assert_eq!(at(50, 30), at(47, 30));
}

#[test]
fn the_background_is_filled_with_a_colour() {
    let mesh = soup(&[[[0.1, 0.1], [0.4, 0.1], [0.1, 0.4]]]);
    let image = noise(16, 16, 3, 1);
    let background = Background::Color([1.0, 0.5, 0.0, 1.0]);
    let out = run(&mesh, &image, &mesh, &Identity, &TransferOptions { background, margin: 0, ..options(16, 16) });
    assert_eq!(out.layers[0].channels, 3);
    assert_eq!(bytes(&out.layers[0])[..3], [255, 128, 0]);
}

#[test]
fn coordinates_beyond_the_unit_square_repeat() {
    let inside = grid(4, 0.5, 1);
    let image = noise(40, 40, 3, 1);
    let expected = run(&inside, &image, &inside, &Identity, &opaque(40, 40));
    for shift in [DVec2::new(3.0, -2.0), DVec2::new(-1.0, 7.0), DVec2::new(0.25, 0.5)] {
        let mut moved = inside.clone();
        for uv in &mut moved.texcoords {
            *uv += shift;
        }
        let out = run(&moved, &image, &moved, &Identity, &opaque(40, 40));
        assert!(bytes(&out.coverage).iter().all(|&c| c == coverage::VALID));
        assert_eq!(out.stats.overlapping, 0);
        let worst = bytes(&out.layers[0]).iter().zip(bytes(&expected.layers[0])).map(|(&a, &b)| a.abs_diff(b)).max();
        assert!(worst <= Some(1), "{shift}: {worst:?}");
    }
    // One square of a UDIM layout shows what lies in it, and nothing else.
    let mut udim = inside.clone();
    for uv in &mut udim.texcoords {
        *uv += DVec2::new(2.0, 1.0);
    }
    let square = |i, j| TransferOptions { region: UvRegion::Square([i, j]), ..opaque(40, 40) };
    assert_eq!(run(&udim, &image, &udim, &Identity, &square(2, 1)).layers, expected.layers);
    assert_eq!(run(&udim, &image, &udim, &Identity, &square(0, 0)).stats.covered, 0);
}

#[test]
fn mirrored_charts_and_maps_keep_the_picture() {
    let straight = grid(4, 0.5, 1);
    let mut mirrored = straight.clone();
    for uv in &mut mirrored.texcoords {
        uv.x = 1.0 - uv.x;
    }
    let image = noise(33, 20, 3, 1);
    let out = run(&straight, &image, &mirrored, &Identity, &opaque(33, 20));
    assert_eq!(out.stats.mirrored_texcoords, mirrored.triangle_count() as u64);
    let (a, b) = (bytes(&image), bytes(&out.layers[0]));
    for y in 0..20 {
        for x in 0..33 {
            for c in 0..3 {
                let (from, to) = ((y * 33 + 32 - x) * 3 + c, (y * 33 + x) * 3 + c);
                assert!(a[from].abs_diff(b[to]) <= 1, "texel {x},{y}");
            }
        }
    }
    // A map that turns the target's square over does the same.
    let map = Planar {
        source: &straight,
        target: &straight,
        function: |p: DVec2| (DVec2::new(1.0 - p.x, p.y), Status::Valid),
    };
    let turned = run(&straight, &image, &straight, &map, &opaque(33, 20));
    let worst = bytes(&turned.layers[0]).iter().zip(b).map(|(&a, &b)| a.abs_diff(b)).max();
    assert!(worst <= Some(1), "{worst:?}");
}

#[test]
fn overlapping_and_degenerate_triangles_are_counted() {
    let a = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
    let mesh = soup(&[a, [[0.2, 0.2], [0.2, 0.2], [0.2, 0.2]], a, [[0.0, 0.0], [0.5, 0.5], [1.0, 1.0]]]);
    let image = noise(16, 16, 1, 1);
    let out = run(&mesh, &image, &mesh, &Identity, &opaque(16, 16));
    assert_eq!(out.stats.degenerate_texcoords, 2);
    assert_eq!(out.stats.overlapping, out.stats.covered_centre);
    // Half of the texels on the diagonal belong to the triangle; the others are touched.
    assert_eq!(out.stats.covered, 16 * 17 / 2);
}

/// Two squares side by side with a material each, both with the unit square as texture.
fn two_materials() -> Mesh {
    let mut b = MeshBuilder::new("two");
    b.mesh.materials = vec![Default::default(); 2];
    for side in 0..2 {
        b.material = side;
        let first = b.mesh.positions.len() as u32;
        for (x, y) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
            b.mesh.positions.push(DVec3::new(x + f64::from(side), y, 0.0));
            b.mesh.texcoords.push(DVec2::new(x, y));
        }
        b.polygon((first..first + 4).map(|i| Corner { vertex: i, texcoord: i, normal: NONE }));
    }
    b.build().unwrap()
}

#[test]
fn each_material_has_its_own_picture() {
    let source = two_materials();
    let mut target = source.clone();
    for (uv, p) in target.texcoords.iter_mut().zip(&source.positions) {
        *uv = DVec2::new(p.x * 0.5, p.y);
    }
    let flat = |v: u8, channels: u32| {
        Image::new(4, 4, channels, Pixels::U8(vec![v; 16 * channels as usize])).expect("picture")
    };
    let (grey, colour, other) = (flat(50, 1), flat(200, 3), flat(90, 3));
    let layers = [
        Layer {
            images: vec![&grey, &colour],
            material_texture: vec![0, 1],
            default_texture: NONE,
            ..Layer::single("colour", &grey)
        },
        Layer { material_texture: vec![NONE, 0], ..Layer::single("second", &other) },
    ];
    let options = TransferOptions { margin: 0, ..opaque(32, 16) };
    let out = transfer(&source, &layers, &target, &Identity, &options, &Quiet).expect("transfer");
    let at = |layer: usize, x: usize| &bytes(&out.layers[layer])[(5 * 32 + x) * 3..(5 * 32 + x) * 3 + 3];
    assert_eq!((at(0, 3), at(0, 28)), (&[50; 3][..], &[200; 3][..]));
    assert_eq!((at(1, 3), at(1, 28)), (&[0; 3][..], &[90; 3][..]));
    // One material of the target alone.
    let one = TransferOptions { material: Some(1), ..options.clone() };
    let out = transfer(&source, &layers, &target, &Identity, &one, &Quiet).expect("transfer");
    assert_eq!(out.stats.covered, 16 * 16);
    let wrong = Layer { default_texture: 7, ..Layer::single("wrong", &grey) };
    assert!(transfer(&source, &[wrong], &target, &Identity, &options, &Quiet).is_err());
}

#[test]
fn bad_input_is_refused_with_its_place() {
    let good = grid(2, 0.0, 0);
    let image = noise(4, 4, 3, 1);
    let told = |result: barymap::Result<TransferOutput>| result.expect_err("must be refused").to_string();
    for (value, place) in [(f64::NAN, "triangle 0"), (f64::INFINITY, "triangle 0"), (1e9, "triangle 0")] {
        let mut bad = good.clone();
        bad.texcoords[0].x = value;
        assert!(told(attempt(&good, &image, &bad, &options(8, 8))).contains(place));
        assert!(told(attempt(&bad, &image, &good, &options(8, 8))).contains(place));
    }
    let mut lost = good.clone();
    lost.positions[4].y = f64::NAN;
    assert!(told(attempt(&good, &image, &lost, &options(8, 8))).contains("not finite"));
    assert!(told(attempt(&lost, &image, &good, &options(8, 8))).contains("not finite"));
    let mut wide = good.clone();
    wide.texcoords[0].x = -1000.0;
    assert!(told(attempt(&good, &image, &wide, &options(8, 8))).contains("repeats"));
    let bare = Mesh::from_triangles("bare", good.positions.clone(), &good.triangles()).unwrap();
    assert!(told(attempt(&good, &image, &bare, &options(8, 8))).contains("no texture coordinates"));
    assert!(told(attempt(&bare, &image, &good, &options(8, 8))).contains("no texture coordinates"));
    let empty = Mesh::from_triangles("empty", Vec::new(), &[]).unwrap();
    assert!(attempt(&empty, &image, &good, &options(8, 8)).is_err());
    for (w, h) in [(0, 8), (8, 0), (16385, 8)] {
        assert!(told(attempt(&good, &image, &good, &options(w, h))).contains("option size"));
    }
    for bad in [TransferOptions { supersample: 0, ..options(8, 8) }, TransferOptions { taps: 17, ..options(8, 8) }] {
        assert!(matches!(attempt(&good, &image, &good, &bad), Err(Error::Option { .. })));
    }
    assert!(transfer(&good, &[], &good, &Identity, &options(8, 8), &Quiet).is_err());
    let short = Image { width: 4, height: 4, channels: 3, pixels: Pixels::U8(vec![0; 5]) };
    assert!(attempt(&good, &short, &good, &options(8, 8)).is_err());
    let small = TransferOptions { memory: 1000, ..options(8, 8) };
    assert!(matches!(attempt(&good, &image, &good, &small), Err(Error::Memory { .. })));
}

/// Images that no source has, or too few of them.
struct Broken(bool);

impl PointMap for Broken {
    fn map(&self, points: &[PackedPoint], images: &mut Vec<PackedImage>) -> barymap::Result<()> {
        images.clear();
        let wrong = [(u32::MAX - 1, 0.3, 0.3), (0, f32::NAN, 0.3), (0, 5.0, -9.0), (NONE, 0.0, 0.0)];
        for (i, _) in points.iter().enumerate().skip(usize::from(self.0)) {
            let (face, b0, b1) = wrong[i % 4];
            images.push(PackedImage { face, b0, b1, confidence: 1.0, status: Status::Valid as u32 });
        }
        Ok(())
    }
}

#[test]
fn images_off_the_source_are_never_coloured() {
    let mesh = grid(2, 0.0, 0);
    let image = noise(4, 4, 3, 1);
    let out = run(&mesh, &image, &mesh, &Broken(false), &options(8, 8));
    assert_eq!((out.stats.colorless, out.stats.padded), (64, 0));
    assert!(bytes(&out.layers[0]).iter().chain(bytes(&out.coverage)).all(|&b| b == 0));
    assert!(transfer(&mesh, &[Layer::single("c", &image)], &mesh, &Broken(true), &options(8, 8), &Quiet).is_err());
}

#[test]
fn every_filter_and_format_runs_on_one_texel() {
    let mesh = grid(3, 0.5, 1);
    for channels in 1..=4 {
        for filter in super::FILTERS {
            for supersample in 1..=4 {
                let image = Image::new(1, 1, channels, Pixels::U8(vec![255; channels as usize])).expect("picture");
                let out =
                    run(&mesh, &image, &mesh, &Identity, &TransferOptions { filter, supersample, ..options(1, 1) });
                assert!(bytes(&out.layers[0]).iter().all(|&b| b == 255));
            }
        }
    }
}

/// Wild but finite geometry: whatever comes out, it comes out, with colours between those of the
/// texture.
#[test]
fn wild_geometry_neither_panics_nor_invents_colours() {
    let mut r = super::Random(21);
    let image = Image::new(7, 5, 1, Pixels::F32((0..35).map(|i| 1.0 + i as f32 / 35.0).collect())).expect("picture");
    for case in 0..60 {
        let size = 10.0_f64.powi(case % 20 - 12);
        let mut wild = |repeats: f64| {
            let triangles: Vec<[[f64; 2]; 3]> =
                (0..8).map(|_| [0; 3].map(|_| [0; 2].map(|_| (r.unit() - 0.5) * repeats))).collect();
            let mut mesh = soup(&triangles);
            for p in &mut mesh.positions {
                *p = DVec3::new(r.unit(), r.unit() * size, r.unit() * size * size);
            }
            mesh
        };
        let (source, target) = (wild(10.0_f64.powi(case / 6 - 4)), wild(3.0));
        let options = TransferOptions { margin: 1, ..opaque(21, 18) };
        let out = run(&source, &image, &target, &Identity, &options);
        let Pixels::F32(values) = &out.layers[0].pixels else { panic!("floats expected") };
        for (&v, &c) in values.iter().zip(bytes(&out.coverage)) {
            assert!(
                if c == 0 { v == 0.0 } else { (0.999..2.0).contains(&v) },
                "case {case}: {v} where coverage is {c}"
            );
        }
    }
}
