//! Host half of the kernel `rasterize_atlas`.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use super::{Items, items};
use crate::engine::{
    Batch, BindGroup, BindingKind, Buffer, Gpu, Kernel, Layout, Pipeline, ReadbackRing, Table, UniformBlocks,
};
use crate::error::{Error, Result};
use crate::geometry::NONE;
use crate::kernel_layout as layout;
use crate::tools::transfer::atlas::{self, AtlasTexel, AtlasTriangle, BIN, BinEntry, Tile};
use crate::tools::transfer::bins::Bins;

/// Entries of a bin beyond which its 64 texels go through the reference: both loops of the kernel
/// together stay far within the loop budget of any driver, and a dispatch within its time.
pub const MOST_ENTRIES: u32 = 4096;

/// Parameters of the kernel; twin of the struct in `shaders/rasterize_atlas.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct RasterizeParams {
    x: u32,
    y: u32,
    width: u32,
    first_x: u32,
    first_y: u32,
    columns: u32,
    most: u32,
    place: u32,
}

const LAYOUTS: &[Layout] = &[layout!(RasterizeParams, { x, y, width, first_x, first_y, columns, most, place })];

pub(super) static RASTERIZE_ATLAS: Kernel = Kernel {
    name: "rasterize_atlas",
    source: include_str!("../../../../shaders/rasterize_atlas.wgsl"),
    bindings: &[
        BindingKind::Uniform(size_of::<RasterizeParams>() as u64),
        BindingKind::Read,
        BindingKind::Write,
        BindingKind::Table,
        BindingKind::Table,
    ],
    layouts: LAYOUTS,
    items: 1,
    constants: &[],
};

/// Texels of a dispatch at most.
const MOST_TEXELS: usize = 1 << 18;

/// Visits of entries that a dispatch may cost, about half a second of a software device.
const MOST_VISITS: u64 = 1 << 27;

/// An atlas on a device, whose tiles it rasterises.
#[derive(Debug)]
pub struct Rasterizer<'a> {
    gpu: &'a Gpu,
    pipeline: Arc<Pipeline>,
    triangles: Table,
    texels: Buffer<AtlasTexel>,
    left: u64,
}

impl<'a> Rasterizer<'a> {
    /// Bytes on the device, and of the host's copies on the way, for an atlas of so many records.
    pub fn bytes(triangles: usize) -> u64 {
        let texels = MOST_TEXELS * size_of::<AtlasTexel>() * 4;
        (texels + 2 * (triangles * size_of::<AtlasTriangle>() + entries(triangles) * size_of::<BinEntry>())) as u64
    }

    /// Puts an atlas on a device; `width` texels are the most in a row of a tile.
    ///
    /// # Errors
    /// [`Error::Memory`](crate::Error::Memory), [`Error::Capability`](crate::Error::Capability) or
    /// [`Error::Device`](crate::Error::Device).
    pub fn new(gpu: &'a Gpu, triangles: &[AtlasTriangle], width: usize) -> Result<Self> {
        let texels = MOST_TEXELS.max(width);
        gpu.capabilities().check_loops(RASTERIZE_ATLAS.name, 2 * u64::from(MOST_ENTRIES))?;
        Ok(Self {
            gpu,
            pipeline: gpu.pipeline(&RASTERIZE_ATLAS)?,
            triangles: gpu.table("atlas triangles", triangles)?,
            texels: gpu.buffer("atlas texels", texels)?,
            left: 0,
        })
    }

    /// Texels so far that the kernel left to the reference.
    pub fn left_to_reference(&self) -> u64 {
        self.left
    }

