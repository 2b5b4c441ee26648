//! F of rings (equation 13), of a level of vertex splits, and the residual V - F of all rings.

use rayon::prelude::*;

use super::vector::{add, add_scaled, cross, dot, scale, sub, zero};
use super::{Encoding, Stencils, V3};
use crate::engine::Real;

/// Part of a ring's rms radius that is added (in squares) to the distances under the offsets; see
/// [`Encoding`].
pub const REGULARISATION: f64 = 1e-3;
/// Rows that one task takes.
pub(crate) const BLOCK: usize = 2048;

/// What all terms of F share, in coordinates relative to the ring's first vertex.
pub(crate) struct Frame<R> {
    /// Unit normal (zero where the ring has no area).
    pub(crate) normal: V3<R>,
    /// One over the length of the vector area.
    pub(crate) inverse_length: R,
    /// Weighted mean of the ring.
    pub(crate) centre: V3<R>,
    /// Plain mean of the ring.
    pub(crate) mean: V3<R>,
    /// tau² rho².
    pub(crate) regular: R,
}

impl<R: Real> Frame<R> {
    #[inline(always)]
    pub(crate) fn new(positions: &[V3<R>], ring: &[u32], w: &[R]) -> Self {
        let origin = positions[ring[0] as usize];
        let m = ring.len();
        let (mut c, mut centre, mut mean) = (zero(), zero(), zero());
        let mut square = R::ZERO;
        let mut before = sub(positions[ring[m - 1] as usize], origin);
        for k in 0..m {
            let p = sub(positions[ring[k] as usize], origin);
            c = add(c, cross(p, before));
            centre = add_scaled(centre, p, w[k]);
            mean = add(mean, p);
            square += dot(p, p);
            before = p;
        }
        let inverse = R::ONE / R::of(m as f64);
        let mean = scale(mean, inverse);
        let spread = (square * inverse - dot(mean, mean)).maximum(R::ZERO);
        let area = dot(c, c).sqrt();
        let inverse_length = if area > R::ZERO && area.finite() { R::ONE / area } else { R::ZERO };
        Self {
            normal: scale(c, inverse_length),
            inverse_length,
            centre,
            mean,
            regular: R::of(REGULARISATION * REGULARISATION) * spread,
        }
    }

    /// Offset of the weighted mean from ring vertex `p` (relative coordinates): the whole, its part
    /// along the normal, and the regularised length of its part in the plane.
    #[inline(always)]
    pub(crate) fn offset(&self, p: V3<R>) -> (V3<R>, R, R) {
        let r = sub(self.centre, p);
        let along = dot(self.normal, r);
        let plane = add_scaled(r, self.normal, R::ZERO - along);
        (r, along, (dot(plane, plane) + self.regular).sqrt())
    }
}

/// F of one ring (equation 13), in the form q + (sum w b d) n with q = sum w v and d the distance
/// of q to a neighbour in the ring's plane.
#[inline(always)]
pub fn ring_value<R: Real>(positions: &[V3<R>], ring: &[u32], w: &[R], b: &[R]) -> V3<R> {
    let frame = Frame::new(positions, ring, w);
    let origin = positions[ring[0] as usize];
    let mut s = R::ZERO;
    for k in 0..ring.len() {
        let (_, _, d) = frame.offset(sub(positions[ring[k] as usize], origin));
        s += w[k] * b[k] * d;
    }
    add(origin, add_scaled(frame.centre, frame.normal, s))
}

/// Sets the vertices of the rows in `rows` from their rings, which must not contain one another (a
/// level of vertex splits, section 3.2.1).
///
/// The vertices of the rows must follow one another in the numbering. CPU reference of the kernel
/// `split_level`.
pub fn split_level<R: Real>(
    stencils: &Stencils,
    encoding: &Encoding<R>,
    rows: std::ops::Range<usize>,
    positions: &mut [V3<R>],
) {
    if rows.is_empty() {
        return;
    }
    let first = stencils.vertex[rows.start] as usize;
    let (known, rest) = positions.split_at_mut(first);
    let known: &[V3<R>] = known;
    let one = |row: usize| {
        let slots = stencils.slots(row);
        ring_value(known, &stencils.neighbour[slots.clone()], &encoding.w[slots.clone()], &encoding.b[slots])
    };
    let out = &mut rest[..rows.len()];
    if rows.len() <= BLOCK {
        out.iter_mut().zip(rows).for_each(|(x, row)| *x = one(row));
    } else {
        out.par_chunks_mut(BLOCK).enumerate().for_each(|(block, out)| {
            out.iter_mut().zip(rows.start + block * BLOCK..).for_each(|(x, row)| *x = one(row));
        });
    }
}

/// V - F for every row. CPU reference of the kernel `encoding_residual`.
pub fn encoding_residual<R: Real>(
    stencils: &Stencils,
    encoding: &Encoding<R>,
    positions: &[V3<R>],
    residual: &mut [V3<R>],
) {
    residual.par_chunks_mut(BLOCK).enumerate().for_each(|(block, out)| {
        for (row, out) in (block * BLOCK..).zip(out) {
            let slots = stencils.slots(row);
            let f = ring_value(
                positions,
                &stencils.neighbour[slots.clone()],
                &encoding.w[slots.clone()],
                &encoding.b[slots],
            );
            *out = sub(positions[stencils.vertex[row] as usize], f);
        }
    });
}

/// G = 1/2 sum |v - F|² (equation 15) of residuals; summed in blocks, the same for any number of
/// threads.
pub fn energy(residual: &[V3<f64>]) -> f64 {
    let blocks: Vec<f64> = residual.par_chunks(BLOCK).map(|part| part.iter().map(|&r| dot(r, r)).sum()).collect();
    0.5 * blocks.iter().sum::<f64>()
}
