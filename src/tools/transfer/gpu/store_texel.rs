//! Host half of the kernels `store_texel` and `fill_background`: pictures of the result on a
//! device.
//!
//! A texel takes whole words there: one of 8-bit samples, one or two of 16-bit samples, one for
//! each float.

use std::sync::{Arc, LazyLock};

use bytemuck::{Pod, Zeroable};
use rayon::prelude::*;

use super::device_picture::DevicePicture;
use super::locate::Chunk;
use super::runs::Runs;
use super::sample_texture::mode;
use crate::engine::{Batch, BindGroup, BindingKind, Buffer, Gpu, Kernel, Layout, Pipeline, Table, UniformBlocks};
use crate::error::Result;
use crate::kernel_layout as layout;
use crate::picture::{Depth, Image, Pixels};
use crate::tools::transfer::color::Sample;
use crate::tools::transfer::mip::{Alpha, MipChain};

/// Parameters of the kernel; twin of the struct in `shaders/store_texel.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct StoreParams {
    texture: u32,
    width: u32,
    height: u32,
    wrap_u: u32,
    wrap_v: u32,
    channels: u32,
    wide: u32,
    opacity: u32,
    exact: u32,
    words: u32,
    row: u32,
    unused: u32,
}

const LAYOUTS: &[Layout] = &[layout!(StoreParams, {
    texture, width, height, wrap_u, wrap_v, channels, wide, opacity, exact, words, row, unused
})];

/// Samples of 8 bits, not light.
pub(super) static STORE_TEXEL: Kernel = variant(&[("DEPTH", 0.0), ("LIGHT", 0.0)]);
/// By depth, and whether colours are light.
static VARIANTS: [[Kernel; 2]; 3] = [
    [variant(&[("DEPTH", 0.0), ("LIGHT", 0.0)]), variant(&[("DEPTH", 0.0), ("LIGHT", 1.0)])],
    [variant(&[("DEPTH", 1.0), ("LIGHT", 0.0)]), variant(&[("DEPTH", 1.0), ("LIGHT", 1.0)])],
    [variant(&[("DEPTH", 2.0), ("LIGHT", 0.0)]), variant(&[("DEPTH", 2.0), ("LIGHT", 1.0)])],
];

const fn variant(constants: &'static [(&'static str, f64)]) -> Kernel {
    Kernel {
        name: "store_texel",
        source: include_str!("../../../../shaders/store_texel.wgsl"),
        bindings: &[
            BindingKind::Uniform(size_of::<StoreParams>() as u64),
            BindingKind::Read,
            BindingKind::Read,
            BindingKind::Write,
            BindingKind::Read,
            BindingKind::Table,
            BindingKind::Table,
            BindingKind::Table,
        ],
        layouts: LAYOUTS,
        items: 1,
        constants,
    }
}

/// Channels and depth of a picture on a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::tools) struct Format {
    pub(in crate::tools) channels: u32,
    pub(in crate::tools) depth: Depth,
}

impl Format {
    pub(in crate::tools) fn of(image: &Image) -> Self {
        Self { channels: image.channels, depth: image.depth() }
    }

    /// Words of a texel.
    pub(in crate::tools) fn words(self) -> usize {
        match self.depth {
            Depth::U8 => 1,
            Depth::U16 => self.channels.div_ceil(2) as usize,
            Depth::F32 => self.channels as usize,
        }
    }

    /// The words of the first texel of a picture.
    pub(super) fn words_of(self, image: &Image) -> [u32; 4] {
        let mut words = [0; 4];
        for k in 0..self.channels as usize {
            match &image.pixels {
                Pixels::U8(v) => words[0] |= u32::from(v[k]) << (8 * k),
                Pixels::U16(v) => words[k / 2] |= u32::from(v[k]) << (16 * (k % 2)),
                Pixels::F32(v) => words[k] = v[k].to_bits(),
            }
        }
        words
    }

