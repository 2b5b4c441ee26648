//! TIFF files. The crate `tiff` unpacks the samples; what they mean is told here: grey, palettes,
//! RGB, CMYK, YCbCr, transparency, integers and floats.

use std::io::Cursor;

use tiff::decoder::{Decoder, DecodingResult, Limits};

use super::cmyk;
use super::exif::density_of;
use super::ifd::{Block, Directory, Fields};
use super::metadata::{Metadata, Part, upright_xmp};
use super::{Decoded, Refused};
use crate::picture::{Image, Pixels};

const BITS: u16 = 258;
const COMPRESSION: u16 = 259;
const PHOTOMETRIC: u16 = 262;
const FILL_ORDER: u16 = 266;
const DESCRIPTION: u16 = 270;
const ORIENTATION: u16 = 274;
const SAMPLES: u16 = 277;
const PREDICTOR: u16 = 317;
const COLOR_MAP: u16 = 320;
const EXTRA: u16 = 338;
const SUBSAMPLING: u16 = 530;
const XMP: u16 = 700;
const PROFILE: u16 = 34675;
/// Old pictures, layers and thumbnails that Photoshop keeps.
const PHOTOSHOP: [u16; 2] = [34377, 37724];

const JPEG: u64 = 7;

/// What the numbers of a pixel are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Meaning {
    WhiteIsZero,
    BlackIsZero,
    Rgb,
    Palette,
    Cmyk,
    YCbCr,
}

impl Meaning {
    fn of_tag(value: Option<u64>) -> Result<Self, String> {
        match value {
            Some(0) => Ok(Self::WhiteIsZero),
            Some(1 | 4) => Ok(Self::BlackIsZero),
            Some(2) => Ok(Self::Rgb),
            Some(3) => Ok(Self::Palette),
            Some(5) => Ok(Self::Cmyk),
            Some(6) => Ok(Self::YCbCr),
            Some(8..=10) => Err("TIFF pictures in Lab colours are not read".into()),
            Some(32844 | 32845) => Err("TIFF pictures in LogLuv colours are not read".into()),
            Some(32803 | 34892) => Err("raw photos of cameras (DNG) are not read".into()),
            Some(other) => Err(format!("TIFF pictures of the photometric interpretation {other} are not read")),
            None => Err("the TIFF file does not say what its samples mean (no photometric interpretation)".into()),
        }
    }

    /// Samples of a colour.
    fn samples(self) -> usize {
        match self {
            Self::WhiteIsZero | Self::BlackIsZero | Self::Palette => 1,
            Self::Rgb | Self::YCbCr => 3,
            Self::Cmyk => 4,
        }
    }
}

/// Decodes a TIFF file that may take `most` bytes; errors are sentences.
pub(super) fn read(bytes: &[u8], most: u64) -> Result<Decoded, Refused> {
    let damaged = || "the picture cannot be read: the TIFF file is damaged".to_owned();
    let (block, first) = Block::open(bytes).ok_or_else(damaged)?;
    let fields = block.directory(first).ok_or_else(damaged)?;
    let meaning = Meaning::of_tag(block.first(&fields, PHOTOMETRIC))?;
    refuse(&block, &fields, meaning)?;
    let width = block.first(&fields, 256).unwrap_or(0);
    let height = block.first(&fields, 257).unwrap_or(0);
    let samples = block.first(&fields, SAMPLES).unwrap_or(1).clamp(1, 65_535);
    let bits = block.first(&fields, BITS).unwrap_or(1);
    let needed = width.saturating_mul(height).saturating_mul(samples).saturating_mul(bits.div_ceil(8).max(1));
    if needed > most {
        return Err(super::too_large(width, height, bytes.len()).into());
    }
    super::require(width, height, needed)?;
    let mut notes = Vec::new();
    let raw = unpack(bytes, &block, &fields, needed)?;
    let mut metadata = metadata(&block, first, &fields);
    let next = block.directory(fields.next).filter(|_| fields.next != 0);
    // Smaller copies of the same picture are no pages.
    if next.is_some_and(|n| block.first(&n, 254).unwrap_or(0) & 1 == 0) {
        notes.push("the file holds several pictures; the first one is read".into());
    }
    let numbers = |tag: u16| fields.list.iter().find(|f| f.tag == tag).map(|f| block.numbers(f));
    let file = File { meaning, extra: numbers(EXTRA), map: numbers(COLOR_MAP), size: [width as u32, height as u32] };
    let samples = Samples { count: samples as usize, bits: bits as u32, raw };
    let image = file.image(samples, metadata.icc.as_deref(), &mut notes)?;
    if meaning == Meaning::Cmyk {
        // It is for inks, which there are no longer.
        metadata.icc = None;
    }
    let orientation = block.first(&fields, ORIENTATION).map_or(1, |v| v.min(9) as u16);
    Ok(Decoded { image, metadata, orientation, notes })
}

