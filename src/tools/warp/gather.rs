//! `warp_image`: the colours of output pixels, gathered from the picture at their pre-images.

use std::ops::Range;

use super::ewa::{Ellipse, average};
use super::filter::{BILINEAR_REACH, Filter, LANCZOS_REACH, LanczosTable, bilinear, lanczos};
use super::pyramid::{Pyramid, Texel, Window};
use crate::engine::{Lane, Lanes, Sweep};

/// Where an output pixel looks.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Preimage {
    /// The pre-image of the pixel's centre, in pixels of the picture from the block's base (centres of pixels at halves).
    pub at: [f32; 2],
    /// How the pre-image moves when the output pixel moves one to the right.
    pub dx: [f32; 2],
    /// How it moves when the output pixel moves one down.
    pub dy: [f32; 2],
    /// Share of the colour in the result, 0 for pixels that look nowhere: the others need finite numbers.
    pub cover: f32,
    /// Number of the block it belongs to, for the kernel.
    pub block: u32,
}

/// A block of output pixels with their pre-images, row by row.
#[derive(Clone, Copy, Debug)]
pub struct Block<'a> {
    /// Pixels per row.
    pub width: usize,
    /// What pre-images are counted from, so that single precision holds them also in pictures of millions of pixels a side.
    pub base: [i32; 2],
    /// One for each pixel.
    pub preimages: &'a [Preimage],
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

    /// What an ellipse about `p` reads; two texels more: the base may lie between texels of the level, and rows are rounded
    /// outwards.
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

/// Farther than this from the base, single precision does not tell pixels apart, nor is there a picture.
pub(super) const FARTHEST: f32 = 4_194_304.0;

impl Preimage {
    /// The pre-image, kept where numbers of texels and parts of them are exact.
    #[inline(always)]
    pub(super) fn place(&self) -> [f32; 2] {
        self.at.map(|v| v.clamp(-FARTHEST, FARTHEST))
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
    /// Whether pixel `index` takes part.
    fn takes(&self, index: usize) -> bool;
    /// Place and reach of a pixel that takes part, in texels of the level from the base.
    fn extent(&self, index: usize) -> Extent;
    /// What the pixels of a part read together, and how many take part.
    fn extents(&self, block: &Block<'_>, part: Part) -> (Extent, usize) {
        let mut extent = Extent::EMPTY;
        let mut pixels = 0;
        for y in part.y..part.y + part.height {
            for index in y * block.width + part.x..y * block.width + part.x + part.width {
                if self.takes(index) {
                    extent.join(&self.extent(index));
                    pixels += 1;
                }
            }
        }
        (extent, pixels)
    }
    /// Adds the pixel's colour, given the window and where the base lies in it.
    fn add<L: Lane<E = f32>>(
        &self,
        cpu: L::Cpu,
        index: usize,
        texels: &[Texel],
        stride: usize,
        base: [f32; 2],
        out: &mut Texel,
    );
    /// [`Gather::add`] for the pixels of `row` that take part.
    #[inline(always)]
    fn add_row<L: Lane<E = f32>>(
        &self,
        cpu: L::Cpu,
        row: Range<usize>,
        texels: &[Texel],
        stride: usize,
        base: [f32; 2],
        out: &mut [Texel],
    ) {
        for index in row {
            if self.takes(index) {
                self.add::<L>(cpu, index, texels, stride, base, &mut out[index]);
            }
        }
    }
}

/// The colours of a block: decoded, multiplied by alpha, not yet by [`Preimage::cover`]; left as they are where that is 0.
///
/// The mirror of the kernel of the same name. Time O(pixels x texels read); memory for a window of a few hundred texels a side.
/// The picture is continued by its border.
pub fn warp_image(pyramid: &Pyramid<'_>, filter: Filter, block: &Block<'_>, window: &mut Window, out: &mut [Texel]) {
    let table = LanczosTable::get();
    let whole = Part { x: 0, y: 0, width: block.width, height: block.preimages.len() / block.width.max(1) };
    for (o, p) in out.iter_mut().zip(block.preimages) {
        if p.cover > 0.0 {
            *o = [0.0; 4];
        }
    }
    match filter {
        Filter::Bilinear => run(pyramid, block, &Nearest::<false> { block, table }, whole, window, out),
        Filter::Lanczos => run(pyramid, block, &Nearest::<true> { block, table }, whole, window, out),
        Filter::Ewa => {
            let ellipses: Vec<Ellipse> =
                block.preimages.iter().map(|p| Ellipse::new(p.dx, p.dy, pyramid.levels())).collect();
            let seen = || block.preimages.iter().zip(&ellipses).filter(|(p, _)| p.cover > 0.0).map(|(_, e)| e);
            if seen().any(|e| e.share < 1.0) {
                run(pyramid, block, &Interpolated { block, table, ellipses: &ellipses }, whole, window, out);
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

/// Reads the window of a part and gathers from it, or halves the part where its pixels look too far apart.
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

/// Gathers the pixels of a part from its window: what the processor's widest instructions are used for.
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
        for j in y..y + height {
            let start = j * self.block.width + x;
            let row = start..start + width;
            self.gather.add_row::<L>(cpu, row, &self.window.texels, self.window.width, self.shift, self.out);
        }
    }
}

/// Bilinear, or Lanczos-3 if `SHARP`.
struct Nearest<'a, const SHARP: bool> {
    block: &'a Block<'a>,
    table: &'static LanczosTable,
}

impl<const SHARP: bool> Gather for Nearest<'_, SHARP> {
    fn level(&self) -> u32 {
        0
    }

    fn worth(&self) -> usize {
        if SHARP { 64 } else { 12 }
    }

    #[inline(always)]
    fn takes(&self, index: usize) -> bool {
        self.block.preimages[index].cover > 0.0
    }

    #[inline(always)]
    fn extent(&self, index: usize) -> Extent {
        let reach = if SHARP { LANCZOS_REACH } else { BILINEAR_REACH };
        Extent::around(self.block.preimages[index].place(), [reach; 2])
    }

    fn extents(&self, block: &Block<'_>, part: Part) -> (Extent, usize) {
        // All reach as far: the outermost points decide.
        let (mut low, mut high) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
        let mut pixels = 0;
        for y in part.y..part.y + part.height {
            let start = y * block.width + part.x;
            for p in &block.preimages[start..start + part.width] {
                if p.cover > 0.0 {
                    for a in 0..2 {
                        low[a] = if p.at[a] < low[a] { p.at[a] } else { low[a] };
                        high[a] = if p.at[a] > high[a] { p.at[a] } else { high[a] };
                    }
                    pixels += 1;
                }
            }
        }
        if pixels == 0 {
            return (Extent::EMPTY, 0);
        }
        let reach = if SHARP { LANCZOS_REACH } else { BILINEAR_REACH };
        let limit = |v: [f32; 2]| v.map(|v| v.clamp(-FARTHEST, FARTHEST));
        let mut extent = Extent::around(limit(low), [reach; 2]);
        extent.join(&Extent::around(limit(high), [reach; 2]));
        (extent, pixels)
    }

    #[inline(always)]
    fn add<L: Lane<E = f32>>(
        &self,
        cpu: L::Cpu,
        index: usize,
        texels: &[Texel],
        stride: usize,
        base: [f32; 2],
        out: &mut Texel,
    ) {
        let [x, y] = self.block.preimages[index].place();
        let at = [x + base[0], y + base[1]];
        *out =
            if SHARP { lanczos::<L>(cpu, texels, stride, at, self.table) } else { bilinear::<L>(texels, stride, at) };
    }

    #[inline(always)]
    fn add_row<L: Lane<E = f32>>(
        &self,
        cpu: L::Cpu,
        row: Range<usize>,
        texels: &[Texel],
        stride: usize,
        base: [f32; 2],
        out: &mut [Texel],
    ) {
        for (p, out) in self.block.preimages[row.clone()].iter().zip(&mut out[row]) {
            if p.cover > 0.0 {
                let [x, y] = p.place();
                let at = [x + base[0], y + base[1]];
                *out = if SHARP {
                    lanczos::<L>(cpu, texels, stride, at, self.table)
                } else {
                    bilinear::<L>(texels, stride, at)
                };
            }
        }
    }
}

/// The interpolated share of pixels that are not averaged.
struct Interpolated<'a> {
    block: &'a Block<'a>,
    table: &'static LanczosTable,
    ellipses: &'a [Ellipse],
}

