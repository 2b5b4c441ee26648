//! Connectivity of polygon meshes and of their subdivision into quads.

use crate::error::{Error, Result};
use crate::geometry::{Corner, Mesh, MeshBuilder, NONE};
use crate::surface::stencils::Stencils;

/// A mesh of polygons over numbered vertices.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Polygons {
    pub(super) vertices: usize,
    /// First corner of each polygon, and the number of corners at the end.
    pub(super) start: Vec<u32>,
    pub(super) corners: Vec<u32>,
}

/// A polygon mesh one level finer: the coarser vertices, one vertex for each edge, one for each
/// polygon; a quad for each corner.
#[derive(Debug)]
pub(super) struct Refined {
    pub(super) polygons: Polygons,
    /// The averages that make the new vertices.
    pub(super) rows: Stencils,
}

impl Polygons {
    /// The polygons of a mesh, without unused vertices, and the vertices that are used.
    ///
    /// # Errors
    /// [`Error::Mesh`] naming the face: fewer than three corners, a vertex twice; or no face at
    /// all.
    pub(super) fn of(mesh: &Mesh) -> Result<(Self, Vec<u32>)> {
        let mut number = vec![NONE; mesh.vertex_count()];
        for p in 0..mesh.polygon_count() {
            let corners = mesh.polygon(p);
            if corners.len() < 3 {
                let what = format!("face {p} has {} corners", corners.len());
                return Err(Error::mesh(&mesh.name, what, "Give faces of three corners or more, best of four"));
            }
            let mut sorted: Vec<u32> = corners.iter().map(|c| c.vertex).collect();
            sorted.sort_unstable();
            if let Some(w) = sorted.windows(2).find(|w| w[0] == w[1]) {
                let what = format!("face {p} has vertex {} twice", w[0]);
                return Err(Error::mesh(&mesh.name, what, "Merge its corners"));
            }
            corners.iter().for_each(|c| number[c.vertex as usize] = 0);
        }
        if mesh.polygon_count() == 0 {
            return Err(Error::mesh(&mesh.name, "it has no face", "Give a coarse mesh of quads"));
        }
        let used: Vec<u32> = (0..number.len() as u32).filter(|&v| number[v as usize] == 0).collect();
        used.iter().zip(0..).for_each(|(&v, n)| number[v as usize] = n);
        let mut polygons = Self { vertices: used.len(), start: vec![0], corners: Vec::new() };
        for p in 0..mesh.polygon_count() {
            polygons.corners.extend(mesh.polygon(p).iter().map(|c| number[c.vertex as usize]));
            polygons.start.push(polygons.corners.len() as u32);
        }
        Ok((polygons, used))
    }

    pub(super) fn len(&self) -> usize {
        self.start.len() - 1
    }

    pub(super) fn polygon(&self, p: usize) -> &[u32] {
        &self.corners[self.start[p] as usize..self.start[p + 1] as usize]
    }

    /// Polygons that are no quads.
    pub(super) fn others(&self) -> usize {
        (0..self.len()).filter(|&p| self.polygon(p).len() != 4).count()
    }

    /// The edges, lowest vertex first, rising, each with the number of polygons it has.
    pub(super) fn edges(&self) -> Vec<([u32; 2], u32)> {
        let mut all: Vec<[u32; 2]> = (0..self.len())
            .flat_map(|p| {
                let c = self.polygon(p);
                (0..c.len()).map(move |k| edge(c[k], c[(k + 1) % c.len()]))
            })
            .collect();
        all.sort_unstable();
        all.chunk_by(|a, b| a == b).map(|group| (group[0], group.len() as u32)).collect()
    }

    /// One level finer.
    pub(super) fn refined(&self) -> Refined {
        let edges = self.edges();
        let first_face = self.vertices + edges.len();
        let mut rows = Stencils::default();
        edges.iter().for_each(|([a, b], _)| rows.push(*a, [*a, *b], 1.0));
        let mut finer = Self { vertices: first_face + self.len(), start: vec![0], corners: Vec::new() };
        for p in 0..self.len() {
            let c = self.polygon(p);
            rows.push(c[0], c.iter().copied(), 1.0);
            let n = c.len();
            let middle = |k: usize| {
                let e = edge(c[k % n], c[(k + 1) % n]);
                (self.vertices + edges.partition_point(|(other, _)| *other < e)) as u32
            };
            for k in 0..n {
                finer.corners.extend([c[k], middle(k), (first_face + p) as u32, middle(k + n - 1)]);
                finer.start.push(finer.corners.len() as u32);
            }
        }
        Refined { polygons: finer, rows }
    }

