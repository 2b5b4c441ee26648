//! Inverse problem and average in one pass over the anchors: the reference of the kernel `average_anchors`.

use super::AnchorTable;
use super::solve::{Moments, Multipliers, Offset};
use crate::engine::Real;

/// The result of [`average_fused`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Average<S, const D: usize> {
    /// sum w_i image_i.
    pub mean: [S; D],
    /// The anchor with the smallest D (the lowest index of equal ones): a decision, comparable between back ends.
    pub nearest: u32,
    /// Whether the anchors span the plane: the other decision (see [`super::weights`]).
    pub regular: bool,
    /// w_j = q_j (p_j . mu + base) for j other than `nearest`: the multipliers.
    pub mu: [S; 2],
    /// See `mu`.
    pub base: S,
}

/// Smallest D, in units of the scale, of an anchor that is not the nearest: below, q = (scale / D)^2 would
/// overflow f32. An anchor this near to the query point (1e-6 of the scale's length) has a nearer one beside it.
const FLOOR: f64 = 1e-12;

/// Averages `table.image` at `y` with the weights of eq. 13, in one pass with nothing stored per anchor.
///
/// As [`super::weights`], except that neither the nearest anchor nor the second D is known during the pass: the best
/// candidate so far is held back, the loser of each comparison is pushed into the sums, with q = (scale / D)^2 and p
/// in place of K, and the sums are shifted by p_k at the end. Three more sums of D-vectors,
///
/// Z0 = sum q Y_j,   Zx = sum q p_x Y_j,   Zy = sum q p_y Y_j,
///
/// then give sum w_j Y_j = mu_x Zx + mu_y Zy + (t - mu . p_k) Z0 without any weight.
///
/// `scale` is a squared length of the order of D near an anchor; 16 times the squared mean edge length serves. It cancels in exact arithmetic and only
/// keeps the sums in range. The shift costs digits only where two anchors nearly coincide, much closer to each other than to the query point;
/// within a few thousandths (f32) of the distance to the other anchors, their neighbourhood is then mapped to one point. Exact on anchors (the mean is then `image[k]`, bit for bit). Time O(n D).
/// An empty table gives zeros.
pub fn average_fused<S: Real, const D: usize>(
    y: &[S; D],
    basis: &[[S; D]; 2],
    table: &AnchorTable<S, D>,
    scale: S,
) -> Average<S, D> {
    let zero = [S::ZERO; D];
    let mut best = Offset { d: S::HUGE, p: [S::ZERO; 2] };
    let mut nearest = 0;
    let mut moments = Moments::default();
    let (mut z0, mut zx, mut zy) = (zero, zero, zero);

    for (i, (anchor, image)) in table.own.iter().zip(&table.image).enumerate() {
        let offset = Offset::new(y, basis, anchor);
        let mut loser = offset;
        let mut value = image;
        if offset.d < best.d {
            (loser, value) = (best, &table.image[nearest]);
            (best, nearest) = (offset, i);
        }
        // The first comparison has no loser: HUGE stands in for it.
        let q = if loser.d < S::HUGE { weight_factor(loser.d, scale) } else { S::ZERO };
        moments.push(q, loser.p);
        let (qx, qy) = (q * loser.p[0], q * loser.p[1]);
        for k in 0..D {
            z0[k] += q * value[k];
            zx[k] += qx * value[k];
            zy[k] += qy * value[k];
        }
    }

    let a = (best.d / scale) * (best.d / scale);
    // What the shift takes away is among what the shifted moments are made of.
    let size = moments.size() + moments.s0 * (best.p[0] * best.p[0] + best.p[1] * best.p[1]);
    let Multipliers { mu, t, regular } = Multipliers::solve(&moments.shifted(best.p), size, a, best.p);
    let base = t - mu[0] * best.p[0] - mu[1] * best.p[1];
    let sum = mu[0] * moments.s1[0] + mu[1] * moments.s1[1] + base * moments.s0;
    let mut mean = zero;
    if let Some(image) = table.image.get(nearest) {
        for k in 0..D {
            mean[k] = (S::ONE - sum) * image[k] + (mu[0] * zx[k] + mu[1] * zy[k] + base * z0[k]);
        }
    }
    Average { mean, nearest: nearest as u32, regular, mu, base }
}

/// The weights that `average` was made with, by a second pass: for display, and for the sum of the negative ones.
///
/// Arguments as in [`average_fused`]; `out` is as long as the table.
pub fn fused_weights<S: Real, const D: usize>(
    y: &[S; D],
    basis: &[[S; D]; 2],
    table: &AnchorTable<S, D>,
    scale: S,
    average: &Average<S, D>,
    out: &mut [S],
) {
    let nearest = average.nearest as usize;
    let mut sum = S::ZERO;
    for (j, (anchor, w)) in table.own.iter().zip(out.iter_mut()).enumerate() {
        if j != nearest {
            let Offset { d, p } = Offset::new(y, basis, anchor);
            *w = weight_factor(d, scale) * (p[0] * average.mu[0] + p[1] * average.mu[1] + average.base);
            sum += *w;
        }
    }
    if let Some(w) = out.get_mut(nearest) {
        *w = S::ONE - sum;
    }
}

#[inline(always)]
fn weight_factor<S: Real>(d: S, scale: S) -> S {
    let ratio = scale / d.maximum(scale * S::of(FLOOR));
    ratio * ratio
}
