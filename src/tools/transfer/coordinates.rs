//! ST-maps: the source's texture coordinates of each texel of the target, so that other programs
//! can apply the map.

use glam::DVec2;
use rayon::prelude::*;

use super::band::Window;
use super::coverage;
use super::lookup::Lookup;
use super::tiles::UvTile;
use crate::geometry::{NONE, Wrap};
use crate::picture::{Image, Pixels};
use crate::surface::Status;

/// Channels of an ST-map.
pub(super) const CHANNELS: usize = 4;

/// Writes the texels of `rows`: u, v, the coverage over 255, and 1 where there are coordinates; 0
/// in all of them elsewhere.
///
/// Coordinates are the source file's own for tiles; else places in the picture: those of a triangle
/// are shifted by whole repeats, and turned over with a mirrored one, so that its centroid lies in
/// the unit square; where the picture ends at its border, they do. u runs right and v up; v = 1 is
/// the top of the picture.
pub(super) fn write(image: &mut Image, rows: &std::ops::Range<usize>, window: &Window<'_>, lookup: &Lookup<'_>) {
    let (source, table) = (&lookup.mesh, &lookup.table);
    let Pixels::F32(samples) = &mut image.pixels else { return };
    let images = window.images(rows);
    let range = rows.start * window.width * CHANNELS..rows.end * window.width * CHANNELS;
    samples[range].par_chunks_mut(CHANNELS * 4096).zip(images.par_chunks(4096)).for_each(|(out, images)| {
        for (out, image) in out.chunks_exact_mut(CHANNELS).zip(images) {
            let usable = image.face != NONE && image.status() != Status::Failed;
            if !usable || table[image.face as usize].chart == NONE {
                continue;
            }
            let Some(uv) = source.triangle_texcoords(image.face as usize) else { continue };
            let (b0, b1) = (f64::from(image.b0), f64::from(image.b1));
            let mut p = uv[0] * b0 + uv[1] * b1 + uv[2] * (1.0 - b0 - b1);
            if !lookup.tiled {
                let (tile, [along_u, along_v]) = (UvTile::of(&uv), lookup.placement(image.face as usize).wrap);
                p = DVec2::new(inside(p.x, tile.u, along_u), inside(p.y, tile.v, along_v));
            }
            let cover = if Window::is_valid(image) { coverage::VALID } else { coverage::DOUBTFUL };
            out.copy_from_slice(&[p.x as f32, p.y as f32, f32::from(cover) / 255.0, 1.0]);
        }
    });
}

/// A coordinate of a triangle whose centroid lies in repeat `tile`, in the picture itself.
fn inside(x: f64, tile: i32, wrap: Wrap) -> f64 {
    let y = x - f64::from(tile);
    match wrap {
        Wrap::Repeat => y,
        Wrap::Mirror if tile.rem_euclid(2) == 1 => 1.0 - y,
        Wrap::Mirror => y,
        Wrap::Clamp => x.clamp(0.0, 1.0),
    }
}

/// Marks what was padded.
pub(super) fn mark_padding(image: &mut Image, first: usize, nearest: &[u32]) {
    let Pixels::F32(samples) = &mut image.pixels else { return };
    for (i, &from) in nearest.iter().enumerate() {
        if from != NONE && from as usize != first + i {
            samples[(first + i) * CHANNELS + 2] = f32::from(coverage::PADDING) / 255.0;
        }
    }
}
