//! OpenEXR files: the channels of one layer, chosen by their names.
//!
//! The picture is the display window; where there are no data in it, it is 0.

use std::io::Cursor;

use exr::block::reader::ChunksReader;
use exr::block::{BlockIndex, UncompressedBlock};
use exr::math::Vec2;
use exr::meta::attribute::SampleType;
use exr::meta::header::Header;

use super::exr_channels::{self, Channel, Form};
use super::metadata::Metadata;
use super::{Decoded, Refused};
use crate::picture::{Image, Pixels};

/// The largest whole number that a float holds with all below.
const EXACT: u32 = 1 << 24;

/// Decodes the layer or channel of this name, or what the file shows, from a file that may take
/// `most` bytes; errors are sentences.
pub(super) fn read(bytes: &[u8], wanted: Option<&str>, name: &str, most: u64) -> Result<Decoded, Refused> {
    let failed = |e: exr::error::Error| format!("the picture cannot be read: {e}");
    let reader = exr::block::read(Cursor::new(bytes), false).map_err(failed)?;
    let headers = reader.headers().to_vec();
    let all = channels(&headers)?;
    let chosen = exr_channels::choose(&all, wanted, name)?;
    let header = &headers[chosen.channels[0].part];
    let window = header.shared_attributes.display_window;
    let [width, height] = [window.size.width(), window.size.height()];
    let count = chosen.channels.len() as u64;
    let area = (width as u64).saturating_mul(height as u64).max(header.layer_size.area() as u64);
    let needed = area.saturating_mul(4 * count.max(3));
    if needed > most {
        return Err(super::too_large(width as u64, height as u64, bytes.len()).into());
    }
    super::require(width as u64, height as u64, needed)?;
    if let Some(c) = header.channels.list.iter().find(|c| c.sampling != Vec2(1, 1)) {
        return Err(format!(
            "channel {} has fewer samples than pixels (chroma subsampling), which is not read; save the picture as RGB",
            c.name
        )
        .into());
    }
    let mut notes = chosen.notes;
    let mut planes = Planes::new(header, &chosen.channels, [width, height]);
    let part = chosen.channels[0].part;
    let full = |index: BlockIndex| index.layer == part && index.level == Vec2(0, 0);
    reader
        .filter_chunks(false, |_, _, index| full(index))
        .map_err(failed)?
        .decompress_sequential(false, |_, block| {
            planes.take(header, &block);
            Ok(())
        })
        .map_err(failed)?;
    if planes.outside > 0 {
        notes.push(format!("{} pixels outside the display window are left out", planes.outside));
    }
    if planes.rounded > 0 {
        notes.push(format!("{} whole numbers beyond {EXACT} are rounded to floats", planes.rounded));
    }
    let half = chosen.channels.iter().all(|c| header.channels.list[c.index].sample_type == SampleType::F16);
    let metadata = Metadata { half, ..Metadata::default() };
    let image = image(planes.samples, chosen.form, [width as u32, height as u32], header)?;
    Ok(Decoded { image, metadata, orientation: 1, notes })
}

/// All channels of the file.
fn channels(headers: &[Header]) -> Result<Vec<Channel>, String> {
    if headers.iter().all(|h| h.deep) {
        return Err("OpenEXR files of deep data (several samples a pixel) are not read; flatten the picture".into());
    }
    let mut all = Vec::new();
    for (part, header) in headers.iter().enumerate().filter(|(_, h)| !h.deep) {
        let layer = header.own_attributes.layer_name.as_ref().map(ToString::to_string).filter(|_| headers.len() > 1);
        for (index, channel) in header.channels.list.iter().enumerate() {
            let name = channel.name.to_string();
            let name = match &layer {
                Some(layer) if !name.starts_with(&format!("{layer}.")) => format!("{layer}.{name}"),
                _ => name,
            };
            all.push(Channel { name, part, index });
        }
    }
    Ok(all)
}

/// Samples of the chosen channels in the display window.
struct Planes {
    samples: Vec<Vec<f32>>,
    /// Place in `samples` of each channel of the part.
    place: Vec<Option<usize>>,
    size: [usize; 2],
    /// Where the data begin in the display window.
    offset: [i64; 2],
    outside: u64,
    rounded: u64,
}

