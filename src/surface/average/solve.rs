//! The 2x2 system that is left of eq. 13 once the nearest anchor is eliminated.

use super::{GAMMA, dot};
use crate::engine::Real;

/// Where an anchor is, seen from the query point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Offset<S> {
    /// The penalty D_i = |v_T|^2 + gamma |v_O|^2, a squared length.
    pub d: S,
    /// The anchor in the orthonormal basis of the plane, query point at the origin.
    pub p: [S; 2],
}

impl<S: Real> Offset<S> {
    #[inline(always)]
    pub(super) fn new<const D: usize>(y: &[S; D], basis: &[[S; D]; 2], anchor: &[S; D]) -> Self {
        let mut v = *anchor;
        for k in 0..D {
            v[k] -= y[k];
        }
        let p = [dot(&basis[0], &v), dot(&basis[1], &v)];
        let within = p[0] * p[0] + p[1] * p[1];
        // Rounding may leave an anchor within the plane with a negative rest.
        let across = (dot(&v, &v) - within).maximum(S::ZERO);
        Self { d: within + S::of(GAMMA) * across, p }
    }
}

/// Sums over the anchors other than the nearest, k, of q = (scale / D_j)^2 times powers of some
/// vector per anchor.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Moments<S> {
    /// Sum of q.
    pub s0: S,
    /// Sum of q K.
    pub s1: [S; 2],
    /// Sum of q K K^T: xx, xy, yy.
    pub s2: [S; 3],
}

impl<S: Real> Moments<S> {
    #[inline(always)]
    pub(super) fn push(&mut self, q: S, k: [S; 2]) {
        let (qx, qy) = (q * k[0], q * k[1]);
        self.s0 += q;
        self.s1[0] += qx;
        self.s1[1] += qy;
        self.s2[0] += qx * k[0];
        self.s2[1] += qx * k[1];
        self.s2[2] += qy * k[1];
    }

    /// Size of the terms that S2 was added up from, relative to which it carries rounding errors.
    #[inline(always)]
    pub(super) fn size(&self) -> S {
        self.s2[0] + self.s2[2]
    }

    /// The moments of p - origin from those of p.
    #[inline(always)]
    pub(super) fn shifted(&self, origin: [S; 2]) -> Self {
        let ([x, y], [sx, sy]) = (origin, self.s1);
        let s1 = [sx - x * self.s0, sy - y * self.s0];
        Self {
            s0: self.s0,
            s1,
            s2: [self.s2[0] - x * sx - x * s1[0], self.s2[1] - y * sx - x * s1[1], self.s2[2] - y * sy - y * s1[1]],
        }
    }
}

/// What turns an anchor's offset into its weight: w_j = q_j (K_j . mu + t), K_j = p_j - p_k.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Multipliers<S> {
    /// Multiplier of the constraint in the plane, an inverse length.
    pub mu: [S; 2],
    /// Multiplier of the sum of the weights.
    pub t: S,
    /// Whether the anchors span the plane; if not, the constraint holds in the least-squares sense.
    pub regular: bool,
}

impl<S: Real> Multipliers<S> {
    /// Solves eq. 13 with the nearest anchor eliminated: minimise sum w_j^2 / q_j + a (1 - sum
    /// w_j)^2 subject to sum w_j K_j = -p_k. With rho = a / (1 + a S0) (Sherman-Morrison on the
    /// last term),
    ///
    /// (S2 - rho S1 S1^T) mu = -p_k - rho S1,   t = rho (1 - S1 . mu).
    ///
    /// `moments` are those of K, `size` what they were added up from ([`Moments::size`], before any
    /// shift); `a` = (D_k / scale)^2 with the scale of q; `p` = p_k.
    ///
    /// The matrix is divided by its trace: its determinant is then about the ratio of its
    /// eigenvalues, whatever the scale, and a matrix of rank one is its own pseudo-inverse. That is
    /// what is used where the smaller eigenvalue is within [`rank_limit`] of zero (collinear
    /// anchors, fewer than three, or none that matter apart from a few at one place).
    #[inline(always)]
    pub(super) fn solve(moments: &Moments<S>, size: S, a: S, p: [S; 2]) -> Self {
        let Moments { s0, s1, s2 } = *moments;
        let rho = a / (S::ONE + a * s0);
        // rho S1 is at most |K|: multiplied in this order nothing overflows.
        let rs = [rho * s1[0], rho * s1[1]];
        let rhs = [-p[0] - rs[0], -p[1] - rs[1]];
        let m = [s2[0] - rs[0] * s1[0], s2[1] - rs[0] * s1[1], s2[2] - rs[1] * s1[1]];
        let trace = m[0] + m[2];
        let noise = rank_limit::<S>() * size.maximum(trace);
        let some = trace > noise.maximum(S::ONE / S::HUGE);
        if !some {
            return Self { mu: [S::ZERO; 2], t: rho, regular: false };
        }
        let scale = S::ONE / trace;
        let [xx, xy, yy] = [m[0] * scale, m[1] * scale, m[2] * scale];
        let determinant = xx * yy - xy * xy;
        let regular = determinant > noise * scale;
        let mu = if regular {
            let f = scale / determinant;
            [(yy * rhs[0] - xy * rhs[1]) * f, (xx * rhs[1] - xy * rhs[0]) * f]
        } else {
            [(xx * rhs[0] + xy * rhs[1]) * scale, (xy * rhs[0] + yy * rhs[1]) * scale]
        };
        Self { mu, t: rho * (S::ONE - s1[0] * mu[0] - s1[1] * mu[1]), regular }
    }
}

/// Eigenvalue that rounding alone may leave in place of zero, relative to the sums the matrix was
/// made from: each of n <= 1000 terms carries a few half-epsilons, errors adding up like the square
/// root of n.
#[inline(always)]
pub(super) fn rank_limit<S: Real>() -> S {
    S::of(32.0) * S::EPSILON
}
