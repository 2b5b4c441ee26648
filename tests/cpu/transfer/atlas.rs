//! `rasterize_atlas` against exact integers.

use barymap::geometry::Mesh;
use barymap::tools::transfer::UvRegion;
use barymap::tools::transfer::atlas::{AtlasTexel, Tile, rasterize_atlas};
use barymap::tools::transfer::bins::{Atlas, Bins};
use glam::DVec2;

use super::{Random, grid, soup};

pub(super) fn rasterize(mesh: &Mesh, width: u32, height: u32, tile: Tile) -> Vec<AtlasTexel> {
    let atlas = Atlas::new(mesh, width, height, UvRegion::Repeat, None, 1 << 24).expect("atlas");
    let bins = Bins::new(&tile, &atlas, 1 << 24).expect("bins");
    let mut texels = vec![AtlasTexel::EMPTY; tile.texels()];
    rasterize_atlas(&tile, &bins, &atlas.triangles, &mut texels);
    texels
}

pub(super) fn whole(width: u32, height: u32) -> Tile {
    Tile { x: 0, y: 0, width, height }
}

/// Corners in sub-texels as the rasteriser snaps them.
fn snapped(mesh: &Mesh, face: usize, width: u32, height: u32) -> [[i128; 2]; 3] {
    mesh.triangle_texcoords(face).expect("texcoords").map(|p| {
        let x = p.x * f64::from(width) * 256.0;
        let y = (1.0 - p.y) * f64::from(height) * 256.0;
        [x.round() as i128, y.round() as i128]
    })
}

/// Triangles holding a texel centre, by exact integers over all repeats from -3 to 3: the centre is
/// moved by (-e, e^2).
fn holders(mesh: &Mesh, width: u32, height: u32, x: u32, y: u32) -> Vec<(u32, bool)> {
    let mut found = Vec::new();
    for face in 0..mesh.triangle_count() {
        let c = snapped(mesh, face, width, height);
        for (ry, rx) in (-3..=3_i128).flat_map(|ry| (-3..=3_i128).map(move |rx| (ry, rx))) {
            let p = [
                (i128::from(x) + rx * i128::from(width)) * 256 + 128,
                (i128::from(y) + ry * i128::from(height)) * 256 + 128,
            ];
            let area = (c[1][0] - c[0][0]) * (c[2][1] - c[0][1]) - (c[1][1] - c[0][1]) * (c[2][0] - c[0][0]);
            let inside = area != 0
                && (0..3).all(|k| {
                    let (a, b) = (c[(k + 1) % 3], c[(k + 2) % 3]);
                    let s = area.signum();
                    let e = s * ((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]));
                    let (ex, ey) = (s * (b[1] - a[1]), s * (b[0] - a[0]));
                    e > 0 || (e == 0 && (ex > 0 || (ex == 0 && ey > 0)))
                });
            if inside {
                found.push((face as u32, true));
            }
        }
    }
    found
}

/// Distance of a triangle's boundary from a point in texels.
fn distance_to(mesh: &Mesh, face: usize, width: u32, height: u32, c: [f64; 2]) -> f64 {
    let p = snapped(mesh, face, width, height).map(|v| v.map(|n| n as f64 / 256.0));
    (0..3).map(|k| segment_distance(p[k], p[(k + 1) % 3], c)).fold(f64::MAX, f64::min)
}

fn segment_distance(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    let (d, e) = ([b[0] - a[0], b[1] - a[1]], [c[0] - a[0], c[1] - a[1]]);
    let t = ((d[0] * e[0] + d[1] * e[1]) / (d[0] * d[0] + d[1] * d[1]).max(1e-300)).clamp(0.0, 1.0);
    ((e[0] - t * d[0]).powi(2) + (e[1] - t * d[1]).powi(2)).sqrt()
}

