use glam::{DVec2, DVec3};

use super::tests::{diagnosis, grid, mesh, shattered};
use super::*;
use crate::geometry::{Corner, MeshBuilder, SurfacePoint};
use crate::models::shapes::uv_sphere;

/// The area that usable triangles cover, and what the surface is.
fn summary(mesh: &Mesh) -> (f64, usize, usize, Option<usize>) {
    let d = diagnosis(mesh);
    (d.components.iter().map(|c| c.area).sum(), d.components.len(), d.boundary_loops(), d.genus())
}

/// A triangle below an edge of length 4, and three above it with corners at 1 and `third`.
fn cracked(third: [f64; 2]) -> Mesh {
    let p = [
        [0.0; 3],
        [4.0, 0.0, 0.0],
        [2.0, -1.0, 0.0],
        [0.0; 3],
        [1.0, 0.0, 0.0],
        [third[0], third[1], 0.0],
        [4.0, 0.0, 0.0],
        [2.0, 2.0, 0.0],
    ];
    mesh(&p, &[[1, 0, 2], [3, 4, 7], [4, 5, 7], [5, 6, 7]])
}

#[test]
fn t_junctions_are_closed_and_numbers_stay() {
    let mut cut = cracked([3.0, 0.0]);
    cut.texcoords = vec![DVec2::ZERO, DVec2::X, DVec2::Y];
    let report = weld(&mut cut, Weld::Exact, &[]).unwrap();
    assert_eq!((report.junctions, report.vertices, report.cracks), (1, 2, 0));
    assert!(report.notes()[1].contains("T-junction"), "{:?}", report.notes());
    assert_eq!(summary(&cut), (6.0, 1, 1, Some(0)));
    // Two more pieces, after the triangles of the file.
    assert_eq!((cut.triangle_count(), cut.file_triangle_count(), cut.polygon_count()), (6, 4, 4));
    assert_eq!(cut.file_triangle(0).map(|c| c.vertex), [1, 0, 2]);
    assert_eq!((cut.triangle_polygon(4), cut.triangle_polygon(5), cut.triangle_places(0)), (0, 0, [0, 1, 2]));
    // A point keeps its place there and back, and comes to the triangle of the file again.
    for b in [[0.2, 0.3, 0.5], [0.9, 0.05, 0.05], [0.5, 0.5, 0.0], [1.0, 0.0, 0.0], [0.25, 0.75, 0.0], [0.0, 0.0, 1.0]]
    {
        let whole = cracked([3.0, 0.0]);
        let p = SurfacePoint::new(0, b);
        let here = cut.point_from_file(p);
        assert!(here.is_valid(&cut, 0.0) && here.position(&cut).distance(p.position(&whole)) < 1e-14, "{here:?}");
        let back = cut.point_in_file(here);
        assert!(back.face == 0 && (0..3).all(|k| (back.barycentric[k] - b[k]).abs() < 1e-14), "{back:?}");
    }
    for t in 1..4 {
        let p = SurfacePoint::new(t, [0.2, 0.3, 0.5]);
        assert_eq!((cut.point_from_file(p), cut.point_in_file(p)), (p, p));
    }
    // The shape is bent: what lies on the edge goes with it.
    let mut bent = cut.positions.clone();
    (bent[1], bent[6]) = (DVec3::new(4.0, 0.0, 4.0), DVec3::new(4.0, 0.0, 4.0));
    (bent[4], bent[5]) = (DVec3::ZERO, DVec3::ZERO);
    cut.spread_positions(&mut bent, |v| v == 5);
    assert_eq!((bent[4], bent[5]), (DVec3::new(1.0, 0.0, 1.0), DVec3::ZERO));
    // Joined anew, nothing is left of it.
    weld(&mut cut, Weld::No, &[]).unwrap();
    assert_eq!((cut.triangles(), cut.texcoords.len()), (cracked([3.0, 0.0]).triangles(), 3));
    // A corner that stands off the edge makes a hole, which is no junction; in six digits it lies
    // on it.
    let mut hole = cracked([3.0, 0.1]);
    assert_eq!(weld(&mut hole, Weld::Exact, &[]).unwrap().junctions, 0);
    let mut rounded = cracked([3.0, 3e-6]);
    assert_eq!(weld(&mut rounded, Weld::Exact, &[]).unwrap().junctions, 1);
    assert_eq!(weld(&mut grid(4), Weld::Exact, &[]).unwrap().junctions, 0);
    // A layer in which it stands off.
    let mut cut = cracked([3.0, 0.0]);
    let layer: Vec<DVec3> = cut.positions.iter().enumerate().map(|(v, p)| *p + DVec3::Z * f64::from(v == 5)).collect();
    assert_eq!(weld(&mut cut, Weld::Exact, &[&layer]).unwrap().junctions, 0);
}

