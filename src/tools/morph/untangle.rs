//! Mending folds of a mesh that lies on the surface of another.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec3;
use rayon::prelude::*;

use crate::encoding::Similarity;
use crate::geometry::{ClosestPoints, Mesh, Topology};
use crate::surface::quality::{normal_at, vertex_normals};

/// Rings around bad triangles that may move, in turn: what few do not mend, more may.
const RINGS: [usize; 5] = [0, 1, 2, 4, 8];
/// Sweeps of averages for each ring and one more.
const SWEEPS: usize = 12;
/// Rings around what is left then, that take the mesh's own shape instead.
const OWN_RINGS: [usize; 4] = [1, 2, 4, 8];
/// Sweeps that spread what is left at the border of such a patch.
const SPREAD: usize = 60;
/// A triangle smaller than this part of what its size before lets expect is collapsed.
const COLLAPSED: f64 = 1e-3;
/// Patches of more than this part of the vertices are left alone: then the map is wrong, not
/// folded.
const LARGEST: f64 = 0.2;

/// The vertices of a mesh on a surface.
pub(super) struct Images<'a> {
    mesh: &'a Mesh,
    topology: &'a Topology,
    surface: &'a Mesh,
    closest: ClosestPoints,
    normals: Vec<DVec3>,
    /// Where the vertices are.
    pub(super) at: Vec<DVec3>,
    /// The surface's normals there.
    facing: Vec<DVec3>,
    /// Mean value weights of each vertex's neighbours, by the mesh's own shape.
    neighbours: Vec<Vec<(u32, f64)>>,
    /// The mesh is turned over on the surface as a whole.
    mirrored: bool,
    /// Expected area of an image over that of its triangle.
    ratio: f64,
}

/// What [`Images::mend`] did.
pub(super) struct Mended {
    /// Bad or folded triangles before.
    pub(super) before: usize,
    /// Those left.
    pub(super) left: Vec<u32>,
    /// Vertices moved.
    pub(super) moved: usize,
}

impl<'a> Images<'a> {
    /// The vertices of `mesh` at `at`, on or near `surface`.
    pub(super) fn new(
        (mesh, topology): (&'a Mesh, &'a Topology),
        (surface, around): (&'a Mesh, &'a Topology),
        at: Vec<DVec3>,
    ) -> Self {
        let closest = ClosestPoints::new(surface, around);
        let normals = vertex_normals(surface, around);
        let mut images = Self {
            mesh,
            topology,
            surface,
            closest,
            normals,
            facing: vec![DVec3::ZERO; at.len()],
            at,
            neighbours: mean_value_weights(mesh, topology),
            mirrored: false,
            ratio: 1.0,
        };
        images.facing = images.at.par_iter().map(|&p| images.drawn(p).1).collect();
        let usable = || (0..topology.triangles.len() as u32).filter(|&t| topology.usable[t as usize]);
        let (turned, area) = usable().fold((0.0, 0.0), |(turned, area), t| {
            let n = images.image_normal(t);
            (if n.dot(images.outward(t)) < 0.0 { turned + n.length() } else { turned }, area + n.length())
        });
        images.mirrored = 2.0 * turned > area;
        images.ratio = area / usable().map(|t| mesh.triangle_area_normal(t as usize).length()).sum::<f64>();
        images
    }

    /// The closest point of the surface, and the normal there.
    fn drawn(&self, p: DVec3) -> (DVec3, DVec3) {
        match self.closest.nearest(p) {
            Some((q, _)) => (q.position(self.surface), normal_at(self.surface, &self.normals, &q)),
            None => (p, DVec3::ZERO),
        }
    }

    /// Twice the area normal of a triangle's image.
    fn image_normal(&self, t: u32) -> DVec3 {
        let [a, b, c] = self.topology.triangles[t as usize].map(|v| self.at[v as usize]);
        (b - a).cross(c - a)
    }

    fn outward(&self, t: u32) -> DVec3 {
        self.topology.triangles[t as usize].iter().map(|&v| self.facing[v as usize]).sum()
    }

    /// Whether a triangle is turned over or collapsed.
    fn is_bad(&self, t: u32) -> bool {
        let n = self.image_normal(t);
        let side = n.dot(self.outward(t)) * if self.mirrored { -1.0 } else { 1.0 };
        let expected = self.ratio * self.mesh.triangle_area_normal(t as usize).length();
        !(side > 0.0) || n.length() < COLLAPSED * expected
    }

    /// The bad triangles, ascending.
    fn bad(&self) -> Vec<u32> {
        let usable = &self.topology.usable;
        (0..usable.len() as u32).into_par_iter().filter(|&t| usable[t as usize] && self.is_bad(t)).collect()
    }

