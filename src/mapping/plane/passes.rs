//! The passes over a polygon that sweeps make, for one group of points. The form is that of
//! [`super::mean_value`]; every lane has its own widest edge, kept as area, scalar product and
//! number.

use super::mean_value::BLOCK;
use super::sweep::SweepStep;
use crate::engine::lane::MAX_LANES;
use crate::engine::{Lane, Real};

/// Stands in for an area that is zero, so that a weight it divides is a number yet.
const ON_EDGE: f64 = 1e-18;

/// A vertex as a sweep reads it: position, displacement, and the edge to the next vertex of its
/// loop.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corner<E> {
    pub(super) v: [E; 2],
    pub(super) u: [E; 2],
    pub(super) edge: [E; 2],
}

/// What one pass over the polygon gives for a group of points.
pub(super) struct Found<L> {
    /// Image minus point.
    pub(super) moved: [L; 2],
    /// Derivative minus identity.
    pub(super) change: [[L; 2]; 2],
    /// Squared distance to the nearest vertex.
    pub(super) square: L,
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
#[derive(Clone, Copy)]
struct Sums<L> {
    weight: L,
    moment: [L; 2],
    moved: [L; 2],
    weight_gradient: [L; 2],
    moved_gradient: [[L; 2]; 2],
}

impl<L: Lane> Sums<L> {
    #[inline(always)]
    fn none(cpu: L::Cpu) -> Self {
        let (zero, pair) = (L::num(cpu, 0.0), [L::num(cpu, 0.0); 2]);
        Self { weight: zero, moment: pair, moved: pair, weight_gradient: pair, moved_gradient: [pair; 2] }
    }

