//! Geodesic distances on triangle meshes by fast marching.
//!
//! Fronts are circles, not lines: the distances at two vertices of a triangle place a virtual
//! source in the triangle's plane, from which the distance of the third vertex is measured (Novotni
//! and Klein 2002). That is exact on a plane. Sethian's ordering fails in obtuse triangles, where a
//! vertex can be reached before the edge the front comes through is complete; such a vertex is
//! corrected, and marched from again, when a shorter distance turns up later. No unfolding is
//! needed.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use glam::DVec3;
use rayon::prelude::*;

use crate::error::{Error, Result};

/// A vertex that has been marched from is marched from again if its distance falls by more than
/// this part of it.
pub(crate) const REOPEN: f64 = 1e-7;

/// One triangle seen from one of its vertices.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wedge {
    /// The other two vertices.
    pub(crate) ends: [u32; 2],
    /// Their distances from the vertex.
    pub(crate) lengths: [f64; 2],
    /// Cosine and sine of the angle at the vertex.
    pub(crate) cos: f64,
    pub(crate) sin: f64,
    /// Whether the angles at the other two vertices are obtuse.
    pub(crate) obtuse: [bool; 2],
}

/// Distances on one mesh; holds its triangles in the form marching needs.
#[derive(Clone, Debug)]
pub struct Geodesics {
    pub(crate) positions: Vec<DVec3>,
    start: Vec<u32>,
    wedges: Vec<Wedge>,
}

/// Memory of one march, to be used again by the next.
#[derive(Clone, Debug, Default)]
pub struct March {
    /// Distance of each vertex from the source, infinite where it was not reached.
    pub distances: Vec<f64>,
    /// The distance a vertex was last marched from with.
    pub(crate) marched: Vec<f64>,
    pub(crate) heap: BinaryHeap<Reverse<u64>>,
}

/// Orders by distance (rounded to single precision, which keeps its order), then by vertex.
pub(crate) fn key(distance: f64, vertex: u32) -> u64 {
    (u64::from((distance as f32).to_bits()) << 32) | u64::from(vertex)
}

impl Geodesics {
    /// Prepares `triangles` over `positions`. Triangles with two equal vertices are left out. O(V +
    /// F).
    ///
    /// # Errors
    /// [`Error::Input`] naming the triangle and the vertex that does not exist.
    pub fn new(positions: &[DVec3], triangles: &[[u32; 3]]) -> Result<Self> {
        let count = positions.len();
        for (i, t) in triangles.iter().enumerate() {
            if let Some(v) = t.iter().find(|v| **v as usize >= count) {
                let what = format!("triangle {i} names vertex {v}, there are {count}");
                return Err(Error::input(what, "Give the positions that these triangles index, from 0"));
            }
        }
        Ok(Self::of(positions, triangles))
    }

    /// As [`Geodesics::new`], for the triangles of a mesh.
    pub(crate) fn of(positions: &[DVec3], triangles: &[[u32; 3]]) -> Self {
        let proper = |t: &&[u32; 3]| t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
        let mut start = vec![0u32; positions.len() + 1];
        for t in triangles.iter().filter(proper) {
            for &v in t {
                start[v as usize + 1] += 1;
            }
        }
        for v in 0..positions.len() {
            start[v + 1] += start[v];
        }
        let mut fill = start.clone();
        let empty = Wedge { ends: [0; 2], lengths: [0.0; 2], cos: 0.0, sin: 0.0, obtuse: [false; 2] };
        let mut wedges = vec![empty; start[positions.len()] as usize];
        for t in triangles.iter().filter(proper) {
            for k in 0..3 {
                let ends = [t[(k + 1) % 3], t[(k + 2) % 3]];
                let p = positions[t[k] as usize];
                let [a, b] = ends.map(|w| positions[w as usize] - p);
                let (cross, dot) = (a.cross(b).length(), a.dot(b));
                let norm = cross.hypot(dot);
                let (cos, sin) = if norm > 0.0 { (dot / norm, cross / norm) } else { (1.0, 0.0) };
                let slot = &mut fill[t[k] as usize];
                let obtuse = [a.dot(b - a) > 0.0, b.dot(a - b) > 0.0];
                wedges[*slot as usize] = Wedge { ends, lengths: [a.length(), b.length()], cos, sin, obtuse };
                *slot += 1;
            }
        }
        Self { positions: positions.to_vec(), start, wedges }
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.start.len() - 1
    }

    /// Distances of all vertices from `source`, in `march.distances`; infinite on other components,
    /// and everywhere if there is no such vertex. O(V log V).
    pub fn distances_from(&self, source: u32, march: &mut March) {
        self.clear(march);
        self.add_source(source, march);
    }

