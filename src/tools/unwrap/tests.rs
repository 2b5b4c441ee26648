use glam::DVec3;

use super::*;
use crate::geometry::{Corner, MeshBuilder};
use crate::models::character_pair;
use crate::models::shapes::{Diagonal, icosphere, lobed_sphere, plane_grid, tetrahedron, torus, tube, uv_sphere};

pub(super) fn small() -> UnwrapOptions {
    UnwrapOptions { size: 512, gap: 4, ..UnwrapOptions::default() }
}

pub(super) fn unwrapped(mesh: &Mesh, options: &UnwrapOptions) -> Unwrapped {
    unwrap(mesh, &Topology::new(mesh), options).unwrap()
}

/// Everything that charts promise, but for the quality.
#[track_caller]
fn holds(mesh: &Mesh, result: &Unwrapped, options: &UnwrapOptions) {
    let new = &result.mesh;
    let found = overlaps(new, &Islands::new(new), &OverlapOptions::default());
    assert_eq!(found, Overlaps { complete: true, ..Overlaps::default() });
    holds_by_triangles(mesh, result, options);
}

/// The same but for what triangles have in common.
#[track_caller]
pub(super) fn holds_by_triangles(mesh: &Mesh, result: &Unwrapped, options: &UnwrapOptions) {
    let (new, report) = (&result.mesh, &result.report);
    assert_eq!(new.positions, mesh.positions);
    assert_eq!(new.triangles(), mesh.triangles());
    for t in 0..mesh.triangle_count() {
        let uv = new.triangle_texcoords(t).unwrap_or_else(|| panic!("triangle {t} has no texture coordinates"));
        assert!(uv.iter().all(|p| p.cmpge(glam::DVec2::ZERO).all() && p.cmple(glam::DVec2::ONE).all()), "{t}: {uv:?}");
        assert_eq!(new.triangle_material(t), mesh.triangle_material(t));
    }
    let islands = Islands::new(new);
    assert!(islands.islands.iter().all(|i| !i.mirrored && i.manifold));
    assert!(islands.islands.iter().all(|i| i.is_disk()), "{:?}", islands.islands);
    assert!(report.faulty.is_empty() && report.not_disks == 0 && report.charts == islands.islands.len());
    assert_eq!(report.flat, islands.flat);
    assert!(gap(new, &islands, options.size) >= 2 * options.gap.div_ceil(2) - 1, "charts are too close");
}

/// The smallest number of empty texels between two charts along rows and columns, by texels whose
/// centres are covered.
fn gap(mesh: &Mesh, islands: &Islands, size: u32) -> u32 {
    let n = size as usize;
    let mut shown = vec![NONE; n * n];
    for t in 0..mesh.triangle_count() {
        let Some(uv) = mesh.triangle_texcoords(t).filter(|_| islands.island_of[t] != NONE) else { continue };
        let p = uv.map(|p| p * f64::from(size));
        let low = p[0].min(p[1]).min(p[2]).floor();
        let high = p[0].max(p[1]).max(p[2]).ceil();
        for y in low.y as usize..(high.y as usize).min(n) {
            for x in low.x as usize..(high.x as usize).min(n) {
                let c = glam::DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
                if (0..3).all(|k| (p[(k + 1) % 3] - p[k]).perp_dot(c - p[k]) >= 0.0) {
                    shown[y * n + x] = islands.island_of[t];
                }
            }
        }
    }
    let mut smallest = u32::MAX;
    for (across, along) in [(n, 1), (1, n)] {
        for line in 0..n {
            let mut last: Option<(usize, u32)> = None;
            for i in 0..n {
                let island = shown[line * across + i * along];
                if island == NONE {
                    continue;
                }
                if let Some((at, other)) = last
                    && other != island
                {
                    smallest = smallest.min((i - at - 1) as u32);
                }
                last = Some((i, island));
            }
        }
    }
    smallest
}

