//! Host half of the kernel `sample_texture`.

use std::ops::Range;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use super::device_picture::{DevicePicture, half, level_count, stored_channels};
use super::items;
use crate::engine::{
    BindGroup, BindingKind, Buffer, Gpu, Kernel, Layout, Pipeline, Pyramid, ReadbackRing, Table, UniformBlocks,
};
use crate::error::Result;
use crate::geometry::{NONE, Wrap};
use crate::kernel_layout as layout;
use crate::picture::Filter;
use crate::picture::{Depth, Image};
use crate::tools::transfer::footprint::Footprint;
use crate::tools::transfer::mip::{Alpha, MipChain};
use crate::tools::transfer::sample::{SampleParams, sample_texture, widen};

/// Parameters of the kernel; twin of the struct in `shaders/sample_texture.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct TextureParams {
    width: u32,
    height: u32,
    levels: u32,
    channels: u32,
    filtering: u32,
    taps: u32,
    opacity: u32,
    scale: f32,
    wrap_u: u32,
    wrap_v: u32,
    texture: u32,
    unused: u32,
}

/// The number of a filter in [`TextureParams`], of those that take boxes of the chain.
pub(super) fn filtering(filter: Filter) -> u32 {
    match filter {
        Filter::Trilinear => 1,
        Filter::Bilinear => 2,
        Filter::Anisotropic | Filter::Ewa | Filter::Nearest | Filter::Lanczos | Filter::Lanczos4 => 0,
    }
}

/// The number of the variant of the kernel that has a filter.
fn weights(filter: Filter) -> usize {
    match filter {
        Filter::Anisotropic | Filter::Trilinear | Filter::Bilinear => 0,
        Filter::Nearest => 1,
        Filter::Lanczos => 2,
        Filter::Lanczos4 => 3,
        Filter::Ewa => 4,
    }
}

/// Iterations of an invocation at most: an ellipse of 150 rows of 150 texels.
const ITERATIONS: u32 = 150 * 150;

/// Whether the loops of `filter` end on `gpu` where they should.
pub(super) fn runs(gpu: &Gpu, filter: Filter) -> bool {
    filter != Filter::Ewa || !gpu.capabilities().truncates_loops || gpu.capabilities().loop_budget >= ITERATIONS
}

/// A footprint as the kernel reads it: two vectors of four.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct FootprintRecord {
    centre: [f32; 2],
    dx: [f32; 2],
    dy: [f32; 2],
    /// Triangle of the source, or [`NONE`].
    face: u32,
    unused: u32,
}

const LAYOUTS: &[Layout] = &[layout!(TextureParams, {
    width, height, levels, channels, filtering, taps, opacity, scale, wrap_u, wrap_v, texture, unused
})];

/// Pictures of numbers, which repeat, by boxes of the chain.
pub(super) static SAMPLE_TEXTURE: Kernel = variant(&[("WORDS", 0.0), ("MODES", 0.0), ("WEIGHTS", 0.0)]);

/// The kernels of pictures of numbers, of sRGB numbers averaged as light, and of floats; repeating,
/// and with any mode.
macro_rules! variants {
    ($weights:literal) => {
        [variants!($weights, 0.0), variants!($weights, 1.0), variants!($weights, 2.0)]
    };
    ($weights:literal, $words:literal) => {
        [
            variant(&[("WORDS", $words), ("MODES", 0.0), ("WEIGHTS", $weights)]),
            variant(&[("WORDS", $words), ("MODES", 1.0), ("WEIGHTS", $weights)]),
        ]
    };
}
/// By [`weights`].
static VARIANTS: [[[Kernel; 2]; 3]; 5] =
    [variants!(0.0), variants!(1.0), variants!(2.0), variants!(3.0), variants!(4.0)];

const fn variant(constants: &'static [(&'static str, f64)]) -> Kernel {
    Kernel {
        name: "sample_texture",
        source: include_str!("../../../../shaders/sample_texture.wgsl"),
        bindings: &[
            BindingKind::Uniform(size_of::<TextureParams>() as u64),
            BindingKind::Read,
            BindingKind::Write,
            BindingKind::Table,
            BindingKind::Table,
            BindingKind::Table,
            BindingKind::Table,
        ],
        layouts: LAYOUTS,
        items: 1,
        constants,
    }
}

/// Texels of a dispatch at most.
const MOST_TEXELS: usize = 1 << 17;

/// Footprints that reach over more texels than this, or lie farther off, go through the reference,
/// which tells what is not finite.
const LARGEST: f32 = 2.5e5;

