//! Pictures with their averages, for kernels that filter by themselves.
//!
//! Hardware samplers interpolate with eight bits of fraction, and no two alike; kernels that must
//! agree with a reference load texels and weigh them in single precision. A pyramid is therefore a
//! texture of unsigned words: 8 or 16 bits for samples of that depth, 32 for the bits of floats
//! (formats of floats may flush or canonicalise them). Textures rather than storage buffers,
//! because they may exceed the 128 MiB that a storage binding holds, and because software devices
//! read scattered texels several times faster from them (see [`Table`](super::Table)). Kernels bind
//! it as [`BindingKind::Table`](crate::engine::BindingKind::Table).

use bytemuck::Pod;

use super::buffer::Binding;
use super::gpu::{Gpu, Share};
use crate::error::{Error, Result};

/// Bytes written before the device is waited for, so that not all of a picture is held three times.
const FLUSH: usize = 32 << 20;

/// A channel of a texel: an unsigned word of 8, 16 or 32 bits, or a float that is handed over as
/// its bits.
pub trait Word: Pod + Default {}
impl Word for u8 {}
impl Word for u16 {}
impl Word for u32 {}
impl Word for f32 {}

/// A read-only texture of unsigned words with levels, each of half the sides of the one before,
/// rounded down, one at least.
#[derive(Debug)]
pub struct Pyramid {
    view: wgpu::TextureView,
    _share: Share,
}

impl Pyramid {
    /// To bind it as [`BindingKind::Table`](crate::engine::BindingKind::Table).
    pub fn bind(&self) -> Binding<'_> {
        Binding(wgpu::BindingResource::TextureView(&self.view))
    }

    /// Bytes of `levels` levels from `size` on, with `channels` words of `T`.
    pub fn bytes<T: Word>(size: [u32; 2], levels: u32, channels: u32) -> u64 {
        let texels: u64 = (0..levels).map(|l| level_size(size, l).map(u64::from).iter().product::<u64>()).sum();
        texels * u64::from(channels) * size_of::<T>() as u64
    }
}

fn level_size(size: [u32; 2], level: u32) -> [u32; 2] {
    size.map(|n| n.checked_shr(level).unwrap_or(0).max(1))
}

/// The format with this many channels of this many bytes.
fn format(channels: u32, bytes: usize) -> Option<wgpu::TextureFormat> {
    use wgpu::TextureFormat::{
        R8Uint, R16Uint, R32Uint, Rg8Uint, Rg16Uint, Rg32Uint, Rgba8Uint, Rgba16Uint, Rgba32Uint,
    };
    Some(match (channels, bytes) {
        (1, 1) => R8Uint,
        (2, 1) => Rg8Uint,
        (4, 1) => Rgba8Uint,
        (1, 2) => R16Uint,
        (2, 2) => Rg16Uint,
        (4, 2) => Rgba16Uint,
        (1, 4) => R32Uint,
        (2, 4) => Rg32Uint,
        (4, 4) => Rgba32Uint,
        _ => return None,
    })
}

impl Gpu {
    /// A pyramid of `levels` levels from `size` (width, height) on, with 1, 2 or 4 `channels`.
    /// `fill` writes the words of one row of a level.
    ///
    /// # Errors
    /// [`Error::Capability`] if a side is larger than a texture's may be, [`Error::Memory`] past
    /// the budget, [`Error::Device`] if the device refuses or there is no such format.
    pub fn pyramid<T: Word>(
        &self,
        label: &str,
        channels: u32,
        size: [u32; 2],
        levels: u32,
        mut fill: impl FnMut(u32, u32, &mut [T]),
    ) -> Result<Pyramid> {
        let most = 32 - size[0].max(size[1]).leading_zeros();
        let format = match format(channels, size_of::<T>()) {
            Some(f) if size[0] > 0 && size[1] > 0 && (1..=most).contains(&levels) => f,
            _ => {
                return Err(Error::Device {
                    what: format!("picture '{label}' of {size:?} texels, {levels} levels and {channels} channels"),
                    remedy: "This is a fault of barymap: please report it".into(),
                });
            }
        };
        let side = size[0].max(size[1]);
        if side > self.capabilities.max_texture_side {
            return Err(Error::Capability {
                limit: format!("texels along a side of picture '{label}'"),
                required: u64::from(side),
                actual: u64::from(self.capabilities.max_texture_side),
            });
        }
        let share = self.budget.take(label, Pyramid::bytes::<T>(size, levels, channels))?;
        self.counters.allocation();
        let texture = self.scoped(&format!("picture '{label}'"), || {
            self.device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
                mip_level_count: levels,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
                view_formats: &[],
            })
        })?;
        let mut strip: Vec<T> = Vec::new();
        let mut written = 0;
        for level in 0..levels {
            let [width, height] = level_size(size, level);
            let row = width as usize * channels as usize;
            let rows = (FLUSH / 4 / (row * size_of::<T>())).clamp(1, height as usize);
            for first in (0..height).step_by(rows) {
                let count = rows.min((height - first) as usize);
                strip.resize(count * row, T::default());
                for (y, words) in (first..).zip(strip.chunks_exact_mut(row)) {
                    fill(level, y, words);
                }
                let target = wgpu::TexelCopyTextureInfo {
                    texture: &texture,
                    mip_level: level,
                    origin: wgpu::Origin3d { x: 0, y: first, z: 0 },
                    aspect: wgpu::TextureAspect::All,
                };
                let layout = wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some((row * size_of::<T>()) as u32),
                    rows_per_image: None,
                };
                let extent = wgpu::Extent3d { width, height: count as u32, depth_or_array_layers: 1 };
                self.scoped(&format!("picture '{label}'"), || {
                    self.queue.write_texture(target, bytemuck::cast_slice(&strip), layout, extent);
                })?;
                written += size_of_val(strip.as_slice());
                self.counters.up_once(size_of_val(strip.as_slice()) as u64);
                if written >= FLUSH {
                    written = 0;
                    self.counters.submission();
                    let all = self.scoped("upload", || self.send(None))?;
                    self.wait(&all)?;
                }
            }
        }
        Ok(Pyramid { view: texture.create_view(&wgpu::TextureViewDescriptor::default()), _share: share })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_halve_down_to_one() {
        assert_eq!([0, 1, 2, 3, 40].map(|l| level_size([5, 1], l)), [[5, 1], [2, 1], [1, 1], [1, 1], [1, 1]]);
        assert_eq!(Pyramid::bytes::<u16>([5, 3], 3, 4), (15 + 2 + 1) * 8);
        assert!(format(3, 1).is_none() && format(4, 8).is_none());
    }
}
