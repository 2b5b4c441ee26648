//! Submitting work: batches of dispatches, time slices, waiting.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, PoisonError};
use std::time::Duration;

use web_time::Instant;

use super::buffer::{BindGroup, Buffer};
use super::gpu::{Gpu, Pipeline};
use super::waiting::CAN_WAIT;
use crate::control;
use crate::engine::kernel::{GROUP, Kernel, Span};
use crate::error::{Error, Result};

/// Time one slice is planned to take. Desktop drivers end work that takes about two seconds, and
/// the machine should stay usable meanwhile.
const SLICE: Duration = Duration::from_millis(150);

/// A wait looks this often whether work was cancelled.
const WAIT_PART: Duration = Duration::from_millis(50);

/// Pauses between two looks whether a submission has ended: at first, and at most.
const LEAST_PAUSE: Duration = Duration::from_micros(20);
const MOST_PAUSE: Duration = Duration::from_millis(1);

/// Items of the first slice of a kernel whose pace is not known.
const PROBE: u32 = 4096;

/// Dispatches and copies that the device works on in order; each sees what those before it wrote.
///
/// A batch is submitted by itself ([`Gpu::batch`], [`Batch::submit`]), or written into an encoder
/// that its owner submits ([`Gpu::batch_into`], [`Batch::encode`]).
#[derive(Debug)]
pub struct Batch<'a> {
    gpu: &'a Gpu,
    encoder: Encoder<'a>,
    /// The spans of each bind group used, written when the batch is submitted.
    spans: Vec<(wgpu::Buffer, Vec<Span>)>,
}

/// Where commands are written.
#[derive(Debug)]
enum Encoder<'a> {
    Own(Box<wgpu::CommandEncoder>),
    Lent(&'a mut wgpu::CommandEncoder),
}

/// Tells one submission from others.
#[derive(Clone, Debug)]
pub struct Submission {
    /// Set by the device's callback, which comes while somebody polls.
    ended: Arc<AtomicBool>,
}

