use glam::{DMat3, DVec3};

use super::*;
use crate::geometry::SurfacePoint;
use crate::models::shapes::{Diagonal, plane_grid, uv_sphere};
use crate::surface::{PackedImage, PackedPoint};

/// A map given by a function of points and a status.
struct By<F>(F);

impl<F: Fn(SurfacePoint) -> (SurfacePoint, Status) + Sync> PointMap for By<F> {
    fn map(&self, points: &[PackedPoint], images: &mut Vec<PackedImage>) -> Result<()> {
        images.clear();
        images.extend(points.iter().map(|p| {
            let (q, status) = (self.0)(p.unpack());
            let q = PackedPoint::from(q);
            if status == Status::Failed {
                return PackedImage::NOWHERE;
            }
            PackedImage { face: q.face, b0: q.b0, b1: q.b1, confidence: 1.0, status: status as u32 }
        }));
        Ok(())
    }
}

fn attribute(kind: AttributeKind, columns: usize, values: Vec<f64>) -> Attribute {
    Attribute { name: "data".into(), kind, columns, values }
}

fn run(
    source: &Mesh,
    target: &Mesh,
    map: impl Fn(SurfacePoint) -> (SurfacePoint, Status) + Sync,
    attributes: &[Attribute],
    fill: Fill,
) -> Result<AttributeTransfer> {
    let (s, t) = (Topology::new(source), Topology::new(target));
    transfer_attributes((source, &s), (target, &t), &By(map), attributes, fill)
}

fn same(p: SurfacePoint) -> (SurfacePoint, Status) {
    (p, Status::Valid)
}

fn coordinates(mesh: &Mesh) -> Vec<f64> {
    mesh.positions.iter().flat_map(|p| p.to_array()).collect()
}

fn worst(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, |m, d| if d >= 0.0 { m.max(d) } else { f64::NAN })
}

#[test]
fn the_identity_changes_nothing() {
    let mesh = uv_sphere(1.0, 12, 7);
    let labels: Vec<f64> = (0..mesh.vertex_count()).map(|v| (v % 5) as f64).collect();
    let given = [
        attribute(AttributeKind::Scalars, 3, coordinates(&mesh)),
        attribute(AttributeKind::Labels, 1, labels),
        attribute(AttributeKind::Vectors, 3, coordinates(&mesh)),
    ];
    let out = run(&mesh, &mesh, same, &given, Fill::Smooth).unwrap();
    for (a, b) in given.iter().zip(&out.attributes) {
        assert!(worst(&a.values, &b.values) < 1e-12, "{:?}", a.kind);
    }
    assert_eq!(out.count(VertexStatus::Valid), mesh.vertex_count());
}

#[test]
fn scalars_are_linear_in_the_sources_triangle() {
    let (source, target) = (uv_sphere(2.0, 9, 6), uv_sphere(1.0, 20, 11));
    let faces = source.triangle_count() as u32;
    let map = |p: SurfacePoint| (SurfacePoint::new((7 * p.face) % faces, [0.5, 0.2, 0.3]), Status::Valid);
    let out =
        run(&source, &target, map, &[attribute(AttributeKind::Scalars, 3, coordinates(&source))], Fill::None).unwrap();
    // The linear interpolation of positions is the point itself.
    let wanted: Vec<f64> = out.map.positions.iter().flat_map(|p| p.unwrap().to_array()).collect();
    assert!(worst(&out.attributes[0].values, &wanted) < 1e-12);
}

#[test]
fn the_corners_with_a_label_weigh_together() {
    let mesh = Mesh::of_triangles("one", vec![DVec3::ZERO, DVec3::X, DVec3::Y], &[[0, 1, 2]]);
    let map = |_| (SurfacePoint::new(0, [0.4, 0.3, 0.3]), Status::Valid);
    let labels = attribute(AttributeKind::Labels, 1, vec![1.0, 2.0, 2.0]);
    let out = run(&mesh, &mesh, map, &[labels], Fill::None).unwrap();
    assert_eq!(out.attributes[0].values, [2.0; 3]);
}

