//! What an in-between is like: volume, stretch, folds.

use glam::DVec3;

use crate::geometry::{Frame, Mesh, Topology};
use crate::surface::quality::{distortion, vertex_normals};

/// Measures of an in-between against the first mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameReport {
    /// Volume inside, in the meshes' units; of an open mesh that of the cone over it from its
    /// middle.
    pub volume: f64,
    /// Symmetrised L2 stretch efficiency of the way from the first mesh ([`distortion`]): 1 for a
    /// shape that only turned, moved or changed its size.
    pub stretch_all: f64,
    /// The same over the best 95 % of the area.
    pub stretch_best95: f64,
    /// Triangles that oppose the mean of the normals at their vertices.
    pub inverted: usize,
    /// Their share of the first mesh's area.
    pub inverted_area: f64,
}

/// Measures in-betweens of one mesh.
#[derive(Debug)]
pub struct FrameWatch<'a> {
    mesh: &'a Mesh,
    topology: Topology,
}

impl<'a> FrameWatch<'a> {
    /// For shapes of `mesh`.
    pub fn new(mesh: &'a Mesh) -> Self {
        Self { mesh, topology: Topology::new(mesh) }
    }

    /// Measures the mesh at `positions`, one a vertex. O(F log F).
    ///
    /// # Panics
    /// If there are fewer positions than vertices.
    pub fn measure(&self, positions: &[DVec3]) -> FrameReport {
        let triangles: Vec<[u32; 3]> = (0..self.mesh.triangle_count())
            .filter(|&t| self.topology.usable[t])
            .map(|t| self.topology.triangles[t])
            .collect();
        let shape = Mesh::of_triangles("in-between", positions.to_vec(), &triangles);
        let normals = vertex_normals(&shape, &Topology::new(&shape));
        let images: Vec<Option<DVec3>> = positions.iter().map(|p| Some(*p)).collect();
        let d = distortion(self.mesh, &self.topology, &images, &normals, shape.area());
        let frame = Frame::of_mesh(&shape).in_units();
        let used = || triangles.iter().flatten().map(|&v| frame.local(positions[v as usize]));
        let middle = used().sum::<DVec3>() / used().count().max(1) as f64;
        let cone = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| frame.local(positions[v as usize]) - middle);
            a.dot(b.cross(c)) / 6.0
        };
        FrameReport {
            volume: triangles.iter().map(cone).sum(),
            stretch_all: d.stretch_all,
            stretch_best95: d.stretch_best95,
            inverted: d.flipped_faces,
            inverted_area: d.flipped_area,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::shapes::icosphere;

    #[test]
    fn volume_stretch_and_folds() {
        let mesh = icosphere(1.0, 3);
        let watch = FrameWatch::new(&mesh);
        let same = watch.measure(&mesh.positions);
        assert!((same.volume / (4.0 / 3.0 * std::f64::consts::PI) - 1.0).abs() < 0.02);
        assert!((same.stretch_all - 1.0).abs() < 1e-9 && same.inverted == 0);
        // Far away and twice as large: eight times the volume, no stretch.
        let moved: Vec<DVec3> = mesh.positions.iter().map(|p| *p * 2.0 + DVec3::splat(1e3)).collect();
        let m = watch.measure(&moved);
        assert!((m.volume / same.volume - 8.0).abs() < 1e-6 && (m.stretch_all - 1.0).abs() < 1e-6, "{m:?}");
        // A vertex pushed over its neighbours folds.
        let mut folded = mesh.positions.clone();
        let beside = Topology::new(&mesh).one_ring(100).vertices[0] as usize;
        folded[100] = (folded[beside] * 1.8 - folded[100] * 0.8).normalize();
        assert!(watch.measure(&folded).inverted > 0);
    }
}
