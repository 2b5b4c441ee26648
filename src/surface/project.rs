//! Phong projection onto a surface: the forward problem's search (paper, section 3.3, Definition
//! 2).

use crate::engine::Real;
use crate::geometry::NONE;

use super::long_fans::Reach;
use super::phong_surface::PhongSurface;
use super::psi::Root;
use super::vector::{Vector, distance_squared};

/// How a projection was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Found {
    /// Nothing within the search's cap; the point is the best guess.
    Nothing = 0,
    /// By the barycentric walk.
    Walk = 1,
    /// By the breadth-first search after the walk gave up.
    Search = 2,
}

/// A projection onto a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projection<S> {
    /// The triangle.
    pub face: u32,
    /// Barycentric coordinates in it.
    pub x: [S; 3],
    /// Squared distance from the projected point, in mean edges squared.
    pub distance_squared: S,
    /// How it was found.
    pub found: Found,
}

/// Bounds of the search.
#[derive(Clone, Copy, Debug)]
pub struct SearchLimits {
    /// Vertices visited by the greedy walk over edges.
    pub vertex_steps: u32,
    /// Triangles visited by the barycentric walk.
    pub triangle_steps: u32,
    /// Triangles tested by the breadth-first search.
    pub triangles: u32,
}

impl SearchLimits {
    /// The first pass over all points: what almost every point needs.
    pub const FIRST: Self = Self { vertex_steps: 256, triangle_steps: 12, triangles: 64 };
    /// The second pass, for the points the first one left.
    pub const SECOND: Self = Self { vertex_steps: 4096, triangle_steps: 12, triangles: 2048 };
}

/// Barycentric distance outside a triangle at which the walk crosses the edge without waiting for
/// Newton's method to converge.
pub const WALK_PATIENCE: f64 = 0.35;
/// The same for the search, which must not miss a root.
pub const SEARCH_PATIENCE: f64 = 2.0;

/// Squared distance from the vertex at which a search begins, up to which only roots nearby count:
/// a hundredth of a mean edge.
///
/// Next to a vertex the triangles around it may be so small that rounding moves the root between
/// two of them. A search then finds a root of a triangle farther off, and the vertex is a better
/// guess.
pub const BESIDE: f64 = 1e-4;
/// Squared distance of the roots that count there: ten times as far.
pub const ASIDE: f64 = 1e-2;

fn centroid<S: Real>() -> [S; 3] {
    [S::of(1.0 / 3.0); 3]
}

impl<S: Real, const D: usize> PhongSurface<S, D> {
    /// The vertex of `starts` nearest to `mean`; the earliest one on ties. [`NONE`] entries are
    /// passed over.
    #[inline]
    pub fn nearest_of(&self, mean: &Vector<S, D>, starts: &[u32]) -> u32 {
        let mut best = (S::HUGE, NONE);
        for &v in starts.iter().filter(|&&v| v != NONE) {
            let d = distance_squared(&self.vertices[v as usize].y, mean);
            if d < best.0 {
                best = (d, v);
            }
        }
        best.1
    }

    /// Greedy walk over edges to a vertex no farther from `mean` than all its neighbours: each step
    /// goes to the nearest neighbour, the lowest index on ties.
    pub fn walk_vertices(&self, mean: &Vector<S, D>, start: u32, steps: u32) -> u32 {
        let mut v = start;
        let mut d = distance_squared(&self.vertices[v as usize].y, mean);
        for _ in 0..steps {
            let mut next = v;
            let ring = self.ring(v);
            if let Some(fan) = self.long.of(v, ring.len()) {
                let to = (mean.map(|x| x.to_f64()), [0.0; 4]);
                fan.search(&to, Reach::Vertices, d.to_f64(), |t| {
                    for w in self.triangles[t as usize].v.into_iter().filter(|&w| w != v) {
                        let e = distance_squared(&self.vertices[w as usize].y, mean);
                        if e < d || (e == d && next != v && w < next) {
                            (d, next) = (e, w);
                        }
                    }
                    d.to_f64()
                });
            } else {
                for &w in ring {
                    let e = distance_squared(&self.vertices[w as usize].y, mean);
                    if e < d {
                        (d, next) = (e, w);
                    }
                }
            }
            if next == v {
                break;
            }
            v = next;
        }
        v
    }

    /// The triangle around `v` whose other two vertices are nearest to `mean` (sum of squared
    /// distances), the lowest on ties.
    fn facing_triangle(&self, mean: &Vector<S, D>, v: u32) -> u32 {
        let mut best = (S::HUGE, NONE);
        let mut look = |t: u32| {
            let mut sum = S::ZERO;
            for w in self.triangles[t as usize].v {
                if w != v {
                    sum += distance_squared(&self.vertices[w as usize].y, mean);
                }
            }
            if sum < best.0 || (sum == best.0 && t < best.1) {
                best = (sum, t);
            }
            best.0.to_f64()
        };
        let fan = self.fan(v);
        if let Some(long) = self.long.of(v, fan.len()) {
            let to = (mean.map(|x| x.to_f64()), [0.0; 4]);
            // Both vertices are in the box.
            long.search(&to, Reach::Vertices, f64::INFINITY, |t| 0.5 * look(t));
        } else {
            fan.iter().for_each(|&t| {
                look(t);
            });
        }
        best.1
    }

    pub(super) fn candidate(&self, mean: &Vector<S, D>, face: u32, x: [S; 3], found: Found) -> Projection<S> {
        let y = self.triangle(face).point(&x);
        Projection { face, x, distance_squared: distance_squared(&y, mean), found }
    }