    /// Forgets all sources: every distance becomes infinite.
    pub fn clear(&self, march: &mut March) {
        march.distances.clear();
        march.distances.resize(self.vertex_count(), f64::INFINITY);
        march.marched.clear();
        march.marched.resize(self.vertex_count(), f64::INFINITY);
    }

    /// Lowers the distances in `march` to those from `source` where these are shorter. Only that
    /// part of the mesh is visited. A march of another mesh is cleared first.
    pub fn add_source(&self, source: u32, march: &mut March) {
        let count = self.vertex_count();
        if march.distances.len() != count || march.marched.len() != count {
            self.clear(march);
        }
        if source as usize >= count {
            return;
        }
        self.spread(source, march, f64::INFINITY, |_| ());
    }

    /// [`Self::add_source`] up to a distance of `bound`. `first` is called with each vertex that
    /// is marched from for the first time; those that are reached and not yet marched from stay in
    /// the heap.
    pub(crate) fn spread(&self, source: u32, march: &mut March, bound: f64, mut first: impl FnMut(u32)) {
        let March { distances, marched, heap } = march;
        heap.clear();
        distances[source as usize] = 0.0;
        heap.push(Reverse(key(0.0, source)));
        while let Some(Reverse(top)) = heap.pop() {
            let v = (top & u64::from(u32::MAX)) as usize;
            let d = distances[v];
            if marched[v] == d {
                continue;
            }
            if d > bound {
                heap.push(Reverse(top));
                break;
            }
            if marched[v].is_infinite() {
                first(v as u32);
            }
            marched[v] = d;
            for wedge in self.wedges_at(v) {
                for side in 0..2 {
                    let (target, other) = (wedge.ends[side] as usize, wedge.ends[1 - side] as usize);
                    let old = distances[target];
                    // Where the angle is obtuse a front can reach its corner before both ends of
                    // the opposite side.
                    if old <= d && !wedge.obtuse[side] {
                        continue;
                    }
                    let mut new = d + wedge.lengths[side];
                    // Both ends of the side must be known; the later of the two looks across it.
                    if (distances[other] <= d || marched[other] == distances[other])
                        && let Some(straight) = across(d, distances[other], wedge, side)
                    {
                        new = new.min(straight);
                    }
                    let worth = if marched[target] == old { old * (1.0 - REOPEN) } else { old };
                    if new < worth {
                        distances[target] = new;
                        heap.push(Reverse(key(new, wedge.ends[side])));
                    }
                }
            }
        }
    }

    /// The triangles around a vertex.
    pub(crate) fn wedges_at(&self, v: usize) -> &[Wedge] {
        &self.wedges[self.start[v] as usize..self.start[v + 1] as usize]
    }

    /// The same with vertices numbered breadth first, so that the data of neighbours lie near one
    /// another in memory, and the new number of each vertex. O(V + F).
    pub(crate) fn breadth_first(&self) -> (Self, Vec<u32>) {
        let n = self.vertex_count();
        let (mut number, mut order) = (vec![u32::MAX; n], Vec::with_capacity(n));
        for seed in 0..n as u32 {
            let mut done = order.len();
            let mut reach = |v: u32, order: &mut Vec<u32>| {
                if number[v as usize] == u32::MAX {
                    number[v as usize] = order.len() as u32;
                    order.push(v);
                }
            };
            reach(seed, &mut order);
            while let Some(&v) = order.get(done) {
                done += 1;
                self.wedges_at(v as usize).iter().flat_map(|w| w.ends).for_each(|w| reach(w, &mut order));
            }
        }
        let mut start = vec![0];
        let mut wedges = Vec::with_capacity(self.wedges.len());
        for &v in &order {
            let moved = |w: &Wedge| Wedge { ends: w.ends.map(|v| number[v as usize]), ..*w };
            wedges.extend(self.wedges_at(v as usize).iter().map(moved));
            start.push(wedges.len() as u32);
        }
        let positions = order.iter().map(|&v| self.positions[v as usize]).collect();
        (Self { positions, start, wedges }, number)
    }

    /// Distances between all pairs of `sources`, row-major; row i comes from the march that starts
    /// at source i, so that the matrix is symmetric only up to the marching error. Parallel over
    /// sources. A source that does not exist is infinitely far from all. `done` hears of every row.
    ///
    /// # Errors
    /// Those of `done`, which end the marches.
    pub fn matrix(&self, sources: &[u32], done: impl Fn() -> Result<()> + Sync) -> Result<Vec<f64>> {
        let rows: Result<Vec<Vec<f64>>> = sources
            .par_iter()
            .map_init(March::default, |march, &source| {
                self.distances_from(source, march);
                done()?;
                let distance = |s: &u32| march.distances.get(*s as usize).copied().unwrap_or(f64::INFINITY);
                Ok(sources.iter().map(distance).collect())
            })
            .collect();
        Ok(rows?.concat())
    }
}

