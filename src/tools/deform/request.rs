//! Which vertices are held, and where.

use std::collections::BTreeMap;

use glam::DVec3;

use crate::encoding::Connectivity;
use crate::error::{Error, Result};
use crate::geometry::Mesh;

/// The handles of a mesh and, if only a part of it may move, the region of influence.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Handles {
    /// The vertex of each handle. The same vertex may come twice, then with equal positions.
    pub vertices: Vec<u32>,
    /// Vertices that may move; all others are held where they are. `None` lets the whole mesh move.
    pub region: Option<Vec<u32>>,
}

impl Handles {
    /// The same on `mesh`, with representatives for joined vertices.
    pub(super) fn on(mut self, mesh: &Mesh) -> Result<Self> {
        let vertex_count = mesh.vertex_count();
        let check = |list: &[u32], what: &str| match list.iter().find(|&&v| v as usize >= vertex_count) {
            Some(v) => {
                let what = format!("{what} names vertex {v}, the mesh has {vertex_count}");
                Err(Error::input(what, "Vertex indices count from 0, in the order of the file"))
            }
            None => Ok(()),
        };
        check(&self.vertices, "a handle")?;
        if let Some(region) = &mut self.region {
            check(region, "the region of influence")?;
            region.iter_mut().for_each(|v| *v = mesh.representative(*v));
        }
        self.vertices.iter_mut().for_each(|v| *v = mesh.representative(*v));
        Ok(self)
    }

    /// All held vertices, each once.
    pub(super) fn held(&self, connectivity: &Connectivity) -> Result<Vec<u32>> {
        let vertex_count = connectivity.rings.len();
        if self.vertices.is_empty() {
            return Err(Error::input("there are no handles", "Give at least one vertex and where it goes"));
        }
        if let Some(v) = self.vertices.iter().find(|&&v| connectivity.rings[v as usize].is_empty()) {
            let what = format!("the handle at vertex {v} is part of no face");
            return Err(Error::input(what, "Choose a vertex of the surface"));
        }
        let mut is_held = vec![false; vertex_count];
        if let Some(region) = &self.region {
            is_held.iter_mut().for_each(|h| *h = true);
            region.iter().for_each(|&v| is_held[v as usize] = false);
        }
        self.vertices.iter().for_each(|&v| is_held[v as usize] = true);
        Ok((0..vertex_count as u32)
            .filter(|&v| is_held[v as usize] && !connectivity.rings[v as usize].is_empty())
            .collect())
    }

    /// New positions by vertex.
    pub(super) fn targets(&self, positions: &[DVec3]) -> Result<BTreeMap<u32, DVec3>> {
        if positions.len() != self.vertices.len() {
            let what = format!("{} positions for {} handles", positions.len(), self.vertices.len());
            return Err(Error::input(what, "Give one position a handle"));
        }
        let mut targets = BTreeMap::new();
        for (&v, &p) in self.vertices.iter().zip(positions) {
            if !p.is_finite() {
                return Err(Error::input(format!("the position for vertex {v} is not finite"), "Give numbers"));
            }
            if targets.insert(v, p).is_some_and(|q| q != p) {
                let what = format!("two handles put vertex {v} at different positions");
                return Err(Error::input(what, "Keep one of them"));
            }
        }
        // One place for all would be the best shape of all: a point has no error.
        if self.region.is_none() && targets.len() > 1 {
            let first = positions[0];
            if positions.iter().all(|&p| p == first) {
                let what = "all handles are put at one place, where the mesh would shrink to a point";
                return Err(Error::input(what, "Give them different positions"));
            }
        }
        Ok(targets)
    }
}
