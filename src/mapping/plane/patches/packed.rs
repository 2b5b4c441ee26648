//! The squares as the kernel `place_pixels` reads them: their polynomials, and which of them may
//! have pixels of which tile of the canvas.
//!
//! A device has no double precision, so places are told as whole numbers and parts below 1: pixels
//! from the image of a centre, and pre-images from a centre, are displacements, and of the size of
//! the square. The part of an image is rounded by 2^-25 of a pixel, that of a centre as the point
//! in the square is.

use bytemuck::{Pod, Zeroable};
use glam::{DVec2, UVec2};

use super::fit::{BENDS, MARGIN};
use super::{Leaf, Patch, Patches};

/// Side of a tile in pixels: a workgroup of the kernel has one.
pub const TILE_SIDE: usize = 8;
/// Words of a tile's list are read by fours.
const FOUR: usize = 4;

/// A square with its polynomial; texels of 16 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct PatchRecord {
    /// The centre of the square.
    centre: [i32; 2],
    centre_part: [f32; 2],
    /// Its image.
    image: [i32; 2],
    image_part: [f32; 2],
    /// The inverse of the linear part, row by row.
    inverse: [f32; 4],
    half: f32,
    reach: [f32; 2],
    unused: f32,
    /// The terms that bend, both components of each.
    bend: [[f32; 2]; BENDS],
}

/// Records and tiles.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PackedPatches {
    /// The bounded squares that may have pixels, in their order.
    pub records: Vec<PatchRecord>,
    /// Four words to a record: of each tile, row by row, and of one tile more where its list
    /// begins; then the lists, numbers of records in their order.
    pub tiles: Vec<[u32; FOUR]>,
}

/// The whole number not above a coordinate and the rest.
fn split(v: f64) -> (i32, f32) {
    let whole = v.floor();
    (whole as i32, (v - whole) as f32)
}

fn split_point(p: DVec2) -> ([i32; 2], [f32; 2]) {
    let (x, y) = (split(p.x), split(p.y));
    ([x.0, y.0], [x.1, y.1])
}

impl PatchRecord {
    fn new(patch: &Patch) -> Self {
        let (centre, centre_part) = split_point(patch.centre);
        let (image, image_part) = split_point(patch.image);
        let [[a, b], [c, d]] = patch.single();
        let [x, y] = &patch.bend;
        Self {
            centre,
            centre_part,
            image,
            image_part,
            inverse: [a, b, c, d],
            half: patch.half as f32,
            reach: patch.reach.as_vec2().to_array(),
            unused: 0.0,
            bend: std::array::from_fn(|k| [x[k], y[k]]),
        }
    }
}

impl Patches {
    /// The bounded squares for a canvas of `size` pixels; `None` if their lists are too long for 32
    /// bits. O(squares x tiles that they reach).
    pub fn packed(&self, size: UVec2) -> Option<PackedPatches> {
        let tiles = [size.x, size.y].map(|n| (n as usize).div_ceil(TILE_SIDE));
        let count = tiles[0].checked_mul(tiles[1])?;
        let mut packed = PackedPatches::default();
        // Record, row of tiles, first and last column.
        let mut runs: Vec<(u32, usize, [usize; 2])> = Vec::new();
        let mut lengths = vec![0_u32; count];
        for leaf in &self.leaves {
            let Leaf::Bounded(patch) = leaf else { continue };
            let before = runs.len();
            patch.tiles(size, |row, columns| runs.push((packed.records.len() as u32, row, columns)));
            for (_, row, [first, last]) in &runs[before..] {
                lengths[row * tiles[0] + first..=row * tiles[0] + last].iter_mut().for_each(|n| *n += 1);
            }
            if runs.len() > before {
                packed.records.push(PatchRecord::new(patch));
            }
        }
        let mut words = Vec::with_capacity(count + 1);
        let mut next = u32::try_from(count + 1).ok()?;
        for n in lengths {
            words.push(next);
            next = next.checked_add(n)?;
        }
        words.push(next);
        let mut place = words.clone();
        words.resize((next as usize).next_multiple_of(FOUR), 0);
        for (record, row, [first, last]) in runs {
            for at in &mut place[row * tiles[0] + first..=row * tiles[0] + last] {
                words[*at as usize] = record;
                *at += 1;
            }
        }
        packed.tiles = words.as_chunks().0.to_vec();
        Some(packed)
    }
}

impl Patch {
    /// The tiles with pixels that can lie in the square, whatever the bend: rows of tiles, with the
    /// first and the last column.
    fn tiles(&self, size: UVec2, mut take: impl FnMut(usize, [usize; 2])) {
        let forward = self.inverse.inverse();
        let reach = DVec2::splat(1.0 + MARGIN) + self.reach;
        let corner = |x: f64, y: f64| self.image + forward * (reach * DVec2::new(x, y));
        let corners = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0)];
        let [low, high] = self.rows();
        // Pixels have their centres at halves.
        let first = (low - 0.5).ceil().max(0.0);
        let last = (high - 0.5).floor().min(f64::from(size.y) - 1.0);
        if !(first <= last) {
            return;
        }
        for row in first as usize / TILE_SIDE..=last as usize / TILE_SIDE {
            let top = (row * TILE_SIDE) as f64 + 0.5;
            let (top, bottom) = (top.max(low), (top + TILE_SIDE as f64 - 1.0).min(high));
            // The widest part of the parallelogram between the rows is at a corner or at one of
            // them.
            let inner = corners.iter().filter(|c| c.y >= top && c.y <= bottom).map(|c| [c.x, c.x]);
            let ends = [top, bottom].into_iter().filter_map(|y| self.columns(y));
            let join = |[a, b]: [f64; 2], [c, d]: [f64; 2]| [a.min(c), b.max(d)];
            let [left, right] = inner.chain(ends).fold([f64::INFINITY, f64::NEG_INFINITY], join);
            let left = (left - 0.5).ceil().max(0.0);
            let right = (right - 0.5).floor().min(f64::from(size.x) - 1.0);
            if left <= right {
                take(row, [left as usize / TILE_SIDE, right as usize / TILE_SIDE]);
            }
        }
    }
}

/// The constants of the kernel `place_pixels` that are these.
#[cfg(test)]
pub(crate) fn twins() -> Vec<crate::twins::Twin> {
    use super::solve::{CORRECTIONS, NEAR, SETTLED};
    crate::twins::of(
        "place_pixels",
        [
            ("PATCH_TEXELS", size_of::<PatchRecord>() as f64 / 16.0),
            ("TILE_SIDE", TILE_SIDE as f64),
            ("BENDS", BENDS as f64),
            ("MARGIN", MARGIN),
            ("SETTLED", SETTLED),
            ("CORRECTIONS", CORRECTIONS as f64),
            ("NEAR", NEAR),
        ],
    )
}