/// Distance of end `side` of the wedge from the virtual source that is `d` away from its vertex and
/// `e` from the other end; `None` if the straight line does not pass between the two.
#[inline]
fn across(d: f64, e: f64, wedge: &Wedge, side: usize) -> Option<f64> {
    // The vertex is the origin, the other end at (base, 0), the target above and the source below
    // the base.
    let (base, reach) = (wedge.lengths[1 - side], wedge.lengths[side]);
    let (tx, ty) = (reach * wedge.cos, reach * wedge.sin);
    let sx = ((d - e) * (d + e) + base * base) / (2.0 * base);
    let sy2 = (d - sx) * (d + sx);
    if sy2 <= 0.0 || sy2.is_nan() {
        return None;
    }
    let sy = sy2.sqrt();
    // Where the line crosses the base, times (sy + ty).
    let crossing = sx * ty + tx * sy;
    let height = sy + ty;
    (crossing >= 0.0 && crossing <= base * height).then(|| ((tx - sx) * (tx - sx) + height * height).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(n: usize, shear: f64) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let at = |i: usize, j: usize| (i * (n + 1) + j) as u32;
        let positions = (0..=n)
            .flat_map(|i| (0..=n).map(move |j| DVec3::new(j as f64 + shear * i as f64, i as f64, 0.0) / n as f64))
            .collect();
        let triangles = (0..n)
            .flat_map(|i| (0..n).map(move |j| (i, j)))
            .flat_map(|(i, j)| [[at(i, j), at(i, j + 1), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i + 1, j)]])
            .collect();
        (positions, triangles)
    }

    /// An octahedron subdivided `levels` times and projected to the unit sphere.
    fn sphere(levels: usize) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let mut p = vec![DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];
        let mut t: Vec<[u32; 3]> =
            vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
        for _ in 0..levels {
            let mut middle = std::collections::BTreeMap::new();
            let mut next = Vec::new();
            for [a, b, c] in t {
                let mut mid = |i: u32, j: u32| {
                    *middle.entry((i.min(j), i.max(j))).or_insert_with(|| {
                        p.push((p[i as usize] + p[j as usize]).normalize());
                        p.len() as u32 - 1
                    })
                };
                let (d, e, f) = (mid(a, b), mid(b, c), mid(c, a));
                next.extend([[a, d, f], [d, b, e], [f, e, c], [d, e, f]]);
            }
            t = next;
        }
        (p, t)
    }

    fn worst(p: &[DVec3], t: &[[u32; 3]], source: u32, exact: impl Fn(DVec3) -> f64) -> f64 {
        let mut march = March::default();
        Geodesics::of(p, t).distances_from(source, &mut march);
        p.iter()
            .zip(&march.distances)
            .filter(|(x, _)| exact(**x) > 0.0)
            .map(|(x, d)| (d / exact(*x) - 1.0).abs())
            .fold(0.0, f64::max)
    }

    #[test]
    fn a_convex_plane_is_exact_even_when_obtuse() {
        for shear in [0.0, 2.5] {
            let (p, t) = grid(20, shear);
            for source in [0, 220, 440] {
                let from = p[source];
                let worst = worst(&p, &t, source as u32, |x| x.distance(from));
                assert!(worst < 1e-6, "shear {shear}, source {source}: {worst}");
            }
        }
    }

    #[test]
    fn a_sphere_is_within_two_percent() {
        let (p, t) = sphere(5);
        for source in [0, 77, 500] {
            let from = p[source];
            let worst = worst(&p, &t, source as u32, |x| from.angle_between(x));
            assert!(worst < 0.02, "{worst}");
        }
    }

    #[test]
    fn other_components_are_infinitely_far() {
        let p = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, DVec3::X + DVec3::Z, DVec3::Y + DVec3::Z];
        let mut march = March::default();
        Geodesics::of(&p, &[[0, 1, 2], [3, 4, 5]]).distances_from(1, &mut march);
        assert_eq!(march.distances[1], 0.0);
        assert!((march.distances[2] - 2f64.sqrt()).abs() < 1e-15);
        assert!(march.distances[3..].iter().all(|d| d.is_infinite()));
    }

    #[test]
    fn several_sources_give_the_nearest() {
        let (p, t) = grid(12, 0.3);
        let g = Geodesics::of(&p, &t);
        let (mut both, mut a, mut b) = (March::default(), March::default(), March::default());
        g.distances_from(0, &mut a);
        g.distances_from(168, &mut b);
        g.distances_from(0, &mut both);
        g.add_source(168, &mut both);
        for v in 0..p.len() {
            let nearest = a.distances[v].min(b.distances[v]);
            assert!((both.distances[v] / nearest.max(1e-300) - 1.0).abs() < 0.05 || nearest == 0.0);
        }
    }
}
