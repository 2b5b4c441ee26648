use std::f64::consts::TAU;

use glam::DVec3;

use super::super::tests::{holds_by_triangles, small, unwrapped};
use super::hub::PARTS;
use super::*;
use crate::geometry::texcoords::overlap::interiors_meet;
use crate::models::shapes::uv_sphere;

const N: u32 = 600;

/// A fan around vertex 0 over outer vertices at the angles `turn` goes through, `radius` and
/// `height` by their numbers; closed or open.
fn fan(turn: f64, closed: bool, at: impl Fn(u32) -> (f64, f64)) -> Mesh {
    let count = if closed { N } else { N + 1 };
    let mut positions = vec![DVec3::ZERO];
    positions.extend((0..count).map(|i| {
        let (r, h) = at(i);
        let (s, c) = (turn * f64::from(i) / f64::from(N)).sin_cos();
        DVec3::new(r * c, h, -r * s)
    }));
    let triangles: Vec<[u32; 3]> = (0..N).map(|i| [0, 1 + i, 1 + (i + 1) % count]).collect();
    Mesh::of_triangles("fan", positions, &triangles)
}

/// Of no two triangles the interiors meet in the texture.
#[track_caller]
fn assert_apart(mesh: &Mesh) {
    let uv: Vec<[DVec2; 3]> = (0..mesh.triangle_count()).map(|t| mesh.triangle_texcoords(t).unwrap()).collect();
    for (i, a) in uv.iter().enumerate() {
        assert!(uv[..i].iter().all(|b| !interiors_meet(a, b)), "triangle {i} lies on another");
    }
}

#[test]
#[should_panic(expected = "lies on another")]
fn the_check_sees_triangles_on_one_another() {
    let mut mesh = unwrapped(&fan(TAU, true, |_| (1.0, 0.0)), &small()).mesh;
    let [a, b, c] = mesh.triangle_corners(7).map(|c| c.texcoord as usize);
    mesh.texcoords[c] = 2.0 * mesh.texcoords[b] - mesh.texcoords[a];
    mesh.texcoords[b] = mesh.texcoords[c].lerp(mesh.texcoords[a], 0.4);
    assert_apart(&mesh);
}

#[test]
fn fans_of_every_kind_are_unfolded_without_distortion() {
    let bumps = |i: u32| (1.0 + 0.3 * (f64::from(i) * 0.7).sin(), 0.2 * (f64::from(i) * 0.05).sin());
    for (mesh, charts) in [
        // A disk, a cone, a steep one, half a disk whose hub is on the border, and one with a rim
        // like a saw.
        (fan(TAU, true, |_| (1.0, 0.0)), 1),
        (fan(TAU, true, |_| (1.0, 1.0)), 2),
        (fan(TAU, true, |_| (0.2, 1.0)), 1),
        (fan(0.5 * TAU, false, |_| (1.0, 0.0)), 2),
        (fan(0.4 * TAU, false, |i| (if i % 2 == 0 { 1.0 } else { 0.5 }, 0.0)), 1),
        (fan(0.4 * TAU, false, bumps), 6),
    ] {
        let result = unwrapped(&mesh, &small());
        holds_by_triangles(&mesh, &result, &small());
        assert_apart(&result.mesh);
        let d = result.report.distortion;
        assert!(d.angle_p95 < 1.01 && d.stretch_p95 < 1.01, "{:?}", result.report);
        assert!(result.report.charts <= charts && result.report.cut_polygons == 0, "{:?}", result.report);
    }
}

#[test]
fn the_rest_of_a_mesh_is_charted_around_its_fans() {
    let mesh = uv_sphere(1.0, N as usize, 6);
    let topology = Topology::new(&mesh);
    let fans = Fans::new(&mesh, &topology);
    assert_eq!(fans.inside.iter().filter(|inside| **inside).count(), 2 * N as usize);
    let result = unwrapped(&mesh, &small());
    holds_by_triangles(&mesh, &result, &small());
    // The wide triangles cover the fans and little more.
    let coarse = fans.coarse(&mesh);
    assert!(coarse.area() > mesh.area() && coarse.area() < 1.01 * mesh.area());
    assert!(coarse.triangle_count() < mesh.triangle_count() - 2 * N as usize + 8 * PARTS as usize);
}

#[test]
fn a_polygon_of_many_corners_stays_whole() {
    let mut builder = MeshBuilder::new("coin");
    let corner = |vertex| Corner { vertex, texcoord: NONE, normal: NONE };
    builder.mesh.positions = (0..2 * N)
        .map(|i| {
            let (s, c) = (f64::from(i % N) / f64::from(N) * TAU).sin_cos();
            DVec3::new(c, f64::from(i / N) * 0.1, -s)
        })
        .collect();
    builder.polygon((N..2 * N).map(corner));
    builder.polygon((0..N).rev().map(corner));
    (0..N).for_each(|i| builder.polygon([i, (i + 1) % N, N + (i + 1) % N, N + i].map(corner)));
    let mesh = builder.finish();
    assert!(!Fans::new(&mesh, &Topology::new(&mesh)).is_empty());
    let result = unwrapped(&mesh, &small());
    let report = &result.report;
    assert_eq!((result.mesh.polygon_count(), report.cut_polygons, report.not_disks), (mesh.polygon_count(), 0, 0));
    assert!(report.faulty.is_empty() && report.distortion.stretch_p95 < 1.01, "{report:?}");
}

#[test]
fn meshes_of_ordinary_fans_have_none() {
    let mesh = uv_sphere(1.0, LONGEST, 4);
    assert!(Fans::new(&mesh, &Topology::new(&mesh)).is_empty());
    let mesh = uv_sphere(1.0, LONGEST + 1, 4);
    assert!(!Fans::new(&mesh, &Topology::new(&mesh)).is_empty());
}

#[test]
fn copies_of_a_face_share_its_place() {
    let mut triangles = uv_sphere(1.0, 12, 8).triangles();
    let positions = uv_sphere(1.0, 12, 8).positions;
    let [a, b, c] = triangles[40];
    let count = triangles.len();
    triangles.extend((0..N).map(|i| [[a, b, c], [b, c, a], [c, a, b]][i as usize % 3]));
    // The other way round it is another face.
    triangles.push([a, c, b]);
    let mesh = Mesh::of_triangles("copies", positions, &triangles);
    let result = unwrapped(&mesh, &small());
    assert_eq!(result.report.copies, N as usize);
    let place = |t: usize, v: u32| {
        let corners = result.mesh.triangle_corners(t);
        corners.into_iter().find(|c| c.vertex == v).unwrap().texcoord
    };
    for t in count..count + N as usize {
        assert!([a, b, c].into_iter().all(|v| place(t, v) == place(40, v)));
    }
    assert_ne!(place(count + N as usize, a), place(40, a));
    assert!(result.report.charts < count && result.report.faulty.is_empty());
}
