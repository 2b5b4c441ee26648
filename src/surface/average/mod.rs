//! The inverse problem fused with the weighted average (Panozzo et al. 2013, sections 3.1 and 3.4).
//!
//! For a point y of a surface embedded in R^D and anchors y_i on it, the inverse problem (eq. 13)
//! asks for the weights w that minimise sum (D_i w_i)^2 subject to Psi (y - sum w_i y_i) = 0 and
//! sum w_i = 1, with D_i = |v_T|^2 + [`GAMMA`] |v_O|^2, v_T and v_O being the parts of y_i - y in
//! and across the plane that the two rows of Psi span. The weights are then used once: to average
//! other D-vectors, one per anchor (the corresponding anchors of another surface, or the
//! displacements between two surfaces).
//!
//! The system as printed loses all digits near an anchor. Here the nearest anchor k is eliminated
//! instead: with w_k = 1 - sum w_j the unknowns are the other weights, the constraint becomes sum
//! w_j (p_j - p_k) = -p_k (p = Psi (y_i - y), Psi orthonormalised), and a 2x2 symmetric system is
//! left that is well conditioned on the anchor itself, where the answer is exactly e_k (see
//! `weights`).
//!
//! | function | what it is |
//! |---|---|
//! | `weights` | the weights themselves, three short passes; `f64` is the truth |
//! | [`FusedWeights`] | two passes, nothing stored per anchor: what the kernel `average_anchors` does |
//! | [`average_tiles`] | three passes on SIMD lanes over tiles of points: the fast path of the CPU back end |
//! | [`AveragedChunk`] | surface points in, averages out: [`frame_tiles`], then [`average_tiles`] |
//!
//! All lengths are in the units of the embedding. Nothing here depends on its scale, apart from the
//! range of the number type: with `f32`, keep coordinates within 1e-3..1e3 and centred.

mod chunk;
/// The constants of the shaders that are these of Rust.
#[cfg(test)]
pub(crate) fn twins() -> Vec<crate::twins::Twin> {
    crate::twins::of(
        "average_anchors",
        [("FLOOR", fused::FLOOR), ("GAMMA", GAMMA), ("RANK_LIMIT", solve::rank_limit::<f32>().into())],
    )
}

#[cfg(test)]
mod chunk_tests;
mod frames;
mod fused;
mod solve;
mod sweep;
#[cfg(test)]
mod sweep_tests;
#[cfg(test)]
mod tests;
mod weights;

use crate::engine::Real;
use crate::error::{Error, Result};

pub use chunk::AveragedChunk;
pub use frames::frame_tiles;
pub use fused::FusedWeights;
pub use sweep::{SweepAnchors, average_tiles, point_of};
pub use weights::weights;

/// How much more an offset across the tangent plane counts than one within it (section 3.4; the
/// paper uses 10 for all of its examples).
pub const GAMMA: f64 = 10.0;

/// Anchors of the surface on which the inverse problem is solved, and what is averaged with their
/// weights.
#[derive(Clone, Debug, PartialEq)]
pub struct AnchorTable<S, const D: usize> {
    /// The anchors in the embedding of the surface that the query points lie on.
    pub own: Vec<[S; D]>,
    /// One D-vector per anchor: what is averaged. Centred values keep more digits in single
    /// precision.
    pub image: Vec<[S; D]>,
}

impl<S: Real, const D: usize> AnchorTable<S, D> {
    /// Pairs anchors with what is averaged.
    ///
    /// # Errors
    /// [`Error::Input`] if there is no anchor, if the lists differ in length, or if a coordinate is
    /// not finite.
    pub fn new(own: Vec<[S; D]>, image: Vec<[S; D]>) -> Result<Self> {
        if own.is_empty() {
            return Err(Error::input("there are no anchors", "Give at least one pair of anchors, better ten or more"));
        }
        if own.len() != image.len() {
            return Err(Error::input(
                format!("{} anchors are paired with {}", own.len(), image.len()),
                "Give the same number of anchors on both sides",
            ));
        }
        let bad = |list: &[[S; D]]| list.iter().position(|v| !v.iter().all(|x| x.finite()));
        if let Some(i) = bad(&own).or_else(|| bad(&image)) {
            return Err(Error::input(
                format!("anchor {i} has no finite position in the embedding"),
                "Put it on a part of the mesh that is embedded",
            ));
        }
        Ok(Self { own, image })
    }

