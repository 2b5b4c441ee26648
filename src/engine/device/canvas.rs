//! Pictures that kernels write and windows show.

use super::buffer::Binding;
use super::gpu::{Gpu, Share};
use crate::error::{Error, Result};

/// Rows of a copy from a texture begin at multiples of this many bytes.
const ROW: u32 = wgpu::COPY_BYTES_PER_ROW_ALIGNMENT;

/// A texture of four channels of 8 bits that kernels write as
/// [`BindingKind::Canvas`](crate::engine::BindingKind::Canvas), and that its owner draws.
#[derive(Debug)]
pub struct Canvas {
    texture: wgpu::Texture,
    view: wgpu::TextureView,
    size: [u32; 2],
    _share: Share,
}

impl Canvas {
    /// To bind it as [`BindingKind::Canvas`](crate::engine::BindingKind::Canvas).
    pub fn bind(&self) -> Binding<'_> {
        Binding(wgpu::BindingResource::TextureView(&self.view))
    }

    /// To draw it: format `rgba8unorm`, one level.
    pub fn view(&self) -> &wgpu::TextureView {
        &self.view
    }

    /// Columns and rows.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }
}

impl Gpu {
    /// A canvas of `size` columns and rows, all zero.
    ///
    /// # Errors
    /// [`Error::Capability`] if a side is larger than a texture's may be, [`Error::Memory`] past
    /// the budget, [`Error::Device`] if the device refuses.
    pub fn canvas(&self, label: &str, size: [u32; 2]) -> Result<Canvas> {
        let side = size[0].max(size[1]);
        if side > self.capabilities.max_texture_side {
            return Err(Error::Capability {
                limit: format!("pixels along a side of canvas '{label}'"),
                required: u64::from(side),
                actual: u64::from(self.capabilities.max_texture_side),
            });
        }
        let share = self.budget.take(label, 4 * u64::from(size[0]) * u64::from(size[1]))?;
        self.counters.allocation();
        let texture = self.scoped(&format!("canvas '{label}'"), || {
            self.device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: wgpu::TextureFormat::Rgba8Unorm,
                usage: wgpu::TextureUsages::STORAGE_BINDING
                    | wgpu::TextureUsages::TEXTURE_BINDING
                    | wgpu::TextureUsages::COPY_SRC,
                view_formats: &[],
            })
        })?;
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        Ok(Canvas { texture, view, size, _share: share })
    }

    /// The pixels of a canvas, row by row, after everything submitted so far.
    ///
    /// # Errors
    /// As [`Gpu::read`].
    pub fn read_canvas(&self, canvas: &Canvas) -> Result<Vec<[u8; 4]>> {
        let [width, height] = canvas.size;
        let row = (4 * width).next_multiple_of(ROW);
        let copy = self.buffer::<u8>("canvas read back", row as usize * height as usize)?;
        let mut batch = self.batch()?;
        batch.encoder().copy_texture_to_buffer(
            canvas.texture.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &copy.raw,
                layout: wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None },
            },
            wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        );
        batch.submit()?;
        let bytes = self.read(&copy, 0..copy.len())?;
        let pixels = bytes.chunks_exact(row as usize).flat_map(|r| r[..4 * width as usize].as_chunks().0);
        Ok(pixels.copied().collect())
    }
}
