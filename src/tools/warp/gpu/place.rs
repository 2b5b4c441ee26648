//! Host halves of the kernels `place_pixels` and `place_left`: where pixels look.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::UVec2;

use crate::engine::{Batch, BindGroup, BindingKind, Buffer, Gpu, Kernel, Layout, Pipeline, Table, UniformBlocks};
use crate::error::{Error, Result};
use crate::kernel_layout as layout;
use crate::mapping::plane::{Patches, TILE_SIDE};

/// The share of a pixel that has no pre-image.
pub const UNMAPPED: f32 = -1.0;
/// Pixels of a row that one word tells the cover of, where it tells it.
pub(super) const RUN: usize = 32;
/// Pixels that there is room for at first, of those that the host finds.
const LEFT: usize = 1 << 12;

/// Where a pixel looks.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct PlaceRecord {
    /// The pixel of the picture that holds the pre-image.
    pub whole: [i32; 2],
    /// Where in it.
    pub part: [f32; 2],
    /// How the pre-image moves when the pixel moves one to the right.
    pub dx: [f32; 2],
    /// How it moves when the pixel moves one down.
    pub dy: [f32; 2],
}

/// A pixel that the host found.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct LeftRecord {
    /// Its number in the band, row by row.
    pub pixel: u32,
    /// Its share in the result, or [`UNMAPPED`].
    pub share: f32,
    /// Where it looks.
    pub place: PlaceRecord,
}

/// Parameters of the kernel.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct PlaceParams {
    width: u32,
    height: u32,
    picture_width: u32,
    picture_height: u32,
    across: u32,
    rows: u32,
    caged: u32,
    unused: u32,
}

pub(super) const PLACE_LAYOUT: Layout = layout!(PlaceRecord, { whole, part, dx, dy });

pub(super) static PLACE_PIXELS: Kernel = Kernel {
    name: "place_pixels",
    source: include_str!("../../../../shaders/place_pixels.wgsl"),
    bindings: &[
        BindingKind::Uniform(size_of::<PlaceParams>() as u64),
        BindingKind::Read,
        BindingKind::Write,
        BindingKind::Write,
        BindingKind::Table,
        BindingKind::Table,
    ],
    layouts: &[
        layout!(PlaceParams, { width, height, picture_width, picture_height, across, rows, caged, unused }),
        PLACE_LAYOUT,
    ],
    items: 1,
    constants: &[],
};

pub(super) static PLACE_LEFT: Kernel = Kernel {
    name: "place_left",
    source: include_str!("../../../../shaders/place_left.wgsl"),
    bindings: &[BindingKind::Read, BindingKind::Write, BindingKind::Write],
    layouts: &[layout!(LeftRecord, { pixel, share, place }), PLACE_LAYOUT],
    items: 1,
    constants: &[],
};

/// Places of the pixels of a band of rows, on a device.
#[derive(Debug)]
pub struct Placer<'a> {
    gpu: &'a Gpu,
    place: (Arc<Pipeline>, BindGroup),
    left: (Arc<Pipeline>, BindGroup),
    /// Where pixels look, row by row.
    pub places: Buffer<PlaceRecord>,
    /// Shares of pixels: of their colours in the result, or [`UNMAPPED`], and of the target
    /// polygon.
    pub shares: Buffer<[f32; 2]>,
    cage: Buffer<u32>,
    records: Buffer<LeftRecord>,
    /// Tiles of a row.
    across: usize,
    /// Pixels of a row.
    width: usize,
    /// Of those that the host found, how many there are.
    count: usize,
    _tables: (Table, Table, UniformBlocks<PlaceParams>),
}

