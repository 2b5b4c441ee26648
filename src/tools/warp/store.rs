//! Colours into the output picture: its depth and channels, and what lies outside the cage.

use rayon::prelude::*;

use super::band::{BLOCK, Band, Place};
use super::footprint::Seen;
use super::gather::{Block, warp_image};
use super::pyramid::{Pyramid, Texel, Window};
use crate::engine::{Lane, Lanes, Sweep};
use crate::picture::Filter;
use crate::picture::{Image, Pixels};
use crate::tools::transfer::color::Sample;
use crate::tools::transfer::{Alpha, Encoding};
use crate::words::words;

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

words! { Outside, "outside", "something to show outside":
    Map => "map",
    Keep => "keep",
    Transparent => "transparent",
}

/// A band of pixels with what each keeps of the original picture.
#[derive(Clone, Copy, Debug)]
pub struct Colors<'a> {
    /// The rows.
    pub band: Band,
    /// Where they look; in the order of the band.
    pub seen: Seen<'a>,
    /// Cover of the target cage, row by row, where the rest is the original picture.
    pub keep: Option<&'a [f32]>,
}

/// Where the colours of a band come from.
#[derive(Clone, Copy, Debug)]
enum Origin<'a> {
    /// They are there, in the order of the band.
    Given(&'a [Texel]),
    /// They are gathered block by block, by a filter from bases.
    Gathered(Filter, &'a [[i32; 2]]),
}

/// Writes the colours of a band into `out`, which has the depth of the pyramid's picture and its
/// channels, or alpha more.
///
/// Colours are mixed as they are averaged: multiplied by alpha, as light if the encoding says so.
/// What is kept whole is copied sample by sample.
pub fn store(pyramid: &Pyramid<'_>, colors: &[Texel], pixels: &Colors<'_>, out: &mut Image) {
    write(pyramid, Origin::Given(colors), pixels, out);
}

/// [`Band::gather`] and [`store`] at once: each block's colours are written while they are in the
/// fastest cache.
pub fn gather_and_store(
    pyramid: &Pyramid<'_>,
    filter: Filter,
    bases: &[[i32; 2]],
    pixels: &Colors<'_>,
    out: &mut Image,
) {
    write(pyramid, Origin::Gathered(filter, bases), pixels, out);
}

fn write(pyramid: &Pyramid<'_>, origin: Origin<'_>, pixels: &Colors<'_>, out: &mut Image) {
    let image = pyramid.image();
    let alpha = out.channels > image.channels;
    match (&image.pixels, &mut out.pixels, image.channels) {
        (Pixels::U8(a), Pixels::U8(b), 1) => Writer::<u8, 1> { pyramid, samples: a, alpha }.band(origin, pixels, b),
        (Pixels::U8(a), Pixels::U8(b), 2) => Writer::<u8, 2> { pyramid, samples: a, alpha }.band(origin, pixels, b),
        (Pixels::U8(a), Pixels::U8(b), 3) => Writer::<u8, 3> { pyramid, samples: a, alpha }.band(origin, pixels, b),
        (Pixels::U8(a), Pixels::U8(b), _) => Writer::<u8, 4> { pyramid, samples: a, alpha }.band(origin, pixels, b),
        (Pixels::U16(a), Pixels::U16(b), 1) => Writer::<u16, 1> { pyramid, samples: a, alpha }.band(origin, pixels, b),
        (Pixels::U16(a), Pixels::U16(b), 2) => Writer::<u16, 2> { pyramid, samples: a, alpha }.band(origin, pixels, b),
        (Pixels::U16(a), Pixels::U16(b), 3) => Writer::<u16, 3> { pyramid, samples: a, alpha }.band(origin, pixels, b),
        (Pixels::U16(a), Pixels::U16(b), _) => Writer::<u16, 4> { pyramid, samples: a, alpha }.band(origin, pixels, b),
        (Pixels::F32(a), Pixels::F32(b), 1) => Writer::<f32, 1> { pyramid, samples: a, alpha }.band(origin, pixels, b),
        (Pixels::F32(a), Pixels::F32(b), 2) => Writer::<f32, 2> { pyramid, samples: a, alpha }.band(origin, pixels, b),
        (Pixels::F32(a), Pixels::F32(b), 3) => Writer::<f32, 3> { pyramid, samples: a, alpha }.band(origin, pixels, b),
        (Pixels::F32(a), Pixels::F32(b), _) => Writer::<f32, 4> { pyramid, samples: a, alpha }.band(origin, pixels, b),
        // The driver makes the output with the depth of the picture.
        _ => {}
    }
}

/// Writes samples of one kind.
struct Writer<'a, T, const C: usize> {
    pyramid: &'a Pyramid<'a>,
    samples: &'a [T],
    /// Whether the output has alpha, which the picture has not.
    alpha: bool,
}