/// Says in words what the crate cannot unpack, or would unpack wrongly.
fn refuse(block: &Block<'_>, fields: &Fields, meaning: Meaning) -> Result<(), String> {
    let compression = block.first(fields, COMPRESSION).unwrap_or(1);
    let name = match compression {
        2 => "CCITT run lengths",
        3 => "CCITT group 3 fax",
        6 => "the old kind of JPEG",
        34712 => "JPEG 2000",
        34925 => "LZMA",
        34887 => "LERC",
        50000 => "Zstandard",
        50001 => "WebP",
        50002 | 52546 => "JPEG XL",
        _ => "",
    };
    if !name.is_empty() {
        return Err(format!("TIFF pictures compressed with {name} are not read; LZW, Deflate and JPEG are"));
    }
    let all_bits = fields.list.iter().find(|f| f.tag == BITS).map(|f| block.numbers(f)).unwrap_or_default();
    let bits = all_bits.first().copied().unwrap_or(1);
    if all_bits.iter().any(|b| *b != bits) {
        return Err(format!("TIFF pictures with samples of different sizes ({all_bits:?} bits) are not read"));
    }
    if ![1, 2, 4, 8, 16, 32, 64].contains(&bits) {
        return Err(format!("TIFF pictures of {bits} bits a sample are not read; 1, 2, 4, 8, 16, 32 and 64 are"));
    }
    if bits < 8 && block.first(fields, PREDICTOR).unwrap_or(1) != 1 {
        return Err(format!("TIFF pictures of {bits} bits a sample with a predictor are not read"));
    }
    if bits < 8 && block.first(fields, FILL_ORDER) == Some(2) {
        return Err("TIFF pictures whose bits run from right to left (fill order 2) are not read".into());
    }
    let subsampling = fields.list.iter().find(|f| f.tag == SUBSAMPLING).map_or(vec![2, 2], |f| block.numbers(f));
    if meaning == Meaning::YCbCr && compression != JPEG && subsampling != [1, 1] {
        return Err(
            "TIFF pictures with subsampled YCbCr colours are read only where they are compressed with JPEG".into()
        );
    }
    Ok(())
}

/// All samples of all pixels, those of a pixel next to one another.
fn unpack(bytes: &[u8], block: &Block<'_>, fields: &Fields, needed: u64) -> Result<DecodingResult, String> {
    // The crate refuses palettes and grey with transparency by what the samples mean. As plain
    // bands all of them are unpacked.
    let mut plain = bytes.to_vec();
    if let Some(field) = fields.list.iter().find(|f| f.tag == PHOTOMETRIC) {
        let one = if block.little { 1u16.to_le_bytes() } else { 1u16.to_be_bytes() };
        if let Some(place) = plain.get_mut(field.at..field.at + 2) {
            place.copy_from_slice(&one);
        }
    }
    let failed = |e: tiff::TiffError| format!("the picture cannot be read: {e}");
    let mut limits = Limits::default();
    limits.decoding_buffer_size = needed as usize;
    limits.intermediate_buffer_size = (needed as usize).max(bytes.len());
    // Counted as the crate holds values, which takes more than they take in the file.
    limits.ifd_value_size = bytes.len().saturating_mul(32).max(1 << 20);
    let mut decoder = Decoder::new(Cursor::new(plain)).map_err(failed)?.with_limits(limits);
    let mut result = DecodingResult::U8(Vec::new());
    let layout = decoder.read_image_to_buffer(&mut result).map_err(failed)?;
    if result.as_buffer(0).byte_len() < layout.complete_len {
        return Err("the picture cannot be read: it needs more memory than its size tells".into());
    }
    Ok(match layout.planes {
        0 | 1 => result,
        planes => interleaved(result, planes, layout.plane_stride.map_or(0, usize::from))?,
    })
}

