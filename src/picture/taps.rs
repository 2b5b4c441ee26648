//! Boxes of a mip chain that together see what a footprint covers, and texels beyond a picture.
//!
//! The footprint's matrix takes a pixel of the result to a parallelogram, read as an ellipse with
//! its singular values as widths. Taps are spread along its wide side (Schilling, Knittel and
//! Strasser 1996, "Texram"; EXT_texture_filter_anisotropic) and, unlike there, two across its
//! narrow side: boxes of half its width put together are much closer to the footprint than one
//! blurred box of all of it (25 against 17 dB on a chequered texture reduced four times, see the
//! tests of `transfer`).

use super::Filter;
use crate::geometry::Wrap;

/// Footprints up to this much wider than a texel, or than a whole number of narrow sides, count as
/// no wider, so that rounding does not blur.
pub(crate) const SLACK: f32 = 1.0 / 64.0;
/// Footprints wider than this many texels see the mean of the whole picture.
pub(crate) const LARGEST_FOOTPRINT: f32 = 1e6;

/// The level and the taps of a footprint, in texels of level 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Taps {
    /// Where they are centred.
    pub(crate) centre: [f32; 2],
    /// Level of the mip chain, with fraction.
    pub(crate) level: f32,
    /// Number of taps along and across.
    pub(crate) count: [u32; 2],
    /// The sides of the ellipse, wide and narrow, over which they are spread.
    sides: [[f32; 2]; 2],
}

impl Taps {
    /// Of the footprint about `centre` whose sides are `dx` and `dy`, with `most` taps along its
    /// wide side. `filter` is one of those that boxes of a mip chain make; others have one tap on
    /// level 0.
    #[inline]
    pub(crate) fn new(centre: [f32; 2], dx: [f32; 2], dy: [f32; 2], filter: Filter, most: u32) -> Self {
        let one = |level: f32| Self { centre, level, count: [1; 2], sides: [[0.0; 2]; 2] };
        if !matches!(filter, Filter::Anisotropic | Filter::Trilinear) {
            return one(0.0);
        }
        // Eigenvalues of M M^T are the squares of the widths.
        let (a, b, c) = (dx[0] * dx[0] + dy[0] * dy[0], dx[0] * dx[1] + dy[0] * dy[1], dx[1] * dx[1] + dy[1] * dy[1]);
        let (mean, half) = (0.5 * (a + c), 0.5 * (a - c));
        let root = (half * half + b * b).sqrt();
        let wide = (mean + root).sqrt();
        if wide <= 1.0 + SLACK {
            return one(0.0);
        }
        if wide.is_nan() || wide > LARGEST_FOOTPRINT {
            return one(LARGEST_FOOTPRINT);
        }
        if filter == Filter::Trilinear {
            return one(wide.log2());
        }
        // The product of the widths is the determinant: no cancellation.
        let narrow = (dx[0] * dy[1] - dx[1] * dy[0]).abs() / wide;
        let most = most.clamp(1, 16) as f32;
        // Distance of taps, and width of the boxes they see.
        let step = (0.5 * narrow).max(wide / most).max(1.0);
        let along = (-floor(SLACK - wide / step)).clamp(1, most as i32);
        let across = if narrow / step > 1.0 + SLACK { 2 } else { 1 };
        let axis = if half >= 0.0 { [half + root, b] } else { [b, root - half] };
        let length = (axis[0] * axis[0] + axis[1] * axis[1]).sqrt();
        let unit = if length > 0.0 { [axis[0] / length, axis[1] / length] } else { [1.0, 0.0] };
        let sides = [[unit[0] * wide, unit[1] * wide], [-unit[1] * narrow, unit[0] * narrow]];
        let level = if step > 1.0 { step.log2() } else { 0.0 };
        Self { centre, level, count: [along as u32, across], sides }
    }

    /// Place of tap (i, j).
    #[inline]
    pub(crate) fn place(&self, i: u32, j: u32) -> [f32; 2] {
        let at = |k: u32, n: u32| (k as f32 + 0.5) / n as f32 - 0.5;
        let (s, t) = (at(i, self.count[0]), at(j, self.count[1]));
        [0, 1].map(|a| self.centre[a] + s * self.sides[0][a] + t * self.sides[1][a])
    }
}

/// The largest integer not above `x`; without SSE 4.1, `f32::floor` is a call.
#[inline]
pub(crate) fn floor(x: f32) -> i32 {
    let toward_zero = x as i32;
    toward_zero.saturating_sub(i32::from(toward_zero as f32 > x))
}

/// Farther from a picture than this, in its sides, its border is all that a footprint sees.
pub(crate) const FAR: f32 = 1000.0;

/// A coordinate that shows the same texels, brought near the picture: far off, the fraction of a
/// texel would be lost, and in the end the range of integers left.
#[inline]
pub(crate) fn near_picture(x: f32, wrap: Wrap) -> f32 {
    match wrap {
        Wrap::Repeat => x - floor(x) as f32,
        Wrap::Mirror => x - 2.0 * floor(0.5 * x) as f32,
        Wrap::Clamp => x.clamp(-FAR, FAR),
    }
}

/// The texel that stands for one beyond the picture.
#[inline]
pub(crate) fn wrapped(index: i32, n: u32, wrap: Wrap) -> usize {
    if (0..n as i32).contains(&index) { index as usize } else { wrap.texel(i64::from(index), n) as usize }
}
