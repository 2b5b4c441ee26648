//! Simplification of a triangle mesh by half-edge collapses that turn the normals least.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use glam::DVec3;
use rayon::prelude::*;

use crate::control;
use crate::error::Result;

/// When to stop simplifying, and what not to make.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SimplifyOptions {
    /// Number of vertices to stop at.
    pub(crate) vertices: usize,
    /// No edge longer than this is made; infinite for no bound.
    pub(crate) longest_edge: f64,
}

/// What is left of a mesh; its vertices are some of the original ones, where they were.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Simplified {
    /// The vertices in use, ascending, as indices of the original mesh.
    pub(crate) vertices: Vec<u32>,
    /// Triangles, as indices of the original mesh.
    pub(crate) triangles: Vec<[u32; 3]>,
}

/// A candidate: vertex `from` moves onto `to`. Ordered as the fields are.
///
/// Cost and length are rounded, so that rounding errors do not choose between collapses that a
/// symmetric shape makes equal: the result is the same for the same shape at another scale.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Collapse {
    cost: u64,
    /// Bits of a positive `f32`.
    length: u32,
    from: u32,
    to: u32,
    stamp: u32,
}

/// A cost in steps of 2^-30.
fn rounded(cost: f64) -> u64 {
    (cost * f64::from(1 << 30)).round() as u64
}

/// Collapses half-edges, least change of normals first, until `options.vertices` are left or no
/// collapse is allowed any more.
///
/// `triangles` should be the usable ones. The cost of a collapse is the largest change of a face
/// normal it leads to, added to the changes these faces and the removed ones had before (as chord
/// lengths of the unit normals), so that many small changes do not pass unseen. Along a boundary
/// only boundary edges are collapsed, and the turning of the boundary counts like that of a normal.
/// Vertices whose triangles form no single fan, or that have more than 64 neighbours, stay;
/// collapses that would change the topology (link condition), turn a normal by 90 degrees or more,
/// or make a triangle without area are not allowed. Ties are broken by edge length, then by index.
/// O(F log F). Surfaces and components never vanish.
///
/// Source: the sampling of "Weighted Averages on Surfaces", section 3.5, there done by OpenMesh.
///
/// # Errors
/// [`crate::Error::Cancelled`].
///
/// # Panics
/// If a triangle names a vertex that does not exist.
pub(crate) fn simplify(positions: &[DVec3], triangles: &[[u32; 3]], options: &SimplifyOptions) -> Result<Simplified> {
    control::check()?;
    let mut mesh = Collapser::new(positions, triangles, options.longest_edge);
    let used: Vec<u32> = (0..positions.len() as u32).filter(|&v| !mesh.around[v as usize].is_empty()).collect();
    let mut stamps = vec![0u32; positions.len()];
    let here = control::current();
    let slices: Result<Vec<Vec<Reverse<Collapse>>>> = used
        .par_chunks(SLICE)
        .map(|slice| {
            here.check()?;
            Ok(slice.iter().filter_map(|&v| mesh.best(v).map(Reverse)).collect())
        })
        .collect();
    let mut heap = BinaryHeap::from(slices?.concat());
    let mut left = used.len();
    let mut ring = Vec::new();
    let mut passes = 0usize;
    while left > options.vertices {
        let Some(Reverse(c)) = heap.pop() else { break };
        passes += 1;
        if passes.is_multiple_of(SLICE) {
            here.check()?;
        }
        if c.stamp != stamps[c.from as usize] {
            continue;
        }
        if mesh.cost(c.from, c.to) != Some(c.cost) {
            // Something beyond the ring of `from` changed.
            stamps[c.from as usize] += 1;
            if let Some(again) = mesh.best(c.from) {
                heap.push(Reverse(Collapse { stamp: stamps[c.from as usize], ..again }));
            }
            continue;
        }
        mesh.collapse(c.from, c.to);
        stamps[c.from as usize] += 1;
        left -= 1;
        mesh.ring(c.to, &mut ring);
        ring.push(c.to);
        for &v in &ring {
            stamps[v as usize] += 1;
            if let Some(next) = mesh.best(v) {
                heap.push(Reverse(Collapse { stamp: stamps[v as usize], ..next }));
            }
        }
    }
    Ok(Simplified {
        vertices: used.into_iter().filter(|&v| !mesh.around[v as usize].is_empty()).collect(),
        triangles: mesh.triangles.iter().zip(&mesh.alive).filter(|(_, a)| **a).map(|(t, _)| *t).collect(),
    })
}

