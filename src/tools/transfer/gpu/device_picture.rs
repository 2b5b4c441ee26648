//! A picture of the source and its levels on a device.

use crate::engine::{Gpu, Pyramid, Table, Word};
use crate::error::Result;
use crate::picture::{Depth, Image, Pixels};
use crate::tools::transfer::color::light_values;
use crate::tools::transfer::mip::MipChain;

/// A picture and its levels on a device, for any sampler there.
#[derive(Debug)]
pub struct DevicePicture {
    pub(super) base: Pyramid,
    pub(super) levels: Pyramid,
    pub(super) light: Table,
}

impl DevicePicture {
    /// Puts a picture and its levels on a device.
    ///
    /// # Errors
    /// [`Error::Capability`](crate::Error::Capability), [`Error::Memory`](crate::Error::Memory) or
    /// [`Error::Device`](crate::Error::Device).
    pub fn new(gpu: &Gpu, chain: &MipChain<'_>) -> Result<Self> {
        let image = chain.image;
        let (channels, stored) = (image.channels as usize, stored_channels(image.channels) as usize);
        let base = stored_samples(gpu, image)?;
        let count = chain.levels.len().max(1) as u32;
        let levels = gpu.pyramid("levels", stored as u32, half(image), count, |l, y, out: &mut [f32]| {
            if let Some(level) = chain.levels.get(l as usize) {
                let row = level.width as usize * channels;
                spread(&level.texels[y as usize * row..(y as usize + 1) * row], channels, stored, out);
            }
        })?;
        Ok(Self { base, levels, light: light_of_samples(gpu, image.depth(), chain.encoding.linear_light)? })
    }
}

/// The light of all samples of `depth`, four to a texel; nothing where they are not sRGB that is
/// read as light.
pub(in crate::tools) fn light_of_samples(gpu: &Gpu, depth: Depth, light: bool) -> Result<Table> {
    let entries = match depth {
        Depth::U8 if light => 256,
        Depth::U16 if light => 65536,
        _ => 0,
    };
    let values: Vec<[f32; 4]> = light_values(entries).chunks_exact(4).map(|v| [v[0], v[1], v[2], v[3]]).collect();
    gpu.table("light", &values)
}

/// Level 0 of a picture as it is stored; three channels become four.
pub(in crate::tools) fn stored_samples(gpu: &Gpu, image: &Image) -> Result<Pyramid> {
    fn rows<'p, T: Word>(
        samples: &'p [T],
        row: usize,
        channels: usize,
        stored: usize,
    ) -> impl FnMut(u32, u32, &mut [T]) + 'p {
        move |_, y, out| spread(&samples[y as usize * row..(y as usize + 1) * row], channels, stored, out)
    }
    let (channels, stored) = (image.channels as usize, stored_channels(image.channels) as usize);
    let (size, row) = ([image.width, image.height], image.width as usize * channels);
    let n = stored as u32;
    match &image.pixels {
        Pixels::U8(v) => gpu.pyramid("picture", n, size, 1, rows(v, row, channels, stored)),
        Pixels::U16(v) => gpu.pyramid("picture", n, size, 1, rows(v, row, channels, stored)),
        Pixels::F32(v) => gpu.pyramid("picture", n, size, 1, rows(v, row, channels, stored)),
    }
}

/// Channels of a texel on the device.
pub(super) fn stored_channels(channels: u32) -> u32 {
    if channels == 3 { 4 } else { channels }
}

pub(super) fn half(image: &Image) -> [u32; 2] {
    [image.width, image.height].map(|n| (n / 2).max(1))
}

/// Levels above the picture.
pub(super) fn level_count(image: &Image) -> u32 {
    31 - image.width.max(image.height).leading_zeros()
}

/// Copies a row of `from` channels to texels of `to`.
fn spread<T: Copy>(row: &[T], from: usize, to: usize, out: &mut [T]) {
    if from == to {
        out.copy_from_slice(row);
        return;
    }
    for (texel, out) in row.chunks_exact(from).zip(out.chunks_exact_mut(to)) {
        out[..from].copy_from_slice(texel);
    }
}
