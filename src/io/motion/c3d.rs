//! C3D: labelled markers in binary, with the parameters that describe them.
//!
//! Layout (C3D user guide, C3D.ORG): blocks of 512 bytes; block 1 is the header, then the
//! parameters, then the frames, each with all points (x, y, z and a fourth word) and all analog
//! samples. Numbers are those of Intel, DEC or MIPS machines; coordinates are 16-bit integers times
//! a scale, or floats where the scale is negative. A fourth word below zero marks a gap.

use std::collections::HashSet;
use std::path::Path;

use glam::DVec3;

use super::c3d_parameters::{Numbers, Parameters};
use super::{Clip, Motion, unit};
use crate::io::source::{self, Notes};
use crate::{Error, Result};

const BLOCK: usize = 512;
const REMEDY: &str = "Export the file again";

/// Reads the points of a C3D file.
///
/// Points that the parameters declare to be angles, forces, moments, powers or scalars are left
/// out: they are no positions. Gaps are points with a negative residual, with coordinates that are
/// not finite, or at exactly (0, 0, 0), which some programs write for missing points.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] for a file that is not C3D, is cut short (naming the frame), or
/// has no points.
pub fn read_c3d(path: impl AsRef<Path>) -> Result<Motion> {
    let path = path.as_ref();
    parse(&source::read_all(path)?, path)
}

/// Where the frames are and how they are stored.
struct Layout {
    numbers: Numbers,
    points: usize,
    frames: usize,
    /// Factor of integers; `None` for floats.
    scale: Option<f64>,
    /// First byte of the frames.
    start: usize,
    /// Bytes of a frame.
    stride: usize,
}

pub(super) fn parse(bytes: &[u8], path: &Path) -> Result<Motion> {
    let fail = |what: String, remedy: &str| Err(Error::format(path, None, what, remedy));
    if bytes.get(1) != Some(&0x50) {
        return fail("this is not a C3D file: its second byte is not 80".into(), "Name a C3D file");
    }
    if bytes.len() < BLOCK {
        return fail(format!("the header is cut after {} of {BLOCK} bytes", bytes.len()), REMEDY);
    }
    let mut notes = Notes::default();
    let parameters = Parameters::parse(bytes, path)?;
    let layout = Layout::new(bytes, &parameters, path, &mut notes)?;

    let mut names = parameters.series("LABELS");
    names.truncate(layout.points);
    names.resize(layout.points, String::new());
    let kept = positions_only(&names, &parameters, &mut notes);
    let mut clip = Clip::new(path, kept.iter().map(|&k| std::mem::take(&mut names[k])).collect(), notes)?;
    for f in 0..layout.frames {
        let frame = &bytes[layout.start + f * layout.stride..][..layout.stride];
        let points = kept.iter().map(|&k| layout.point(frame, k)).collect();
        clip.push(points, None)?;
    }
    let header_rate = f64::from(layout.numbers.f32(&bytes[20..24]));
    let rate = parameters.number("POINT", "RATE").filter(|r| *r > 0.0).unwrap_or(header_rate);
    let metres = parameters.series("UNITS").first().and_then(|u| unit(u));
    clip.finish(Some(rate), metres)
}

impl Layout {
    fn new(bytes: &[u8], parameters: &Parameters, path: &Path, notes: &mut Notes) -> Result<Self> {
        let numbers = parameters.numbers;
        let word = |k: usize| numbers.u16(&bytes[2 * k..2 * k + 2]);
        let fail = |what: String, remedy: &str| Err(Error::format(path, None, what, remedy));
        let used = parameters.number("POINT", "USED").map(|n| n as usize);
        let mut points = usize::from(word(1));
        if let Some(used) = used.filter(|&used| used != points) {
            notes.say(format!("the header counts {points} points, the parameters {used}; the parameters are believed"));
            points = used.min(usize::from(u16::MAX));
        }
        if points == 0 {
            return fail("there are no points, only other data".into(), "Export the marker trajectories");
        }
        let header_scale = f64::from(numbers.f32(&bytes[12..16]));
        let scale = parameters.number("POINT", "SCALE").filter(|s| *s != 0.0).unwrap_or(header_scale);
        if !scale.is_finite() || scale == 0.0 {
            return fail(format!("the scale of the coordinates is {scale}"), REMEDY);
        }
        let size = if scale < 0.0 { 4 } else { 2 };
        let stride = size * (4 * points + usize::from(word(2)));
        let block = match usize::from(word(8)) {
            0 => parameters.number("POINT", "DATA_START").unwrap_or(0.0) as usize,
            block => block,
        };
        if block < 2 || block > bytes.len() / BLOCK + 1 {
            return fail(format!("the frames should begin at block {block} of {}", bytes.len() / BLOCK), REMEDY);
        }
        let start = BLOCK * (block - 1);
        let frames = frame_count(usize::from(word(3)), usize::from(word(4)), parameters);
        let there = bytes.len().saturating_sub(start) / stride;
        if frames == 0 {
            return fail("there are no frames".into(), "Export the marker trajectories");
        }
        if there < frames {
            return fail(format!("the file ends in frame {there} of {frames}"), "Fetch or export the file again");
        }
        Ok(Self { numbers, points, frames, scale: (scale > 0.0).then_some(scale), start, stride })
    }

    /// Point `k` of a frame.
    fn point(&self, frame: &[u8], k: usize) -> Option<DVec3> {
        let (xyz, fourth) = match self.scale {
            None => {
                let words = &frame[16 * k..16 * k + 16];
                let [x, y, z, w] = [0, 4, 8, 12].map(|i| f64::from(self.numbers.f32(&words[i..i + 4])));
                (DVec3::new(x, y, z), w)
            }
            Some(scale) => {
                let words = &frame[8 * k..8 * k + 8];
                let [x, y, z, w] = [0, 2, 4, 6].map(|i| f64::from(self.numbers.u16(&words[i..i + 2]) as i16));
                (DVec3::new(x, y, z) * scale, w)
            }
        };
        (fourth >= 0.0 && xyz.is_finite() && xyz != DVec3::ZERO).then_some(xyz)
    }
}

/// The number of frames. The header holds 16 bits of the first and last frame; longer clips say so
/// in TRIAL.
fn frame_count(first: usize, last: usize, parameters: &Parameters) -> usize {
    let long = |name| {
        let [low, high] = parameters.numbers_of("TRIAL", name)[..] else { return None };
        Some((low as i64 & 0xffff) as usize + 65536 * (high as i64 & 0xffff) as usize)
    };
    let declared = (last + 1).saturating_sub(first);
    match (long("ACTUAL_START_FIELD"), long("ACTUAL_END_FIELD")) {
        // Only where the header could not hold it: these fields are stale in files that were cut by
        // other programs.
        (Some(start), Some(end)) if last == 0xffff || end > 0xffff => (end + 1).saturating_sub(start),
        _ => declared,
    }
}

/// The points that are not declared to be something else than positions.
fn positions_only(names: &[String], parameters: &Parameters, notes: &mut Notes) -> Vec<usize> {
    let kinds = ["ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS"];
    let others: HashSet<String> = kinds.iter().flat_map(|k| parameters.series(k)).filter(|n| !n.is_empty()).collect();
    let kept: Vec<usize> = (0..names.len()).filter(|&k| !others.contains(&names[k])).collect();
    let left_out = names.len() - kept.len();
    if left_out > 0 {
        notes.say(format!("{left_out} points are angles, forces, moments, powers or scalars and were left out"));
    }
    kept
}
