//! The weights of the inverse problem.

use super::solve::{Moments, Multipliers, Offset};
use crate::engine::Real;

/// Solves the inverse problem at `y`: the weights of eq. 13 of Panozzo et al. 2013 into `out`.
///
/// `basis` spans the plane of Psi at `y` and is orthonormal ([`super::orthonormalise`]); `own` are
/// the anchors, in the same embedding as `y`; `out` is as long as `own`. Returns whether the
/// anchors span the plane; where they do not (fewer than three, collinear), the constraint in the
/// plane holds in the least-squares sense.
///
/// With k the nearest anchor by D (the lowest index of equal ones), m the second smallest D, q_j =
/// (m / D_j)^2 in (0, 1], a = (D_k / m)^2 in [0, 1] and K_j = p_j - p_k, the multipliers solve a
/// 2x2 system built from sums of q, q K and q K K^T over j != k, and
///
/// w_j = q_j (K_j . mu + t),   w_k = 1 - sum w_j.
///
/// The weights sum to one by construction. On an anchor a = 0 and p_k = 0, hence w = e_k exactly,
/// with no special case. Several anchors at one place share their weight in a way that is finite
/// and sums to one, but is not unique. No anchors: nothing is written.
///
/// Time O(n D), no allocation; each offset is computed three times rather than stored.
pub fn weights<S: Real, const D: usize>(y: &[S; D], basis: &[[S; D]; 2], own: &[[S; D]], out: &mut [S]) -> bool {
    debug_assert_eq!(own.len(), out.len());
    let mut nearest = 0;
    let mut best = Offset { d: S::HUGE, p: [S::ZERO; 2] };
    let mut second = S::HUGE;
    for (i, anchor) in own.iter().enumerate() {
        let offset = Offset::new(y, basis, anchor);
        if offset.d < best.d {
            second = best.d;
            (best, nearest) = (offset, i);
        } else {
            second = offset.d.minimum(second);
        }
    }
    // Two anchors at y: every q is then 0 or 1, and a = 0 decides.
    let m = second.maximum(S::ONE / S::HUGE);
    let a = (best.d / m) * (best.d / m);
    let others = || own.iter().enumerate().filter(|(j, _)| *j != nearest);
    let weighted = |anchor: &[S; D]| {
        let offset = Offset::new(y, basis, anchor);
        let ratio = m / offset.d.maximum(m);
        (ratio * ratio, [offset.p[0] - best.p[0], offset.p[1] - best.p[1]])
    };

    let mut moments = Moments::default();
    for (_, anchor) in others() {
        let (q, k) = weighted(anchor);
        moments.push(q, k);
    }
    let Multipliers { mu, t, regular } = Multipliers::solve(&moments, moments.size(), a, best.p);
    let mut sum = S::ZERO;
    for (j, anchor) in others() {
        let (q, k) = weighted(anchor);
        out[j] = q * (k[0] * mu[0] + k[1] * mu[1] + t);
        sum += out[j];
    }
    if let Some(w) = out.get_mut(nearest) {
        *w = S::ONE - sum;
    }
    regular
}
