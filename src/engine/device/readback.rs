//! Bringing results back: one read, several reads of one submission, or a ring that lets the next
//! tile compute while the last one is copied.

use std::collections::VecDeque;
use std::marker::PhantomData;
use std::ops::Range;

use bytemuck::Pod;

use super::arrival::{Arrival, arrival};
use super::buffer::Buffer;
use super::dispatch::{Batch, Submission};
use super::gpu::{Gpu, Share};
use super::waiting::block_on;
use crate::error::{Error, Result};

/// A staging buffer, and the copy into it that is under way.
#[derive(Debug)]
struct Slot {
    raw: wgpu::Buffer,
    _share: Share,
    pending: Option<(u64, Arrival)>,
}

impl Slot {
    fn new(gpu: &Gpu, label: &str, bytes: u64) -> Result<Self> {
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let (raw, _share) = gpu.allocate(label, bytes, usage)?;
        Ok(Self { raw, _share, pending: None })
    }

    /// Adds the copies of elements `ranges` of `from`, one after the other; there is room for
    /// `most`.
    fn record<T: Pod>(
        &mut self,
        batch: &mut Batch<'_>,
        from: &Buffer<T>,
        ranges: &[Range<usize>],
        most: usize,
    ) -> Result<()> {
        let room = most as u64 * size_of::<T>() as u64;
        let mut bytes = 0;
        for range in ranges {
            let source = from.bytes(range)?;
            let count = source.end - source.start;
            if bytes + count > room || !count.is_multiple_of(wgpu::COPY_BUFFER_ALIGNMENT) || self.pending.is_some() {
                return Err(fault("a readback does not fit its staging buffer"));
            }
            if count > 0 {
                batch.encoder().copy_buffer_to_buffer(&from.raw, source.start, &self.raw, bytes, count);
            }
            bytes += count;
        }
        let (herald, mapped) = arrival();
        if bytes > 0 {
            batch.encoder().map_buffer_on_submit(&self.raw, wgpu::MapMode::Read, 0..bytes, move |outcome| {
                herald.tell(outcome.map_err(|e| e.to_string()));
            });
        }
        self.pending = Some((bytes, mapped));
        Ok(())
    }

    /// Hands the values to `use_`. Outside of a browser their submission was waited for: copies end
    /// while somebody does.
    async fn take<T: Pod, R>(&mut self, gpu: &Gpu, use_: impl FnOnce(&[T]) -> R) -> Result<R> {
        let Some((bytes, mapped)) = self.pending.take() else { return Err(fault("nothing was read back")) };
        if bytes == 0 {
            return Ok(use_(&[]));
        }
        let lost = |e: String| Error::Device {
            what: format!("results could not be read back: {e}"),
            remedy: "Start again, or use --backend cpu".into(),
        };
        mapped.await.map_err(lost)?;
        let view = self.raw.get_mapped_range(0..bytes).map_err(|e| lost(e.to_string()))?;
        // In a browser the view is a copy, which may lie at any address.
        let used = match bytemuck::try_cast_slice(&view) {
            Ok(values) => use_(values),
            Err(_) => use_(&bytemuck::pod_collect_to_vec::<u8, T>(&view)),
        };
        drop(view);
        gpu.counters.down(bytes);
        self.raw.unmap();
        Ok(used)
    }
}

fn fault(what: &str) -> Error {
    Error::Device { what: what.into(), remedy: "This is a fault of barymap: please report it".into() }
}

/// Where values come back to the host, again and again. Several of one batch are brought back by
/// one wait for its submission.
#[derive(Debug)]
pub struct Staging<'a, T> {
    gpu: &'a Gpu,
    slot: Slot,
    len: usize,
    _type: PhantomData<fn() -> T>,
}

impl<'a, T: Pod> Staging<'a, T> {
    /// Room for `len` values.
    ///
    /// # Errors
    /// [`Error::Memory`] past the budget, [`Error::Device`] if the device refuses.
    pub fn new(gpu: &'a Gpu, label: &str, len: usize) -> Result<Self> {
        let slot = Slot::new(gpu, label, len as u64 * size_of::<T>() as u64)?;
        Ok(Self { gpu, slot, len, _type: PhantomData })
    }

    /// Adds the copies of elements `ranges` of `from`, one after the other, to a batch.
    ///
    /// # Errors
    /// [`Error::Device`] if they do not fit, or the last copies were not taken.
    pub fn record(&mut self, batch: &mut Batch<'_>, from: &Buffer<T>, ranges: &[Range<usize>]) -> Result<()> {
        self.slot.record(batch, from, ranges, self.len)
    }

