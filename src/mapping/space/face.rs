//! The faces of a step: a triangle, and the displacement that is linear on it.

use glam::DVec3;

use crate::engine::Real;

/// A triangle of a cage as the formulas read it. Edge `j` lies opposite to corner `j` and runs from
/// corner `j + 1` to `j + 2`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Face<E> {
    pub(super) corners: [[E; 3]; 3],
    /// Unit normal.
    pub(super) normal: [E; 3],
    /// Unit directions of the edges, and their lengths.
    pub(super) edges: [[E; 3]; 3],
    pub(super) lengths: [E; 3],
    /// Unit normals of the edges in the plane of the face, to the inside: normal x edge.
    pub(super) inward: [[E; 3]; 3],
    /// Unit directions from the corners to the barycentre.
    pub(super) toward: [[E; 3]; 3],
    /// Displacement of corner 0.
    pub(super) displacement: [E; 3],
    /// Derivative of the displacement, row by row; the normal goes to zero.
    pub(super) gradient: [[E; 3]; 3],
    /// Derivative of the displacement along each of `inward`.
    pub(super) slopes: [[E; 3]; 3],
    /// Heights of the corners over their edges.
    pub(super) heights: [E; 3],
}

impl Face<f64> {
    /// The face with these corners and displacements of them; `None` where it has no area.
    pub(super) fn new(corners: [DVec3; 3], displacements: [DVec3; 3]) -> Option<Self> {
        let [v0, v1, v2] = corners;
        let across = (v1 - v0).cross(v2 - v0);
        let area = across.length();
        let normal = across / area;
        let edge = |j: usize| corners[(j + 2) % 3] - corners[(j + 1) % 3];
        let lengths = [0, 1, 2].map(|j| edge(j).length());
        let edges = [0, 1, 2].map(|j| edge(j) / lengths[j]);
        let inward = edges.map(|e| normal.cross(e));
        let heights = lengths.map(|l| area / l);
        let middle = (v0 + v1 + v2) / 3.0;
        // The gradient of the hat function of corner i is its inward normal over its height.
        let mut gradient = [[0.0; 3]; 3];
        for i in 0..3 {
            let (hat, moved) = ((inward[i] / heights[i]).to_array(), (displacements[i] - displacements[0]).to_array());
            for row in 0..3 {
                (0..3).for_each(|axis| gradient[row][axis] += moved[row] * hat[axis]);
            }
        }
        let slope = |m: DVec3| gradient.map(|row| DVec3::from(row).dot(m));
        let face = Self {
            corners: corners.map(|v| v.to_array()),
            normal: normal.to_array(),
            edges: edges.map(|e| e.to_array()),
            lengths,
            inward: inward.map(|m| m.to_array()),
            toward: corners.map(|v| (middle - v).normalize_or_zero().to_array()),
            displacement: displacements[0].to_array(),
            gradient,
            slopes: inward.map(slope),
            heights,
        };
        let finite = area > 0.0 && area.is_finite() && lengths.iter().all(|l| *l > 0.0) && normal.is_finite();
        finite.then_some(face)
    }

    /// The same face in another precision.
    pub(super) fn cast<T: Real>(&self) -> Face<T> {
        let vector = |v: [f64; 3]| v.map(T::of);
        let vectors = |v: [[f64; 3]; 3]| v.map(vector);
        Face {
            corners: vectors(self.corners),
            normal: vector(self.normal),
            edges: vectors(self.edges),
            lengths: vector(self.lengths),
            inward: vectors(self.inward),
            toward: vectors(self.toward),
            displacement: vector(self.displacement),
            gradient: vectors(self.gradient),
            slopes: vectors(self.slopes),
            heights: vector(self.heights),
        }
    }
}
