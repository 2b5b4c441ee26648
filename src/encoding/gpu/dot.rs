//! Host half of the kernel `dot`.

use std::sync::Arc;

use crate::encoding::V3;
use crate::engine::{
    Batch, BindGroup, Binding, BindingKind, Buffer, GROUP, Gpu, Kernel, Layout, Pipeline, UniformBlocks,
};
use crate::error::Result;
use crate::kernel_layout as layout;

/// Where the vectors lie; twin of the struct in `shaders/dot.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, bytemuck::Pod, bytemuck::Zeroable)]
pub struct DotParams {
    first_a: u32,
    stride_a: u32,
    first_b: u32,
    stride_b: u32,
    count: u32,
    runs: u32,
    to: u32,
    again: u32,
}

const LAYOUTS: &[Layout] = &[layout!(DotParams, { first_a, stride_a, first_b, stride_b, count, runs, to, again })];

/// Entries a lane takes.
pub(super) const ITEMS: u32 = 16;
/// Entries that one workgroup sums.
const RUN: usize = (GROUP * ITEMS) as usize;

pub(super) static DOT: Kernel = Kernel {
    name: "dot",
    source: include_str!("../../../shaders/dot.wgsl"),
    bindings: &[
        BindingKind::Uniform(size_of::<DotParams>() as u64),
        BindingKind::Read,
        BindingKind::Read,
        BindingKind::Write,
    ],
    layouts: LAYOUTS,
    items: ITEMS,
    constants: &[],
};

/// A vector within a buffer: where it is bound, and its first entry and stride in units of four
/// numbers.
#[derive(Debug)]
pub(super) struct Vector<'a> {
    pub(super) binding: Binding<'a>,
    pub(super) first: u32,
    pub(super) stride: u32,
}

/// Sums of products of two vectors, in one or several segments of equal length, ready to be
/// recorded. The sums stay on the device.
#[derive(Debug)]
pub(super) struct Dot {
    pipeline: Arc<Pipeline>,
    /// A bind group and its items for each level of the tree.
    levels: Vec<(BindGroup, usize)>,
    _held: Vec<(UniformBlocks<DotParams>, Buffer<[f32; 4]>)>,
}

impl Dot {
    /// Sums over `count` entries in each of `segments` segments, to the first component of
    /// `scalars[to..to + segments]`.
    pub(super) fn new(
        gpu: &Gpu,
        [a, b]: [Vector<'_>; 2],
        count: usize,
        segments: usize,
        scalars: &Buffer<[f32; 4]>,
        to: usize,
    ) -> Result<Self> {
        let pipeline = gpu.pipeline(&DOT)?;
        let mut dot = Self { pipeline, levels: Vec::new(), _held: Vec::new() };
        let mut count = count;
        let mut from: Option<Buffer<[f32; 4]>> = None;
        loop {
            let runs = count.div_ceil(RUN).max(1);
            let last = runs == 1;
            let params = DotParams {
                first_a: if from.is_some() { 0 } else { a.first },
                stride_a: if from.is_some() { 1 } else { a.stride },
                first_b: b.first,
                stride_b: b.stride,
                count: count as u32,
                runs: runs as u32,
                to: if last { to as u32 } else { 0 },
                again: u32::from(from.is_some()),
            };
            let params = gpu.uniform("dot", &params)?;
            let out = gpu.buffer("sums", if last { 0 } else { runs * segments })?;
            let into = if last { scalars.bind() } else { out.bind() };
            let bindings = [
                params.bind(0),
                from.as_ref().map_or_else(|| a.binding.clone(), Buffer::bind),
                from.as_ref().map_or_else(|| b.binding.clone(), Buffer::bind),
                into,
            ];
            let group = gpu.bind(&dot.pipeline, &bindings)?;
            dot.levels.push((group, segments * runs * RUN));
            // A buffer must live as long as the bind group that reads it; the bind group itself
            // keeps the device's memory.
            if let Some(before) = from.take() {
                dot._held.push((params, before));
            } else {
                dot._held.push((params, gpu.buffer("sums", 0)?));
            }
            if last {
                return Ok(dot);
            }
            from = Some(out);
            count = runs;
        }
    }

    /// Records the sums.
    pub(super) fn record(&self, batch: &mut Batch<'_>) -> Result<()> {
        self.levels.iter().try_for_each(|(group, items)| batch.dispatch(&self.pipeline, group, *items))
    }
}

/// The sum of the products of two lists, on the device and in its order.
///
/// # Errors
/// [`Error::Device`](crate::Error::Device), [`Error::Memory`](crate::Error::Memory), or
/// [`Error::Capability`](crate::Error::Capability).
pub fn dot_on_device(gpu: &Gpu, a: &[V3<f32>], b: &[V3<f32>]) -> Result<f32> {
    if a.len() != b.len() {
        return Err(super::fault("vectors of different lengths"));
    }
    let padded = |v: &[V3<f32>]| v.iter().map(|&[x, y, z]| [x, y, z, 0.0]).collect::<Vec<[f32; 4]>>();
    let (a, b) = (gpu.upload("a", &padded(a))?, gpu.upload("b", &padded(b))?);
    let scalars = gpu.buffer("scalars", 1)?;
    let vectors = [&a, &b].map(|v| Vector { binding: v.bind(), first: 0, stride: 1 });
    let dot = Dot::new(gpu, vectors, a.len(), 1, &scalars, 0)?;
    let mut batch = gpu.batch()?;
    dot.record(&mut batch)?;
    batch.submit()?;
    Ok(gpu.read(&scalars, 0..1)?.first().map_or(0.0, |s| s[0]))
}
