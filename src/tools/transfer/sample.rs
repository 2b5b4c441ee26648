//! `sample_texture`: the colour of a texel, averaged over its footprint on the source's texture.
//!
//! The footprint's matrix takes the texel's square to a parallelogram, read as an ellipse with its
//! singular values as widths. Taps are spread along its wide side (Schilling, Knittel and Strasser
//! 1996, "Texram"; EXT_texture_filter_anisotropic) and, unlike there, two across its narrow side:
//! boxes of half its width put together are much closer to the footprint than one blurred box of
//! all of it (25 against 17 dB on a chequered texture reduced four times, see the tests).

use rayon::prelude::*;

use super::color::Sample;
use super::footprint::Footprint;
use super::mip::{Encoding, Level, MipChain};
use crate::geometry::{NONE, Wrap};
use crate::raster::Pixels;
use crate::words::words;

/// Footprints up to this much wider than a texel, or than a whole number of narrow sides, count as
/// no wider, so that rounding does not blur.
pub(super) const SLACK: f32 = 1.0 / 64.0;
/// Footprints wider than this many texels see the mean of the whole picture.
pub(super) const LARGEST_FOOTPRINT: f32 = 1e6;
/// Texels of one parallel task.
const TASK: usize = 4096;

/// How a texture is averaged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Filter {
    /// Over the footprint: levels of a mip chain along its narrow side, up to 16 taps along the
    /// wide one.
    #[default]
    Anisotropic,
    /// Levels of a mip chain by the wide side of the footprint: blurs where it is much wider than
    /// narrow.
    Trilinear,
    /// Four texels of the picture whatever the footprint: flickers and aliases where the texture is
    /// reduced.
    Bilinear,
}

words! { Filter, "filter", "a filter":
    Anisotropic => "anisotropic",
    Trilinear => "trilinear",
    Bilinear => "bilinear",
}

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

/// The level and the taps of a footprint, in texels of level 0.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Taps {
    /// Where they are centred.
    centre: [f32; 2],
    /// Level of the mip chain, with fraction.
    level: f32,
    /// Number of taps along and across.
    count: [u32; 2],
    /// The sides of the ellipse, wide and narrow, over which they are spread.
    sides: [[f32; 2]; 2],
}

impl Taps {
    #[inline]
    fn new(f: &Footprint, size: [u32; 2], wrap: [Wrap; 2], params: &SampleParams) -> Self {
        let s = size.map(|n| n as f32);
        let centre = [0, 1].map(|a| near_picture(f.centre[a], wrap[a]) * s[a]);
        let one = |level: f32| Self { centre, level, count: [1; 2], sides: [[0.0; 2]; 2] };
        if params.filter == Filter::Bilinear {
            return one(0.0);
        }
        let (dx, dy) = ([f.dx[0] * s[0], f.dx[1] * s[1]], [f.dy[0] * s[0], f.dy[1] * s[1]]);
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
        if params.filter == Filter::Trilinear {
            return one(wide.log2());
        }
        // The product of the widths is the determinant: no cancellation.
        let narrow = (dx[0] * dy[1] - dx[1] * dy[0]).abs() / wide;
        let most = params.taps.clamp(1, 16) as f32;
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
    fn place(&self, i: u32, j: u32) -> [f32; 2] {
        let at = |k: u32, n: u32| (k as f32 + 0.5) / n as f32 - 0.5;
        let (s, t) = (at(i, self.count[0]), at(j, self.count[1]));
        [0, 1].map(|a| self.centre[a] + s * self.sides[0][a] + t * self.sides[1][a])
    }
}

struct Texture<'a, T, const C: usize> {
    base: &'a [T],
    size: [u32; 2],
    levels: &'a [Level],
    wrap: [Wrap; 2],
    encoding: Encoding,
}

impl<T: Sample, const C: usize> Texture<'_, T, C> {
    fn sample(&self, f: &Footprint, params: &SampleParams) -> [f32; C] {
        let taps = Taps::new(f, self.size, self.wrap, params);
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
            bilinear(self.size, self.wrap, p, |t| self.encoding.decode::<T, C>(&self.base[t * C..t * C + C]))
        } else {
            let l = &self.levels[level - 1];
            let q = [0, 1].map(|a| p[a] * ([l.width, l.height][a] as f32 / self.size[a] as f32));
            bilinear([l.width, l.height], self.wrap, q, |t| {
                let mut texel = [0.0; C];
                texel.copy_from_slice(&l.texels[t * C..t * C + C]);
                texel
            })
        }
    }
}

/// The largest integer not above `x`; without SSE 4.1, `f32::floor` is a call.
#[inline]
fn floor(x: f32) -> i32 {
    let toward_zero = x as i32;
    toward_zero.saturating_sub(i32::from(toward_zero as f32 > x))
}

/// Farther from a picture than this, in its sides, its border is all that a footprint sees.
pub(super) const FAR: f32 = 1000.0;

/// A coordinate that shows the same texels, brought near the picture: far off, the fraction of a
/// texel would be lost, and in the end the range of integers left.
#[inline]
fn near_picture(x: f32, wrap: Wrap) -> f32 {
    match wrap {
        Wrap::Repeat => x - floor(x) as f32,
        Wrap::Mirror => x - 2.0 * floor(0.5 * x) as f32,
        Wrap::Clamp => x.clamp(-FAR, FAR),
    }
}

/// The texel that stands for one beyond the picture.
#[inline]
fn wrapped(index: i32, n: u32, wrap: Wrap) -> usize {
    if (0..n as i32).contains(&index) { index as usize } else { wrap.texel(i64::from(index), n) as usize }
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
