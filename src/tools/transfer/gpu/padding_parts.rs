//! The padding of parts of a picture that changes, again and again: everything is bound beforehand.

use std::ops::Range;
use std::sync::Arc;

use super::copy_padding::{COPY_PADDING, COVERAGE_BITS, CopyParams, CoverParams, DeviceImage};
use super::pad_seams::{Padder, PartOfPadding};
use crate::engine::{Batch, BindGroup, Buffer, Gpu, Pipeline, UniformBlocks};
use crate::error::Result;

/// Rows that a word of the bits holds.
const WORD: usize = 32;

/// The padding of whole pictures by parts of rows.
#[derive(Debug)]
pub(super) struct PaddingParts {
    size: [usize; 2],
    bits: (Arc<Pipeline>, BindGroup),
    copy: Arc<Pipeline>,
    parts: Vec<Part>,
    _params: UniformBlocks<CoverParams>,
}

/// The padding of some rows.
#[derive(Debug)]
struct Part {
    rows: Range<usize>,
    nearest: PartOfPadding,
    /// Of each picture.
    copies: Vec<(BindGroup, UniformBlocks<CopyParams>)>,
}

impl PaddingParts {
    /// Of `pictures`, whose coverage is `covers`.
    pub(super) fn new(
        gpu: &Gpu,
        padder: &Padder<'_>,
        covers: &Buffer<u32>,
        pictures: &[DeviceImage<'_>],
    ) -> Result<Self> {
        let [width, height] = padder.size();
        let params = CoverParams::new([width, height]);
        let params = gpu.uniform("coverage parameters", &params)?;
        let bits = gpu.pipeline(&COVERAGE_BITS)?;
        let group = gpu.bind(&bits, &[params.bind(0), covers.bind(), padder.bits().bind()])?;
        let copy = gpu.pipeline(&COPY_PADDING)?;
        let part = |first: usize| -> Result<Part> {
            let rows = first..(first + padder.rows()).min(height);
            let copies = pictures.iter().map(|&(picture, words)| {
                let params = gpu.uniform("copy parameters", &CopyParams::new(width, first, words))?;
                let bindings = [params.bind(0), padder.found().bind(), covers.bind(), picture.bind()];
                Ok((gpu.bind(&copy, &bindings)?, params))
            });
            Ok(Part { nearest: padder.part(rows.clone())?, copies: copies.collect::<Result<_>>()?, rows })
        };
        let parts = (0..height).step_by(padder.rows().max(1)).map(part).collect::<Result<_>>()?;
        Ok(Self { size: [width, height], bits: (bits, group), copy, parts, _params: params })
    }

    /// Records the padding of all parts that have some of `rows`. Coverage of these rows and of
    /// those as far around them as padding reaches was tallied anew. Gives the rows of the parts.
    pub(super) fn record(
        &self,
        batch: &mut Batch<'_>,
        padder: &Padder<'_>,
        rows: &Range<usize>,
    ) -> Result<Range<usize>> {
        let [width, height] = self.size;
        let words = (rows.start / WORD) as u32..rows.end.min(height).div_ceil(WORD) as u32;
        batch.dispatch_rows(&self.bits.0, &self.bits.1, words, width as u32, 0)?;
        let mut all = rows.clone();
        for part in self.parts.iter().filter(|p| p.rows.start < rows.end && rows.start < p.rows.end) {
            padder.record_part(batch, &part.nearest)?;
            let (first, end) = (part.rows.start as u32, part.rows.end as u32);
            for (group, _) in &part.copies {
                batch.dispatch_rows(&self.copy, group, first..end, width.div_ceil(4) as u32, 0)?;
            }
            all = all.start.min(part.rows.start)..all.end.max(part.rows.end);
        }
        Ok(all)
    }
}