impl Planes {
    fn new(header: &Header, channels: &[Channel], size: [usize; 2]) -> Self {
        let mut place = vec![None; header.channels.list.len()];
        channels.iter().enumerate().for_each(|(k, c)| place[c.index] = Some(k));
        let (data, shown) = (header.own_attributes.layer_position, header.shared_attributes.display_window.position);
        let offset = [0, 1].map(|k| [data.x() - shown.x(), data.y() - shown.y()][k]).map(i64::from);
        let samples = vec![vec![0.0; size[0] * size[1]]; channels.len()];
        Self { samples, place, size, offset, outside: 0, rounded: 0 }
    }

    fn take(&mut self, header: &Header, block: &UncompressedBlock) {
        for line in block.lines(&header.channels) {
            let index = line.location;
            let Some(plane) = self.place[index.channel] else { continue };
            let x = self.offset[0] + index.position.x() as i64;
            let y = self.offset[1] + index.position.y() as i64;
            let inside = (0..self.size[1] as i64).contains(&y);
            let size = match header.channels.list[index.channel].sample_type {
                SampleType::F16 => 2,
                SampleType::F32 | SampleType::U32 => 4,
            };
            for (k, bytes) in line.value.chunks_exact(size).enumerate() {
                let column = x + k as i64;
                if !(inside && (0..self.size[0] as i64).contains(&column)) {
                    self.outside += u64::from(plane == 0);
                    continue;
                }
                let value = match (header.channels.list[index.channel].sample_type, bytes) {
                    (SampleType::F16, &[a, b]) => exr::prelude::f16::from_ne_bytes([a, b]).to_f32(),
                    (SampleType::F32, &[a, b, c, d]) => f32::from_ne_bytes([a, b, c, d]),
                    (SampleType::U32, &[a, b, c, d]) => {
                        let whole = u32::from_ne_bytes([a, b, c, d]);
                        self.rounded += u64::from(whole > EXACT && f64::from(whole as f32) != f64::from(whole));
                        whole as f32
                    }
                    _ => 0.0,
                };
                self.samples[plane][y as usize * self.size[0] + column as usize] = value;
            }
        }
    }
}

/// The picture of the planes.
fn image(mut planes: Vec<Vec<f32>>, form: Form, [width, height]: [u32; 2], header: &Header) -> Result<Image, String> {
    if let Form::Chroma = form {
        from_chroma(&mut planes, header);
    }
    if let Form::Pair = form {
        planes.push(vec![0.0; planes[0].len()]);
    }
    let channels = planes.len();
    let mut samples = Vec::with_capacity(channels * planes[0].len());
    for k in 0..planes[0].len() {
        samples.extend(planes.iter().map(|p| p[k]));
    }
    Image::new(width, height, channels as u32, Pixels::F32(samples)).map_err(|e| e.to_string())
}

/// Luminance and the relative differences of red and blue to it become red, green and blue.
fn from_chroma(planes: &mut [Vec<f32>], header: &Header) {
    let [wr, wg, wb] = weights(header);
    for k in 0..planes[0].len() {
        let [y, ry, by] = [planes[0][k], planes[1][k], planes[2][k]];
        let (r, b) = ((ry + 1.0) * y, (by + 1.0) * y);
        let g = (y - r * wr - b * wb) / wg;
        (planes[0][k], planes[1][k], planes[2][k]) = (r, g, b);
    }
}

/// Luminance of red, green and blue: those of the file's primaries, else of Rec. 709.
fn weights(header: &Header) -> [f32; 3] {
    const REC_709: [f64; 8] = [0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329];
    let primaries = header.shared_attributes.chromaticities.map_or(REC_709, |c| {
        [c.red.x(), c.red.y(), c.green.x(), c.green.y(), c.blue.x(), c.blue.y(), c.white.x(), c.white.y()]
            .map(f64::from)
    });
    let xyz = |x: f64, y: f64| glam::DVec3::new(x / y, 1.0, (1.0 - x - y) / y);
    let [rx, ry, gx, gy, bx, by, wx, wy] = primaries;
    // Amounts of the primaries that give white of luminance 1 are their luminances.
    let amounts = glam::DMat3::from_cols(xyz(rx, ry), xyz(gx, gy), xyz(bx, by)).inverse() * xyz(wx, wy);
    if amounts.is_finite() { amounts.as_vec3().to_array() } else { [0.2126, 0.7152, 0.0722] }
}

#[cfg(test)]
#[path = "exr_tests.rs"]
mod tests;