#[test]
fn weights_are_the_largest_few_and_sum_to_one() {
    let mesh = Mesh::of_triangles("one", vec![DVec3::ZERO, DVec3::X, DVec3::Y], &[[0, 1, 2]]);
    let map = |_| (SurfacePoint::new(0, [0.5, 0.25, 0.25]), Status::Valid);
    let rows = vec![4.0, 0.0, 0.0, 4.0, 0.0, 4.0, 4.0, 0.0, 0.0, 2.0, 0.0, 2.0];
    let keep = |keep| attribute(AttributeKind::Weights { keep }, 4, rows.clone());
    // 0.5 (4,0,0,4) + 0.25 (0,4,4,0) + 0.25 (0,2,0,2) = (2, 1.5, 1, 2.5).
    let out = run(&mesh, &mesh, map, &[keep(0), keep(3), keep(2)], Fill::None).unwrap();
    let row = |k: usize| out.attributes[k].values[..4].to_vec();
    assert!(worst(&row(0), &[2.0 / 7.0, 1.5 / 7.0, 1.0 / 7.0, 2.5 / 7.0]) < 1e-7);
    assert!(worst(&row(1), &[2.0 / 6.0, 1.5 / 6.0, 0.0, 2.5 / 6.0]) < 1e-7);
    assert!(worst(&row(2), &[2.0 / 4.5, 0.0, 0.0, 2.5 / 4.5]) < 1e-7);
}

/// The target is the source turned, twice as large and moved: vectors turn with it.
#[test]
fn vectors_turn_with_the_surface() {
    let source = uv_sphere(1.0, 24, 13);
    let turn = DMat3::from_axis_angle(DVec3::new(0.3, 1.0, -0.4).normalize(), 0.9);
    let mut target = source.clone();
    target.positions.iter_mut().for_each(|p| *p = turn * *p * 2.0 + DVec3::ONE);
    let field: Vec<DVec3> = source.positions.iter().map(|p| DVec3::new(p.y, 2.0 * p.z, 1.0 - p.x)).collect();
    let flat = |list: Vec<DVec3>| list.iter().flat_map(|v| v.to_array()).collect::<Vec<f64>>();
    let normals = vertex_normals(&source, &Topology::new(&source));
    let across: Vec<DVec3> = normals.iter().map(|n| n.any_orthonormal_vector()).collect();
    let hands: Vec<f64> = across.iter().flat_map(|v| [v.x, v.y, v.z, -1.0]).collect();
    let given = [
        attribute(AttributeKind::Vectors, 3, flat(field.clone())),
        attribute(AttributeKind::Normals, 3, flat(source.positions.iter().map(|p| *p * 0.3).collect())),
        attribute(AttributeKind::Tangents, 4, hands),
    ];
    let out = run(&source, &target, same, &given, Fill::Smooth).unwrap();
    let vectors = &out.attributes[0].values;
    assert!(worst(vectors, &flat(field.iter().map(|v| turn * *v).collect())) < 1e-9);
    // What is not turned is not right.
    assert!(worst(vectors, &flat(field)) > 0.1);
    assert!(
        worst(&out.attributes[1].values, &flat(source.positions.iter().map(|p| turn * p.normalize()).collect())) < 1e-9
    );
    for (row, t) in out.attributes[2].values.chunks_exact(4).zip(&across) {
        assert!((DVec3::from_slice(row) - turn * *t).length() < 1e-9 && row[3] == -1.0);
    }
}

#[test]
fn a_mirror_image_turns_handedness_over() {
    let source = plane_grid(4, 4, 1.0, 1.0, Diagonal::Forward);
    // Seen from the same side.
    let mirrored = source.positions.iter().map(|p| DVec3::new(-p.x, p.y, p.z)).collect();
    let turned: Vec<[u32; 3]> = source.triangles().iter().map(|[a, b, c]| [*a, *c, *b]).collect();
    let target = Mesh::of_triangles("mirrored", mirrored, &turned);
    let same = |p: SurfacePoint| {
        let [a, b, c] = p.barycentric;
        (SurfacePoint::new(p.face, [a, c, b]), Status::Valid)
    };
    let values = [1.0, 0.0, 0.0, 1.0].repeat(source.vertex_count());
    let out = run(&source, &target, same, &[attribute(AttributeKind::Tangents, 4, values)], Fill::None).unwrap();
    for row in out.attributes[0].values.chunks_exact(4) {
        assert!(worst(row, &[-1.0, 0.0, 0.0, -1.0]) < 1e-9, "{row:?}");
    }
}

