//! Stable compaction: the indices of the items that match, in order, whatever the device.
//!
//! Three kernels: each run of 1,024 items counts its matches, one workgroup turns the counts into offsets, each run
//! writes its indices from its offset on. Only whole numbers are added, so the order of the additions is free.

use std::sync::Arc;

use super::buffer::{BindGroup, Buffer, UniformBlocks};
use super::dispatch::Batch;
use super::gpu::{Gpu, Pipeline};
use super::kernel::{BindingKind, GROUP, Kernel, Layout, layout};
use crate::error::Result;

/// Which items match: those whose 32-bit word `offset`, of `stride` words an item, equals `value`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Matching {
    /// Words an item takes.
    pub stride: u32,
    /// The word of the item that is compared.
    pub offset: u32,
    /// What it must be.
    pub value: u32,
    /// Fills the struct to 16 bytes.
    pub unused: u32,
}

const LAYOUTS: &[Layout] = &[layout!(Matching, { stride, offset, value, unused })];
const MATCHING: BindingKind = BindingKind::Uniform(size_of::<Matching>() as u64);
const ITEMS: u32 = 16;

pub(super) static COMPACT_COUNT: Kernel = Kernel {
    name: "compact_count",
    source: include_str!("../../shaders/compact_count.wgsl"),
    bindings: &[MATCHING, BindingKind::Read, BindingKind::Write],
    layouts: LAYOUTS,
    items: ITEMS,
};

pub(super) static COMPACT_SCAN: Kernel = Kernel {
    name: "compact_scan",
    source: include_str!("../../shaders/compact_scan.wgsl"),
    bindings: &[BindingKind::Write, BindingKind::Write],
    layouts: &[],
    items: 1,
};

pub(super) static COMPACT_SCATTER: Kernel = Kernel {
    name: "compact_scatter",
    source: include_str!("../../shaders/compact_scatter.wgsl"),
    bindings: &[MATCHING, BindingKind::Read, BindingKind::Read, BindingKind::Write],
    layouts: LAYOUTS,
    items: ITEMS,
};

/// A compaction of one buffer, its bindings built once.
#[derive(Debug)]
pub struct Compaction {
    _matching: UniformBlocks<Matching>,
    _blocks: Buffer<u32>,
    total: Buffer<u32>,
    indices: Buffer<u32>,
    capacity: usize,
    stages: [(Arc<Pipeline>, BindGroup); 3],
}

impl Compaction {
    /// Prepares the compaction of up to `capacity` items held in `items`.
    ///
    /// # Errors
    /// [`Error::Memory`](crate::Error::Memory) or [`Error::Device`](crate::Error::Device).
    pub fn new<T: bytemuck::Pod>(gpu: &Gpu, items: &Buffer<T>, capacity: usize, matching: Matching) -> Result<Self> {
        let uniform = gpu.uniform("compaction", &matching)?;
        let runs = capacity.div_ceil((GROUP * ITEMS) as usize);
        let blocks = gpu.buffer::<u32>("compaction runs", runs)?;
        let total = gpu.buffer::<u32>("compaction total", 1)?;
        let indices = gpu.buffer::<u32>("compaction indices", capacity)?;
        let count = gpu.pipeline(&COMPACT_COUNT)?;
        let scan = gpu.pipeline(&COMPACT_SCAN)?;
        let scatter = gpu.pipeline(&COMPACT_SCATTER)?;
        let stages = {
            let a = gpu.bind(&count, &[uniform.bind(0), items.bind(), blocks.bind()])?;
            let b = gpu.bind(&scan, &[blocks.bind(), total.bind()])?;
            let c = gpu.bind(&scatter, &[uniform.bind(0), items.bind(), blocks.bind(), indices.bind()])?;
            [(count, a), (scan, b), (scatter, c)]
        };
        Ok(Self { _matching: uniform, _blocks: blocks, total, indices, capacity, stages })
    }

    /// Adds the compaction of the first `len` items to a batch. With no items the total is zero.
    ///
    /// # Errors
    /// [`Error::Device`](crate::Error::Device), also if `len` exceeds the capacity.
    pub fn record(&self, batch: &mut Batch<'_>, len: usize) -> Result<()> {
        self.indices.bytes(&(0..len))?;
        batch.clear(&self.total);
        let [(count, a), (scan, b), (scatter, c)] = &self.stages;
        batch.dispatch(count, a, len)?;
        batch.dispatch_one_group(scan, b, len.div_ceil((GROUP * ITEMS) as usize))?;
        batch.dispatch(scatter, c, len)
    }

    /// Most items it can take.
    pub fn capacity(&self) -> usize {
        self.capacity
    }

    /// The matching indices, in order; the first [`Compaction::count`] hold.
    pub fn indices(&self) -> &Buffer<u32> {
        &self.indices
    }

    /// Matches found by the last submission; waits for it.
    ///
    /// # Errors
    /// [`Error::Device`](crate::Error::Device).
    pub fn count(&self, gpu: &Gpu) -> Result<usize> {
        Ok(gpu.read(&self.total, 0..1)?.first().map_or(0, |n| *n as usize))
    }
}
