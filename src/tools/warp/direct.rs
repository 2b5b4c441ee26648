//! Bilinear interpolation of samples as they are stored: four are read for a pixel, too few to
//! decode them all beforehand.

use super::footprint::{Bounds, Seen};
use super::gather::{Block, Extent};
use super::interpolate::{Bilinear, Grid, Texels, interpolate};
use super::pyramid::{OnSamples, Pyramid, Texel, pair};
use crate::engine::{Lane, Lanes, Sweep};
use crate::tools::transfer::color::Sample;
use crate::tools::transfer::{Alpha, Encoding};

/// Largest part of the picture that a block may see here, along each side: places in it are exact
/// in single precision.
const WIDEST: usize = 1 << 20;

/// The colours of a block that sees nothing beyond the picture, bit for bit as from a window.
/// `false`, with nothing done, where it sees more, or where decoding costs more than reading (light
/// is looked up).
pub(super) fn bilinear(pyramid: &Pyramid<'_>, block: &Block<'_>, bounds: &Bounds, out: &mut [Texel]) -> bool {
    if pyramid.encoding().linear_light || bounds.pixels == 0 {
        return false;
    }
    let extent = Extent::within(bounds, <Bilinear as super::interpolate::Interpolation<&[Texel]>>::REACH);
    let image = pyramid.image();
    let size = [image.width, image.height];
    let inside = (0..2).all(|a| {
        let low = i64::from(extent.low[a]) + i64::from(block.base[a]);
        let high = i64::from(extent.high[a]) + i64::from(block.base[a]);
        low >= 0 && high <= i64::from(size[a]) && extent.size()[a] <= WIDEST
    });
    if !inside {
        return false;
    }
    let origin = [0, 1].map(|a| (i64::from(extent.low[a]) + i64::from(block.base[a])) as usize);
    let shift = extent.low.map(|low| -(low as f32));
    let first = origin[1] * image.width as usize + origin[0];
    pyramid.visit(Direct {
        seen: &block.seen,
        first,
        stride: image.width as usize,
        shift,
        encoding: pyramid.encoding(),
        out,
    });
    true
}

/// What is to be done once the kind of samples is known.
struct Direct<'a> {
    seen: &'a Seen<'a>,
    first: usize,
    stride: usize,
    shift: [f32; 2],
    encoding: Encoding,
    out: &'a mut [Texel],
}

impl OnSamples for Direct<'_> {
    fn run<T: Sample, const C: usize>(self, samples: &[T]) {
        let samples = &samples[self.first * C..];
        if self.encoding.alpha == Alpha::Opacity && C.is_multiple_of(2) {
            Lanes::detect().run(Apply::<T, C, true> { job: self, samples });
        } else {
            Lanes::detect().run(Apply::<T, C, false> { job: self, samples });
        }
    }
}

struct Apply<'a, T, const C: usize, const PREMULTIPLY: bool> {
    job: Direct<'a>,
    samples: &'a [T],
}

impl<T: Sample, const C: usize, const PREMULTIPLY: bool> Sweep<f32> for Apply<'_, T, C, PREMULTIPLY> {
    #[inline(always)]
    fn run<L: Lane<E = f32>>(self, cpu: L::Cpu) {
        let Direct { seen, stride, shift, out, .. } = self.job;
        let texels = Stored::<T, C, PREMULTIPLY>(self.samples);
        interpolate::<L, _, _>(cpu, &Bilinear, &Grid { texels, stride, shift }, seen, out);
    }
}

/// Stored samples, decoded as they are read.
#[derive(Clone, Copy)]
struct Stored<'a, T, const C: usize, const PREMULTIPLY: bool>(&'a [T]);

impl<T: Sample, const C: usize, const PREMULTIPLY: bool> Texels for Stored<'_, T, C, PREMULTIPLY> {
    #[inline(always)]
    fn pair<L: Lane<E = f32>>(self, cpu: L::Cpu, at: usize) -> [Texel; 2] {
        let alpha = if PREMULTIPLY { Alpha::Opacity } else { Alpha::Data };
        pair::<L, T, C>(cpu, self.0, at, Encoding { linear_light: false, alpha })
    }
}
