//! OpenEXR files as they are written: Y or R G B, and A, in floats or half floats.

use std::io::Cursor;

use exr::prelude::{AnyChannel, AnyChannels, FlatSamples, SmallVec, WritableImage, f16};

use crate::picture::{Image, Pixels};

/// The bytes of a file; errors are sentences.
pub(super) fn write(image: &Image, half: bool) -> Result<Vec<u8>, String> {
    let names: &[&str] = match image.channels {
        1 => &["Y"],
        2 => &["Y", "A"],
        3 => &["R", "G", "B"],
        _ => &["R", "G", "B", "A"],
    };
    let Pixels::F32(samples) = &image.pixels else { return Err("only floats are written to OpenEXR files".into()) };
    // What half floats cannot hold would become infinite.
    let half = half && samples.iter().all(|v| !v.is_finite() || v.abs() <= f32::from(f16::MAX));
    let plane = |k: usize| samples.iter().skip(k).step_by(names.len()).copied();
    let channel = |(k, name): (usize, &&str)| {
        let data = match half {
            true => FlatSamples::F16(plane(k).map(f16::from_f32).collect()),
            false => FlatSamples::F32(plane(k).collect()),
        };
        AnyChannel::new(*name, data)
    };
    let channels: SmallVec<[AnyChannel<FlatSamples>; 4]> = names.iter().enumerate().map(channel).collect();
    let size = (image.width as usize, image.height as usize);
    let mut file = Cursor::new(Vec::new());
    exr::image::Image::from_channels(size, AnyChannels::sort(channels))
        .write()
        .non_parallel()
        .to_buffered(&mut file)
        .map_err(|e| e.to_string())?;
    Ok(file.into_inner())
}
