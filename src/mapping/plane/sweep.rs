//! Steps for many points at once on SIMD lanes: the fast path of the CPU back end.
//!
//! Points at a vertex, where the form of [`super::passes`] divides by zero, are told by their
//! distance and left to the reference.

use super::mean_value::AT_VERTEX;
use super::outline::Outline;
use super::passes::{Corner, around, moved};
use super::step::{Coordinates, Step, determinant};
use crate::engine::lane::MAX_LANES;
use crate::engine::{Lane, LaneScalar, Lanes, Real, Sweep, TILE};

/// Points component by component, in whole tiles; what fills the last one is a copy of the last
/// point.
#[derive(Clone, Debug)]
pub(super) struct SweepPoints<E> {
    x: Vec<E>,
    y: Vec<E>,
    /// What the points are more than their components; empty where that is not wanted.
    tail: [Vec<E>; 2],
    /// The entries of the derivatives, row by row; empty where they are not wanted.
    derivative: [Vec<E>; 4],
}

impl<E: Real> SweepPoints<E> {
    /// `points`, at least one, and the derivatives they come with.
    pub(super) fn new(points: &[[E; 2]], derivatives: Option<&[[[E; 2]; 2]]>) -> Self {
        Self::padded(points, derivatives, TILE)
    }

    /// Fewer points than a tile, at least one, padded to whole groups of lanes only.
    pub(super) fn few(points: &[[E; 2]]) -> Self {
        Self::padded(points, None, MAX_LANES)
    }

    fn padded(points: &[[E; 2]], derivatives: Option<&[[[E; 2]; 2]]>, to: usize) -> Self {
        let whole = points.len().next_multiple_of(to);
        let padded = |of: &dyn Fn(usize) -> E| (0..whole).map(|i| of(i.min(points.len() - 1))).collect::<Vec<E>>();
        let derivative = match derivatives {
            None => Default::default(),
            Some(d) => std::array::from_fn(|k| padded(&|i| d[i][k / 2][k % 2])),
        };
        Self { x: padded(&|i| points[i][0]), y: padded(&|i| points[i][1]), tail: Default::default(), derivative }
    }

    /// Points in two parts, the second smaller than a rounding of the first, with derivatives. A
    /// step takes the first part as the point, and the second by its derivative, so that points do
    /// not lose to rounding from step to step what displacements, being small, still have.
    pub(super) fn in_parts(points: &[[[E; 2]; 2]], derivatives: &[[[E; 2]; 2]]) -> Self {
        let first: Vec<[E; 2]> = points.iter().map(|p| p[0]).collect();
        let mut all = Self::new(&first, Some(derivatives));
        let tail = |axis: usize| (0..all.x.len()).map(|i| points[i.min(points.len() - 1)][1][axis]).collect();
        all.tail = [tail(0), tail(1)];
        all
    }

    /// The second parts of points that have them.
    pub(super) fn store_tails(&self, points: &mut [[[E; 2]; 2]]) {
        let [x, y] = &self.tail;
        for ((p, x), y) in points.iter_mut().zip(x).zip(y) {
            p[1] = [*x, *y];
        }
    }

    /// Back into pairs.
    pub(super) fn store(&self, points: &mut [[E; 2]], derivatives: Option<&mut [[[E; 2]; 2]]>) {
        for (i, p) in points.iter_mut().enumerate() {
            *p = [self.x[i], self.y[i]];
        }
        let [a, b, c, d] = &self.derivative;
        for (i, out) in derivatives.into_iter().flatten().enumerate() {
            *out = [[a[i], b[i]], [c[i], d[i]]];
        }
    }

    fn has_derivatives(&self) -> bool {
        !self.derivative[0].is_empty()
    }

    /// Point `i` through the reference, its derivative multiplied.
    fn advance(&mut self, step: &Step<E>, i: usize) {
        let e = step.evaluate([self.x[i], self.y[i]]);
        [self.x[i], self.y[i]] = e.point;
        let [x, y] = &mut self.tail;
        if let (Some(x), Some(y)) = (x.get_mut(i), y.get_mut(i)) {
            let tail = [*x, *y];
            [*x, *y] = e.derivative.map(|row| row[0] * tail[0] + row[1] * tail[1]);
        }
        if self.has_derivatives() {
            let [a, b, c, d] = &mut self.derivative;
            let [[p, q], [r, s]] = product(e.derivative, [[a[i], b[i]], [c[i], d[i]]]);
            (a[i], b[i], c[i], d[i]) = (p, q, r, s);
        }
    }
}

/// A step prepared for sweeps.
#[derive(Clone, Debug)]
pub(super) struct SweepStep<'a, E> {
    pub(super) step: &'a Step<E>,
    pub(super) corners: Vec<Corner<E>>,
    /// The vertex after each.
    pub(super) next: Vec<usize>,
    /// Whether lanes can do it: mean value coordinates, and no loop is too short to have an edge.
    swept: bool,
}

impl<'a, E: LaneScalar> SweepStep<'a, E> {
    pub(super) fn new(step: &'a Step<E>) -> Self {
        let Outline { vertices, displacements, .. } = &step.outline;
        let corner = |(i, k): (usize, usize)| {
            let (v, w) = (vertices[i], vertices[k]);
            Corner { v, u: displacements[i], edge: [w[0] - v[0], w[1] - v[1]] }
        };
        let next: Vec<usize> = step.outline.edges().map(|(_, k)| k).collect();
        let long = step.outline.loops.iter().all(|ring| ring.len() > 1) && !next.is_empty();
        let swept = long && step.coordinates == Coordinates::MeanValue;
        Self { step, corners: step.outline.edges().map(corner).collect(), next, swept }
    }

