//! Pictures in memory: what textures, masks and results are before and after a file format.

use crate::error::{Error, Result};

/// Samples of a picture in the depth they came in.
#[derive(Clone, Debug, PartialEq)]
pub enum Pixels {
    /// 8 bits per sample, 0..=255 meaning 0..1.
    U8(Vec<u8>),
    /// 16 bits per sample, 0..=65535 meaning 0..1.
    U16(Vec<u16>),
    /// Floats as they are.
    F32(Vec<f32>),
}

/// Depth of the samples of an [`Image`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Depth {
    /// 8 bits, unsigned.
    U8,
    /// 16 bits, unsigned.
    U16,
    /// 32-bit float.
    F32,
}

impl Depth {
    /// Bytes of one sample.
    pub fn bytes(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::U16 => 2,
            Self::F32 => 4,
        }
    }
}

impl Pixels {
    /// `count` zeros.
    pub fn zeros(depth: Depth, count: usize) -> Self {
        match depth {
            Depth::U8 => Self::U8(vec![0; count]),
            Depth::U16 => Self::U16(vec![0; count]),
            Depth::F32 => Self::F32(vec![0.0; count]),
        }
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        match self {
            Self::U8(v) => v.len(),
            Self::U16(v) => v.len(),
            Self::F32(v) => v.len(),
        }
    }

    /// Whether there are no samples.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Depth of the samples.
    pub fn depth(&self) -> Depth {
        match self {
            Self::U8(_) => Depth::U8,
            Self::U16(_) => Depth::U16,
            Self::F32(_) => Depth::F32,
        }
    }
}

/// A picture: rows from top to bottom, samples of a pixel next to one another.
///
/// Channels: 1 grey, 2 grey and alpha, 3 RGB, 4 RGBA; alpha is straight (not premultiplied). The
/// centre of pixel (x, y) is at (x + 1/2, y + 1/2); a texture coordinate (u, v) is the point (u
/// width, (1 - v) height).
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Samples per pixel, 1 to 4.
    pub channels: u32,
    /// `width * height * channels` samples.
    pub pixels: Pixels,
}

impl Image {
    /// A picture of the given samples.
    ///
    /// # Errors
    /// If there are not 1 to 4 channels, a side is 0, or the number of samples is not `width *
    /// height * channels`.
    pub fn new(width: u32, height: u32, channels: u32, pixels: Pixels) -> Result<Self> {
        let image = Self { width, height, channels, pixels };
        image.check("image")?;
        Ok(image)
    }

    /// A picture of zeros.
    ///
    /// # Errors
    /// If there are not 1 to 4 channels, a side is 0, or the size cannot be addressed.
    pub fn zeros(width: u32, height: u32, channels: u32, depth: Depth) -> Result<Self> {
        let count = Self { width, height, channels, pixels: Pixels::U8(Vec::new()) }.sample_count("image")?;
        Ok(Self { width, height, channels, pixels: Pixels::zeros(depth, count) })
    }

    /// An 8-bit RGBA picture by the colour of each column and row.
    ///
    /// # Errors
    /// If a side is 0 or the size cannot be addressed.
    pub fn from_fn(width: u32, height: u32, color: impl Fn(u32, u32) -> [u8; 4]) -> Result<Self> {
        let mut image = Self::zeros(width, height, 4, Depth::U8)?;
        if let Pixels::U8(samples) = &mut image.pixels {
            let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
            for (pixel, (x, y)) in samples.chunks_exact_mut(4).zip(places) {
                pixel.copy_from_slice(&color(x, y));
            }
        }
        Ok(image)
    }

    /// The pixel in column `x` and row `y` as 8-bit RGBA; grey is repeated, a missing alpha is
    /// full.
    ///
    /// # Panics
    /// If there is no such pixel.
    pub fn pixel(&self, x: u32, y: u32) -> [u8; 4] {
        let first = self.index(x, y, 0);
        let sample = |c: u32| match &self.pixels {
            Pixels::U8(v) => v[first + c as usize],
            _ => (self.sample(first + c as usize).clamp(0.0, 1.0) * 255.0).round() as u8,
        };
        let [r, g, b] = if self.channels < 3 { [0; 3] } else { [0, 1, 2] }.map(sample);
        [r, g, b, if self.has_alpha() { sample(self.channels - 1) } else { 255 }]
    }

    /// Depth of the samples.
    pub fn depth(&self) -> Depth {
        self.pixels.depth()
    }

    /// Whether the last channel is alpha (2 or 4 channels).
    pub fn has_alpha(&self) -> bool {
        self.channels == 2 || self.channels == 4
    }

    /// Sample as a float: integers are scaled to 0..1, floats are returned as they are.
    ///
    /// # Panics
    /// If `index` is not below the number of samples.
    pub fn sample(&self, index: usize) -> f32 {
        match &self.pixels {
            Pixels::U8(v) => f32::from(v[index]) / 255.0,
            Pixels::U16(v) => f32::from(v[index]) / 65535.0,
            Pixels::F32(v) => v[index],
        }
    }

    /// Channel `c` of the pixel in column `x` and row `y`, with 1 as full scale.
    ///
    /// # Panics
    /// If there is no such pixel or channel.
    pub fn get(&self, x: u32, y: u32, c: u32) -> f32 {
        self.sample(self.index(x, y, c))
    }