impl<T: Round, const C: usize> Writer<'_, T, C> {
    /// Samples of a pixel.
    fn stride(&self) -> usize {
        C + usize::from(self.alpha)
    }

    fn band(&self, origin: Origin<'_>, pixels: &Colors<'_>, out: &mut [T]) {
        let band = &pixels.band;
        let row = band.width * self.stride();
        let target = &mut out[band.first * row..(band.first + band.rows) * row];
        let places = band.places();
        // The rows of each block, which lie apart in the picture.
        let across = band.width.div_ceil(BLOCK);
        let mut parts: Vec<Vec<&mut [T]>> = places.iter().map(|p| Vec::with_capacity(p.height)).collect();
        for (y, line) in target.chunks_mut(row).enumerate() {
            for (k, part) in line.chunks_mut(BLOCK * self.stride()).enumerate() {
                parts[y / BLOCK * across + k].push(part);
            }
        }
        let work = |(window, own): &mut (Window, Vec<Texel>), ((k, place), part): ((usize, &Place), Vec<&mut [T]>)| {
            let range = place.start..place.start + place.width * place.height;
            let seen = pixels.seen.part(range.clone());
            let colors = match origin {
                Origin::Given(colors) => &colors[range],
                Origin::Gathered(filter, bases) => {
                    own.resize(BLOCK * BLOCK, [0.0; 4]);
                    let block = Block { width: place.width, base: bases[k], seen };
                    warp_image(self.pyramid, filter, &block, window, &mut own[..seen.len()]);
                    &own[..seen.len()]
                }
            };
            if self.is_plain(seen.cover()) && pixels.keep.is_none() {
                let (alpha, width) = (self.pyramid.encoding().alpha, place.width);
                Lanes::detect().run(Plain::<T, C> { colors, width, alpha, out: part });
                return;
            }
            for (j, out) in part.into_iter().enumerate() {
                let run = j * place.width..(j + 1) * place.width;
                let keep = pixels.keep.map(|k| &k[(place.y + j) * band.width + place.x..][..place.width]);
                let at = [place.x, band.first + place.y + j];
                self.run(at, &seen.cover()[run.clone()], &colors[run], keep, out);
            }
        };
        let init = || (Window::default(), Vec::new());
        places.par_iter().enumerate().zip(parts).for_each_init(init, work);
    }

    /// Whether there is no question about any of the pixels: they are covered whole, and stored
    /// values are written.
    fn is_plain(&self, cover: &[f32]) -> bool {
        let whole = cover.iter().fold(true, |all, c| all & (*c >= 1.0));
        whole && !self.alpha && !self.pyramid.encoding().linear_light
    }

    /// Pixels of one row from column and row `at` of the picture on.
    fn run(&self, at: [usize; 2], cover: &[f32], colors: &[Texel], keep: Option<&[f32]>, out: &mut [T]) {
        let encoding = self.pyramid.encoding();
        let image = self.pyramid.image();
        let kept = |x: usize| -> Option<&[T]> {
            let inside = at[1] < image.height as usize && x < image.width as usize;
            inside.then(|| &self.samples[(at[1] * image.width as usize + x) * C..][..C])
        };
        for (i, target) in out.chunks_exact_mut(self.stride()).enumerate() {
            let original = kept(at[0] + i);
            let share = cover[i];
            let keep = keep.map_or(0.0, |cover| 1.0 - cover[i]);
            if keep >= 1.0 {
                match original {
                    Some(original) => {
                        target[..C].copy_from_slice(original);
                        if self.alpha {
                            target[C] = T::encode(1.0, false);
                        }
                    }
                    None => target.fill(T::default()),
                }
                continue;
            }
            let mut color = colors[i];
            let mut opacity = 1.0;
            if share < 1.0 {
                let decoded: [f32; C] = match original {
                    Some(original) if keep > 0.0 => encoding.decode(original),
                    _ => [0.0; C],
                };
                opacity = share + if original.is_some() { keep } else { 0.0 };
                for c in 0..C {
                    color[c] = if share > 0.0 { share * color[c] } else { 0.0 } + keep * decoded[c];
                }
            }
            encode::<T, C>(color, opacity, encoding, target);
        }
    }
}