    /// The averages of one step of Laplacian smoothing: each vertex and the mean of its neighbours
    /// over edges. Vertices of edges that do not have two polygons stay.
    pub(super) fn smoothing(&self, step: f64) -> Stencils {
        let edges = self.edges();
        let mut fixed = vec![false; self.vertices];
        let mut around: Vec<Vec<u32>> = vec![Vec::new(); self.vertices];
        for ([a, b], count) in edges {
            around[a as usize].push(b);
            around[b as usize].push(a);
            if count != 2 {
                (fixed[a as usize], fixed[b as usize]) = (true, true);
            }
        }
        let mut rows = Stencils::default();
        for (v, ring) in around.into_iter().enumerate() {
            rows.push(v as u32, if fixed[v] { Vec::new() } else { ring }, step);
        }
        rows
    }

    /// As a mesh.
    pub(super) fn mesh(&self, name: &str, positions: Vec<glam::DVec3>) -> Mesh {
        let mut builder = MeshBuilder::new(name);
        builder.mesh.positions = positions;
        for p in 0..self.len() {
            builder.polygon(self.polygon(p).iter().map(|&vertex| Corner { vertex, texcoord: NONE, normal: NONE }));
        }
        builder.finish()
    }
}

fn edge(a: u32, b: u32) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    fn polygons(vertices: usize, faces: &[&[u32]]) -> Polygons {
        let mut builder = MeshBuilder::new("m");
        builder.mesh.positions = vec![DVec3::ZERO; vertices];
        for f in faces {
            builder.polygon(f.iter().map(|&vertex| Corner { vertex, texcoord: NONE, normal: NONE }));
        }
        Polygons::of(&builder.finish()).unwrap().0
    }

    #[test]
    fn refinement_counts_and_keeps_orientation() {
        // A prism: two triangles and three quads.
        let p = polygons(6, &[&[0, 2, 1], &[3, 4, 5], &[0, 1, 4, 3], &[1, 2, 5, 4], &[2, 0, 3, 5]]);
        let fine = p.refined();
        assert_eq!((p.others(), fine.polygons.len(), fine.polygons.vertices), (2, 18, 6 + 9 + 5));
        assert_eq!((fine.rows.len(), fine.polygons.others()), (14, 0));
        // Closed, and every edge run through once each way.
        for q in [&p, &fine.polygons, &fine.polygons.refined().polygons] {
            assert!(q.edges().iter().all(|(_, count)| *count == 2));
            let mut directed: Vec<[u32; 2]> = (0..q.len())
                .flat_map(|f| {
                    let c = q.polygon(f);
                    (0..c.len()).map(move |k| [c[k], c[(k + 1) % c.len()]])
                })
                .collect();
            let n = directed.len();
            directed.sort_unstable();
            directed.dedup();
            assert_eq!(directed.len(), n);
        }
    }

    #[test]
    fn boundaries_stay_and_unused_vertices_go() {
        let p = polygons(12, &[&[0, 1, 4, 3], &[1, 2, 5, 4], &[3, 4, 7, 6], &[4, 5, 8, 7]]);
        assert_eq!(p.vertices, 9);
        let rows = p.smoothing(1.0);
        assert!((0..9).all(|v| rows.row(v).1.len() == if v == 4 { 4 } else { 0 }));
        let bad = |faces: &[&[u32]]| {
            let mut builder = MeshBuilder::new("m");
            builder.mesh.positions = vec![DVec3::ZERO; 5];
            for f in faces {
                builder.polygon(f.iter().map(|&vertex| Corner { vertex, texcoord: NONE, normal: NONE }));
            }
            Polygons::of(&builder.finish()).unwrap_err().to_string()
        };
        assert!(bad(&[&[0, 1, 2, 3], &[0, 1, 1, 3]]).contains("face 1 has vertex 1 twice"));
        assert!(bad(&[&[0, 1]]).contains("face 0 has 2 corners"));
        assert!(bad(&[]).contains("no face"));
    }
}
