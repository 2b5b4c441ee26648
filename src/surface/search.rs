//! Breadth-first search for a Phong projection, and the bound that keeps it from looking closely at
//! hopeless triangles.

use std::cell::RefCell;

use crate::engine::Real;
use crate::geometry::NONE;

use super::long_fans::LONGEST;
use super::phong_surface::PhongSurface;
use super::project::{Found, Projection, SEARCH_PATIENCE};
use super::psi::{CORNER_OF_BASIS, Root, TangentTriangle};
use super::vector::{Vector, distance_squared, dot, sub};

/// What is known of all planes and points of a triangle at once.
///
/// On the triangle, Psi is a convex combination of the six bases `A_k` (see [`super::psi`]), so
/// with `B` their mean its distance from `B` is at most `spread = max |A_k - B|`. At a root `Psi r
/// = 0` with `r = x - ybar`, hence `|B r| <= spread |r|`; with the triangle within `radius` of its
/// centre `c`,
///
/// `|B (c - ybar)| <= |B| radius + spread (|c - ybar| + radius)`.
///
/// A triangle that fails this has no root.
#[derive(Clone, Copy, Debug)]
pub struct TriangleBound<S, const D: usize> {
    pub(super) centre: Vector<S, D>,
    pub(super) basis: [Vector<S, D>; 2],
    /// `|B| radius + spread radius`, with a margin for rounding and for roots within the slack.
    pub(super) reach: S,
    /// `spread`, with the same margin.
    pub(super) spread: S,
}

/// Widens the bound: far more than single precision rounds and than [`super::psi::slack`] lets
/// roots lie outside.
const MARGIN: f64 = 1.01;

/// The largest singular value of two rows.
fn norm<const D: usize>(m: &[Vector<f64, D>; 2]) -> f64 {
    let (a, b, c) = (dot(&m[0], &m[0]), dot(&m[0], &m[1]), dot(&m[1], &m[1]));
    (0.5 * (a + c) + (0.25 * (a - c) * (a - c) + b * b).sqrt()).max(0.0).sqrt()
}

impl<const D: usize> TriangleBound<f64, D> {
    /// The bound of a triangle.
    pub fn new(t: &TangentTriangle<'_, f64, D>) -> Self {
        let centre = t.point(&[1.0 / 3.0; 3]);
        let bases: [[Vector<f64, D>; 2]; 6] = std::array::from_fn(|k| {
            let rows = t.t[CORNER_OF_BASIS[k]];
            let m = t.gauge[k].matrix();
            [0, 1].map(|r| std::array::from_fn(|e| m[2 * r] * rows[0][e] + m[2 * r + 1] * rows[1][e]))
        });
        let basis = [0, 1].map(|r| std::array::from_fn(|e| bases.iter().map(|a| a[r][e]).sum::<f64>() / 6.0));
        let spread = bases.iter().map(|a| norm(&[sub(&a[0], &basis[0]), sub(&a[1], &basis[1])])).fold(0.0, f64::max);
        let radius = t.v.iter().map(|v| distance_squared(v, &centre).sqrt()).fold(0.0, f64::max);
        Self { centre, basis, reach: MARGIN * radius * (norm(&basis) + spread), spread: MARGIN * spread }
    }
}

impl<S: Real, const D: usize> TriangleBound<S, D> {
    /// Whether the triangle can hold a Phong projection of `mean`.
    #[inline(always)]
    pub fn admits(&self, mean: &Vector<S, D>) -> bool {
        let d = sub(&self.centre, mean);
        let (a, b) = (dot(&self.basis[0], &d), dot(&self.basis[1], &d));
        let most = self.reach + self.spread * dot(&d, &d).sqrt();
        a * a + b * b <= most * most
    }

    /// Converts the scalars.
    pub fn cast<T: Real>(&self) -> TriangleBound<T, D> {
        let one = |x: S| T::of(x.to_f64());
        TriangleBound {
            centre: super::vector::cast(&self.centre),
            basis: [super::vector::cast(&self.basis[0]), super::vector::cast(&self.basis[1])],
            reach: one(self.reach),
            spread: one(self.spread),
        }
    }
}

/// Marks of one thread's searches: an element is marked if its entry is the current round.
#[derive(Default)]
struct Marks {
    round: u32,
    triangles: Vec<u32>,
    vertices: Vec<u32>,
    level: Vec<u32>,
    next: Vec<u32>,
}