    /// Barycentric walk: Newton's method in a triangle, then across the edge opposite to the most
    /// negative coordinate, until a root lies inside.
    #[inline(always)]
    fn walk_triangles(&self, mean: &Vector<S, D>, start: u32, steps: u32) -> Option<Projection<S>> {
        let (mut t, mut previous) = (start, NONE);
        for _ in 0..steps {
            match self.triangle(t).project(mean, S::of(WALK_PATIENCE)) {
                Root::Inside(x) => return Some(self.candidate(mean, t, x, Found::Walk)),
                Root::Outside(x) => {
                    let mut k = 0;
                    for i in 1..3 {
                        if x[i] < x[k] {
                            k = i;
                        }
                    }
                    let next = self.triangles[t as usize].neighbours[k];
                    if next == NONE || next == previous {
                        return None;
                    }
                    (previous, t) = (t, next);
                }
            }
        }
        None
    }

    /// Phong projection of `mean` by local search from the nearest of the `starts` vertices: walk
    /// over vertices, barycentric walk over triangles, breadth-first search. Where nothing is found
    /// within `limits`, the nearest point of the fan of the last vertex is the best guess, marked
    /// [`Found::Nothing`].
    ///
    /// This is what the kernel `project_phong` computes. It may differ from
    /// [`PhongSurface::project_exhaustive`] where several projections are nearly as close; then the
    /// average itself is ambiguous (paper, section 3.3).
    pub fn project(&self, mean: &Vector<S, D>, starts: &[u32], limits: SearchLimits) -> Projection<S> {
        let nowhere = Projection { face: NONE, x: centroid(), distance_squared: S::HUGE, found: Found::Nothing };
        if !mean.iter().all(|x| x.finite()) {
            return nowhere;
        }
        let start = self.nearest_of(mean, starts);
        if start == NONE {
            return nowhere;
        }
        let v = self.walk_vertices(mean, start, limits.vertex_steps);
        let t = self.facing_triangle(mean, v);
        if t == NONE {
            return nowhere;
        }
        let d = distance_squared(&self.vertices[v as usize].y, mean);
        let walked = self.walk_triangles(mean, t, limits.triangle_steps);
        // A projection farther away than a vertex cannot be the closest one: the walk went astray.
        if let Some(p) = walked.filter(|p| p.distance_squared <= d) {
            return p;
        }
        let most = if d <= S::of(BESIDE) { S::of(ASIDE) } else { S::HUGE };
        let searched = self.search(mean, [v, t], limits.triangles, most);
        match (walked.filter(|p| p.distance_squared <= most), searched) {
            (Some(a), Some(b)) => {
                if b.distance_squared < a.distance_squared {
                    b
                } else {
                    a
                }
            }
            (a, b) => a.or(b).unwrap_or_else(|| {
                // As near as that, the vertex is as good as a projection.
                let found = if d <= S::of(BESIDE) { Found::Search } else { Found::Nothing };
                self.guess(mean, v, found)
            }),
        }
    }

    /// The barycentric walk from triangle `start`, if it ends at a projection no farther away than
    /// any of the vertices `bounds`: the usual case when both are images of points nearby. `None`
    /// sends the caller to [`PhongSurface::project`].
    #[inline(always)]
    pub fn project_from(&self, mean: &Vector<S, D>, start: u32, bounds: &[u32]) -> Option<Projection<S>> {
        if start == NONE || !mean.iter().all(|x| x.finite()) {
            return None;
        }
        let p = self.walk_triangles(mean, start, SearchLimits::FIRST.triangle_steps)?;
        bounds
            .iter()
            .all(|&v| v == NONE || p.distance_squared <= distance_squared(&self.vertices[v as usize].y, mean))
            .then_some(p)
    }

    /// Projects an average whose neighbours went near the triangle `start` and the vertices
    /// `starts`.
    ///
    /// Nearly always the barycentric walk from the triangle ends at a projection that is nearer
    /// than the vertices; else these start the search, and a second, longer one for what that
    /// leaves.
    #[inline(always)]
    pub fn project_near(&self, mean: &Vector<S, D>, start: u32, starts: &[u32; 3]) -> Projection<S> {
        if let Some(p) = self.project_from(mean, start, starts) {
            return p;
        }
        let first = self.project(mean, starts, SearchLimits::FIRST);
        if first.found == Found::Nothing && first.face != NONE {
            return self.project(mean, starts, SearchLimits::SECOND);
        }
        first
    }

    /// The vertex `v` itself, as a point of its lowest triangle: the best guess where no projection
    /// was found.
    fn guess(&self, mean: &Vector<S, D>, v: u32, found: Found) -> Projection<S> {
        let Some(&t) = self.fan(v).first() else {
            return Projection { face: NONE, x: centroid(), distance_squared: S::HUGE, found: Found::Nothing };
        };
        let x = self.triangles[t as usize].v.map(|w| if w == v { S::ONE } else { S::ZERO });
        self.candidate(mean, t, x, found)
    }

    /// Definition 2 by brute force: Newton's method on every usable triangle, the closest root of
    /// all, the lowest triangle on ties. O(F).
    pub fn project_exhaustive(&self, mean: &Vector<S, D>) -> Option<Projection<S>> {
        let mut best: Option<Projection<S>> = None;
        for t in (0..self.triangles.len() as u32).filter(|&t| self.usable[t as usize]) {
            if let Root::Inside(x) = self.triangle(t).project(mean, S::of(SEARCH_PATIENCE)) {
                let c = self.candidate(mean, t, x, Found::Search);
                if best.is_none_or(|b| c.distance_squared < b.distance_squared) {
                    best = Some(c);
                }
            }
        }
        best
    }
}
