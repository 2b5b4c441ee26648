use std::collections::HashMap;

use glam::{DVec2, DVec3};

use super::*;
use crate::geometry::{Corner, Diagnosis, MeshBuilder, NONE};
use crate::models::shapes::uv_sphere;

/// A mesh of triangles over points.
pub(super) fn mesh(positions: &[[f64; 3]], triangles: &[[u32; 3]]) -> Mesh {
    Mesh::of_triangles("m", positions.iter().map(|p| DVec3::from(*p)).collect(), triangles)
}

/// Every face with vertices of its own, in the order of the faces.
pub(super) fn shattered(welded: &Mesh) -> Mesh {
    rebuilt(welded, |t, _| t as u32)
}

/// One vertex for every corner of a vertex with another `key(triangle, corner)`, numbered as they
/// come.
fn rebuilt(welded: &Mesh, key: impl Fn(usize, Corner) -> u32) -> Mesh {
    let mut builder = MeshBuilder::new("rebuilt");
    builder.mesh.texcoords = welded.texcoords.clone();
    builder.mesh.normals = welded.normals.clone();
    let mut index = HashMap::new();
    for t in 0..welded.triangle_count() {
        let corners = welded.triangle_corners(t).map(|c| {
            let vertex = *index.entry((c.vertex, key(t, c))).or_insert_with(|| {
                builder.mesh.positions.push(welded.positions[c.vertex as usize]);
                builder.mesh.positions.len() as u32 - 1
            });
            Corner { vertex, ..c }
        });
        builder.polygon(corners);
    }
    builder.finish()
}

/// The vertices of `mesh` are joined as those of `truth`, whose faces are the same in the same
/// order.
fn assert_joined_as(mesh: &Mesh, truth: &Mesh) {
    let mut here = HashMap::new();
    let mut there = HashMap::new();
    for (t, (a, b)) in mesh.triangles().into_iter().zip(truth.triangles()).enumerate() {
        for k in 0..3 {
            assert_eq!(*here.entry(a[k]).or_insert(b[k]), b[k], "triangle {t} joins too much");
            assert_eq!(*there.entry(b[k]).or_insert(a[k]), a[k], "triangle {t} joins too little");
        }
    }
}

pub(super) fn diagnosis(mesh: &Mesh) -> Diagnosis {
    Diagnosis::new(mesh, &Topology::new(mesh))
}

/// A grid of `n` x `n` squares of two triangles with texture coordinates; columns `x` and rows `y`
/// of vertices.
pub(super) fn grid(n: u32) -> Mesh {
    let mut builder = MeshBuilder::new("grid");
    for y in 0..=n {
        for x in 0..=n {
            builder.mesh.positions.push(DVec3::new(f64::from(x), f64::from(y), 0.0));
            builder.mesh.texcoords.push(DVec2::new(f64::from(x), f64::from(y)) / f64::from(n));
        }
    }
    let corner = |vertex| Corner { vertex, texcoord: vertex, normal: NONE };
    for y in 0..n {
        for x in 0..n {
            let at = |i, j| corner((y + j) * (n + 1) + x + i);
            builder.polygon([at(0, 0), at(1, 0), at(1, 1)]);
            builder.polygon([at(0, 0), at(1, 1), at(0, 1)]);
        }
    }
    builder.finish()
}

/// The grid cut along the vertices (1..n, row) of the middle row: those above the cut have vertices
/// of their own.
fn cut_grid(n: u32, columns: std::ops::Range<u32>) -> Mesh {
    let welded = grid(n);
    let row = n / 2;
    rebuilt(&welded, |t, c| {
        let (x, y) = (c.vertex % (n + 1), c.vertex / (n + 1));
        let above = t as u32 / 2 / n >= row;
        u32::from(y == row && columns.contains(&x) && above)
    })
}