    /// Writes texels that came from a device into a picture of this format, from texel `first` on.
    pub(in crate::tools) fn unpack(self, words: &[u32], image: &mut Image, first: usize) {
        const TASK: usize = 1 << 14;
        let (n, w) = (self.channels as usize, self.words());
        let range = first * n..(first + words.len() / w) * n;
        let parts = words.par_chunks(TASK * w);
        match &mut image.pixels {
            Pixels::U8(v) if n == 4 => {
                v[range].par_chunks_mut(TASK * n).zip(parts).for_each(|(out, words)| {
                    out.copy_from_slice(bytemuck::cast_slice(words));
                });
            }
            Pixels::U8(v) => v[range].par_chunks_mut(TASK * n).zip(parts).for_each(|(out, words)| {
                for (out, word) in out.chunks_exact_mut(n).zip(words) {
                    out.copy_from_slice(&word.to_le_bytes()[..n]);
                }
            }),
            Pixels::U16(v) => v[range].par_chunks_mut(TASK * n).zip(parts).for_each(|(out, words)| {
                for (out, words) in out.chunks_exact_mut(n).zip(words.chunks_exact(w)) {
                    for (k, out) in out.iter_mut().enumerate() {
                        *out = (words[k / 2] >> (16 * (k % 2))) as u16;
                    }
                }
            }),
            Pixels::F32(v) => v[range].par_chunks_mut(TASK * n).zip(parts).for_each(|(out, words)| {
                out.copy_from_slice(bytemuck::cast_slice(words));
            }),
        }
    }
}

/// The light from which on the nearest sample is at least 1, 2, ... of `T`: bisections of
/// [`Sample::encode`], so that the kernel decides as it does.
fn light_steps<T: Sample + PartialOrd>(samples: impl IntoIterator<Item = T>) -> Vec<f32> {
    let least = |sample: T| {
        // Positive floats are in the order of their bits.
        let (mut low, mut high) = (0_u32, 2.0_f32.to_bits());
        while low < high {
            let middle = low.midpoint(high);
            if T::encode(f32::from_bits(middle), true) >= sample { high = middle } else { low = middle + 1 }
        }
        f32::from_bits(low)
    };
    samples.into_iter().map(least).collect()
}

static STEPS_8: LazyLock<Vec<f32>> = LazyLock::new(|| light_steps(1..=u8::MAX));
static STEPS_16: LazyLock<Vec<f32>> = LazyLock::new(|| light_steps(1..=u16::MAX));

/// The table of steps for colours of `depth`; of one step where they are not light.
pub(in crate::tools) fn step_table(gpu: &Gpu, depth: Depth, light: bool) -> Result<Table> {
    let steps: &[f32] = match depth {
        Depth::U8 if light => &STEPS_8,
        Depth::U16 if light => &STEPS_16,
        _ => &[0.0],
    };
    let four = |v: &[f32]| std::array::from_fn::<f32, 4, _>(|k| v.get(k).copied().unwrap_or(f32::MAX));
    let records: Vec<[f32; 4]> = steps.chunks(4).map(four).collect();
    gpu.table("steps of light", &records)
}

/// A picture of a layer and where its texels go.
#[derive(Debug)]
pub(super) struct Store {
    pub(super) pipeline: Arc<Pipeline>,
    pub(super) group: BindGroup,
    _params: UniformBlocks<StoreParams>,
}

/// Parameters of the kernel `fill_background`; twin of the struct in
/// `shaders/fill_background.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct BackgroundParams {
    background: [u32; 4],
    words: u32,
    unused0: u32,
    unused1: u32,
    unused2: u32,
}

pub(super) static FILL_BACKGROUND: Kernel = Kernel {
    name: "fill_background",
    source: include_str!("../../../../shaders/fill_background.wgsl"),
    bindings: &[BindingKind::Uniform(size_of::<BackgroundParams>() as u64), BindingKind::Write],
    layouts: &[layout!(BackgroundParams, { background, words, unused0, unused1, unused2 })],
    items: 1,
    constants: &[],
};

/// What texels of a picture hold that show nothing.
#[derive(Debug)]
pub(super) struct Background {
    fill: (Arc<Pipeline>, BindGroup),
    _params: UniformBlocks<BackgroundParams>,
}

impl Background {
    /// `background` is a picture of nothing else, in the format.
    pub(super) fn new(gpu: &Gpu, format: Format, background: &Image, picture: &Buffer<u32>) -> Result<Self> {
        let (background, words) = (format.words_of(background), format.words() as u32);
        let params = BackgroundParams { background, words, unused0: 0, unused1: 0, unused2: 0 };
        let params = gpu.uniform("background parameters", &params)?;
        let pipeline = gpu.pipeline(&FILL_BACKGROUND)?;
        let group = gpu.bind(&pipeline, &[params.bind(0), picture.bind()])?;
        Ok(Self { fill: (pipeline, group), _params: params })
    }

