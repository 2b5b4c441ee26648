//! Newton's method on the polynomial of a patch, for runs of pixels.

use glam::DVec2;

use super::Patch;
use super::fit::MARGIN;
use crate::engine::lane::MAX_LANES;
use crate::engine::{Lane, Sweep};

/// A correction that is the last: convergence is quadratic, so what is left is below a rounding.
pub(super) const SETTLED: f64 = 2e-5;
/// Corrections before a point is given up. From the linear start three are enough inside a square.
pub(super) const CORRECTIONS: usize = 8;
/// Points are kept this near to the square while they are corrected.
pub(super) const NEAR: f64 = 1.5;

/// A pixel that a patch has found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solved {
    /// The point, from the centre of the square in units of half its side.
    pub at: [f32; 2],
    /// How it moves when the pixel moves one to the right.
    pub dx: [f32; 2],
    /// How it moves when the pixel moves one down.
    pub dy: [f32; 2],
}

/// What the sum of the bends is at a point, and its derivatives: g, dg/du, dg/dv of one component.
///
/// Horner's scheme in u for each power of v, then in v; the order of the coefficients is that of
/// [`super::fit`].
#[inline(always)]
fn bend<L: Lane<E = f32>>(cpu: L::Cpu, c: &[f32; super::fit::BENDS], u: L, v: L) -> [L; 3] {
    let zero = L::splat(cpu, 0.0);
    let num = |k: usize| L::splat(cpu, c[k]);
    // Value and derivative of a row of terms u^0 .. u^n.
    let row = |from: usize, count: usize| {
        let (mut value, mut slope) = (num(from + count - 1), zero);
        for k in (from..from + count - 1).rev() {
            slope = slope.mul_add(u, value);
            value = value.mul_add(u, num(k));
        }
        (value, slope)
    };
    // The rows of v^0 and v^1 begin with u^2 and u^1.
    let (a, b) = row(0, 4);
    let zeroth = (a * u * u, (b * u + a + a) * u);
    let (a, b) = row(4, 4);
    let first = (a * u, b.mul_add(u, a));
    let rows = [zeroth, first, row(8, 4), row(12, 3), row(15, 2), (num(17), zero)];
    let (mut value, mut by_u, mut by_v) = (zero, zero, zero);
    for (a, b) in rows.into_iter().rev() {
        by_v = by_v.mul_add(v, value);
        value = value.mul_add(v, a);
        by_u = by_u.mul_add(v, b);
    }
    [value, by_u, by_v]
}

/// Points of the square with their derivatives I + g', the last corrections, by component.
struct Root<L> {
    at: [L; 2],
    /// dy/du, row by row.
    derivative: [[L; 2]; 2],
    inverse: L,
    correction: L,
}

/// Solves p + g(p) = y.
#[inline(always)]
fn root<L: Lane<E = f32>>(cpu: L::Cpu, patch: &Patch, y: [L; 2]) -> Root<L> {
    let (one, near) = (L::splat(cpu, 1.0), L::num(cpu, NEAR));
    let settled = L::num(cpu, SETTLED);
    let keep = |x: L| x.minimum(near).maximum(-near);
    let mut at = y.map(keep);
    let mut found = Root { at, derivative: [[one; 2]; 2], inverse: one, correction: L::num(cpu, f64::from(f32::MAX)) };
    for _ in 0..CORRECTIONS {
        let g = [bend::<L>(cpu, &patch.bend[0], at[0], at[1]), bend::<L>(cpu, &patch.bend[1], at[0], at[1])];
        let off = [at[0] + g[0][0] - y[0], at[1] + g[1][0] - y[1]];
        let [[a, b], [c, d]] = [[one + g[0][1], g[0][2]], [g[1][1], one + g[1][2]]];
        let inverse = one / a.mul_add(d, -(b * c));
        let by = [d.mul_add(off[0], -(b * off[1])) * inverse, a.mul_add(off[1], -(c * off[0])) * inverse];
        at = [keep(at[0] - by[0]), keep(at[1] - by[1])];
        let correction = by[0].abs().maximum(by[1].abs());
        found = Root { at, derivative: [[a, b], [c, d]], inverse, correction };
        if !L::any(cpu, settled.lt(correction)) {
            break;
        }
    }
    found
}

