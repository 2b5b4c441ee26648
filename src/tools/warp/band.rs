//! Rows of the output in square blocks: what is worked on at once.

use rayon::prelude::*;

use super::footprint::Seen;
use super::gather::{Block, warp_image};
use super::pyramid::{Pyramid, Texel, Window};
use crate::picture::Filter;

/// Pixels along a side of a block: its pre-images lie close together, so that one decoded window
/// serves them all.
pub const BLOCK: usize = 32;

/// Whole rows of the output, from `first` on, with one value per pixel held block after block, row
/// by row inside a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Band {
    /// First row of the output.
    pub first: usize,
    /// Number of rows.
    pub rows: usize,
    /// Pixels per row.
    pub width: usize,
}

/// The pixels of a band that one block holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// Column of its first pixel.
    pub x: usize,
    /// Row of its first pixel in the band.
    pub y: usize,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Where its values begin.
    pub start: usize,
}

impl Band {
    /// Number of pixels.
    pub fn len(&self) -> usize {
        self.rows * self.width
    }

    /// Whether it has no pixels.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The blocks in the order of their values.
    pub fn places(&self) -> Vec<Place> {
        let mut places = Vec::new();
        for y in (0..self.rows).step_by(BLOCK) {
            let height = BLOCK.min(self.rows - y);
            for x in (0..self.width).step_by(BLOCK) {
                let width = BLOCK.min(self.width - x);
                places.push(Place { x, y, width, height, start: y * self.width + x * height });
            }
        }
        places
    }

    /// Where the value of the pixel in column `x` of row `y` of the band is.
    #[inline]
    pub fn index(&self, x: usize, y: usize) -> usize {
        let (upper, left) = (y / BLOCK * BLOCK, x / BLOCK * BLOCK);
        let height = BLOCK.min(self.rows - upper);
        let width = BLOCK.min(self.width - left);
        upper * self.width + left * height + (y - upper) * width + (x - left)
    }

    /// Colours of all pixels of the band whose pre-images have a cover, one block at a time on each
    /// thread: see [`warp_image`].
    ///
    /// `bases` has one entry for each block; the other slices one value per pixel.
    pub fn gather(
        &self,
        pyramid: &Pyramid<'_>,
        filter: Filter,
        bases: &[[i32; 2]],
        seen: Seen<'_>,
        colors: &mut [Texel],
    ) {
        let places = self.places();
        let mut rest = colors;
        let mut parts = Vec::with_capacity(places.len());
        for place in &places {
            let (part, others) = rest.split_at_mut(place.width * place.height);
            rest = others;
            parts.push(part);
        }
        let work = |window: &mut Window, ((place, base), out): ((&Place, &[i32; 2]), &mut [Texel])| {
            let seen = seen.part(place.start..place.start + out.len());
            warp_image(pyramid, filter, &Block { width: place.width, base: *base, seen }, window, out);
        };
        places.par_iter().zip(bases).zip(parts).for_each_init(Window::default, work);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_hold_every_pixel_once() {
        for (width, rows) in [(1, 1), (32, 32), (33, 31), (100, 70), (31, 64), (65, 1)] {
            let band = Band { first: 0, rows, width };
            let mut next = 0;
            for place in band.places() {
                assert_eq!(place.start, next);
                for j in 0..place.height {
                    for i in 0..place.width {
                        assert_eq!(band.index(place.x + i, place.y + j), next);
                        next += 1;
                    }
                }
            }
            assert_eq!(next, band.len());
        }
    }
}
