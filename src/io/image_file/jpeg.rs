//! The segments of JPEG files: what they say of the picture, and the quality it was written with.

use image::codecs::jpeg::{JpegEncoder, PixelDensity, PixelDensityUnit};
use image::{ExtendedColorType, ImageEncoder};

use super::metadata::{Density, DensityUnit, Metadata, Part};

const XMP: &[u8] = b"http://ns.adobe.com/xap/1.0/\0";
const EXIF: &[u8] = b"Exif\0\0";
const PROFILE: &[u8] = b"ICC_PROFILE\0";
/// The most bytes of a segment's content.
const LARGEST: usize = 65_533;

const APP0: u8 = 0xe0;
const APP1: u8 = 0xe1;
const APP2: u8 = 0xe2;
const APP13: u8 = 0xed;
const APP14: u8 = 0xee;
const COMMENT: u8 = 0xfe;
const QUANTISATION: u8 = 0xdb;

/// Quality where nothing says another.
pub(super) const QUALITY: u8 = 95;

/// The tables that quality scales (ITU T.81, annex K.1), in the zigzag order of files.
const LUMA: [u16; 64] = [
    16, 11, 12, 14, 12, 10, 16, 14, 13, 14, 18, 17, 16, 19, 24, 40, 26, 24, 22, 22, 24, 49, 35, 37, 29, 40, 58, 51, 61,
    60, 57, 51, 56, 55, 64, 72, 92, 78, 64, 68, 87, 69, 55, 56, 80, 109, 81, 87, 95, 98, 103, 104, 103, 62, 77, 113,
    121, 112, 100, 120, 92, 101, 103, 99,
];

/// Markers and contents of the segments before the first scan.
fn segments(bytes: &[u8]) -> Vec<(u8, &[u8])> {
    let mut list = Vec::new();
    let mut at = 2;
    while let Some(&[0xff, marker, high, low]) = bytes.get(at..at + 4) {
        // Fill bytes may stand before a marker.
        if marker == 0xff {
            at += 1;
            continue;
        }
        let length = usize::from(high) << 8 | usize::from(low);
        let Some(content) = bytes.get(at + 4..at + 2 + length) else { break };
        if marker == 0xda {
            break;
        }
        list.push((marker, content));
        at += 2 + length;
    }
    list
}

/// How the colours of a JPEG file are stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Frame {
    /// Colours of a pixel.
    pub(super) components: u8,
    /// The transform that Adobe's segment names, if there is one.
    pub(super) adobe: Option<u8>,
}

/// What the file says of its picture, and how it is stored.
pub(super) fn read(bytes: &[u8]) -> (Metadata, Frame) {
    let mut metadata = Metadata::default();
    let mut frame = Frame::default();
    let mut stale: Vec<String> = Vec::new();
    let mut profile: Vec<(u8, &[u8])> = Vec::new();
    for (marker, content) in segments(bytes) {
        match marker {
            APP0 if content.starts_with(b"JFIF\0") => metadata.density = jfif_density(content),
            APP0 if content.starts_with(b"JFXX") => {}
            APP1 if content.starts_with(EXIF) => metadata.exif = Some(content[EXIF.len()..].to_vec()),
            APP1 if content.starts_with(XMP) => metadata.xmp = Some(content[XMP.len()..].to_vec()),
            APP2 if content.starts_with(PROFILE) && content.len() > 14 => profile.push((content[12], &content[14..])),
            APP13 | COMMENT => metadata.parts.push(Part::Jpeg(marker, content.to_vec())),
            APP14 if content.starts_with(b"Adobe") => frame.adobe = content.get(11).copied(),
            QUANTISATION => metadata.quality = quality(content).or(metadata.quality),
            0xc0..=0xc3 | 0xc5..=0xc7 | 0xc9..=0xcb | 0xcd..=0xcf => {
                frame.components = content.get(5).copied().unwrap_or(0);
            }
            APP0..=0xef => {
                let name: String =
                    content.iter().take(20).take_while(|b| b.is_ascii_graphic()).map(|b| char::from(*b)).collect();
                stale.push(format!("APP{} {name}", marker - APP0).trim_end().to_owned());
            }
            _ => {}
        }
    }
    profile.sort_by_key(|p| p.0);
    if !profile.is_empty() {
        metadata.icc = Some(profile.iter().flat_map(|p| p.1).copied().collect());
    }
    if metadata.density.is_none() {
        metadata.density = metadata.exif.as_deref().and_then(super::exif::density);
    }
    if !stale.is_empty() {
        stale.dedup();
        metadata.parts.push(Part::Stale(format!("segments {}", stale.join(", "))));
    }
    (metadata, frame)
}

