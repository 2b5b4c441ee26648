//! The stored texel nearest to a texel's image, for labels: nothing is averaged.

use rayon::prelude::*;

use super::color::Sample;
use super::footprint::Footprint;
use super::mip::MipChain;
use super::sample::widen;
use crate::geometry::NONE;
use crate::picture::Pixels;

/// Texels of one parallel task.
const TASK: usize = 4096;

/// Looks the texel up that holds the centre of each footprint whose triangle has texture `texture`;
/// beyond its borders the picture goes on as the chain says. `colors` has `channels` values per
/// footprint; samples come back as they were when they are encoded in their own depth.
/// O(footprints).
pub(super) fn nearest_texels(
    chain: &MipChain<'_>,
    texture: u32,
    channels: usize,
    texture_of: &[u32],
    footprints: &[Footprint],
    colors: &mut [f32],
) {
    fn run<T: Sample>(
        samples: &[T],
        chain: &MipChain<'_>,
        texture: u32,
        channels: usize,
        texture_of: &[u32],
        footprints: &[Footprint],
        colors: &mut [f32],
    ) {
        let image = chain.image;
        let (w, h, n) = (image.width as usize, image.height as usize, image.channels as usize);
        let tasks = footprints.par_chunks(TASK).zip(colors.par_chunks_mut(TASK * channels));
        tasks.for_each(|(footprints, colors)| {
            for (f, out) in footprints.iter().zip(colors.chunks_exact_mut(channels)) {
                if f.face == NONE || texture_of[f.face as usize] != texture {
                    continue;
                }
                let place = |axis: usize, side: usize| {
                    let x = chain.wrap[axis].fold(f64::from(f.centre[axis]));
                    ((x * side as f64) as usize).min(side - 1)
                };
                let at = (place(1, h) * w + place(0, w)) * n;
                let mut texel = [0.0; 4];
                for (t, s) in texel.iter_mut().zip(&samples[at..at + n]) {
                    *t = s.decode(false);
                }
                widen(&texel[..n], out);
            }
        });
    }
    match &chain.image.pixels {
        Pixels::U8(v) => run(v, chain, texture, channels, texture_of, footprints, colors),
        Pixels::U16(v) => run(v, chain, texture, channels, texture_of, footprints, colors),
        Pixels::F32(v) => run(v, chain, texture, channels, texture_of, footprints, colors),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Wrap;
    use crate::picture::Image;
    use crate::tools::transfer::Encoding;

    #[test]
    fn beyond_its_borders_a_picture_goes_on_as_the_chain_says() {
        let image = Image::new(4, 1, 1, Pixels::U8(vec![1, 2, 3, 4])).unwrap();
        let mut chain = MipChain::new(&image, Encoding::default()).unwrap();
        let at = |u: f32| Footprint { centre: [u, 0.5], face: 0, ..Footprint::NOWHERE };
        let footprints = [0.0, 0.49, 0.51, 1.0, 1.3, -0.1].map(at);
        for (wrap, expected) in
            [(Wrap::Repeat, [1, 2, 3, 1, 2, 4]), (Wrap::Clamp, [1, 2, 3, 4, 4, 1]), (Wrap::Mirror, [1, 2, 3, 4, 3, 1])]
        {
            chain.wrap = [wrap; 2];
            let mut found = [0.0; 6];
            nearest_texels(&chain, 0, 1, &[0], &footprints, &mut found);
            assert_eq!(found.map(|c| (c * 255.0_f32).round() as u8), expected);
        }
    }
}
