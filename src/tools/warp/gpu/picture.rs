//! Host half of the kernel `halve_texels`: a picture and its levels on a device.

use bytemuck::{Pod, Zeroable};

use crate::engine::{BindingKind, Buffer, Gpu, Kernel, Layout, Pyramid as Samples, Table, UniformBlocks};
use crate::error::Result;
use crate::kernel_layout as layout;
use crate::picture::{Depth, Image};
use crate::tools::transfer::gpu::{light_of_samples, stored_samples};
use crate::tools::transfer::{Alpha, Encoding};
use crate::tools::warp::pyramid::{Texel, level_count, level_size};

/// Levels that the kernels have room for; a picture of 2^31 pixels a side has as many.
pub(super) const MOST_LEVELS: usize = 32;
/// Texels of a dispatch at most.
const MOST_TEXELS: u32 = 1 << 20;

/// A picture and its levels as kernels see them.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct HalvingParams {
    width: u32,
    height: u32,
    levels: u32,
    channels: u32,
    opacity: u32,
    scale: f32,
    most: f32,
    unused: u32,
    places: [[u32; 4]; MOST_LEVELS],
}

pub(super) const HALVING_LAYOUT: Layout =
    layout!(HalvingParams, { width, height, levels, channels, opacity, scale, most, unused, places });
pub(super) const HALVING_PARAMS: BindingKind = BindingKind::Uniform(size_of::<HalvingParams>() as u64);

/// By what the words of the picture are: see [`words`].
pub(super) static HALVE_TEXELS: [Kernel; 3] =
    [halve_texels(&[("WORDS", 0.0)]), halve_texels(&[("WORDS", 1.0)]), halve_texels(&[("WORDS", 2.0)])];

const fn halve_texels(constants: &'static [(&'static str, f64)]) -> Kernel {
    Kernel {
        name: "halve_texels",
        source: include_str!("../../../../shaders/halve_texels.wgsl"),
        bindings: &[HALVING_PARAMS, BindingKind::Write, BindingKind::Table, BindingKind::Table],
        layouts: &[HALVING_LAYOUT],
        items: 1,
        constants,
    }
}

/// What the words of a picture are: 0 numbers, 1 sRGB numbers that are read as light, 2 bits of
/// floats.
pub(super) fn words(depth: Depth, encoding: Encoding) -> usize {
    match depth {
        Depth::U8 | Depth::U16 => usize::from(encoding.linear_light),
        Depth::F32 => 2,
    }
}

/// A picture on a device as it is stored, and its levels as decoded texels.
#[derive(Debug)]
pub struct StoredPicture {
    pub(super) samples: Samples,
    pub(super) light: Table,
    pub(super) params: UniformBlocks<HalvingParams>,
    /// Levels 1, 2, ... one after the other.
    pub halvings: Buffer<Texel>,
    pub(super) words: usize,
}

impl StoredPicture {
    /// Puts `image` on a device and halves it there if `halved`. Its samples go up once, its levels
    /// never.
    ///
    /// # Errors
    /// [`Error::Memory`](crate::Error::Memory) or [`Error::Capability`](crate::Error::Capability)
    /// where it does not fit, [`Error::Device`](crate::Error::Device).
    pub fn new(gpu: &Gpu, image: &Image, encoding: Encoding, halved: bool) -> Result<Self> {
        let levels = level_count(image);
        let mut params = HalvingParams {
            width: image.width,
            height: image.height,
            levels,
            channels: image.channels,
            opacity: u32::from(image.has_alpha() && encoding.alpha == Alpha::Opacity),
            scale: match image.depth() {
                Depth::U8 => 1.0 / 255.0,
                Depth::U16 => 1.0 / 65535.0,
                Depth::F32 => 1.0,
            },
            most: (1u64 << levels.min(32)) as f32,
            unused: 0,
            places: [[0; 4]; MOST_LEVELS],
        };
        let mut total = 0_u64;
        for (level, place) in (0..levels).zip(&mut params.places) {
            let [width, height] = level_size(image, level);
            // What does not fit 32 bits does not fit the buffer below.
            *place = [u32::try_from(total).unwrap_or(u32::MAX), width, height, 0];
            total += if level > 0 && halved { u64::from(width) * u64::from(height) } else { 0 };
        }
        let made = Self {
            samples: stored_samples(gpu, image)?,
            light: light_of_samples(gpu, image.depth(), encoding.linear_light)?,
            params: gpu.uniform("picture parameters", &params)?,
            halvings: gpu.buffer("halvings", usize::try_from(total.max(1)).unwrap_or(usize::MAX))?,
            words: words(image.depth(), encoding),
        };
        if halved {
            made.halve(gpu, &params)?;
        }
        Ok(made)
    }

    fn halve(&self, gpu: &Gpu, params: &HalvingParams) -> Result<()> {
        let pipeline = gpu.pipeline(&HALVE_TEXELS[self.words])?;
        let bindings = [self.params.bind(0), self.halvings.bind(), self.samples.bind(), self.light.bind()];
        let group = gpu.bind(&pipeline, &bindings)?;
        for (level, [_, width, height, _]) in (0..params.levels).zip(params.places).skip(1) {
            for first in (0..width * height).step_by(MOST_TEXELS as usize) {
                let count = MOST_TEXELS.min(width * height - first);
                let mut batch = gpu.batch()?;
                batch.dispatch_placed(&pipeline, &group, (first, count), level)?;
                batch.submit()?;
            }
        }
        Ok(())
    }
}
