//! Turning back the few triangles whose image is turned over.

use glam::DVec3;
use rayon::prelude::*;

use super::GUARD;
use super::closest::{ClosestOnSurface, FLAT};
use super::pair::Shapes;
use crate::geometry::{NONE, SurfacePoint};
use crate::surface::PhongSurface;
use crate::surface::quality::{normal_at, vertex_normals};
use crate::surface::vector::{Vector, add_scaled, scaled};

/// Rings around turned triangles that may move, at most. Larger patches turn hardly a triangle more back and can lose what their vertices know.
const RINGS: usize = 3;
/// Sweeps of averages over a patch: enough for a disk of [`RINGS`] rings.
const SWEEPS: usize = 20;

/// The images of a target's vertices, as they are repaired.
pub(super) struct Images<'a, const K: usize> {
    pub(super) shapes: &'a Shapes<'a>,
    pub(super) reference: &'a PhongSurface<f64, K>,
    pub(super) closest: &'a ClosestOnSurface<'a, K>,
    /// Of each vertex in R^K.
    pub(super) z: &'a mut [Vector<f64, K>],
    /// Vertices of the source near them.
    pub(super) starts: &'a mut [u32],
    /// For each triangle of the target a triangle of the source to start from.
    pub(super) start_faces: &'a [u32],
}

/// What a repair did.
#[derive(Debug, Default)]
pub(super) struct Repaired {
    /// Turned triangles before.
    pub(super) before: usize,
    /// Those that are left.
    pub(super) left: Vec<usize>,
}

/// Position of an image on the source, and the normal there.
type Seen = Option<(DVec3, DVec3)>;

