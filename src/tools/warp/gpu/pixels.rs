//! Host halves of the kernels `filter_pixels`, `store_pixels` and `count_pixels`: from places to
//! finished pixels.

use std::ops::Range;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use super::picture::{HALVING_LAYOUT, HALVING_PARAMS, StoredPicture};
use super::place::{PLACE_LAYOUT, Placer};
use crate::engine::{Batch, BindGroup, BindingKind, Buffer, Gpu, Kernel, Pipeline, Table, UniformBlocks};
use crate::error::Result;
use crate::kernel_layout as layout;
use crate::picture::Filter;
use crate::picture::{Depth, Image};
use crate::tools::transfer::gpu::{Format, step_table};
use crate::tools::transfer::{Alpha, Encoding};
use crate::tools::warp::pyramid::Texel;

/// Pixels that one word counts.
pub(super) const RUN: usize = 64;

/// Parameters of the kernel `store_pixels`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct StorePixelsParams {
    row: u32,
    wide: u32,
    words: u32,
    keeps: u32,
    opacity: u32,
    unused0: u32,
    unused1: u32,
    unused2: u32,
}

/// Parameters of the kernel `count_pixels`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct CountParams {
    first: u32,
    unused0: u32,
    unused1: u32,
    unused2: u32,
}

/// By filter, bilinear, Lanczos and elliptical averages, and by what the words of the picture are.
pub(super) static FILTER_PIXELS: [[Kernel; 3]; 3] = [
    [
        filter_pixels(&[("FILTER", 0.0), ("WORDS", 0.0)]),
        filter_pixels(&[("FILTER", 0.0), ("WORDS", 1.0)]),
        filter_pixels(&[("FILTER", 0.0), ("WORDS", 2.0)]),
    ],
    [
        filter_pixels(&[("FILTER", 1.0), ("WORDS", 0.0)]),
        filter_pixels(&[("FILTER", 1.0), ("WORDS", 1.0)]),
        filter_pixels(&[("FILTER", 1.0), ("WORDS", 2.0)]),
    ],
    [
        filter_pixels(&[("FILTER", 2.0), ("WORDS", 0.0)]),
        filter_pixels(&[("FILTER", 2.0), ("WORDS", 1.0)]),
        filter_pixels(&[("FILTER", 2.0), ("WORDS", 2.0)]),
    ],
];

const fn filter_pixels(constants: &'static [(&'static str, f64)]) -> Kernel {
    Kernel {
        name: "filter_pixels",
        source: include_str!("../../../../shaders/filter_pixels.wgsl"),
        bindings: &[
            HALVING_PARAMS,
            BindingKind::Read,
            BindingKind::Read,
            BindingKind::Read,
            BindingKind::Write,
            BindingKind::Table,
            BindingKind::Table,
        ],
        layouts: &[HALVING_LAYOUT, PLACE_LAYOUT],
        items: 1,
        constants,
    }
}

/// By depth, and whether colours are light.
pub(super) static STORE_PIXELS: [[Kernel; 2]; 3] = [
    [
        store_pixels(&[("DEPTH", 0.0), ("LIGHT", 0.0), ("WORDS", 0.0)]),
        store_pixels(&[("DEPTH", 0.0), ("LIGHT", 1.0), ("WORDS", 1.0)]),
    ],
    [
        store_pixels(&[("DEPTH", 1.0), ("LIGHT", 0.0), ("WORDS", 0.0)]),
        store_pixels(&[("DEPTH", 1.0), ("LIGHT", 1.0), ("WORDS", 1.0)]),
    ],
    [
        store_pixels(&[("DEPTH", 2.0), ("LIGHT", 0.0), ("WORDS", 2.0)]),
        store_pixels(&[("DEPTH", 2.0), ("LIGHT", 1.0), ("WORDS", 2.0)]),
    ],
];

