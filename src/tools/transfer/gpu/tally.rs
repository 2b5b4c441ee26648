//! Host half of the kernel `tally`: counts and the coverage picture on a device.

use std::ops::Range;
use std::sync::Arc;

use super::locate::PARAMS;
use super::window::{IMAGE_LAYOUT, Rows, WINDOW_LAYOUT};
use crate::engine::{Batch, BindGroup, BindingKind, Buffer, GROUP, Gpu, Kernel, Pipeline, Table};
use crate::error::Result;
use crate::kernel_layout as layout;
use crate::tools::transfer::tally::{RUN, Sums};

pub(super) static TALLY: Kernel = Kernel {
    name: "tally",
    source: include_str!("../../../../shaders/tally.wgsl"),
    bindings: &[
        PARAMS,
        BindingKind::Read,
        BindingKind::Read,
        BindingKind::Write,
        BindingKind::Write,
        BindingKind::Table,
        BindingKind::Table,
    ],
    layouts: &[
        WINDOW_LAYOUT,
        IMAGE_LAYOUT,
        layout!(Sums, { covered, centre, overlapping, valid, doubtful, area, valid_area, doubtful_area }),
    ],
    items: RUN as u32 / GROUP,
    constants: &[],
};

/// The coverage of a picture on a device, and its sums by runs.
#[derive(Debug)]
pub(super) struct DeviceTally {
    /// Four texels to a word; rows begin with a word of their own.
    pub(super) covers: Buffer<u32>,
    pub(super) sums: Buffer<Sums>,
    tally: (Arc<Pipeline>, BindGroup),
    _colored: Table,
}

impl DeviceTally {
    /// For texels of `rows`; `colored` says of each triangle of the source whether some layer has a
    /// colour there.
    pub(super) fn new(gpu: &Gpu, rows: &Rows, target: &Table, colored: &[bool]) -> Result<Self> {
        let covers = gpu.buffer("coverage", rows.height * rows.width.div_ceil(4))?;
        let sums = gpu.buffer("sums", rows.height * rows.width.div_ceil(RUN))?;
        let colored = by_four(gpu, "coloured", colored.iter().map(|c| u32::from(*c)))?;
        let pipeline = gpu.pipeline(&TALLY)?;
        let bindings = [
            rows.params.bind(0),
            rows.texels.bind(),
            rows.images.bind(),
            covers.bind(),
            sums.bind(),
            target.bind(),
            colored.bind(),
        ];
        let group = gpu.bind(&pipeline, &bindings)?;
        Ok(Self { covers, sums, tally: (pipeline, group), _colored: colored })
    }

    /// Records what became of the texels of a band.
    pub(super) fn record(&self, batch: &mut Batch<'_>, rows: &Rows, band: &Range<usize>) -> Result<()> {
        let (width, place) = (rows.width as u32, rows.place(band.start) as u32);
        batch.dispatch_rows(&self.tally.0, &self.tally.1, band.start as u32..band.end as u32, width, place)
    }
}

/// A table of words, four to a texel; of one word where there are none.
pub(super) fn by_four(gpu: &Gpu, label: &str, words: impl Iterator<Item = u32>) -> Result<Table> {
    let mut words: Vec<u32> = words.collect();
    words.resize(words.len().max(1).next_multiple_of(4), 0);
    let records: Vec<[u32; 4]> = words.chunks_exact(4).map(|w| [w[0], w[1], w[2], w[3]]).collect();
    gpu.table(label, &records)
}