impl Gpu {
    /// An empty batch.
    ///
    /// # Errors
    /// [`Error::Device`] if the device is lost.
    pub fn batch(&self) -> Result<Batch<'_>> {
        let encoder = self.scoped("batch", || self.device.create_command_encoder(&Default::default()))?;
        Ok(Batch { gpu: self, encoder: Encoder::Own(Box::new(encoder)), spans: Vec::new() })
    }

    /// An empty batch in an encoder of this device. [`Batch::encode`] ends it; the owner of the
    /// encoder submits it.
    ///
    /// # Errors
    /// [`Error::Device`] if the device is lost.
    pub fn batch_into<'a>(&'a self, encoder: &'a mut wgpu::CommandEncoder) -> Result<Batch<'a>> {
        self.check()?;
        Ok(Batch { gpu: self, encoder: Encoder::Lent(encoder), spans: Vec::new() })
    }

    /// Submits commands, and what was written to buffers before.
    pub(super) fn send(&self, commands: Option<wgpu::CommandBuffer>) -> Submission {
        self.queue.submit(commands);
        let ended = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&ended);
        self.queue.on_submitted_work_done(move || flag.store(true, Ordering::Release));
        Submission { ended }
    }

    /// Waits for a submission. In a browser, where no thread can, it returns at once;
    /// [`Gpu::read_async`] waits there.
    ///
    /// # Errors
    /// [`Error::Device`] after the time limit of the engine's options, or if the device is lost.
    pub fn wait(&self, submission: &Submission) -> Result<()> {
        self.check()?;
        self.counters.wait();
        if !CAN_WAIT {
            return self.check();
        }
        let begun = Instant::now();
        let (mut looked, mut pause) = (begun, LEAST_PAUSE);
        loop {
            // Not `PollType::Wait`: where such a wait ends early while another thread, or the
            // window that lent its device, empties the queue, wgpu takes that for a fault of its
            // own and panics.
            let _ = self.device.poll(wgpu::PollType::Poll);
            self.check()?;
            if submission.ended.load(Ordering::Acquire) {
                return Ok(());
            }
            if begun.elapsed() > self.timeout {
                return Err(Error::Device {
                    what: format!("no answer after {:.0} s", self.timeout.as_secs_f64()),
                    remedy: "The driver hangs or the machine is overloaded: try again or use --backend cpu".into(),
                });
            }
            if looked.elapsed() > WAIT_PART {
                control::check()?;
                looked = Instant::now();
            }
            std::thread::sleep(pause);
            pause = (2 * pause).min(MOST_PAUSE);
        }
    }

    /// Whether a submission has ended; returns at once.
    ///
    /// # Errors
    /// [`Error::Device`] if the device is lost.
    pub fn is_done(&self, submission: &Submission) -> Result<bool> {
        if !submission.ended.load(Ordering::Acquire) {
            let _ = self.device.poll(wgpu::PollType::Poll);
        }
        self.check()?;
        Ok(submission.ended.load(Ordering::Acquire))
    }

    /// Runs a kernel over items `0..items` in slices of about 0.15 s each and waits for the last;
    /// `done` hears how many more items are finished. Two slices are under way at a time, so that
    /// the device does not idle between them.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub fn run(&self, pipeline: &Pipeline, group: &BindGroup, items: usize, mut done: impl FnMut(u64)) -> Result<()> {
        let total = u32::try_from(items).map_err(|_| Error::Capability {
            limit: format!("items of kernel {}", pipeline.kernel.name),
            required: items as u64,
            actual: u64::from(u32::MAX),
        })?;
        let mut first = 0;
        let mut pending: Option<(Submission, u32)> = None;
        let mut mark = Instant::now();
        while first < total {
            // Without waits there is nothing to learn: slices stay those of an unknown kernel.
            let known = !CAN_WAIT || pipeline.pace.load(Ordering::Relaxed) != 0;
            let count = self.slice(pipeline).min(total - first);
            let mut batch = self.batch()?;
            batch.dispatch_range(pipeline, group, first, count)?;
            let submission = batch.submit()?;
            first += count;
            if !known {
                // The first dispatch of a kernel holds its compilation, so its time says nothing
                // about its pace; the second, of the same items, does.
                self.wait(&submission)?;
                mark = Instant::now();
                let mut again = self.batch()?;
                again.dispatch_range(pipeline, group, first - count, count)?;
                self.wait(&again.submit()?)?;
                learn(pipeline, mark.elapsed(), count);
                mark = Instant::now();
                done(u64::from(count));
                continue;
            }
            if let Some((before, n)) = pending.replace((submission, count)) {
                self.wait(&before)?;
                learn(pipeline, mark.elapsed(), n);
                mark = Instant::now();
                done(u64::from(n));
            }
        }
        if let Some((last, n)) = pending {
            self.wait(&last)?;
            learn(pipeline, mark.elapsed(), n);
            done(u64::from(n));
        }
        Ok(())
    }

    /// Items of this kernel that take about one time slice.
    pub fn slice(&self, pipeline: &Pipeline) -> u32 {
        let per_group = pipeline.kernel.items_per_group();
        let most = u64::from(per_group) * u64::from(self.capabilities.max_groups);
        let pace = pipeline.pace.load(Ordering::Relaxed);
        let items = (SLICE.as_nanos() as u64 * 1000).checked_div(pace).unwrap_or(u64::from(PROBE));
        let items = items.clamp(1, most).min(u64::from(u32::MAX / 2)) as u32;
        items.next_multiple_of(per_group)
    }
}

/// Takes over a measured pace; halfway, so that one disturbed slice does not change the next
/// sixfold.
fn learn(pipeline: &Pipeline, time: Duration, items: u32) {
    if !CAN_WAIT {
        return;
    }
    let pace = (time.as_nanos() as u64).saturating_mul(1000) / u64::from(items.max(1));
    let before = pipeline.pace.load(Ordering::Relaxed);
    let mean = if before == 0 { pace } else { before / 2 + pace / 2 };
    pipeline.pace.store(mean.max(1), Ordering::Relaxed);
}

fn fault(kernel: &Kernel, what: &str) -> Error {
    Error::Device {
        what: format!("kernel {}: {what}", kernel.name),
        remedy: "This is a fault of barymap: please report it".into(),
    }
}