fn jfif_density(content: &[u8]) -> Option<Density> {
    let number = |k: usize| Some(f64::from(u16::from_be_bytes([*content.get(k)?, *content.get(k + 1)?])));
    let (x, y) = (number(8)?, number(10)?);
    match content.get(7)? {
        _ if !(x > 0.0 && y > 0.0) => None,
        0 if x == y => None,
        0 => Some(Density { x, y, unit: DensityUnit::Aspect }),
        1 => Some(Density { x, y, unit: DensityUnit::Inch }),
        2 => Some(Density { x: 100.0 * x, y: 100.0 * y, unit: DensityUnit::Metre }),
        _ => None,
    }
}

/// Quality that the first table of the segment (brightness) was scaled with, in the scale of the
/// JPEG group's library.
fn quality(content: &[u8]) -> Option<u8> {
    let first = *content.first()?;
    if first & 15 != 0 {
        return None;
    }
    let wide = first >> 4 == 1;
    let entry = |k: usize| match wide {
        true => Some(u16::from_be_bytes([*content.get(1 + 2 * k)?, *content.get(2 + 2 * k)?])),
        false => content.get(1 + k).map(|b| u16::from(*b)),
    };
    let table: Vec<u16> = (0..64).map(entry).collect::<Option<_>>()?;
    let off =
        |quality: &u8| -> u32 { scaled(*quality).iter().zip(&table).map(|(a, b)| u32::from(a.abs_diff(*b))).sum() };
    // Of several that fit as well, the best: nothing is lost by it.
    (1..=100).rev().min_by_key(off)
}

/// The table for brightness of a quality.
fn scaled(quality: u8) -> [u16; 64] {
    let quality = u32::from(quality);
    let scale = if quality < 50 { 5000 / quality } else { 200 - 2 * quality };
    LUMA.map(|v| ((u32::from(v) * scale + 50) / 100).clamp(1, 255) as u16)
}

/// The bytes of a JPEG file, without subsampled colours; sentences on what did not fit.
pub(super) fn write(
    samples: &[u8],
    [width, height]: [u32; 2],
    channels: u32,
    metadata: &Metadata,
) -> image::ImageResult<(Vec<u8>, Vec<String>)> {
    let mut file = Vec::new();
    let mut notes = Vec::new();
    let mut encoder = JpegEncoder::new_with_quality(&mut file, metadata.quality.unwrap_or(QUALITY));
    if let Some(density) = metadata.density {
        encoder.set_pixel_density(pixel_density(density));
    }
    if let Some(icc) = metadata.profile_for(channels) {
        // The encoder takes any profile; only one of more than 255 segments is refused, when it is
        // written.
        let _ = encoder.set_icc_profile(icc.to_vec());
    }
    if let Some(exif) = &metadata.exif {
        match super::exif::finished(exif, width, height) {
            block if block.len() + EXIF.len() <= LARGEST => drop(encoder.set_exif_metadata(block)),
            block => notes.push(format!("the {} bytes of EXIF data do not fit into a JPEG file", block.len())),
        }
    }
    let color = if channels == 1 { ExtendedColorType::L8 } else { ExtendedColorType::Rgb8 };
    encoder.encode(samples, width, height, color)?;
    let xmp = metadata.xmp.as_deref().map(|packet| (APP1, [XMP, packet].concat()));
    let parts = metadata.parts.iter().filter_map(|part| match part {
        Part::Jpeg(marker, content) => Some((*marker, content.clone())),
        Part::Png(..) | Part::Stale(_) => None,
    });
    let mut extra = Vec::new();
    for (marker, content) in xmp.into_iter().chain(parts) {
        if content.len() > LARGEST {
            notes.push(format!("{} bytes of XMP data do not fit into a JPEG file", content.len()));
            continue;
        }
        extra.extend_from_slice(&[0xff, marker]);
        extra.extend_from_slice(&(content.len() as u16 + 2).to_be_bytes());
        extra.extend_from_slice(&content);
    }
    // Behind the encoder's own application segments, which are to be the first.
    let own = |(marker, _): &&(u8, &[u8])| (APP0..=APP2).contains(marker);
    let at = 2 + segments(&file).iter().take_while(own).map(|s| s.1.len() + 4).sum::<usize>();
    file.splice(at..at, extra);
    Ok((file, notes))
}

