//! Colours for the parts of charts that the map leaves without: interpolated from what surrounds
//! them on the surface.

mod graph;
mod holes;
mod nearest;
mod pyramid;
mod smooth;

use rayon::prelude::*;

use super::color::Sample;
use super::mip::Encoding;
use super::seams::SeamPair;
use crate::control;
use crate::error::Result;
use crate::geometry::NONE;
use crate::picture::{Image, Pixels};
use crate::words::words;

use graph::Graph;
pub(super) use holes::Holes;

/// What texels of charts without colour get.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Fill {
    /// The background.
    #[default]
    None,
    /// Averages over ever larger parts of the hole, interpolated back (Gortler, Grzeszczuk,
    /// Szeliski and Cohen 1996, "The Lumigraph", section 3.4.3): fast.
    PullPush,
    /// The harmonic function with the colours around as boundary values: no bump inside, no step at
    /// the border.
    Smooth,
    /// The nearest colour, counted in steps from texel to texel. Labels, which do not mix, get it
    /// whatever is asked for.
    Nearest,
}

words! { Fill, "fill", "a way to fill":
    None => "none",
    PullPush => "pull-push",
    Smooth => "smooth",
    Nearest => "nearest",
}

impl Fill {
    /// Bytes per texel of holes and their borders at most.
    pub(super) fn bytes(self) -> u64 {
        match self {
            Self::None => 0,
            Self::PullPush | Self::Nearest => 260,
            Self::Smooth => 640,
        }
    }
}

/// Fills the holes of a picture and returns the texels that got a colour. Holes that border on
/// nothing stay as they are.
///
/// Texels are neighbours along rows and columns of a chart, and across `seams`. Colours are mixed
/// decoded and weighted by opacity, as filters do; `finish` gets all of them before they are
/// stored. O(n log n) for n texels of holes.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub(super) fn fill(
    image: &mut Image,
    holes: &Holes,
    covers: &[u8],
    seams: &[SeamPair],
    how: Fill,
    encoding: Encoding,
    finish: impl FnOnce(&mut [f32]),
) -> Result<Vec<u32>> {
    if how == Fill::None || holes.is_empty() {
        return Ok(Vec::new());
    }
    let graph = Graph::new(holes, covers, seams, image.width);
    let channels = image.channels as usize;
    if how == Fill::Nearest {
        return Ok(copy_nearest(image, &graph));
    }
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
    let here = control::current();
    let solve = |known: &Vec<f64>| {
        here.check()?;
        let (mut values, filled) = pyramid::pull_push(&graph, &pyramid, known);
        if how == Fill::Smooth {
            here.within(|| smooth::solve(&graph, &pyramid, known, &filled, &mut values))?;
        }
        Ok((values, filled))
    };
    let solved = planes.par_iter().map(solve).collect::<Result<Vec<(Vec<f64>, Vec<bool>)>>>()?;
    let mut written = Vec::new();
    let mut colors = Vec::new();
    for (u, &texel) in graph.unknown.iter().enumerate().filter(|(u, _)| solved[0].1[*u]) {
        written.push(texel);
        colors.extend(solved.iter().map(|(values, _)| values[u] as f32));
    }
    finish(&mut colors);
    for (&texel, color) in written.iter().zip(colors.chunks_exact(channels)) {
        encode(image, texel as usize, encoding, color);
    }
    Ok(written)
}

/// Copies samples as they are.
fn copy_nearest(image: &mut Image, graph: &Graph) -> Vec<u32> {
    fn run<T: Copy>(samples: &mut [T], channels: usize, copies: &[(u32, u32)]) {
        for &(to, from) in copies {
            let from = from as usize * channels;
            samples.copy_within(from..from + channels, to as usize * channels);
        }
    }
    let from = nearest::nearest(graph);
    let copies: Vec<(u32, u32)> = graph.unknown.iter().copied().zip(from).filter(|c| c.1 != NONE).collect();
    let channels = image.channels as usize;
    match &mut image.pixels {
        Pixels::U8(v) => run(v, channels, &copies),
        Pixels::U16(v) => run(v, channels, &copies),
        Pixels::F32(v) => run(v, channels, &copies),
    }
    copies.into_iter().map(|c| c.0).collect()
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
