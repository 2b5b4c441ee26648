//! Lines on a shape as thin tubes, for pictures.

use barymap::geometry::Mesh;
use glam::DVec3;

/// Sides of a tube.
const SIDES: usize = 8;

/// A line with its radius and colour.
pub(crate) struct Line {
    pub(crate) points: Vec<DVec3>,
    pub(crate) radius: f64,
    pub(crate) color: [u8; 3],
}

/// A shape of one colour with lines on it, and a colour for each vertex.
pub(crate) fn with_lines(mesh: &Mesh, color: [u8; 3], lines: &[Line]) -> barymap::Result<(Mesh, Vec<[u8; 3]>)> {
    let mut positions = mesh.positions.clone();
    let mut triangles = mesh.triangles();
    let mut colors = vec![color; positions.len()];
    for line in lines {
        let mut points = line.points.clone();
        points.dedup_by(|a, b| a.distance(*b) < 1e-3 * line.radius);
        let mut side = DVec3::ZERO;
        let first = positions.len();
        for (i, &p) in points.iter().enumerate() {
            let along = points[(i + 1).min(points.len() - 1)] - points[i.saturating_sub(1)];
            let along = along.normalize_or(DVec3::X);
            // The side of the ring before, turned as little as possible.
            side = (side - along * side.dot(along)).normalize_or(along.any_orthonormal_vector());
            let other = along.cross(side);
            for k in 0..SIDES {
                let (sin, cos) = (std::f64::consts::TAU * k as f64 / SIDES as f64).sin_cos();
                positions.push(p + line.radius * (cos * side + sin * other));
                colors.push(line.color);
            }
            if i > 0 {
                let ring = |i: usize, k: usize| (first + i * SIDES + k % SIDES) as u32;
                for k in 0..SIDES {
                    triangles.push([ring(i - 1, k), ring(i - 1, k + 1), ring(i, k + 1)]);
                    triangles.push([ring(i - 1, k), ring(i, k + 1), ring(i, k)]);
                }
            }
        }
    }
    Ok((Mesh::from_triangles(&mesh.name, positions, &triangles)?, colors))
}
