//! Who touches whom in a triangle mesh.

use super::{Mesh, NONE, SurfacePoint};
use crate::error::{Error, Result};

/// Adjacency of the usable triangles of a mesh.
///
/// A triangle is *usable* if its vertices differ and its area is positive. Across an edge shared by
/// exactly two usable triangles these are neighbours, also when they are oriented against each
/// other; an edge with one or more than two usable triangles is treated as boundary, so that
/// non-manifold spots become cuts.
#[derive(Clone, Debug)]
pub struct Topology {
    /// Vertices of every triangle, unusable ones included.
    pub triangles: Vec<[u32; 3]>,
    /// Whether a triangle takes part in computations.
    pub usable: Vec<bool>,
    /// `neighbours[t][k]` lies across the edge opposite to corner `k`, or [`NONE`].
    pub neighbours: Vec<[u32; 3]>,
    /// Connected component (over shared vertices) of each vertex, or [`NONE`] for vertices of no
    /// usable triangle. Numbered by lowest vertex.
    pub vertex_component: Vec<u32>,
    /// Number of components.
    pub component_count: u32,
    /// Number of edges with more than two usable triangles.
    pub nonmanifold_edges: usize,
    /// Number of edges with one usable triangle.
    pub boundary_edges: usize,
    /// Number of inner edges whose two triangles are oriented against each other.
    pub misoriented_edges: usize,
    vertex_start: Vec<u32>,
    vertex_triangles: Vec<u32>,
}

/// The triangles and vertices around a vertex.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OneRing {
    /// Neighbouring vertices; in order around the vertex where `fan` is set, else ascending. The
    /// first is not repeated.
    pub vertices: Vec<u32>,
    /// The triangles form one fan (closed or open).
    pub fan: bool,
    /// The fan is open: first and last neighbour lie on the boundary.
    pub boundary: bool,
}

impl Topology {
    /// Adjacency of `mesh`. O(F log F).
    pub fn new(mesh: &Mesh) -> Self {
        let triangles = mesh.triangles();
        let usable: Vec<bool> = (0..triangles.len())
            .map(|t| {
                let [a, b, c] = triangles[t];
                let area = mesh.triangle_area(t);
                a != b && b != c && c != a && area > 0.0 && area.is_finite()
            })
            .collect();
        Self::from_triangles(mesh.vertex_count(), triangles, usable)
    }