#[test]
fn shapes_of_every_kind_get_charts_that_are_disks_and_do_not_overlap() {
    let shapes = [
        tetrahedron(),
        icosphere(2.0, 3),
        lobed_sphere(4, 0.5),
        torus(1.0, 0.3, 40, 24, Diagonal::Alternating),
        tube(1.0, 4.0, 24, 10, Diagonal::Forward),
        plane_grid(10, 7, 3.0, 2.0, Diagonal::Backward),
        uv_sphere(1.0, 24, 16),
    ];
    for mesh in &shapes {
        let result = unwrapped(mesh, &small());
        holds(mesh, &result, &small());
        let d = result.report.distortion;
        assert!(d.angle_p95 < 1.3 && d.stretch_p95 < 2.0 && d.texture_area > 0.3, "{}: {:?}", mesh.name, result.report);
    }
}

#[test]
fn a_flat_sheet_is_one_chart_without_distortion_and_a_washer_two() {
    let sheet = plane_grid(10, 7, 3.0, 2.0, Diagonal::Backward);
    let report = unwrapped(&sheet, &small()).report;
    assert_eq!((report.charts, report.seam_length), (1, 0.0));
    assert!(report.distortion.angle_p95 < 1.0 + 1e-4 && report.distortion.stretch_p95 < 1.0 + 1e-3, "{report:?}");
    // Flat with a hole: no cut makes it a disk without parting it.
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for k in 0..32u32 {
        let (s, c) = (std::f64::consts::TAU * f64::from(k) / 32.0).sin_cos();
        positions.extend([DVec3::new(c, s, 0.0), DVec3::new(2.0 * c, 2.0 * s, 0.0)]);
        let (a, b) = (2 * k, 2 * ((k + 1) % 32));
        triangles.extend([[a, a + 1, b + 1], [a, b + 1, b]]);
    }
    let washer = Mesh::of_triangles("washer", positions, &triangles);
    let result = unwrapped(&washer, &small());
    holds(&washer, &result, &small());
    assert_eq!(result.report.charts, 2);
}

#[test]
fn characters_keep_polygons_normals_and_materials() {
    let mut mesh = character_pair().target.mesh;
    mesh.normals = vec![DVec3::Z];
    let result = unwrapped(&mesh, &UnwrapOptions { size: 1024, gap: 8, ..UnwrapOptions::default() });
    holds(&mesh, &result, &UnwrapOptions { size: 1024, gap: 8, ..UnwrapOptions::default() });
    assert_eq!(result.mesh.polygon_count(), mesh.polygon_count());
    assert_eq!(result.report.cut_polygons, 0);
    assert!(result.report.charts < mesh.triangle_count() / 20, "{:?}", result.report);
}

#[test]
fn charts_stay_within_materials() {
    let plain = icosphere(1.0, 2);
    let mut builder = MeshBuilder::new("halves");
    builder.mesh.positions.clone_from(&plain.positions);
    builder.mesh.materials = vec![Default::default(); 2];
    for (t, tri) in plain.triangles().into_iter().enumerate() {
        builder.material = [0, 1, NONE][t % 3];
        builder.polygon(tri.map(|vertex| Corner { vertex, texcoord: NONE, normal: NONE }));
    }
    let mesh = builder.finish();
    let result = unwrapped(&mesh, &small());
    holds(&mesh, &result, &small());
    assert!(Islands::new(&result.mesh).islands.iter().all(|i| i.materials.len() == 1));
}

#[test]
fn degenerate_and_non_manifold_triangles_are_named_or_cut() {
    let mut positions = icosphere(1.0, 2).positions;
    let mut triangles = icosphere(1.0, 2).triangles();
    let n = positions.len() as u32;
    let [a, b, c] = triangles[0];
    // A fin at an edge that has two triangles already, a needle without width, a triangle of one
    // point, and one of repeated vertices.
    positions.extend([DVec3::new(3.0, 3.0, 3.0), positions[a as usize].midpoint(positions[b as usize])]);
    triangles.push([a, b, n]);
    let first = triangles.len() as u32;
    triangles.extend([[a, n + 1, b], [c, c, c], [a, b, a]]);
    // A component far away, oriented the other way, and a vertex that is used by nothing and is no
    // number.
    positions.extend([[10.0, 0.0, 0.0], [11.0, 0.0, 0.0], [10.0, 1.0, 0.0], [f64::NAN; 3]].map(DVec3::from));
    triangles.push([n + 4, n + 3, n + 2]);
    let mesh = Mesh::of_triangles("bad", positions[..positions.len() - 1].to_vec(), &triangles);
    let result = unwrapped(&mesh, &small());
    holds(&mesh, &result, &small());
    assert_eq!(result.report.flat, [first, first + 1, first + 2]);
    let mut mesh = mesh;
    mesh.positions.push(DVec3::NAN);
    assert_eq!(unwrapped(&mesh, &small()).report, result.report);
}

