//! Pictures: PNG, JPEG, TIFF and OpenEXR.
//!
//! A picture stays in memory as the file stores it: its channels, and 8-bit, 16-bit or float samples. Values are the stored ones; no colour
//! space is applied. Row 0 is the top.

use std::io::Cursor;
use std::path::Path;

use image::codecs::jpeg::JpegEncoder;
use image::{DynamicImage, ExtendedColorType, ImageDecoder, ImageFormat, ImageReader, Limits};

use super::{output, source};
use crate::{Error, Result};

/// The samples of a picture in row order, channels interleaved.
#[derive(Clone, Debug, PartialEq)]
pub enum Samples {
    /// 8 bits, 255 is full.
    U8(Vec<u8>),
    /// 16 bits, 65535 is full.
    U16(Vec<u16>),
    /// Floating point, 1 is full; any value may occur.
    F32(Vec<f32>),
}

/// How precisely a picture stores its samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Depth {
    /// 8-bit integers.
    U8,
    /// 16-bit integers.
    U16,
    /// Single precision floating point.
    F32,
}

/// A picture with 1 (grey), 2 (grey, alpha), 3 (RGB) or 4 (RGBA) channels.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    width: usize,
    height: usize,
    channels: usize,
    samples: Samples,
}

impl Image {
    /// A black, transparent picture.
    pub fn new(width: usize, height: usize, channels: usize, depth: Depth) -> Self {
        let count = width * height * channels;
        let samples = match depth {
            Depth::U8 => Samples::U8(vec![0; count]),
            Depth::U16 => Samples::U16(vec![0; count]),
            Depth::F32 => Samples::F32(vec![0.0; count]),
        };
        Self { width, height, channels, samples }
    }

    /// A picture of the given samples.
    ///
    /// # Errors
    /// [`Error::Input`] unless there are 1 to 4 channels and `width * height * channels` samples.
    pub fn from_samples(width: usize, height: usize, channels: usize, samples: Samples) -> Result<Self> {
        let count = match &samples {
            Samples::U8(s) => s.len(),
            Samples::U16(s) => s.len(),
            Samples::F32(s) => s.len(),
        };
        let wanted = width.checked_mul(height).and_then(|n| n.checked_mul(channels));
        if !(1..=4).contains(&channels) || wanted != Some(count) {
            let what = format!("{count} samples are no picture of {width} x {height} with {channels} channels");
            return Err(Error::input(what, "Give width * height * channels samples of 1 to 4 channels"));
        }
        Ok(Self { width, height, channels, samples })
    }

    /// Pixels in a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Samples of a pixel, 1 to 4.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// How samples are stored.
    pub fn depth(&self) -> Depth {
        match self.samples {
            Samples::U8(_) => Depth::U8,
            Samples::U16(_) => Depth::U16,
            Samples::F32(_) => Depth::F32,
        }
    }

    /// The samples, row by row from the top, channels interleaved.
    pub fn samples(&self) -> &Samples {
        &self.samples
    }

    /// The samples, to be changed in place.
    pub fn samples_mut(&mut self) -> &mut Samples {
        &mut self.samples
    }

    /// Whether the last channel is an alpha channel.
    pub fn has_alpha(&self) -> bool {
        self.channels % 2 == 0
    }

    /// Channel `c` of the pixel in column `x` and row `y`, with 1 as full scale.
    ///
    /// # Panics
    /// If there is no such pixel or channel.
    pub fn get(&self, x: usize, y: usize, c: usize) -> f32 {
        let at = self.at(x, y, c);
        match &self.samples {
            Samples::U8(s) => f32::from(s[at]) / 255.0,
            Samples::U16(s) => f32::from(s[at]) / 65535.0,
            Samples::F32(s) => s[at],
        }
    }

    /// Sets channel `c` of the pixel in column `x` and row `y`; integers are rounded and clamped.
    ///
    /// # Panics
    /// If there is no such pixel or channel.
    pub fn set(&mut self, x: usize, y: usize, c: usize, value: f32) {
        let at = self.at(x, y, c);
        match &mut self.samples {
            Samples::U8(s) => s[at] = to_u8(value),
            Samples::U16(s) => s[at] = to_u16(value),
            Samples::F32(s) => s[at] = value,
        }
    }

    fn at(&self, x: usize, y: usize, c: usize) -> usize {
        assert!(x < self.width && y < self.height && c < self.channels, "pixel {x} {y} channel {c} out of range");
        (y * self.width + x) * self.channels + c
    }

