//! Colours for the parts of charts that the map leaves without: interpolated from what surrounds them on the surface.

mod graph;
mod holes;
mod pyramid;
mod smooth;

use rayon::prelude::*;

use super::color::Sample;
use super::mip::Encoding;
use super::seams::SeamPair;
use crate::raster::{Image, Pixels};

use graph::Graph;
pub(super) use holes::Holes;

/// What texels of charts without colour get.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Fill {
    /// The background.
    #[default]
    None,
    /// Averages over ever larger parts of the hole, interpolated back (Gortler, Grzeszczuk, Szeliski and Cohen 1996, "The Lumigraph",
    /// section 3.4.3): fast.
    PullPush,
    /// The harmonic function with the colours around as boundary values: no bump inside, no step at the border.
    Smooth,
}

impl Fill {
    /// Bytes per texel of holes and their borders at most.
    pub(super) fn bytes(self) -> u64 {
        match self {
            Self::None => 0,
            Self::PullPush => 260,
            Self::Smooth => 640,
        }
    }
}

/// Fills the holes of a picture and returns the texels that got a colour. Holes that border on nothing stay as they are.
///
/// Texels are neighbours along rows and columns of a chart, and across `seams`. Colours are mixed decoded and weighted by opacity, as
/// filters do. O(n log n) for n texels of holes.
pub(super) fn fill(
    image: &mut Image,
    holes: &Holes,
    covers: &[u8],
    seams: &[SeamPair],
    how: Fill,
    encoding: Encoding,
) -> Vec<u32> {
    if how == Fill::None || holes.is_empty() {
        return Vec::new();
    }
    let graph = Graph::new(holes, covers, seams, image.width);
    let channels = image.channels as usize;
    // Known texels beside the holes, decoded once; a plane per channel.
    let mut planes = vec![vec![0.0_f64; graph.known.len()]; channels];
    for (k, &texel) in graph.known.iter().enumerate() {
        let mut color = [0.0_f32; 4];
        decode(image, texel as usize, encoding, &mut color[..channels]);
        for (plane, c) in planes.iter_mut().zip(color) {
            plane[k] = f64::from(c);
        }
    }
    let pyramid = pyramid::Pyramid::new(&graph);
    let solve = |known: &Vec<f64>| {
        let (mut values, filled) = pyramid::pull_push(&graph, &pyramid, known);
        if how == Fill::Smooth {
            smooth::solve(&graph, &pyramid, known, &filled, &mut values);
        }
        (values, filled)
    };
    let solved: Vec<(Vec<f64>, Vec<bool>)> = planes.par_iter().map(solve).collect();
    let mut written = Vec::new();
    for (u, &texel) in graph.unknown.iter().enumerate() {
        if !solved[0].1[u] {
            continue;
        }
        let mut color = [0.0_f32; 4];
        for (c, (values, _)) in color.iter_mut().zip(&solved) {
            *c = values[u] as f32;
        }
        encode(image, texel as usize, encoding, &color[..channels]);
        written.push(texel);
    }
    written
}

/// A texel's colour, light if the layer averages light, weighted by opacity.
fn decode(image: &Image, texel: usize, encoding: Encoding, out: &mut [f32]) {
    fn of<T: Sample>(samples: &[T], texel: usize, encoding: Encoding, out: &mut [f32]) {
        let n = out.len();
        let texel = &samples[texel * n..texel * n + n];
        match n {
            1 => out.copy_from_slice(&encoding.decode::<T, 1>(texel)),
            2 => out.copy_from_slice(&encoding.decode::<T, 2>(texel)),
            3 => out.copy_from_slice(&encoding.decode::<T, 3>(texel)),
            _ => out.copy_from_slice(&encoding.decode::<T, 4>(texel)),
        }
    }
    match &image.pixels {
        Pixels::U8(v) => of(v, texel, encoding, out),
        Pixels::U16(v) => of(v, texel, encoding, out),
        Pixels::F32(v) => of(v, texel, encoding, out),
    }
}

fn encode(image: &mut Image, texel: usize, encoding: Encoding, color: &[f32]) {
    let range = texel * color.len()..(texel + 1) * color.len();
    match &mut image.pixels {
        Pixels::U8(v) => super::layer::encode(color, &mut v[range], encoding),
        Pixels::U16(v) => super::layer::encode(color, &mut v[range], encoding),
        Pixels::F32(v) => super::layer::encode(color, &mut v[range], encoding),
    }
}

#[cfg(test)]
mod tests;
