//! Cages and places for tests.

use glam::DVec3;

/// Triangles and vertices.
pub(super) type Shape = (Vec<[u32; 3]>, Vec<DVec3>);

/// A cube of side 1 about the origin, in 12 triangles.
pub(super) fn cube() -> Shape {
    box_cage(1)
}

/// A cube of side 1 whose sides are cut into `n` x `n` quads.
pub(super) fn box_cage(n: usize) -> Shape {
    let mut vertices: Vec<DVec3> = Vec::new();
    let mut triangles = Vec::new();
    let mut number = |p: DVec3| {
        vertices.iter().position(|q| q.distance(p) < 1e-9).unwrap_or_else(|| {
            vertices.push(p);
            vertices.len() - 1
        }) as u32
    };
    for axis in 0..3 {
        for side in [-0.5, 0.5] {
            let at = |i: usize, k: usize| {
                let mut p = [0.0; 3];
                p[axis] = side;
                p[(axis + 1) % 3] = i as f64 / n as f64 - 0.5;
                p[(axis + 2) % 3] = k as f64 / n as f64 - 0.5;
                DVec3::from(p)
            };
            for i in 0..n {
                for k in 0..n {
                    let q = [at(i, k), at(i + 1, k), at(i + 1, k + 1), at(i, k + 1)].map(&mut number);
                    let q = if side < 0.0 { [q[0], q[3], q[2], q[1]] } else { q };
                    triangles.extend([[q[0], q[1], q[2]], [q[0], q[2], q[3]]]);
                }
            }
        }
    }
    (triangles, vertices)
}

/// A cube with one side pushed in, and oblique: no face lies along an axis, and some edges are
/// concave.
pub(super) fn dented() -> Shape {
    let (triangles, vertices) = box_cage(2);
    let turn = glam::DMat3::from_euler(glam::EulerRot::XYZ, 0.4, 0.7, -0.3);
    let place = |v: DVec3| {
        let pushed = if v.distance(DVec3::new(0.0, 0.5, 0.0)) < 1e-9 { DVec3::new(0.05, 0.15, -0.02) } else { v };
        turn * pushed * 0.8
    };
    let vertices: Vec<DVec3> = vertices.into_iter().map(place).collect();
    let centre = super::Frame::of(&vertices, 1.0).origin();
    (triangles, vertices.into_iter().map(|v| v - centre).collect())
}

/// A sphere of 80 faces.
pub(super) fn sphere() -> Shape {
    let mesh = crate::models::shapes::icosphere(0.5, 1);
    let centre = super::Frame::of(&mesh.positions, 1.0).origin();
    (mesh.triangles(), mesh.positions.iter().map(|&p| p - centre).collect())
}

/// Places inside and outside, on faces, edges, vertices, 1e-6 off them, over corners, and on the
/// planes and lines of faces and edges.
pub(super) fn places(triangles: &[[u32; 3]], vertices: &[DVec3]) -> Vec<(String, DVec3)> {
    let mut all = Vec::new();
    let mut random = crate::models::shapes::Random::new(3);
    for k in 0..60 {
        all.push((format!("random {k}"), 0.6 * DVec3::new(random.signed(), random.signed(), random.signed())));
    }
    for (f, t) in triangles.iter().enumerate().step_by(3) {
        let [a, b, c] = t.map(|v| vertices[v as usize]);
        let normal = (b - a).cross(c - a).normalize();
        let middle = a * 0.3 + b * 0.45 + c * 0.25;
        let beyond = a * 1.7 - b * 0.4 - c * 0.3;
        all.push((format!("plane of {f}"), beyond));
        let edge = a * 0.35 + b * 0.65;
        all.push((format!("edge {f}"), edge));
        all.push((format!("line of edge {f}"), a + (a - b) * 0.3));
        all.push((format!("vertex {f}"), a));
        for off in [1e-6, -1e-6] {
            all.push((format!("off {off} face {f}"), middle + normal * off));
            all.push((format!("off {off} plane of {f}"), beyond + normal * off));
            all.push((format!("near {off} edge {f}"), edge + (normal + (b - a).cross(normal)).normalize() * off));
            all.push((format!("near {off} vertex {f}"), a + (normal + (b - a)).normalize() * off));
        }
        all.push((format!("over corner {f}"), a - normal * 0.11));
        all.push((format!("over edge {f}"), edge - normal * 0.07));
    }
    all
}
