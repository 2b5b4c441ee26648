//! Whole transfers through simple maps.

use barymap::Error;
use barymap::geometry::Mesh;
use barymap::picture::{Image, Pixels};
use barymap::progress::Quiet;
use barymap::surface::{PointMap, Status};
use barymap::tools::transfer::{Background, Layer, TransferOptions, TransferOutput, coverage, memory_needed, transfer};
use glam::DVec2;

use super::{Random, grid, soup};
pub(super) use crate::common::flat::{Identity, Planar, noise};

pub(super) fn options(width: u32, height: u32) -> TransferOptions {
    TransferOptions { width, height, ..TransferOptions::default() }
}

pub(super) fn run(
    source: &Mesh,
    image: &Image,
    target: &Mesh,
    map: &dyn PointMap,
    options: &TransferOptions,
) -> TransferOutput {
    transfer(source, &[Layer::single("colour", image)], target, map, options, &Quiet).expect("transfer")
}

pub(super) fn bytes(image: &Image) -> &[u8] {
    match &image.pixels {
        Pixels::U8(v) => v,
        _ => panic!("8 bits expected"),
    }
}

/// Stretches a grid in space only, unevenly, so that texture and surface differ in scale from
/// triangle to triangle.
fn uneven(n: usize) -> Mesh {
    let mut mesh = grid(n, 0.8, 4);
    for p in &mut mesh.positions {
        *p = glam::DVec3::new(p.x * p.x + 0.1 * p.x, 0.3 * p.y, (3.0 * p.x).sin() * 0.2);
    }
    mesh
}

#[test]
fn the_identity_reproduces_the_texture() {
    let meshes = [grid(6, 0.8, 1), uneven(6), soup(&[[[0.1, 0.1], [0.9, 0.2], [0.4, 0.8]]])];
    for mesh in &meshes {
        let sizes = [(1, 1), (2, 2), (15, 15), (16, 16), (17, 17), (1000, 3), (128, 200), (16384, 5), (5, 16384)];
        for (w, h) in sizes {
            for channels in [1, 3] {
                let image = noise(w, h, channels, 9);
                let opaque = TransferOptions { background: Background::Color([0.0; 4]), margin: 0, ..options(w, h) };
                let out = run(mesh, &image, mesh, &Identity, &opaque);
                let (a, b) = (bytes(&image), bytes(&out.layers[0]));
                let c = bytes(&out.coverage);
                let rows = mesh.name == "grid";
                assert!(!rows || c.iter().all(|&c| c == coverage::VALID));
                if rows {
                    let worst = a.iter().zip(b).map(|(&a, &b)| a.abs_diff(b)).max();
                    assert!(worst <= Some(0), "{}: {w}x{h}x{channels}: off by {worst:?}", mesh.triangle_count());
                }
            }
        }
    }
}

#[test]
fn depths_are_kept() {
    let mesh = grid(3, 0.5, 1);
    let mut r = Random(2);
    let sixteen: Vec<u16> = (0..32 * 32).map(|_| r.next() as u16).collect();
    let floats: Vec<f32> = (0..32 * 32).map(|_| (r.unit() * 100.0) as f32).collect();
    let layers = [
        Image::new(32, 32, 1, Pixels::U16(sixteen.clone())).expect("picture"),
        Image::new(32, 32, 1, Pixels::F32(floats.clone())).expect("picture"),
    ];
    let options = TransferOptions { background: Background::Color([0.0; 4]), ..options(32, 32) };
    let layers: Vec<Layer<'_>> = layers.iter().map(|i| Layer::single("layer", i)).collect();
    let out = transfer(&mesh, &layers, &mesh, &Identity, &options, &Quiet).expect("transfer");
    match (&out.layers[0].pixels, &out.layers[1].pixels) {
        (Pixels::U16(a), Pixels::F32(b)) => {
            assert!(*a == sixteen && *b == floats, "texels that coincide are copied");
        }
        other => panic!("depths changed: {other:?}"),
    }
}

#[test]
fn bands_and_threads_do_not_show() {
    let (source, target) = (grid(5, 0.6, 1), grid(8, 0.8, 2));
    let image = noise(64, 64, 4, 3);
    let map = Planar {
        source: &source,
        target: &target,
        function: |p: DVec2| {
            let status = if p.x + p.y > 1.2 { Status::Doubtful } else { Status::Valid };
            (DVec2::new(0.1 + 0.7 * p.y, 0.9 - 0.8 * p.x * p.x), status)
        },
    };
    for supersample in [1, 2] {
        let free = TransferOptions { supersample, ..options(150, 130) };
        let layer = [Layer::single("colour", &image)];
        let all = run(&source, &image, &target, &map, &free);
        assert_eq!(all.stats.bands, 1);
        let least = memory_needed(&source, &layer, &target, &free);
        let mut tight = free.clone();
        tight.memory = least;
        let banded = run(&source, &image, &target, &map, &tight);
        assert_eq!(banded.stats.bands, 130);
        assert!(banded.stats.memory <= least);
        assert_eq!((&all.layers, &all.coverage), (&banded.layers, &banded.coverage));
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("pool");
        let single = pool.install(|| run(&source, &image, &target, &map, &free));
        assert_eq!((&all.layers, &all.coverage), (&single.layers, &single.coverage));
        tight.memory = least - 1;
        let refused = transfer(&source, &layer, &target, &map, &tight, &Quiet);
        assert!(matches!(refused, Err(Error::Memory { required, .. }) if required == least));
    }
}
