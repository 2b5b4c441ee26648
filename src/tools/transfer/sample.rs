//! `sample_texture`: the colour of a texel, from its footprint on the source's texture.

use rayon::prelude::*;

use super::color::Sample;
use super::footprint::Footprint;
use super::mip::{Encoding, Level, MipChain};
use crate::geometry::{NONE, Wrap};
use crate::picture::Filter;
use crate::picture::Pixels;
use crate::picture::lanczos::LanczosTable;
use crate::picture::taps::{SLACK, Taps, floor, near_picture, wrapped};

/// Texels of one parallel task.
const TASK: usize = 4096;

/// Parameters of [`sample_texture`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleParams {
    /// How the texture is averaged.
    pub filter: Filter,
    /// Largest number of taps along the wide side, 1 to 16; there are at most two across.
    pub taps: u32,
    /// Channels of the output; pictures with fewer are widened (grey to colour, alpha 1).
    pub channels: u32,
    /// Index of this texture: only texels whose source triangle has it are sampled.
    pub texture: u32,
}

/// Samples one texture at the texels whose source triangle shows it.
///
/// `texture_of` holds the texture of each source triangle; `colors` gets `params.channels` decoded,
/// premultiplied values per footprint, and is left as it is where the texture is another.
///
/// Time O(footprints x taps).
pub fn sample_texture(
    chain: &MipChain<'_>,
    params: &SampleParams,
    texture_of: &[u32],
    footprints: &[Footprint],
    colors: &mut [f32],
) {
    match (&chain.image.pixels, chain.image.channels) {
        (Pixels::U8(v), 1) => run::<u8, 1>(v, chain, params, texture_of, footprints, colors),
        (Pixels::U8(v), 2) => run::<u8, 2>(v, chain, params, texture_of, footprints, colors),
        (Pixels::U8(v), 3) => run::<u8, 3>(v, chain, params, texture_of, footprints, colors),
        (Pixels::U8(v), _) => run::<u8, 4>(v, chain, params, texture_of, footprints, colors),
        (Pixels::U16(v), 1) => run::<u16, 1>(v, chain, params, texture_of, footprints, colors),
        (Pixels::U16(v), 2) => run::<u16, 2>(v, chain, params, texture_of, footprints, colors),
        (Pixels::U16(v), 3) => run::<u16, 3>(v, chain, params, texture_of, footprints, colors),
        (Pixels::U16(v), _) => run::<u16, 4>(v, chain, params, texture_of, footprints, colors),
        (Pixels::F32(v), 1) => run::<f32, 1>(v, chain, params, texture_of, footprints, colors),
        (Pixels::F32(v), 2) => run::<f32, 2>(v, chain, params, texture_of, footprints, colors),
        (Pixels::F32(v), 3) => run::<f32, 3>(v, chain, params, texture_of, footprints, colors),
        (Pixels::F32(v), _) => run::<f32, 4>(v, chain, params, texture_of, footprints, colors),
    }
}

fn run<T: Sample, const C: usize>(
    base: &[T],
    chain: &MipChain<'_>,
    params: &SampleParams,
    texture_of: &[u32],
    footprints: &[Footprint],
    colors: &mut [f32],
) {
    let stride = params.channels as usize;
    let texture = Texture::<T, C> {
        base,
        size: [chain.image.width, chain.image.height],
        levels: &chain.levels,
        wrap: chain.wrap,
        encoding: chain.encoding,
    };
    footprints.par_chunks(TASK).zip(colors.par_chunks_mut(TASK * stride)).for_each(|(footprints, colors)| {
        for (f, out) in footprints.iter().zip(colors.chunks_exact_mut(stride)) {
            if f.face != NONE && texture_of[f.face as usize] == params.texture {
                widen(&texture.sample(f, params), out);
            }
        }
    });
}

/// Writes a colour into a wider one: grey to all of RGB, alpha 1 where there was none.
#[inline(always)]
pub(super) fn widen(color: &[f32], out: &mut [f32]) {
    match (color.len(), out.len()) {
        (1, n) => {
            out.fill(color[0]);
            if n.is_multiple_of(2) {
                out[n - 1] = 1.0;
            }
        }
        (2, 4) => {
            out[..3].fill(color[0]);
            out[3] = color[1];
        }
        (3, 4) => {
            out[..3].copy_from_slice(color);
            out[3] = 1.0;
        }
        _ => out.copy_from_slice(color),
    }
}

/// [`widen`] for stored samples, of which `full` is the largest.
#[inline(always)]
pub(super) fn widen_samples<T: Copy>(color: &[T], out: &mut [T], full: T) {
    let (n, m) = (color.len(), out.len());
    let colors = if n.is_multiple_of(2) { n - 1 } else { n };
    let out_colors = if m.is_multiple_of(2) { m - 1 } else { m };
    for (c, out) in out[..out_colors].iter_mut().enumerate() {
        *out = color[c.min(colors - 1)];
    }
    if out_colors < m {
        out[m - 1] = if colors < n { color[n - 1] } else { full };
    }
}

