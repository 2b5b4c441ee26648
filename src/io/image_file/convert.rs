//! What a format cannot hold: channels and depths become those it can, and the pixels that change
//! are counted.

use std::borrow::Cow;

use super::format::Format;
use crate::Result;
use crate::picture::{Depth, Image, Pixels};

/// Channels and depth that a format stores a picture with.
fn stored(format: Format, image: &Image) -> (u32, Depth) {
    let (channels, depth) = (image.channels, image.depth());
    let colors = channels - u32::from(image.has_alpha());
    let colored = if image.has_alpha() { 4 } else { 3 };
    match format {
        Format::Png if depth == Depth::F32 => (channels, Depth::U16),
        Format::Png | Format::Tiff => (channels, depth),
        Format::Jpeg => (colors, Depth::U8),
        Format::OpenExr => (channels, Depth::F32),
        Format::Tga => (if channels == 2 { 4 } else { channels }, Depth::U8),
        Format::WebP | Format::Bmp | Format::Qoi => (colored, Depth::U8),
    }
}

/// The picture as `format` stores it, and sentences on what that changes.
///
/// # Errors
/// As [`Image::converted`].
pub(super) fn fitted(image: &Image, format: Format) -> Result<(Cow<'_, Image>, Vec<String>)> {
    let (channels, depth) = stored(format, image);
    if (channels, depth) == (image.channels, image.depth()) {
        return Ok((Cow::Borrowed(image), Vec::new()));
    }
    let mut notes = Vec::new();
    let name = format.name();
    if image.has_alpha() && (channels == 1 || channels == 3) {
        let clear = pixels(image, |p| p[p.len() - 1] < 1.0);
        if clear > 0 {
            notes.push(format!(
                "{name} has no transparency: {clear} pixels that are not opaque show the colour stored there, often black; PNG keeps transparency"
            ));
        }
    }
    if depth != Depth::F32 {
        let full = if depth == Depth::U8 { 255.0 } else { 65535.0 };
        let bits = if depth == Depth::U8 { 8 } else { 16 };
        let missing = pixels(image, |p| p.iter().any(|v| v.is_nan()));
        let outside = pixels(image, |p| p.iter().any(|v| *v < 0.0 || *v > 1.0));
        if missing > 0 {
            notes.push(format!("{name} has no place for values that are not numbers: {missing} pixels become 0; TIFF and OpenEXR keep them"));
        }
        if outside > 0 {
            notes.push(format!(
                "{name} holds values from 0 to 1: {outside} pixels outside are cut off; TIFF and OpenEXR keep them"
            ));
        }
        let inexact = |v: &f32| (0.0..=1.0).contains(v) && ((v * full).round() / full - v).abs() > 1e-7;
        let rounded = pixels(image, |p| p.iter().any(inexact));
        if rounded > 0 && image.depth().bytes() > depth.bytes() {
            let wider =
                if image.depth() == Depth::U16 { "PNG and TIFF keep 16" } else { "TIFF and OpenEXR keep floats" };
            notes.push(format!("{name} holds {bits} bits a channel: {rounded} pixels are rounded; {wider}"));
        }
    }
    Ok((Cow::Owned(image.converted(channels, depth)?), notes))
}

/// Number of pixels whose samples, with 1 as full scale, `has` something. Whole numbers lie in 0..1
/// and are rounded only to 8 bits.
fn pixels(image: &Image, has: impl Fn(&[f32]) -> bool) -> u64 {
    let channels = image.channels as usize;
    let mut pixel = [0.0; 4];
    let mut count = 0;
    for k in 0..image.pixels.len() / channels {
        for (c, value) in pixel[..channels].iter_mut().enumerate() {
            *value = match &image.pixels {
                Pixels::F32(v) => v[k * channels + c],
                _ => image.sample(k * channels + c),
            };
        }
        count += u64::from(has(&pixel[..channels]));
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;

    fn notes(image: &Image, format: Format) -> Vec<String> {
        fitted(image, format).unwrap().1
    }

    #[test]
    fn pixels_that_change_are_counted() {
        let alpha = Image::new(3, 1, 4, Pixels::U8(vec![9, 9, 9, 255, 9, 9, 9, 254, 9, 9, 9, 0])).unwrap();
        assert!(notes(&alpha, Format::Jpeg)[0].contains(": 2 pixels that are not opaque"));
        assert!(notes(&alpha, Format::Png).is_empty());
        let opaque = Image::new(1, 1, 4, Pixels::U8(vec![9, 9, 9, 255])).unwrap();
        assert!(notes(&opaque, Format::Jpeg).is_empty());
        let floats = Image::new(5, 1, 1, Pixels::F32(vec![-0.1, 1.5, f32::NAN, 0.3, 1.0])).unwrap();
        let said = notes(&floats, Format::Png);
        assert!(said[0].contains("1 pixels become 0") && said[1].contains("2 pixels outside"), "{said:?}");
        assert!(said[2].contains("16 bits a channel: 1 pixels are rounded"), "{said:?}");
        assert!(notes(&floats, Format::OpenExr).is_empty() && notes(&floats, Format::Tiff).is_empty());
        let deep = Image::new(3, 1, 1, Pixels::U16(vec![0, 257 * 7, 258])).unwrap();
        let said = notes(&deep, Format::Bmp);
        assert!(said.len() == 1 && said[0].contains("8 bits a channel: 1 pixels"), "{said:?}");
    }

    #[test]
    fn formats_keep_what_they_can() {
        let kept = |format: Format, channels: u32, depth: Depth| {
            let image = Image::zeros(2, 2, channels, depth).unwrap();
            let out = fitted(&image, format).unwrap().0.into_owned();
            (out.channels, out.depth())
        };
        for channels in 1..=4 {
            for depth in [Depth::U8, Depth::U16, Depth::F32] {
                assert_eq!(kept(Format::Tiff, channels, depth), (channels, depth));
                assert_eq!(kept(Format::OpenExr, channels, depth), (channels, Depth::F32));
                assert_eq!(kept(Format::Jpeg, channels, depth), (if channels < 3 { 1 } else { 3 }, Depth::U8));
            }
        }
        assert_eq!(kept(Format::Png, 2, Depth::F32), (2, Depth::U16));
        assert_eq!(kept(Format::Tga, 2, Depth::U16), (4, Depth::U8));
        assert_eq!(kept(Format::Qoi, 1, Depth::U8), (3, Depth::U8));
    }
}