#[test]
fn faces_of_their_own_become_the_surface() {
    let welded = uv_sphere(1.0, 12, 8);
    let mut mesh = shattered(&welded);
    assert_eq!(mesh.vertex_count(), 3 * welded.triangle_count());
    let report = weld(&mut mesh, Weld::Exact, &[]).unwrap();
    assert_joined_as(&mesh, &welded);
    assert_eq!(report.vertices, mesh.vertex_count() - welded.vertex_count());
    assert_eq!((report.edges, report.turned, report.crowded, report.slits), (welded.triangle_count() * 3 / 2, 0, 0, 0));
    // The file's vertices are still there, and nothing is joined on demand.
    assert_eq!(mesh.file_triangle_corners(1).map(|c| c.vertex), shattered(&welded).triangle(1));
    assert_eq!(weld(&mut mesh, Weld::No, &[]).unwrap(), Welded::default());
    assert!(!mesh.has_joined_vertices());
}

#[test]
fn the_comparison_notices_too_much_and_too_little() {
    let welded = uv_sphere(1.0, 6, 4);
    let pairs = [(shattered(&welded), welded.clone()), (welded.clone(), shattered(&welded))];
    for (a, b) in pairs {
        assert!(std::panic::catch_unwind(|| assert_joined_as(&a, &b)).is_err());
    }
}

#[test]
fn seams_of_one_chart_and_between_charts() {
    // Pole to pole, one chart: a loop that folds onto itself, with other texture coordinates on
    // both sides.
    let welded = uv_sphere(1.0, 12, 8);
    let mut seam = rebuilt(&welded, |_, c| c.texcoord);
    assert!(seam.vertex_count() > welded.vertex_count());
    weld(&mut seam, Weld::Exact, &[]).unwrap();
    assert_joined_as(&seam, &welded);
    // Charts of equal texture coordinates, as overlapping halves have them.
    let mut charts = rebuilt(&welded, |t, _| t as u32 % 24 / 12);
    weld(&mut charts, Weld::Exact, &[]).unwrap();
    assert_joined_as(&charts, &welded);
}

#[test]
fn a_seam_that_ends_inside_is_joined_and_lips_stay_open() {
    let n = 6;
    // From the border into the surface: a part of the loop lies on nothing.
    let mut seam = cut_grid(n, 0..3);
    let report = weld(&mut seam, Weld::Exact, &[]).unwrap();
    assert_joined_as(&seam, &grid(n));
    assert_eq!((report.edges, report.slits), (3, 0));
    // Inside, with equal corners: lips.
    let mut lips = cut_grid(n, 2..5);
    let report = weld(&mut lips, Weld::Exact, &[]).unwrap();
    assert!(!lips.has_joined_vertices());
    assert_eq!((report.edges, report.slits), (0, 4));
    assert_eq!(diagnosis(&lips).boundary_loops(), 2);
    assert!(report.notes()[0].contains("slit"));
    // The same place with other texture coordinates above: a seam.
    let mut seam = cut_grid(n, 2..5);
    let above: Vec<u32> = (0..seam.vertex_count() as u32).filter(|v| *v >= 21).collect();
    assert!(!above.is_empty());
    let moved = grid_with_shifted_upper_half(&seam, n);
    seam = moved;
    let report = weld(&mut seam, Weld::Exact, &[]).unwrap();
    assert_eq!((report.edges, report.slits), (4, 0));
    assert_joined_as(&seam, &grid(n));
}

/// The upper half's corners get texture coordinates of their own.
fn grid_with_shifted_upper_half(mesh: &Mesh, n: u32) -> Mesh {
    let mut builder = MeshBuilder::new("shifted");
    builder.mesh.positions = mesh.positions.clone();
    builder.mesh.texcoords = mesh.texcoords.clone();
    builder.mesh.texcoords.extend(mesh.texcoords.iter().map(|t| *t + DVec2::X));
    for t in 0..mesh.triangle_count() {
        let shift = if t as u32 / 2 / n >= n / 2 { mesh.texcoords.len() as u32 } else { 0 };
        builder.polygon(mesh.triangle_corners(t).map(|c| Corner { texcoord: c.texcoord + shift, ..c }));
    }
    builder.finish()
}

