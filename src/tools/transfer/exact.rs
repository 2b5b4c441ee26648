//! Texels that need no filter: those that land on a texel of the source, at its size.

use rayon::prelude::*;

use super::footprint::Footprint;
use super::mip::MipChain;
use crate::geometry::{NONE, Wrap};
use crate::picture::{Image, Pixels};

/// Distance to the centre of the source's texel, in texels. Below the steps of graphics devices'
/// own filters (1/256), above what single precision makes of texture coordinates in pictures of
/// 16384 texels (3e-3).
pub(super) const NEAR: f32 = 1.0 / 256.0;
/// How much each side of the footprint may differ from a texel's, in texels.
pub(super) const ALIKE: f32 = 1.0 / 64.0;

/// Copies, sample for sample, the texel of the source under each texel of the result whose
/// footprint is a whole texel there, within 1/256 texel of its centre and 1/64 texel of its size
/// (turned by right angles or mirrored, too). So where the map is the identity and sizes are the
/// same, the result is the source bit for bit, also in 16 bits, in floats, in light, and under
/// transparent texels, where weighting and rounding would change it.
///
/// `image` gets it from texel `first` on; `texture` is the number of the chain's picture in
/// `texture_of`. O(footprints).
pub(super) fn copy_coinciding(
    image: &mut Image,
    first: usize,
    chain: &MipChain<'_>,
    texture: u32,
    texture_of: &[u32],
    footprints: &[Footprint],
) {
    let (channels, source) = (image.channels as usize, chain.image);
    let range = first * channels..(first + footprints.len()) * channels;
    let texel = |f: &Footprint| {
        let shown = f.face != NONE && texture_of[f.face as usize] == texture;
        if shown { coinciding(f, [source.width, source.height], chain.wrap) } else { None }
    };
    match (&mut image.pixels, &source.pixels) {
        (Pixels::U8(to), Pixels::U8(from)) => copy(&mut to[range], channels, from, source, u8::MAX, footprints, texel),
        (Pixels::U16(to), Pixels::U16(from)) => {
            copy(&mut to[range], channels, from, source, u16::MAX, footprints, texel)
        }
        (Pixels::F32(to), Pixels::F32(from)) => copy(&mut to[range], channels, from, source, 1.0, footprints, texel),
        // A picture of another depth than the layer's deepest is converted.
        _ => {}
    }
}

fn copy<T: Copy + Send + Sync>(
    to: &mut [T],
    channels: usize,
    from: &[T],
    source: &Image,
    full: T,
    footprints: &[Footprint],
    texel: impl Fn(&Footprint) -> Option<usize> + Sync,
) {
    const TASK: usize = 4096;
    let n = source.channels as usize;
    to.par_chunks_mut(TASK * channels).zip(footprints.par_chunks(TASK)).for_each(|(to, footprints)| {
        for (to, f) in to.chunks_exact_mut(channels).zip(footprints) {
            if let Some(at) = texel(f) {
                super::sample::widen_samples(&from[at * n..at * n + n], to, full);
            }
        }
    });
}

/// The texel of a picture that a footprint coincides with.
#[inline]
fn coinciding(f: &Footprint, size: [u32; 2], wrap: [Wrap; 2]) -> Option<usize> {
    let s = size.map(|n| n as f32);
    let scaled = |v: [f32; 2]| [v[0] * s[0], v[1] * s[1]];
    let (dx, dy) = (scaled(f.dx), scaled(f.dy));
    let near = |v: [f32; 2], w: [f32; 2]| (0..2).all(|a| (v[a].abs() - w[a]).abs() <= ALIKE);
    let whole = (near(dx, [1.0, 0.0]) && near(dy, [0.0, 1.0])) || (near(dx, [0.0, 1.0]) && near(dy, [1.0, 0.0]));
    if !whole {
        return None;
    }
    let mut at = [0_usize; 2];
    for a in 0..2 {
        let p = f.centre[a] * s[a];
        let index = p.floor();
        if !((p - index - 0.5).abs() <= NEAR) {
            return None;
        }
        at[a] = match index as i64 {
            i if wrap[a] != Wrap::Clamp || (0..i64::from(size[a])).contains(&i) => wrap[a].texel(i, size[a]) as usize,
            _ => return None,
        };
    }
    Some(at[1] * size[0] as usize + at[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_whole_texels_at_their_centres_coincide() {
        let f = |x: f32, y: f32, dx: [f32; 2], dy: [f32; 2]| Footprint {
            centre: [x / 8.0, y / 4.0],
            dx: [dx[0] / 8.0, dx[1] / 4.0],
            dy: [dy[0] / 8.0, dy[1] / 4.0],
            face: 0,
        };
        let (right, down) = ([1.0, 0.0], [0.0, 1.0]);
        let at =
            |f: Footprint, repeats: bool| coinciding(&f, [8, 4], [if repeats { Wrap::Repeat } else { Wrap::Clamp }; 2]);
        assert_eq!(at(f(3.5, 2.5, right, down), false), Some(19));
        assert_eq!(at(f(3.503, 2.497, [0.0, -1.0], [-1.0, 0.0]), false), Some(19), "turned");
        assert_eq!(at(f(3.506, 2.5, right, down), false), None, "beside the centre");
        assert_eq!(at(f(3.5, 2.5, [1.02, 0.0], down), false), None, "wider");
        assert_eq!(at(f(3.5, 2.5, right, right), false), None, "flat");
        assert_eq!(at(f(11.5, -1.5, right, down), true), Some(19), "repeated");
        assert_eq!(at(f(11.5, 2.5, right, down), false), None, "beyond the border");
        assert_eq!(coinciding(&f(11.5, -1.5, right, down), [8, 4], [Wrap::Mirror; 2]), Some(12), "mirrored");
        assert_eq!(at(f(f32::NAN, 2.5, right, down), true), None);
        assert_eq!(at(f(f32::INFINITY, 2.5, right, down), true), None);
    }
}
