//! Neighbours that do not agree: parts of the target whose images lie elsewhere on the source than
//! those of all their neighbours.
//!
//! A relaxation is smooth over the target, and yet an image may end nearest to another part of the
//! source, across a gap between two limbs. Edges of the target that are torn so are cut; what then
//! hangs together with nothing else, and has no anchor that says it belongs there, is an island,
//! and takes its place from the shores around it.

use glam::DVec3;
use rayon::prelude::*;

use super::closest::{ClosestOnSurface, FLAT};
use super::pair::Shapes;
use crate::geometry::NONE;
use crate::surface::vector::{Vector, add_scaled};

/// An edge whose image is longer than this many times itself, both at unit area, is torn ...
const TORN: f64 = 4.0;
/// ... if it is longer than this many mean edges of the target, too: short edges stretch much for
/// little.
const LEAST: f64 = 2.0;
/// An island is at most this part of its component and has at most so many vertices: what is larger
/// is no matter of neighbours.
const PART: usize = 50;
const MOST: usize = 2000;
/// Averages over an island after it was filled.
const SWEEPS: usize = 8;

/// The images of a target's vertices, and where on the source they are.
pub(super) struct Islands<'a, const K: usize> {
    pub(super) shapes: &'a Shapes<'a>,
    pub(super) closest: &'a ClosestOnSurface<'a, K>,
    /// Vertices whose images were given.
    pub(super) held: &'a [bool],
}

impl<const K: usize> Islands<'_, K> {
    /// Gives islands other images and returns the number of vertices that have one now; `near`
    /// holds the triangle of the source each image is nearest to. An island is moved only if fewer
    /// of its edges are torn then. O(F), and what islands take.
    pub(super) fn reseat(&self, z: &mut [Vector<f64, K>], near: &mut [u32]) -> usize {
        let neighbours = self.neighbours();
        let places: Vec<Option<DVec3>> = (0..z.len()).into_par_iter().map(|v| self.place(&z[v], near[v])).collect();
        let edges: Vec<f64> = neighbours
            .iter()
            .enumerate()
            .flat_map(|(v, n)| n.iter().map(move |&w| (v, w)))
            .map(|(v, w)| self.length(v, w as usize))
            .collect();
        let least = LEAST * edges.iter().sum::<f64>() / edges.len().max(1) as f64;
        let torn = |p: Option<DVec3>, q: Option<DVec3>, v: usize, w: usize| match (p, q) {
            (Some(p), Some(q)) => p.distance(q) > (TORN * self.length(v, w)).max(least),
            _ => false,
        };
        let mut moved = 0;
        for island in self.islands(&neighbours, |v, w| torn(places[v], places[w], v, w)) {
            let inside = |v: u32| island.binary_search(&v).is_ok();
            let mut new: Vec<Option<(Vector<f64, K>, u32)>> = vec![None; island.len()];
            let known = |new: &[Option<(Vector<f64, K>, u32)>], w: u32| match island.binary_search(&w) {
                Ok(i) => new[i],
                Err(_) => Some((z[w as usize], near[w as usize])),
            };
            // Ring by ring from the shore, then averages: each image starts from a neighbour's.
            for sweep in 0..island.len() + SWEEPS {
                let before = new.clone();
                for (i, &v) in island.iter().enumerate() {
                    let around: Vec<_> = neighbours[v as usize].iter().filter_map(|&w| known(&before, w)).collect();
                    if let Some(&(_, start)) = around.first() {
                        let share = 1.0 / around.len() as f64;
                        let mean = around.iter().fold([0.0; K], |sum, (z, _)| add_scaled(&sum, share, z));
                        let found = self.closest.follow((&mean, &FLAT), start).map_or(start, |c| c.face);
                        new[i] = Some((mean, found));
                    }
                }
                if sweep >= SWEEPS && before.iter().all(Option::is_some) {
                    break;
                }
            }
            let place = |w: u32| match island.binary_search(&w) {
                Ok(i) => new[i].and_then(|(z, face)| self.place(&z, face)),
                Err(_) => places[w as usize],
            };
            let count = |place: &dyn Fn(u32) -> Option<DVec3>| -> usize {
                let ends = island.iter().flat_map(|&v| neighbours[v as usize].iter().map(move |&w| (v, w)));
                ends.filter(|&(v, w)| (!inside(w) || v < w) && torn(place(v), place(w), v as usize, w as usize)).count()
            };
            if new.iter().all(Option::is_some) && count(&place) < count(&|w| places[w as usize]) {
                moved += island.len();
                for (&v, (image, face)) in island.iter().zip(new.into_iter().flatten()) {
                    z[v as usize] = image;
                    near[v as usize] = face;
                }
            }
        }
        moved
    }

    /// The place on the source, at unit area, nearest to an image.
    fn place(&self, z: &Vector<f64, K>, near: u32) -> Option<DVec3> {
        let c = self.closest.follow((z, &FLAT), Some(near).filter(|f| *f != NONE)?)?;
        let corners = self.shapes.source.topology.triangles[c.face as usize];
        Some((0..3).map(|k| c.x[k] * self.shapes.source_position(corners[k] as usize)).sum())
    }

    fn length(&self, v: usize, w: usize) -> f64 {
        self.shapes.target_position(v).distance(self.shapes.target_position(w))
    }

    /// The neighbours of each vertex, rising.
    fn neighbours(&self) -> Vec<Vec<u32>> {
        let t = self.shapes.target.topology;
        let around = |v: u32| {
            let mut all: Vec<u32> =
                t.vertex_triangles(v).iter().flat_map(|&f| t.triangles[f as usize]).filter(|&w| w != v).collect();
            all.sort_unstable();
            all.dedup();
            all
        };
        (0..t.vertex_count() as u32).into_par_iter().map(around).collect()
    }

    /// What hangs together by edges that are not torn, is a small part of its component and holds
    /// no given image; each rising.
    fn islands(&self, neighbours: &[Vec<u32>], torn: impl Fn(usize, usize) -> bool) -> Vec<Vec<u32>> {
        let component = &self.shapes.target.topology.vertex_component;
        let mut seen = vec![false; neighbours.len()];
        let mut size = vec![0; self.shapes.target.topology.component_count as usize];
        let mut parts = Vec::new();
        for v in 0..neighbours.len() {
            if seen[v] || component[v] == NONE {
                continue;
            }
            seen[v] = true;
            let mut part = vec![v as u32];
            let mut next = 0;
            while let Some(&v) = part.get(next) {
                next += 1;
                for &w in &neighbours[v as usize] {
                    if !seen[w as usize] && !torn(v as usize, w as usize) {
                        seen[w as usize] = true;
                        part.push(w);
                    }
                }
            }
            size[component[v] as usize] += part.len();
            parts.push(part);
        }
        parts.retain(|p| {
            let small = p.len() <= MOST && PART * p.len() <= size[component[p[0] as usize] as usize];
            small && p.iter().all(|&v| !self.held[v as usize])
        });
        parts.iter_mut().for_each(|p| p.sort_unstable());
        parts
    }
}

