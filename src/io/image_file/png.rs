//! The chunks of PNG files that say something of the picture.

use std::io::{Read, Write};

use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};

use super::metadata::{Density, DensityUnit, Metadata, Part};

/// Chunks that tell what the colours mean.
const COLORS: [&[u8; 4]; 6] = [b"sRGB", b"gAMA", b"cHRM", b"cICP", b"mDCV", b"cLLI"];
/// Chunks with text.
const TEXTS: [&[u8; 4]; 3] = [b"tEXt", b"zTXt", b"iTXt"];
/// The keyword of an XMP packet.
const XMP: &[u8] = b"XML:com.adobe.xmp\0";

/// Names and contents of the chunks.
pub(super) fn chunks(bytes: &[u8]) -> Vec<([u8; 4], &[u8])> {
    let mut list = Vec::new();
    let mut at = 8;
    while let Some(head) = bytes.get(at..at + 8) {
        let length = u32::from_be_bytes([head[0], head[1], head[2], head[3]]) as usize;
        let Some(content) = bytes.get(at + 8..at + 8 + length) else { break };
        list.push(([head[4], head[5], head[6], head[7]], content));
        at += 12 + length;
    }
    list
}

/// Most bytes of a profile: those of printers have a few millions.
pub(super) const PROFILE: u64 = 32 << 20;

/// Bytes that a decoder may take beside the pixels: two rows, and a profile. A profile is packed,
/// and a small file could ask for gigabytes.
pub(super) fn beside_pixels(bytes: &[u8]) -> u64 {
    let width = bytes.get(16..20).and_then(|b| b.try_into().ok()).map_or(0, u32::from_be_bytes);
    PROFILE + 64 * u64::from(width)
}

/// Bytes that are counted of a profile, at most.
pub(super) const COUNTED: u64 = 1 << 30;

/// Bytes of a profile once it is unpacked, where they are more than a decoder may take: a small
/// file could ask for gigabytes. Unpacks it in pieces, and stops at a gigabyte.
pub(super) fn too_large_a_profile(bytes: &[u8]) -> Option<u64> {
    let packed = chunks(bytes).into_iter().find(|(name, _)| name == b"iCCP")?.1;
    // Its name ends with a zero; the method of packing is one byte.
    let start = packed.iter().position(|&b| b == 0)? + 2;
    let unpacked = flate2::read::ZlibDecoder::new(packed.get(start..)?);
    let mut counted = Counted(0);
    // A damaged one ends where it is damaged.
    let _ = std::io::copy(&mut unpacked.take(COUNTED), &mut counted);
    (counted.0 > PROFILE).then_some(counted.0)
}

/// Bytes that were written here.
struct Counted(u64);

