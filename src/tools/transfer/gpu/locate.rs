//! Host half of the kernels `locate` and `footprint`.

use std::ops::Range;
use std::sync::Arc;

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
    bindings: &[PARAMS, BindingKind::Read, BindingKind::Write, BindingKind::Table],
    layouts: &[WINDOW_LAYOUT],
    items: 1,
    constants: &[],
};

/// Where a texel lies on the source, and what is expected of its neighbours.
pub(super) type LocatedRecord = [[u32; 4]; 3];

/// The footprints of texels in one table of the source.
#[derive(Debug)]
pub(super) struct Footprints {
    locate: (Arc<Pipeline>, BindGroup),
    footprint: (Arc<Pipeline>, BindGroup),
    _source: Table,
}

impl Footprints {
    /// `located` and `footprints` hold the texels of a chunk of rows, the first with a row on either
    /// side.
    pub(super) fn new(
        gpu: &Gpu,
        rows: &Rows,
        source: &[SourceTriangle],
        target: &Table,
        located: &Buffer<LocatedRecord>,
        footprints: &Buffer<FootprintRecord>,
    ) -> Result<Self> {
        let source = gpu.table("source triangles", source)?;
        let locate = gpu.pipeline(&LOCATE)?;
        let bindings =
            [rows.params.bind(0), rows.texels.bind(), rows.images.bind(), located.bind(), source.bind(), target.bind()];
        let locate_group = gpu.bind(&locate, &bindings)?;
        let footprint = gpu.pipeline(&FOOTPRINT)?;
        let bindings = [rows.params.bind(0), located.bind(), footprints.bind(), source.bind()];
        let footprint_group = gpu.bind(&footprint, &bindings)?;
        Ok(Self { locate: (locate, locate_group), footprint: (footprint, footprint_group), _source: source })
    }

    /// Records the footprints of `chunk`; a row on either side is at hand.
    pub(super) fn record(&self, batch: &mut Batch<'_>, rows: &Rows, chunk: Range<usize>) -> Result<()> {
        let around = chunk.start.saturating_sub(1)..(chunk.end + 1).min(rows.height);
        let wide = |r: &Range<usize>| r.start as u32..r.end as u32;
        let (width, place) = (rows.width as u32, rows.place(around.start) as u32);
        batch.dispatch_rows(&self.locate.0, &self.locate.1, wide(&around), width, place)?;
        batch.dispatch_rows(&self.footprint.0, &self.footprint.1, wide(&chunk), width, 0)
    }
}