    /// Sets channel `c` of the pixel in column `x` and row `y`; integers are rounded and clamped.
    ///
    /// # Panics
    /// If there is no such pixel or channel.
    pub fn set(&mut self, x: u32, y: u32, c: u32, value: f32) {
        let at = self.index(x, y, c);
        // The casts turn NaN into 0.
        let clamped = value.clamp(0.0, 1.0);
        match &mut self.pixels {
            Pixels::U8(s) => s[at] = (clamped * 255.0).round() as u8,
            Pixels::U16(s) => s[at] = (clamped * 65535.0).round() as u16,
            Pixels::F32(s) => s[at] = value,
        }
    }

    fn index(&self, x: u32, y: u32, c: u32) -> usize {
        assert!(x < self.width && y < self.height && c < self.channels, "pixel {x} {y} channel {c} out of range");
        (y as usize * self.width as usize + x as usize) * self.channels as usize + c as usize
    }

    /// The same picture with other depth and channels. Grey becomes RGB by repetition, RGB grey by
    /// its luma (weights 0.299, 0.587, 0.114); alpha is dropped or added as full.
    ///
    /// # Errors
    /// Unless there are 1 to 4 channels.
    pub fn converted(&self, channels: u32, depth: Depth) -> Result<Self> {
        let mut out = Self::zeros(self.width, self.height, channels, depth)?;
        let colours = self.channels - u32::from(self.has_alpha());
        let out_colours = channels - u32::from(out.has_alpha());
        for y in 0..self.height {
            for x in 0..self.width {
                for c in 0..channels {
                    let value = if c == out_colours {
                        if self.has_alpha() { self.get(x, y, colours) } else { 1.0 }
                    } else if colours == 3 && out_colours == 1 {
                        0.299 * self.get(x, y, 0) + 0.587 * self.get(x, y, 1) + 0.114 * self.get(x, y, 2)
                    } else {
                        self.get(x, y, c.min(colours - 1))
                    };
                    out.set(x, y, c, value);
                }
            }
        }
        Ok(out)
    }

    /// Checks what [`Image::new`] promises, for pictures whose fields were filled in directly;
    /// `name` goes into the message.
    ///
    /// # Errors
    /// As [`Image::new`].
    pub fn check(&self, name: &str) -> Result<()> {
        let expected = self.sample_count(name)?;
        if self.pixels.len() != expected {
            return Err(Error::input(
                format!(
                    "{name}: {} samples for {} x {} pixels of {} channels",
                    self.pixels.len(),
                    self.width,
                    self.height,
                    self.channels
                ),
                format!("Give {expected} samples"),
            ));
        }
        Ok(())
    }

    fn sample_count(&self, name: &str) -> Result<usize> {
        if self.width == 0 || self.height == 0 {
            return Err(Error::input(
                format!("{name}: {} x {} pixels", self.width, self.height),
                "Give a picture of at least one pixel",
            ));
        }
        if !(1..=4).contains(&self.channels) {
            return Err(Error::input(
                format!("{name}: {} channels", self.channels),
                "Give 1 (grey), 2 (grey, alpha), 3 (RGB) or 4 (RGBA)",
            ));
        }
        (self.width as usize)
            .checked_mul(self.height as usize)
            .and_then(|n| n.checked_mul(self.channels as usize))
            .filter(|&n| n <= isize::MAX as usize / 4)
            .ok_or_else(|| {
                Error::input(
                    format!("{name}: {} x {} pixels cannot be addressed", self.width, self.height),
                    "Use a smaller picture",
                )
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_checked() {
        assert!(Image::new(2, 3, 4, Pixels::U8(vec![0; 24])).is_ok());
        assert!(Image::new(2, 3, 4, Pixels::U8(vec![0; 23])).is_err());
        assert!(Image::new(0, 3, 4, Pixels::U8(vec![])).is_err());
        assert!(Image::new(2, 3, 5, Pixels::U8(vec![0; 30])).is_err());
        assert!(Image::zeros(u32::MAX, u32::MAX, 4, Depth::F32).is_err());
    }

    #[test]
    fn pixels_are_those_of_the_converted_picture() {
        let value = |i: u16| i * 4001;
        for channels in 1..=4 {
            let samples = (0..6 * channels as u16).map(value).collect();
            let image = Image::new(3, 2, channels, Pixels::U16(samples)).unwrap();
            let Pixels::U8(all) = image.converted(4, Depth::U8).unwrap().pixels else { panic!("not 8-bit") };
            let same = Image::from_fn(3, 2, |x, y| image.pixel(x, y)).unwrap();
            assert_eq!(same.pixels, Pixels::U8(all), "{channels}");
        }
        let first = Image::from_fn(2, 2, |x, y| [x as u8, y as u8, 7, 9]).unwrap();
        assert_eq!(first.pixel(1, 0), [1, 0, 7, 9]);
        assert_eq!(Image::from_fn(1, 1, |_, _| [0, 0, 0, 255]).unwrap().pixel(0, 0), [0, 0, 0, 255]);
    }

    #[test]
    fn samples_are_scaled_to_one() {
        let one = |p| Image::new(1, 1, 1, p).expect("one sample").sample(0);
        assert_eq!(one(Pixels::U8(vec![255])), 1.0);
        assert_eq!(one(Pixels::U16(vec![65535])), 1.0);
        assert_eq!(one(Pixels::F32(vec![3.5])), 3.5);
    }
}