thread_local! {
    static MARKS: RefCell<Marks> = RefCell::default();
}

impl Marks {
    fn begin(&mut self, triangles: usize, vertices: usize) {
        self.round = self.round.wrapping_add(1);
        if self.round == 0 || self.triangles.len() < triangles || self.vertices.len() < vertices {
            self.triangles = vec![0; triangles.max(self.triangles.len())];
            self.vertices = vec![0; vertices.max(self.vertices.len())];
            self.round = 1;
        }
        self.level.clear();
    }
}

impl<S: Real, const D: usize> PhongSurface<S, D> {
    /// Breadth-first search over triangles that share a vertex, level by level from the fan of `v`:
    /// the nearest root of the first level that has one (lowest triangle on ties). At most `cap`
    /// triangles are looked at, a level is always finished. Of a long fan ([`LONGEST`]) a level has
    /// only what is beside the triangle from which the search comes to it: `facing`, a triangle of
    /// the fan of `v`, to begin with. Roots whose squared distance is above `most` do not
    /// count.
    pub(super) fn search(
        &self,
        mean: &Vector<S, D>,
        [v, facing]: [u32; 2],
        cap: u32,
        most: S,
    ) -> Option<Projection<S>> {
        MARKS.with_borrow_mut(|marks| self.search_marked(mean, [v, facing], cap, most, marks))
    }

    fn search_marked(
        &self,
        mean: &Vector<S, D>,
        from: [u32; 2],
        cap: u32,
        most: S,
        marks: &mut Marks,
    ) -> Option<Projection<S>> {
        let mut found = None;
        self.levels(from, cap, marks, |level| {
            let mut best: Option<Projection<S>> = None;
            for &t in level.iter().filter(|&&t| self.bounds[t as usize].admits(mean)) {
                let root = self.triangle(t).project(mean, S::of(SEARCH_PATIENCE));
                if let Root::Inside(x) = root {
                    let c = self.candidate(mean, t, x, Found::Search);
                    let closer = |b: &Projection<S>| {
                        c.distance_squared < b.distance_squared
                            || (c.distance_squared == b.distance_squared && t < b.face)
                    };
                    if c.distance_squared <= most && best.as_ref().is_none_or(closer) {
                        best = Some(c);
                    }
                }
            }
            found = best;
            found.is_some()
        });
        found
    }

    /// Visits the levels of triangles around `v` until `stop` says so, or `cap` triangles were
    /// passed to it.
    fn levels(&self, [v, facing]: [u32; 2], cap: u32, marks: &mut Marks, mut stop: impl FnMut(&[u32]) -> bool) {
        marks.begin(self.triangles.len(), self.vertices.len());
        let Marks { round, triangles, vertices, level, next } = marks;
        let mut passed = 0;
        next.clear();
        let mut expand = |w: u32, from: u32, next: &mut Vec<u32>| {
            if std::mem::replace(&mut vertices[w as usize], *round) != *round {
                let mut new = |t: u32| std::mem::replace(&mut triangles[t as usize], *round) != *round;
                let fan = self.fan(w);
                let mut pass = |t: u32| next.extend(Some(t).filter(|&t| new(t)));
                match self.long.of(w, fan.len()) {
                    None => fan.iter().for_each(|&t| pass(t)),
                    Some(long) if long.triangles().len() <= LONGEST => long.triangles().iter().for_each(|&t| pass(t)),
                    Some(_) => self.beside(w, from, pass),
                }
            }
        };
        expand(v, facing, next);
        while !next.is_empty() && passed < cap {
            std::mem::swap(level, next);
            next.clear();
            passed += level.len() as u32;
            if stop(level) {
                return;
            }
            for &t in level.iter() {
                for w in self.triangles[t as usize].v {
                    expand(w, t, next);
                }
            }
        }
    }