    /// The same as [`rasterize_atlas`](atlas::rasterize_atlas), but for the rounding of barycentric
    /// coordinates.
    ///
    /// # Errors
    /// As [`Rasterizer::new`].
    pub fn rasterize(
        &mut self,
        tile: &Tile,
        bins: &Bins,
        triangles: &[AtlasTriangle],
        texels: &mut [AtlasTexel],
    ) -> Result<()> {
        let fits = bins.entries.len() <= entries(triangles.len()) && tile.width as usize <= self.texels.len();
        match fits.then(|| self.on_device(tile, bins, texels)) {
            Some(Ok(())) => {
                self.fill_dense(tile, bins, triangles, texels);
            }
            // Too many triangles for the device: the reference does this tile.
            None | Some(Err(Error::Memory { .. } | Error::Capability { .. })) => {
                self.left += tile.texels() as u64;
                atlas::rasterize_atlas(tile, bins, triangles, texels);
            }
            Some(Err(e)) => return Err(e),
        }
        Ok(())
    }

    /// Binds the bins of a tile whose texels go to `texels`, from `place` on ([`NONE`] for each
    /// dispatch from the first).
    fn bind(&self, tile: &Tile, bins: &Bins, texels: &Buffer<AtlasTexel>, place: u32) -> Result<Bound> {
        let params = RasterizeParams {
            x: tile.x,
            y: tile.y,
            width: tile.width,
            first_x: bins.first[0],
            first_y: bins.first[1],
            columns: bins.columns,
            most: MOST_ENTRIES,
            place,
        };
        let params = self.gpu.uniform("rasterise parameters", &params)?;
        let starts = self.gpu.upload("bins", &bins.start)?;
        let entries = self.gpu.table("bin entries", &bins.entries)?;
        let bindings = [params.bind(0), starts.bind(), texels.bind(), entries.bind(), self.triangles.bind()];
        let group = self.gpu.bind(&self.pipeline, &bindings)?;
        Ok(Bound { group, _tables: (params, starts, entries) })
    }

    /// Records the texels of a tile of whole rows into `into`, from `place` on; the same as
    /// [`Rasterizer::rasterize`].
    ///
    /// # Errors
    /// As [`Rasterizer::new`].
    pub(super) fn record(
        &mut self,
        batch: &mut Batch<'_>,
        tile: &Tile,
        bins: &Bins,
        triangles: &[AtlasTriangle],
        into: &Buffer<AtlasTexel>,
        place: usize,
    ) -> Result<()> {
        let fits = bins.entries.len() <= entries(triangles.len());
        let mut texels = Vec::new();
        match fits.then(|| self.bind(tile, bins, into, place as u32)) {
            Some(Ok(bound)) => {
                for part in few_parts(tile, bins) {
                    let (first, count) = items(&part)?;
                    batch.dispatch_range(&self.pipeline, &bound.group, first, count)?;
                }
                if bins.start.windows(2).all(|range| range[1] - range[0] <= MOST_ENTRIES) {
                    return Ok(());
                }
                // The rows of crowded bins come from the reference.
                texels.resize(tile.texels(), AtlasTexel::EMPTY);
                let dense = self.fill_dense(tile, bins, triangles, &mut texels);
                let host = self.gpu.upload("crowded texels", &texels)?;
                dense.into_iter().try_for_each(|run| batch.copy(&host, run.start, into, place + run.start, run.len()))
            }
            // Too many triangles for the device: the reference does this tile.
            None | Some(Err(Error::Memory { .. } | Error::Capability { .. })) => {
                self.left += tile.texels() as u64;
                texels.resize(tile.texels(), AtlasTexel::EMPTY);
                atlas::rasterize_atlas(tile, bins, triangles, &mut texels);
                let host = self.gpu.upload("atlas texels", &texels)?;
                batch.copy(&host, 0, into, place, texels.len())
            }
            Some(Err(e)) => Err(e),
        }
    }