    /// The same picture with other depth and channels. Grey becomes RGB by repetition, RGB grey by its first channel's luma weights
    /// (0.299, 0.587, 0.114); alpha is dropped or added as full.
    ///
    /// # Panics
    /// Unless there are 1 to 4 channels.
    pub fn converted(&self, channels: usize, depth: Depth) -> Self {
        let mut out = Self::new(self.width, self.height, channels, depth);
        assert!((1..=4).contains(&channels), "{channels} channels");
        let colours = self.channels - usize::from(self.has_alpha());
        let out_colours = channels - usize::from(out.has_alpha());
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
        out
    }
}

fn to_u8(x: f32) -> u8 {
    // The cast turns NaN into 0.
    (x.clamp(0.0, 1.0) * 255.0).round() as u8
}

fn to_u16(x: f32) -> u16 {
    (x.clamp(0.0, 1.0) * 65535.0).round() as u16
}

/// More samples than this in one picture are not read: 32768 x 32768 pixels of 8-bit RGBA, or 16384 x 16384 of float RGBA.
const LARGEST: u64 = 4 << 30;

/// Reads a picture; the format is told by the content. Palettes are expanded, 1, 2 and 4 bits become 8.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] if the file is damaged, of another kind, empty, or declares a size that its bytes cannot hold.
pub fn read_image(path: impl AsRef<Path>) -> Result<Image> {
    let path = path.as_ref();
    decode_image(&source::read_all(path)?, path)
}

/// Decodes the bytes of a picture file (an embedded texture, for example); `name` stands in messages.
///
/// # Errors
/// As [`read_image`].
pub fn decode_image(bytes: &[u8], name: impl AsRef<Path>) -> Result<Image> {
    let name = name.as_ref();
    let remedy = "Use a PNG, JPEG, TIFF or OpenEXR file, or save the picture again";
    let fail = |what: String| Error::format(name, None, what, remedy);
    if bytes.is_empty() {
        return Err(fail("the picture file is empty".into()));
    }
    // Reading from memory cannot fail.
    let mut reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| fail(e.to_string()))?;
    if reader.format().is_none() {
        return Err(fail("this is not a picture of a known kind".into()));
    }
    let mut limits = Limits::default();
    limits.max_alloc = Some(LARGEST);
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(|e| fail(format!("the picture cannot be read: {e}")))?;
    let (width, height) = decoder.dimensions();
    // No codec packs more than about 4000 bytes into one: a tiny file must not ask for gigabytes.
    let plausible = (bytes.len() as u64).saturating_mul(4096).saturating_add(64 << 20);
    if decoder.total_bytes() > LARGEST.min(plausible) {
        return Err(fail(format!("the declared size {width} x {height} does not fit a file of {} bytes", bytes.len())));
    }
    if width == 0 || height == 0 {
        return Err(fail(format!("the picture has no pixels ({width} x {height})")));
    }
    let decoded = DynamicImage::from_decoder(decoder).map_err(|e| fail(format!("the picture cannot be read: {e}")))?;
    let (channels, samples) = match decoded {
        DynamicImage::ImageLuma8(b) => (1, Samples::U8(b.into_raw())),
        DynamicImage::ImageLumaA8(b) => (2, Samples::U8(b.into_raw())),
        DynamicImage::ImageRgb8(b) => (3, Samples::U8(b.into_raw())),
        DynamicImage::ImageRgba8(b) => (4, Samples::U8(b.into_raw())),
        DynamicImage::ImageLuma16(b) => (1, Samples::U16(b.into_raw())),
        DynamicImage::ImageLumaA16(b) => (2, Samples::U16(b.into_raw())),
        DynamicImage::ImageRgb16(b) => (3, Samples::U16(b.into_raw())),
        DynamicImage::ImageRgba16(b) => (4, Samples::U16(b.into_raw())),
        DynamicImage::ImageRgb32F(b) => (3, Samples::F32(b.into_raw())),
        DynamicImage::ImageRgba32F(b) => (4, Samples::F32(b.into_raw())),
        other => return Err(fail(format!("pixels of the kind {:?} are not read", other.color()))),
    };
    Image::from_samples(width as usize, height as usize, channels, samples)
}