    #[inline(always)]
    fn join(&mut self, other: &Self) {
        self.weight = self.weight + other.weight;
        for axis in 0..2 {
            self.moment[axis] = self.moment[axis] + other.moment[axis];
            self.moved[axis] = self.moved[axis] + other.moved[axis];
            self.weight_gradient[axis] = self.weight_gradient[axis] + other.weight_gradient[axis];
            for row in 0..2 {
                self.moved_gradient[row][axis] = self.moved_gradient[row][axis] + other.moved_gradient[row][axis];
            }
        }
    }
}

#[inline(always)]
pub(super) fn around<L: Lane>(cpu: L::Cpu, step: &SweepStep<'_, L::E>, x: L, y: L) -> Found<L> {
    let (one, quarter) = (L::num(cpu, 1.0), L::num(cpu, 0.25));
    let found = scan(cpu, step, x, y);
    let scale = found.square.sqrt();
    // Edges until the widest: zero there.
    let mut left = found.widest;
    let mut sums = Sums::none(cpu);
    for ring in &step.step.outline.loops {
        let corners = &step.corners[ring.clone()];
        let first = ray(cpu, spoke(cpu, corners[0].v, x, y));
        let second = ray(cpu, spoke(cpu, corners[1].v, x, y));
        let leaving = edge::<L>(cpu, &corners[0], &first, &second, &found, (left * left).lt(quarter));
        left = left - one;
        let (mut here, mut before) = (second, leaving);
        for start in (1..corners.len()).step_by(BLOCK) {
            let mut block = Sums::none(cpu);
            for i in start..corners.len().min(start + BLOCK) {
                let there = if i + 1 < corners.len() { ray(cpu, spoke(cpu, corners[i + 1].v, x, y)) } else { first };
                let after = edge::<L>(cpu, &corners[i], &here, &there, &found, (left * left).lt(quarter));
                left = left - one;
                add::<L>(cpu, &corners[i], &here, before, after, scale, found.base, &mut block);
                (here, before) = (there, after);
            }
            sums.join(&block);
        }
        add::<L>(cpu, &corners[0], &first, before, leaving, scale, found.base, &mut sums);
    }
    let inverse = inverse_total(cpu, step, x, y, sums.weight, sums.moment, one);
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
fn edge<L: Lane>(
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
    let factor = L::num(cpu, 0.5) * scaled.mul_add(t, found.tau);
    Half {
        t: L::select(widest, one, scaled),
        x: L::select(widest, zero, factor.mul_add(b.y - a.y, t * found.slope[0])),
        y: L::select(widest, zero, factor.mul_add(a.x - b.x, t * found.slope[1])),
    }
}

#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "one line of the loop, inlined twice")]
fn add<L: Lane>(
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
        sums.moment[row] = w.mul_add(L::splat(cpu, corner.v[row]), sums.moment[row]);
        sums.moved[row] = w.mul_add(u[row], sums.moved[row]);
    }
    let g = [c.mul_add(before.x + after.x, w * at.x), c.mul_add(before.y + after.y, w * at.y)];
    for axis in 0..2 {
        sums.weight_gradient[axis] = sums.weight_gradient[axis] + g[axis];
        for row in 0..2 {
            sums.moved_gradient[row][axis] = u[row].mul_add(g[axis], sums.moved_gradient[row][axis]);
        }
    }
}

/// t of an edge; on the edge itself, where it is infinite, so large that only its two ends count.
#[inline(always)]
fn half_tangent<L: Lane>(cpu: L::Cpu, corner: &Corner<L::E>, a: &Leg<L>, b: &Leg<L>) -> L {
    let area = area(L::splat(cpu, corner.edge[0]), L::splat(cpu, corner.edge[1]), a.spoke, b.spoke);
    let (d, rr) = (dot(a.spoke, b.spoke), a.r * b.r);
    let obtuse = d.lt(L::num(cpu, 0.0));
    let sum = rr + d.abs();
    let floor = L::num(cpu, ON_EDGE);
    let below = L::select(area.abs().lt(floor), floor, area);
    L::select(obtuse, sum, area) / L::select(obtuse, below, sum)
}

/// Image minus point alone, and the squared distance to the nearest vertex. Without derivatives
/// nothing has to be scaled, for coordinates are ratios of the weights.
#[inline(always)]
pub(super) fn moved<L: Lane>(cpu: L::Cpu, step: &SweepStep<'_, L::E>, x: L, y: L) -> ([L; 2], L) {
    let (zero, one) = (L::num(cpu, 0.0), L::num(cpu, 1.0));
    // Displacements relative to that of the nearest vertex, as the other form has them.
    let (mut nearest, mut base) = (L::splat(cpu, L::E::HUGE), [zero; 2]);
    for corner in &step.corners {
        let square = spoke(cpu, corner.v, x, y).square;
        let closer = square.lt(nearest);
        nearest = L::select(closer, square, nearest);
        for axis in 0..2 {
            base[axis] = L::select(closer, L::splat(cpu, corner.u[axis]), base[axis]);
        }
    }
    // Weight, moment and displacement.
    let mut sums = [zero; 5];
    let leg = |corner: &Corner<L::E>| {
        let spoke = spoke(cpu, corner.v, x, y);
        Leg { spoke, r: spoke.square.sqrt() }
    };
    for ring in &step.step.outline.loops {
        let corners = &step.corners[ring.clone()];
        let last = &corners[corners.len() - 1];
        let first = leg(&corners[0]);
        let mut here = first;
        let mut before = half_tangent(cpu, last, &leg(last), &first);
        for start in (0..corners.len()).step_by(BLOCK) {
            let mut block = [zero; 5];
            for i in start..corners.len().min(start + BLOCK) {
                let corner = &corners[i];
                let there = if i + 1 < corners.len() { leg(&corners[i + 1]) } else { first };
                let after = half_tangent(cpu, corner, &here, &there);
                let w = (before + after) / here.r;
                block[0] = block[0] + w;
                for axis in 0..2 {
                    block[1 + axis] = w.mul_add(L::splat(cpu, corner.v[axis]), block[1 + axis]);
                    block[3 + axis] = w.mul_add(L::splat(cpu, corner.u[axis]) - base[axis], block[3 + axis]);
                }
                (here, before) = (there, after);
            }
            for k in 0..5 {
                sums[k] = sums[k] + block[k];
            }
        }
    }
    let inverse = inverse_total(cpu, step, x, y, sums[0], [sums[1], sums[2]], one);
    ([base[0] + sums[3] * inverse, base[1] + sums[4] * inverse], nearest)
}

/// One end of an edge in that pass.
#[derive(Clone, Copy)]
struct Leg<L> {
    spoke: Spoke<L>,
    r: L,
}

/// 1 / W; far away from the moment, as the reference does.
#[inline(always)]
fn inverse_total<L: Lane>(cpu: L::Cpu, step: &SweepStep<'_, L::E>, x: L, y: L, weight: L, moment: [L; 2], one: L) -> L {
    let square = x.mul_add(x, y * y);
    let far = L::splat(cpu, step.step.outline.far).lt(square);
    let along = moment[0].mul_add(x, moment[1] * y);
    L::select(far, square, one) / L::select(far, along, weight)
}
