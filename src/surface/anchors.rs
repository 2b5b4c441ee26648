//! Pairs of corresponding points.

use crate::error::{Error, Result};
use crate::geometry::{Mesh, NONE, SurfacePoint, Topology};

/// Corresponding points of two meshes: `source[i]` and `target[i]` are the same place.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AnchorPairs {
    /// Points of the source, where the texture lives.
    pub source: Vec<SurfacePoint>,
    /// Points of the target, which receives it.
    pub target: Vec<SurfacePoint>,
}

/// A vertex as a surface point: a corner of its lowest usable triangle.
///
/// # Errors
/// If the vertex does not exist or belongs to no usable triangle; `what` names it in the message.
pub fn vertex_point(mesh: &Mesh, topology: &Topology, vertex: u32, what: &str) -> Result<SurfacePoint> {
    if vertex as usize >= mesh.vertex_count() {
        return Err(Error::input(
            format!("{what}: vertex {vertex} does not exist, {} has {} vertices", mesh.name, mesh.vertex_count()),
            "Vertex indices start at 0 and count the v lines of the file",
        ));
    }
    topology.vertex_point(vertex).ok_or_else(|| {
        Error::input(
            format!("{what}: vertex {vertex} of {} belongs to no usable triangle", mesh.name),
            "Choose a vertex of the surface",
        )
    })
}

impl AnchorPairs {
    /// Number of pairs.
    pub fn len(&self) -> usize {
        self.source.len()
    }

    /// Whether there are no pairs.
    pub fn is_empty(&self) -> bool {
        self.source.is_empty()
    }

    /// Checks that the pairs fit the two meshes and returns what is worth a warning (coincident anchors, components with no anchor).
    ///
    /// # Errors
    /// For no pairs, unequal counts, or a point that is not on its mesh.
    pub fn check(&self, source: (&Mesh, &Topology), target: (&Mesh, &Topology)) -> Result<Vec<String>> {
        if self.source.len() != self.target.len() {
            return Err(Error::input(
                format!("{} anchors on the source, {} on the target", self.source.len(), self.target.len()),
                "Give one target anchor for each source anchor, in the same order",
            ));
        }
        if self.is_empty() {
            return Err(Error::input("there are no anchors", "Give at least one pair, better twenty or more"));
        }
        let mut warnings = Vec::new();
        for (side, points, (mesh, topology)) in [("source", &self.source, source), ("target", &self.target, target)] {
            for (i, p) in points.iter().enumerate() {
                if !p.is_valid(mesh, 1e-6) {
                    return Err(Error::input(
                        format!(
                            "{side} anchor {i} (face {}, {:?}) is not a point of {}",
                            p.face, p.barycentric, mesh.name
                        ),
                        "Barycentric coordinates are nonnegative and sum to one; faces are counted from 0",
                    ));
                }
                if topology.triangle_component(p.face) == NONE {
                    return Err(Error::input(
                        format!("{side} anchor {i} lies on the degenerate triangle {} of {}", p.face, mesh.name),
                        "Move it to a neighbouring triangle",
                    ));
                }
            }
            let mut seen: Vec<(u64, u64, u64, usize)> = points
                .iter()
                .enumerate()
                .map(|(i, p)| {
                    let x = p.position(mesh);
                    (x.x.to_bits(), x.y.to_bits(), x.z.to_bits(), i)
                })
                .collect();
            seen.sort_unstable();
            for pair in seen.windows(2).filter(|w| (w[0].0, w[0].1, w[0].2) == (w[1].0, w[1].1, w[1].2)) {
                warnings.push(format!("{side} anchors {} and {} coincide", pair[0].3, pair[1].3));
            }
        }
        if self.len() < 3 {
            warnings.push(format!("only {} anchors: the map is hardly determined, give twenty or more", self.len()));
        }
        for component in 0..target.1.component_count {
            if !self.target.iter().any(|p| target.1.triangle_component(p.face) == component) {
                warnings.push(format!("component {component} of the target has no anchor: its map is a guess"));
            }
        }
        Ok(warnings)
    }
}
