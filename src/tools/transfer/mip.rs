//! Mip chains: a texture averaged over ever larger boxes.

use std::sync::Arc;

use rayon::prelude::*;

use super::color::Sample;
use crate::error::Result;
use crate::geometry::Wrap;
use crate::picture::{Depth, Image, Pixels};

/// What the last of 2 or 4 channels means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Alpha {
    /// Opacity: colours are weighted by it (premultiplied) before they are averaged.
    #[default]
    Opacity,
    /// One more channel of data.
    Data,
}

/// How stored samples become values to average.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Encoding {
    /// Colour channels of 8 and 16 bits hold sRGB values and are averaged as light; floats hold
    /// light already.
    pub linear_light: bool,
    /// Meaning of the last of 2 or 4 channels.
    pub alpha: Alpha,
}

impl Encoding {
    /// Decodes the channels of one texel: light if asked for, colours premultiplied.
    #[inline(always)]
    pub(crate) fn decode<T: Sample, const C: usize>(self, texel: &[T]) -> [f32; C] {
        let mut out = [0.0; C];
        let colors = if C.is_multiple_of(2) { C - 1 } else { C };
        for (c, out) in out.iter_mut().enumerate() {
            *out = texel[c].decode(self.linear_light && c < colors);
        }
        if colors < C && self.alpha == Alpha::Opacity {
            let a = out[C - 1];
            for c in &mut out[..colors] {
                *c *= a;
            }
        }
        out
    }
}

/// One level above the picture itself.
#[derive(Clone, Debug)]
pub struct Level {
    /// Texels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Decoded, premultiplied texels.
    pub texels: Vec<f32>,
}

/// A picture and its averages over 2 x 2, 4 x 4 ... texels, down to one texel.
///
/// Each side is halved and rounded down; a texel of a level is the exact average of the box of the
/// level below that it covers, also where a side is odd (then it reaches over parts of three
/// texels), so every level has the mean of the picture.
#[derive(Clone, Debug)]
pub struct MipChain<'a> {
    /// Level 0, as stored.
    pub image: &'a Image,
    /// How its samples are read.
    pub encoding: Encoding,
    /// Levels 1, 2, ..., which clones share.
    pub levels: Arc<[Level]>,
    /// What it shows beyond its borders, along u and along v.
    pub wrap: [Wrap; 2],
}

impl<'a> MipChain<'a> {
    /// The chain of `image`, which repeats. O(texels), 4/3 bytes per sample of memory (f32, a third
    /// as many as in the picture).
    ///
    /// # Errors
    /// If the picture's sizes and samples do not fit together.
    pub fn new(image: &'a Image, encoding: Encoding) -> Result<Self> {
        image.check("texture")?;
        let levels = match (&image.pixels, image.channels) {
            (Pixels::U8(v), 1) => levels::<u8, 1>(v, image, encoding),
            (Pixels::U8(v), 2) => levels::<u8, 2>(v, image, encoding),
            (Pixels::U8(v), 3) => levels::<u8, 3>(v, image, encoding),
            (Pixels::U8(v), _) => levels::<u8, 4>(v, image, encoding),
            (Pixels::U16(v), 1) => levels::<u16, 1>(v, image, encoding),
            (Pixels::U16(v), 2) => levels::<u16, 2>(v, image, encoding),
            (Pixels::U16(v), 3) => levels::<u16, 3>(v, image, encoding),
            (Pixels::U16(v), _) => levels::<u16, 4>(v, image, encoding),
            (Pixels::F32(v), 1) => levels::<f32, 1>(v, image, encoding),
            (Pixels::F32(v), 2) => levels::<f32, 2>(v, image, encoding),
            (Pixels::F32(v), 3) => levels::<f32, 3>(v, image, encoding),
            (Pixels::F32(v), _) => levels::<f32, 4>(v, image, encoding),
        };
        Ok(Self { image, encoding, levels: levels.into(), wrap: [Wrap::Repeat; 2] })
    }

    /// Number of levels, the picture included.
    pub fn level_count(&self) -> u32 {
        self.levels.len() as u32 + 1
    }

    /// Bytes that the levels above a picture take.
    pub fn bytes(width: u32, height: u32, channels: u32) -> u64 {
        let (mut w, mut h, mut sum) = (u64::from(width), u64::from(height), 0);
        while w > 1 || h > 1 {
            (w, h) = ((w / 2).max(1), (h / 2).max(1));
            sum += w * h;
        }
        sum * u64::from(channels) * 4
    }

    /// Depth of the picture.
    pub fn depth(&self) -> Depth {
        self.image.depth()
    }
}

/// First texel and weights of the box that texel `i` of a halved side covers on a side of `n`
/// texels.
#[inline]
fn taps(i: usize, n: usize) -> (usize, [f32; 3]) {
    if n == 1 {
        return (0, [1.0, 0.0, 0.0]);
    }
    if n.is_multiple_of(2) {
        return (2 * i, [0.5, 0.5, 0.0]);
    }
    // The box is [i n / m, (i + 1) n / m] with n = 2 m + 1.
    let m = n / 2;
    let inverse = 1.0 / n as f32;
    (2 * i, [(m - i) as f32 * inverse, m as f32 * inverse, (i + 1) as f32 * inverse])
}

fn levels<T: Sample, const C: usize>(base: &[T], image: &Image, encoding: Encoding) -> Vec<Level> {
    let mut out: Vec<Level> = Vec::new();
    let (mut w, mut h) = (image.width as usize, image.height as usize);
    while w > 1 || h > 1 {
        let level = match out.last() {
            None => halve::<C>(w, h, |t| encoding.decode::<T, C>(&base[t * C..t * C + C])),
            Some(below) => halve::<C>(w, h, |t| {
                let mut texel = [0.0; C];
                texel.copy_from_slice(&below.texels[t * C..t * C + C]);
                texel
            }),
        };
        (w, h) = (level.width as usize, level.height as usize);
        out.push(level);
    }
    out
}

/// The level above one of `w` x `h` texels.
fn halve<const C: usize>(w: usize, h: usize, texel: impl Fn(usize) -> [f32; C] + Sync) -> Level {
    let (width, height) = ((w / 2).max(1), (h / 2).max(1));
    let mut texels = vec![0.0_f32; width * height * C];
    texels.par_chunks_mut(width * C).enumerate().for_each(|(y, row)| {
        let (y0, wy) = taps(y, h);
        for (x, out) in row.chunks_exact_mut(C).enumerate() {
            let (x0, wx) = taps(x, w);
            for (j, wy) in wy.into_iter().enumerate().filter(|(_, w)| *w != 0.0) {
                for (i, wx) in wx.into_iter().enumerate().filter(|(_, w)| *w != 0.0) {
                    let t = texel((y0 + j) * w + x0 + i);
                    for c in 0..C {
                        out[c] += wx * wy * t[c];
                    }
                }
            }
        }
    });
    Level { width: width as u32, height: height as u32, texels }
}