/// Area of the part of a triangle in a unit square (Sutherland and Hodgman).
fn area_in_square(p: [[f64; 2]; 3], x: f64, y: f64) -> f64 {
    let mut polygon: Vec<[f64; 2]> = p.to_vec();
    for (axis, sign, limit) in [(0, 1.0, x), (0, -1.0, x + 1.0), (1, 1.0, y), (1, -1.0, y + 1.0)] {
        let inside = |q: &[f64; 2]| sign * (q[axis] - limit) >= 0.0;
        let mut next = Vec::new();
        for i in 0..polygon.len() {
            let (a, b) = (polygon[i], polygon[(i + 1) % polygon.len()]);
            if inside(&a) {
                next.push(a);
            }
            if inside(&a) != inside(&b) {
                let t = (limit - a[axis]) / (b[axis] - a[axis]);
                next.push([a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]);
            }
        }
        polygon = next;
    }
    let n = polygon.len();
    (0..n)
        .map(|i| {
            let (a, b) = (polygon[i], polygon[(i + 1) % n]);
            0.5 * (a[0] * b[1] - a[1] * b[0])
        })
        .sum::<f64>()
        .abs()
}

/// Checks every texel against exact integers; tells the place of the first that is wrong.
fn check_against_brute_force(mesh: &Mesh, width: u32, height: u32, texels: &[AtlasTexel]) -> Result<(), String> {
    for y in 0..height {
        for x in 0..width {
            let t = texels[(y * width + x) as usize];
            let place = format!("texel {x},{y} of {width}x{height}: {t:?}");
            let holders = holders(mesh, width, height, x, y);
            if let Some(&(lowest, _)) = holders.first() {
                if !t.is_centre() || t.face != lowest {
                    return Err(format!("{place}, but triangle {lowest} holds its centre"));
                }
                if (t.cover & AtlasTexel::OVERLAP != 0) != (holders.len() > 1) {
                    return Err(format!("{place}, but {} triangles hold its centre", holders.len()));
                }
            } else if t.is_centre() {
                return Err(format!("{place}, but no triangle holds its centre"));
            }
            if t.is_covered() && !(t.b0 >= -1e-6 && t.b1 >= -1e-6 && t.b0 + t.b1 <= 1.0 + 1e-6) {
                return Err(format!("{place} is not in the triangle"));
            }
        }
    }
    Ok(())
}

#[test]
fn every_texel_centre_is_decided_as_exact_arithmetic_does() {
    let mut r = Random(7);
    for (width, height) in [(1, 1), (2, 2), (15, 15), (16, 16), (17, 17), (40, 3), (3, 40)] {
        for case in 0..6 {
            let n = 1 + (r.next() % 12) as usize;
            let span = [0.3, 1.0, 2.5][case % 3];
            let on_grid = case >= 3;
            let triangles: Vec<[[f64; 2]; 3]> = (0..n)
                .map(|_| {
                    [0; 3].map(|_| {
                        [0; 2].map(|_| {
                            let c = (r.unit() - 0.2) * span;
                            // Corners on texel centres and edges make ties.
                            if on_grid { (c * 2.0 * f64::from(width)).round() / (2.0 * f64::from(width)) } else { c }
                        })
                    })
                })
                .collect();
            let mesh = soup(&triangles);
            let texels = rasterize(&mesh, width, height, whole(width, height));
            check_against_brute_force(&mesh, width, height, &texels).expect("texels as by brute force");
        }
    }
}

#[test]
fn the_comparison_finds_a_wrong_texel() {
    let mesh = grid(3, 0.5, 1);
    let good = rasterize(&mesh, 16, 16, whole(16, 16));
    check_against_brute_force(&mesh, 16, 16, &good).expect("good");
    for wrong in [
        AtlasTexel { face: 17, ..good[100] },
        AtlasTexel { cover: good[100].cover | AtlasTexel::OVERLAP, ..good[100] },
        AtlasTexel { b0: -0.1, ..good[100] },
        AtlasTexel::EMPTY,
    ] {
        let mut bad = good.clone();
        bad[100] = wrong;
        assert!(check_against_brute_force(&mesh, 16, 16, &bad).is_err(), "{wrong:?}");
    }
}

#[test]
fn shared_edges_belong_to_exactly_one_triangle() {
    // Corners on texel centres: every inner edge and vertex is a tie.
    for n in [1, 2, 5, 16, 17] {
        let mesh = {
            let mut m = grid(n, 0.0, 0);
            let side = (2 * n) as f64;
            for uv in &mut m.texcoords {
                *uv = (*uv * (side - 2.0) + DVec2::splat(0.5)) / side;
            }
            m
        };
        let side = 2 * n as u32;
        let texels = rasterize(&mesh, side, side, whole(side, side));
        check_against_brute_force(&mesh, side, side, &texels).expect("ties");
        // The jittered grid covers all of the square once, whatever its triangles.
        let jittered = grid(n, 0.7, n as u64);
        let texels = rasterize(&jittered, 50, 50, whole(50, 50));
        assert!(texels.iter().all(|t| t.cover == AtlasTexel::CENTRE));
    }
}

