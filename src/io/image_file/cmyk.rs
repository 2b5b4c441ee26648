//! Pictures for print: cyan, magenta, yellow and black become red, green and blue.

use moxcms::{ColorProfile, Layout, TransformOptions};
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

/// What the user should know of such a picture.
pub(super) fn note(profiled: bool) -> String {
    match profiled {
        true => "the picture is CMYK: it becomes RGB (sRGB) by its colour profile, as whatever is written".into(),
        false => "the picture is CMYK without a usable profile: it becomes RGB by a plain formula, and colours may look different".into(),
    }
}

/// Colours of 8-bit amounts of ink, 255 for full; whether the profile could be used.
pub(super) fn to_rgb8(inks: &[u8], icc: Option<&[u8]>) -> (Vec<u8>, bool) {
    let mut colors = vec![0; inks.len() / 4 * 3];
    if let Some((profile, srgb)) = profiles(icc)
        && let Ok(transform) =
            profile.create_transform_8bit(Layout::Rgba, &srgb, Layout::Rgb, TransformOptions::default())
        && transform.transform(inks, &mut colors).is_ok()
    {
        return (colors, true);
    }
    for (color, ink) in colors.chunks_exact_mut(3).zip(inks.chunks_exact(4)) {
        let [c, m, y, k] = [0, 1, 2, 3].map(|i| 255 - u32::from(ink[i]));
        color.copy_from_slice(&[c, m, y].map(|v| ((v * k + 127) / 255) as u8));
    }
    (colors, false)
}

/// [`to_rgb8`] for 16 bits.
pub(super) fn to_rgb16(inks: &[u16], icc: Option<&[u8]>) -> (Vec<u16>, bool) {
    let mut colors = vec![0; inks.len() / 4 * 3];
    if let Some((profile, srgb)) = profiles(icc)
        && let Ok(transform) =
            profile.create_transform_16bit(Layout::Rgba, &srgb, Layout::Rgb, TransformOptions::default())
        && transform.transform(inks, &mut colors).is_ok()
    {
        return (colors, true);
    }
    for (color, ink) in colors.chunks_exact_mut(3).zip(inks.chunks_exact(4)) {
        let [c, m, y, k] = [0, 1, 2, 3].map(|i| 65535 - u64::from(ink[i]));
        color.copy_from_slice(&[c, m, y].map(|v| ((v * k + 32767) / 65535) as u16));
    }
    (colors, false)
}

fn profiles(icc: Option<&[u8]>) -> Option<(ColorProfile, ColorProfile)> {
    let icc = icc.filter(|p| p.get(16..20) == Some(b"CMYK"))?;
    Some((ColorProfile::new_from_slice(icc).ok()?, ColorProfile::new_srgb()))
}

/// The amounts of ink that a JPEG file of four components stores. Such files count the other way
/// round, 255 for no ink.
pub(super) fn jpeg_inks(bytes: &[u8]) -> Result<Vec<u8>, String> {
    let failed = |e: zune_jpeg::errors::DecodeErrors| format!("the picture cannot be read: {e:?}");
    let options = DecoderOptions::default().set_strict_mode(false).set_max_width(65_535).set_max_height(65_535);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    decoder.decode_headers().map_err(failed)?;
    let stored = decoder.input_colorspace().unwrap_or(ColorSpace::CMYK);
    decoder.set_options(options.jpeg_set_out_colorspace(stored));
    let mut samples = decoder.decode().map_err(failed)?;
    if stored == ColorSpace::YCCK {
        for pixel in samples.chunks_exact_mut(4) {
            // What the transform takes for red, green and blue is the amount of ink.
            let rgb = ycc_to_rgb([pixel[0], pixel[1], pixel[2]]);
            pixel[..3].copy_from_slice(&rgb);
            pixel[3] = 255 - pixel[3];
        }
    } else {
        samples.iter_mut().for_each(|s| *s = 255 - *s);
    }
    Ok(samples)
}

/// Red, green and blue of brightness and two colour differences, as JPEG files store them (ITU
/// T.871).
pub(super) fn ycc_to_rgb([y, cb, cr]: [u8; 3]) -> [u8; 3] {
    let (y, cb, cr) = (f32::from(y), f32::from(cb) - 128.0, f32::from(cr) - 128.0);
    let rgb = [y + 1.402 * cr, y - 0.344_136 * cb - 0.714_136 * cr, y + 1.772 * cb];
    rgb.map(|v| v.round().clamp(0.0, 255.0) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inks_take_light_away() {
        let inks = [0, 0, 0, 0, 255, 0, 0, 0, 0, 255, 255, 0, 0, 0, 0, 255, 0, 0, 0, 128];
        let expected = [255, 255, 255, 0, 255, 255, 255, 0, 0, 0, 0, 0, 127, 127, 127];
        assert_eq!(to_rgb8(&inks, None), (expected.to_vec(), false));
        let wide: Vec<u16> = inks.iter().map(|v| u16::from(*v) * 257).collect();
        let (colors, profiled) = to_rgb16(&wide, Some(b"not a profile"));
        assert!(!profiled);
        assert!(colors.iter().zip(expected).all(|(a, b)| a.abs_diff(u16::from(b) * 257) < 257), "{colors:?}");
    }

    #[test]
    fn grey_has_no_colour_difference() {
        assert_eq!(ycc_to_rgb([77, 128, 128]), [77; 3]);
        assert_eq!(ycc_to_rgb([76, 85, 255]), [254, 0, 0]);
    }
}
