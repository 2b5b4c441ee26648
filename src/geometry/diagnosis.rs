//! What is odd about a mesh, in words: what is passed over, what is cut, what cannot be used.

use std::fmt;

use super::union_find::UnionFind;
use super::{Mesh, NONE, Topology};
use crate::{Error, Result};

/// A connected part of the surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Component {
    /// Usable triangles.
    pub triangles: usize,
    /// Vertices they use.
    pub vertices: usize,
    /// Their area.
    pub area: f64,
    /// Boundary loops; loops that touch at a vertex count as one.
    pub boundary_loops: usize,
    /// Handles, where the component is an oriented manifold: (2 - V + E - F - loops) / 2.
    pub genus: Option<usize>,
}

/// The state of a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Diagnosis {
    /// The mesh's name.
    pub name: String,
    /// All vertices.
    pub vertices: usize,
    /// All triangles.
    pub triangles: usize,
    /// The connected parts, in the order of [`Topology::vertex_component`].
    pub components: Vec<Component>,
    /// Edges with more than two usable triangles.
    pub nonmanifold_edges: usize,
    /// Vertices, on none of those edges, whose triangles form more than one fan.
    pub nonmanifold_vertices: usize,
    /// Inner edges whose two triangles are oriented against each other.
    pub misoriented_edges: usize,
    /// Triangles without area, or with a position that is not finite.
    pub degenerate_triangles: Vec<u32>,
    /// Usable triangles that have the vertices of an earlier one.
    pub duplicate_triangles: Vec<u32>,
    /// Used vertices that lie exactly where an earlier one lies and are not joined with it.
    pub duplicate_positions: usize,
    /// Vertices of no polygon.
    pub unreferenced_vertices: usize,
    /// Positions that are not finite, used or not.
    pub nonfinite_vertices: usize,
}

impl Diagnosis {
    /// Examines a mesh. O((V + F) log (V + F)).
    pub fn new(mesh: &Mesh, topology: &Topology) -> Self {
        let count = topology.component_count as usize;
        let empty = Component { triangles: 0, vertices: 0, area: 0.0, boundary_loops: 0, genus: None };
        let mut components = vec![empty; count];
        for &c in topology.vertex_component.iter().filter(|c| **c != NONE) {
            components[c as usize].vertices += 1;
        }
        let usable: Vec<u32> = (0..topology.triangles.len() as u32).filter(|t| topology.usable[*t as usize]).collect();
        for &t in &usable {
            let component = &mut components[topology.triangle_component(t) as usize];
            component.triangles += 1;
            component.area += mesh.triangle_area(t as usize);
        }
        let edges = Edges::new(topology, &usable);
        let nonmanifold_vertices = edges.explain(topology, &mut components);
        let mut referenced = vec![false; mesh.vertex_count()];
        for v in topology.triangles.iter().flatten() {
            referenced[*v as usize] = true;
        }
        mesh.spread(&mut referenced);
        Self {
            name: mesh.name.clone(),
            vertices: mesh.vertex_count(),
            triangles: mesh.file_triangle_count(),
            components,
            nonmanifold_edges: topology.nonmanifold_edges,
            nonmanifold_vertices,
            misoriented_edges: topology.misoriented_edges,
            degenerate_triangles: (0..mesh.triangle_count() as u32).filter(|t| !topology.usable[*t as usize]).collect(),
            duplicate_triangles: duplicate_triangles(topology, &usable),
            duplicate_positions: duplicate_positions(mesh, topology),
            unreferenced_vertices: referenced.iter().filter(|r| !**r).count(),
            nonfinite_vertices: mesh.positions.iter().filter(|p| !p.is_finite()).count(),
        }
    }

    /// Boundary loops of all components.
    pub fn boundary_loops(&self) -> usize {
        self.components.iter().map(|c| c.boundary_loops).sum()
    }

    /// Genus summed over the components, if all have one.
    pub fn genus(&self) -> Option<usize> {
        self.components.iter().map(|c| c.genus).sum()
    }

