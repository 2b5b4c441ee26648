//! Filters that put boxes of the pyramid together: one or more taps a pixel, on one level or
//! between two.

use std::ops::Range;

use super::{Extent, Gather, Part, joined, run};
use crate::engine::Lane;
use crate::picture::Filter;
use crate::picture::taps::{SLACK, Taps, floor};
use crate::tools::warp::gather::Block;
use crate::tools::warp::interpolate::Grid;
use crate::tools::warp::pyramid::{Pyramid, Texel, Window};

/// Taps along the wide side of a footprint at most.
const MOST_TAPS: u32 = 16;

/// The colours of a block by [`Filter::Anisotropic`] or [`Filter::Trilinear`].
pub(super) fn warp(
    pyramid: &Pyramid<'_>,
    filter: Filter,
    block: &Block<'_>,
    whole: Part,
    window: &mut Window,
    out: &mut [Texel],
) {
    let top = (pyramid.levels() - 1) as f32;
    let pixel = |i: usize| {
        let [dx, dy] = block.seen.derivative(i);
        let taps = Taps::new(block.seen.place(i), dx, dy, filter, MOST_TAPS);
        let level = taps.level.min(top);
        let lower = floor(level).max(0);
        let part = level - lower as f32;
        // Half of the reads are saved where they would not show.
        Pixel { taps, lower: lower as u32, part: if part > SLACK { part } else { 0.0 } }
    };
    let pixels: Vec<Pixel> = (0..block.seen.len()).map(pixel).collect();
    for (o, _) in out.iter_mut().zip(block.seen.cover()).filter(|(_, cover)| **cover > 0.0) {
        *o = [0.0; 4];
    }
    for level in 0..pyramid.levels() {
        let all = Tapped { block, pixels: &pixels, level };
        if (0..pixels.len()).any(|i| all.takes(i)) {
            run(pyramid, block, &all, whole, window, out);
        }
    }
}

/// What one pixel reads.
struct Pixel {
    taps: Taps,
    /// The finer of the levels.
    lower: u32,
    /// Share of the coarser one, or 0.
    part: f32,
}

impl Pixel {
    /// Share of a level in the pixel.
    fn share(&self, level: u32) -> f32 {
        if level == self.lower {
            1.0 - self.part
        } else if level == self.lower + 1 {
            self.part
        } else {
            0.0
        }
    }
}

/// What the pixels read of one level.
struct Tapped<'a> {
    block: &'a Block<'a>,
    pixels: &'a [Pixel],
    level: u32,
}

impl Tapped<'_> {
    fn takes(&self, index: usize) -> bool {
        self.block.seen.looks(index) && self.pixels[index].share(self.level) > 0.0
    }

    /// A tap in texels of the level from the base.
    #[inline(always)]
    fn place(&self, taps: &Taps, i: u32, j: u32) -> [f32; 2] {
        let scale = 1.0 / (1u64 << self.level) as f32;
        taps.place(i, j).map(|v| v * scale)
    }
}

impl Gather for Tapped<'_> {
    fn level(&self) -> u32 {
        self.level
    }

    fn worth(&self) -> usize {
        128
    }

    fn extents(&self, block: &Block<'_>, part: Part) -> (Extent, usize) {
        let extent = |index: usize| {
            let taps = &self.pixels[index].taps;
            let [last_i, last_j] = taps.count.map(|n| n - 1);
            let mut extent = Extent::EMPTY;
            // The outermost taps; two texels more, as the base may lie between texels.
            for (i, j) in [(0, 0), (last_i, 0), (0, last_j), (last_i, last_j)] {
                extent.join(&Extent::around(self.place(taps, i, j), [2; 2]));
            }
            extent
        };
        joined(block, part, |index| self.takes(index), extent)
    }

    #[inline(always)]
    fn add_row<L: Lane<E = f32>>(&self, _cpu: L::Cpu, row: Range<usize>, window: &Grid<&[Texel]>, out: &mut [Texel]) {
        for index in row.filter(|&index| self.takes(index)) {
            let pixel = &self.pixels[index];
            let count = pixel.taps.count;
            let share = pixel.share(self.level) / (count[0] * count[1]) as f32;
            for j in 0..count[1] {
                for i in 0..count[0] {
                    let p = self.place(&pixel.taps, i, j);
                    add_bilinear(window, [p[0] + window.shift[0], p[1] + window.shift[1]], share, &mut out[index]);
                }
            }
        }
    }
}

/// Adds `share` of the weighted mean of the four texels around a place of the window.
#[inline(always)]
fn add_bilinear(window: &Grid<&[Texel]>, p: [f32; 2], share: f32, out: &mut Texel) {
    let q = p.map(|v| v - 0.5);
    let at = q.map(floor);
    let [fx, fy] = [0, 1].map(|a| q[a] - at[a] as f32);
    let first = at[1] as usize * window.stride + at[0] as usize;
    let (upper, lower) = (&window.texels[first..first + 2], &window.texels[first + window.stride..][..2]);
    for c in 0..4 {
        let top = upper[0][c] + fx * (upper[1][c] - upper[0][c]);
        let bottom = lower[0][c] + fx * (lower[1][c] - lower[0][c]);
        out[c] += share * (top + fy * (bottom - top));
    }
}
