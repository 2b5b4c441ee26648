//! `warp_image`: the colours of output pixels, gathered from the picture at their pre-images.

use std::ops::Range;

use super::band::BLOCK;
use super::direct;
use super::ewa::average;
use super::footprint::{Bounds, FARTHEST, Seen};
use super::interpolate::{Bilinear, Grid, Interpolation, Lanczos, NearestTexel, Places, interpolate};
use super::pyramid::{Pyramid, Texel, Window};
use crate::engine::{Lane, Lanes, Sweep};
use crate::picture::Filter;
use crate::picture::ellipse::Ellipse;
use crate::picture::lanczos::LanczosTable;

/// A block of output pixels with their pre-images, row by row.
#[derive(Clone, Copy, Debug)]
pub struct Block<'a> {
    /// Pixels per row.
    pub width: usize,
    /// What pre-images are counted from, so that single precision holds them also in pictures of
    /// millions of pixels a side.
    pub base: [i32; 2],
    /// Where each of them looks.
    pub seen: Seen<'a>,
}

/// A rectangle of pixels of a block.
#[derive(Clone, Copy, Debug)]
struct Part {
    x: usize,
    y: usize,
    width: usize,
    height: usize,
}

/// Texels from `low` to below `high`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    pub(super) low: [i32; 2],
    pub(super) high: [i32; 2],
}

impl Extent {
    pub(super) const EMPTY: Self = Self { low: [i32::MAX; 2], high: [i32::MIN; 2] };

    /// The texels within `reach` of the one that holds `p`.
    #[inline(always)]
    pub(super) fn around(p: [f32; 2], reach: [i32; 2]) -> Self {
        let at = p.map(floor);
        Self {
            low: [at[0].saturating_sub(reach[0]), at[1].saturating_sub(reach[1])],
            high: [at[0].saturating_add(reach[0] + 1), at[1].saturating_add(reach[1] + 1)],
        }
    }

    /// The texels within `reach` of those that hold points between the bounds.
    #[inline(always)]
    pub(super) fn within(bounds: &Bounds, reach: i32) -> Self {
        if bounds.pixels == 0 {
            return Self::EMPTY;
        }
        let limit = |v: [f32; 2]| v.map(|v| v.clamp(-FARTHEST, FARTHEST));
        let mut extent = Self::around(limit(bounds.low), [reach; 2]);
        extent.join(&Self::around(limit(bounds.high), [reach; 2]));
        extent
    }

    /// What an ellipse about `p` reads; two texels more: the base may lie between texels of the
    /// level, and rows are rounded outwards.
    #[inline(always)]
    pub(super) fn of_ellipse(p: [f32; 2], ellipse: &Ellipse) -> Self {
        Self::around(p, ellipse.reach.map(|r| r as i32 + 3))
    }

    #[inline(always)]
    pub(super) fn join(&mut self, other: &Self) {
        for a in 0..2 {
            self.low[a] = self.low[a].min(other.low[a]);
            self.high[a] = self.high[a].max(other.high[a]);
        }
    }

    pub(super) fn size(&self) -> [usize; 2] {
        [0, 1].map(|a| (i64::from(self.high[a]) - i64::from(self.low[a])).max(0) as usize)
    }
}

/// The largest integer not above `x`; without SSE 4.1, `f32::floor` is a call.
#[inline(always)]
fn floor(x: f32) -> i32 {
    let toward_zero = x as i32;
    toward_zero.saturating_sub(i32::from(toward_zero as f32 > x))
}

