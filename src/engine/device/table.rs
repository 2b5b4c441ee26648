//! Tables that kernels look things up in by an index of their own.
//!
//! Records of a mesh are read at scattered places. A software device takes such reads from a
//! texture at a fraction of the cost of a storage buffer, and hardware caches them at least as
//! well, so tables are textures of four unsigned words a texel: unsigned, because those keep every
//! bit of a floating-point number, also where the format's own would flush or canonicalise it.
//! `shaders/lib/table.wgsl` has the other half.

use bytemuck::Pod;

use super::buffer::Binding;
use super::gpu::{Gpu, Share};
use crate::error::{Error, Result};

/// Texels of a row; what every device has.
pub(in crate::engine) const WIDTH: u32 = 2048;

/// Bytes of a texel.
const TEXEL: usize = 16;

/// A read-only table of records of whole texels (16 bytes).
#[derive(Debug)]
pub struct Table {
    texture: wgpu::Texture,
    view: wgpu::TextureView,
    _share: Share,
}

impl Table {
    /// To bind it as [`BindingKind::Table`](crate::engine::BindingKind::Table).
    pub fn bind(&self) -> Binding<'_> {
        Binding(wgpu::BindingResource::TextureView(&self.view))
    }
}

impl Gpu {
    /// A table holding `records`, one after the other.
    ///
    /// # Errors
    /// [`Error::Capability`] if it is larger than a texture may be, [`Error::Memory`] past the
    /// budget, [`Error::Device`] if the device refuses or a record is not made of whole texels.
    pub fn table<T: Pod>(&self, label: &str, records: &[T]) -> Result<Table> {
        if !size_of::<T>().is_multiple_of(TEXEL) {
            return Err(Error::Device {
                what: format!("table '{label}' has records of {} bytes", size_of::<T>()),
                remedy: "This is a fault of barymap: please report it".into(),
            });
        }
        let bytes: &[u8] = bytemuck::cast_slice(records);
        let texels = bytes.len().div_ceil(TEXEL);
        let height = texels.div_ceil(WIDTH as usize).max(1);
        if height > self.capabilities.max_texture_side as usize {
            return Err(Error::Capability {
                limit: format!("rows in table '{label}'"),
                required: height as u64,
                actual: u64::from(self.capabilities.max_texture_side),
            });
        }
        let row = WIDTH as usize * TEXEL;
        let size = wgpu::Extent3d { width: WIDTH, height: height as u32, depth_or_array_layers: 1 };
        let share = self.budget.take(label, (row * height) as u64)?;
        let mut padded;
        let whole = if bytes.len() == row * height {
            bytes
        } else {
            padded = bytes.to_vec();
            padded.resize(row * height, 0);
            &padded
        };
        self.counters.allocation();
        self.counters.up_once(whole.len() as u64);
        let texture = self.scoped(&format!("table '{label}'"), || {
            let texture = self.device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size,
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: wgpu::TextureFormat::Rgba32Uint,
                usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
                view_formats: &[],
            });
            let layout = wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(row as u32),
                rows_per_image: Some(height as u32),
            };
            self.queue.write_texture(texture.as_image_copy(), whole, layout, size);
            texture
        })?;
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        Ok(Table { texture, view, _share: share })
    }

    /// Overwrites records from `first` on. What was submitted before still sees the old ones.
    ///
    /// # Errors
    /// [`Error::Device`] if the records do not fit the table or the device refuses.
    pub fn write_table<T: Pod>(&self, table: &Table, first: usize, records: &[T]) -> Result<()> {
        let (width, height) = (WIDTH as usize, table.texture.height() as usize);
        let each = size_of::<T>() / TEXEL;
        let (begin, end) = (first.saturating_mul(each), first.saturating_add(records.len()).saturating_mul(each));
        if !size_of::<T>().is_multiple_of(TEXEL) || end > width * height {
            return Err(Error::Device {
                what: format!("records {first}..{} of a table of {height} rows", first.saturating_add(records.len())),
                remedy: "This is a fault of barymap: please report it".into(),
            });
        }
        let bytes: &[u8] = bytemuck::cast_slice(records);
        self.counters.up(bytes.len() as u64);
        self.scoped("upload", || {
            let mut at = begin;
            while at < end {
                // To the end of a row, or as many whole rows as there are.
                let (x, y) = (at % width, at / width);
                let rows = if x == 0 { ((end - at) / width).max(1) } else { 1 };
                let columns = (end - at).min(width - x);
                let target = wgpu::TexelCopyTextureInfo {
                    origin: wgpu::Origin3d { x: x as u32, y: y as u32, z: 0 },
                    ..table.texture.as_image_copy()
                };
                let layout = wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some((columns * TEXEL) as u32),
                    rows_per_image: None,
                };
                let extent = wgpu::Extent3d { width: columns as u32, height: rows as u32, depth_or_array_layers: 1 };
                let count = columns * rows;
                let values = &bytes[(at - begin) * TEXEL..(at - begin + count) * TEXEL];
                self.queue.write_texture(target, values, layout, extent);
                at += count;
            }
        })
    }
}