#[test]
fn hard_edges_are_joined() {
    // A cube whose six sides have vertices and normals of their own.
    let mut builder = MeshBuilder::new("cube");
    for axis in 0..3 {
        for sign in [-1.0, 1.0] {
            let mut n = DVec3::ZERO;
            n[axis] = sign;
            let (mut u, mut v) = (DVec3::ZERO, DVec3::ZERO);
            u[(axis + 1) % 3] = 1.0;
            v[(axis + 2) % 3] = sign;
            let normal = builder.mesh.normals.len() as u32;
            builder.mesh.normals.push(n);
            let corners = [n - u - v, n + u - v, n + u + v, n - u + v].map(|p| {
                builder.mesh.positions.push(p);
                Corner { vertex: builder.mesh.positions.len() as u32 - 1, texcoord: NONE, normal }
            });
            builder.polygon(corners);
        }
    }
    let mut cube = builder.finish();
    let report = weld(&mut cube, Weld::Exact, &[]).unwrap();
    assert_eq!((report.vertices, report.edges), (16, 12));
    let d = diagnosis(&cube);
    assert_eq!((d.components.len(), d.genus(), d.boundary_loops()), (1, Some(0), 0));
}

/// A box from `low` to `high`, faces outwards.
fn block(low: [f64; 3], high: [f64; 3]) -> Mesh {
    let at = |i: u32| [0, 1, 2].map(|k| if i >> k & 1 == 1 { high[k] } else { low[k] });
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles: Vec<[u32; 3]> = quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
    mesh(&[0, 1, 2, 3, 4, 5, 6, 7].map(at), &triangles)
}

fn together(parts: &[Mesh]) -> Mesh {
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for part in parts {
        let base = positions.len() as u32;
        positions.extend_from_slice(&part.positions);
        triangles.extend(part.triangles().into_iter().map(|t| t.map(|v| v + base)));
    }
    Mesh::of_triangles("together", positions, &triangles)
}

#[test]
fn bodies_that_touch_stay_apart() {
    let bottom = block([0.0; 3], [1.0; 3]);
    let on_top = block([0.0, 0.0, 1.0], [1.0, 1.0, 2.0]);
    let at_an_edge = block([1.0, 0.0, 1.0], [2.0, 1.0, 2.0]);
    let at_a_corner = block([1.0, 1.0, 1.0], [2.0, 2.0, 2.0]);
    for (name, other) in [("face", on_top), ("edge", at_an_edge), ("corner", at_a_corner), ("copy", bottom.clone())] {
        let welded = together(&[bottom.clone(), other]);
        // Closed shells have no open edges.
        let mut closed = welded.clone();
        assert_eq!(weld(&mut closed, Weld::Exact, &[]).unwrap(), Welded::default(), "{name}");
        // Each face with its own vertices: each body is closed again, by itself.
        let mut mesh = shattered(&welded);
        let report = weld(&mut mesh, Weld::Exact, &[]).unwrap();
        assert_eq!((report.edges, report.crowded), (36, 0), "{name}");
        assert_joined_as(&mesh, &welded);
    }
}

#[test]
fn three_sheets_at_an_edge_stay_apart() {
    // Three pages of two triangles with a common binding of two edges, each face with its own
    // vertices.
    let mut pages = Vec::new();
    for [x, z] in [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.5]] {
        let p = [[0.0; 3], [0.0, 1.0, 0.0], [0.0, 2.0, 0.0], [x, 0.5, z], [x, 1.5, z]];
        pages.push(mesh(&p, &[[0, 3, 1], [1, 3, 4], [1, 4, 2]]));
    }
    let mut book = shattered(&together(&pages));
    let report = weld(&mut book, Weld::Exact, &[]).unwrap();
    assert_joined_as(&book, &together(&pages));
    assert_eq!((report.edges, report.crowded), (6, 6));
    assert!(report.notes()[1].contains("6 open edges lie on several others"));
}

#[test]
fn a_fin_does_not_cut_a_sheet() {
    // A grid whose two halves are split along the middle, and a page that stands on the split.
    let n = 4;
    let mut sheet = together(&[cut_grid(n, 0..n + 1), {
        let p = [[1.0, 2.0, 0.0], [2.0, 2.0, 0.0], [1.5, 2.0, 1.0]];
        mesh(&p, &[[0, 1, 2]])
    }]);
    let report = weld(&mut sheet, Weld::Exact, &[]).unwrap();
    assert_eq!((report.edges, report.crowded), (4, 1));
    assert_eq!(diagnosis(&sheet).components.len(), 2);
}

