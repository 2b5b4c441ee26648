//! Host halves of the kernels `blank_texels` and `show_texels`: pictures that are coloured anew in
//! parts, and shown.

use std::ops::Range;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use super::store_texel::Format;
use crate::engine::{Batch, BindGroup, BindingKind, Buffer, Canvas, Gpu, Kernel, Pipeline, UniformBlocks};
use crate::error::Result;
use crate::kernel_layout as layout;
use crate::picture::{Depth, Image};

/// Parameters of the kernel; twin of the struct in `shaders/blank_texels.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct BlankParams {
    background: [u32; 4],
    words: u32,
    width: u32,
    unused0: u32,
    unused1: u32,
}

/// Parameters of the kernel; twin of the struct in `shaders/show_texels.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct ShowParams {
    width: u32,
    words: u32,
    channels: u32,
    depth: u32,
}

pub(super) static BLANK_TEXELS: Kernel = Kernel {
    name: "blank_texels",
    source: include_str!("../../../../shaders/blank_texels.wgsl"),
    bindings: &[BindingKind::Uniform(size_of::<BlankParams>() as u64), BindingKind::Read, BindingKind::Write],
    layouts: &[layout!(BlankParams, { background, words, width, unused0, unused1 })],
    items: 1,
    constants: &[],
};

pub(super) static SHOW_TEXELS: Kernel = Kernel {
    name: "show_texels",
    source: include_str!("../../../../shaders/show_texels.wgsl"),
    bindings: &[BindingKind::Uniform(size_of::<ShowParams>() as u64), BindingKind::Read, BindingKind::Canvas],
    layouts: &[layout!(ShowParams, { width, words, channels, depth })],
    items: 1,
    constants: &[],
};

/// A picture of the result, and the canvas that shows it.
#[derive(Debug)]
pub(super) struct Shown {
    pub(super) canvas: Canvas,
    width: usize,
    blank: (Arc<Pipeline>, BindGroup),
    show: (Arc<Pipeline>, BindGroup),
    _params: (UniformBlocks<BlankParams>, UniformBlocks<ShowParams>),
}

impl Shown {
    /// For the picture of `format` whose texels are `picture`; `background` is one texel.
    pub(super) fn new(
        gpu: &Gpu,
        format: Format,
        background: &Image,
        [width, height]: [usize; 2],
        (covers, picture): (&Buffer<u32>, &Buffer<u32>),
    ) -> Result<Self> {
        let words = format.words() as u32;
        let blank =
            BlankParams { background: format.words_of(background), words, width: width as u32, unused0: 0, unused1: 0 };
        let depth = match format.depth {
            Depth::U8 => 0,
            Depth::U16 => 1,
            Depth::F32 => 2,
        };
        let show = ShowParams { width: width as u32, words, channels: format.channels, depth };
        let canvas = gpu.canvas("live picture", [width as u32, height as u32])?;
        let params = (gpu.uniform("blank parameters", &blank)?, gpu.uniform("show parameters", &show)?);
        let (blank, show) = (gpu.pipeline(&BLANK_TEXELS)?, gpu.pipeline(&SHOW_TEXELS)?);
        let of_blank = gpu.bind(&blank, &[params.0.bind(0), covers.bind(), picture.bind()])?;
        let of_show = gpu.bind(&show, &[params.1.bind(0), picture.bind(), canvas.bind()])?;
        Ok(Self { canvas, width, blank: (blank, of_blank), show: (show, of_show), _params: params })
    }

    /// Records the background where texels of `rows` are not covered.
    pub(super) fn record_blank(&self, batch: &mut Batch<'_>, rows: &Range<usize>) -> Result<()> {
        let (first, end) = (rows.start as u32, rows.end as u32);
        batch.dispatch_rows(&self.blank.0, &self.blank.1, first..end, self.width as u32, 0)
    }

    /// Records the showing of `rows`.
    pub(super) fn record_show(&self, batch: &mut Batch<'_>, rows: &Range<usize>) -> Result<()> {
        let (first, end) = (rows.start as u32, rows.end as u32);
        batch.dispatch_rows(&self.show.0, &self.show.1, first..end, self.width as u32, 0)
    }
}