    /// Adjacency of triangles over `vertex_count` vertices, with the unusable ones marked by the
    /// caller.
    pub(crate) fn from_triangles(vertex_count: usize, triangles: Vec<[u32; 3]>, usable: Vec<bool>) -> Self {
        let mut edges: Vec<(u32, u32, u32, u32)> = Vec::with_capacity(3 * triangles.len());
        for (t, tri) in triangles.iter().enumerate().filter(|(t, _)| usable[*t]) {
            for k in 0..3 {
                let (a, b) = (tri[(k + 1) % 3], tri[(k + 2) % 3]);
                edges.push((a.min(b), a.max(b), t as u32, k as u32));
            }
        }
        edges.sort_unstable();
        let mut neighbours = vec![[NONE; 3]; triangles.len()];
        let (mut nonmanifold_edges, mut boundary_edges, mut misoriented_edges) = (0, 0, 0);
        for group in edges.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
            match group {
                [_] => boundary_edges += 1,
                [(_, _, s, i), (_, _, t, j)] => {
                    neighbours[*s as usize][*i as usize] = *t;
                    neighbours[*t as usize][*j as usize] = *s;
                    let from = |t: u32, k: u32| triangles[t as usize][(k as usize + 1) % 3];
                    misoriented_edges += usize::from(from(*s, *i) == from(*t, *j));
                }
                _ => nonmanifold_edges += 1,
            }
        }
        let mut vertex_start = vec![0u32; vertex_count + 1];
        for tri in triangles.iter().zip(&usable).filter(|(_, u)| **u).map(|(t, _)| t) {
            for &v in tri {
                vertex_start[v as usize + 1] += 1;
            }
        }
        for v in 0..vertex_count {
            vertex_start[v + 1] += vertex_start[v];
        }
        let mut fill = vertex_start.clone();
        let mut vertex_triangles = vec![0; vertex_start[vertex_count] as usize];
        for (t, tri) in triangles.iter().enumerate().filter(|(t, _)| usable[*t]) {
            for &v in tri {
                vertex_triangles[fill[v as usize] as usize] = t as u32;
                fill[v as usize] += 1;
            }
        }
        let mut topology = Self {
            triangles,
            usable,
            neighbours,
            vertex_component: vec![NONE; vertex_count],
            component_count: 0,
            nonmanifold_edges,
            boundary_edges,
            misoriented_edges,
            vertex_start,
            vertex_triangles,
        };
        topology.label_components();
        topology
    }

    /// Fails for the adjacency of a mesh with other numbers of vertices or triangles.
    ///
    /// # Errors
    /// [`Error::Mesh`].
    pub(crate) fn check(&self, mesh: &Mesh) -> Result<()> {
        if self.vertex_count() == mesh.vertex_count() && self.triangles.len() == mesh.triangle_count() {
            return Ok(());
        }
        Err(Error::mesh(&mesh.name, "its adjacency is that of another mesh", "Build it from this mesh"))
    }

    /// The same mesh with the triangles of the components that `keep` refuses marked unusable.
    /// Components are numbered anew. O(F log F).
    pub fn restricted(&self, keep: impl Fn(u32) -> bool) -> Self {
        let kept = |t: u32| self.usable[t as usize] && keep(self.triangle_component(t));
        let usable = (0..self.triangles.len() as u32).map(kept).collect();
        Self::from_triangles(self.vertex_count(), self.triangles.clone(), usable)
    }

    fn label_components(&mut self) {
        let mut stack = Vec::new();
        for seed in 0..self.vertex_component.len() {
            if self.vertex_component[seed] != NONE || self.vertex_triangles(seed as u32).is_empty() {
                continue;
            }
            let label = self.component_count;
            self.component_count += 1;
            self.vertex_component[seed] = label;
            stack.push(seed as u32);
            while let Some(v) = stack.pop() {
                for i in self.vertex_start[v as usize]..self.vertex_start[v as usize + 1] {
                    for w in self.triangles[self.vertex_triangles[i as usize] as usize] {
                        if self.vertex_component[w as usize] == NONE {
                            self.vertex_component[w as usize] = label;
                            stack.push(w);
                        }
                    }
                }
            }
        }
    }

    /// Number of vertices, used or not.
    pub fn vertex_count(&self) -> usize {
        self.vertex_component.len()
    }

    /// The usable triangles around vertex `v`, ascending.
    pub fn vertex_triangles(&self, v: u32) -> &[u32] {
        &self.vertex_triangles[self.vertex_start[v as usize] as usize..self.vertex_start[v as usize + 1] as usize]
    }

    /// Component of triangle `t`, or [`NONE`] if it is unusable.
    pub fn triangle_component(&self, t: u32) -> u32 {
        if self.usable[t as usize] { self.vertex_component[self.triangles[t as usize][0] as usize] } else { NONE }
    }

    /// The corner (0, 1, 2) of triangle `t` that is vertex `v`.
    pub fn corner_of(&self, t: u32, v: u32) -> Option<usize> {
        self.triangles[t as usize].iter().position(|&w| w == v)
    }

    /// Vertex `v` as a corner of its lowest usable triangle; `None` if it has none.
    pub fn vertex_point(&self, v: u32) -> Option<SurfacePoint> {
        let &t = self.vertex_triangles(v).first()?;
        let barycentric = self.triangles[t as usize].map(|w| if w == v { 1.0 } else { 0.0 });
        Some(SurfacePoint::new(t, barycentric))
    }

    /// The neighbours of vertex `v`, in order around it where its triangles form one fan.
    ///
    /// A closed fan starts at the vertex after `v` in its lowest triangle and runs with that
    /// triangle's orientation; an open one starts at the boundary so that it runs with the
    /// orientation of its first triangle.
    pub fn one_ring(&self, v: u32) -> OneRing {
        let around = self.vertex_triangles(v);
        let Some(&first) = around.first() else {
            return OneRing { vertices: Vec::new(), fan: false, boundary: false };
        };
        // Leaving corner c of t, `next` crosses the edge (v, c+2) and `previous` the edge (v, c+1).
        let step = |t: u32, enter: u32| -> (u32, u32) {
            // The third vertex, and the triangle across the edge (v, third).
            let tri = self.triangles[t as usize];
            let third = tri.into_iter().find(|&w| w != v && w != enter).unwrap_or(NONE);
            let across = tri.iter().position(|&w| w == enter).map_or(NONE, |k| self.neighbours[t as usize][k]);
            (third, across)
        };
        let c = self.corner_of(first, v).unwrap_or(0);
        let tri = self.triangles[first as usize];
        let (mut start_triangle, mut start_vertex) = (first, tri[(c + 1) % 3]);
        // Walk backwards to the boundary, if there is one.
        let (mut t, mut enter) = (first, tri[(c + 2) % 3]);
        let mut boundary = false;
        for _ in 0..around.len() {
            let (third, across) = step(t, enter);
            (start_triangle, start_vertex) = (t, third);
            if across == NONE {
                boundary = true;
                break;
            }
            if across == first {
                (start_triangle, start_vertex) = (first, tri[(c + 1) % 3]);
                break;
            }
            (t, enter) = (across, third);
        }
        let mut vertices = vec![start_vertex];
        let (mut t, mut enter) = (start_triangle, start_vertex);
        let mut seen = 0;
        loop {
            let (third, across) = step(t, enter);
            seen += 1;
            if across == NONE {
                vertices.push(third);
                break;
            }
            if across == start_triangle || seen >= around.len() {
                break;
            }
            vertices.push(third);
            (t, enter) = (across, third);
        }
        let mut distinct = vertices.clone();
        distinct.sort_unstable();
        distinct.dedup();
        if seen == around.len() && distinct.len() == vertices.len() {
            return OneRing { vertices, fan: true, boundary };
        }
        let mut all: Vec<u32> = around.iter().flat_map(|&t| self.triangles[t as usize]).filter(|&w| w != v).collect();
        all.sort_unstable();
        all.dedup();
        OneRing { vertices: all, fan: false, boundary: true }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn topology(n: usize, t: &[[u32; 3]]) -> Topology {
        Topology::from_triangles(n, t.to_vec(), vec![true; t.len()])
    }

    #[test]
    fn closed_fan_is_ordered() {
        let t = topology(4, &[[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]);
        let ring = t.one_ring(0);
        assert_eq!(ring, OneRing { vertices: vec![1, 2, 3], fan: true, boundary: false });
        assert_eq!((t.boundary_edges, t.nonmanifold_edges, t.misoriented_edges), (0, 0, 0));
    }

    #[test]
    fn open_fan_starts_at_the_boundary() {
        let t = topology(5, &[[0, 2, 3], [0, 1, 2], [0, 3, 4]]);
        assert_eq!(t.one_ring(0), OneRing { vertices: vec![1, 2, 3, 4], fan: true, boundary: true });
        assert_eq!(t.one_ring(1).vertices, vec![2, 0]);
    }

    #[test]
    fn two_fans_are_no_fan() {
        let t = topology(5, &[[0, 1, 2], [0, 3, 4]]);
        let ring = t.one_ring(0);
        assert!(!ring.fan && ring.boundary);
        assert_eq!(ring.vertices, vec![1, 2, 3, 4]);
        assert_eq!(t.component_count, 1);
    }

    #[test]
    fn three_triangles_at_an_edge_become_cuts() {
        let t = topology(5, &[[0, 1, 2], [0, 1, 3], [0, 1, 4]]);
        assert_eq!(t.nonmanifold_edges, 1);
        assert!(t.neighbours.iter().flatten().all(|&n| n == NONE));
    }

    #[test]
    fn orientation_is_noticed() {
        assert_eq!(topology(4, &[[0, 1, 2], [1, 2, 3]]).misoriented_edges, 1);
        assert_eq!(topology(4, &[[0, 1, 2], [2, 1, 3]]).misoriented_edges, 0);
    }
}