/// Buffers for sampling, shared by all textures.
#[derive(Debug)]
pub struct Sampler<'a> {
    gpu: &'a Gpu,
    footprints: [Buffer<FootprintRecord>; 2],
    colors: Buffer<[f32; 4]>,
    /// For footprints that the host chose: one triangle, which shows picture 0.
    chosen: Table,
    ring: ReadbackRing<'a, [f32; 4]>,
    records: Vec<FootprintRecord>,
    left: u64,
}

/// A texture on a device, with its bindings.
#[derive(Debug)]
pub struct DeviceTexture {
    texture: Texture,
    groups: [BindGroup; 2],
}

/// A picture and how it is sampled.
#[derive(Debug)]
pub(super) struct Texture {
    pub(super) pipeline: Arc<Pipeline>,
    pub(super) picture: Arc<DevicePicture>,
    params: UniformBlocks<TextureParams>,
}

impl Texture {
    /// `picture` is `chain` on the device, and number `texture` of its layer.
    pub(super) fn new(
        gpu: &Gpu,
        picture: Arc<DevicePicture>,
        chain: &MipChain<'_>,
        (filter, taps): (Filter, u32),
        texture: u32,
    ) -> Result<Self> {
        let image = chain.image;
        let (words, scale) = match image.depth() {
            Depth::U8 => (usize::from(chain.encoding.linear_light), 1.0 / 255.0),
            Depth::U16 => (usize::from(chain.encoding.linear_light), 1.0 / 65535.0),
            Depth::F32 => (2, 1.0),
        };
        let kernel = &VARIANTS[weights(filter)][words][usize::from(chain.wrap != [Wrap::Repeat; 2])];
        let params = TextureParams {
            width: image.width,
            height: image.height,
            levels: chain.levels.len() as u32,
            channels: image.channels,
            filtering: filtering(filter),
            taps: taps.clamp(1, 16),
            opacity: u32::from(image.has_alpha() && chain.encoding.alpha == Alpha::Opacity),
            scale,
            wrap_u: mode(chain.wrap[0]),
            wrap_v: mode(chain.wrap[1]),
            texture,
            unused: 0,
        };
        let params = gpu.uniform("texture parameters", &params)?;
        Ok(Self { pipeline: gpu.pipeline(kernel)?, picture, params })
    }

    /// Its bindings with footprints, the colours that they get, and the picture of each triangle.
    pub(super) fn bind(
        &self,
        gpu: &Gpu,
        footprints: &Buffer<FootprintRecord>,
        colors: &Buffer<[f32; 4]>,
        textures: &Table,
    ) -> Result<BindGroup> {
        let DevicePicture { base, levels, light } = &*self.picture;
        let bindings = [
            self.params.bind(0),
            footprints.bind(),
            colors.bind(),
            base.bind(),
            levels.bind(),
            light.bind(),
            textures.bind(),
        ];
        gpu.bind(&self.pipeline, &bindings)
    }
}

impl DeviceTexture {
    /// Bytes on the device.
    pub fn bytes(image: &Image) -> u64 {
        let channels = stored_channels(image.channels);
        let (size, half) = ([image.width, image.height], half(image));
        let base = match image.depth() {
            Depth::U8 => Pyramid::bytes::<u8>(size, 1, channels),
            Depth::U16 => Pyramid::bytes::<u16>(size, 1, channels),
            Depth::F32 => Pyramid::bytes::<f32>(size, 1, channels),
        };
        base + Pyramid::bytes::<f32>(half, level_count(image).max(1), channels)
    }

    /// Why `gpu` cannot hold a picture; `None` if it can.
    pub fn obstacle(gpu: &Gpu, image: &Image) -> Option<String> {
        let (side, most) = (image.width.max(image.height), gpu.capabilities().max_texture_side);
        (side > most).then(|| format!("a picture has {side} texels along a side, the device takes {most}"))
    }
}

impl<'a> Sampler<'a> {
    /// Device memory, and host memory of the device's copies.
    pub const BYTES: u64 = (MOST_TEXELS * (size_of::<FootprintRecord>() * 5 + size_of::<[f32; 4]>() * 4)) as u64;

    /// Buffers on a device.
    ///
    /// # Errors
    /// [`Error::Memory`](crate::Error::Memory) or [`Error::Device`](crate::Error::Device).
    pub fn new(gpu: &'a Gpu) -> Result<Self> {
        Ok(Self {
            gpu,
            footprints: [gpu.buffer("footprints", MOST_TEXELS)?, gpu.buffer("footprints", MOST_TEXELS)?],
            colors: gpu.buffer("colours", MOST_TEXELS)?,
            chosen: gpu.table("chosen", &[[0_u32; 4]])?,
            ring: ReadbackRing::new(gpu, "colours", 2, MOST_TEXELS)?,
            records: Vec::new(),
            left: 0,
        })
    }

