//! Host half of the kernels `locate` and `footprint`.

use std::ops::Range;
use std::sync::Arc;

use super::items;
use super::runs::{RUN_BITS, Runs};
use super::sample_texture::FootprintRecord;
use super::window::{IMAGE_LAYOUT, Rows, WINDOW_LAYOUT};
use crate::engine::{Batch, BindGroup, BindingKind, Buffer, Gpu, Kernel, Pipeline, Table};
use crate::error::Result;
use crate::tools::transfer::tables::SourceTriangle;

pub(super) const PARAMS: BindingKind = BindingKind::Uniform(size_of::<super::WindowParams>() as u64);

pub(super) static LOCATE: Kernel = Kernel {
    name: "locate",
    source: include_str!("../../../../shaders/locate.wgsl"),
    bindings: &[
        PARAMS,
        BindingKind::Read,
        BindingKind::Read,
        BindingKind::Write,
        BindingKind::Read,
        BindingKind::Table,
        BindingKind::Table,
    ],
    layouts: &[WINDOW_LAYOUT, IMAGE_LAYOUT],
    items: 1,
    constants: &[],
};

pub(super) static FOOTPRINT: Kernel = Kernel {
    name: "footprint",
    source: include_str!("../../../../shaders/footprint.wgsl"),
    bindings: &[PARAMS, BindingKind::Read, BindingKind::Write, BindingKind::Read, BindingKind::Table],
    layouts: &[WINDOW_LAYOUT],
    items: 1,
    constants: &[],
};

/// Where a texel lies on the source, and what is expected of its neighbours.
pub(super) type LocatedRecord = [[u32; 4]; 3];

/// What the texels of a chunk of rows have between stages.
#[derive(Debug)]
pub(super) struct Chunk {
    /// Of the chunk and a row on either side.
    located: Buffer<LocatedRecord>,
    /// Of its runs.
    pub(super) footprints: Buffer<FootprintRecord>,
    pub(super) colors: Buffer<[f32; 4]>,
}

impl Chunk {
    /// Room for chunks of `rows` rows of `width` texels.
    pub(super) fn new(gpu: &Gpu, rows: usize, width: usize) -> Result<Self> {
        // Runs may reach beyond their row.
        let of_runs = rows * width.next_multiple_of(1 << RUN_BITS);
        Ok(Self {
            located: gpu.buffer("located", (rows + 2) * width)?,
            footprints: gpu.buffer("footprints", of_runs)?,
            colors: gpu.buffer("colours", of_runs)?,
        })
    }
}

/// The footprints of texels in one table of the source.
#[derive(Debug)]
pub(super) struct Footprints {
    locate: (Arc<Pipeline>, BindGroup),
    footprint: (Arc<Pipeline>, BindGroup),
    _source: Table,
}

impl Footprints {
    /// For the texels of `chunk`.
    pub(super) fn new(
        gpu: &Gpu,
        rows: &Rows,
        runs: &Runs,
        source: &[SourceTriangle],
        target: &Table,
        chunk: &Chunk,
    ) -> Result<Self> {
        let source = gpu.table("source triangles", source)?;
        let locate = gpu.pipeline(&LOCATE)?;
        let bindings = [
            rows.params.bind(0),
            rows.texels.bind(),
            rows.images.bind(),
            chunk.located.bind(),
            runs.list.bind(),
            source.bind(),
            target.bind(),
        ];
        let locate_group = gpu.bind(&locate, &bindings)?;
        let footprint = gpu.pipeline(&FOOTPRINT)?;
        let bindings =
            [rows.params.bind(0), chunk.located.bind(), chunk.footprints.bind(), runs.list.bind(), source.bind()];
        let footprint_group = gpu.bind(&footprint, &bindings)?;
        Ok(Self { locate: (locate, locate_group), footprint: (footprint, footprint_group), _source: source })
    }

    /// Records the footprints of items `texels` of the list of runs; items `seen` have them and all
    /// runs beside them, in rows from `place` on.
    pub(super) fn record_listed(
        &self,
        batch: &mut Batch<'_>,
        seen: &Range<usize>,
        texels: &Range<usize>,
        place: usize,
    ) -> Result<()> {
        batch.dispatch_placed(&self.locate.0, &self.locate.1, items(seen)?, place as u32)?;
        batch.dispatch_placed(&self.footprint.0, &self.footprint.1, items(texels)?, place as u32)
    }

    /// Records the footprints of the runs of `chunk`; a row on either side is at hand.
    pub(super) fn record(&self, batch: &mut Batch<'_>, runs: &Runs, height: usize, chunk: &Range<usize>) -> Result<()> {
        let around = chunk.start.saturating_sub(1)..(chunk.end + 1).min(height);
        let place = around.start as u32;
        for texels in [runs.texels(&around), runs.border(&around)] {
            batch.dispatch_placed(&self.locate.0, &self.locate.1, items(&texels)?, place)?;
        }
        batch.dispatch_placed(&self.footprint.0, &self.footprint.1, items(&runs.texels(chunk))?, place)
    }
}
