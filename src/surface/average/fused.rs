//! Inverse problem and average with nothing stored per anchor: the reference of the kernel
//! `average_anchors`.

use super::solve::{Moments, Multipliers, Offset};
use crate::engine::Real;

/// Smallest D, in units of the scale, of an anchor that is not the nearest: below, q = (scale /
/// D)^2 would overflow f32. An anchor this near to the query point (1e-6 of the scale's length) has
/// a nearer one beside it.
pub(super) const FLOOR: f64 = 1e-12;

/// The weights of eq. 13 at a point, in closed form: w_j = q_j (K_j . mu + t) with q_j = (scale /
/// D_j)^2 and K_j = p_j - p_k, and for the nearest anchor k what is left of 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FusedWeights<'a, S, const D: usize> {
    y: &'a [S; D],
    basis: &'a [[S; D]; 2],
    own: &'a [[S; D]],
    scale: S,
    /// The anchor with the smallest D (the lowest index of equal ones): a decision, comparable
    /// between back ends.
    pub nearest: u32,
    /// Whether the anchors span the plane: the other decision (see `super::weights`).
    pub regular: bool,
    /// The weight of the nearest anchor.
    rest: S,
    p: [S; 2],
    mu: [S; 2],
    t: S,
}

impl<'a, S: Real, const D: usize> FusedWeights<'a, S, D> {
    /// Solves the inverse problem at `y` in one pass over the anchors `own`.
    ///
    /// As [`super::weights`], except that neither the nearest anchor nor the second D is known
    /// during the pass: the best candidate so far is held back and is the origin of K. The loser of
    /// each comparison is pushed into the sums, with q = (scale / D)^2, and where the newcomer
    /// wins, the sums are first shifted to it. No shift ends near an anchor that was pushed before
    /// with a much larger K: that anchor would have been the candidate. So also where anchors
    /// nearly coincide, nothing is lost that matters.
    ///
    /// `scale` is a squared length of the order of D near an anchor; 16 times the squared mean edge
    /// length serves. It cancels in exact arithmetic and only keeps the sums in range. On an anchor
    /// its weight is exactly 1 and all others are 0. Time O(n D).
    pub fn solve(y: &'a [S; D], basis: &'a [[S; D]; 2], own: &'a [[S; D]], scale: S) -> Self {
        let mut best = Offset { d: S::HUGE, p: [S::ZERO; 2] };
        let mut nearest = 0;
        let mut moments = Moments::default();
        // What a shift takes away is among what the sums are made of.
        let mut shifted = S::ZERO;
        for (anchor, i) in own.iter().zip(0..) {
            let mut loser = Offset::new(y, basis, anchor);
            if loser.d < best.d {
                let by = [loser.p[0] - best.p[0], loser.p[1] - best.p[1]];
                moments = moments.shifted(by);
                shifted += moments.s0 * (by[0] * by[0] + by[1] * by[1]);
                std::mem::swap(&mut loser, &mut best);
                nearest = i;
            }
            // The first comparison has no loser: HUGE stands in for it.
            let q = if loser.d < S::HUGE { weight_factor(loser.d, scale) } else { S::ZERO };
            moments.push(q, [loser.p[0] - best.p[0], loser.p[1] - best.p[1]]);
        }
        let a = (best.d / scale) * (best.d / scale);
        let Multipliers { mu, t, regular } = Multipliers::solve(&moments, moments.size() + shifted, a, best.p);
        let rest = S::ONE - (mu[0] * moments.s1[0] + mu[1] * moments.s1[1] + t * moments.s0);
        Self { y, basis, own, scale, nearest, regular, rest, p: best.p, mu, t }
    }

    /// The weight of anchor `j`, which must exist.
    #[inline(always)]
    pub fn of(&self, j: usize) -> S {
        if j == self.nearest as usize {
            return self.rest;
        }
        let Offset { d, p } = Offset::new(self.y, self.basis, &self.own[j]);
        weight_factor(d, self.scale) * ((p[0] - self.p[0]) * self.mu[0] + (p[1] - self.p[1]) * self.mu[1] + self.t)
    }

    /// sum w_j image_j, in a second pass that computes each weight anew; `image` is as long as the
    /// list of anchors. Sums of q image and q K image in the first pass would save it, but they are
    /// larger than what is left of them: in single precision their average has four times the
    /// error. On an anchor this is `image[k]`, bit for bit. No anchors give zeros. Time O(n D).
    pub fn average(&self, image: &[[S; D]]) -> [S; D] {
        let mut mean = [S::ZERO; D];
        for (j, image) in image.iter().enumerate() {
            let w = self.of(j);
            for k in 0..D {
                mean[k] += w * image[k];
            }
        }
        mean
    }
}

#[inline(always)]
fn weight_factor<S: Real>(d: S, scale: S) -> S {
    let ratio = scale / d.maximum(scale * S::of(FLOOR));
    ratio * ratio
}