    /// Moves the points on the calling thread; derivatives are multiplied from the left by that of
    /// the step.
    pub(super) fn apply(&self, lanes: Lanes, points: &mut SweepPoints<E>) {
        if self.swept {
            lanes.run(Apply { step: self, points });
        } else {
            (0..points.x.len()).for_each(|i| points.advance(self.step, i));
        }
    }

    /// The Jacobian at each of the points, on the calling thread.
    pub(super) fn jacobians(&self, lanes: Lanes, points: &SweepPoints<E>) -> Vec<E> {
        let mut jacobians = vec![E::ZERO; points.x.len()];
        if self.swept {
            lanes.run(Jacobians { step: self, points, jacobians: &mut jacobians });
        } else {
            for (i, j) in jacobians.iter_mut().enumerate() {
                *j = determinant(self.step.evaluate([points.x[i], points.y[i]]).derivative);
            }
        }
        jacobians
    }
}

/// a b.
fn product<R: Real>(a: [[R; 2]; 2], b: [[R; 2]; 2]) -> [[R; 2]; 2] {
    a.map(|row| std::array::from_fn(|k| row[0] * b[0][k] + row[1] * b[1][k]))
}

/// Whether the reference has to do some of the points.
#[inline(always)]
fn any_at_vertex<L: Lane>(cpu: L::Cpu, square: L) -> bool {
    L::any(cpu, square.lt(L::num(cpu, 2.0 * AT_VERTEX * AT_VERTEX)))
}

/// a + b in two parts, exactly: the rounded sum, and what it is less (Knuth).
#[inline(always)]
fn sum<L: Lane>(a: L, b: L) -> (L, L) {
    let sum = a + b;
    let part = sum - a;
    (sum, (a - (sum - part)) + (b - part))
}

struct Apply<'a, 'b, E> {
    step: &'a SweepStep<'b, E>,
    points: &'a mut SweepPoints<E>,
}

impl<E: LaneScalar> Sweep<E> for Apply<'_, '_, E> {
    #[inline(always)]
    fn run<L: Lane<E = E>>(self, cpu: L::Cpu) {
        let Self { step, points } = self;
        for at in (0..points.x.len()).step_by(L::N) {
            let (x, y) = (L::load(cpu, &points.x[at..]), L::load(cpu, &points.y[at..]));
            if points.has_derivatives() {
                let found = around::<L>(cpu, step, x, y);
                if any_at_vertex(cpu, found.square) {
                    (at..at + L::N).for_each(|i| points.advance(step.step, i));
                    continue;
                }
                let one = L::num(cpu, 1.0);
                let [[p, q], [r, s]] = found.change;
                let (p, s) = (one + p, one + s);
                let [a, b, c, d] = &mut points.derivative;
                for (upper, lower) in [(a, c), (b, d)] {
                    let (u, v) = (L::load(cpu, &upper[at..]), L::load(cpu, &lower[at..]));
                    p.mul_add(u, q * v).store(&mut upper[at..]);
                    r.mul_add(u, s * v).store(&mut lower[at..]);
                }
                let [mx, my] = found.moved;
                let [tx, ty] = &mut points.tail;
                if tx.is_empty() {
                    (x + mx).store(&mut points.x[at..]);
                    (y + my).store(&mut points.y[at..]);
                    continue;
                }
                let (u, v) = (L::load(cpu, &tx[at..]), L::load(cpu, &ty[at..]));
                let (x, u) = sum(x, p.mul_add(u, q.mul_add(v, mx)));
                let (y, v) = sum(y, r.mul_add(L::load(cpu, &tx[at..]), s.mul_add(v, my)));
                x.store(&mut points.x[at..]);
                y.store(&mut points.y[at..]);
                u.store(&mut tx[at..]);
                v.store(&mut ty[at..]);
            } else {
                let (by, square) = moved::<L>(cpu, step, x, y);
                if any_at_vertex(cpu, square) {
                    (at..at + L::N).for_each(|i| points.advance(step.step, i));
                    continue;
                }
                (x + by[0]).store(&mut points.x[at..]);
                (y + by[1]).store(&mut points.y[at..]);
            }
        }
    }
}

struct Jacobians<'a, 'b, E> {
    step: &'a SweepStep<'b, E>,
    points: &'a SweepPoints<E>,
    jacobians: &'a mut [E],
}

impl<E: LaneScalar> Sweep<E> for Jacobians<'_, '_, E> {
    #[inline(always)]
    fn run<L: Lane<E = E>>(self, cpu: L::Cpu) {
        let Self { step, points, jacobians } = self;
        for at in (0..points.x.len()).step_by(L::N) {
            let (x, y) = (L::load(cpu, &points.x[at..]), L::load(cpu, &points.y[at..]));
            let found = around::<L>(cpu, step, x, y);
            if any_at_vertex(cpu, found.square) {
                for i in at..at + L::N {
                    jacobians[i] = step.step.evaluate([points.x[i], points.y[i]]).jacobian;
                }
                continue;
            }
            let one = L::num(cpu, 1.0);
            let [[a, b], [c, d]] = found.change;
            ((one + a) * (one + d) - b * c).store(&mut jacobians[at..]);
        }
    }
}