/// Vertices between two looks whether the work is cancelled: a few milliseconds.
const SLICE: usize = 1024;

/// Vertices of more faces than this stay, and nothing is moved onto them: each collapse looks at
/// all faces of both ends, and at what may come next around the one that stays. Their neighbours
/// collapse into one another until they have fewer.
const MANY: usize = 64;

/// The mesh while it is being simplified.
struct Collapser<'a> {
    positions: &'a [DVec3],
    longest_edge: f64,
    /// Mean edge length.
    unit: f64,
    triangles: Vec<[u32; 3]>,
    alive: Vec<bool>,
    normals: Vec<DVec3>,
    /// Sum of the changes each face's normal went through.
    turned: Vec<f64>,
    /// The same for the boundary at each boundary vertex.
    boundary_turned: Vec<f64>,
    /// Faces around each vertex.
    around: Vec<Vec<u32>>,
}

impl<'a> Collapser<'a> {
    fn new(positions: &'a [DVec3], triangles: &[[u32; 3]], longest_edge: f64) -> Self {
        let mut around = vec![Vec::new(); positions.len()];
        let proper: Vec<[u32; 3]> =
            triangles.iter().copied().filter(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0]).collect();
        for (f, t) in proper.iter().enumerate() {
            for &v in t {
                around[v as usize].push(f as u32);
            }
        }
        let normal = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| positions[v as usize]);
            (b - a).cross(c - a).normalize_or_zero()
        };
        let perimeters = proper.iter().map(|t| {
            let [a, b, c] = t.map(|v| positions[v as usize]);
            a.distance(b) + b.distance(c) + c.distance(a)
        });
        let unit = perimeters.sum::<f64>() / (3 * proper.len()).max(1) as f64;
        Self {
            positions,
            longest_edge,
            unit,
            normals: proper.iter().map(normal).collect(),
            turned: vec![0.0; proper.len()],
            boundary_turned: vec![0.0; positions.len()],
            alive: vec![true; proper.len()],
            triangles: proper,
            around,
        }
    }

    /// Neighbours of `v`, ascending.
    fn ring(&self, v: u32, out: &mut Vec<u32>) {
        out.clear();
        for &f in &self.around[v as usize] {
            out.extend(self.triangles[f as usize].into_iter().filter(|&w| w != v));
        }
        out.sort_unstable();
        out.dedup();
    }

    /// The two boundary neighbours of `v` if it is on the boundary; `Err` if its triangles form no
    /// single fan.
    fn boundary(&self, v: u32) -> std::result::Result<Option<[u32; 2]>, ()> {
        let faces = &self.around[v as usize];
        let mut once = [0u32; 2];
        let (mut found, mut count) = (0, 0);
        let mut seen: [u32; MANY] = [0; MANY];
        let mut distinct = 0;
        for &f in faces {
            for w in self.triangles[f as usize].into_iter().filter(|&w| w != v) {
                if !seen[..distinct].contains(&w) {
                    if distinct == seen.len() {
                        return Err(());
                    }
                    seen[distinct] = w;
                    distinct += 1;
                }
            }
        }
        for &w in &seen[..distinct] {
            match faces.iter().filter(|&&f| self.triangles[f as usize].contains(&w)).count() {
                1 => {
                    if found < 2 {
                        once[found] = w;
                    }
                    found += 1;
                }
                2 => {}
                _ => return Err(()),
            }
            count += 1;
        }
        // A closed fan has as many neighbours as faces and an open one has one more. Two closed
        // fans would pass this count: the link condition and the walk below reject them.
        match found {
            0 if count == faces.len() && self.connected(v) => Ok(None),
            2 if count == faces.len() + 1 && self.connected(v) => Ok(Some(once)),
            _ => Err(()),
        }
    }

    /// Whether one can walk around `v` through all its faces.
    fn connected(&self, v: u32) -> bool {
        let faces = &self.around[v as usize];
        let mut reached = vec![false; faces.len()];
        let mut stack = vec![0];
        reached[0] = true;
        let mut n = 1;
        while let Some(i) = stack.pop() {
            let t = self.triangles[faces[i] as usize];
            for (j, &g) in faces.iter().enumerate() {
                let s = self.triangles[g as usize];
                if !reached[j] && t.iter().any(|w| *w != v && s.contains(w)) {
                    reached[j] = true;
                    n += 1;
                    stack.push(j);
                }
            }
        }
        n == faces.len()
    }

    /// The cheapest allowed collapse that removes `v`.
    fn best(&self, v: u32) -> Option<Collapse> {
        if self.around[v as usize].is_empty() {
            return None;
        }
        let boundary = self.boundary(v).ok()?;
        let mut ring = Vec::new();
        self.ring(v, &mut ring);
        let mut best: Option<Collapse> = None;
        for &to in &ring {
            let limit = best.map_or(u64::MAX, |b| b.cost);
            if let Some(cost) = self.cost_given(v, to, boundary, &ring, limit) {
                let length = self.positions[v as usize].distance(self.positions[to as usize]) / self.unit;
                let length = (length as f32).to_bits();
                let here = Collapse { cost, length, from: v, to, stamp: 0 };
                best = Some(best.map_or(here, |b| b.min(here)));
            }
        }
        best
    }

    fn cost(&self, from: u32, to: u32) -> Option<u64> {
        let boundary = self.boundary(from).ok()?;
        let mut ring = Vec::new();
        self.ring(from, &mut ring);
        self.cost_given(from, to, boundary, &ring, u64::MAX)
    }

    /// Cost of moving `from` onto `to`, or `None` if that is not allowed or costs more than
    /// `limit`.
    fn cost_given(&self, from: u32, to: u32, boundary: Option<[u32; 2]>, ring: &[u32], limit: u64) -> Option<u64> {
        if boundary.is_some_and(|b| !b.contains(&to)) {
            return None;
        }
        let faces = &self.around[from as usize];
        let target = self.positions[to as usize];
        let far = &self.around[to as usize];
        if far.len() > MANY {
            return None;
        }
        // What rules most candidates out comes first: a change of earlier collapses, then a normal.
        let removed = |f: &&u32| self.triangles[**f as usize].contains(&to);
        let turned = |f: &u32| self.turned[*f as usize];
        let before = faces.iter().filter(removed).map(turned).fold(0.0, f64::max);
        let mut cost = faces.iter().map(turned).fold(before, f64::max);
        if rounded(cost) > limit {
            return None;
        }
        let moved = |f: u32| self.triangles[f as usize].map(|w| if w == from { to } else { w });
        for &f in faces.iter().filter(|f| !removed(f)) {
            let [a, b, c] = moved(f).map(|w| self.positions[w as usize]);
            let normal = (b - a).cross(c - a).try_normalize()?;
            let old = self.normals[f as usize];
            if normal.dot(old) <= 0.0 {
                return None;
            }
            cost = cost.max(before.max(self.turned[f as usize]) + normal.distance(old));
            if rounded(cost) > limit {
                return None;
            }
        }
        // An edge to the opposite corner of a face that vanishes is there already, however long.
        let is_opposite = |w: u32| faces.iter().filter(removed).any(|&f| self.triangles[f as usize].contains(&w));
        let is_too_long = |w: u32| self.positions[w as usize].distance(target) > self.longest_edge;
        if self.longest_edge.is_finite() && ring.iter().any(|&w| w != to && is_too_long(w) && !is_opposite(w)) {
            return None;
        }
        // Link condition: the common neighbours are the opposite corners of the faces at the edge.
        let at_edge = faces.iter().filter(removed).count();
        let common =
            ring.iter().filter(|&&w| w != to && far.iter().any(|&f| self.triangles[f as usize].contains(&w))).count();
        if common != at_edge || faces.len() == at_edge {
            return None;
        }
        // A fold onto an existing face (the last step of a tetrahedron) needs two common neighbours
        // in the only face that is kept.
        if faces.len() - at_edge == 1 && common == 2 {
            let folds = |t: [u32; 3]| far.iter().any(|&g| self.triangles[g as usize].iter().all(|w| t.contains(w)));
            if faces.iter().filter(|f| !removed(f)).any(|&f| folds(moved(f))) {
                return None;
            }
        }
        if let Some(b) = boundary {
            cost = cost.max(self.boundary_cost(from, to, b)?);
        }
        cost.is_finite().then(|| rounded(cost))
    }

    /// How much the boundary turns when its vertex `from` moves to its neighbour `to`.
    fn boundary_cost(&self, from: u32, to: u32, neighbours: [u32; 2]) -> Option<f64> {
        let other = if neighbours[0] == to { neighbours[1] } else { neighbours[0] };
        let [o, f, t] = [other, from, to].map(|v| self.positions[v as usize]);
        let new = (t - o).try_normalize()?;
        let turn = new.distance((f - o).normalize_or_zero()).max(new.distance((t - f).normalize_or_zero()));
        let before = [from, to, other].map(|v| self.boundary_turned[v as usize]).into_iter().fold(0.0, f64::max);
        Some(before + turn)
    }

    fn collapse(&mut self, from: u32, to: u32) {
        if let Ok(Some(b)) = self.boundary(from) {
            let cost = self.boundary_cost(from, to, b).unwrap_or(0.0);
            for v in [b[0], b[1]] {
                self.boundary_turned[v as usize] = cost;
            }
        }
        let faces = std::mem::take(&mut self.around[from as usize]);
        let (gone, kept): (Vec<u32>, Vec<u32>) =
            faces.into_iter().partition(|&f| self.triangles[f as usize].contains(&to));
        let before = gone.iter().map(|&f| self.turned[f as usize]).fold(0.0, f64::max);
        for &f in &gone {
            self.alive[f as usize] = false;
            for w in self.triangles[f as usize] {
                self.around[w as usize].retain(|&g| g != f);
            }
        }
        for &f in &kept {
            let t = self.triangles[f as usize].map(|w| if w == from { to } else { w });
            let [a, b, c] = t.map(|w| self.positions[w as usize]);
            let normal = (b - a).cross(c - a).normalize_or_zero();
            let f = f as usize;
            self.turned[f] = before.max(self.turned[f]) + normal.distance(self.normals[f]);
            self.normals[f] = normal;
            self.triangles[f] = t;
        }
        self.around[to as usize].extend(kept);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Topology;

    /// A box of 3 x 2 x 1 with `n` squares per unit, welded.
    fn block(n: usize) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let mut index = std::collections::BTreeMap::new();
        let mut positions = Vec::new();
        let mut triangles = Vec::new();
        let size = [3 * n, 2 * n, n];
        for axis in 0..3 {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            for side in [0, size[axis]] {
                for i in 0..size[u] {
                    for j in 0..size[v] {
                        let mut at = |di: usize, dj: usize| {
                            let mut c = [0; 3];
                            (c[axis], c[u], c[v]) = (side, i + di, j + dj);
                            *index.entry(c).or_insert_with(|| {
                                positions.push(DVec3::from(c.map(|x| x as f64 / n as f64)));
                                positions.len() as u32 - 1
                            })
                        };
                        let q = [at(0, 0), at(1, 0), at(1, 1), at(0, 1)];
                        let t = [[q[0], q[1], q[2]], [q[0], q[2], q[3]]];
                        triangles.extend(if side == 0 { t.map(|[a, b, c]| [a, c, b]) } else { t });
                    }
                }
            }
        }
        (positions, triangles)
    }

    fn volume(p: &[DVec3], t: &[[u32; 3]]) -> f64 {
        t.iter().map(|t| t.map(|v| p[v as usize])).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
    }

    #[test]
    fn a_box_keeps_its_shape_down_to_its_corners() {
        let (p, t) = block(4);
        let s = simplify(&p, &t, &SimplifyOptions { vertices: 8, longest_edge: f64::INFINITY }).unwrap();
        assert_eq!((s.vertices.len(), s.triangles.len()), (8, 12));
        assert!((volume(&p, &s.triangles) - 6.0).abs() < 1e-12);
        let topology = Topology::from_triangles(p.len(), s.triangles.clone(), vec![true; 12]);
        assert_eq!((topology.boundary_edges, topology.nonmanifold_edges, topology.misoriented_edges), (0, 0, 0));
    }

    #[test]
    fn it_stops_at_a_tetrahedron_and_keeps_boundaries() {
        let (p, t) = block(1);
        let s = simplify(&p, &t, &SimplifyOptions { vertices: 0, longest_edge: f64::INFINITY }).unwrap();
        assert!(s.vertices.len() >= 4 && volume(&p, &s.triangles) > 0.0);
        // A square sheet: its outline stays a square.
        let n = 6u32;
        let p: Vec<DVec3> =
            (0..=n).flat_map(|i| (0..=n).map(move |j| DVec3::new(f64::from(i), f64::from(j), 0.0))).collect();
        let at = |i, j| i * (n + 1) + j;
        let t: Vec<[u32; 3]> = (0..n * n)
            .map(|k| (k / n, k % n))
            .flat_map(|(i, j)| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]])
            .collect();
        let s = simplify(&p, &t, &SimplifyOptions { vertices: 4, longest_edge: f64::INFINITY }).unwrap();
        assert_eq!(s.vertices, vec![0, n, at(n, 0), at(n, n)]);
        let bounded = simplify(&p, &t, &SimplifyOptions { vertices: 4, longest_edge: 2.3 }).unwrap();
        assert!(
            bounded
                .triangles
                .iter()
                .all(|t| { (0..3).all(|k| p[t[k] as usize].distance(p[t[(k + 1) % 3] as usize]) <= 2.3) })
        );
    }

    #[test]
    fn vertices_without_a_fan_stay() {
        // Two tetrahedra that share vertex 0.
        let p: Vec<DVec3> =
            [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, DVec3::NEG_X, DVec3::NEG_Y, DVec3::NEG_Z].into();
        let tetrahedron = |a, b, c, d| [[a, b, c], [a, c, d], [a, d, b], [b, d, c]];
        let t = [tetrahedron(0, 1, 2, 3), tetrahedron(0, 4, 5, 6)].concat();
        let s = simplify(&p, &t, &SimplifyOptions { vertices: 1, longest_edge: f64::INFINITY }).unwrap();
        assert!(s.vertices.contains(&0) && s.triangles.len() == 8);
    }

    #[test]
    fn edges_that_were_long_already_do_not_keep_a_mesh_from_being_simplified() {
        // Half a wheel: the rim collapses although every spoke is longer than the bound.
        let n = 400u32;
        let rim = |i: u32| DVec3::new((f64::from(i) * 0.005).cos(), (f64::from(i) * 0.005).sin(), 0.0);
        let p: Vec<DVec3> = std::iter::once(DVec3::ZERO).chain((0..=n).map(rim)).collect();
        let t: Vec<[u32; 3]> = (1..=n).map(|i| [0, i, i + 1]).collect();
        let s = simplify(&p, &t, &SimplifyOptions { vertices: 100, longest_edge: 0.05 }).unwrap();
        assert_eq!((s.vertices.len(), s.vertices[0]), (100, 0));
        let spans = s.vertices[1..].windows(2).map(|w| p[w[0] as usize].distance(p[w[1] as usize]));
        assert!(spans.fold(0.0, f64::max) <= 0.05);
    }
}
