//! What is drawn on: 8-bit RGBA pixels.

use glam::Vec3;

use super::shade::{encode, linear};
use crate::error::Result;
use crate::picture::{Image, Pixels};

/// Pixels row by row, sRGB with straight alpha.
pub(crate) struct Canvas {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) pixels: Vec<[u8; 4]>,
}

impl Canvas {
    /// All pixels are `color`.
    pub(crate) fn new(width: u32, height: u32, color: [u8; 4]) -> Self {
        Self { width, height, pixels: vec![color; width as usize * height as usize] }
    }

    /// The canvas as a picture.
    ///
    /// # Errors
    /// If a side is 0.
    pub(crate) fn into_image(self) -> Result<Image> {
        Image::new(self.width, self.height, 4, Pixels::U8(self.pixels.into_flattened()))
    }

    /// Puts `picture` with its upper left corner at column `x` and row `y`; what lies beyond the
    /// canvas is left out.
    pub(crate) fn put(&mut self, picture: &Image, x: u32, y: u32) {
        let columns = picture.width.min(self.width.saturating_sub(x));
        for row in 0..picture.height.min(self.height.saturating_sub(y)) {
            for column in 0..columns {
                if let Some(pixel) = self.pixel(x + column, y + row) {
                    *pixel = picture.pixel(column, row);
                }
            }
        }
    }

    fn pixel(&mut self, x: u32, y: u32) -> Option<&mut [u8; 4]> {
        self.pixels.get_mut(y as usize * self.width as usize + x as usize)
    }

    /// Draws a colour that covers a share of a pixel over it, in linear light.
    pub(super) fn blend(&mut self, x: u32, y: u32, color: [u8; 3], cover: f32) {
        let Some(pixel) = self.pixel(x, y) else { return };
        let old_alpha = f32::from(pixel[3]) / 255.0;
        let alpha = cover + old_alpha * (1.0 - cover);
        let old = Vec3::from([0, 1, 2].map(|k| linear(pixel[k])));
        let new = Vec3::from(color.map(linear));
        let mixed = (new * cover + old * (old_alpha * (1.0 - cover))) / alpha;
        *pixel = [encode(mixed.x), encode(mixed.y), encode(mixed.z), (alpha * 255.0 + 0.5) as u8];
    }
}