    /// Largest distance of a vertex from the surface.
    pub(super) fn farthest_off(&self) -> f64 {
        let used = |v: usize| !self.neighbours[v].is_empty();
        (0..self.at.len())
            .into_par_iter()
            .filter(|&v| used(v))
            .map(|v| self.drawn(self.at[v]).0.distance(self.at[v]))
            .reduce(|| 0.0, f64::max)
    }

    /// Relaxes patches around bad triangles: their vertices become averages of their neighbours
    /// with mean value weights, drawn onto the surface. Where that does not help they take the
    /// shape that they have on the mesh itself, fitted to the patch's border, off the surface. A
    /// patch is kept where fewer of its triangles are bad; vertices of `fixed` stay.
    pub(super) fn mend(&mut self, fixed: &[bool]) -> Mended {
        let mut left = self.bad();
        let before = self.bad_or_folded().len();
        let mut moved = BTreeSet::new();
        for rings in RINGS {
            for patch in self.patches(&left, rings, fixed) {
                if patch.len() as f64 > LARGEST * self.at.len() as f64 {
                    continue;
                }
                if self.relax(&patch, rings) {
                    moved.extend(patch);
                }
            }
            left = self.bad();
            if left.is_empty() {
                break;
            }
        }
        for rings in OWN_RINGS {
            if self.mirrored {
                break;
            }
            let wrong = self.bad_or_folded();
            for patch in self.patches(&wrong, rings, fixed) {
                if patch.len() as f64 <= LARGEST * self.at.len() as f64 && self.own_shape(&patch) {
                    moved.extend(patch);
                }
            }
        }
        Mended { before, left: self.bad_or_folded(), moved: moved.len() }
    }

    /// Whether a triangle opposes the normals of the mesh's own image at its vertices.
    fn is_folded(&self, t: u32) -> bool {
        let around =
            |v: u32| -> DVec3 { self.topology.vertex_triangles(v).iter().map(|&t| self.image_normal(t)).sum() };
        let mean: DVec3 = self.topology.triangles[t as usize].iter().map(|&v| around(v).normalize_or_zero()).sum();
        !(self.image_normal(t).dot(mean) > 0.0)
    }

    fn bad_or_folded(&self) -> Vec<u32> {
        let usable = &self.topology.usable;
        let all = (0..usable.len() as u32).into_par_iter();
        all.filter(|&t| usable[t as usize] && (self.is_bad(t) || self.is_folded(t))).collect()
    }

    /// Gives a patch the shape it has on the mesh, by the similarity that fits its border and a
    /// smooth correction that makes it meet there; and takes it back if that helped nothing.
    fn own_shape(&mut self, patch: &[u32]) -> bool {
        let inside: BTreeSet<u32> = patch.iter().copied().collect();
        let border: BTreeSet<u32> = patch
            .iter()
            .flat_map(|&v| self.neighbours[v as usize].iter().map(|n| n.0))
            .filter(|w| !inside.contains(w))
            .collect();
        if border.len() < 4 {
            return false;
        }
        let pairs: Vec<(DVec3, DVec3)> =
            border.iter().map(|&w| (self.mesh.positions[w as usize], self.at[w as usize])).collect();
        let fit = Similarity::fit(&pairs);
        let triangles: BTreeSet<u32> =
            patch.iter().chain(&border).flat_map(|&v| self.topology.vertex_triangles(v)).copied().collect();
        // What opposes the surface and its own surroundings counts twice.
        let count = |images: &Self| {
            triangles.iter().map(|&t| usize::from(images.is_bad(t)) + usize::from(images.is_folded(t))).sum::<usize>()
        };
        let before = count(self);
        let kept: Vec<(DVec3, DVec3)> = patch.iter().map(|&v| (self.at[v as usize], self.facing[v as usize])).collect();
        let fitted = |v: u32| fit.apply(self.mesh.positions[v as usize]);
        let mut rest: BTreeMap<u32, DVec3> = border.iter().map(|&w| (w, self.at[w as usize] - fitted(w))).collect();
        rest.extend(patch.iter().map(|&v| (v, DVec3::ZERO)));
        for _ in 0..SPREAD {
            for &v in patch {
                let mean = self.neighbours[v as usize].iter().filter_map(|(w, x)| Some(*rest.get(w)? * *x)).sum();
                rest.insert(v, mean);
            }
        }
        let placed: Vec<DVec3> = patch.iter().map(|&v| fitted(v) + rest[&v]).collect();
        for (&v, p) in patch.iter().zip(&placed) {
            (self.at[v as usize], self.facing[v as usize]) = (*p, self.drawn(*p).1);
        }
        let better = placed.iter().all(|p| p.is_finite()) && count(self) < before;
        if !better {
            for (&v, (p, n)) in patch.iter().zip(&kept) {
                (self.at[v as usize], self.facing[v as usize]) = (*p, *n);
            }
        }
        better
    }