    /// Calls `visit` with `t`, a triangle of the fan of `v`, and with as many on both sides of it
    /// as make [`LONGEST`] together, or as there are until the fan ends.
    fn beside(&self, v: u32, t: u32, mut visit: impl FnMut(u32)) {
        visit(t);
        // Leaving a triangle across the edge that is opposite to one of its outer vertices.
        for mut opposite in self.triangles[t as usize].v.into_iter().filter(|&w| w != v) {
            let mut at = t;
            for _ in 0..LONGEST / 2 {
                let triangle = &self.triangles[at as usize];
                let Some(k) = triangle.v.iter().position(|&w| w == opposite) else { break };
                let Some(kept) = triangle.v.into_iter().find(|&w| w != v && w != opposite) else { break };
                if triangle.neighbours[k] == NONE {
                    break;
                }
                (at, opposite) = (triangle.neighbours[k], kept);
                visit(at);
            }
        }
    }

    /// Appends the triangles that a search from `v` capped at `cap` passes, the first of each level
    /// marked by [`NEW_LEVEL`]: the order in which a kernel looks at them.
    pub(super) fn neighbourhood(&self, v: u32, cap: u32, out: &mut Vec<u32>) {
        MARKS.with_borrow_mut(|marks| {
            let Some(&facing) = self.fan(v).first() else { return };
            self.levels([v, facing], cap, marks, |level| {
                let first = out.len();
                out.extend_from_slice(level);
                out[first] |= NEW_LEVEL;
                false
            });
        });
    }
}

/// Marks the first triangle of a level.
pub(super) const NEW_LEVEL: u32 = 1 << 31;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Topology;
    use crate::models::shapes::{Random, lobed_sphere, uv_sphere};
    use crate::surface::theory::lift;

    #[test]
    fn no_triangle_with_a_root_is_passed_over() {
        let mesh = lobed_sphere(2, 0.5);
        let s = PhongSurface::<f64, 8>::new(&Topology::new(&mesh), &lift(&mesh)).unwrap();
        let single = s.cast::<f32>();
        let mut random = Random::new(11);
        let (mut roots, mut admitted, mut all) = (0, 0, 0);
        for distance in [0.0, 1.0, 5.0] {
            for _ in 0..60 {
                let t = (random.unit() * s.triangles.len() as f64) as u32;
                let mut mean = s.triangle(t).point(&[0.2, 0.3, 0.5]);
                for x in &mut mean {
                    *x += distance * random.signed();
                }
                let rounded = mean.map(|x| x as f32);
                for t in 0..s.triangles.len() as u32 {
                    all += 1;
                    let admits = s.bounds[t as usize].admits(&mean);
                    admitted += usize::from(admits);
                    if let Root::Inside(_) = s.triangle(t).project(&mean, 2.0) {
                        roots += 1;
                        assert!(admits, "triangle {t}, distance {distance}");
                    }
                    if let Root::Inside(_) = single.triangle(t).project(&rounded, 2.0) {
                        assert!(single.bounds[t as usize].admits(&rounded), "triangle {t}, distance {distance}");
                    }
                }
            }
        }
        assert!(roots > 100 && admitted * 2 < all, "{roots} roots, {admitted} of {all} admitted");
    }

    /// A double cone: around a vertex of thousands of triangles a search stays where it came from,
    /// and finds what there is.
    #[test]
    fn a_search_does_not_pass_a_whole_long_fan() {
        let n = 2000;
        let mesh = uv_sphere(1.0, n, 2);
        let s = PhongSurface::<f64, 8>::new(&Topology::new(&mesh), &lift(&mesh)).unwrap();
        let mut near = Vec::new();
        for v in 0..s.vertices.len() as u32 {
            let before = near.len();
            s.neighbourhood(v, 64, &mut near);
            let passed: Vec<u32> = near[before..].iter().map(|t| t & !NEW_LEVEL).collect();
            assert!(s.fan(v).iter().filter(|t| passed.contains(t)).count() >= s.fan(v).len().min(LONGEST));
            assert!(passed.len() < 4 * LONGEST, "{}", passed.len());
        }
        let mut random = Random::new(5);
        for _ in 0..200 {
            let t = (random.unit() * s.triangles.len() as f64) as u32;
            let mut mean = s.triangle(t).point(&[0.3, 0.3, 0.4]);
            mean.iter_mut().for_each(|x| *x += 1e-3 * random.signed());
            let wanted = s.project_exhaustive(&mean).unwrap();
            let v = s.triangles[t as usize].v[0];
            let found = s.search(&mean, [v, t], 64, f64::INFINITY).unwrap();
            assert!(found.distance_squared < 4.0 * wanted.distance_squared + 1e-12, "{found:?} {wanted:?}");
        }
    }
}