/// What a pass over a block gathers.
trait Gather: Sync {
    /// Level of the pyramid.
    fn level(&self) -> u32;
    /// Texels of a window that are worth decoding for one pixel: about twice what it reads.
    fn worth(&self) -> usize;
    /// What the pixels of a part read together, in texels of the level from the base, and how many
    /// take part.
    fn extents(&self, block: &Block<'_>, part: Part) -> (Extent, usize);
    /// Adds the colours of those pixels of a row of the block that take part, given the window and
    /// where the base lies in it.
    fn add_row<L: Lane<E = f32>>(&self, cpu: L::Cpu, row: Range<usize>, window: &Grid<&[Texel]>, out: &mut [Texel]);
}

/// The colours of a block: decoded, multiplied by alpha, not yet by the cover; left as they are
/// where that is 0.
///
/// The mirror of the kernel of the same name. Time O(pixels x texels read); memory for a window of
/// a few hundred texels a side. The picture is continued by its border.
pub fn warp_image(pyramid: &Pyramid<'_>, filter: Filter, block: &Block<'_>, window: &mut Window, out: &mut [Texel]) {
    let whole = Part { x: 0, y: 0, width: block.width, height: block.seen.len() / block.width.max(1) };
    let lanczos = Lanczos(LanczosTable::<6>::get());
    match filter {
        Filter::Bilinear => {
            if !direct::bilinear(pyramid, block, &bounds(block, whole), out) {
                run(pyramid, block, &Fixed { block, filter: Bilinear }, whole, window, out);
            }
        }
        Filter::Nearest => run(pyramid, block, &Fixed { block, filter: NearestTexel }, whole, window, out),
        Filter::Lanczos => run(pyramid, block, &Fixed { block, filter: lanczos }, whole, window, out),
        Filter::Lanczos4 => {
            let filter = Lanczos(LanczosTable::<8>::get());
            run(pyramid, block, &Fixed { block, filter }, whole, window, out);
        }
        Filter::Anisotropic | Filter::Trilinear => tapped::warp(pyramid, filter, block, whole, window, out),
        Filter::Ewa => {
            let ellipse = |i: usize| {
                let [dx, dy] = block.seen.derivative(i);
                Ellipse::new(dx, dy, pyramid.levels())
            };
            let ellipses: Vec<Ellipse> = (0..block.seen.len()).map(ellipse).collect();
            for (o, _) in out.iter_mut().zip(block.seen.cover()).filter(|(_, cover)| **cover > 0.0) {
                *o = [0.0; 4];
            }
            let seen = || ellipses.iter().zip(block.seen.cover()).filter(|(_, cover)| **cover > 0.0).map(|(e, _)| e);
            if seen().any(|e| e.share < 1.0) {
                let shared = Shared { block, filter: lanczos, ellipses: &ellipses };
                run(pyramid, block, &shared, whole, window, out);
            }
            let lowest = seen().map(|e| e.level).min().unwrap_or(0);
            let highest = seen().map(|e| e.level).max().unwrap_or(0);
            for level in lowest..=highest {
                if seen().any(|e| e.share > 0.0 && e.level == level) {
                    run(pyramid, block, &Averaged { block, ellipses: &ellipses, level }, whole, window, out);
                }
            }
        }
    }
}

/// The bounds of the pre-images of a part.
fn bounds(block: &Block<'_>, part: Part) -> Bounds {
    let mut bounds = Bounds::EMPTY;
    Lanes::detect().run(Bound { block, part, bounds: &mut bounds });
    bounds
}

struct Bound<'a> {
    block: &'a Block<'a>,
    part: Part,
    bounds: &'a mut Bounds,
}

impl Sweep<f32> for Bound<'_> {
    #[inline(always)]
    fn run<L: Lane<E = f32>>(self, cpu: L::Cpu) {
        let Part { x, y, width, height } = self.part;
        // Whole rows lie one after the other.
        let (runs, length) = if width == self.block.width { (1, width * height) } else { (height, width) };
        for j in 0..runs {
            let start = (y + j) * self.block.width + x;
            self.bounds.join(&self.block.seen.part(start..start + length).bounds::<L>(cpu));
        }
    }
}

/// Reads the window of a part and gathers from it, or halves the part where its pixels look too far
/// apart.
fn run<G: Gather>(
    pyramid: &Pyramid<'_>,
    block: &Block<'_>,
    gather: &G,
    part: Part,
    window: &mut Window,
    out: &mut [Texel],
) {
    let (extent, pixels) = gather.extents(block, part);
    if pixels == 0 {
        return;
    }
    let [width, height] = extent.size();
    if pixels > 1 && width.saturating_mul(height) > gather.worth().saturating_mul(pixels) + 256 {
        let Part { x, y, width, height } = part;
        let (a, b) = if width >= height {
            (Part { width: width / 2, ..part }, Part { x: x + width / 2, width: width - width / 2, ..part })
        } else {
            (Part { height: height / 2, ..part }, Part { y: y + height / 2, height: height - height / 2, ..part })
        };
        run(pyramid, block, gather, a, window, out);
        run(pyramid, block, gather, b, window, out);
        return;
    }
    let level = gather.level();
    // The base need not be on a texel of a higher level: the remainder goes into the points.
    let base = block.base.map(|b| b >> level);
    let rest = [0, 1].map(|a| (block.base[a] - (base[a] << level)) as f32 / (1u64 << level) as f32);
    let origin = [0, 1].map(|a| base[a].saturating_add(extent.low[a]));
    pyramid.read(level, origin, [width, height], window);
    let shift = [0, 1].map(|a| rest[a] - extent.low[a] as f32);
    Lanes::detect().run(Apply { block, gather, part, window, shift, out });
}

/// Gathers the pixels of a part from its window: what the processor's widest instructions are used
/// for.
struct Apply<'a, G> {
    block: &'a Block<'a>,
    gather: &'a G,
    part: Part,
    window: &'a Window,
    shift: [f32; 2],
    out: &'a mut [Texel],
}

impl<G: Gather> Sweep<f32> for Apply<'_, G> {
    #[inline(always)]
    fn run<L: Lane<E = f32>>(self, cpu: L::Cpu) {
        let Part { x, y, width, height } = self.part;
        let window = Grid { texels: self.window.texels.as_slice(), stride: self.window.width, shift: self.shift };
        for j in y..y + height {
            let start = j * self.block.width + x;
            self.gather.add_row::<L>(cpu, start..start + width, &window, self.out);
        }
    }
}