/// Planes one after another as pixels one after another.
fn interleaved(planar: DecodingResult, planes: usize, stride: usize) -> Result<DecodingResult, String> {
    fn mix<T: Copy>(v: &[T], planes: usize, stride: usize) -> Vec<T> {
        let size = stride / size_of::<T>();
        (0..size).flat_map(|k| (0..planes).map(move |p| v[p * size + k])).collect()
    }
    use DecodingResult as D;
    Ok(match planar {
        D::U8(v) => D::U8(mix(&v, planes, stride)),
        D::U16(v) => D::U16(mix(&v, planes, stride)),
        D::U32(v) => D::U32(mix(&v, planes, stride)),
        D::U64(v) => D::U64(mix(&v, planes, stride)),
        D::I8(v) => D::I8(mix(&v, planes, stride)),
        D::I16(v) => D::I16(mix(&v, planes, stride)),
        D::I32(v) => D::I32(mix(&v, planes, stride)),
        D::I64(v) => D::I64(mix(&v, planes, stride)),
        D::F16(v) => D::F16(mix(&v, planes, stride)),
        D::F32(v) => D::F32(mix(&v, planes, stride)),
        D::F64(v) => D::F64(mix(&v, planes, stride)),
    })
}

fn metadata(block: &Block<'_>, first: u64, fields: &Fields) -> Metadata {
    let data =
        |tag: u16| fields.list.iter().find(|f| f.tag == tag).map(|f| block.bytes[f.at..f.at + f.length].to_vec());
    // Some programs describe the numbers of their stack here, which other readers then miss.
    let stack = data(DESCRIPTION).is_some_and(|d| d.starts_with(b"{\"shape\":") || d.starts_with(b"ImageJ="));
    let photoshop = fields.list.iter().any(|f| PHOTOSHOP.contains(&f.tag));
    let tree: Directory = block.tree(first, &|tag| !(is_structure(tag) || stack && tag == DESCRIPTION));
    Metadata {
        icc: data(PROFILE),
        exif: (!tree.is_empty()).then(|| tree.to_block()),
        xmp: data(XMP).map(upright_xmp),
        density: density_of(block, fields),
        parts: photoshop.then(|| Part::Stale("layers and other data of Photoshop".into())).into_iter().collect(),
        ..Metadata::default()
    }
}

/// Whether a tag tells how the pixels are stored, or is kept in another way.
fn is_structure(tag: u16) -> bool {
    matches!(tag, 254..=259 | 262..=266 | 273 | 274 | 277..=284 | 290..=293 | 296 | 297 | 301 | 317 | 320..=347 | 512..=532 | XMP | PROFILE)
        || PHOTOSHOP.contains(&tag)
}

/// Samples as they are stored.
struct Samples {
    /// Of a pixel.
    count: usize,
    bits: u32,
    raw: DecodingResult,
}

/// What the file says of them.
struct File {
    meaning: Meaning,
    extra: Option<Vec<u64>>,
    map: Option<Vec<u64>>,
    size: [u32; 2],
}

impl File {
    fn image(&self, samples: Samples, icc: Option<&[u8]>, notes: &mut Vec<String>) -> Result<Image, String> {
        let Samples { count, bits, raw } = samples;
        let colors = self.meaning.samples();
        if count < colors {
            return Err(format!("the picture cannot be read: {count} samples a pixel where its colours need {colors}"));
        }
        let [width, height] = self.size;
        let total = width as usize * height as usize * count;
        let pixels = depth(raw, bits, width as usize * count, total, self.meaning == Meaning::Palette, notes)?;
        // Without a word on it one more sample is transparency, as everywhere.
        let alpha = match self.extra.as_deref() {
            None => count == colors + 1,
            Some([1 | 2, ..]) => count > colors,
            Some(_) => false,
        };
        let left = count - colors - usize::from(alpha);
        if left > 0 {
            notes.push(format!("{left} further channels of the file are not read"));
        }
        let kept = colors + usize::from(alpha);
        let pixels = match pixels {
            Pixels::U8(v) => Pixels::U8(leading(v, count, kept)),
            Pixels::U16(v) => Pixels::U16(leading(v, count, kept)),
            Pixels::F32(v) => Pixels::F32(leading(v, count, kept)),
        };
        let pixels = self.colors(pixels, kept, icc, notes)?;
        let channels = match self.meaning {
            Meaning::WhiteIsZero | Meaning::BlackIsZero => kept,
            _ => 3 + usize::from(alpha),
        };
        let mut image = Image::new(width, height, channels as u32, pixels).map_err(|e| e.to_string())?;
        if alpha && self.extra.as_ref().is_some_and(|e| e[0] == 1) {
            straighten(&mut image);
        }
        Ok(image)
    }

