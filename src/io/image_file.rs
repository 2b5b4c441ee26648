//! Pictures: PNG, JPEG, TIFF and OpenEXR.
//!
//! A picture stays in memory as the file stores it: its channels, and 8-bit, 16-bit or float samples. Values are the stored ones; no colour
//! space is applied. Row 0 is the top.

use std::io::Cursor;
use std::path::Path;

use image::codecs::jpeg::JpegEncoder;
use image::{DynamicImage, ExtendedColorType, ImageDecoder, ImageFormat, ImageReader, Limits};

use super::{output, source};
use crate::raster::{Depth, Image, Pixels};
use crate::{Error, Result};

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
        DynamicImage::ImageLuma8(b) => (1, Pixels::U8(b.into_raw())),
        DynamicImage::ImageLumaA8(b) => (2, Pixels::U8(b.into_raw())),
        DynamicImage::ImageRgb8(b) => (3, Pixels::U8(b.into_raw())),
        DynamicImage::ImageRgba8(b) => (4, Pixels::U8(b.into_raw())),
        DynamicImage::ImageLuma16(b) => (1, Pixels::U16(b.into_raw())),
        DynamicImage::ImageLumaA16(b) => (2, Pixels::U16(b.into_raw())),
        DynamicImage::ImageRgb16(b) => (3, Pixels::U16(b.into_raw())),
        DynamicImage::ImageRgba16(b) => (4, Pixels::U16(b.into_raw())),
        DynamicImage::ImageRgb32F(b) => (3, Pixels::F32(b.into_raw())),
        DynamicImage::ImageRgba32F(b) => (4, Pixels::F32(b.into_raw())),
        other => return Err(fail(format!("pixels of the kind {:?} are not read", other.color()))),
    };
    Image::new(width, height, channels, samples)
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
            Err(Error::option("--output", what, "End the name in .png, .jpg, .tif or .exr"))
        }
    }
}

fn encode(image: &Image, format: ImageFormat, path: &Path) -> Result<Vec<u8>> {
    let colours = image.channels - u32::from(image.has_alpha());
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
        converted = image.converted(channels, depth)?;
        &converted
    };
    let (bytes, colour): (&[u8], _) = match (&image.pixels, channels) {
        (Pixels::U8(s), 1) => (s, ExtendedColorType::L8),
        (Pixels::U8(s), 2) => (s, ExtendedColorType::La8),
        (Pixels::U8(s), 3) => (s, ExtendedColorType::Rgb8),
        (Pixels::U8(s), _) => (s, ExtendedColorType::Rgba8),
        (Pixels::U16(s), 1) => (bytemuck::cast_slice(s), ExtendedColorType::L16),
        (Pixels::U16(s), 2) => (bytemuck::cast_slice(s), ExtendedColorType::La16),
        (Pixels::U16(s), 3) => (bytemuck::cast_slice(s), ExtendedColorType::Rgb16),
        (Pixels::U16(s), _) => (bytemuck::cast_slice(s), ExtendedColorType::Rgba16),
        (Pixels::F32(s), 3) => (bytemuck::cast_slice(s), ExtendedColorType::Rgb32F),
        (Pixels::F32(s), _) => (bytemuck::cast_slice(s), ExtendedColorType::Rgba32F),
    };
    let fail = |e: image::ImageError| {
        Error::format(path, None, format!("the picture cannot be encoded: {e}"), "Use another format or size")
    };
    let (width, height) = (image.width, image.height);
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

    fn pattern(channels: u32, depth: Depth) -> Image {
        let mut image = Image::zeros(7, 5, channels, depth).unwrap();
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
            assert_eq!((back.channels, back.depth()), expected, "{name}");
            let tolerance = if name.contains(".j") { 0.5 } else { 1e-4 };
            assert!((back.get(2, 1, 0) - image.get(2, 1, 0)).abs() < tolerance, "{name}");
        }
        assert!(write_image(&pattern(1, Depth::U8), dir.path().join("g.bmp")).is_err());
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 6);
    }

    #[test]
    fn floats_beyond_one_survive_and_integers_clamp() {
        let image = Image::new(1, 1, 3, Pixels::F32(vec![-0.5, 7.25, f32::NAN])).unwrap();
        let bytes = encode(&image, ImageFormat::OpenExr, Path::new("x")).unwrap();
        let back = decode_image(&bytes, "x").unwrap();
        assert_eq!((back.get(0, 0, 0), back.get(0, 0, 1)), (-0.5, 7.25));
        let png = decode_image(&encode_png(&image).unwrap(), "x").unwrap();
        assert_eq!(png.pixels, Pixels::U16(vec![0, 65535, 0]));
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