/// Writes a picture in the format of the file's extension (`png`, `jpg`, `jpeg`, `tif`, `tiff`, `exr`), whole or not at all.
///
/// Channels and depth are kept where the format has them. Otherwise: float becomes 16-bit in PNG; everything becomes 8-bit without alpha in
/// JPEG (quality 95); OpenEXR is float RGB or RGBA; grey with alpha, and grey float, become RGB in TIFF.
///
/// # Errors
/// [`Error::Option`] on another extension; [`Error::Io`].
pub fn write_image(image: &Image, path: impl AsRef<Path>) -> Result<()> {
    let path = path.as_ref();
    let bytes = encode(image, format_of(path)?, path)?;
    output::write_bytes(path, &bytes)
}

/// Fails unless [`write_image`] knows the extension of `path`.
///
/// # Errors
/// [`Error::Option`].
pub fn check_image_extension(path: impl AsRef<Path>) -> Result<()> {
    format_of(path.as_ref()).map(drop)
}

/// The bytes of a PNG file.
///
/// # Errors
/// [`Error::Format`] on a picture without pixels.
pub fn encode_png(image: &Image) -> Result<Vec<u8>> {
    encode(image, ImageFormat::Png, Path::new("PNG"))
}

fn format_of(path: &Path) -> Result<ImageFormat> {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    match extension.as_str() {
        "png" => Ok(ImageFormat::Png),
        "jpg" | "jpeg" => Ok(ImageFormat::Jpeg),
        "tif" | "tiff" => Ok(ImageFormat::Tiff),
        "exr" => Ok(ImageFormat::OpenExr),
        _ => {
            let what = format!("{} has no extension of a picture format that can be written", path.display());
            Err(Error::option("--out", what, "End the name in .png, .jpg, .tif or .exr"))
        }
    }
}

