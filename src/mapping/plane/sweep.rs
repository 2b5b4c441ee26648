//! Steps for many points at once on SIMD lanes: the fast path of the CPU back end.
//!
//! The form is that of [`super::mean_value`]; each lane has its own widest edge, kept as area, scalar product and number. Points at a
//! vertex, where that form divides by zero, are told by their distance and done again by the reference.

use super::mean_value::AT_VERTEX;
use super::outline::Outline;
use super::step::{Coordinates, Step, determinant};
use crate::engine::lane::MAX_LANES;
use crate::engine::{Lane, LaneScalar, Lanes, Real, Sweep, TILE};

/// Points component by component, in whole tiles; what fills the last one is a copy of the last point.
#[derive(Clone, Debug)]
pub(super) struct SweepPoints<E> {
    x: Vec<E>,
    y: Vec<E>,
    /// The entries of the derivatives, row by row; empty where they are not wanted.
    derivative: [Vec<E>; 4],
}

impl<E: Real> SweepPoints<E> {
    /// `points`, at least one, and the derivatives they come with.
    pub(super) fn new(points: &[[E; 2]], derivatives: Option<&[[[E; 2]; 2]]>) -> Self {
        let whole = points.len().next_multiple_of(TILE);
        let padded = |of: &dyn Fn(usize) -> E| (0..whole).map(|i| of(i.min(points.len() - 1))).collect::<Vec<E>>();
        let derivative = match derivatives {
            None => Default::default(),
            Some(d) => std::array::from_fn(|k| padded(&|i| d[i][k / 2][k % 2])),
        };
        Self { x: padded(&|i| points[i][0]), y: padded(&|i| points[i][1]), derivative }
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
        if self.has_derivatives() {
            let [a, b, c, d] = &mut self.derivative;
            let [[p, q], [r, s]] = product(e.derivative, [[a[i], b[i]], [c[i], d[i]]]);
            (a[i], b[i], c[i], d[i]) = (p, q, r, s);
        }
    }
}

/// A vertex as a sweep reads it: position, displacement, and the edge to the next vertex of its loop.
#[derive(Clone, Copy, Debug)]
struct Corner<E> {
    v: [E; 2],
    u: [E; 2],
    edge: [E; 2],
}

/// A step prepared for sweeps.
#[derive(Clone, Debug)]
pub(super) struct SweepStep<'a, E> {
    step: &'a Step<E>,
    corners: Vec<Corner<E>>,
    /// The vertex after each.
    next: Vec<usize>,
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

    /// Moves the points on the calling thread; derivatives are multiplied from the left by that of the step.
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

/// What one pass over the polygon gives for a group of points.
struct Found<L> {
    /// Image minus point.
    moved: [L; 2],
    /// Derivative minus identity.
    change: [[L; 2]; 2],
    /// Squared distance to the nearest vertex.
    square: L,
}