impl Gather for Interpolated<'_> {
    fn level(&self) -> u32 {
        0
    }

    fn worth(&self) -> usize {
        64
    }

    #[inline(always)]
    fn takes(&self, index: usize) -> bool {
        self.block.preimages[index].cover > 0.0 && self.ellipses[index].share < 1.0
    }

    #[inline(always)]
    fn extent(&self, index: usize) -> Extent {
        Extent::around(self.block.preimages[index].place(), [LANCZOS_REACH; 2])
    }

    #[inline(always)]
    fn add<L: Lane<E = f32>>(
        &self,
        cpu: L::Cpu,
        index: usize,
        texels: &[Texel],
        stride: usize,
        base: [f32; 2],
        out: &mut Texel,
    ) {
        let p = &self.block.preimages[index];
        let [x, y] = p.place();
        let color = lanczos::<L>(cpu, texels, stride, [x + base[0], y + base[1]], self.table);
        let share = 1.0 - self.ellipses[index].share;
        for c in 0..4 {
            out[c] += share * color[c];
        }
    }
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
        self.block.preimages[index].place().map(|v| v * scale)
    }
}

impl Gather for Averaged<'_> {
    fn level(&self) -> u32 {
        self.level
    }

    fn worth(&self) -> usize {
        256
    }

    #[inline(always)]
    fn takes(&self, index: usize) -> bool {
        let e = &self.ellipses[index];
        self.block.preimages[index].cover > 0.0 && e.share > 0.0 && e.level == self.level
    }

    #[inline(always)]
    fn extent(&self, index: usize) -> Extent {
        Extent::of_ellipse(self.place(index), &self.ellipses[index])
    }

    #[inline(always)]
    fn add<L: Lane<E = f32>>(
        &self,
        _cpu: L::Cpu,
        index: usize,
        texels: &[Texel],
        stride: usize,
        base: [f32; 2],
        out: &mut Texel,
    ) {
        let p = self.place(index);
        let e = &self.ellipses[index];
        let color = average(texels, stride, [p[0] + base[0], p[1] + base[1]], e);
        for c in 0..4 {
            out[c] += e.share * color[c];
        }
    }
}

#[cfg(test)]
mod tests;
