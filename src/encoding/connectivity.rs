//! Rings of all vertices of a mesh, as the encoding wants them.

use crate::geometry::{Mesh, Topology};

/// The ordered ring of every vertex.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Connectivity {
    /// Neighbours in order around each vertex; empty for a vertex of no triangle.
    pub rings: Vec<Vec<u32>>,
    /// The ring is open: its first and last neighbour lie on the boundary.
    pub open: Vec<bool>,
    /// The vertex's triangles form more than one fan: the ring is the largest of them.
    pub irregular: Vec<bool>,
    /// Connected component of each vertex, or [`crate::geometry::NONE`].
    pub component: Vec<u32>,
    /// Number of components.
    pub component_count: u32,
}

impl Connectivity {
    /// The rings of `mesh`, over the triangles with three different vertices at finite positions.
    /// Triangles without area count: the surface stays whole there.
    ///
    /// Edges of more than two triangles are cuts; a vertex whose triangles form several fans gets
    /// the ring of the largest one (of equally large ones the first). O(F log F).
    pub fn new(mesh: &Mesh) -> Self {
        let triangles = mesh.triangles();
        let usable = triangles
            .iter()
            .map(|&[a, b, c]| {
                a != b && b != c && c != a && [a, b, c].iter().all(|&v| mesh.positions[v as usize].is_finite())
            })
            .collect();
        Self::from_topology(&Topology::from_triangles(mesh.vertex_count(), triangles, usable))
    }

    fn from_topology(topology: &Topology) -> Self {
        let n = topology.vertex_count();
        let mut result = Self {
            rings: Vec::with_capacity(n),
            open: vec![false; n],
            irregular: vec![false; n],
            component: topology.vertex_component.clone(),
            component_count: topology.component_count,
        };
        for v in 0..n as u32 {
            let ring = topology.one_ring(v);
            if topology.vertex_triangles(v).is_empty() {
                result.rings.push(Vec::new());
            } else {
                // Two triangles back to back are closed and have two neighbours: no ring to walk
                // around either.
                let regular = ring.fan && (ring.boundary || ring.vertices.len() > 2);
                let (vertices, open) = if regular { (ring.vertices, ring.boundary) } else { largest_fan(topology, v) };
                result.irregular[v as usize] = !regular;
                result.open[v as usize] = open;
                result.rings.push(vertices);
            }
        }
        result
    }
}

/// The longest fan of triangles around `v`, and whether it is open; at least one triangle.
fn largest_fan(topology: &Topology, v: u32) -> (Vec<u32>, bool) {
    let around = topology.vertex_triangles(v);
    let mut taken = vec![false; around.len()];
    let lowest = topology.triangles[around[0] as usize];
    let mut best: (Vec<u32>, bool) = (lowest.into_iter().filter(|&w| w != v).collect(), true);
    for first in 0..around.len() {
        if taken[first] {
            continue;
        }
        // Walk across shared edges in one direction, then in the other.
        let walk = |taken: &mut Vec<bool>, mut t: usize, mut enter: u32, out: &mut Vec<u32>| -> bool {
            loop {
                taken[t] = true;
                let triangle = topology.triangles[around[t] as usize];
                let Some(third) = triangle.into_iter().find(|&w| w != v && w != enter) else { return false };
                let Some(k) = triangle.iter().position(|&w| w == enter) else { return false };
                let across = topology.neighbours[around[t] as usize][k];
                match around.binary_search(&across) {
                    Ok(next) if next == first => return true,
                    Ok(next) if !taken[next] => {
                        out.push(third);
                        (t, enter) = (next, third);
                    }
                    _ => {
                        out.push(third);
                        return false;
                    }
                }
            }
        };
        let triangle = topology.triangles[around[first] as usize];
        let c = topology.corner_of(around[first], v).unwrap_or(0);
        let (a, b) = (triangle[(c + 1) % 3], triangle[(c + 2) % 3]);
        let mut forward = vec![a];
        let mut closed = walk(&mut taken, first, a, &mut forward);
        let mut ring = forward;
        if !closed {
            let mut backward = Vec::new();
            walk(&mut taken, first, b, &mut backward);
            // The first step of the walk back is `a` itself.
            backward.reverse();
            backward.pop();
            backward.extend(ring);
            ring = backward;
            if ring.len() > 3 && ring.first() == ring.last() {
                // Both ends on one edge of many triangles: around the vertex the fan is closed.
                ring.pop();
                closed = true;
            }
        }
        let mut distinct = ring.clone();
        distinct.sort_unstable();
        distinct.dedup();
        if distinct.len() == ring.len() && ring.len() > best.0.len() {
            best = (ring, !closed);
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rings(n: usize, t: &[[u32; 3]]) -> Connectivity {
        Connectivity::from_topology(&Topology::from_triangles(n, t.to_vec(), vec![true; t.len()]))
    }

    #[test]
    fn a_vertex_of_two_fans_takes_the_larger_one() {
        let c = rings(8, &[[0, 1, 2], [0, 4, 5], [0, 3, 4], [0, 5, 6]]);
        assert!(c.irregular[0] && c.open[0]);
        assert_eq!(c.rings[0], [3, 4, 5, 6]);
        assert!(c.rings[7].is_empty());
        // A closed fan beside an open one.
        let c = rings(7, &[[0, 1, 2], [0, 2, 3], [0, 3, 1], [0, 4, 5]]);
        assert!(c.irregular[0] && !c.open[0]);
        assert_eq!(c.rings[0], [1, 2, 3]);
    }

    #[test]
    fn every_vertex_of_a_triangle_has_a_ring() {
        // A tetrahedron with a flap of two triangles back to back on the edge 0-1.
        let c = rings(5, &[[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2], [0, 1, 4], [1, 0, 4]]);
        assert!(c.irregular[0] && c.irregular[1] && c.irregular[4] && !c.irregular[2]);
        assert_eq!((c.rings[0].len(), c.open[0]), (3, false));
        assert_eq!(c.rings[4].len(), 2);
        // The same triangle three times.
        let c = rings(3, &[[0, 1, 2]; 3]);
        assert!(c.rings.iter().all(|r| r.len() == 2) && c.irregular.iter().all(|i| *i));
    }
}