    /// Grey or RGB of `stride` samples a pixel, the last of which is transparency where there is
    /// one more than colours.
    fn colors(
        &self,
        pixels: Pixels,
        stride: usize,
        icc: Option<&[u8]>,
        notes: &mut Vec<String>,
    ) -> Result<Pixels, String> {
        let alpha = stride > self.meaning.samples();
        match (self.meaning, pixels) {
            (Meaning::WhiteIsZero, mut pixels) => {
                let color = |k: usize| !alpha || k.is_multiple_of(2);
                match &mut pixels {
                    Pixels::U8(v) => v.iter_mut().enumerate().filter(|p| color(p.0)).for_each(|(_, s)| *s = 255 - *s),
                    Pixels::U16(v) => {
                        v.iter_mut().enumerate().filter(|p| color(p.0)).for_each(|(_, s)| *s = 65535 - *s)
                    }
                    Pixels::F32(v) => v.iter_mut().enumerate().filter(|p| color(p.0)).for_each(|(_, s)| *s = 1.0 - *s),
                }
                Ok(pixels)
            }
            (Meaning::BlackIsZero | Meaning::Rgb, pixels) => Ok(pixels),
            (Meaning::Palette, Pixels::U8(v)) => self.palette(&v, stride, u8::MAX.into()),
            (Meaning::Palette, Pixels::U16(v)) => self.palette(&v, stride, u16::MAX.into()),
            (Meaning::Cmyk, Pixels::U8(v)) => {
                let (inks, alphas) = split(&v, stride, 4);
                let (colors, profiled) = cmyk::to_rgb8(&inks, icc);
                notes.push(cmyk::note(profiled));
                Ok(Pixels::U8(joined(&colors, alphas.as_deref())))
            }
            (Meaning::Cmyk, Pixels::U16(v)) => {
                let (inks, alphas) = split(&v, stride, 4);
                let (colors, profiled) = cmyk::to_rgb16(&inks, icc);
                notes.push(cmyk::note(profiled));
                Ok(Pixels::U16(joined(&colors, alphas.as_deref())))
            }
            (Meaning::YCbCr, Pixels::U8(mut v)) => {
                for pixel in v.chunks_exact_mut(stride) {
                    let rgb = cmyk::ycc_to_rgb([pixel[0], pixel[1], pixel[2]]);
                    pixel[..3].copy_from_slice(&rgb);
                }
                Ok(Pixels::U8(v))
            }
            (meaning, pixels) => {
                Err(format!("TIFF pictures of the kind {meaning:?} with {:?} samples are not read", pixels.depth()))
            }
        }
    }

    /// Colours of numbers in a map: all reds, all greens, all blues.
    fn palette<T: Copy + Into<u32>>(&self, samples: &[T], stride: usize, full: u32) -> Result<Pixels, String> {
        let map = self.map.as_deref().filter(|m| !m.is_empty() && m.len() % 3 == 0);
        let map = map.ok_or("the picture cannot be read: it has no colours for its palette")?;
        let size = map.len() / 3;
        let pixels = samples.chunks_exact(stride).map(|p| (p[0].into() as usize, p.get(1).map(|a| (*a).into())));
        if pixels.clone().any(|p| p.0 >= size) {
            return Err(format!("the picture cannot be read: it names colours beyond the {size} of its palette"));
        }
        // Entries have 16 bits. Most programs write bytes, as they are or times 256 or 257.
        let bytes = map.iter().all(|v| *v < 256);
        let shifted = map.iter().all(|v| v % 256 == 0) || map.iter().all(|v| v % 257 == 0);
        let color = |k: usize| [map[k], map[size + k], map[2 * size + k]];
        Ok(if bytes || shifted {
            let byte = |v: u64| if bytes { v as u8 } else { (v >> 8) as u8 };
            let alpha = |a: u32| (a * 255 / full) as u8;
            Pixels::U8(pixels.flat_map(|(k, a)| color(k).map(byte).into_iter().chain(a.map(alpha))).collect())
        } else {
            let alpha = |a: u32| (a * (65535 / full)) as u16;
            Pixels::U16(pixels.flat_map(|(k, a)| color(k).map(|v| v as u16).into_iter().chain(a.map(alpha))).collect())
        })
    }
}