const fn store_pixels(constants: &'static [(&'static str, f64)]) -> Kernel {
    Kernel {
        name: "store_pixels",
        source: include_str!("../../../../shaders/store_pixels.wgsl"),
        bindings: &[
            BindingKind::Uniform(size_of::<StorePixelsParams>() as u64),
            HALVING_PARAMS,
            BindingKind::Read,
            BindingKind::Read,
            BindingKind::Write,
            BindingKind::Table,
            BindingKind::Table,
            BindingKind::Table,
        ],
        layouts: &[
            HALVING_LAYOUT,
            layout!(StorePixelsParams, { row, wide, words, keeps, opacity, unused0, unused1, unused2 }),
        ],
        items: 1,
        constants,
    }
}

pub(super) static COUNT_PIXELS: Kernel = Kernel {
    name: "count_pixels",
    source: include_str!("../../../../shaders/count_pixels.wgsl"),
    bindings: &[BindingKind::Uniform(size_of::<CountParams>() as u64), BindingKind::Read, BindingKind::Write],
    layouts: &[layout!(CountParams, { first, unused0, unused1, unused2 })],
    items: 1,
    constants: &[],
};

/// What became of some pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PixelCounts {
    /// Those that have a pre-image.
    pub mapped: u64,
    /// Those that are to be coloured and see nothing.
    pub empty: u64,
    /// Those of these that have no pre-image.
    pub lost: u64,
}

impl PixelCounts {
    /// The sum of what the kernel counted.
    pub fn of(words: &[u32]) -> Self {
        words.iter().fold(Self::default(), |sum, word| Self {
            mapped: sum.mapped + u64::from(word & 0xff),
            empty: sum.empty + u64::from(word >> 8 & 0xff),
            lost: sum.lost + u64::from(word >> 16),
        })
    }
}

/// Reference of the kernel: counts of pixels with these shares.
pub fn count_pixels(shares: &[[f32; 2]]) -> PixelCounts {
    let count = |of: &dyn Fn(&[f32; 2]) -> bool| shares.iter().filter(|s| of(s)).count() as u64;
    PixelCounts {
        mapped: count(&|s| s[0] >= 0.0),
        empty: count(&|s| s[0] <= 0.0 && s[1] > 0.0),
        lost: count(&|s| s[0] < 0.0 && s[1] > 0.0),
    }
}

/// What the result of a warp is like.
#[derive(Clone, Copy, Debug)]
pub struct Finish {
    /// How colours are taken from the picture.
    pub filter: Filter,
    /// How samples become values to average.
    pub encoding: Encoding,
    /// Channels: those of the picture, or alpha more.
    pub channels: u32,
    /// Whether what the target polygon does not cover is the original picture.
    pub keeps: bool,
}

/// Pixels of a band of rows on a device, as samples of the result.
#[derive(Debug)]
pub struct Finisher {
    filter: (Arc<Pipeline>, BindGroup),
    store: (Arc<Pipeline>, BindGroup),
    count: (Arc<Pipeline>, BindGroup),
    /// Words of finished pixels, then counts.
    pub result: Buffer<u32>,
    /// Colours of pixels.
    pub colors: Buffer<Texel>,
    format: Format,
    pixels: usize,
    _kept: (Table, UniformBlocks<StorePixelsParams>, UniformBlocks<CountParams>),
}

impl Finisher {
    /// The number of a filter among the variants of the kernel, if it has it.
    pub fn variant(filter: Filter) -> Option<usize> {
        match filter {
            Filter::Bilinear => Some(0),
            Filter::Lanczos => Some(1),
            Filter::Ewa => Some(2),
            Filter::Anisotropic | Filter::Trilinear | Filter::Nearest | Filter::Lanczos4 => None,
        }
    }

