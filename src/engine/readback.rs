//! Bringing results back: one read, or a ring that lets the next tile compute while the last one is
//! copied.

use std::collections::VecDeque;
use std::marker::PhantomData;
use std::ops::Range;
use std::sync::mpsc::{Receiver, channel};

use bytemuck::Pod;

use super::buffer::Buffer;
use super::dispatch::{Batch, Submission};
use super::gpu::{Gpu, Share};
use crate::error::{Error, Result};

type Outcome = std::result::Result<(), wgpu::BufferAsyncError>;

/// A staging buffer that results are copied into.
#[derive(Debug)]
struct Slot {
    raw: wgpu::Buffer,
    _share: Share,
}

/// A copy under way.
#[derive(Debug)]
struct Pending {
    slot: Slot,
    bytes: u64,
    submission: Submission,
    mapped: Receiver<Outcome>,
}

/// A ring of staging buffers: results come back in the order they were asked for, up to `depth` at
/// a time.
#[derive(Debug)]
pub struct ReadbackRing<'a, T> {
    gpu: &'a Gpu,
    free: Vec<Slot>,
    pending: VecDeque<Pending>,
    len: usize,
    _type: PhantomData<fn() -> T>,
}

impl<'a, T: Pod> ReadbackRing<'a, T> {
    /// A ring of `depth` staging buffers of `len` values each.
    ///
    /// # Errors
    /// [`Error::Memory`] past the budget, [`Error::Device`] if the device refuses.
    pub fn new(gpu: &'a Gpu, label: &str, depth: usize, len: usize) -> Result<Self> {
        let bytes = len as u64 * size_of::<T>() as u64;
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let free = (0..depth.max(1))
            .map(|_| gpu.allocate(label, bytes, usage).map(|(raw, _share)| Slot { raw, _share }))
            .collect::<Result<Vec<_>>>()?;
        Ok(Self { gpu, free, pending: VecDeque::new(), len, _type: PhantomData })
    }

    /// Whether every staging buffer is in use: [`ReadbackRing::pop`] first.
    pub fn is_full(&self) -> bool {
        self.free.is_empty()
    }

    /// Submits `batch` and, after it, the copy of elements `range` of `from`.
    ///
    /// # Errors
    /// [`Error::Device`] if the ring is full, the range does not fit or the device refuses.
    pub fn push(&mut self, mut batch: Batch<'_>, from: &Buffer<T>, range: Range<usize>) -> Result<()> {
        let source = from.bytes(&range)?;
        let bytes = source.end - source.start;
        let fault = |what: &str| Error::Device {
            what: what.into(),
            remedy: "This is a fault of barymap: please report it".into(),
        };
        if range.len() > self.len || !bytes.is_multiple_of(wgpu::COPY_BUFFER_ALIGNMENT) {
            return Err(fault("a readback does not fit its staging buffer"));
        }
        let slot = self.free.pop().ok_or_else(|| fault("more readbacks are pending than were planned"))?;
        let (tell, mapped) = channel();
        if bytes > 0 {
            batch.encoder.copy_buffer_to_buffer(&from.raw, source.start, &slot.raw, 0, bytes);
            batch.encoder.map_buffer_on_submit(&slot.raw, wgpu::MapMode::Read, 0..bytes, move |outcome| {
                // The receiver is gone only if the ring was dropped before the copy ended.
                let _ = tell.send(outcome);
            });
        }
        let submission = batch.submit()?;
        self.pending.push_back(Pending { slot, bytes, submission, mapped });
        Ok(())
    }

    /// Waits for the oldest copy and returns its values; `None` if nothing is pending.
    ///
    /// # Errors
    /// [`Error::Device`] if the device is lost or does not answer in time.
    pub fn pop(&mut self) -> Result<Option<Vec<T>>> {
        let Some(p) = self.pending.pop_front() else { return Ok(None) };
        self.gpu.wait(&p.submission)?;
        let mut values = vec![T::zeroed(); p.bytes as usize / size_of::<T>().max(1)];
        if p.bytes > 0 {
            let lost = |e: String| Error::Device {
                what: format!("results could not be read back: {e}"),
                remedy: "Start again, or use --backend cpu".into(),
            };
            p.mapped
                .recv_timeout(self.gpu.timeout)
                .map_err(|e| lost(e.to_string()))?
                .map_err(|e| lost(e.to_string()))?;
            let view = p.slot.raw.get_mapped_range(0..p.bytes).map_err(|e| lost(e.to_string()))?;
            bytemuck::cast_slice_mut::<T, u8>(&mut values).copy_from_slice(&view);
            drop(view);
            self.gpu.counters.down(p.bytes);
            p.slot.raw.unmap();
        }
        self.free.push(p.slot);
        Ok(Some(values))
    }
}

impl Gpu {
    /// Elements `range` of a buffer, after everything submitted so far.
    ///
    /// # Errors
    /// [`Error::Device`] if the range leaves the buffer, the device is lost or does not answer in
    /// time.
    pub fn read<T: Pod>(&self, from: &Buffer<T>, range: Range<usize>) -> Result<Vec<T>> {
        if range.is_empty() {
            self.check()?;
            return from.bytes(&range).map(|_| Vec::new());
        }
        let mut ring = ReadbackRing::new(self, "readback", 1, range.len())?;
        ring.push(self.batch()?, from, range)?;
        Ok(ring.pop()?.unwrap_or_default())
    }
}