/// Samples in one of the depths of pictures. Numbers that are no colours (32 bits, signs) become
/// floats of the same value.
fn depth(
    raw: DecodingResult,
    bits: u32,
    row: usize,
    total: usize,
    numbers: bool,
    notes: &mut Vec<String>,
) -> Result<Pixels, String> {
    /// The largest whole number that a float holds with all below.
    const EXACT: f64 = 16_777_216.0;
    let mut rounded = 0u64;
    let mut float = |v: f64, whole: bool| {
        rounded += u64::from(whole && v.abs() > EXACT && f64::from(v as f32) != v);
        v as f32
    };
    use DecodingResult as D;
    let pixels = match raw {
        D::U8(v) if bits < 8 => Pixels::U8(expanded(&v, bits, row, numbers)),
        D::U8(v) => Pixels::U8(v),
        D::U16(v) => Pixels::U16(v),
        D::F16(v) => Pixels::F32(v.iter().map(|v| v.to_f32()).collect()),
        D::F32(v) => Pixels::F32(v),
        D::F64(v) => Pixels::F32(v.iter().map(|v| float(*v, false)).collect()),
        D::U32(v) => Pixels::F32(v.iter().map(|v| float(f64::from(*v), true)).collect()),
        D::U64(v) => Pixels::F32(v.iter().map(|v| float(*v as f64, true)).collect()),
        D::I8(v) => Pixels::F32(v.iter().map(|v| f32::from(*v)).collect()),
        D::I16(v) => Pixels::F32(v.iter().map(|v| f32::from(*v)).collect()),
        D::I32(v) => Pixels::F32(v.iter().map(|v| float(f64::from(*v), true)).collect()),
        D::I64(v) => Pixels::F32(v.iter().map(|v| float(*v as f64, true)).collect()),
    };
    if rounded > 0 {
        notes.push(format!("{rounded} whole numbers beyond 16777216 are rounded to floats"));
    }
    if pixels.len() != total {
        return Err(format!("the picture cannot be read: {} samples where its size needs {total}", pixels.len()));
    }
    Ok(pixels)
}

/// Samples of less than 8 bits, each row beginning with a byte; scaled to 8 unless they are
/// numbers.
fn expanded(bytes: &[u8], bits: u32, row: usize, numbers: bool) -> Vec<u8> {
    let stride = (row * bits as usize).div_ceil(8);
    let full = (1u32 << bits) - 1;
    let scale = if numbers { 1 } else { 255 / full };
    let sample = |line: &[u8], k: usize| {
        let at = k * bits as usize;
        let shift = 8 - bits - (at % 8) as u32;
        ((u32::from(line[at / 8]) >> shift & full) * scale) as u8
    };
    bytes.chunks_exact(stride.max(1)).flat_map(|line| (0..row).map(move |k| sample(line, k))).collect()
}

/// The first `kept` of every `count` samples.
fn leading<T: Copy>(samples: Vec<T>, count: usize, kept: usize) -> Vec<T> {
    if kept == count { samples } else { samples.chunks_exact(count).flat_map(|p| &p[..kept]).copied().collect() }
}

/// The first `colors` of every `stride` samples, and the one behind them.
fn split<T: Copy>(samples: &[T], stride: usize, colors: usize) -> (Vec<T>, Option<Vec<T>>) {
    let first = samples.chunks_exact(stride).flat_map(|p| &p[..colors]).copied().collect();
    (first, (stride > colors).then(|| samples.chunks_exact(stride).map(|p| p[colors]).collect()))
}

/// Colours with their transparency behind them.
fn joined<T: Copy>(colors: &[T], alphas: Option<&[T]>) -> Vec<T> {
    match alphas {
        None => colors.to_vec(),
        Some(alphas) => colors.chunks_exact(3).zip(alphas).flat_map(|(c, a)| [c[0], c[1], c[2], *a]).collect(),
    }
}

/// Divides colours by the transparency that they were multiplied with.
fn straighten(image: &mut Image) {
    let channels = image.channels as usize;
    let divided =
        |color: f64, alpha: f64, full: f64| if alpha > 0.0 { (color * full / alpha).round().min(full) } else { 0.0 };
    match &mut image.pixels {
        Pixels::U8(v) => v.chunks_exact_mut(channels).for_each(|p| {
            let alpha = f64::from(p[channels - 1]);
            p[..channels - 1].iter_mut().for_each(|c| *c = divided(f64::from(*c), alpha, 255.0) as u8);
        }),
        Pixels::U16(v) => v.chunks_exact_mut(channels).for_each(|p| {
            let alpha = f64::from(p[channels - 1]);
            p[..channels - 1].iter_mut().for_each(|c| *c = divided(f64::from(*c), alpha, 65535.0) as u16);
        }),
        Pixels::F32(v) => v.chunks_exact_mut(channels).for_each(|p| {
            let alpha = p[channels - 1];
            p[..channels - 1].iter_mut().for_each(|c| *c = if alpha > 0.0 { *c / alpha } else { 0.0 });
        }),
    }
}

#[cfg(test)]
#[path = "tiff_tests.rs"]
mod tests;
