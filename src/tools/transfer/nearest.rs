//! The stored texel nearest to a texel's image, for labels: nothing is averaged.

use rayon::prelude::*;

use super::color::Sample;
use super::footprint::Footprint;
use super::sample::widen;
use crate::geometry::NONE;
use crate::raster::{Image, Pixels};

/// Texels of one parallel task.
const TASK: usize = 4096;

/// Looks the texel up that holds the centre of each footprint whose triangle has texture `texture`; the texture repeats. `colors` has
/// `channels` values per footprint; samples come back as they were when they are encoded in their own depth. O(footprints).
pub(super) fn nearest_texels(
    image: &Image,
    texture: u32,
    channels: usize,
    texture_of: &[u32],
    footprints: &[Footprint],
    colors: &mut [f32],
) {
    fn run<T: Sample>(
        samples: &[T],
        image: &Image,
        texture: u32,
        channels: usize,
        texture_of: &[u32],
        footprints: &[Footprint],
        colors: &mut [f32],
    ) {
        let (w, h, n) = (image.width as usize, image.height as usize, image.channels as usize);
        let tasks = footprints.par_chunks(TASK).zip(colors.par_chunks_mut(TASK * channels));
        tasks.for_each(|(footprints, colors)| {
            for (f, out) in footprints.iter().zip(colors.chunks_exact_mut(channels)) {
                if f.face == NONE || texture_of[f.face as usize] != texture {
                    continue;
                }
                let column = |x: f32, side: usize| ((x - x.floor()) * side as f32) as usize % side;
                let at = (column(f.centre[1], h) * w + column(f.centre[0], w)) * n;
                let mut texel = [0.0; 4];
                for (t, s) in texel.iter_mut().zip(&samples[at..at + n]) {
                    *t = s.decode(false);
                }
                widen(&texel[..n], out);
            }
        });
    }
    match &image.pixels {
        Pixels::U8(v) => run(v, image, texture, channels, texture_of, footprints, colors),
        Pixels::U16(v) => run(v, image, texture, channels, texture_of, footprints, colors),
        Pixels::F32(v) => run(v, image, texture, channels, texture_of, footprints, colors),
    }
}
