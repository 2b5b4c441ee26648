//! Stable compaction: the indices of the items that match, in order, whatever the device.
//!
//! Three kernels: each run of 1,024 items counts its matches, one workgroup turns the counts into
//! offsets, each run writes its indices from its offset on. Only whole numbers are added, so the
//! order of the additions is free.

use std::sync::Arc;

use super::device::{Batch, BindGroup, Buffer, Gpu, Pipeline, UniformBlocks};
use super::kernel::{BindingKind, GROUP, Kernel, Layout, layout};
use crate::error::Result;

/// Which items match: those whose 32-bit word `offset`, of `stride` words an item, equals `value`
/// in the bits of `mask`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Matching {
    /// Words an item takes.
    pub stride: u32,
    /// The word of the item that is compared.
    pub offset: u32,
    /// What it must be.
    pub value: u32,
    /// The bits that are compared.
    pub mask: u32,
}

const LAYOUTS: &[Layout] = &[layout!(Matching, { stride, offset, value, mask })];
const MATCHING: BindingKind = BindingKind::Uniform(size_of::<Matching>() as u64);
pub(super) const ITEMS: u32 = 16;

pub(super) static COMPACT_COUNT: Kernel = Kernel {
    name: "compact_count",
    source: include_str!("../../shaders/compact_count.wgsl"),
    bindings: &[MATCHING, BindingKind::Read, BindingKind::Write],
    layouts: LAYOUTS,
    items: ITEMS,
    constants: &[],
};

pub(super) static COMPACT_SCAN: Kernel = Kernel {
    name: "compact_scan",
    source: include_str!("../../shaders/compact_scan.wgsl"),
    bindings: &[BindingKind::Write, BindingKind::Write],
    layouts: &[],
    items: 1,
    constants: &[],
};

pub(super) static COMPACT_SCATTER: Kernel = Kernel {
    name: "compact_scatter",
    source: include_str!("../../shaders/compact_scatter.wgsl"),
    bindings: &[MATCHING, BindingKind::Read, BindingKind::Read, BindingKind::Write],
    layouts: LAYOUTS,
    items: ITEMS,
    constants: &[],
};

/// A compaction of one buffer, its bindings built once.
#[derive(Debug)]
pub struct Compaction {
    _matching: UniformBlocks<Matching>,
    _blocks: Buffer<u32>,
    list: Buffer<u32>,
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
        let list = gpu.buffer::<u32>("compaction list", capacity + 1)?;
        let count = gpu.pipeline(&COMPACT_COUNT)?;
        let scan = gpu.pipeline(&COMPACT_SCAN)?;
        let scatter = gpu.pipeline(&COMPACT_SCATTER)?;
        let stages = {
            let a = gpu.bind(&count, &[uniform.bind(0), items.bind(), blocks.bind()])?;
            let b = gpu.bind(&scan, &[blocks.bind(), list.bind()])?;
            let c = gpu.bind(&scatter, &[uniform.bind(0), items.bind(), blocks.bind(), list.bind()])?;
            [(count, a), (scan, b), (scatter, c)]
        };
        Ok(Self { _matching: uniform, _blocks: blocks, list, capacity, stages })
    }

    /// Adds the compaction of the first `len` items to a batch. With no items the total is zero.
    ///
    /// # Errors
    /// [`Error::Device`](crate::Error::Device), also if `len` exceeds the capacity.
    pub fn record(&self, batch: &mut Batch<'_>, len: usize) -> Result<()> {
        self.list.bytes(&(0..len.saturating_add(1)))?;
        batch.clear(&self.list);
        let [(count, a), (scan, b), (scatter, c)] = &self.stages;
        batch.dispatch(count, a, len)?;
        batch.dispatch_one_group(scan, b, len.div_ceil((GROUP * ITEMS) as usize))?;
        batch.dispatch(scatter, c, len)
    }

    /// Most items it can take.
    pub fn capacity(&self) -> usize {
        self.capacity
    }

    /// The number of matches, then their indices in order; kernels bind it.
    pub fn list(&self) -> &Buffer<u32> {
        &self.list
    }

    /// The matching indices of the last submission; waits for it.
    ///
    /// # Errors
    /// [`Error::Device`](crate::Error::Device).
    pub fn read(&self, gpu: &Gpu) -> Result<Vec<u32>> {
        let count = gpu.read(&self.list, 0..1)?.first().map_or(0, |n| *n as usize);
        gpu.read(&self.list, 1..count + 1)
    }
}