#[test]
fn the_same_mesh_gives_the_same_charts_on_any_number_of_threads() {
    let mesh = lobed_sphere(4, 0.4);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| unwrapped(&mesh, &small()))
    };
    let (one, two) = (on(1), on(3));
    assert_eq!(one.mesh.texcoords, two.mesh.texcoords);
    assert_eq!(one.report, two.report);
}

#[test]
fn scale_and_place_do_not_matter() {
    let mesh = lobed_sphere(3, 0.4);
    let base = unwrapped(&mesh, &small()).report;
    for (factor, shift) in [(1e-12, 0.0), (1e12, 0.0), (1024.0, 4096.0)] {
        let mut moved = mesh.clone();
        moved.positions.iter_mut().for_each(|p| *p = *p * factor + shift);
        let report = unwrapped(&moved, &small()).report;
        assert_eq!(report.charts, base.charts, "{factor}");
        assert!((report.seam_length / factor / base.seam_length - 1.0).abs() < 1e-3);
    }
}

#[test]
fn what_cannot_be_unwrapped_is_told() {
    let mesh = icosphere(1.0, 2);
    let topology = Topology::new(&mesh);
    for (size, gap, angle, word) in [
        (8, 1, 70.0, "option size"),
        (512, 0, 70.0, "option gap"),
        (512, 400, 70.0, "option gap"),
        (512, 4, f64::NAN, "option chart_angle"),
    ] {
        let message = unwrap(&mesh, &topology, &UnwrapOptions { size, gap, angle }).unwrap_err().to_string();
        assert!(message.contains(word), "{message}");
    }
    let flat = Mesh::of_triangles("flat", vec![DVec3::ZERO; 3], &[[0, 1, 2]]);
    assert!(
        unwrap(&flat, &Topology::new(&flat), &small()).unwrap_err().to_string().contains("no triangle has an area")
    );
    // Two hundred separate triangles on 16 x 16 texels.
    let positions: Vec<DVec3> =
        (0..600).map(|k| DVec3::new(f64::from(k / 3), f64::from(k % 2), f64::from(k % 3))).collect();
    let triangles: Vec<[u32; 3]> = (0..200).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let many = Mesh::of_triangles("many", positions, &triangles);
    let message = unwrap(&many, &Topology::new(&many), &UnwrapOptions { size: 16, gap: 4, angle: 70.0 });
    assert!(message.unwrap_err().to_string().contains("--size"));
}

/// The checks of these tests see faults: a chart moved onto another, a triangle turned over, a
/// ring.
#[test]
fn the_checks_reject_what_is_wrong() {
    let mesh = icosphere(1.0, 3);
    let good = unwrapped(&mesh, &small()).mesh;
    let islands = Islands::new(&good);
    assert!(islands.islands.len() > 1);
    let mut moved = good.clone();
    let centre = |i: u32| {
        let t = islands.islands[i as usize].first as usize;
        good.triangle_texcoords(t).unwrap().iter().sum::<glam::DVec2>() / 3.0
    };
    let shift = centre(0) - centre(1);
    for t in (0..mesh.triangle_count()).filter(|&t| islands.island_of[t] == 1) {
        for c in good.triangle_corners(t) {
            moved.texcoords[c.texcoord as usize] = good.texcoords[c.texcoord as usize] + shift;
        }
    }
    let found = overlaps(&moved, &Islands::new(&moved), &OverlapOptions::default());
    assert!(found.overlaps.iter().any(|o| o.islands == [0, 1]), "{found:?}");
    let mut turned = good.clone();
    let c = turned.triangle_corners(5);
    turned.texcoords.swap(c[0].texcoord as usize, c[1].texcoord as usize);
    let islands = Islands::new(&turned);
    assert!(!faulty(&islands, &overlaps(&turned, &islands, &OverlapOptions::default())).is_empty());
}