/// A filter of a fixed size at every pixel.
struct Fixed<'a, I> {
    block: &'a Block<'a>,
    filter: I,
}

impl<I: for<'t> Interpolation<&'t [Texel]>> Gather for Fixed<'_, I> {
    fn level(&self) -> u32 {
        0
    }

    fn worth(&self) -> usize {
        I::WORTH
    }

    fn extents(&self, block: &Block<'_>, part: Part) -> (Extent, usize) {
        // All reach as far: the outermost points decide.
        let bounds = bounds(block, part);
        (Extent::within(&bounds, I::REACH), bounds.pixels)
    }

    #[inline(always)]
    fn add_row<L: Lane<E = f32>>(&self, cpu: L::Cpu, row: Range<usize>, window: &Grid<&[Texel]>, out: &mut [Texel]) {
        interpolate::<L, _, _>(cpu, &self.filter, window, &self.block.seen.part(row.clone()), &mut out[row]);
    }
}

/// Its share of pixels that are not all averaged.
struct Shared<'a, I> {
    block: &'a Block<'a>,
    filter: I,
    ellipses: &'a [Ellipse],
}

impl<I: for<'t> Interpolation<&'t [Texel]>> Gather for Shared<'_, I> {
    fn level(&self) -> u32 {
        0
    }

    fn worth(&self) -> usize {
        I::WORTH
    }

    fn extents(&self, block: &Block<'_>, part: Part) -> (Extent, usize) {
        let extent = |i: usize| Extent::around(block.seen.place(i), [I::REACH; 2]);
        joined(block, part, |i| block.seen.looks(i) && self.ellipses[i].share < 1.0, extent)
    }

    #[inline(always)]
    fn add_row<L: Lane<E = f32>>(&self, cpu: L::Cpu, row: Range<usize>, window: &Grid<&[Texel]>, out: &mut [Texel]) {
        for (start, out) in row.clone().step_by(BLOCK).zip(out[row.clone()].chunks_mut(BLOCK)) {
            let range = start..start + out.len();
            let (run, ellipses) = (self.block.seen.part(range.clone()), &self.ellipses[range]);
            let places = Places::new(&run, window.shift);
            for (k, (out, ellipse)) in out.iter_mut().zip(ellipses).enumerate() {
                if run.looks(k) && ellipse.share < 1.0 {
                    let color = self.filter.color::<L>(cpu, window, &places, k);
                    for c in 0..4 {
                        out[c] += (1.0 - ellipse.share) * color[c];
                    }
                }
            }
        }
    }
}

/// Joins the extents of those pixels of a part that take part.
fn joined(
    block: &Block<'_>,
    part: Part,
    takes: impl Fn(usize) -> bool,
    extent: impl Fn(usize) -> Extent,
) -> (Extent, usize) {
    let (mut all, mut pixels) = (Extent::EMPTY, 0);
    for y in part.y..part.y + part.height {
        let start = y * block.width + part.x;
        for i in (start..start + part.width).filter(|&i| takes(i)) {
            all.join(&extent(i));
            pixels += 1;
        }
    }
    (all, pixels)
}

/// The averaged share of pixels whose ellipses lie on one level.
struct Averaged<'a> {
    block: &'a Block<'a>,
    ellipses: &'a [Ellipse],
    level: u32,
}

impl Averaged<'_> {
    /// The pre-image in texels of the level.
    #[inline(always)]
    fn place(&self, index: usize) -> [f32; 2] {
        let scale = 1.0 / (1u64 << self.level) as f32;
        self.block.seen.place(index).map(|v| v * scale)
    }

    #[inline(always)]
    fn takes(&self, index: usize) -> bool {
        let e = &self.ellipses[index];
        self.block.seen.looks(index) && e.share > 0.0 && e.level == self.level
    }
}

impl Gather for Averaged<'_> {
    fn level(&self) -> u32 {
        self.level
    }

    fn worth(&self) -> usize {
        256
    }

    fn extents(&self, block: &Block<'_>, part: Part) -> (Extent, usize) {
        let extent = |i: usize| Extent::of_ellipse(self.place(i), &self.ellipses[i]);
        joined(block, part, |i| self.takes(i), extent)
    }

    #[inline(always)]
    fn add_row<L: Lane<E = f32>>(&self, _cpu: L::Cpu, row: Range<usize>, window: &Grid<&[Texel]>, out: &mut [Texel]) {
        for i in row.filter(|&i| self.takes(i)) {
            let (p, e) = (self.place(i), &self.ellipses[i]);
            let at = [p[0] + window.shift[0], p[1] + window.shift[1]];
            let color = average(window.texels, window.stride, at, e);
            for c in 0..4 {
                out[i][c] += e.share * color[c];
            }
        }
    }
}

mod tapped;
#[cfg(test)]
mod tests;