/// A chain whose samples have one type and number.
pub(super) struct Texture<'a, T, const C: usize> {
    base: &'a [T],
    pub(super) size: [u32; 2],
    pub(super) levels: &'a [Level],
    wrap: [Wrap; 2],
    encoding: Encoding,
}

impl<T: Sample, const C: usize> Texture<'_, T, C> {
    fn sample(&self, f: &Footprint, params: &SampleParams) -> [f32; C] {
        let size = self.size.map(|n| n as f32);
        let scaled = |v: [f32; 2]| [v[0] * size[0], v[1] * size[1]];
        let centre = scaled([0, 1].map(|a| near_picture(f.centre[a], self.wrap[a])));
        let (dx, dy) = (scaled(f.dx), scaled(f.dy));
        match params.filter {
            Filter::Ewa => self.elliptical(centre, dx, dy),
            Filter::Nearest => self.nearest(centre),
            Filter::Lanczos => self.windowed::<6>(LanczosTable::<6>::get(), centre),
            Filter::Lanczos4 => self.windowed::<8>(LanczosTable::<8>::get(), centre),
            filter @ (Filter::Anisotropic | Filter::Trilinear | Filter::Bilinear) => {
                self.tapped(&Taps::new(centre, dx, dy, filter, params.taps))
            }
        }
    }

    /// The mean of boxes of the chain.
    fn tapped(&self, taps: &Taps) -> [f32; C] {
        let level = taps.level.min(self.levels.len() as f32);
        let lower = floor(level).max(0) as usize;
        let fraction = level - lower as f32;
        // Half of the reads are saved where they would not show.
        let fraction = if fraction > SLACK { fraction } else { 0.0 };
        let mut sum = [0.0; C];
        let share = 1.0 / (taps.count[0] * taps.count[1]) as f32;
        for j in 0..taps.count[1] {
            for i in 0..taps.count[0] {
                let p = taps.place(i, j);
                let mut color = self.bilinear(lower, p);
                if fraction > 0.0 {
                    let above = self.bilinear(lower + 1, p);
                    for c in 0..C {
                        color[c] += fraction * (above[c] - color[c]);
                    }
                }
                for c in 0..C {
                    sum[c] += share * color[c];
                }
            }
        }
        sum
    }

    /// The four texels of a level around a point given in texels of level 0.
    #[inline(always)]
    fn bilinear(&self, level: usize, p: [f32; 2]) -> [f32; C] {
        if level == 0 {
            bilinear(self.size, self.wrap, p, |t| self.decoded(t))
        } else {
            let l = &self.levels[level - 1];
            let q = [0, 1].map(|a| p[a] * ([l.width, l.height][a] as f32 / self.size[a] as f32));
            bilinear([l.width, l.height], self.wrap, q, |t| level_texel(l, t))
        }
    }

    /// Texel `index` of level 0.
    #[inline(always)]
    fn decoded(&self, index: usize) -> [f32; C] {
        self.encoding.decode::<T, C>(&self.base[index * C..index * C + C])
    }

    /// The texel of `level` that stands for one of its plane.
    #[inline(always)]
    pub(super) fn texel(&self, level: usize, x: i32, y: i32) -> [f32; C] {
        let [width, height] = self.level_size(level);
        let index = wrapped(y, height, self.wrap[1]) * width as usize + wrapped(x, width, self.wrap[0]);
        if level == 0 { self.decoded(index) } else { level_texel(&self.levels[level - 1], index) }
    }

    /// Texels per row, and rows, of a level.
    pub(super) fn level_size(&self, level: usize) -> [u32; 2] {
        if level == 0 { self.size } else { [self.levels[level - 1].width, self.levels[level - 1].height] }
    }
}

#[inline(always)]
fn level_texel<const C: usize>(level: &Level, index: usize) -> [f32; C] {
    let mut texel = [0.0; C];
    texel.copy_from_slice(&level.texels[index * C..index * C + C]);
    texel
}

#[inline(always)]
fn bilinear<const C: usize>(
    size: [u32; 2],
    wrap: [Wrap; 2],
    p: [f32; 2],
    texel: impl Fn(usize) -> [f32; C],
) -> [f32; C] {
    let x = p[0] - 0.5;
    let y = p[1] - 0.5;
    let (fx, fy) = (floor(x), floor(y));
    let (wx, wy) = (x - fx as f32, y - fy as f32);
    let (x0, x1) = (wrapped(fx, size[0], wrap[0]), wrapped(fx.saturating_add(1), size[0], wrap[0]));
    let w = size[0] as usize;
    let (y0, y1) = (wrapped(fy, size[1], wrap[1]) * w, wrapped(fy.saturating_add(1), size[1], wrap[1]) * w);
    let (t00, t01, t10, t11) = (texel(y0 + x0), texel(y0 + x1), texel(y1 + x0), texel(y1 + x1));
    let mut out = [0.0; C];
    for c in 0..C {
        let top = t00[c] + wx * (t01[c] - t00[c]);
        let bottom = t10[c] + wx * (t11[c] - t10[c]);
        out[c] = top + wy * (bottom - top);
    }
    out
}
