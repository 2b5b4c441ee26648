//! Colours into the output picture: its depth and channels, and what lies outside the cage.

use rayon::prelude::*;

use super::band::Band;
use super::gather::Preimage;
use super::pyramid::Texel;
use crate::raster::{Image, Pixels};
use crate::tools::transfer::color::Sample;
use crate::tools::transfer::{Alpha, Encoding};

/// What the output shows outside the target cage, and in its holes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Outside {
    /// The map as it continues there: mean value coordinates are defined in the whole plane.
    #[default]
    Map,
    /// The picture as it was.
    Keep,
    /// Nothing: a picture without alpha gets it.
    Transparent,
}

impl Outside {
    /// Name on the command line and in reports.
    pub fn word(self) -> &'static str {
        match self {
            Self::Map => "map",
            Self::Keep => "keep",
            Self::Transparent => "transparent",
        }
    }
}

/// A band of colours with what each pixel keeps of the original picture.
#[derive(Clone, Copy, Debug)]
pub struct Colors<'a> {
    /// The rows.
    pub band: Band,
    /// Pre-images, for their cover; in the order of the band.
    pub preimages: &'a [Preimage],
    /// Colours, in the order of the band.
    pub colors: &'a [Texel],
    /// Cover of the target cage, row by row, where the rest is the original picture.
    pub keep: Option<&'a [f32]>,
}

/// Writes a band into `out`, which has the depth of `image` and its channels, or alpha more.
///
/// Colours are mixed as they are averaged: multiplied by alpha, as light if the encoding says so. What is kept whole is copied
/// sample by sample.
pub fn store(image: &Image, encoding: Encoding, colors: &Colors<'_>, out: &mut Image) {
    let alpha = out.channels > image.channels;
    match (&image.pixels, &mut out.pixels, image.channels) {
        (Pixels::U8(a), Pixels::U8(b), 1) => rows::<u8, 1>(image, a, encoding, colors, alpha, b),
        (Pixels::U8(a), Pixels::U8(b), 2) => rows::<u8, 2>(image, a, encoding, colors, alpha, b),
        (Pixels::U8(a), Pixels::U8(b), 3) => rows::<u8, 3>(image, a, encoding, colors, alpha, b),
        (Pixels::U8(a), Pixels::U8(b), _) => rows::<u8, 4>(image, a, encoding, colors, alpha, b),
        (Pixels::U16(a), Pixels::U16(b), 1) => rows::<u16, 1>(image, a, encoding, colors, alpha, b),
        (Pixels::U16(a), Pixels::U16(b), 2) => rows::<u16, 2>(image, a, encoding, colors, alpha, b),
        (Pixels::U16(a), Pixels::U16(b), 3) => rows::<u16, 3>(image, a, encoding, colors, alpha, b),
        (Pixels::U16(a), Pixels::U16(b), _) => rows::<u16, 4>(image, a, encoding, colors, alpha, b),
        (Pixels::F32(a), Pixels::F32(b), 1) => rows::<f32, 1>(image, a, encoding, colors, alpha, b),
        (Pixels::F32(a), Pixels::F32(b), 2) => rows::<f32, 2>(image, a, encoding, colors, alpha, b),
        (Pixels::F32(a), Pixels::F32(b), 3) => rows::<f32, 3>(image, a, encoding, colors, alpha, b),
        (Pixels::F32(a), Pixels::F32(b), _) => rows::<f32, 4>(image, a, encoding, colors, alpha, b),
        // The driver makes the output with the depth of the picture.
        _ => {}
    }
}

fn rows<T: Sample, const C: usize>(
    image: &Image,
    samples: &[T],
    encoding: Encoding,
    colors: &Colors<'_>,
    alpha: bool,
    out: &mut [T],
) {
    let band = &colors.band;
    let stride = C + usize::from(alpha);
    let row = band.width * stride;
    let target = &mut out[band.first * row..(band.first + band.rows) * row];
    target.par_chunks_mut(row).enumerate().for_each(|(y, target)| {
        let line = band.first + y;
        let kept = |x: usize| -> Option<&[T]> {
            let inside = line < image.height as usize && x < image.width as usize;
            inside.then(|| &samples[(line * image.width as usize + x) * C..][..C])
        };
        for (x, target) in target.chunks_exact_mut(stride).enumerate() {
            let at = band.index(x, y);
            let share = colors.preimages[at].cover;
            let keep = colors.keep.map_or(0.0, |cover| 1.0 - cover[y * band.width + x]);
            if keep >= 1.0 {
                match kept(x) {
                    Some(original) => {
                        target[..C].copy_from_slice(original);
                        if alpha {
                            target[C] = T::encode(1.0, false);
                        }
                    }
                    None => target.fill(T::default()),
                }
                continue;
            }
            let mut color = colors.colors[at];
            let mut opacity = 1.0;
            if share < 1.0 {
                let original: [f32; C] = match kept(x) {
                    Some(original) if keep > 0.0 => encoding.decode(original),
                    _ => [0.0; C],
                };
                opacity = share + if kept(x).is_some() { keep } else { 0.0 };
                for c in 0..C {
                    color[c] = if share > 0.0 { share * color[c] } else { 0.0 } + keep * original[c];
                }
            }
            encode::<T, C>(color, opacity, encoding, target);
        }
    });
}

/// One pixel: colours divided by alpha, rounded to the depth.
#[inline(always)]
fn encode<T: Sample, const C: usize>(color: Texel, opacity: f32, encoding: Encoding, out: &mut [T]) {
    let light = encoding.linear_light;
    let own = C.is_multiple_of(2);
    let colors = if own { C - 1 } else { C };
    let alpha = if own { color[C - 1].clamp(0.0, 1.0) } else { opacity };
    let straight = if own { encoding.alpha == Alpha::Opacity } else { out.len() > C };
    let factor = if !straight {
        1.0
    } else if alpha > 0.0 {
        1.0 / alpha
    } else {
        0.0
    };
    for c in 0..colors {
        out[c] = T::encode(color[c] * factor, light);
    }
    if own {
        out[C - 1] = T::encode(if straight { alpha } else { color[C - 1] }, false);
    } else if straight {
        out[C] = T::encode(alpha, false);
    }
}