#[test]
fn footprints_cover_whatever_touches_and_take_the_closest() {
    let mut r = Random(3);
    for case in 0..20 {
        let triangles: Vec<[[f64; 2]; 3]> =
            (0..1 + case % 5).map(|_| [0; 3].map(|_| [0; 2].map(|_| 0.05 + 0.9 * r.unit()))).collect();
        let mesh = soup(&triangles);
        let side = 24;
        let texels = rasterize(&mesh, side, side, whole(side, side));
        for (i, t) in texels.iter().enumerate() {
            if t.is_centre() {
                continue;
            }
            let (x, y) = ((i as u32 % side) as f64, (i as u32 / side) as f64);
            let c = [x + 0.5, y + 0.5];
            let touching: Vec<(f64, u32)> = (0..mesh.triangle_count())
                .filter(|&f| {
                    let p = snapped(&mesh, f, side, side).map(|v| v.map(|n| n as f64 / 256.0));
                    area_in_square(p, x, y) > 1e-9
                })
                .map(|f| (distance_to(&mesh, f, side, side, c), f as u32))
                .collect();
            assert_eq!(t.is_covered(), !touching.is_empty(), "texel {x},{y}: {t:?} {touching:?}");
            if t.is_covered() {
                assert_eq!(t.cover, AtlasTexel::FOOTPRINT);
                let nearest = touching.iter().map(|d| d.0).fold(f64::MAX, f64::min);
                let uv = mesh.triangle_texcoords(t.face as usize).expect("texcoords");
                let b = [f64::from(t.b0), f64::from(t.b1), 1.0 - f64::from(t.b0) - f64::from(t.b1)];
                let p = uv[0] * b[0] + uv[1] * b[1] + uv[2] * b[2];
                let q = [p.x * f64::from(side), (1.0 - p.y) * f64::from(side)];
                let distance = (q[0] - c[0]).hypot(q[1] - c[1]);
                assert!((distance - nearest).abs() < 6e-3, "texel {x},{y}: {distance} but {nearest}");
            }
        }
    }
}

#[test]
fn points_shown_lie_under_the_centres() {
    let mesh = grid(9, 0.8, 5);
    for (w, h) in [(64, 64), (1000, 3), (3, 1000), (15, 33)] {
        for (i, t) in rasterize(&mesh, w, h, whole(w, h)).iter().enumerate() {
            let uv = mesh.triangle_texcoords(t.face as usize).expect("texcoords");
            let b = [f64::from(t.b0), f64::from(t.b1), 1.0 - f64::from(t.b0) - f64::from(t.b1)];
            let p = uv[0] * b[0] + uv[1] * b[1] + uv[2] * b[2];
            let (x, y) = (p.x * f64::from(w), (1.0 - p.y) * f64::from(h));
            let (cx, cy) = ((i as u32 % w) as f64 + 0.5, (i as u32 / w) as f64 + 0.5);
            assert!((x - cx).hypot(y - cy) < 0.008, "{x},{y} for {cx},{cy} of {w}x{h}");
        }
    }
}

#[test]
fn tiles_show_what_the_whole_shows() {
    let mesh = grid(7, 0.9, 2);
    let (w, h) = (53, 37);
    let all = rasterize(&mesh, w, h, whole(w, h));
    for (tw, th) in [(16, 16), (5, 11), (53, 1), (1, 37)] {
        for y0 in (0..h).step_by(th) {
            for x0 in (0..w).step_by(tw) {
                let tile = Tile { x: x0, y: y0, width: (w - x0).min(tw as u32), height: (h - y0).min(th as u32) };
                let part = rasterize(&mesh, w, h, tile);
                for (i, t) in part.iter().enumerate() {
                    let (x, y) = (x0 + i as u32 % tile.width, y0 + i as u32 / tile.width);
                    let a = all[(y * w + x) as usize];
                    assert_eq!(*t, a);
                }
            }
        }
    }
}
