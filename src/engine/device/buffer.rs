//! Typed buffers, uniform blocks, and what binds them to a kernel.

use std::marker::PhantomData;
use std::ops::Range;

use bytemuck::Pod;

use super::gpu::{Gpu, Pipeline, Share};
use crate::engine::kernel::{BindingKind, Span, UNIFORM_BLOCK};
use crate::error::{Error, Result};

/// Smallest allocation: nothing of size zero can be bound.
const LEAST: u64 = 16;

/// Device memory holding `len` values of `T`; counted against the memory budget until dropped.
#[derive(Debug)]
pub struct Buffer<T> {
    pub(super) raw: wgpu::Buffer,
    len: usize,
    _share: Share,
    _type: PhantomData<fn() -> T>,
}

impl<T: Pod> Buffer<T> {
    /// Number of values.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The whole buffer, to bind it.
    pub fn bind(&self) -> Binding<'_> {
        Binding(wgpu::BindingResource::Buffer(self.raw.as_entire_buffer_binding()))
    }

    /// Byte range of elements.
    ///
    /// # Errors
    /// [`Error::Device`] if the range leaves the buffer.
    pub(in crate::engine) fn bytes(&self, range: &Range<usize>) -> Result<Range<u64>> {
        if range.start > range.end || range.end > self.len {
            return Err(Error::Device {
                what: format!("elements {}..{} of a buffer of {}", range.start, range.end, self.len),
                remedy: "This is a fault of barymap: please report it".into(),
            });
        }
        let size = size_of::<T>() as u64;
        Ok(range.start as u64 * size..range.end as u64 * size)
    }
}

/// What all invocations read in step: blocks of at most 16 KiB, which every device binds and which
/// a software device reads ten times faster than storage. A kernel sees one block at a time.
#[derive(Debug)]
pub struct UniformBlocks<T> {
    raw: wgpu::Buffer,
    len: usize,
    _share: Share,
    _type: PhantomData<fn() -> T>,
}

impl<T: Pod> UniformBlocks<T> {
    /// Values in a full block.
    pub const PER_BLOCK: usize = UNIFORM_BLOCK as usize / size_of::<T>();

    /// Number of blocks; at least one.
    pub fn blocks(&self) -> usize {
        self.len.div_ceil(Self::PER_BLOCK).max(1)
    }

    /// Values in block `index`.
    pub fn block_len(&self, index: usize) -> usize {
        self.len.saturating_sub(index * Self::PER_BLOCK).min(Self::PER_BLOCK)
    }

    /// Block `index`, to bind it. The bound range is always a whole block; values past the end are
    /// zero.
    pub fn bind(&self, index: usize) -> Binding<'_> {
        Binding(wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: &self.raw,
            offset: index.min(self.blocks() - 1) as u64 * UNIFORM_BLOCK,
            size: wgpu::BufferSize::new(UNIFORM_BLOCK),
        }))
    }
}

/// Something a kernel can bind.
#[derive(Clone, Debug)]
pub struct Binding<'a>(pub(super) wgpu::BindingResource<'a>);

/// The buffers of one kernel, ready to dispatch; built once, used many times.
#[derive(Debug)]
pub struct BindGroup {
    pub(super) raw: wgpu::BindGroup,
    pub(super) spans: wgpu::Buffer,
    pub(super) kernel: &'static str,
    /// Room for the different spans of a batch.
    pub(super) slots: usize,
}

/// Different spans that dispatches of one bind group can have within a batch.
const SPAN_SLOTS: usize = 16;

impl Gpu {
    /// A buffer of `len` zeroed values.
    ///
    /// # Errors
    /// [`Error::Capability`] if it is larger than a binding may be, [`Error::Memory`] past the
    /// budget, [`Error::Device`] if the device refuses.
    pub fn buffer<T: Pod>(&self, label: &str, len: usize) -> Result<Buffer<T>> {
        let most = self.capabilities.max_elements::<T>();
        if len as u64 > most {
            return Err(Error::Capability {
                limit: format!("elements in buffer '{label}'"),
                required: len as u64,
                actual: most,
            });
        }
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
        let (raw, share) = self.allocate(label, len as u64 * size_of::<T>() as u64, usage)?;
        Ok(Buffer { raw, len, _share: share, _type: PhantomData })
    }