impl Batch<'_> {
    pub(super) fn encoder(&mut self) -> &mut wgpu::CommandEncoder {
        match &mut self.encoder {
            Encoder::Own(encoder) => encoder,
            Encoder::Lent(encoder) => encoder,
        }
    }

    /// Adds a dispatch over items `0..items`; nothing for none. The caller keeps the work of a
    /// batch within a time slice ([`Gpu::slice`]).
    ///
    /// # Errors
    /// [`Error::Device`] if the items are too many for one dispatch or the bind group is of another
    /// kernel.
    pub fn dispatch(&mut self, pipeline: &Pipeline, group: &BindGroup, items: usize) -> Result<()> {
        let count = u32::try_from(items).unwrap_or(u32::MAX);
        self.dispatch_range(pipeline, group, 0, count)
    }

    /// Adds a dispatch over `items` items from `first` on.
    ///
    /// # Errors
    /// As [`Batch::dispatch`].
    pub fn dispatch_range(&mut self, pipeline: &Pipeline, group: &BindGroup, first: u32, items: u32) -> Result<()> {
        self.dispatch_placed(pipeline, group, (first, items), 0)
    }

    /// The same of `items` items from `first` on, with a row that the kernel counts rows from.
    ///
    /// # Errors
    /// As [`Batch::dispatch`].
    pub fn dispatch_placed(
        &mut self,
        pipeline: &Pipeline,
        group: &BindGroup,
        (first, items): (u32, u32),
        place: u32,
    ) -> Result<()> {
        let (span, groups) = match Span::grid(pipeline.kernel, first, items, self.gpu.capabilities.max_groups) {
            _ if items == 0 => return Ok(()),
            Some(grid) => grid,
            None => return Err(fault(pipeline.kernel, &format!("{items} items from {first} do not fit one dispatch"))),
        };
        self.record(pipeline, group, Span { place, ..span }, groups)
    }

    /// Adds a dispatch in which a single workgroup works on items `0..items`; nothing for none.
    ///
    /// # Errors
    /// As [`Batch::dispatch`].
    pub fn dispatch_one_group(&mut self, pipeline: &Pipeline, group: &BindGroup, items: usize) -> Result<()> {
        let end = u32::try_from(items).map_err(|_| fault(pipeline.kernel, "too many items for one workgroup"))?;
        if end == 0 {
            return Ok(());
        }
        self.record(pipeline, group, Span { first: 0, end, row: GROUP, place: 0 }, [1, 1])
    }

    /// Adds a dispatch of `groups` workgroups, each of which works on all items from `first` to
    /// `end`.
    ///
    /// # Errors
    /// [`Error::Device`] if there are more groups than one dimension holds or the bind group is of
    /// another kernel.
    pub fn dispatch_each_group(
        &mut self,
        pipeline: &Pipeline,
        group: &BindGroup,
        first: u32,
        end: u32,
        groups: u32,
    ) -> Result<()> {
        if first >= end || groups == 0 {
            return Ok(());
        }
        if groups > self.gpu.capabilities.max_groups {
            return Err(fault(pipeline.kernel, &format!("{groups} workgroups do not fit one dispatch")));
        }
        self.record(pipeline, group, Span { first, end, row: groups * GROUP, place: 0 }, [groups, 1])
    }

    /// Adds a dispatch over the texels of `rows` of a picture that has `width` texels in a row: the
    /// number of an invocation is its column, and its row counts from `rows.start`. The rows are
    /// the span's items; `place` goes with the span and says where the first of them is kept.
    ///
    /// # Errors
    /// As [`Batch::dispatch`].
    pub fn dispatch_rows(
        &mut self,
        pipeline: &Pipeline,
        group: &BindGroup,
        rows: std::ops::Range<u32>,
        width: u32,
        place: u32,
    ) -> Result<()> {
        let kernel = pipeline.kernel;
        let groups = [width.div_ceil(kernel.items_per_group()), rows.len() as u32];
        if groups.contains(&0) {
            return Ok(());
        }
        if groups.iter().any(|&g| g > self.gpu.capabilities.max_groups) {
            return Err(fault(kernel, &format!("{width} x {} texels do not fit one dispatch", rows.len())));
        }
        self.record(pipeline, group, Span { first: rows.start, end: rows.end, row: width, place }, groups)
    }

    fn record(&mut self, pipeline: &Pipeline, group: &BindGroup, span: Span, [x, y]: [u32; 2]) -> Result<()> {
        let kernel = pipeline.kernel;
        if group.kernel != kernel.name {
            return Err(fault(kernel, &format!("dispatched with the bindings of {}", group.kernel)));
        }
        let index = self.spans.iter().position(|(b, _)| *b == group.spans).unwrap_or_else(|| {
            self.spans.push((group.spans.clone(), Vec::new()));
            self.spans.len() - 1
        });
        let used = &mut self.spans[index].1;
        let slot = used.iter().position(|s| *s == span).unwrap_or_else(|| {
            used.push(span);
            used.len() - 1
        });
        if slot >= group.slots {
            return Err(fault(kernel, &format!("more than {} different dispatches in a batch", group.slots)));
        }
        let offset = slot as u32 * self.gpu.span_stride();
        self.gpu.counters.dispatch();
        let mut pass = self
            .encoder()
            .begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some(kernel.name), timestamp_writes: None });
        pass.set_pipeline(&pipeline.pipeline);
        pass.set_bind_group(0, &group.raw, &[offset]);
        pass.dispatch_workgroups(x, y, 1);
        Ok(())
    }

    /// Adds a copy of `count` elements between buffers.
    ///
    /// # Errors
    /// [`Error::Device`] if a range leaves its buffer.
    pub fn copy<T: bytemuck::Pod>(
        &mut self,
        from: &Buffer<T>,
        from_first: usize,
        to: &Buffer<T>,
        to_first: usize,
        count: usize,
    ) -> Result<()> {
        let a = from.bytes(&(from_first..from_first.saturating_add(count)))?;
        let b = to.bytes(&(to_first..to_first.saturating_add(count)))?;
        if count > 0 {
            self.encoder().copy_buffer_to_buffer(&from.raw, a.start, &to.raw, b.start, a.end - a.start);
        }
        Ok(())
    }

    /// Sets all of a buffer to zero.
    pub fn clear<T>(&mut self, buffer: &Buffer<T>) {
        self.encoder().clear_buffer(&buffer.raw, 0, None);
    }

    /// Hands the batch to the device.
    ///
    /// # Errors
    /// [`Error::Device`] if the device refuses it, or the encoder is another's.
    pub fn submit(self) -> Result<Submission> {
        let Self { gpu, encoder, spans } = self;
        let Encoder::Own(encoder) = encoder else {
            return Err(Error::Device {
                what: "a batch in another's encoder was submitted".into(),
                remedy: "This is a fault of barymap: please report it".into(),
            });
        };
        gpu.scoped("submission", || {
            // Spans are written right before the submission that reads them; another thread's must
            // not come between.
            let _turn = gpu.submitting.lock().unwrap_or_else(PoisonError::into_inner);
            write_spans(gpu, &spans);
            gpu.counters.submission();
            gpu.send(Some(encoder.finish()))
        })
    }

    /// Ends a batch in an encoder of [`Gpu::batch_into`]. Nothing is submitted, waited for or
    /// allocated. The owner submits the encoder before anything else is submitted that uses the
    /// same bind groups: the spans are written here.
    ///
    /// # Errors
    /// [`Error::Device`] if the device refuses.
    pub fn encode(self) -> Result<()> {
        self.gpu.scoped("spans", || write_spans(self.gpu, &self.spans))
    }
}

/// Writes the spans of bind groups.
fn write_spans(gpu: &Gpu, spans: &[(wgpu::Buffer, Vec<Span>)]) {
    let stride = u64::from(gpu.span_stride());
    for (buffer, spans) in spans {
        for (slot, span) in spans.iter().enumerate() {
            gpu.queue.write_buffer(buffer, slot as u64 * stride, bytemuck::bytes_of(span));
            gpu.counters.up(size_of::<Span>() as u64);
        }
    }
}
