//! Where output pixels look, list by list.

use std::ops::Range;

use crate::engine::Lane;
use crate::engine::lane::MAX_LANES;

/// Farther than this from the base, single precision does not tell pixels apart, nor is there a
/// picture.
pub(super) const FARTHEST: f32 = 4_194_304.0;

/// Where an output pixel looks.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Footprint {
    /// The pre-image of the pixel's centre, in pixels of the picture from the block's base (centres
    /// of pixels at halves).
    pub at: [f32; 2],
    /// How the pre-image moves when the output pixel moves one to the right.
    pub dx: [f32; 2],
    /// How it moves when the output pixel moves one down.
    pub dy: [f32; 2],
    /// Share of the colour in the result, 0 for pixels that look nowhere: the others need finite
    /// numbers.
    pub cover: f32,
}

/// The [`Footprint`]s of many pixels. Filters that only interpolate read a place and a cover of
/// each, 12 bytes: so few that memory does not hold them up.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Footprints {
    x: Vec<f32>,
    y: Vec<f32>,
    cover: Vec<f32>,
    derivatives: Vec<[[f32; 2]; 2]>,
}

impl Footprints {
    /// `count` pixels that look nowhere; with room for derivatives, which
    /// [`Filter::Ewa`](super::Filter::Ewa) needs, if asked for.
    pub fn new(count: usize, derivatives: bool) -> Self {
        let mut footprints = Self::default();
        footprints.reset(count, derivatives);
        footprints
    }

    /// As [`Footprints::new`], in the memory that there is.
    pub fn reset(&mut self, count: usize, derivatives: bool) {
        for list in [&mut self.x, &mut self.y, &mut self.cover] {
            list.clear();
            list.resize(count, 0.0);
        }
        self.derivatives.clear();
        self.derivatives.resize(if derivatives { count } else { 0 }, [[0.0; 2]; 2]);
    }

    /// Sets pixel `i`. Derivatives are dropped if there is no room for them.
    ///
    /// # Panics
    /// If there is no such pixel.
    pub fn set(&mut self, i: usize, footprint: Footprint) {
        let Self { x, y, cover, derivatives } = self;
        Setter { x, y, cover, derivatives }.set(i, footprint);
    }

    /// Runs of pixels one after another, of these lengths, to be set side by side.
    pub(super) fn parts(&mut self, lengths: impl Iterator<Item = usize>) -> Vec<Setter<'_>> {
        let (mut x, mut y, mut cover) = (self.x.as_mut_slice(), self.y.as_mut_slice(), self.cover.as_mut_slice());
        let mut derivatives = self.derivatives.as_mut_slice();
        let wanted = !derivatives.is_empty();
        let part = |n: usize| {
            let own = if wanted { n } else { 0 };
            Setter {
                x: x.split_off_mut(..n).unwrap_or_default(),
                y: y.split_off_mut(..n).unwrap_or_default(),
                cover: cover.split_off_mut(..n).unwrap_or_default(),
                derivatives: derivatives.split_off_mut(..own).unwrap_or_default(),
            }
        };
        lengths.map(part).collect()
    }

    /// All pixels.
    pub fn seen(&self) -> Seen<'_> {
        Seen { x: &self.x, y: &self.y, cover: &self.cover, derivatives: &self.derivatives }
    }
}

/// A run of [`Footprints`] that are set.
pub(super) struct Setter<'a> {
    x: &'a mut [f32],
    y: &'a mut [f32],
    pub(super) cover: &'a mut [f32],
    derivatives: &'a mut [[[f32; 2]; 2]],
}

impl Setter<'_> {
    /// See [`Footprints::set`].
    #[inline(always)]
    pub(super) fn set(&mut self, i: usize, footprint: Footprint) {
        let Footprint { at, dx, dy, cover } = footprint;
        (self.x[i], self.y[i], self.cover[i]) = (at[0], at[1], cover);
        if let Some(derivative) = self.derivatives.get_mut(i) {
            *derivative = [dx, dy];
        }
    }
}

/// A run of [`Footprints`].
#[derive(Clone, Copy, Debug)]
pub struct Seen<'a> {
    /// Columns of the pre-images, from the base.
    pub(super) x: &'a [f32],
    /// Their rows.
    pub(super) y: &'a [f32],
    /// Shares in the result.
    pub(super) cover: &'a [f32],
    derivatives: &'a [[[f32; 2]; 2]],
}

impl<'a> Seen<'a> {
    /// Number of pixels.
    pub fn len(&self) -> usize {
        self.cover.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.cover.is_empty()
    }

