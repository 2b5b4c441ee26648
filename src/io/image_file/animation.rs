//! Pictures one after the other in one file: GIF, and PNG with the chunks of animations (APNG).

use std::path::Path;

use image::codecs::gif::{GifEncoder, Repeat};
use image::{Delay, Frame, RgbaImage};

use super::{Metadata, encode, format::Format};
use crate::io::output;
use crate::picture::{Depth, Image, Pixels};
use crate::{Error, Result};

/// The formats of animations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AnimationFormat {
    /// 256 colours a frame.
    Gif,
    /// As PNG.
    Apng,
}

impl AnimationFormat {
    /// The format that the name of a file says, if it is one of these.
    pub fn of_name(path: &Path) -> Option<Self> {
        match path.extension()?.to_string_lossy().to_ascii_lowercase().as_str() {
            "gif" => Some(Self::Gif),
            "apng" => Some(Self::Apng),
            _ => None,
        }
    }
}

/// Writes `frames`, `rate` of them a second, over and over, whole or not at all. Returns sentences
/// on what the format has no place for.
///
/// # Errors
/// [`Error::Io`]; [`Error::Input`] for no frames, or frames of several sizes; [`Error::Option`] for
/// a rate that the format cannot hold.
pub fn write_animation(
    path: impl AsRef<Path>,
    format: AnimationFormat,
    frames: &[Image],
    metadata: &Metadata,
    rate: f64,
) -> Result<Vec<String>> {
    let path = path.as_ref();
    let size = |i: &Image| (i.width, i.height, i.channels);
    if frames.is_empty() || frames.iter().any(|f| size(f) != size(&frames[0])) {
        return Err(Error::input("an animation has frames of one size, and one at least", "Give other frames"));
    }
    if !(0.1..=100.0).contains(&rate) {
        return Err(Error::option("rate", format!("{rate} frames a second"), "Give 0.1 to 100"));
    }
    let (bytes, notes) = match format {
        AnimationFormat::Gif => gif(path, frames, rate)?,
        AnimationFormat::Apng => apng(path, frames, metadata, rate)?,
    };
    output::write_bytes(path, &bytes)?;
    Ok(notes)
}

fn gif(path: &Path, frames: &[Image], rate: f64) -> Result<(Vec<u8>, Vec<String>)> {
    let failed = |what: String| {
        Error::format(path, None, format!("the animation cannot be encoded: {what}"), "Write it as .apng")
    };
    if frames[0].width > u32::from(u16::MAX) || frames[0].height > u32::from(u16::MAX) {
        return Err(failed("its sides have more than 65535 pixels".into()));
    }
    let mut bytes = Vec::new();
    {
        let mut encoder = GifEncoder::new_with_speed(&mut bytes, 10);
        encoder.set_repeat(Repeat::Infinite).map_err(|e| failed(e.to_string()))?;
        for frame in frames {
            let Pixels::U8(samples) = frame.converted(4, Depth::U8)?.pixels else { continue };
            let Some(picture) = RgbaImage::from_raw(frame.width, frame.height, samples) else { continue };
            let delay = Delay::from_numer_denom_ms((100_000.0 / rate).round() as u32, 100);
            encoder.encode_frame(Frame::from_parts(picture, 0, 0, delay)).map_err(|e| failed(e.to_string()))?;
        }
    }
    Ok((bytes, vec!["GIF has 256 colours a frame; .apng keeps all".into()]))
}

/// Hundredths of frames a second in the chunks.
const DENOMINATOR: f64 = 100.0;

