//! Host halves of the kernels `coverage_bits` and `copy_padding`: the padding of pictures that are
//! on a device.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use super::pad_seams::Padder;
use crate::engine::{Batch, BindingKind, Buffer, Gpu, Kernel, Pipeline};
use crate::error::Result;
use crate::kernel_layout as layout;

/// Parameters of the kernel; twin of the struct in `shaders/coverage_bits.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct CoverParams {
    width: u32,
    height: u32,
    unused0: u32,
    unused1: u32,
}

/// Parameters of the kernel; twin of the struct in `shaders/copy_padding.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct CopyParams {
    width: u32,
    stride: u32,
    first: u32,
    words: u32,
}

impl CoverParams {
    pub(super) fn new([width, height]: [usize; 2]) -> Self {
        Self { width: width as u32, height: height as u32, unused0: 0, unused1: 0 }
    }
}

impl CopyParams {
    /// Of rows of `width` texels from row `first` on, with `words` words a texel.
    pub(super) fn new(width: usize, first: usize, words: usize) -> Self {
        let stride = width.next_multiple_of(2) as u32;
        Self { width: width as u32, stride, first: first as u32, words: words as u32 }
    }
}

pub(super) static COVERAGE_BITS: Kernel = Kernel {
    name: "coverage_bits",
    source: include_str!("../../../../shaders/coverage_bits.wgsl"),
    bindings: &[BindingKind::Uniform(size_of::<CoverParams>() as u64), BindingKind::Read, BindingKind::Write],
    layouts: &[layout!(CoverParams, { width, height, unused0, unused1 })],
    items: 1,
    constants: &[],
};

pub(super) static COPY_PADDING: Kernel = Kernel {
    name: "copy_padding",
    source: include_str!("../../../../shaders/copy_padding.wgsl"),
    bindings: &[
        BindingKind::Uniform(size_of::<CopyParams>() as u64),
        BindingKind::Read,
        BindingKind::Write,
        BindingKind::Write,
    ],
    layouts: &[layout!(CopyParams, { width, stride, first, words })],
    items: 1,
    constants: &[],
};

/// Records the bits of `covers` (four texels to a word, rows beginning with a word of their own)
/// into `bits`.
pub(super) fn record_bits(
    gpu: &Gpu,
    batch: &mut Batch<'_>,
    covers: &Buffer<u32>,
    [width, height]: [usize; 2],
    bits: &Buffer<u32>,
) -> Result<()> {
    let params = gpu.uniform("coverage parameters", &CoverParams::new([width, height]))?;
    let pipeline = gpu.pipeline(&COVERAGE_BITS)?;
    let group = gpu.bind(&pipeline, &[params.bind(0), covers.bind(), bits.bind()])?;
    batch.dispatch_rows(&pipeline, &group, 0..height.div_ceil(32) as u32, width as u32, 0)
}

/// A picture on a device, and the words of a texel of it.
pub(super) type DeviceImage<'p> = (&'p Buffer<u32>, usize);

/// Submits the padding of whole pictures, part after part, and marks it in `covers`.
///
/// # Errors
/// [`Error::Memory`](crate::Error::Memory) or [`Error::Device`](crate::Error::Device).
pub(super) fn submit_padding(
    gpu: &Gpu,
    padder: &Padder<'_>,
    covers: &Buffer<u32>,
    pictures: &[DeviceImage<'_>],
) -> Result<()> {
    let [width, height] = padder.size();
    let copy: Arc<Pipeline> = gpu.pipeline(&COPY_PADDING)?;
    let mut first = 0;
    while first < height {
        let end = (first + padder.rows()).min(height);
        let mut batch = gpu.batch()?;
        let nearest = padder.record(&mut batch, first..end)?;
        for &(picture, words) in pictures {
            let params = gpu.uniform("copy parameters", &CopyParams::new(width, first, words))?;
            let group = gpu.bind(&copy, &[params.bind(0), nearest.bind(), covers.bind(), picture.bind()])?;
            let columns = width.div_ceil(4) as u32;
            batch.dispatch_rows(&copy, &group, first as u32..end as u32, columns, 0)?;
        }
        batch.submit()?;
        first = end;
    }
    Ok(())
}