    /// Whether every edge has one or two triangles and every vertex one fan.
    pub fn is_manifold(&self) -> bool {
        self.nonmanifold_edges == 0 && self.nonmanifold_vertices == 0
    }

    /// Fails if nothing can be computed on the mesh.
    ///
    /// # Errors
    /// [`Error::Mesh`] if no triangle is usable, or the area is too large for a number.
    pub fn is_usable(&self) -> Result<()> {
        let what = if self.triangles == 0 {
            "there are no triangles".to_owned()
        } else if self.components.is_empty() {
            format!("none of the {} triangles has an area", self.triangles)
        } else if !self.components.iter().map(|c| c.area).sum::<f64>().is_finite() {
            "the coordinates are too large".to_owned()
        } else {
            return Ok(());
        };
        Err(Error::mesh(&self.name, what, "Export the surface again, or scale it"))
    }

    /// What deserves to be told, a sentence each; empty for a clean, connected mesh.
    pub fn findings(&self) -> Vec<String> {
        let mut said = Vec::new();
        let mut say = |count: usize, one: &str, many: &str, rest: String| {
            if count > 0 {
                said.push(format!("{count} {}{rest}", if count == 1 { one } else { many }));
            }
        };
        let first = |list: &[u32]| list.first().map(|t| format!(" (first: {t})")).unwrap_or_default();
        if self.components.len() > 1 {
            let rest = ": each is mapped on its own and needs anchors of its own".to_owned();
            say(self.components.len(), "component", "components", rest);
        }
        let rest = format!("{}: ignored, numbers stay", first(&self.degenerate_triangles));
        say(self.degenerate_triangles.len(), "triangle without area", "triangles without area", rest);
        let rest = format!("{}: remove them where the surface is cut", first(&self.duplicate_triangles));
        say(self.duplicate_triangles.len(), "duplicate triangle", "duplicate triangles", rest);
        let rest = " of more than two triangles: the surface is cut there".to_owned();
        say(self.nonmanifold_edges, "edge", "edges", rest);
        let rest = " where several parts of the surface touch: treated as boundary".to_owned();
        say(self.nonmanifold_vertices, "vertex", "vertices", rest);
        let rest = " with triangles oriented against each other: orient the faces alike for reliable signs".to_owned();
        say(self.misoriented_edges, "edge", "edges", rest);
        let rest =
            " exactly on another: the surface is not connected there; merge vertices by distance if it should be";
        say(self.duplicate_positions, "vertex lies", "vertices lie", rest.to_owned());
        let rest = ": kept, numbers stay".to_owned();
        say(self.unreferenced_vertices, "vertex of no face", "vertices of no face", rest);
        say(self.nonfinite_vertices, "position is", "positions are", " not finite: ignored".to_owned());
        said
    }
}

impl fmt::Display for Diagnosis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, vertices, triangles, components, .. } = self;
        write!(f, "{name}: {vertices} vertices, {triangles} triangles")?;
        match (components.len(), self.boundary_loops()) {
            (0, _) => {}
            (_, 0) => write!(f, ", closed")?,
            (_, 1) => write!(f, ", 1 boundary loop")?,
            (_, n) => write!(f, ", {n} boundary loops")?,
        }
        if let Some(genus) = self.genus() {
            write!(f, ", genus {genus}")?;
        }
        self.findings().iter().try_for_each(|finding| write!(f, "\n  {finding}"))
    }
}

/// Every edge once: its vertices, how many usable triangles it has, and whether two of them
/// disagree in orientation.
struct Edges {
    list: Vec<(u32, u32, usize, bool)>,
}