#[cfg(test)]
mod tests {
    use super::super::{framed, joined};
    use super::*;
    use crate::geometry::Topology;
    use crate::models::character_pair;
    use crate::surface::correspondence::Shape;
    use crate::surface::{NearestVertex, PhongSurface};

    #[test]
    fn what_strayed_to_another_limb_returns_unless_it_was_given() {
        let mesh = character_pair().source.mesh;
        let topology = Topology::new(&mesh);
        let shape = Shape { mesh: &mesh, topology: &topology, embedding: None };
        let shapes = Shapes::new(shape, shape).unwrap();
        let n = mesh.vertex_count();
        let own = |v: usize| joined::<0, 4>(&[], 1.0, shapes.source_position(v).to_array());
        let surface = PhongSurface::<f64, 4>::new(&topology, &(0..n).flat_map(own).collect::<Vec<f64>>()).unwrap();
        let vertices = NearestVertex::new(&surface);
        let closest = ClosestOnSurface::new(&surface, &vertices);
        let face = |v: usize| topology.vertex_triangles(v as u32)[0];
        let at_home = || -> (Vec<Vector<f64, 4>>, Vec<u32>) {
            ((0..n).map(|v| framed(&surface, own(v))).collect(), (0..n).map(face).collect())
        };
        // A vertex and those around it go where the vertex farthest from it is.
        let middle = mesh.positions.iter().sum::<DVec3>() / n as f64;
        let far = |from: DVec3| {
            let d = |v: &usize| mesh.positions[*v].distance_squared(from);
            (0..n).max_by(|a, b| d(a).total_cmp(&d(b))).unwrap()
        };
        let tip = far(middle);
        let other = far(mesh.positions[tip]);
        let mut patch: Vec<usize> = topology.one_ring(tip as u32).vertices.iter().map(|&v| v as usize).collect();
        patch.push(tip);
        let astray = || {
            let (mut z, mut near) = at_home();
            for &v in &patch {
                (z[v], near[v]) = (framed(&surface, own(other)), face(other));
            }
            (z, near)
        };
        let mut held = vec![false; n];
        let reseat = |held: &[bool], (mut z, mut near): (Vec<Vector<f64, 4>>, Vec<u32>)| {
            let moved = Islands { shapes: &shapes, closest: &closest, held }.reseat(&mut z, &mut near);
            (moved, z, near)
        };
        // Where all agree nothing happens.
        assert_eq!(reseat(&held, at_home()), (0, at_home().0, at_home().1));
        let (moved, z, near) = reseat(&held, astray());
        assert_eq!(moved, patch.len());
        let islands = Islands { shapes: &shapes, closest: &closest, held: &held };
        let off = |z: &[Vector<f64, 4>], near: &[u32], v: usize| {
            islands.place(&z[v], near[v]).unwrap().distance(shapes.source_position(v))
        };
        // Back within the patch, which is flatter than it was: less than its width from home.
        let width =
            patch.iter().map(|&v| shapes.source_position(v).distance(shapes.source_position(tip))).fold(0.0, f64::max);
        assert!(patch.iter().all(|&v| off(&z, &near, v) < 2.0 * width), "{width}");
        let (z, near) = astray();
        assert!(patch.iter().all(|&v| off(&z, &near, v) > 10.0 * width));
        // An anchor there says that it is meant.
        held[tip] = true;
        assert_eq!(reseat(&held, astray()).0, 0);
    }
}