    /// Number of anchors; never 0 if made by [`AnchorTable::new`].
    pub fn len(&self) -> usize {
        self.own.len()
    }

    /// Whether there is no anchor.
    pub fn is_empty(&self) -> bool {
        self.own.is_empty()
    }

    /// The same anchors in another precision.
    pub fn cast<T: Real>(&self) -> AnchorTable<T, D> {
        let all = |list: &[[S; D]]| list.iter().map(|v| v.map(|x| T::of(x.to_f64()))).collect();
        AnchorTable { own: all(&self.own), image: all(&self.image) }
    }
}

#[inline(always)]
fn dot<S: Real, const D: usize>(a: &[S; D], b: &[S; D]) -> S {
    let mut sum = S::ZERO;
    for k in 0..D {
        sum += a[k] * b[k];
    }
    sum
}

/// An orthonormal basis of the plane spanned by the two rows of `psi`.
///
/// Gram-Schmidt, the second row cleaned twice so that the result is orthogonal to rounding at any
/// angle. Rows that are parallel (sine below 1e-3, the limit used for tangents) or zero leave the
/// plane undetermined; it is completed by the coordinate axis farthest from the first row, so that
/// the result is always orthonormal and finite for finite input, D >= 2. Weights and averages
/// depend on the plane only, not on this basis of it.
pub fn orthonormalise<S: Real, const D: usize>(psi: [[S; D]; 2]) -> [[S; D]; 2] {
    let [first, second] = psi;
    let b0 = unit(&first).or_else(|| unit(&second)).unwrap_or_else(|| axis(0));
    let b1 = across(&b0, &second).unwrap_or_else(|| {
        let mut flattest = 0;
        for k in 1..D {
            if b0[k].abs() < b0[flattest].abs() {
                flattest = k;
            }
        }
        across(&b0, &axis(flattest)).unwrap_or_else(|| axis(flattest))
    });
    [b0, b1]
}

fn axis<S: Real, const D: usize>(k: usize) -> [S; D] {
    let mut e = [S::ZERO; D];
    e[k] = S::ONE;
    e
}

/// The unit vector along `v`; `None` if `v` is zero or its length is not a normal number.
fn unit<S: Real, const D: usize>(v: &[S; D]) -> Option<[S; D]> {
    let mut largest = S::ZERO;
    for x in v {
        largest = x.abs().maximum(largest);
    }
    if !(largest > S::of(1e-30) && largest.finite()) {
        return None;
    }
    // Divided by the largest entry first: squares of small entries underflow in f32.
    let scaled = v.map(|x| x / largest);
    let inverse = S::ONE / dot(&scaled, &scaled).sqrt();
    Some(scaled.map(|x| x * inverse))
}

/// The unit vector of `v`'s part orthogonal to the unit vector `b0`; `None` if that part is below
/// 1e-3 of `v`.
fn across<S: Real, const D: usize>(b0: &[S; D], v: &[S; D]) -> Option<[S; D]> {
    let v = unit(v)?;
    let reject = |v: &[S; D]| {
        let along = dot(b0, v);
        let mut rest = *v;
        for k in 0..D {
            rest[k] -= along * b0[k];
        }
        rest
    };
    let rest = reject(&v);
    let tilted = dot(&rest, &rest) > S::of(1e-6);
    if !tilted {
        return None;
    }
    unit(&reject(&unit(&rest)?))
}