impl Edges {
    fn new(topology: &Topology, usable: &[u32]) -> Self {
        let mut sides = Vec::with_capacity(3 * usable.len());
        for &t in usable {
            let tri = topology.triangles[t as usize];
            for k in 0..3 {
                let (a, b) = (tri[k], tri[(k + 1) % 3]);
                sides.push((a.min(b), a.max(b), a < b));
            }
        }
        sides.sort_unstable();
        let groups = sides.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1));
        let list = groups.map(|g| (g[0].0, g[0].1, g.len(), g.len() == 2 && g[0].2 == g[1].2)).collect();
        Self { list }
    }

    /// Fills in loops and genus; returns the number of vertices with several fans that lie on no
    /// edge of more than two triangles.
    fn explain(&self, topology: &Topology, components: &mut [Component]) -> usize {
        let mut edge_count = vec![0usize; components.len()];
        let mut manifold = vec![true; components.len()];
        let mut on_bad_edge = vec![false; topology.vertex_count()];
        let mut loops = UnionFind::new(topology.vertex_count());
        let mut on_loop = vec![false; topology.vertex_count()];
        for &(a, b, triangles, misoriented) in &self.list {
            let c = topology.vertex_component[a as usize] as usize;
            edge_count[c] += 1;
            manifold[c] &= triangles <= 2 && !misoriented;
            if triangles > 2 {
                (on_bad_edge[a as usize], on_bad_edge[b as usize]) = (true, true);
            }
            if triangles == 1 {
                // A boundary edge between two sets of boundary vertices joins them; a loop is what
                // is joined in the end.
                let mut enter = |v: u32| usize::from(!std::mem::replace(&mut on_loop[v as usize], true));
                let new = enter(a) + enter(b);
                let joined = usize::from(loops.join(a, b));
                components[c].boundary_loops = components[c].boundary_loops + new - joined;
            }
        }
        let mut several_fans = 0;
        for v in 0..topology.vertex_count() as u32 {
            let c = topology.vertex_component[v as usize];
            if c != NONE && !topology.one_ring(v).fan {
                manifold[c as usize] = false;
                several_fans += usize::from(!on_bad_edge[v as usize]);
            }
        }
        for (c, component) in components.iter_mut().enumerate() {
            let odd = 2 + edge_count[c] as i64
                - component.vertices as i64
                - component.triangles as i64
                - component.boundary_loops as i64;
            component.genus = (manifold[c] && odd >= 0 && odd % 2 == 0).then_some((odd / 2) as usize);
        }
        several_fans
    }
}

fn duplicate_triangles(topology: &Topology, usable: &[u32]) -> Vec<u32> {
    let mut keyed: Vec<([u32; 3], u32)> = usable
        .iter()
        .map(|&t| {
            let mut key = topology.triangles[t as usize];
            key.sort_unstable();
            (key, t)
        })
        .collect();
    keyed.sort_unstable();
    let mut duplicates: Vec<u32> = keyed.windows(2).filter(|w| w[0].0 == w[1].0).map(|w| w[1].1).collect();
    duplicates.sort_unstable();
    duplicates
}