#[test]
fn faces_turned_over_stay_apart_with_a_note() {
    let square = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
    let mut alike = mesh(&square, &[[0, 1, 2], [3, 5, 4]]);
    let report = weld(&mut alike, Weld::Exact, &[]).unwrap();
    assert_eq!((report.turned, report.edges, report.vertices), (0, 1, 2));
    let mut turned = mesh(&square, &[[0, 1, 2], [3, 4, 5]]);
    let report = weld(&mut turned, Weld::Exact, &[]).unwrap();
    assert_eq!((report.turned, report.edges), (1, 0));
    assert!(!turned.has_joined_vertices() && report.notes()[0].contains("orient"));
}

#[test]
fn copies_of_a_face_and_backs_are_sheets_of_their_own() {
    let sheet = grid(3);
    let back = Mesh::of_triangles(
        "back",
        sheet.positions.clone(),
        &sheet.triangles().into_iter().map(|[a, b, c]| [a, c, b]).collect::<Vec<_>>(),
    );
    for other in [sheet.clone(), back] {
        let welded = together(&[sheet.clone(), other]);
        let mut mesh = welded.clone();
        assert_eq!(weld(&mut mesh, Weld::Exact, &[]).unwrap(), Welded::default());
        let mut mesh = shattered(&welded);
        weld(&mut mesh, Weld::Exact, &[]).unwrap();
        assert_joined_as(&mesh, &welded);
    }
}

#[test]
fn another_layer_keeps_vertices_apart() {
    let welded = uv_sphere(1.0, 8, 6);
    let mut mesh = shattered(&welded);
    let same: Vec<DVec3> = mesh.positions.iter().map(|p| *p * 2.0).collect();
    weld(&mut mesh, Weld::Exact, &[&same]).unwrap();
    assert_joined_as(&mesh, &welded);
    // The upper half moves away in a morph target.
    let moved: Vec<DVec3> = (0..mesh.vertex_count())
        .map(|v| {
            let t = v / 3;
            let up: f64 = mesh.positions[3 * t..3 * t + 3].iter().map(|p| p.y).sum();
            mesh.positions[v] + DVec3::Y * f64::from(up > 0.0)
        })
        .collect();
    let report = weld(&mut mesh, Weld::Exact, &[&same, &moved]).unwrap();
    assert!(report.edges > 0);
    let d = diagnosis(&mesh);
    assert_eq!((d.components.len(), d.boundary_loops()), (2, 2));
}

#[test]
fn shapes_of_one_connectivity_are_joined_alike() {
    let welded = uv_sphere(1.0, 8, 6);
    let (first, mut second) = (shattered(&welded), shattered(&welded));
    // The second shape has one face that stands off.
    (0..3).for_each(|v| second.positions[v] *= 2.0);
    let mut each = [first.clone(), second.clone()];
    for m in &mut each {
        weld(m, Weld::Exact, &[]).unwrap();
    }
    assert_ne!(each[0].triangles(), each[1].triangles());
    weld_alike(&mut each, Weld::Exact).unwrap();
    assert_eq!(each[0].triangles(), each[1].triangles());
    assert_eq!(diagnosis(&each[0]).components.len(), 2);
    // Another connectivity is left alone.
    let mut other = [first, grid(3)];
    weld_alike(&mut other, Weld::Exact).unwrap();
    assert!(!other[0].has_joined_vertices());
}