/// The common case of a block.
struct Plain<'a, T, const C: usize> {
    colors: &'a [Texel],
    /// Pixels in a row of the block.
    width: usize,
    alpha: Alpha,
    /// Its rows in the picture.
    out: Vec<&'a mut [T]>,
}

impl<T: Round, const C: usize> Sweep<f32> for Plain<'_, T, C> {
    #[inline(always)]
    fn run<L: Lane<E = f32>>(self, _cpu: L::Cpu) {
        for (colors, out) in self.colors.chunks(self.width).zip(self.out) {
            for (color, out) in colors.iter().zip(out.chunks_exact_mut(C)) {
                let mut color = *color;
                if C.is_multiple_of(2) && self.alpha == Alpha::Opacity {
                    let a = color[C - 1].clamp(0.0, 1.0);
                    let factor = if a > 0.0 { 1.0 / a } else { 0.0 };
                    for c in 0..C - 1 {
                        color[c] *= factor;
                    }
                    color[C - 1] = a;
                }
                // All four at once, whatever the picture has.
                let rounded = T::round(color);
                out.copy_from_slice(&rounded[..C]);
            }
        }
    }
}

/// Rounding without a conversion: beyond 2^23 the numbers of single precision are the whole ones,
/// in the order of their bits.
trait Round: Sample {
    /// The nearest samples to stored values; halves go to the even one.
    fn round(values: [f32; 4]) -> [Self; 4];
}

const WHOLE: f32 = 8_388_608.0;

impl Round for u8 {
    #[inline(always)]
    fn round(values: [f32; 4]) -> [Self; 4] {
        values.map(|v| ((v * 255.0).clamp(0.0, 255.0) + WHOLE).to_bits() as Self)
    }
}

impl Round for u16 {
    #[inline(always)]
    fn round(values: [f32; 4]) -> [Self; 4] {
        values.map(|v| ((v * 65535.0).clamp(0.0, 65535.0) + WHOLE).to_bits() as Self)
    }
}

impl Round for f32 {
    #[inline(always)]
    fn round(values: [f32; 4]) -> [Self; 4] {
        values
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_is_to_the_nearest_sample() {
        for i in 0..=u16::MAX {
            assert_eq!(u16::round([i.decode(false); 4]), [i; 4]);
            for off in [-0.49, 0.49] {
                let value = (f32::from(i) + off) / 65535.0;
                assert!(u16::round([value; 4])[2].abs_diff(u16::encode(value, false)) <= 1);
            }
        }
        for i in 0..=u8::MAX {
            for off in [-0.49, 0.0, 0.49] {
                assert_eq!(u8::round([(f32::from(i) + off) / 255.0; 4]), [i; 4]);
            }
        }
        for (value, byte) in [(-3.0, 0), (7.0, 255), (f32::NAN, 0), (f32::INFINITY, 255), (f32::NEG_INFINITY, 0)] {
            assert_eq!(u8::round([value; 4]), [byte; 4], "{value}");
        }
    }
}
