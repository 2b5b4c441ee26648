//! Host half of the kernels `pad_columns` and `pad_seams`.

use std::ops::Range;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use rayon::prelude::*;

use super::items;
use crate::engine::{
    Batch, BindGroup, BindingKind, Buffer, Gpu, Kernel, Layout, Pipeline, ReadbackRing, UniformBlocks,
};
use crate::error::Result;
use crate::kernel_layout as layout;
use crate::tools::transfer::pad::{COVERED, LARGEST_MARGIN};

/// Parameters of both kernels; twin of the struct in `shaders/lib/padding.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct PadParams {
    width: u32,
    height: u32,
    pairs: u32,
    first: u32,
    column_reach: u32,
    row_reach: u32,
    square: u32,
    unused: u32,
}

const LAYOUTS: &[Layout] =
    &[layout!(PadParams, { width, height, pairs, first, column_reach, row_reach, square, unused })];

const fn kernel(name: &'static str, source: &'static str) -> Kernel {
    Kernel {
        name,
        source,
        bindings: &[BindingKind::Uniform(size_of::<PadParams>() as u64), BindingKind::Read, BindingKind::Write],
        layouts: LAYOUTS,
        items: 1,
        constants: &[],
    }
}

pub(super) static PAD_COLUMNS: Kernel = kernel("pad_columns", include_str!("../../../../shaders/pad_columns.wgsl"));
pub(super) static PAD_SEAMS: Kernel = kernel("pad_seams", include_str!("../../../../shaders/pad_seams.wgsl"));

/// Rows that a word of the coverage holds.
const WORD: usize = 32;
/// Pairs of texels in a dispatch at most.
const MOST_PAIRS: usize = 1 << 18;
/// Pairs looked at in a dispatch at most, about half a second of a software device.
const MOST_VISITS: usize = 1 << 27;

/// The coverage of a picture on a device.
#[derive(Debug)]
pub struct Padder<'a> {
    gpu: &'a Gpu,
    size: [usize; 2],
    margin: u32,
    bits: Buffer<u32>,
    /// Rows of one dispatch.
    rows: usize,
    columns: (Arc<Pipeline>, Buffer<u32>),
    seams: (Arc<Pipeline>, Buffer<[u32; 2]>),
    /// Made when the host first wants what is found.
    ring: Option<ReadbackRing<'a, [u32; 2]>>,
}

/// The kernels of some rows, bound.
#[derive(Debug)]
pub(super) struct PartOfPadding {
    items: (u32, u32),
    groups: [BindGroup; 2],
    _params: UniformBlocks<PadParams>,
}

impl<'a> Padder<'a> {
    /// Device memory, and host memory of the device's copies, for a picture of this size.
    pub fn bytes(width: usize, height: usize) -> u64 {
        let pairs = MOST_PAIRS.max(width.div_ceil(2));
        (3 * width * height.div_ceil(WORD) * 4 + pairs * (4 + 4 * 8)) as u64
    }

    /// Puts `coverage`, `width` to a row, on a device; texels from [`COVERED`] on are covered.
    ///
    /// # Errors
    /// [`Error::Memory`](crate::Error::Memory), [`Error::Capability`](crate::Error::Capability) or
    /// [`Error::Device`](crate::Error::Device).
    pub fn new(gpu: &'a Gpu, coverage: &[u8], width: usize, margin: u32) -> Result<Self> {
        let height = coverage.len().checked_div(width).unwrap_or(0);
        let bits = gpu.upload("coverage", &column_bits(coverage, width))?;
        Self::of(gpu, bits, [width, height], margin)
    }

    /// For the coverage of a picture of this size that is on the device as bits ([`column_bits`]),
    /// or will be.
    ///
    /// # Errors
    /// As [`Padder::new`].
    pub(super) fn of(gpu: &'a Gpu, bits: Buffer<u32>, [width, height]: [usize; 2], margin: u32) -> Result<Self> {
        let margin = margin.min(LARGEST_MARGIN);
        let pairs = width.div_ceil(2);
        // Columns look at words above and below, rows at pairs on both sides.
        let reach = (margin as usize).min(width) / 2 + 1;
        gpu.capabilities().check_loops(PAD_COLUMNS.name, 2 * (u64::from(margin) / WORD as u64 + 1))?;
        gpu.capabilities().check_loops(PAD_SEAMS.name, reach as u64)?;
        let rows = (MOST_PAIRS.min(MOST_VISITS / (reach + 4)) / pairs.max(1)).max(1);
        Ok(Self {
            gpu,
            size: [width, height],
            margin,
            bits,
            rows,
            columns: (gpu.pipeline(&PAD_COLUMNS)?, gpu.buffer("column distances", rows * pairs)?),
            seams: (gpu.pipeline(&PAD_SEAMS)?, gpu.buffer("nearest texels", rows * pairs)?),
            ring: None,
        })
    }