#[test]
fn holes_are_filled_by_harmonic_functions() {
    let mesh = plane_grid(12, 12, 1.0, 1.0, Diagonal::Forward);
    let inside = |p: DVec3| (p.x - 0.5).abs() < 0.3 && (p.y - 0.5).abs() < 0.3;
    let centre = (mesh.bounds().unwrap().0 + mesh.bounds().unwrap().1) * 0.5 - DVec3::new(0.5, 0.5, 0.0);
    let hole: Vec<bool> = mesh.positions.iter().map(|p| inside(*p - centre)).collect();
    let map = |p: SurfacePoint| {
        let v = mesh.triangle(p.face as usize)[p.dominant_corner()] as usize;
        (
            p,
            if !hole[v] {
                Status::Valid
            } else if v.is_multiple_of(2) {
                Status::Failed
            } else {
                Status::Doubtful
            },
        )
    };
    // Linear functions are harmonic on a plane; shares stay shares.
    let linear: Vec<f64> = mesh.positions.iter().map(|p| 3.0 * p.x - p.y).collect();
    let shares: Vec<f64> = mesh
        .positions
        .iter()
        .flat_map(|p| {
            let s = (3.0 * p.x).sin().abs();
            [s, 1.0 - s]
        })
        .collect();
    let labels: Vec<f64> = mesh.positions.iter().map(|p| f64::from(u8::from(p.x > centre.x + 0.5))).collect();
    let given = [
        attribute(AttributeKind::Scalars, 1, linear.clone()),
        attribute(AttributeKind::Weights { keep: 0 }, 2, shares),
        attribute(AttributeKind::Labels, 1, labels),
    ];
    let out = run(&mesh, &mesh, map, &given, Fill::Smooth).unwrap();
    assert!(worst(&out.attributes[0].values, &linear) < 1e-6);
    assert!(
        out.attributes[1]
            .values
            .chunks_exact(2)
            .all(|w| w[0] >= 0.0 && w[1] >= 0.0 && (w[0] + w[1] - 1.0).abs() < 1e-12)
    );
    assert!(out.attributes[2].values.iter().all(|&l| l == 0.0 || l == 1.0));
    let filled = hole.iter().filter(|h| **h).count();
    assert_eq!((out.count(VertexStatus::Filled), out.count(VertexStatus::Failed)), (filled, 0));
    assert!(filled > 20);

    let out = run(&mesh, &mesh, map, &given, Fill::None).unwrap();
    for (v, status) in out.status.iter().enumerate() {
        assert_eq!(out.attributes[0].values[v].is_nan(), *status == VertexStatus::Failed);
    }
    assert_eq!(out.count(VertexStatus::Failed) + out.count(VertexStatus::Doubtful), filled);
    assert!(out.count(VertexStatus::Doubtful) > 0);
}

#[test]
fn a_part_without_anything_stays_without() {
    let one = plane_grid(2, 2, 1.0, 1.0, Diagonal::Forward);
    let mut positions = one.positions.clone();
    positions.extend(one.positions.iter().map(|p| *p + DVec3::X * 9.0));
    positions.push(DVec3::ZERO);
    let n = one.vertex_count() as u32;
    let triangles: Vec<[u32; 3]> = one.triangles().iter().flat_map(|t| [*t, t.map(|v| v + n)]).collect();
    let mesh = Mesh::of_triangles("two", positions, &triangles);
    let map = |p: SurfacePoint| (p, if mesh.triangle(p.face as usize)[0] < n { Status::Valid } else { Status::Failed });
    let values = vec![1.0; mesh.vertex_count()];
    let out = run(&mesh, &mesh, map, &[attribute(AttributeKind::Scalars, 1, values)], Fill::Smooth).unwrap();
    assert_eq!(out.count(VertexStatus::Failed), n as usize + 1);
    assert_eq!(out.attributes[0].values.iter().filter(|v| v.is_nan()).count(), n as usize + 1);
}

#[test]
fn bad_data_are_named() {
    let mesh = uv_sphere(1.0, 6, 4);
    let n = mesh.vertex_count();
    let mut nan = vec![0.5; 2 * n];
    nan[7] = f64::NAN;
    let mut negative = vec![0.5; 2 * n];
    negative[5] = -0.1;
    let weights = AttributeKind::Weights { keep: 4 };
    let cases = [
        (attribute(AttributeKind::Scalars, 2, vec![0.0; 2 * n - 2]), "vertices"),
        (attribute(AttributeKind::Scalars, 2, nan), "vertex 3, column 1: NaN"),
        (attribute(weights, 2, negative.clone()), "vertex 2, column 1: the weight -0.1 is negative"),
        (attribute(AttributeKind::Vectors, 2, vec![0.0; 2 * n]), "three columns"),
        (attribute(AttributeKind::Tangents, 6, vec![0.0; 6 * n]), "three or four"),
        (attribute(AttributeKind::Scalars, 0, vec![]), "at least one"),
    ];
    for (bad, words) in cases {
        let message = run(&mesh, &mesh, same, &[bad], Fill::None).unwrap_err().to_string();
        assert!(message.contains(words) && message.contains("data"), "{message}");
    }
    assert!(run(&mesh, &mesh, same, &[attribute(AttributeKind::Scalars, 2, negative)], Fill::None).is_ok());
}