/// The pixels of one row that lie in a patch.
pub(super) struct Run<'a, F> {
    pub(super) patch: &'a Patch,
    /// The centre of the first pixel, from the image of the centre of the square.
    pub(super) from: [f32; 2],
    pub(super) count: usize,
    /// Takes the number of a pixel, and what was found.
    pub(super) found: F,
}

impl<F: FnMut(usize, Solved)> Sweep<f32> for Run<'_, F> {
    #[inline(always)]
    fn run<L: Lane<E = f32>>(mut self, cpu: L::Cpu) {
        let mut steps = [0.0; MAX_LANES];
        steps.iter_mut().enumerate().for_each(|(k, s)| *s = k as f32);
        let steps = L::load(cpu, &steps);
        let ([[a, b], [c, d]], y) = (self.patch.single(), L::splat(cpu, self.from[1]));
        let [a, b, c, d] = [a, b, c, d].map(|x| L::splat(cpu, x));
        let mut lanes = [[0.0; MAX_LANES]; 8];
        for start in (0..self.count).step_by(L::N) {
            let x = steps + L::splat(cpu, self.from[0] + start as f32);
            let r = root::<L>(cpu, self.patch, [a.mul_add(x, b * y), c.mul_add(x, d * y)]);
            // The derivative of the point by the pixel: the inverse of (I + g') times that of A.
            let [[p, q], [s, t]] = r.derivative;
            let slope = |x: L, y: L| [t.mul_add(x, -(q * y)) * r.inverse, p.mul_add(y, -(s * x)) * r.inverse];
            let (dx, dy) = (slope(a, c), slope(b, d));
            let outside = r.at[0].abs().maximum(r.at[1].abs());
            for (out, of) in lanes.iter_mut().zip([r.at[0], r.at[1], dx[0], dx[1], dy[0], dy[1], outside, r.correction])
            {
                of.store(out);
            }
            for k in 0..L::N.min(self.count - start) {
                if lanes[6][k] <= 1.0 + MARGIN as f32 && lanes[7][k] <= SETTLED as f32 {
                    let pair = |i: usize| [lanes[i][k], lanes[i + 1][k]];
                    (self.found)(start + k, Solved { at: pair(0), dx: pair(2), dy: pair(4) });
                }
            }
        }
    }
}

impl Patch {
    /// The inverse of the linear part, row by row.
    #[inline(always)]
    pub(super) fn single(&self) -> [[f32; 2]; 2] {
        let (x, y) = (self.inverse.x_axis.as_vec2(), self.inverse.y_axis.as_vec2());
        [[x.x, y.x], [x.y, y.y]]
    }

    /// The pre-image of one point, if it lies in the square.
    pub fn solve(&self, q: DVec2) -> Option<DVec2> {
        let mut at = None;
        let from = (q - self.image).as_vec2().to_array();
        Run { patch: self, from, count: 1, found: |_, s: Solved| at = Some(s.at) }.run::<f32>(());
        at.map(|at| self.point(at))
    }

    /// The point of the source at a place in the square.
    pub fn point(&self, at: [f32; 2]) -> DVec2 {
        self.centre + self.half * DVec2::from(at.map(f64::from))
    }

    /// The columns between which pixels of the row at `y` can lie in the square, whatever the bend;
    /// centres are at halves.
    pub(super) fn columns(&self, y: f64) -> Option<[f64; 2]> {
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        for k in 0..2 {
            let (slope, at) = (self.inverse.x_axis[k], self.inverse.y_axis[k] * (y - self.image.y));
            let reach = 1.0 + MARGIN + self.reach[k];
            if slope == 0.0 {
                if at.abs() > reach {
                    return None;
                }
                continue;
            }
            let (a, b) = ((-reach - at) / slope, (reach - at) / slope);
            (low, high) = (low.max(a.min(b)), high.min(a.max(b)));
        }
        (low <= high).then_some([self.image.x + low, self.image.x + high])
    }

    /// The rows between which its pixels can lie.
    pub(super) fn rows(&self) -> [f64; 2] {
        // |y_k| <= reach_k maps back to a parallelogram, whose corners are the sums of A's columns.
        let forward = self.inverse.inverse();
        let reach = DVec2::splat(1.0 + MARGIN) + self.reach;
        let height = (forward.x_axis.y * reach.x).abs() + (forward.y_axis.y * reach.y).abs();
        [self.image.y - height, self.image.y + height]
    }
}