    /// Words of the coverage of a picture as bits.
    pub(super) fn words([width, height]: [usize; 2]) -> usize {
        width * height.div_ceil(WORD)
    }

    pub(super) fn bits(&self) -> &Buffer<u32> {
        &self.bits
    }

    pub(super) fn size(&self) -> [usize; 2] {
        self.size
    }

    /// Rows that [`Padder::record`] takes at most.
    pub(super) fn rows(&self) -> usize {
        self.rows
    }

    /// Records the nearest covered texels of `rows`, by pairs of texels; an odd row ends with one
    /// too many.
    ///
    /// # Errors
    /// As [`Padder::new`].
    pub(super) fn record(&self, batch: &mut Batch<'_>, rows: Range<usize>) -> Result<&Buffer<[u32; 2]>> {
        self.record_part(batch, &self.part(rows)?)?;
        Ok(&self.seams.1)
    }

    /// Where the nearest texels are found.
    pub(super) fn found(&self) -> &Buffer<[u32; 2]> {
        &self.seams.1
    }

    /// What [`Padder::record_part`] records of `rows`, bound.
    pub(super) fn part(&self, rows: Range<usize>) -> Result<PartOfPadding> {
        let [width, height] = self.size;
        let pairs = width.div_ceil(2);
        let params = PadParams {
            width: width as u32,
            height: height as u32,
            pairs: pairs as u32,
            first: rows.start as u32,
            column_reach: self.margin.min(height as u32),
            row_reach: self.margin.min(width as u32),
            square: self.margin * self.margin,
            unused: 0,
        };
        let params = self.gpu.uniform("padding parameters", &params)?;
        let (columns, seams) = (&self.columns, &self.seams);
        let of_columns = self.gpu.bind(&columns.0, &[params.bind(0), self.bits.bind(), columns.1.bind()])?;
        let of_seams = self.gpu.bind(&seams.0, &[params.bind(0), columns.1.bind(), seams.1.bind()])?;
        Ok(PartOfPadding { items: items(&(0..rows.len() * pairs))?, groups: [of_columns, of_seams], _params: params })
    }

    /// Records a part.
    pub(super) fn record_part(&self, batch: &mut Batch<'_>, part: &PartOfPadding) -> Result<()> {
        let (start, count) = part.items;
        let [of_columns, of_seams] = &part.groups;
        batch.dispatch_range(&self.columns.0, of_columns, start, count)?;
        batch.dispatch_range(&self.seams.0, of_seams, start, count)
    }

    /// The same as [`pad_seams`](crate::tools::transfer::pad::pad_seams), to the bit.
    ///
    /// # Errors
    /// As [`Padder::new`].
    pub fn nearest(&mut self, rows: Range<usize>, nearest: &mut Vec<u32>) -> Result<()> {
        let width = self.size[0];
        let pairs = width.div_ceil(2);
        nearest.clear();
        nearest.reserve(rows.len() * width);
        let mut ring = match self.ring.take() {
            Some(ring) => ring,
            None => ReadbackRing::new(self.gpu, "nearest texels", 2, self.rows * pairs)?,
        };
        let mut first = rows.start;
        let mut pending = false;
        // One part computes while the one before is brought back.
        while first < rows.end || pending {
            let submitted = first < rows.end;
            if submitted {
                let end = (first + self.rows).min(rows.end);
                let mut batch = self.gpu.batch()?;
                let found = self.record(&mut batch, first..end)?;
                ring.push(batch, found, 0..(end - first) * pairs)?;
                first = end;
            }
            if std::mem::replace(&mut pending, submitted) {
                let found = ring.pop()?.unwrap_or_default();
                for row in found.chunks_exact(pairs) {
                    // Of an odd row the last pair has one texel.
                    nearest.extend_from_slice(&row.as_flattened()[..width]);
                }
            }
        }
        self.ring = Some(ring);
        Ok(())
    }
}

/// The covered texels as bits, 32 rows of a column to a word, the lowest bit first.
fn column_bits(coverage: &[u8], width: usize) -> Vec<u32> {
    let height = coverage.len().checked_div(width).unwrap_or(0);
    let mut bits = vec![0; height.div_ceil(WORD) * width];
    bits.par_chunks_mut(width.max(1)).zip(coverage.par_chunks(width.max(1) * WORD)).for_each(|(words, texels)| {
        for (y, row) in texels.chunks_exact(width).enumerate() {
            for (word, &c) in words.iter_mut().zip(row) {
                *word |= u32::from(c >= COVERED) << y;
            }
        }
    });
    bits
}