#[test]
fn polygons_of_one_connectivity_have_one_triangulation() {
    let quad = |inner: usize| {
        let mut builder = MeshBuilder::new("quad");
        builder.mesh.positions = vec![DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y];
        builder.mesh.positions[inner] = DVec3::new(0.4, 0.4, 0.0) + 0.2 * DVec3::new((inner / 2) as f64, 0.0, 0.0);
        builder.polygon([0, 1, 2, 3].map(|vertex| Corner { vertex, texcoord: NONE, normal: NONE }));
        builder.finish()
    };
    let mut shapes = [quad(2), quad(1)];
    shapes[1].positions[1] = DVec3::new(0.3, 0.4, 0.0);
    let mut shapes = shapes.map(|m| {
        let mut builder = MeshBuilder::new("again");
        builder.mesh.positions = m.positions.clone();
        builder.polygon(m.file_polygon(0));
        builder.finish()
    });
    assert_ne!(shapes[0].triangles(), shapes[1].triangles());
    weld_alike(&mut shapes, Weld::Exact).unwrap();
    assert_eq!(shapes[0].triangles(), shapes[1].triangles());
}

#[test]
fn rounding_is_no_gap_and_a_tolerance_bridges_more() {
    let welded = uv_sphere(1.0, 12, 8);
    let shaken = |size: f64, shift: f64| {
        let mut mesh = shattered(&welded);
        let wobble = |v: usize, k: usize| (((v * 7919 + k * 104729) % 1000) as f64 / 500.0 - 1.0) * size;
        for v in 0..mesh.vertex_count() {
            let d = DVec3::new(wobble(v, 0), wobble(v, 1), wobble(v, 2));
            mesh.positions[v] += d + DVec3::splat(shift);
        }
        mesh
    };
    for (size, shift) in [(1e-12, 0.0), (1e-12, 1e7)] {
        let mut mesh = shaken(size, shift);
        weld(&mut mesh, Weld::Exact, &[]).unwrap();
        assert_joined_as(&mesh, &welded);
    }
    let mut mesh = shaken(1e-6, 0.0);
    weld(&mut mesh, Weld::Exact, &[]).unwrap();
    assert!(!mesh.has_joined_vertices());
    weld(&mut mesh, Weld::Within(1e-5), &[]).unwrap();
    assert_joined_as(&mesh, &welded);
    // The representative is the lowest vertex, at its own position.
    assert!((0..mesh.vertex_count() as u32).all(|v| mesh.representative(v) <= v));
}

#[test]
fn a_tolerance_collapses_no_triangle() {
    // A strip of ever smaller triangles, each face with its own vertices.
    let mut positions = Vec::new();
    for i in 0..12 {
        let x = 1.0 - 0.5f64.powi(i);
        positions.extend([[x, 0.0, 0.0], [x, 0.2 * 0.5f64.powi(i), 0.0]]);
    }
    let triangles: Vec<[u32; 3]> =
        (0..11).flat_map(|i| [[2 * i, 2 * i + 2, 2 * i + 3], [2 * i, 2 * i + 3, 2 * i + 1]]).collect();
    let strip = mesh(&positions, &triangles);
    for tolerance in [0.0, 1e-3, 1e-2, strip.mean_edge_length()] {
        let mut mesh = shattered(&strip);
        weld(&mut mesh, Weld::Within(tolerance), &[]).unwrap();
        let used = mesh.triangles().iter().filter(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0]).count();
        assert_eq!(used, triangles.len(), "tolerance {tolerance}");
    }
}

#[test]
fn tolerances_that_make_no_sense_are_refused() {
    for tolerance in [-1.0, f64::NAN, f64::INFINITY, 1e3] {
        let error = weld(&mut uv_sphere(1.0, 8, 6), Weld::Within(tolerance), &[]).unwrap_err().to_string();
        assert!(error.contains("option weld") && error.contains("mean edge"), "{error}");
    }
}

#[test]
fn an_apex_of_many_faces_is_one_vertex() {
    let n = 20_000;
    let mut positions = vec![[0.0, 0.0, 1.0]];
    positions.extend((0..n).map(|i| {
        let a = f64::from(i) / f64::from(n) * std::f64::consts::TAU;
        [a.cos(), a.sin(), 0.0]
    }));
    let triangles: Vec<[u32; 3]> = (0..n as u32).map(|i| [0, 1 + i, 1 + (i + 1) % n as u32]).collect();
    let cone = mesh(&positions, &triangles);
    let mut mesh = shattered(&cone);
    weld(&mut mesh, Weld::Exact, &[]).unwrap();
    assert_joined_as(&mesh, &cone);
}