    fn on_device(&self, tile: &Tile, bins: &Bins, texels: &mut [AtlasTexel]) -> Result<()> {
        let width = tile.width as usize;
        let Bound { group, _tables } = self.bind(tile, bins, &self.texels, NONE)?;
        let mut ring = ReadbackRing::new(self.gpu, "atlas texels", 2, self.texels.len())?;
        let mut pending: Option<Items> = None;
        let mut row = 0;
        // One part computes while the one before is brought back.
        while row < tile.height || pending.is_some() {
            let part = (row < tile.height).then(|| {
                let end = part_end(tile, bins, row, self.texels.len(), MOST_VISITS);
                let part = row as usize * width..end as usize * width;
                row = end;
                part
            });
            if let Some(part) = &part {
                let mut batch = self.gpu.batch()?;
                let (first, count) = items(part)?;
                batch.dispatch_range(&self.pipeline, &group, first, count)?;
                ring.push(batch, &self.texels, 0..part.len())?;
            }
            if let Some(before) = std::mem::replace(&mut pending, part) {
                let found = ring.pop()?.unwrap_or_default();
                texels[before].copy_from_slice(&found);
            }
        }
        Ok(())
    }

    /// The texels of bins with too many triangles; gives the runs of them.
    fn fill_dense(
        &mut self,
        tile: &Tile,
        bins: &Bins,
        triangles: &[AtlasTriangle],
        texels: &mut [AtlasTexel],
    ) -> Vec<Items> {
        let mut runs = Vec::new();
        for (bin, range) in (0..).zip(bins.start.windows(2)) {
            if range[1] - range[0] <= MOST_ENTRIES {
                continue;
            }
            let clip = |axis: usize, number: u32, first: u32, count: u32| {
                let low = ((bins.first[axis] + number) * BIN).max(first);
                (low, ((bins.first[axis] + number + 1) * BIN).min(first + count))
            };
            let (x0, x1) = clip(0, bin % bins.columns, tile.x, tile.width);
            let (y0, y1) = clip(1, bin / bins.columns, tile.y, tile.height);
            let part = Tile { x: x0, y: y0, width: x1 - x0, height: y1 - y0 };
            let mut dense = vec![AtlasTexel::EMPTY; part.texels()];
            atlas::rasterize_atlas(&part, bins, triangles, &mut dense);
            for (y, row) in (y0..y1).zip(dense.chunks_exact(part.width.max(1) as usize)) {
                let at = ((y - tile.y) * tile.width + x0 - tile.x) as usize;
                texels[at..at + row.len()].copy_from_slice(row);
                runs.push(at..at + row.len());
            }
            self.left += dense.len() as u64;
        }
        runs
    }
}

/// The bins of a tile on a device. Its tables are counted against the memory budget as long as it
/// lives; the driver keeps them until what was recorded with them has run.
struct Bound {
    group: BindGroup,
    _tables: (UniformBlocks<RasterizeParams>, Buffer<u32>, Table),
}

/// Entries in the bins of a tile beyond which it goes through the reference: more than tiles of
/// usual meshes have.
fn entries(triangles: usize) -> usize {
    4 * triangles + (1 << 16)
}

/// Dispatches of one batch at most.
const MOST_PARTS: usize = 12;

/// The texels of a tile as the parts that one batch dispatches: of [`MOST_VISITS`], or of more
/// where that makes too many.
fn few_parts(tile: &Tile, bins: &Bins) -> Vec<Items> {
    let mut visits = MOST_VISITS;
    loop {
        let mut parts = Vec::new();
        let mut row = 0;
        while row < tile.height {
            let end = part_end(tile, bins, row, usize::MAX, visits);
            parts.push((row * tile.width) as usize..(end * tile.width) as usize);
            row = end;
        }
        if parts.len() <= MOST_PARTS {
            return parts;
        }
        visits = visits.saturating_mul(2);
    }
}

/// The row of the tile after the last that fits a dispatch together with `row`.
fn part_end(tile: &Tile, bins: &Bins, row: u32, most: usize, most_visits: u64) -> u32 {
    let (mut end, mut texels, mut visits) = (row, 0, 0);
    while end < tile.height {
        let bin_row = ((tile.y + end) / BIN - bins.first[1]) * bins.columns;
        let [first, last] = [bin_row, bin_row + bins.columns].map(|b| bins.start[b as usize]);
        texels += tile.width as usize;
        visits += u64::from(BIN) * u64::from(last - first) + u64::from(tile.width);
        if end > row && (texels > most || visits > most_visits) {
            break;
        }
        end += 1;
    }
    end
}
