//! The formats that the crate `image` reads and writes.

use std::io::Cursor;

use image::codecs::bmp::BmpEncoder;
use image::codecs::gif::GifDecoder;
use image::codecs::qoi::QoiEncoder;
use image::codecs::tga::TgaEncoder;
use image::codecs::webp::{WebPDecoder, WebPEncoder};
use image::{
    AnimationDecoder, DynamicImage, ExtendedColorType, ImageDecoder, ImageEncoder, ImageFormat, ImageReader,
    ImageResult, Limits,
};

use super::format::Format;
use super::metadata::{Metadata, upright_xmp};
use super::{Decoded, LARGEST, Refused, cmyk, exif, jpeg, png, too_large};
use crate::picture::{Image, Pixels};

/// Decodes a file of this format that may take `most` bytes; errors are sentences.
pub(super) fn read(bytes: &[u8], format: ImageFormat, most: u64) -> Result<Decoded, Refused> {
    let failed = |e: image::ImageError| format!("the picture cannot be read: {e}");
    if format == ImageFormat::Png
        && let Some(asked) = png::too_large_a_profile(bytes)
    {
        let (least, allowed) = (if asked < png::COUNTED { "" } else { "at least " }, png::PROFILE);
        return Err(format!("its colour profile unpacks to {least}{asked} bytes, {allowed} are allowed").into());
    }
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = Limits::default();
    limits.max_alloc = Some(if format == ImageFormat::Png { png::beside_pixels(bytes) } else { LARGEST });
    reader.limits(limits);
    let mut decoder = reader.into_decoder().map_err(failed)?;
    let (width, height) = decoder.dimensions();
    // Four inks take more than the three colours they become.
    let needed = decoder.total_bytes().max(u64::from(width) * u64::from(height) * 3);
    if needed > most {
        return Err(too_large(width.into(), height.into(), bytes.len()).into());
    }
    super::require(width.into(), height.into(), needed)?;
    if width == 0 || height == 0 {
        return Err(format!("the picture has no pixels ({width} x {height})").into());
    }
    let (mut metadata, mut notes, mut inks) = (Metadata::default(), Vec::new(), false);
    match format {
        ImageFormat::Jpeg => {
            let (found, frame) = jpeg::read(bytes);
            (metadata, inks) = (found, frame.components == 4);
        }
        ImageFormat::Png => {
            let (found, animated) = png::read(bytes);
            metadata = found;
            notes.extend(animated.then(first_frame));
            if png::has_profile(bytes) && decoder.icc_profile().ok().flatten().is_none() {
                notes.push("its colour profile is damaged, and passed over".into());
            }
        }
        ImageFormat::Gif => notes.extend(is_animated(GifDecoder::new(Cursor::new(bytes))).then(first_frame)),
        ImageFormat::WebP => {
            notes.extend(WebPDecoder::new(Cursor::new(bytes)).is_ok_and(|d| d.has_animation()).then(first_frame));
        }
        _ => {}
    }
    // A damaged profile or the like is no reason to refuse the pixels.
    metadata.icc = metadata.icc.or_else(|| decoder.icc_profile().ok().flatten()).filter(|p| p.len() >= 128);
    metadata.exif = metadata.exif.or_else(|| decoder.exif_metadata().ok().flatten()).map(without_marker);
    metadata.xmp = metadata.xmp.or_else(|| decoder.xmp_metadata().ok().flatten()).map(upright_xmp);
    metadata.density = metadata.density.or_else(|| metadata.exif.as_deref().and_then(exif::density));
    let orientation = metadata.exif.as_deref().and_then(exif::orientation).unwrap_or(1);
    let image = if inks {
        let (colors, profiled) = cmyk::to_rgb8(&cmyk::jpeg_inks(bytes)?, metadata.icc.as_deref());
        notes.push(cmyk::note(profiled));
        // It is for inks, which there are no longer.
        metadata.icc = None;
        Image::new(width, height, 3, Pixels::U8(colors)).map_err(|e| e.to_string())?
    } else {
        of_decoded(DynamicImage::from_decoder(decoder).map_err(failed)?)?
    };
    // GIF has transparency whether it is used or not.
    let image = if format == ImageFormat::Gif { opaque(image) } else { image };
    Ok(Decoded { image, metadata, orientation, notes })
}

fn first_frame() -> String {
    "the picture is animated; its first frame is read".into()
}

fn is_animated<'a>(decoder: ImageResult<impl AnimationDecoder<'a>>) -> bool {
    decoder.is_ok_and(|d| d.into_frames().take(2).filter(Result::is_ok).count() == 2)
}

/// EXIF data without the marker that JPEG files put before them, and some programs elsewhere.
fn without_marker(block: Vec<u8>) -> Vec<u8> {
    match block.strip_prefix(b"Exif\0\0") {
        Some(rest) => rest.to_vec(),
        None => block,
    }
}

fn of_decoded(decoded: DynamicImage) -> Result<Image, String> {
    let (width, height) = (decoded.width(), decoded.height());
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
        other => return Err(format!("pixels of the kind {:?} are not read", other.color())),
    };
    Image::new(width, height, channels, samples).map_err(|e| e.to_string())
}

/// The picture without transparency if every pixel is opaque.
fn opaque(image: Image) -> Image {
    match &image.pixels {
        Pixels::U8(v) if image.channels == 4 && v.iter().skip(3).step_by(4).all(|a| *a == 255) => {
            let colors = v.chunks_exact(4).flat_map(|p| &p[..3]).copied().collect();
            Image { channels: 3, pixels: Pixels::U8(colors), ..image }
        }
        _ => image,
    }
}

/// The bytes of a file of a format that has one encoder for all of 8 bits.
pub(super) fn write(
    samples: &[u8],
    [width, height]: [u32; 2],
    color: ExtendedColorType,
    format: Format,
    metadata: &Metadata,
) -> ImageResult<Vec<u8>> {
    let mut file = Vec::new();
    match format {
        Format::WebP => {
            let mut encoder = WebPEncoder::new_lossless(&mut file);
            // The encoder takes both.
            if let Some(icc) = metadata.profile_for(u32::from(color.channel_count())) {
                let _ = encoder.set_icc_profile(icc.to_vec());
            }
            if let Some(block) = &metadata.exif {
                let _ = encoder.set_exif_metadata(exif::finished(block, width, height));
            }
            encoder.write_image(samples, width, height, color)?;
        }
        Format::Tga => TgaEncoder::new(&mut file).write_image(samples, width, height, color)?,
        Format::Bmp => BmpEncoder::new(&mut file).write_image(samples, width, height, color)?,
        _ => QoiEncoder::new(&mut file).write_image(samples, width, height, color)?,
    }
    Ok(file)
}
