//! A point on a triangle mesh.

use glam::DVec3;

use super::Mesh;

/// A point of a mesh: a triangle and barycentric coordinates in it.
///
/// `face` is the 0-based triangle after fan triangulation, in file order; `barycentric[k]` belongs
/// to the triangle's corner `k`. The coordinates are nonnegative and sum to one up to rounding. A
/// vertex or a point of an edge is the same point in each triangle around it;
/// [`SurfacePoint::dominant_corner`] helps to name the vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// The triangle.
    pub face: u32,
    /// Barycentric coordinates with respect to the triangle's corners.
    pub barycentric: [f64; 3],
}

impl SurfacePoint {
    /// A point of triangle `face`.
    pub fn new(face: u32, barycentric: [f64; 3]) -> Self {
        Self { face, barycentric }
    }

    /// The corner (0, 1 or 2) with the largest coordinate, the lowest one on ties.
    pub fn dominant_corner(&self) -> usize {
        let b = &self.barycentric;
        if b[0] >= b[1] && b[0] >= b[2] {
            0
        } else if b[1] >= b[2] {
            1
        } else {
            2
        }
    }

    /// The point in space.
    ///
    /// # Panics
    /// If `face` is not a triangle of `mesh`.
    pub fn position(&self, mesh: &Mesh) -> DVec3 {
        let [a, b, c] = mesh.triangle_positions(self.face as usize);
        a * self.barycentric[0] + b * self.barycentric[1] + c * self.barycentric[2]
    }

    /// Whether the triangle exists and the coordinates are finite, sum to one and are not below
    /// `-slack`.
    pub fn is_valid(&self, mesh: &Mesh, slack: f64) -> bool {
        let b = &self.barycentric;
        (self.face as usize) < mesh.triangle_count()
            && b.iter().all(|x| x.is_finite() && *x >= -slack)
            && (b.iter().sum::<f64>() - 1.0).abs() <= 1e-6 + 3.0 * slack
    }
}