    /// A buffer holding `values`.
    ///
    /// # Errors
    /// As [`Gpu::buffer`].
    pub fn upload<T: Pod>(&self, label: &str, values: &[T]) -> Result<Buffer<T>> {
        let buffer = self.buffer(label, values.len())?;
        self.write(&buffer, 0, values)?;
        Ok(buffer)
    }

    /// Overwrites elements from `first` on. What was submitted before still sees the old values.
    ///
    /// # Errors
    /// [`Error::Device`] if the values do not fit or the device refuses.
    pub fn write<T: Pod>(&self, buffer: &Buffer<T>, first: usize, values: &[T]) -> Result<()> {
        let bytes = buffer.bytes(&(first..first.saturating_add(values.len())))?;
        if values.is_empty() {
            return self.check();
        }
        self.counters.up(bytes.end - bytes.start);
        self.scoped("upload", || self.queue.write_buffer(&buffer.raw, bytes.start, bytemuck::cast_slice(values)))
    }

    /// A uniform block holding one parameter struct.
    ///
    /// # Errors
    /// As [`Gpu::uniform_blocks`].
    pub fn uniform<T: Pod>(&self, label: &str, value: &T) -> Result<UniformBlocks<T>> {
        self.uniform_blocks(label, std::slice::from_ref(value))
    }

    /// Uniform blocks holding `values`. The size of `T` must divide 16 KiB or the rest of each
    /// block stays unused.
    ///
    /// # Errors
    /// [`Error::Memory`] past the budget, [`Error::Device`] if `T` exceeds a block or the device
    /// refuses.
    pub fn uniform_blocks<T: Pod>(&self, label: &str, values: &[T]) -> Result<UniformBlocks<T>> {
        let per = UniformBlocks::<T>::PER_BLOCK;
        if per == 0 {
            return Err(Error::Device {
                what: format!("uniform '{label}' holds values larger than a block"),
                remedy: "This is a fault of barymap: please report it".into(),
            });
        }
        let blocks = values.len().div_ceil(per).max(1) as u64;
        let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let (raw, share) = self.allocate(label, blocks * UNIFORM_BLOCK, usage)?;
        self.scoped("upload", || self.fill_blocks(&raw, values))?;
        Ok(UniformBlocks { raw, len: values.len(), _share: share, _type: PhantomData })
    }

    /// Overwrites the first values of uniform blocks. What was submitted before still sees the old
    /// ones.
    ///
    /// # Errors
    /// [`Error::Device`] if there are more values than the blocks were made for, or the device
    /// refuses.
    pub fn write_uniform<T: Pod>(&self, blocks: &UniformBlocks<T>, values: &[T]) -> Result<()> {
        if values.len() > blocks.len {
            return Err(Error::Device {
                what: format!("{} values for uniform blocks of {}", values.len(), blocks.len),
                remedy: "This is a fault of barymap: please report it".into(),
            });
        }
        self.scoped("upload", || self.fill_blocks(&blocks.raw, values))
    }

    fn fill_blocks<T: Pod>(&self, raw: &wgpu::Buffer, values: &[T]) {
        for (i, block) in values.chunks(UniformBlocks::<T>::PER_BLOCK.max(1)).enumerate() {
            self.queue.write_buffer(raw, i as u64 * UNIFORM_BLOCK, bytemuck::cast_slice(block));
            self.counters.up(size_of_val(block) as u64);
        }
    }