    /// Adds the copy of all of `from` to a batch.
    ///
    /// # Errors
    /// As [`Staging::record`].
    pub fn record_all(&mut self, batch: &mut Batch<'_>, from: &Buffer<T>) -> Result<()> {
        let all = 0..from.len();
        self.slot.record(batch, from, &[all], self.len)
    }

    /// Hands the values of the last copies to `use_` if they have arrived; returns at once. Their
    /// batch may lie in another's encoder, which its owner has submitted or will.
    ///
    /// # Errors
    /// As [`Staging::take`], and if the encoder was dropped.
    pub fn poll<R>(&mut self, use_: impl FnOnce(&[T]) -> R) -> Result<Option<R>> {
        let _ = self.gpu.device.poll(wgpu::PollType::Poll);
        self.gpu.check()?;
        let arrived = self.slot.pending.as_ref().is_none_or(|(_, arrival)| arrival.is_there());
        arrived.then(|| block_on(self.slot.take(self.gpu, use_))).transpose()
    }

    /// Hands the values of the last copies to `use_`. The caller has waited for its submission.
    ///
    /// # Errors
    /// [`Error::Device`] if there was none, the device is lost or does not answer in time.
    pub fn take<R>(&mut self, use_: impl FnOnce(&[T]) -> R) -> Result<R> {
        self.gpu.check()?;
        block_on(self.slot.take(self.gpu, use_))
    }
}

/// A ring of staging buffers: results come back in the order they were asked for, up to `depth` at
/// a time.
#[derive(Debug)]
pub struct ReadbackRing<'a, T> {
    gpu: &'a Gpu,
    free: Vec<Slot>,
    pending: VecDeque<(Slot, Submission)>,
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
        let free = (0..depth.max(1)).map(|_| Slot::new(gpu, label, bytes)).collect::<Result<Vec<_>>>()?;
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
        let mut slot = self.free.pop().ok_or_else(|| fault("more readbacks are pending than were planned"))?;
        slot.record(&mut batch, from, &[range], self.len)?;
        self.pending.push_back((slot, batch.submit()?));
        Ok(())
    }

    /// Waits for the oldest copy and returns its values; `None` if nothing is pending.
    ///
    /// # Errors
    /// [`Error::Device`] if the device is lost or does not answer in time.
    pub fn pop(&mut self) -> Result<Option<Vec<T>>> {
        block_on(self.next())
    }

    async fn next(&mut self) -> Result<Option<Vec<T>>> {
        let Some((mut slot, submission)) = self.pending.pop_front() else { return Ok(None) };
        // A browser says by itself when it has copied, and meanwhile what it objects to.
        self.gpu.wait(&submission)?;
        self.gpu.settle().await?;
        let values = slot.take(self.gpu, <[T]>::to_vec).await?;
        self.free.push(slot);
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
        block_on(self.read_async(from, range))
    }

    /// [`Gpu::read`] for a browser, where no thread can wait. What the device objects to in the
    /// work before it is an error here: a browser tells no earlier. Elsewhere the thread is kept
    /// until the values are there.
    ///
    /// # Errors
    /// As [`Gpu::read`].
    ///
    /// # Examples
    /// ```no_run
    /// # async fn example() -> Result<(), barymap::Error> {
    /// use barymap::engine::{Backend, Engine, EngineOptions};
    /// let engine = Engine::start(EngineOptions { backend: Backend::Gpu, ..EngineOptions::default() }).await?;
    /// let Some(gpu) = engine.gpu() else { return Ok(()) };
    /// let buffer = gpu.upload("numbers", &[1u32, 2, 3])?;
    /// assert_eq!(gpu.read_async(&buffer, 1..3).await?, [2, 3]);
    /// # Ok(())
    /// # }
    /// ```
    pub async fn read_async<T: Pod>(&self, from: &Buffer<T>, range: Range<usize>) -> Result<Vec<T>> {
        if range.is_empty() {
            self.check()?;
            return from.bytes(&range).map(|_| Vec::new());
        }
        let mut ring = ReadbackRing::new(self, "readback", 1, range.len())?;
        ring.push(self.batch()?, from, range)?;
        Ok(ring.next().await?.unwrap_or_default())
    }
}