impl<const K: usize> Images<'_, K> {
    /// Replaces the images around turned triangles by averages of those around them (Tutte), drawn onto the source: their own vertices first, rings around them where that does not help. A patch is kept only if fewer of its
    /// triangles are turned. Vertices of `held` stay. `O(F)` and little more, since turned triangles are few.
    pub(super) fn repair(&mut self, held: &[bool]) -> Repaired {
        let source = self.shapes.source;
        let normals = vertex_normals(source.mesh, source.topology);
        let mut seen: Vec<Seen> = (0..self.z.len()).into_par_iter().map(|v| self.see(v, &normals)).collect();
        let triangles = &self.shapes.target.topology.triangles;
        let usable = &self.shapes.target.topology.usable;
        let all: Vec<usize> = (0..triangles.len()).filter(|&t| usable[t]).collect();
        // A mirrored pair turns them all.
        let over = |seen: &[Seen], t: usize| turned(seen, triangles[t]);
        let mirrored = 2 * all.iter().filter(|&&t| over(&seen, t)).count() > all.len();
        let bad = |seen: &[Seen], t: usize| usable[t] && over(seen, t) != mirrored;
        let mut left: Vec<usize> = all.iter().copied().filter(|&t| bad(&seen, t)).collect();
        let before = left.len();
        for rings in 0..=RINGS {
            if left.is_empty() || 10 * left.len() > all.len() {
                break;
            }
            for patch in self.patches(&left, rings, held) {
                let around = self.triangles_of(&patch);
                let count = |seen: &[Seen]| around.iter().filter(|&&t| bad(seen, t)).count();
                let was = count(&seen);
                if was == 0 {
                    continue;
                }
                let kept: Vec<_> = patch.iter().map(|&v| (self.z[v], self.starts[v], seen[v])).collect();
                self.average(&patch);
                patch.iter().for_each(|&v| seen[v] = self.see(v, &normals));
                if count(&seen) >= was {
                    for (&v, (z, start, image)) in patch.iter().zip(kept) {
                        (self.z[v], self.starts[v], seen[v]) = (z, start, image);
                    }
                }
            }
            left.retain(|&t| bad(&seen, t));
        }
        Repaired { before, left: all.into_iter().filter(|&t| bad(&seen, t)).collect() }
    }

    /// Where a vertex goes.
    fn see(&self, v: usize, normals: &[DVec3]) -> Seen {
        let first = self.shapes.target.topology.vertex_point(v as u32)?.face as usize;
        let starts = self.shapes.target.topology.triangles[first].map(|v| self.starts[v as usize]);
        let image = self.reference.project_near(&self.z[v], self.start_faces[first], &starts);
        // As the field itself guards them.
        let p = if image.face != NONE && image.distance_squared <= GUARD * GUARD {
            SurfacePoint::new(image.face, image.x)
        } else {
            let c = self.closest.near((&self.z[v], &FLAT), self.starts[v])?;
            SurfacePoint::new(c.face, c.x)
        };
        let mesh = self.shapes.source.mesh;
        Some((p.position(mesh), normal_at(mesh, normals, &p)))
    }

    /// The vertices within some rings of triangles, the held ones left out, by connected patches; each rising.
    fn patches(&self, triangles: &[usize], rings: usize, held: &[bool]) -> Vec<Vec<usize>> {
        let t = &self.shapes.target.topology;
        let mut inside = vec![false; self.z.len()];
        let mut front: Vec<u32> = triangles.iter().flat_map(|&f| t.triangles[f]).collect();
        for _ in 0..=rings {
            front.iter().for_each(|&v| inside[v as usize] = true);
            front = front.iter().flat_map(|&v| self.neighbours(v as usize)).filter(|&v| !inside[v as usize]).collect();
        }
        let mut patches = Vec::new();
        for v in 0..inside.len() {
            if !inside[v] || held[v] {
                continue;
            }
            let mut patch = vec![v];
            inside[v] = false;
            let mut next = 0;
            while next < patch.len() {
                for w in self.neighbours(patch[next]) {
                    if inside[w as usize] && !held[w as usize] {
                        inside[w as usize] = false;
                        patch.push(w as usize);
                    }
                }
                next += 1;
            }
            patch.sort_unstable();
            patches.push(patch);
        }
        patches
    }

    /// Vertices that share a usable triangle with `v`, rising.
    fn neighbours(&self, v: usize) -> Vec<u32> {
        let t = &self.shapes.target.topology;
        let mut around: Vec<u32> = t
            .vertex_triangles(v as u32)
            .iter()
            .flat_map(|&f| t.triangles[f as usize])
            .filter(|&w| w as usize != v)
            .collect();
        around.sort_unstable();
        around.dedup();
        around
    }

    fn triangles_of(&self, patch: &[usize]) -> Vec<usize> {
        let t = &self.shapes.target.topology;
        let mut around: Vec<usize> =
            patch.iter().flat_map(|&v| t.vertex_triangles(v as u32)).map(|&f| f as usize).collect();
        around.sort_unstable();
        around.dedup();
        around
    }

    /// Averages of neighbours, in order, then the closest points of the source.
    fn average(&mut self, patch: &[usize]) {
        let around: Vec<Vec<u32>> = patch.iter().map(|&v| self.neighbours(v)).collect();
        for _ in 0..SWEEPS {
            for (&v, around) in patch.iter().zip(&around) {
                let sum = around.iter().fold([0.0; K], |sum, &w| add_scaled(&sum, 1.0, &self.z[w as usize]));
                self.z[v] = scaled(1.0 / around.len().max(1) as f64, &sum);
            }
        }
        for &v in patch {
            if let Some(c) = self.closest.near((&self.z[v], &FLAT), self.starts[v]) {
                self.z[v] = self.closest.point(&c);
                self.starts[v] = self.closest.vertex(&c);
            }
        }
    }
}

/// Whether the image of a triangle faces against the source there; one without image does not.
fn turned(seen: &[Seen], t: [u32; 3]) -> bool {
    let [Some(a), Some(b), Some(c)] = t.map(|v| seen[v as usize]) else { return false };
    (b.0 - a.0).cross(c.0 - a.0).dot(a.1 + b.1 + c.1) < 0.0
}