    /// Texels so far that the kernel left to the reference.
    pub fn left_to_reference(&self) -> u64 {
        self.left
    }

    /// The device.
    pub(in crate::tools::transfer) fn gpu(&self) -> &'a Gpu {
        self.gpu
    }

    /// Puts a texture on the device.
    ///
    /// # Errors
    /// As [`DevicePicture::new`].
    pub fn texture(&self, chain: &MipChain<'_>, filter: Filter, taps: u32) -> Result<DeviceTexture> {
        self.bind(Arc::new(DevicePicture::new(self.gpu, chain)?), chain, filter, taps)
    }

    /// Binds `picture`, which is `chain` on this device.
    ///
    /// # Errors
    /// [`Error::Memory`](crate::Error::Memory) or [`Error::Device`](crate::Error::Device).
    pub(in crate::tools::transfer) fn bind(
        &self,
        picture: Arc<DevicePicture>,
        chain: &MipChain<'_>,
        filter: Filter,
        taps: u32,
    ) -> Result<DeviceTexture> {
        let texture = Texture::new(self.gpu, picture, chain, (filter, taps), 0)?;
        let [a, b] = &self.footprints;
        let groups = [
            texture.bind(self.gpu, a, &self.colors, &self.chosen)?,
            texture.bind(self.gpu, b, &self.colors, &self.chosen)?,
        ];
        Ok(DeviceTexture { texture, groups })
    }

    /// The same as [`sample_texture`], but for rounding: samples `texture`, which is `chain` on the
    /// device.
    ///
    /// # Errors
    /// [`Error::Device`](crate::Error::Device).
    pub fn sample(
        &mut self,
        texture: &DeviceTexture,
        chain: &MipChain<'_>,
        params: &SampleParams,
        texture_of: &[u32],
        footprints: &[Footprint],
        colors: &mut [f32],
    ) -> Result<()> {
        let (stride, channels) = (params.channels as usize, chain.image.channels as usize);
        let size = [chain.image.width as f32, chain.image.height as f32];
        let mut rest = Vec::new();
        let mut pending: Option<Vec<u32>> = None;
        let (mut next, mut turn) = (0, 0);
        // One part computes while the next is gathered and the one before is brought back.
        while next < footprints.len() || pending.is_some() {
            let mut part = Vec::new();
            self.records.clear();
            while next < footprints.len() && part.len() < MOST_TEXELS {
                let f = &footprints[next];
                if f.face != NONE && texture_of[f.face as usize] == params.texture {
                    if plain(f, size) {
                        part.push(next as u32);
                        self.records.push(FootprintRecord { centre: f.centre, dx: f.dx, dy: f.dy, face: 0, unused: 0 });
                    } else {
                        rest.push(next);
                    }
                }
                next += 1;
            }
            let part = (!part.is_empty()).then_some(part);
            if let Some(part) = &part {
                self.gpu.write(&self.footprints[turn], 0, &self.records)?;
                let all: Range<usize> = 0..part.len();
                let mut batch = self.gpu.batch()?;
                let (first, count) = items(&all)?;
                batch.dispatch_range(&texture.texture.pipeline, &texture.groups[turn], first, count)?;
                self.ring.push(batch, &self.colors, all)?;
                turn ^= 1;
            }
            if let Some(before) = std::mem::replace(&mut pending, part) {
                let found = self.ring.pop()?.unwrap_or_default();
                for (&i, color) in before.iter().zip(&found) {
                    let at = i as usize * stride;
                    widen(&color[..channels], &mut colors[at..at + stride]);
                }
            }
        }
        for &i in &rest {
            let range = i * stride..(i + 1) * stride;
            sample_texture(chain, params, texture_of, &footprints[i..=i], &mut colors[range]);
        }
        self.left += rest.len() as u64;
        Ok(())
    }
}

/// The kernel's number of a mode.
pub(super) fn mode(wrap: Wrap) -> u32 {
    match wrap {
        Wrap::Repeat => 0,
        Wrap::Clamp => 1,
        Wrap::Mirror => 2,
    }
}

/// Whether the kernel takes a footprint on a picture of this size.
fn plain(f: &Footprint, size: [f32; 2]) -> bool {
    let small = |v: [f32; 2]| v[0].abs() * size[0] < LARGEST && v[1].abs() * size[1] < LARGEST;
    small(f.dx) && small(f.dy) && f.centre[0].abs() < LARGEST && f.centre[1].abs() < LARGEST
}