fn duplicate_positions(mesh: &Mesh, topology: &Topology) -> usize {
    let used = (0..mesh.vertex_count()).filter(|&v| topology.vertex_component[v] != NONE);
    // Adding zero makes -0 equal to 0.
    let mut keys: Vec<[u64; 3]> = used.map(|v| mesh.positions[v].to_array().map(|x| (x + 0.0).to_bits())).collect();
    keys.sort_unstable();
    keys.windows(2).filter(|w| w[0] == w[1]).count()
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    fn diagnose(positions: &[[f64; 3]], triangles: &[[u32; 3]]) -> Diagnosis {
        let mesh = Mesh::of_triangles("m", positions.iter().map(|p| DVec3::from(*p)).collect(), triangles);
        Diagnosis::new(&mesh, &Topology::new(&mesh))
    }

    const CORNERS: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    const TETRAHEDRON: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];

    #[test]
    fn a_clean_mesh_has_no_findings() {
        let d = diagnose(&CORNERS, &TETRAHEDRON);
        assert!(d.findings().is_empty() && d.is_manifold() && d.is_usable().is_ok());
        assert_eq!((d.genus(), d.boundary_loops()), (Some(0), 0));
        assert!((d.components[0].area - (1.5 + 0.75f64.sqrt())).abs() < 1e-12);
        assert_eq!(d.to_string(), "m: 4 vertices, 4 triangles, closed, genus 0");
        let open = diagnose(&CORNERS, &TETRAHEDRON[..3]);
        assert_eq!((open.genus(), open.boundary_loops()), (Some(0), 1));
    }

    #[test]
    fn a_torus_has_a_handle_and_a_ring_two_loops() {
        let (n, m) = (6u32, 5u32);
        let mut positions = Vec::new();
        let mut triangles = Vec::new();
        for i in 0..n {
            for j in 0..m {
                let (a, b) = (f64::from(i) * std::f64::consts::TAU / 6.0, f64::from(j) * std::f64::consts::TAU / 5.0);
                positions.push([(3.0 + b.cos()) * a.cos(), (3.0 + b.cos()) * a.sin(), b.sin()]);
                let at = |i: u32, j: u32| i % n * m + j % m;
                triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
                triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
            }
        }
        assert_eq!(diagnose(&positions, &triangles).genus(), Some(1));
        let ring = diagnose(&positions, &triangles[..(2 * m * (n - 1)) as usize]);
        assert_eq!((ring.genus(), ring.boundary_loops()), (Some(0), 2));
    }

    #[test]
    fn every_fault_is_found() {
        let mut positions = CORNERS.to_vec();
        positions.extend([[0.0, 0.0, -1.0], [5.0, 5.0, 5.0], [f64::NAN, 0.0, 0.0], [0.0, 0.0, -1.0]]);
        // A tetrahedron, a fin on one edge (4), the same fin again, a degenerate triangle, and a
        // triangle on a repeated position (7).
        let mut triangles = TETRAHEDRON.to_vec();
        triangles.extend([[0, 1, 4], [1, 0, 4], [2, 2, 3], [0, 1, 6], [2, 3, 7]]);
        let d = diagnose(&positions, &triangles);
        assert_eq!(d.nonmanifold_edges, 2);
        assert_eq!((d.degenerate_triangles.clone(), d.duplicate_triangles.clone()), (vec![6, 7], vec![5]));
        assert_eq!((d.duplicate_positions, d.unreferenced_vertices, d.nonfinite_vertices), (1, 1, 1));
        assert_eq!((d.genus(), d.is_manifold()), (None, false));
        let text = d.to_string();
        for expected in [
            "2 triangles without area (first: 6)",
            "1 duplicate triangle (first: 5)",
            "2 edges of more",
            "1 vertex lies",
            "1 vertex of no face",
            "1 position is",
        ] {
            assert!(text.contains(expected), "{text:?} lacks {expected:?}");
        }
        assert!(d.is_usable().is_ok());
    }

    #[test]
    fn touching_parts_and_disagreeing_faces() {
        let mut positions = CORNERS.to_vec();
        positions.extend([[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]);
        let touching = diagnose(&positions, &[[0, 1, 2], [0, 4, 5]]);
        assert_eq!((touching.nonmanifold_vertices, touching.nonmanifold_edges, touching.components.len()), (1, 0, 1));
        let turned = diagnose(&CORNERS, &[[0, 1, 2], [0, 1, 3]]);
        assert_eq!((turned.misoriented_edges, turned.genus()), (1, None));
        positions.push([3.0, 3.0, 3.0]);
        let apart = diagnose(&positions, &[[0, 1, 2], [3, 4, 5]]);
        assert!(apart.findings()[0].starts_with("2 components"));
    }

    #[test]
    fn useless_meshes_are_refused() {
        for (positions, triangles, expected) in [
            (&CORNERS[..], &[][..], "no triangles"),
            (&CORNERS[..], &[[0, 0, 1]][..], "none of the 1"),
            (&[[0.0; 3], [f64::NAN; 3], [1.0; 3]][..], &[[0, 1, 2]][..], "none of the 1"),
            (&[[0.0; 3], [1e300, 0.0, 0.0], [0.0, 1e300, 0.0]][..], &[[0, 1, 2]][..], "none of the 1"),
        ] {
            let message = diagnose(positions, triangles).is_usable().unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
    }
}
