//! The kernels of texture transfer against their references.

use barymap::engine::{Engine, Gpu};
use barymap::geometry::{Mesh, NONE};
use barymap::tools::transfer::UvRegion;
use barymap::tools::transfer::atlas::{AtlasTexel, Tile, rasterize_atlas};
use barymap::tools::transfer::bins::{Atlas, Bins};
use barymap::tools::transfer::gpu::{MOST_ENTRIES, Padder, Rasterizer};
use barymap::tools::transfer::pad::pad_seams;

use crate::common::flat::{Random, grid, soup};
use crate::{devices, engine};

/// A mesh in a texture.
struct Sheet {
    size: [u32; 2],
    atlas: Atlas,
}

impl Sheet {
    fn new(mesh: &Mesh, width: u32, height: u32) -> Self {
        let atlas = Atlas::new(mesh, width, height, UvRegion::Repeat, None, 1 << 24).unwrap();
        Self { size: [width, height], atlas }
    }

    /// A tile by the reference, and by the kernel with the texels it left.
    fn both(&self, gpu: &Gpu, tile: Tile) -> (Vec<AtlasTexel>, Vec<AtlasTexel>, u64) {
        let bins = Bins::new(&tile, &self.atlas, 1 << 24).unwrap();
        let mut expected = vec![AtlasTexel::EMPTY; tile.texels()];
        rasterize_atlas(&tile, &bins, &self.atlas.triangles, &mut expected);
        let mut rasterizer = Rasterizer::new(gpu, &self.atlas.triangles, tile.width as usize).unwrap();
        let mut found = vec![AtlasTexel { face: 7, b0: 7.0, b1: 7.0, cover: 7 }; tile.texels()];
        rasterizer.rasterize(&tile, &bins, &self.atlas.triangles, &mut found).unwrap();
        (expected, found, rasterizer.left_to_reference())
    }

    /// Distance of a triangle (all its repeats) from a texel's centre, in texels, in double
    /// precision.
    fn distance(&self, face: u32, c: [f64; 2]) -> f64 {
        let segment = |a: [f64; 2], b: [f64; 2]| {
            let (d, e) = ([b[0] - a[0], b[1] - a[1]], [c[0] - a[0], c[1] - a[1]]);
            let t = ((d[0] * e[0] + d[1] * e[1]) / (d[0] * d[0] + d[1] * d[1])).clamp(0.0, 1.0);
            (e[0] - t * d[0]).hypot(e[1] - t * d[1])
        };
        let records = self.atlas.triangles.iter().filter(|t| t.face == face);
        let nearest = |t: &barymap::tools::transfer::atlas::AtlasTriangle| {
            let p = t.corners.map(|p| p.map(|x| f64::from(x) / 256.0));
            (0..3).map(|k| segment(p[k], p[(k + 1) % 3])).fold(f64::MAX, f64::min)
        };
        records.map(nearest).fold(f64::MAX, f64::min)
    }

    /// Whether `found` is `expected` up to rounding: the same centres in the same triangles,
    /// always, and the same closest triangle unless two are as close; barycentric coordinates
    /// within the rounding of their sums.
    fn check(&self, tile: Tile, expected: &[AtlasTexel], found: &[AtlasTexel]) -> Result<(), String> {
        const EPSILON: f64 = f32::EPSILON as f64;
        if expected.len() != found.len() {
            return Err(format!("{} texels for {}", found.len(), expected.len()));
        }
        let mut moved = 0;
        for (i, (e, f)) in expected.iter().zip(found).enumerate() {
            let at = [tile.x + i as u32 % tile.width, tile.y + i as u32 / tile.width];
            let place = || format!("texel {at:?}: {f:?}, expected {e:?}");
            if e.cover != f.cover || (e.face == NONE) != (f.face == NONE) {
                return Err(place());
            }
            if e.face == NONE {
                continue;
            }
            let centre = at.map(|c| f64::from(c) + 0.5);
            if e.face != f.face {
                // A point of a boundary is found within six roundings of the longest side.
                let (a, b) = (self.distance(e.face, centre), self.distance(f.face, centre));
                let longest = f64::from(self.size[0].max(self.size[1]));
                if e.is_centre() || (a - b).abs() > 12.0 * EPSILON * longest {
                    return Err(place());
                }
                moved += 1;
                continue;
            }
            let slope: f64 = self
                .atlas
                .triangles
                .iter()
                .filter(|t| t.face == e.face)
                .flat_map(|t| t.gradient.as_flattened())
                .fold(0.0, |m: f64, g| m.max(f64::from(*g).abs()));
            // A sum of three terms of at most 1 + 14 slopes, or the parameter of an edge of a
            // texel's length times its slope.
            let rounding = 4.0 * EPSILON * (1.0 + 14.0 * slope) + 12.0 * EPSILON * 2.0 * (1.0 + slope);
            let b = [f64::from(e.b0), f64::from(e.b1), 1.0 - f64::from(e.b0) - f64::from(e.b1)];
            let on_border = b.iter().any(|b| b.abs() <= rounding);
            // On the border one may have been moved there, by at most the 1/256 texel that corners
            // are moved by.
            let allowed = if on_border { rounding + slope * 2.0 / 256.0 } else { rounding };
            let close = |a: f32, b: f32| f64::from((a - b).abs()) <= allowed;
            if !(close(e.b0, f.b0) && close(e.b1, f.b1)) {
                return Err(format!("{}, {allowed:e} are allowed", place()));
            }
        }
        if moved * 1000 > expected.len() { Err(format!("{moved} texels moved")) } else { Ok(()) }
    }
}

