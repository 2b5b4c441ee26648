//! TIFF files as they are written: one strip after another without compression, with every tag that
//! came in.

use super::ifd::{BYTE, Block, Directory, RATIONAL, UNDEFINED, append_even};
use super::metadata::{DensityUnit, Metadata};
use crate::picture::{Depth, Image, Pixels};

/// About as many bytes of a strip.
const STRIP: usize = 1 << 20;

/// The bytes of a TIFF file; an error if the format cannot address them.
pub(super) fn write(image: &Image, metadata: &Metadata) -> Result<Vec<u8>, String> {
    let (channels, size) = (image.channels as usize, image.depth().bytes());
    let row = image.width as usize * channels * size;
    let total = row * image.height as usize;
    // Places have 32 bits; room for the tags.
    if total > (u32::MAX - (1 << 26)) as usize {
        return Err("a TIFF file holds up to 4 GB: write OpenEXR or PNG, or a smaller picture".into());
    }
    let mut bytes = Vec::with_capacity(total + 4096);
    bytes.extend_from_slice(b"II*\0\0\0\0\0");
    match &image.pixels {
        Pixels::U8(v) => bytes.extend_from_slice(v),
        Pixels::U16(v) => bytes.extend(v.iter().flat_map(|v| v.to_le_bytes())),
        Pixels::F32(v) => bytes.extend(v.iter().flat_map(|v| v.to_le_bytes())),
    }
    append_even(&mut bytes, &[]);
    let mut tags = match metadata.exif.as_deref().map(|exif| super::exif::finished(exif, image.width, image.height)) {
        Some(exif) => Block::open(&exif).map(|(block, first)| block.tree(first, &|_| true)).unwrap_or_default(),
        None => Directory::default(),
    };
    tags.set_longs(256, &[image.width]);
    tags.set_longs(257, &[image.height]);
    tags.set_shorts(258, &vec![8 * size as u16; channels]);
    tags.set_shorts(259, &[1]);
    tags.set_shorts(262, &[if channels < 3 { 1 } else { 2 }]);
    let rows = (STRIP / row.max(1)).clamp(1, image.height as usize);
    let starts = (0..image.height as usize).step_by(rows);
    let lengths: Vec<u32> = starts.clone().map(|y| ((image.height as usize - y).min(rows) * row) as u32).collect();
    tags.set_longs(273, &starts.map(|y| (8 + y * row) as u32).collect::<Vec<_>>());
    tags.set_shorts(274, &[1]);
    tags.set_shorts(277, &[channels as u16]);
    tags.set_longs(278, &[rows as u32]);
    tags.set_longs(279, &lengths);
    tags.set_shorts(284, &[1]);
    if image.has_alpha() {
        // Not multiplied into the colours.
        tags.set_shorts(338, &[2]);
    }
    tags.set_shorts(339, &vec![if image.depth() == Depth::F32 { 3 } else { 1 }; channels]);
    set_density(&mut tags, metadata);
    if let Some(icc) = metadata.profile_for(image.channels) {
        tags.set(34675, UNDEFINED, icc.to_vec());
    }
    if let Some(xmp) = &metadata.xmp {
        tags.set(700, BYTE, xmp.clone());
    }
    let first = tags.append(&mut bytes);
    bytes[4..8].copy_from_slice(&first.to_le_bytes());
    Ok(bytes)
}

fn set_density(tags: &mut Directory, metadata: &Metadata) {
    let Some(density) = metadata.density else { return };
    let (scale, unit) = match density.unit {
        DensityUnit::Aspect => (1.0, 1),
        DensityUnit::Inch => (1.0, 2),
        // The format counts in centimetres.
        DensityUnit::Metre => (0.01, 3),
    };
    let mut set = |tag: u16, value: f64| {
        let (n, d) = fraction(value);
        tags.set(tag, RATIONAL, [n.to_le_bytes(), d.to_le_bytes()].concat());
    };
    set(282, scale * density.x);
    set(283, scale * density.y);
    tags.set_shorts(296, &[unit]);
}

/// The fraction of a positive number by the smallest power of ten that tells it, if one does.
fn fraction(value: f64) -> (u32, u32) {
    let fits = |d: &u32| {
        let n = value * f64::from(*d);
        n < f64::from(u32::MAX) && (n - n.round()).abs() <= 1e-9 * n
    };
    let d = (0..7).map(|k| 10u32.pow(k)).find(fits).unwrap_or(1000);
    ((value * f64::from(d)).round() as u32, d)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fractions_are_exact_where_they_can_be() {
        assert_eq!(fraction(300.0), (300, 1));
        assert_eq!(fraction(118.11), (11811, 100));
        assert_eq!(fraction(0.01 * 11811.0), (11811, 100));
        assert_eq!(fraction(1.0 / 3.0), (333, 1000));
    }
}