    /// Records it for the first `count` texels.
    pub(super) fn record(&self, batch: &mut Batch<'_>, count: usize) -> Result<()> {
        batch.dispatch(&self.fill.0, &self.fill.1, count)
    }
}

/// What stores bind, beside pictures of the source.
#[derive(Clone, Copy, Debug)]
pub(super) struct StoreTo<'a> {
    pub(super) format: Format,
    /// Texels of a row.
    pub(super) row: usize,
    pub(super) runs: &'a Runs,
    pub(super) chunk: &'a Chunk,
    pub(super) picture: &'a Buffer<u32>,
    pub(super) textures: &'a Table,
    pub(super) steps: &'a Table,
}

impl StoreTo<'_> {
    /// Stores texels that show `picture`, which is `chain` and number `texture` of its layer.
    pub(super) fn bind(&self, gpu: &Gpu, picture: &DevicePicture, chain: &MipChain<'_>, texture: u32) -> Result<Store> {
        let image = chain.image;
        let params = StoreParams {
            texture,
            width: image.width,
            height: image.height,
            wrap_u: mode(chain.wrap[0]),
            wrap_v: mode(chain.wrap[1]),
            channels: image.channels,
            wide: self.format.channels,
            opacity: u32::from(chain.encoding.alpha == Alpha::Opacity),
            // A picture of another depth than the layer's deepest is converted.
            exact: u32::from(image.depth() == self.format.depth),
            words: self.format.words() as u32,
            row: self.row as u32,
            unused: 0,
        };
        let params = gpu.uniform("store parameters", &params)?;
        let depth = match self.format.depth {
            Depth::U8 => 0,
            Depth::U16 => 1,
            Depth::F32 => 2,
        };
        let pipeline = gpu.pipeline(&VARIANTS[depth][usize::from(chain.encoding.linear_light)])?;
        let bindings = [
            params.bind(0),
            self.chunk.footprints.bind(),
            self.chunk.colors.bind(),
            self.picture.bind(),
            self.runs.list.bind(),
            picture.base.bind(),
            self.textures.bind(),
            self.steps.bind(),
        ];
        let group = gpu.bind(&pipeline, &bindings)?;
        Ok(Store { pipeline, group, _params: params })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_between_two_steps_is_the_sample_that_it_encodes_to() {
        let sample = |steps: &[f32], light: f32| steps.iter().filter(|s| **s <= light).count();
        for i in 0..=20_000 {
            let light = (i as f32 / 16_000.0 - 0.1).powi(3);
            assert_eq!(sample(&STEPS_8, light), usize::from(u8::encode(light, true)), "{light}");
        }
        for i in 0..500 {
            let light = i as f32 / 490.0;
            assert_eq!(sample(&STEPS_16, light), usize::from(u16::encode(light, true)), "{light}");
        }
    }

    #[test]
    fn texels_survive_their_words() {
        for channels in 1..=4 {
            for depth in [Depth::U8, Depth::U16, Depth::F32] {
                let count = 5 * channels as usize;
                let pixels = match depth {
                    Depth::U8 => Pixels::U8((0..count).map(|i| (7 * i + 3) as u8).collect()),
                    Depth::U16 => Pixels::U16((0..count).map(|i| (4001 * i + 3) as u16).collect()),
                    Depth::F32 => Pixels::F32((0..count).map(|i| i as f32 - 2.5).collect()),
                };
                let image = Image::new(5, 1, channels, pixels).unwrap();
                let format = Format::of(&image);
                let texel = |x: u32| {
                    let one = Image::zeros(1, 1, channels, depth).unwrap();
                    let (n, x) = (channels as usize, x as usize);
                    let pixels = match &image.pixels {
                        Pixels::U8(v) => Pixels::U8(v[x * n..(x + 1) * n].to_vec()),
                        Pixels::U16(v) => Pixels::U16(v[x * n..(x + 1) * n].to_vec()),
                        Pixels::F32(v) => Pixels::F32(v[x * n..(x + 1) * n].to_vec()),
                    };
                    format.words_of(&Image { pixels, ..one })[..format.words()].to_vec()
                };
                let words: Vec<u32> = (0..5).flat_map(texel).collect();
                let mut back = Image::zeros(5, 2, channels, depth).unwrap();
                format.unpack(&words, &mut back, 5);
                let range = count..2 * count;
                let same = (0..count).all(|i| back.sample(range.start + i) == image.sample(i) && back.sample(i) == 0.0);
                assert!(same, "{channels} {depth:?}");
            }
        }
    }
}