    /// Binds `bindings`, in the order of the kernel's table.
    ///
    /// # Errors
    /// [`Error::Device`] if they do not fit the kernel.
    pub fn bind(&self, pipeline: &Pipeline, bindings: &[Binding<'_>]) -> Result<BindGroup> {
        let kernel = pipeline.kernel;
        if bindings.len() != kernel.bindings.len() {
            return Err(Error::Device {
                what: format!("kernel {} binds {}, not {}", kernel.name, kernel.bindings.len(), bindings.len()),
                remedy: "This is a fault of barymap: please report it".into(),
            });
        }
        let stride = u64::from(self.span_stride());
        self.counters.allocation();
        let spans = self.scoped("spans", || {
            self.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(kernel.name),
                size: stride * SPAN_SLOTS as u64,
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        })?;
        let span = wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: &spans,
            offset: 0,
            size: wgpu::BufferSize::new(size_of::<Span>() as u64),
        });
        let entries: Vec<wgpu::BindGroupEntry<'_>> = std::iter::once(span)
            .chain(bindings.iter().map(|b| b.0.clone()))
            .zip(0..)
            .map(|(resource, binding)| wgpu::BindGroupEntry { binding, resource })
            .collect();
        let raw = self.scoped(&format!("bindings of kernel {}", kernel.name), || {
            self.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some(kernel.name),
                layout: &pipeline.layout,
                entries: &entries,
            })
        })?;
        Ok(BindGroup { raw, spans, kernel: kernel.name, slots: SPAN_SLOTS })
    }

    /// Distance of two spans in their buffer.
    pub(super) fn span_stride(&self) -> u32 {
        (size_of::<Span>() as u32).next_multiple_of(self.capabilities.uniform_alignment.max(1))
    }

    pub(super) fn allocate(&self, label: &str, bytes: u64, usage: wgpu::BufferUsages) -> Result<(wgpu::Buffer, Share)> {
        let size = bytes.max(LEAST).next_multiple_of(4);
        if size > self.capabilities.max_buffer {
            return Err(Error::Capability {
                limit: format!("bytes in buffer '{label}'"),
                required: size,
                actual: self.capabilities.max_buffer,
            });
        }
        let share = self.budget.take(label, size)?;
        self.counters.allocation();
        let raw = self.scoped(&format!("buffer '{label}'"), || {
            self.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size,
                usage,
                mapped_at_creation: false,
            })
        })?;
        Ok((raw, share))
    }
}

/// A pair of buffers that steps read from and write to in turn, with both bind groups built
/// beforehand.
#[derive(Debug)]
pub struct PingPong<T> {
    buffers: [Buffer<T>; 2],
    groups: [BindGroup; 2],
    turn: usize,
}

impl<T: Pod> PingPong<T> {
    /// Two buffers of `len` values; `bindings` lists what the kernel binds, given where it reads
    /// and where it writes.
    ///
    /// # Errors
    /// As [`Gpu::buffer`] and [`Gpu::bind`].
    pub fn new<F>(gpu: &Gpu, pipeline: &Pipeline, label: &str, len: usize, bindings: F) -> Result<Self>
    where
        F: for<'a> Fn(&'a Buffer<T>, &'a Buffer<T>) -> Vec<Binding<'a>>,
    {
        debug_assert!(pipeline.kernel.bindings.contains(&BindingKind::Write), "a step writes somewhere");
        let (a, b) = (gpu.buffer(label, len)?, gpu.buffer(label, len)?);
        let groups = [gpu.bind(pipeline, &bindings(&a, &b))?, gpu.bind(pipeline, &bindings(&b, &a))?];
        Ok(Self { buffers: [a, b], groups, turn: 0 })
    }

    /// Where the newest values are: what the next step reads.
    pub fn newest(&self) -> &Buffer<T> {
        &self.buffers[self.turn]
    }

    /// The bind group of the next step; the one after it reads what this one wrote.
    pub fn step(&mut self) -> &BindGroup {
        let group = &self.groups[self.turn];
        self.turn ^= 1;
        group
    }
}