    /// The pixels of `range`.
    ///
    /// # Panics
    /// If there are no such pixels.
    #[inline(always)]
    pub fn part(&self, range: Range<usize>) -> Self {
        let derivatives = if self.derivatives.is_empty() { &[] } else { &self.derivatives[range.clone()] };
        let Range { start, end } = range;
        Self { x: &self.x[start..end], y: &self.y[start..end], cover: &self.cover[start..end], derivatives }
    }

    /// Shares of the colours in the result.
    pub fn cover(&self) -> &'a [f32] {
        self.cover
    }

    /// Whether pixel `i` looks anywhere.
    #[inline(always)]
    pub(super) fn looks(&self, i: usize) -> bool {
        self.cover[i] > 0.0
    }

    /// The pre-image of pixel `i`, kept where numbers of texels and parts of them are exact.
    #[inline(always)]
    pub(super) fn place(&self, i: usize) -> [f32; 2] {
        [self.x[i], self.y[i]].map(|v| v.clamp(-FARTHEST, FARTHEST))
    }

    /// How it moves when the pixel moves one to the right and one down: not at all if that was not
    /// given.
    #[inline(always)]
    pub(super) fn derivative(&self, i: usize) -> [[f32; 2]; 2] {
        self.derivatives.get(i).copied().unwrap_or_default()
    }

    /// Smallest and largest pre-image, by component, of the pixels that look somewhere; and how
    /// many these are.
    #[inline(always)]
    pub(super) fn bounds<L: Lane<E = f32>>(&self, cpu: L::Cpu) -> Bounds {
        let (zero, one) = (L::splat(cpu, 0.0), L::splat(cpu, 1.0));
        let (least, most) = (L::splat(cpu, f32::NEG_INFINITY), L::splat(cpu, f32::INFINITY));
        let (mut low, mut high, mut count) = ([most; 2], [least; 2], zero);
        let whole = self.len() / L::N * L::N;
        for i in (0..whole).step_by(L::N) {
            let looks = zero.lt(L::load(cpu, &self.cover[i..]));
            count = count + L::select(looks, one, zero);
            for (axis, values) in [self.x, self.y].into_iter().enumerate() {
                let v = L::load(cpu, &values[i..]);
                low[axis] = L::select(looks, v, most).minimum(low[axis]);
                high[axis] = L::select(looks, v, least).maximum(high[axis]);
            }
        }
        let lanes = |v: L| {
            let mut lanes = [0.0; MAX_LANES];
            v.store(&mut lanes);
            lanes
        };
        let (low, high, count) = (low.map(lanes), high.map(lanes), lanes(count));
        let mut bounds = Bounds::EMPTY;
        for k in 0..L::N {
            let (low, high) = ([low[0][k], low[1][k]], [high[0][k], high[1][k]]);
            bounds.join(&Bounds { low, high, pixels: count[k] as usize });
        }
        for i in (whole..self.len()).filter(|&i| self.looks(i)) {
            let p = [self.x[i], self.y[i]];
            bounds.join(&Bounds { low: p, high: p, pixels: 1 });
        }
        bounds
    }
}

/// See [`Seen::bounds`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    pub(super) low: [f32; 2],
    pub(super) high: [f32; 2],
    pub(super) pixels: usize,
}

impl Bounds {
    pub(super) const EMPTY: Self = Self { low: [f32::INFINITY; 2], high: [f32::NEG_INFINITY; 2], pixels: 0 };

    #[inline(always)]
    pub(super) fn join(&mut self, other: &Self) {
        for a in 0..2 {
            self.low[a] = if other.low[a] < self.low[a] { other.low[a] } else { self.low[a] };
            self.high[a] = if other.high[a] > self.high[a] { other.high[a] } else { self.high[a] };
        }
        self.pixels += other.pixels;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_are_those_of_the_pixels_that_look() {
        for count in [0, 1, 15, 16, 17, 40, 1024] {
            for every in [1, 3, 50] {
                let mut all = Footprints::new(count, false);
                for i in 0..count {
                    let at = [(i * 37 % 101) as f32 - 50.0, (i * 53 % 89) as f32 + 7.0];
                    let cover = if i % every == 0 { 0.5 } else { 0.0 };
                    all.set(i, Footprint { at, cover, ..Footprint::default() });
                }
                let mut expected = Bounds::EMPTY;
                for i in (0..count).step_by(every) {
                    let p = [all.x[i], all.y[i]];
                    expected.join(&Bounds { low: p, high: p, pixels: 1 });
                }
                let found = all.seen().bounds::<f32>(());
                assert_eq!((found.low, found.high), (expected.low, expected.high));
                assert_eq!(found.pixels, count.div_ceil(every));
            }
        }
    }
}