fn whole(width: u32, height: u32) -> Tile {
    Tile { x: 0, y: 0, width, height }
}

/// Triangles over several repeats of the texture, with corners anywhere or on texel centres and
/// edges, where ties are.
fn scattered(r: &mut Random, count: usize, span: f64, steps: Option<f64>) -> Mesh {
    let corner = |r: &mut Random| {
        let c = (r.unit() - 0.2) * span;
        steps.map_or(c, |s| (c * s).round() / s)
    };
    let triangles: Vec<[[f64; 2]; 3]> = (0..count).map(|_| [0; 3].map(|_| [corner(r), corner(r)])).collect();
    soup(&triangles)
}

#[test]
fn the_atlas_is_rasterised_as_by_the_reference() {
    let mut r = Random(7);
    let mut texels = 0;
    let mut same = 0;
    for gpu in devices() {
        for (width, height) in [(1, 1), (7, 9), (8, 8), (9, 7), (63, 1), (64, 1), (65, 1), (40, 33), (1000, 3)] {
            for case in 0..6 {
                let steps = (case >= 3).then_some(2.0 * f64::from(width));
                let mesh = scattered(&mut r, 1 + case * 5, [0.3, 1.0, 2.5][case % 3], steps);
                let sheet = Sheet::new(&mesh, width, height);
                let (expected, found, left) = sheet.both(gpu, whole(width, height));
                sheet.check(whole(width, height), &expected, &found).unwrap();
                assert_eq!(left, 0);
                texels += expected.len();
                same += expected.iter().zip(&found).filter(|(a, b)| a == b).count();
            }
        }
    }
    eprintln!("{same} of {texels} texels are equal to the bit");
}

#[test]
fn more_texels_than_a_dispatch_takes_and_tiles_of_a_texture() {
    let Some(gpu) = engine().and_then(Engine::gpu) else { return };
    let sheet = Sheet::new(&grid(40, 0.9, 3), 1000, 700);
    let (all, found, _) = sheet.both(gpu, whole(1000, 700));
    sheet.check(whole(1000, 700), &all, &found).unwrap();
    for tile in [
        Tile { x: 5, y: 13, width: 17, height: 29 },
        Tile { x: 0, y: 699, width: 1000, height: 1 },
        Tile { x: 999, y: 0, width: 1, height: 700 },
    ] {
        let (expected, part, _) = sheet.both(gpu, tile);
        sheet.check(tile, &expected, &part).unwrap();
        // Not only close to the reference: the same as in any other tile.
        for (i, t) in part.iter().enumerate() {
            let (x, y) = (tile.x + i as u32 % tile.width, tile.y + i as u32 / tile.width);
            assert_eq!(*t, found[(y * 1000 + x) as usize], "{x},{y}");
        }
    }
}

#[test]
fn crowded_bins_go_through_the_reference() {
    let Some(gpu) = engine().and_then(Engine::gpu) else { return };
    // As many slivers in a corner as overflow its bin, and some triangles elsewhere.
    let mut r = Random(3);
    let mut triangles: Vec<[[f64; 2]; 3]> =
        (0..=MOST_ENTRIES as usize).map(|_| [0; 3].map(|_| [0.2 * r.unit(), 1.0 - 0.2 * r.unit()])).collect();
    triangles.extend((0..9).map(|_| [0; 3].map(|_| [r.unit(), r.unit()])));
    let sheet = Sheet::new(&soup(&triangles), 29, 29);
    let (expected, found, left) = sheet.both(gpu, whole(29, 29));
    sheet.check(whole(29, 29), &expected, &found).unwrap();
    assert_eq!(left, 64, "the crowded bin and no other");
}