fn encode(image: &Image, format: ImageFormat, path: &Path) -> Result<Vec<u8>> {
    let colours = image.channels - usize::from(image.has_alpha());
    let (channels, depth) = match (format, image.depth()) {
        (ImageFormat::Png, Depth::F32) => (image.channels, Depth::U16),
        (ImageFormat::Jpeg, _) => (colours, Depth::U8),
        (ImageFormat::OpenExr, _) => (if image.has_alpha() { 4 } else { 3 }, Depth::F32),
        (ImageFormat::Tiff, depth) if image.channels == 2 => (4, depth),
        (ImageFormat::Tiff, Depth::F32) => (image.channels.max(3), Depth::F32),
        (_, depth) => (image.channels, depth),
    };
    let converted;
    let image = if (channels, depth) == (image.channels, image.depth()) {
        image
    } else {
        converted = image.converted(channels, depth);
        &converted
    };
    let (bytes, colour): (&[u8], _) = match (&image.samples, channels) {
        (Samples::U8(s), 1) => (s, ExtendedColorType::L8),
        (Samples::U8(s), 2) => (s, ExtendedColorType::La8),
        (Samples::U8(s), 3) => (s, ExtendedColorType::Rgb8),
        (Samples::U8(s), _) => (s, ExtendedColorType::Rgba8),
        (Samples::U16(s), 1) => (bytemuck::cast_slice(s), ExtendedColorType::L16),
        (Samples::U16(s), 2) => (bytemuck::cast_slice(s), ExtendedColorType::La16),
        (Samples::U16(s), 3) => (bytemuck::cast_slice(s), ExtendedColorType::Rgb16),
        (Samples::U16(s), _) => (bytemuck::cast_slice(s), ExtendedColorType::Rgba16),
        (Samples::F32(s), 3) => (bytemuck::cast_slice(s), ExtendedColorType::Rgb32F),
        (Samples::F32(s), _) => (bytemuck::cast_slice(s), ExtendedColorType::Rgba32F),
    };
    let fail = |e: image::ImageError| {
        Error::format(path, None, format!("the picture cannot be encoded: {e}"), "Use another format or size")
    };
    let (width, height) = (image.width as u64, image.height as u64);
    let (Ok(width), Ok(height)) = (u32::try_from(width), u32::try_from(height)) else {
        let what = format!("{width} x {height} pixels are too many");
        return Err(Error::format(path, None, what, "Use a smaller size"));
    };
    let mut file = Cursor::new(Vec::new());
    match format {
        ImageFormat::Jpeg => {
            JpegEncoder::new_with_quality(&mut file, 95).encode(bytes, width, height, colour).map_err(fail)?;
        }
        _ => image::write_buffer_with_format(&mut file, bytes, width, height, colour, format).map_err(fail)?,
    }
    Ok(file.into_inner())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pattern(channels: usize, depth: Depth) -> Image {
        let mut image = Image::new(7, 5, channels, depth);
        for k in 0..7 * 5 * channels {
            let value = ((k * 37) % 256) as f32 / 255.0;
            image.set(k / channels % 7, k / channels / 7, k % channels, value);
        }
        image
    }

    #[test]
    fn formats_keep_channels_and_depth() {
        let dir = tempfile::tempdir().unwrap();
        let cases = [
            ("png", vec![1, 2, 3, 4], vec![Depth::U8, Depth::U16]),
            ("tif", vec![1, 3, 4], vec![Depth::U8, Depth::U16]),
            ("tiff", vec![3, 4], vec![Depth::F32]),
            ("exr", vec![3, 4], vec![Depth::F32]),
        ];
        for (extension, channels, depths) in cases {
            for &c in &channels {
                for &depth in &depths {
                    let image = pattern(c, depth);
                    let path = dir.path().join(format!("{c}{depth:?}.{extension}"));
                    write_image(&image, &path).unwrap();
                    let back = read_image(&path).unwrap();
                    assert!(back == image, "{}", path.display());
                    let mut changed = image.clone();
                    changed.set(3, 2, 0, 1.0 - image.get(3, 2, 0));
                    assert!(back != changed, "the comparison must see one sample");
                }
            }
        }
    }

    #[test]
    fn what_a_format_lacks_is_converted() {
        let dir = tempfile::tempdir().unwrap();
        for (name, channels, depth, expected) in [
            ("a.jpg", 4, Depth::U16, (3, Depth::U8)),
            ("b.jpeg", 2, Depth::U8, (1, Depth::U8)),
            ("c.png", 3, Depth::F32, (3, Depth::U16)),
            ("d.exr", 2, Depth::U8, (4, Depth::F32)),
            ("e.tif", 1, Depth::F32, (3, Depth::F32)),
            ("f.TIF", 2, Depth::U8, (4, Depth::U8)),
        ] {
            let image = pattern(channels, depth);
            write_image(&image, dir.path().join(name)).unwrap();
            let back = read_image(dir.path().join(name)).unwrap();
            assert_eq!((back.channels(), back.depth()), expected, "{name}");
            let tolerance = if name.contains(".j") { 0.5 } else { 1e-4 };
            assert!((back.get(2, 1, 0) - image.get(2, 1, 0)).abs() < tolerance, "{name}");
        }
        assert!(write_image(&pattern(1, Depth::U8), dir.path().join("g.bmp")).is_err());
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 6);
    }

    #[test]
    fn floats_beyond_one_survive_and_integers_clamp() {
        let image = Image::from_samples(1, 1, 3, Samples::F32(vec![-0.5, 7.25, f32::NAN])).unwrap();
        let bytes = encode(&image, ImageFormat::OpenExr, Path::new("x")).unwrap();
        let back = decode_image(&bytes, "x").unwrap();
        assert_eq!((back.get(0, 0, 0), back.get(0, 0, 1)), (-0.5, 7.25));
        let png = decode_image(&encode_png(&image).unwrap(), "x").unwrap();
        assert_eq!(*png.samples(), Samples::U16(vec![0, 65535, 0]));
    }

    #[test]
    fn a_small_file_cannot_ask_for_much() {
        let mut bytes = encode_png(&pattern(4, Depth::U8)).unwrap();
        // Width and height of the header chunk, with its checksum made right.
        bytes[16..24].copy_from_slice(&[0, 0, 0x7f, 0xff, 0, 0, 0x7f, 0xff]);
        let crc = bytes[12..29].iter().fold(!0u32, |crc, b| {
            (0..8).fold(crc ^ u32::from(*b), |c, _| if c & 1 == 1 { c >> 1 ^ 0xedb8_8320 } else { c >> 1 })
        });
        bytes[29..33].copy_from_slice(&(!crc).to_be_bytes());
        let message = decode_image(&bytes, "bomb.png").unwrap_err().to_string();
        assert!(message.contains("bomb.png") && message.contains("32767"), "{message}");
    }

    #[test]
    fn truncation_is_an_error() {
        for format in [ImageFormat::Png, ImageFormat::Tiff, ImageFormat::OpenExr] {
            let image = pattern(3, if format == ImageFormat::OpenExr { Depth::F32 } else { Depth::U8 });
            let bytes = encode(&image, format, Path::new("x")).unwrap();
            for length in [0, 1, 4, 8, 20, bytes.len() / 2] {
                assert!(decode_image(&bytes[..length], "cut").is_err(), "{format:?} cut at {length}");
            }
        }
    }
}
