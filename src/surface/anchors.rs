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

    /// The pairs of these numbers, in this order.
    pub(crate) fn part(&self, numbers: &[usize]) -> Self {
        let of = |points: &[SurfacePoint]| numbers.iter().map(|&i| points[i]).collect();
        Self { source: of(&self.source), target: of(&self.target) }
    }

    /// Checks that the pairs fit the two meshes and returns what is worth a warning (coincident
    /// anchors, components with no anchor).
    ///
    /// # Errors
    /// For no pairs, unequal counts, a point that is not on its mesh, or the adjacency of another
    /// mesh.
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
            topology.check(mesh)?;
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
        let follow = "follow the nearest part that has one, as a whole, and are doubtful";
        if let Some(warning) = without_anchor("target", &self.target, target.1, follow) {
            warnings.push(warning);
            // Where the target has none they are like any part.
            warnings.extend(without_anchor("source", &self.source, source.1, "receive nothing but such parts"));
        }
        Ok(warnings)
    }
}

/// Parts named in a message, at most.
const NAMED: usize = 20;

/// One line about the components without an anchor, each named by its first face and its number of
/// vertices; nothing where all have one.
fn without_anchor(side: &str, points: &[SurfacePoint], topology: &Topology, what: &str) -> Option<String> {
    let count = topology.component_count as usize;
    let mut has = vec![false; count];
    for c in points.iter().map(|p| topology.triangle_component(p.face)).filter(|&c| c != NONE) {
        has[c as usize] = true;
    }
    let (mut face, mut vertices) = (vec![NONE; count], vec![0usize; count]);
    for t in (0..topology.triangles.len() as u32).rev() {
        let c = topology.triangle_component(t);
        if c != NONE {
            face[c as usize] = t;
        }
    }
    topology.vertex_component.iter().filter(|c| **c != NONE).for_each(|&c| vertices[c as usize] += 1);
    let mut parts: Vec<(u32, usize)> = (0..count).filter(|&c| !has[c]).map(|c| (face[c], vertices[c])).collect();
    if parts.is_empty() {
        return None;
    }
    parts.sort_unstable();
    let named: Vec<String> =
        parts.iter().take(NAMED).map(|(f, n)| format!("from face {f} on ({n} vertices)")).collect();
    let more = if parts.len() > NAMED { format!(" and {} more", parts.len() - NAMED) } else { String::new() };
    Some(format!("parts of the {side} without an anchor {what}: {}{more}", named.join(", ")))
}