/// Whether the reference has to do some of the points.
#[inline(always)]
fn any_at_vertex<L: Lane>(cpu: L::Cpu, square: L) -> bool {
    L::any(cpu, square.lt(L::num(cpu, 2.0 * AT_VERTEX * AT_VERTEX)))
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
                let found = around::<L, true>(cpu, step, x, y);
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
                (x + found.moved[0]).store(&mut points.x[at..]);
                (y + found.moved[1]).store(&mut points.y[at..]);
            } else {
                let found = around::<L, false>(cpu, step, x, y);
                if any_at_vertex(cpu, found.square) {
                    (at..at + L::N).for_each(|i| points.advance(step.step, i));
                    continue;
                }
                (x + found.moved[0]).store(&mut points.x[at..]);
                (y + found.moved[1]).store(&mut points.y[at..]);
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
            let found = around::<L, true>(cpu, step, x, y);
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

/// One end of an edge, seen from the points.
#[derive(Clone, Copy)]
struct Spoke<L> {
    x: L,
    y: L,
    square: L,
}

/// The same for the second pass.
#[derive(Clone, Copy)]
struct Ray<L> {
    spoke: Spoke<L>,
    r: L,
    inverse: L,
    /// s / r^2.
    x: L,
    y: L,
}

/// T of an edge and its gradient.
#[derive(Clone, Copy)]
struct Half<L> {
    t: L,
    x: L,
    y: L,
}

#[inline(always)]
fn spoke<L: Lane>(cpu: L::Cpu, v: [L::E; 2], x: L, y: L) -> Spoke<L> {
    let (x, y) = (L::splat(cpu, v[0]) - x, L::splat(cpu, v[1]) - y);
    Spoke { x, y, square: x.mul_add(x, y * y) }
}

/// A, with the digits of the nearer end.
#[inline(always)]
fn area<L: Lane>(ex: L, ey: L, a: Spoke<L>, b: Spoke<L>) -> L {
    let near = b.square.lt(a.square);
    let (x, y) = (L::select(near, b.x, a.x), L::select(near, b.y, a.y));
    x * ey - y * ex
}

/// D.
#[inline(always)]
fn dot<L: Lane>(a: Spoke<L>, b: Spoke<L>) -> L {
    a.x.mul_add(b.x, a.y * b.y)
}

/// What the first pass finds: see [`super::mean_value::Scan`].
struct Scan<L> {
    /// Squared distance of the nearest vertex, and its displacement.
    square: L,
    base: [L; 2],
    /// Number of the edge seen under the widest obtuse angle; -1 for none.
    widest: L,
    tau: L,
    slope: [L; 2],
}

#[inline(always)]
fn scan<L: Lane>(cpu: L::Cpu, step: &SweepStep<'_, L::E>, x: L, y: L) -> Scan<L> {
    let (zero, one) = (L::num(cpu, 0.0), L::num(cpu, 1.0));
    let (mut square, mut base) = (L::splat(cpu, L::E::HUGE), [zero; 2]);
    // |A| and -D of the widest so far; with these numbers any obtuse angle wins.
    let (mut best_area, mut best_product, mut widest) = (one, zero, -one);
    let mut counter = zero;
    for ring in &step.step.outline.loops {
        let corners = &step.corners[ring.clone()];
        let first = spoke(cpu, corners[0].v, x, y);
        let mut here = first;
        for (i, corner) in corners.iter().enumerate() {
            let there = if i + 1 < corners.len() { spoke(cpu, corners[i + 1].v, x, y) } else { first };
            let closer = here.square.lt(square);
            square = L::select(closer, here.square, square);
            base[0] = L::select(closer, L::splat(cpu, corner.u[0]), base[0]);
            base[1] = L::select(closer, L::splat(cpu, corner.u[1]), base[1]);
            let a = area(L::splat(cpu, corner.edge[0]), L::splat(cpu, corner.edge[1]), here, there).abs();
            let d = dot(here, there);
            // |A / D| falls as an obtuse angle widens; the products compare the quotients.
            let wider = a.mul_add(best_product, best_area * d).lt(zero);
            best_area = L::select(wider, a, best_area);
            best_product = L::select(wider, -d, best_product);
            widest = L::select(wider, counter, widest);
            counter = counter + one;
            here = there;
        }
    }
    // The widest edge, lane by lane.
    let mut numbers = [L::E::ZERO; MAX_LANES];
    widest.store(&mut numbers);
    let mut ends = [[L::E::ZERO; MAX_LANES]; 4];
    for lane in 0..L::N {
        let index = numbers[lane].to_f64().max(0.0) as usize;
        let (from, to) = (step.corners[index].v, step.corners[step.next[index]].v);
        (ends[0][lane], ends[1][lane], ends[2][lane], ends[3][lane]) = (from[0], from[1], to[0], to[1]);
    }
    let (fx, fy) = (L::load(cpu, &ends[0]), L::load(cpu, &ends[1]));
    let (tx, ty) = (L::load(cpu, &ends[2]), L::load(cpu, &ends[3]));
    let from = ray(cpu, Spoke::between(fx, fy, x, y));
    let to = ray(cpu, Spoke::between(tx, ty, x, y));
    let a = area(tx - fx, ty - fy, from.spoke, to.spoke);
    let tau = a / (from.r * to.r - dot(from.spoke, to.spoke));
    let factor = L::num(cpu, -0.5) * tau.mul_add(tau, one);
    // Where no angle is obtuse nothing is scaled.
    let none = widest.lt(zero);
    Scan {
        square,
        base,
        widest,
        tau: L::select(none, one, tau),
        slope: [L::select(none, zero, factor * (to.y - from.y)), L::select(none, zero, factor * (from.x - to.x))],
    }
}

impl<L: Lane> Spoke<L> {
    #[inline(always)]
    fn between(vx: L, vy: L, x: L, y: L) -> Self {
        let (x, y) = (vx - x, vy - y);
        Self { x, y, square: x.mul_add(x, y * y) }
    }
}

#[inline(always)]
fn ray<L: Lane>(cpu: L::Cpu, spoke: Spoke<L>) -> Ray<L> {
    let r = spoke.square.sqrt();
    let inverse = L::num(cpu, 1.0) / r;
    let square = inverse * inverse;
    Ray { spoke, r, inverse, x: spoke.x * square, y: spoke.y * square }
}

/// Running sums over the vertices.
struct Sums<L> {
    weight: L,
    moved: [L; 2],
    weight_gradient: [L; 2],
    moved_gradient: [[L; 2]; 2],
}

#[inline(always)]
fn around<L: Lane, const GRADIENT: bool>(cpu: L::Cpu, step: &SweepStep<'_, L::E>, x: L, y: L) -> Found<L> {
    let (zero, one) = (L::num(cpu, 0.0), L::num(cpu, 1.0));
    let quarter = L::num(cpu, 0.25);
    let found = scan(cpu, step, x, y);
    let scale = found.square.sqrt();
    // Edges until the widest: zero there.
    let mut left = found.widest;
    let mut sums = Sums { weight: zero, moved: [zero; 2], weight_gradient: [zero; 2], moved_gradient: [[zero; 2]; 2] };
    for ring in &step.step.outline.loops {
        let corners = &step.corners[ring.clone()];
        let first = ray(cpu, spoke(cpu, corners[0].v, x, y));
        let second = ray(cpu, spoke(cpu, corners[1].v, x, y));
        let leaving = edge::<L, GRADIENT>(cpu, &corners[0], &first, &second, &found, (left * left).lt(quarter));
        left = left - one;
        let (mut here, mut before) = (second, leaving);
        for (i, corner) in corners.iter().enumerate().skip(1) {
            let there = if i + 1 < corners.len() { ray(cpu, spoke(cpu, corners[i + 1].v, x, y)) } else { first };
            let after = edge::<L, GRADIENT>(cpu, corner, &here, &there, &found, (left * left).lt(quarter));
            left = left - one;
            add::<L, GRADIENT>(cpu, corner, &here, before, after, scale, found.base, &mut sums);
            (here, before) = (there, after);
        }
        add::<L, GRADIENT>(cpu, &corners[0], &first, before, leaving, scale, found.base, &mut sums);
    }
    let inverse = one / sums.weight;
    let mean = [sums.moved[0] * inverse, sums.moved[1] * inverse];
    let mut change = sums.moved_gradient;
    for row in 0..2 {
        for axis in 0..2 {
            change[row][axis] = (change[row][axis] - mean[row] * sums.weight_gradient[axis]) * inverse;
        }
    }
    Found { moved: [found.base[0] + mean[0], found.base[1] + mean[1]], change, square: found.square }
}

#[inline(always)]
fn edge<L: Lane, const GRADIENT: bool>(
    cpu: L::Cpu,
    corner: &Corner<L::E>,
    a: &Ray<L>,
    b: &Ray<L>,
    found: &Scan<L>,
    widest: L::Mask,
) -> Half<L> {
    let (zero, one) = (L::num(cpu, 0.0), L::num(cpu, 1.0));
    let area = area(L::splat(cpu, corner.edge[0]), L::splat(cpu, corner.edge[1]), a.spoke, b.spoke);
    let (d, rr) = (dot(a.spoke, b.spoke), a.r * b.r);
    let obtuse = d.lt(zero);
    let sum = rr + d.abs();
    let t = L::select(obtuse, sum, area) / L::select(obtuse, area, sum);
    let scaled = found.tau * t;
    let (mut gx, mut gy) = (zero, zero);
    if GRADIENT {
        let factor = L::num(cpu, 0.5) * scaled.mul_add(t, found.tau);
        gx = L::select(widest, zero, factor.mul_add(b.y - a.y, t * found.slope[0]));
        gy = L::select(widest, zero, factor.mul_add(a.x - b.x, t * found.slope[1]));
    }
    Half { t: L::select(widest, one, scaled), x: gx, y: gy }
}

#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "one line of the loop, inlined twice")]
fn add<L: Lane, const GRADIENT: bool>(
    cpu: L::Cpu,
    corner: &Corner<L::E>,
    at: &Ray<L>,
    before: Half<L>,
    after: Half<L>,
    scale: L,
    base: [L; 2],
    sums: &mut Sums<L>,
) {
    let c = scale * at.inverse;
    let w = c * (before.t + after.t);
    let u = [L::splat(cpu, corner.u[0]) - base[0], L::splat(cpu, corner.u[1]) - base[1]];
    sums.weight = sums.weight + w;
    for row in 0..2 {
        sums.moved[row] = w.mul_add(u[row], sums.moved[row]);
    }
    if GRADIENT {
        let g = [c.mul_add(before.x + after.x, w * at.x), c.mul_add(before.y + after.y, w * at.y)];
        for axis in 0..2 {
            sums.weight_gradient[axis] = sums.weight_gradient[axis] + g[axis];
            for row in 0..2 {
                sums.moved_gradient[row][axis] = u[row].mul_add(g[axis], sums.moved_gradient[row][axis]);
            }
        }
    }
}