impl Write for Counted {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0 += bytes.len() as u64;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

/// Whether there is a profile, readable or not.
pub(super) fn has_profile(bytes: &[u8]) -> bool {
    chunks(bytes).iter().any(|(name, _)| name == b"iCCP")
}

/// What the chunks say of the picture, but for profile, EXIF and XMP data; whether they animate it.
pub(super) fn read(bytes: &[u8]) -> (Metadata, bool) {
    let mut metadata = Metadata::default();
    let mut animated = false;
    for (name, content) in chunks(bytes) {
        match &name {
            b"pHYs" => metadata.density = density(content),
            b"acTL" => animated = true,
            b"iTXt" if content.starts_with(XMP) => {}
            name if COLORS.contains(&name) || TEXTS.contains(&name) => {
                metadata.parts.push(Part::Png(*name, content.to_vec()));
            }
            _ => {}
        }
    }
    (metadata, animated)
}

fn density(content: &[u8]) -> Option<Density> {
    let number = |k: usize| Some(f64::from(u32::from_be_bytes(content.get(k..k + 4)?.try_into().ok()?)));
    let (x, y) = (number(0)?, number(4)?);
    let unit = match content.get(8)? {
        1 => DensityUnit::Metre,
        _ => DensityUnit::Aspect,
    };
    (x > 0.0 && y > 0.0).then_some(Density { x, y, unit })
}

/// The bytes of a PNG file.
pub(super) fn write(
    samples: &[u8],
    [width, height]: [u32; 2],
    color: ExtendedColorType,
    metadata: &Metadata,
) -> image::ImageResult<Vec<u8>> {
    let mut file = Vec::new();
    let mut encoder = PngEncoder::new(&mut file);
    let profile = metadata.profile_for(u32::from(color.channel_count()));
    // The encoder takes both.
    if let Some(icc) = profile {
        let _ = encoder.set_icc_profile(icc.to_vec());
    }
    if let Some(exif) = &metadata.exif {
        let _ = encoder.set_exif_metadata(super::exif::finished(exif, width, height));
    }
    encoder.write_image(samples, width, height, color)?;
    let mut extra = Vec::new();
    for part in &metadata.parts {
        // A profile says more than these, and what says both is refused by some.
        if let Part::Png(name, content) = part
            && !(profile.is_some() && COLORS.contains(&name))
        {
            append(&mut extra, *name, content);
        }
    }
    if let Some(density) = metadata.density {
        let d = density.to(DensityUnit::Metre);
        let whole = |v: f64| (v.round().clamp(1.0, f64::from(i32::MAX)) as u32).to_be_bytes();
        let unit = [u8::from(d.unit == DensityUnit::Metre)];
        append(&mut extra, *b"pHYs", &[&whole(d.x)[..], &whole(d.y), &unit].concat());
    }
    if let Some(packet) = &metadata.xmp {
        // Keyword; not compressed; no language, no translation.
        append(&mut extra, *b"iTXt", &[XMP, &[0, 0, 0, 0], packet].concat());
    }
    // Behind the signature and the header, which is to be the first.
    file.splice(8 + 25..8 + 25, extra);
    Ok(file)
}

fn append(bytes: &mut Vec<u8>, name: [u8; 4], content: &[u8]) {
    bytes.extend_from_slice(&(content.len() as u32).to_be_bytes());
    let start = bytes.len();
    bytes.extend_from_slice(&name);
    bytes.extend_from_slice(content);
    let checksum = crc32fast::hash(&bytes[start..]);
    bytes.extend_from_slice(&checksum.to_be_bytes());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        let mut icc = vec![7; 200];
        icc[16..20].copy_from_slice(b"RGB ");
        let mut metadata = Metadata {
            density: Some(Density { x: 11_811.0, y: 5000.0, unit: DensityUnit::Metre }),
            xmp: Some(b"<x/>".to_vec()),
            parts: vec![Part::Png(*b"gAMA", vec![0, 0, 0xb1, 0x8f]), Part::Png(*b"tEXt", b"Author\0me".to_vec())],
            ..Metadata::default()
        };
        let samples: Vec<u8> = (0..5 * 3 * 3).collect();
        let file = write(&samples, [5, 3], ExtendedColorType::Rgb8, &metadata).unwrap();
        let (found, animated) = read(&file);
        assert_eq!((found.density, &found.parts, animated), (metadata.density, &metadata.parts, false));
        assert_eq!(image::load_from_memory(&file).unwrap().into_bytes(), samples);
        metadata.icc = Some(icc);
        let file = write(&samples, [5, 3], ExtendedColorType::Rgb8, &metadata).unwrap();
        let names: Vec<[u8; 4]> = chunks(&file).iter().map(|c| c.0).collect();
        assert!(names.contains(b"iCCP") && !names.contains(b"gAMA") && names[0] == *b"IHDR", "{names:?}");
        for length in 0..file.len() {
            drop(read(&file[..length]));
        }
    }

    #[test]
    fn inches_become_metres() {
        let metadata =
            Metadata { density: Some(Density { x: 300.0, y: 300.0, unit: DensityUnit::Inch }), ..Metadata::default() };
        let file = write(&[0], [1, 1], ExtendedColorType::L8, &metadata).unwrap();
        assert_eq!(read(&file).0.density, Some(Density { x: 11_811.0, y: 11_811.0, unit: DensityUnit::Metre }));
    }
}