fn pixel_density(density: Density) -> PixelDensity {
    let whole = |v: f64| v.round().clamp(1.0, 65535.0) as u16;
    let pair = |d: Density| (whole(d.x), whole(d.y));
    match density.unit {
        DensityUnit::Inch => PixelDensity { density: pair(density), unit: PixelDensityUnit::Inches },
        DensityUnit::Aspect => PixelDensity { density: pair(density), unit: PixelDensityUnit::PixelAspectRatio },
        DensityUnit::Metre => {
            let per_centimetre = Density { x: density.x / 100.0, y: density.y / 100.0, ..density };
            if per_centimetre.x.fract() == 0.0 && per_centimetre.y.fract() == 0.0 {
                return PixelDensity { density: pair(per_centimetre), unit: PixelDensityUnit::Centimeters };
            }
            PixelDensity { density: pair(density.to(DensityUnit::Inch)), unit: PixelDensityUnit::Inches }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey(metadata: &Metadata) -> Vec<u8> {
        let samples: Vec<u8> = (0..32 * 24).map(|k| (k * 7 % 256) as u8).collect();
        write(&samples, [32, 24], 1, metadata).unwrap().0
    }

    #[test]
    fn the_quality_of_a_file_is_found_again() {
        for expected in 1..=100 {
            let file = grey(&Metadata { quality: Some(expected), ..Metadata::default() });
            let found = read(&file).0.quality.unwrap();
            // Below 5 all entries are at their limit, and a few neighbours share a table.
            assert!(scaled(found) == scaled(expected) && found.abs_diff(expected) <= 4, "{expected}: {found}");
        }
        assert_eq!(read(&grey(&Metadata::default())).0.quality, Some(QUALITY));
    }

    #[test]
    fn what_is_written_is_read() {
        let mut icc = vec![7; 70_000];
        icc[16..20].copy_from_slice(b"GRAY");
        let metadata = Metadata {
            icc: Some(icc),
            xmp: Some(b"<x/>".to_vec()),
            density: Some(Density { x: 300.0, y: 240.0, unit: DensityUnit::Inch }),
            quality: Some(80),
            parts: vec![Part::Jpeg(COMMENT, b"hello".to_vec()), Part::Jpeg(APP13, b"Photoshop 3.0\0x".to_vec())],
            ..Metadata::default()
        };
        let file = grey(&metadata);
        let (found, frame) = read(&file);
        assert_eq!(found, metadata);
        assert_eq!(frame, Frame { components: 1, adobe: None });
        assert_eq!(image::load_from_memory(&file).unwrap().width(), 32);
    }

    #[test]
    fn metres_become_what_the_format_has() {
        let metre = |x: f64| pixel_density(Density { x, y: x, unit: DensityUnit::Metre });
        assert_eq!(metre(11_800.0), PixelDensity { density: (118, 118), unit: PixelDensityUnit::Centimeters });
        assert_eq!(metre(11_811.0), PixelDensity { density: (300, 300), unit: PixelDensityUnit::Inches });
    }

    #[test]
    fn unknown_segments_are_named() {
        let mut file = grey(&Metadata::default());
        file.splice(2..2, *b"\xff\xe2\0\x07MPF\0\x01");
        assert_eq!(read(&file).0.parts, [Part::Stale("segments APP2 MPF".into())]);
        for length in 0..file.len() {
            drop(read(&file[..length]));
        }
    }
}