    /// The vertices within `rings` of the triangles, in connected groups, without those that are
    /// fixed.
    fn patches(&self, triangles: &[u32], rings: usize, fixed: &[bool]) -> Vec<Vec<u32>> {
        let mut inside: BTreeSet<u32> = triangles.iter().flat_map(|&t| self.topology.triangles[t as usize]).collect();
        for _ in 0..rings {
            let ring: Vec<u32> = inside.iter().flat_map(|&v| self.neighbours[v as usize].iter().map(|n| n.0)).collect();
            inside.extend(ring);
        }
        inside.retain(|&v| !fixed[v as usize]);
        let mut patches = Vec::new();
        while let Some(first) = inside.pop_first() {
            let (mut patch, mut stack) = (vec![first], vec![first]);
            while let Some(v) = stack.pop() {
                for &(w, _) in &self.neighbours[v as usize] {
                    if inside.remove(&w) {
                        patch.push(w);
                        stack.push(w);
                    }
                }
            }
            patch.sort_unstable();
            patches.push(patch);
        }
        patches
    }

    /// Moves a patch, and back if that helped nothing.
    fn relax(&mut self, patch: &[u32], rings: usize) -> bool {
        let triangles: BTreeSet<u32> = patch.iter().flat_map(|&v| self.topology.vertex_triangles(v)).copied().collect();
        let count = |images: &Self| triangles.iter().filter(|&&t| images.is_bad(t)).count();
        let before = count(self);
        if before == 0 {
            return false;
        }
        let kept: Vec<(DVec3, DVec3)> = patch.iter().map(|&v| (self.at[v as usize], self.facing[v as usize])).collect();
        let sweeps = SWEEPS * (rings + 1);
        let mut best = (before, kept.clone());
        // In space first, which no fold survives, then along the surface.
        for sweep in 0..2 * sweeps {
            for &v in patch {
                let around = &self.neighbours[v as usize];
                self.at[v as usize] = around.iter().map(|&(w, x)| self.at[w as usize] * x).sum();
            }
            if sweep + 1 >= sweeps {
                let drawn: Vec<(DVec3, DVec3)> = patch.par_iter().map(|&v| self.drawn(self.at[v as usize])).collect();
                for (&v, (p, n)) in patch.iter().zip(&drawn) {
                    (self.at[v as usize], self.facing[v as usize]) = (*p, *n);
                }
                let now = count(self);
                if now < best.0 {
                    best = (now, drawn);
                }
                if now == 0 {
                    break;
                }
            }
        }
        for (&v, (p, n)) in patch.iter().zip(&best.1) {
            (self.at[v as usize], self.facing[v as usize]) = (*p, *n);
        }
        best.0 < before
    }
}

/// Mean value weights (Floater 2003) of every vertex's neighbours on its mesh, positive and summing
/// to one; equal ones at degenerate corners.
fn mean_value_weights(mesh: &Mesh, topology: &Topology) -> Vec<Vec<(u32, f64)>> {
    let weights_of = |v: u32| -> Vec<(u32, f64)> {
        let p = mesh.positions[v as usize];
        let mut found: Vec<(u32, f64)> = Vec::new();
        for &t in topology.vertex_triangles(v) {
            let triangle = topology.triangles[t as usize];
            let Some(k) = topology.corner_of(t, v) else { continue };
            let ends = [triangle[(k + 1) % 3], triangle[(k + 2) % 3]];
            let [e, f] = ends.map(|w| mesh.positions[w as usize] - p);
            // tan(angle / 2) = sin / (1 + cos).
            let half = e.cross(f).length() / (e.length() * f.length() + e.dot(f));
            for (w, edge) in ends.into_iter().zip([e, f]) {
                let weight = half / edge.length();
                let weight = if weight.is_finite() { weight } else { 0.0 };
                match found.iter_mut().find(|x| x.0 == w) {
                    Some(x) => x.1 += weight,
                    None => found.push((w, weight)),
                }
            }
        }
        found.sort_unstable_by_key(|x| x.0);
        let sum: f64 = found.iter().map(|x| x.1).sum();
        let n = found.len() as f64;
        found.iter_mut().for_each(|x| x.1 = if sum > 0.0 && sum.is_finite() { x.1 / sum } else { 1.0 / n });
        found
    };
    (0..mesh.vertex_count() as u32).into_par_iter().map(weights_of).collect()
}