/// The chunks of PNG files in one: those before the pixels are the first frame's.
fn apng(path: &Path, frames: &[Image], metadata: &Metadata, rate: f64) -> Result<(Vec<u8>, Vec<String>)> {
    let mut bytes = b"\x89PNG\r\n\x1a\n".to_vec();
    let (mut sequence, mut notes) = (0u32, Vec::new());
    let control = |frame: &Image, bytes: &mut Vec<u8>, sequence: &mut u32| {
        let mut content = Vec::with_capacity(26);
        for number in [*sequence, frame.width, frame.height, 0, 0] {
            content.extend(number.to_be_bytes());
        }
        // Seconds as a fraction; the frame replaces what was there.
        content.extend((DENOMINATOR as u16).to_be_bytes());
        content.extend(((rate * DENOMINATOR).round() as u16).to_be_bytes());
        content.extend([0, 0]);
        chunk(bytes, *b"fcTL", &content);
        *sequence += 1;
    };
    for (k, frame) in frames.iter().enumerate() {
        let (png, told) = encode(frame, metadata, Format::Png, path)?;
        if k == 0 {
            notes = told;
        }
        let mut begun = false;
        for (name, content) in super::png::chunks(&png) {
            let pixels = name == *b"IDAT";
            if pixels && !begun {
                if k == 0 {
                    let count = u32::try_from(frames.len()).unwrap_or(u32::MAX);
                    chunk(&mut bytes, *b"acTL", &[count.to_be_bytes(), [0; 4]].concat());
                }
                control(frame, &mut bytes, &mut sequence);
                begun = true;
            }
            match (k, pixels) {
                (0, _) if name != *b"IEND" => chunk(&mut bytes, name, content),
                (1.., true) => {
                    chunk(&mut bytes, *b"fdAT", &[&sequence.to_be_bytes(), content].concat());
                    sequence += 1;
                }
                _ => {}
            }
        }
    }
    chunk(&mut bytes, *b"IEND", &[]);
    Ok((bytes, notes))
}

/// Appends a chunk: length, name, content, checksum.
fn chunk(bytes: &mut Vec<u8>, name: [u8; 4], content: &[u8]) {
    bytes.extend((content.len() as u32).to_be_bytes());
    let begin = bytes.len();
    bytes.extend(name);
    bytes.extend(content);
    let sum = checksum(&bytes[begin..]);
    bytes.extend(sum.to_be_bytes());
}

/// The cyclic redundancy check of PNG (ISO 3309).
fn checksum(bytes: &[u8]) -> u32 {
    let step = |sum: u32, byte: &u8| {
        (0..8).fold(sum ^ u32::from(*byte), |sum, _| if sum & 1 == 1 { 0xedb8_8320 ^ (sum >> 1) } else { sum >> 1 })
    };
    !bytes.iter().fold(u32::MAX, step)
}

#[cfg(test)]
mod tests {
    use image::AnimationDecoder;
    use image::codecs::gif::GifDecoder;

    use super::*;

    fn frames() -> Vec<Image> {
        let frame = |k: u8| {
            let samples = (0..6 * 4 * 3).map(|i| (i as u8).wrapping_mul(3).wrapping_add(60 * k)).collect();
            Image::new(6, 4, 3, Pixels::U8(samples)).unwrap()
        };
        (0..3).map(frame).collect()
    }

    #[test]
    fn checksums_are_those_of_the_standard() {
        assert_eq!((checksum(b"IEND"), checksum(b"123456789")), (0xae42_6082, 0xcbf4_3926));
    }

    #[test]
    fn animations_read_back_frame_by_frame() {
        let dir = tempfile::tempdir().unwrap();
        let place = |name: &str| dir.path().join(name);
        write_animation(place("a.apng"), AnimationFormat::Apng, &frames(), &Metadata::default(), 25.0).unwrap();
        let bytes = std::fs::read(place("a.apng")).unwrap();
        let decoder = image::codecs::png::PngDecoder::new(std::io::Cursor::new(&bytes)).unwrap();
        let read: Vec<Frame> = decoder.apng().unwrap().into_frames().collect_frames().unwrap();
        assert_eq!(read.len(), 3);
        for (read, frame) in read.iter().zip(frames()) {
            let Pixels::U8(expected) = frame.converted(4, Depth::U8).unwrap().pixels else { panic!("8 bits") };
            let (milliseconds, over) = read.delay().numer_denom_ms();
            assert_eq!((read.buffer().as_raw(), milliseconds), (&expected, 40 * over));
        }
        // What reads single pictures sees the first.
        assert_eq!(super::super::read_image(place("a.apng")).unwrap(), frames()[0]);

        write_animation(place("a.gif"), AnimationFormat::Gif, &frames(), &Metadata::default(), 10.0).unwrap();
        let bytes = std::fs::read(place("a.gif")).unwrap();
        let read = GifDecoder::new(std::io::Cursor::new(&bytes)).unwrap().into_frames().collect_frames().unwrap();
        assert_eq!((read.len(), read[1].delay().numer_denom_ms()), (3, (100, 1)));
        let mixed = [frames()[0].clone(), Image::zeros(5, 4, 3, Depth::U8).unwrap()];
        for (frames, rate) in [(&mixed[..], 25.0), (&[], 25.0), (&frames()[..], f64::NAN)] {
            assert!(write_animation(place("b.gif"), AnimationFormat::Gif, frames, &Metadata::default(), rate).is_err());
        }
        assert!(!place("b.gif").exists());
    }
}