impl<'a> Placer<'a> {
    /// For a `canvas` and a `picture` of so many columns and rows, and bands of `rows` rows, whole
    /// tiles. `caged` says whether what a polygon covers is shown alone.
    ///
    /// # Errors
    /// [`Error::Memory`] or [`Error::Capability`] where it does not fit, [`Error::Device`].
    pub fn new(
        gpu: &'a Gpu,
        patches: &Patches,
        canvas: [u32; 2],
        picture: [u32; 2],
        rows: usize,
        caged: bool,
    ) -> Result<Self> {
        let (width, across) = (canvas[0] as usize, (canvas[0] as usize).div_ceil(TILE_SIDE));
        let Some(packed) = patches.packed(UVec2::from(canvas)) else {
            return Err(Error::Capability {
                limit: "squares of tiles".into(),
                required: u64::from(u32::MAX) + 1,
                actual: u64::from(u32::MAX),
            });
        };
        let params = PlaceParams {
            width: canvas[0],
            height: canvas[1],
            picture_width: picture[0],
            picture_height: picture[1],
            across: across as u32,
            rows: rows as u32,
            caged: u32::from(caged),
            unused: 0,
        };
        let params = gpu.uniform("parameters of places", &params)?;
        let (patches, tiles) = (gpu.table("squares", &packed.records)?, gpu.table("tiles", &packed.tiles)?);
        let (places, shares) = (gpu.buffer("places", rows * width)?, gpu.buffer("shares", rows * width)?);
        let words = if caged { rows * width.div_ceil(RUN) * (1 + RUN) } else { 1 };
        let (cage, records) = (gpu.buffer("cage", words)?, gpu.buffer("pixels found", LEFT)?);
        let pipeline = gpu.pipeline(&PLACE_PIXELS)?;
        let bindings = [params.bind(0), cage.bind(), places.bind(), shares.bind(), patches.bind(), tiles.bind()];
        let place = gpu.bind(&pipeline, &bindings)?;
        let left = gpu.pipeline(&PLACE_LEFT)?;
        let of_left = gpu.bind(&left, &[records.bind(), places.bind(), shares.bind()])?;
        Ok(Self {
            gpu,
            place: (pipeline, place),
            left: (left, of_left),
            places,
            shares,
            cage,
            records,
            across,
            width,
            count: 0,
            _tables: (patches, tiles, params),
        })
    }

    /// Takes the cover of the pixels of a band, row by row, if a polygon shows some of them alone,
    /// and the pixels that the host found.
    ///
    /// # Errors
    /// [`Error::Memory`] or [`Error::Device`].
    pub fn write(&mut self, cover: &[f32], left: &[LeftRecord]) -> Result<()> {
        self.gpu.write(&self.cage, 0, &cage_words(cover, self.width))?;
        if left.len() > self.records.len() {
            self.records = self.gpu.buffer("pixels found", left.len().next_power_of_two())?;
            let bindings = [self.records.bind(), self.places.bind(), self.shares.bind()];
            self.left.1 = self.gpu.bind(&self.left.0, &bindings)?;
        }
        self.count = left.len();
        self.gpu.write(&self.records, 0, left)
    }

    /// Records the places of `rows` rows from row `first` of the canvas on, which a tile begins
    /// with.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub fn record(&self, batch: &mut Batch<'_>, first: usize, rows: usize) -> Result<()> {
        let items = self.across * rows.div_ceil(TILE_SIDE) * TILE_SIDE * TILE_SIDE;
        batch.dispatch_placed(&self.place.0, &self.place.1, (0, items as u32), first as u32)?;
        batch.dispatch(&self.left.0, &self.left.1, self.count)
    }
}

/// Of each run of pixels, row by row: 0 or 1 if all have that cover, else 2 and where their covers
/// are, which follow.
fn cage_words(cover: &[f32], width: usize) -> Vec<u32> {
    let runs = || cover.chunks(width.max(1)).flat_map(|row| row.chunks(RUN));
    let mut words = vec![0; runs().count()];
    for (i, run) in runs().enumerate() {
        words[i] = if run.iter().all(|c| *c == 0.0) {
            0
        } else if run.iter().all(|c| *c == 1.0) {
            1
        } else {
            let at = words.len();
            words.extend(run.iter().map(|c| c.to_bits()));
            words.resize(at + RUN, 0);
            2 + at as u32
        };
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn covers_survive_their_words() {
        for width in [1, 31, 32, 33, 100] {
            let cover: Vec<f32> =
                (0..5 * width).map(|i| if i % 97 < 50 { 0.0 } else { ((i % 97) as f32 / 60.0).min(1.0) }).collect();
            let words = cage_words(&cover, width);
            let at = |x: usize, y: usize| match words[y * width.div_ceil(RUN) + x / RUN] {
                word @ 0..2 => word as f32,
                word => f32::from_bits(words[word as usize - 2 + x % RUN]),
            };
            for (i, c) in cover.iter().enumerate() {
                assert_eq!(at(i % width, i / width), *c);
            }
        }
        assert_eq!(cage_words(&[1.0; 64], 64), [1, 1]);
        assert!(cage_words(&[], 64).is_empty());
    }
}