#[test]
fn the_comparison_of_atlases_finds_wrong_texels() {
    let sheet = Sheet::new(&grid(3, 0.5, 1), 16, 16);
    let tile = whole(16, 16);
    let bins = Bins::new(&tile, &sheet.atlas, 1 << 24).unwrap();
    let mut good = vec![AtlasTexel::EMPTY; 256];
    rasterize_atlas(&tile, &bins, &sheet.atlas.triangles, &mut good);
    sheet.check(tile, &good, &good).unwrap();
    for wrong in [
        AtlasTexel { face: (good[100].face + 1) % 18, ..good[100] },
        AtlasTexel { cover: good[100].cover | AtlasTexel::OVERLAP, ..good[100] },
        AtlasTexel { cover: AtlasTexel::FOOTPRINT, ..good[100] },
        AtlasTexel { b0: good[100].b0 + 1e-4, ..good[100] },
        AtlasTexel { b1: f32::NAN, ..good[100] },
        AtlasTexel::EMPTY,
    ] {
        let mut bad = good.clone();
        bad[100] = wrong;
        assert!(sheet.check(tile, &good, &bad).is_err(), "{wrong:?}");
    }
    assert!(sheet.check(tile, &good, &good[1..]).is_err());
}

/// The reference's padding of the whole picture, and the kernels' in bands.
fn padding(gpu: &Gpu, coverage: &[u8], width: usize, margin: u32, band: usize) -> (Vec<u32>, Vec<u32>) {
    let height = coverage.len() / width;
    let mut expected = Vec::new();
    pad_seams(coverage, width, 0..height, margin, &mut expected);
    let mut padder = Padder::new(gpu, coverage, width, margin).unwrap();
    let (mut all, mut part) = (Vec::new(), Vec::new());
    for start in (0..height).step_by(band) {
        padder.nearest(start..(start + band).min(height), &mut part).unwrap();
        all.extend_from_slice(&part);
    }
    (expected, all)
}

#[test]
fn padding_is_the_reference_s_to_the_bit() {
    let mut r = Random(11);
    for gpu in devices() {
        for (width, height) in [(1, 1), (2, 1), (1, 77), (31, 32), (33, 65), (64, 64), (65, 31), (200, 150)] {
            // From a few texels, which leave many ties, to most.
            for share in [0.002, 0.05, 0.6] {
                let coverage: Vec<u8> = (0..width * height)
                    .map(|_| {
                        if r.unit() < share {
                            [128, 255][(r.next() % 2) as usize]
                        } else {
                            [0, 64, 127][(r.next() % 3) as usize]
                        }
                    })
                    .collect();
                for margin in [0, 1, 2, 16, 33, 100, u32::MAX] {
                    let (expected, found) = padding(gpu, &coverage, width, margin, 41);
                    assert!(expected == found, "{width} x {height}, {share} covered, margin {margin}");
                }
            }
        }
    }
}

#[test]
fn padding_of_more_texels_than_a_dispatch_takes() {
    let Some(gpu) = engine().and_then(Engine::gpu) else { return };
    let (width, height) = (1001, 1203);
    let mut coverage = vec![0; width * height];
    for (x, y, radius) in [(300, 250, 120), (700, 900, 200), (20, 1190, 60)] {
        for (i, c) in coverage.iter_mut().enumerate() {
            let (dx, dy) = ((i % width) as i32 - x, (i / width) as i32 - y);
            if dx * dx + dy * dy < radius * radius {
                *c = 255;
            }
        }
    }
    for margin in [16, 5000] {
        let (expected, found) = padding(gpu, &coverage, width, margin, height);
        let wrong = expected.iter().zip(&found).position(|(a, b)| a != b);
        assert_eq!(wrong.map(|i| (i % width, i / width, expected[i], found[i])), None, "margin {margin}");
    }
    // A comparison that could not fail would not be one.
    let (expected, mut found) = padding(gpu, &coverage, width, 16, height);
    let padded = expected.iter().enumerate().position(|(i, &n)| n != NONE && n as usize != i).unwrap();
    found[padded] += 1;
    assert!(expected != found);
}