#[test]
fn further_corners_have_the_texture_and_the_normals_of_their_edge() {
    let whole = cracked([3.0, 0.0]);
    let mut builder = MeshBuilder::new("textured");
    builder.mesh.positions = whole.positions.clone();
    builder.mesh.texcoords =
        whole.positions.iter().map(|p| DVec2::new(0.1 * p.x, 0.2 * p.y) + DVec2::splat(0.3)).collect();
    builder.mesh.normals = whole.positions.iter().map(|p| DVec3::new(0.1 * p.x, 0.0, 1.0).normalize()).collect();
    for t in whole.triangles() {
        builder.polygon(t.map(|vertex| Corner { vertex, texcoord: vertex, normal: vertex }));
    }
    let mut cut = builder.finish();
    weld(&mut cut, Weld::Exact, &[]).unwrap();
    for mesh in [cut.clone(), cut.with_corners(|c| c)] {
        for t in 0..mesh.triangle_count() {
            for c in mesh.triangle_corners(t) {
                let p = mesh.positions[c.vertex as usize];
                let wanted = DVec2::new(0.1 * p.x, 0.2 * p.y) + DVec2::splat(0.3);
                assert!(mesh.texcoords[c.texcoord as usize].distance(wanted) < 1e-15);
                let n = mesh.normals[c.normal as usize];
                assert!((n.length() - 1.0).abs() < 1e-15 && n.y.abs() < 1e-15);
            }
        }
        assert_eq!((mesh.file_texcoords().len(), mesh.file_normals().len()), (8, 8));
    }
    let mut placed = cut.clone();
    placed.map_texcoords(|_, uv| uv * 2.0);
    let all = |mesh: &Mesh| (0..mesh.triangle_count()).map(|t| mesh.triangle_texcoords(t).unwrap()).collect::<Vec<_>>();
    assert_eq!(all(&placed), all(&cut).into_iter().map(|t| t.map(|uv| uv * 2.0)).collect::<Vec<_>>());
}

#[test]
fn rows_of_edges_that_end_at_different_places_are_one() {
    // Below an edge of length 6 corners at 2 and 5, above it at 1, 2 and 4.
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for (corners, y) in [(&[0.0, 2.0, 5.0, 6.0][..], -1.0), (&[0.0, 1.0, 2.0, 4.0, 6.0], 1.0)] {
        let first = positions.len() as u32;
        positions.push([3.0, y, 0.0]);
        positions.extend(corners.iter().map(|x| [*x, 0.0, 0.0]));
        for k in 1..corners.len() as u32 {
            let t = [first, first + k, first + k + 1];
            triangles.push(if y > 0.0 { t } else { [t[0], t[2], t[1]] });
        }
    }
    let mut rows = mesh(&positions, &triangles);
    let report = weld(&mut rows, Weld::Exact, &[]).unwrap();
    // 0 to 2 runs along two, 2 to 5 along one and a half, 5 to 6 along the rest of 4 to 6.
    assert_eq!((report.junctions, report.cracks), (3, 0));
    assert_eq!(summary(&rows), (6.0, 1, 1, Some(0)));
    let mut soup = shattered(&mesh(&positions, &triangles));
    weld(&mut soup, Weld::Exact, &[]).unwrap();
    assert_eq!(summary(&soup), (6.0, 1, 1, Some(0)));
}

/// Every third triangle in four, its neighbours as they are.
fn refined(mesh: &Mesh) -> Mesh {
    let mut positions = mesh.positions.clone();
    let mut triangles = Vec::new();
    for (i, t) in mesh.triangles().into_iter().enumerate() {
        if i % 3 != 0 {
            triangles.push(t);
            continue;
        }
        let [a, b, c] = t;
        let mut middle = |v: u32, w: u32| {
            positions.push(0.5 * (mesh.positions[v as usize] + mesh.positions[w as usize]));
            positions.len() as u32 - 1
        };
        let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
        triangles.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    Mesh::of_triangles("refined", positions, &triangles)
}

#[test]
fn a_body_of_t_junctions_is_closed() {
    let welded = uv_sphere(1.0, 12, 8);
    let (area, ..) = summary(&welded);
    for (k, mut mesh) in
        [refined(&welded), shattered(&refined(&welded)), refined(&refined(&welded))].into_iter().enumerate()
    {
        let report = weld(&mut mesh, Weld::Exact, &[]).unwrap();
        let found = summary(&mesh);
        assert!(report.junctions > 0 && report.cracks == 0 && report.crowded == 0, "{k}: {report:?}");
        assert!((found.0 / area - 1.0).abs() < 1e-12, "{k}: {found:?}");
        assert_eq!((found.1, found.2, found.3), (1, 0, Some(0)), "{k}");
        // Positions of six digits.
        mesh.positions.iter_mut().for_each(|p| *p = (*p * 1e6).round() / 1e6);
        let report = weld(&mut mesh, Weld::Exact, &[]).unwrap();
        assert_eq!((summary(&mesh).1, summary(&mesh).2, report.cracks), (1, 0, 0), "{k}, rounded");
    }
}