    /// For pixels of `placer`, `row` of them in a row, that look into `picture`, which is `image`
    /// on the device. `None` if the kernel has no such filter.
    ///
    /// # Errors
    /// [`Error::Memory`](crate::Error::Memory) or [`Error::Capability`](crate::Error::Capability)
    /// where it does not fit, [`Error::Device`](crate::Error::Device).
    pub fn new(
        gpu: &Gpu,
        image: &Image,
        picture: &StoredPicture,
        placer: &Placer<'_>,
        row: usize,
        finish: &Finish,
    ) -> Result<Option<Self>> {
        let Some(variant) = Self::variant(finish.filter) else { return Ok(None) };
        let pixels = placer.places.len();
        let format = Format { channels: finish.channels, depth: image.depth() };
        let light = finish.encoding.linear_light;
        let params = StorePixelsParams {
            row: row as u32,
            wide: finish.channels,
            words: format.words() as u32,
            keeps: u32::from(finish.keeps),
            opacity: u32::from(finish.encoding.alpha == Alpha::Opacity),
            unused0: 0,
            unused1: 0,
            unused2: 0,
        };
        let params = gpu.uniform("store parameters", &params)?;
        let first = pixels * format.words();
        let counts = CountParams { first: first as u32, unused0: 0, unused1: 0, unused2: 0 };
        let counts = gpu.uniform("count parameters", &counts)?;
        let colors = gpu.buffer("colours", pixels)?;
        let result = gpu.buffer("result", first + pixels.div_ceil(RUN))?;
        let steps = step_table(gpu, image.depth(), light)?;
        let filter = gpu.pipeline(&FILTER_PIXELS[variant][picture.words])?;
        let depth = match image.depth() {
            Depth::U8 => 0,
            Depth::U16 => 1,
            Depth::F32 => 2,
        };
        let store = gpu.pipeline(&STORE_PIXELS[depth][usize::from(light)])?;
        let count = gpu.pipeline(&COUNT_PIXELS)?;
        let to_filter = [
            picture.params.bind(0),
            placer.places.bind(),
            placer.shares.bind(),
            picture.halvings.bind(),
            colors.bind(),
            picture.samples.bind(),
            picture.light.bind(),
        ];
        let to_store = [
            params.bind(0),
            picture.params.bind(0),
            placer.shares.bind(),
            colors.bind(),
            result.bind(),
            picture.samples.bind(),
            picture.light.bind(),
            steps.bind(),
        ];
        let to_count = [counts.bind(0), placer.shares.bind(), result.bind()];
        Ok(Some(Self {
            filter: (Arc::clone(&filter), gpu.bind(&filter, &to_filter)?),
            store: (Arc::clone(&store), gpu.bind(&store, &to_store)?),
            count: (Arc::clone(&count), gpu.bind(&count, &to_count)?),
            result,
            colors,
            format,
            pixels,
            _kept: (steps, params, counts),
        }))
    }

    /// Records the colours of the first `count` pixels.
    ///
    /// # Errors
    /// [`Error::Device`](crate::Error::Device).
    pub fn record_colors(&self, batch: &mut Batch<'_>, count: usize) -> Result<()> {
        batch.dispatch(&self.filter.0, &self.filter.1, count)
    }

    /// Records their samples, the first being in row `row` of the result, and their counts.
    ///
    /// # Errors
    /// [`Error::Device`](crate::Error::Device).
    pub fn record_samples(&self, batch: &mut Batch<'_>, row: usize, count: usize) -> Result<()> {
        batch.dispatch_placed(&self.store.0, &self.store.1, (0, count as u32), row as u32)?;
        let runs = count.div_ceil(RUN) as u32;
        batch.dispatch_placed(&self.count.0, &self.count.1, (0, runs), count as u32)
    }

    /// Where the samples of the first `count` pixels and their counts are in the result.
    pub fn ranges(&self, count: usize) -> [Range<usize>; 2] {
        let words = self.format.words();
        let first = self.pixels * words;
        [0..count * words, first..first + count.div_ceil(RUN)]
    }

    /// Writes samples that came from the device into a picture, from pixel `first` on.
    pub fn unpack(&self, words: &[u32], image: &mut Image, first: usize) {
        self.format.unpack(words, image, first);
    }
}
