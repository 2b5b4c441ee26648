//! Motion capture: trajectories of markers (C3D, TRC, CSV) and moving skeletons (BVH, ASF with
//! AMC).
//!
//! All readers give one type, [`Motion`]: a position or a gap for each point in each frame, in the
//! file's units and axes. The points of a skeleton are its joints and the ends of its limbs, found
//! by forward kinematics; the rotations of the bones are kept beside them, so that points fixed to
//! a bone ([`Motion::attach`]) tell of rotations about the bone itself, which joints do not show.
//!
//! No header makes a reader allocate more than the file can fill, and [`MAX_POSITIONS`] bounds what
//! short rows or joints without channels can stand for.

mod acclaim;
mod acclaim_skeleton;
mod bvh;
mod c3d;
mod c3d_parameters;
mod csv;
mod optitrack;
mod skeleton;
mod trc;

use std::collections::HashSet;
use std::io::Read;
use std::path::{Path, PathBuf};

use glam::DVec3;

use super::source::{self, Notes};
use crate::{Error, Result};

#[doc(hidden)]
pub use acclaim::read_acclaim;
#[doc(hidden)]
pub use bvh::read_bvh;
#[doc(hidden)]
pub use c3d::read_c3d;
#[doc(hidden)]
pub use csv::read_csv;
#[doc(hidden)]
pub use skeleton::{Segment, Skeleton};
#[doc(hidden)]
pub use trc::read_trc;

/// Largest number of positions (frames times points) of a clip, about 1 GiB of memory: 75 points at
/// 120 frames a second for an hour.
#[doc(hidden)]
pub const MAX_POSITIONS: usize = 1 << 25;

/// Coordinates beyond this are not measurements.
const MAX_COORDINATE: f64 = 1e9;

/// Frames per second where the file does not say.
const ASSUMED_RATE: f64 = 30.0;

/// Trajectories of named points.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// The file, named in messages.
    pub path: PathBuf,
    /// Names of the points (markers or joints), distinct and not empty.
    pub names: Vec<String>,
    /// Frames per second, positive and finite.
    pub rate: f64,
    /// One entry a frame, each with one position a point; `None` is a gap. At least one frame.
    pub frames: Vec<Vec<Option<DVec3>>>,
    /// Metres per unit of length, where the file says so.
    pub metres_per_unit: Option<f64>,
    /// What moves the points, if they are the joints of a skeleton.
    pub skeleton: Option<Skeleton>,
    /// What was passed over or assumed; one sentence each.
    pub warnings: Vec<String>,
}

/// Reads a motion by its content or extension: `.c3d`, `.trc`, `.csv` (also `.tsv`, `.txt`),
/// `.bvh`, `.amc`.
///
/// An AMC file holds no bones. Its skeleton is named as `SKELETON.asf,CLIP.amc`, or found beside
/// it: an ASF file of the same name, of the name up to its last underscore (`11.asf` for
/// `11_01.amc`), or the only one in the folder.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] with line, frame or marker and the remedy.
pub fn read_motion(path_or_pair: impl AsRef<Path>) -> Result<Motion> {
    let path = path_or_pair.as_ref();
    if let Some((skeleton, clip)) = acclaim::split_pair(path) {
        return read_acclaim(&skeleton, &clip);
    }
    let mut head = Vec::new();
    let read = source::open(path)?.take(64).read_to_end(&mut head);
    read.map_err(|e| Error::io(path, e, "Check that the file may be read"))?;
    let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    let text = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&head).trim_ascii_start();
    if text.starts_with(b"HIERARCHY") {
        return read_bvh(path);
    }
    if text.starts_with(b"PathFileType") {
        return read_trc(path);
    }
    match extension.as_str() {
        "c3d" => read_c3d(path),
        "trc" => read_trc(path),
        "bvh" => read_bvh(path),
        "amc" => read_acclaim(&acclaim::skeleton_beside(path)?, path),
        "csv" | "tsv" | "txt" => read_csv(path),
        "asf" => {
            let what = "this is a skeleton without motion";
            Err(Error::format(path, None, what, "Name its clip as SKELETON.asf,CLIP.amc"))
        }
        // The second byte of every C3D file.
        _ if head.get(1) == Some(&0x50) => read_c3d(path),
        _ => {
            let what = if head.is_empty() { "the file is empty" } else { "this is not a motion of a known kind" };
            Err(Error::format(path, None, what, "Convert it to C3D, TRC, CSV, BVH or ASF with AMC"))
        }
    }
}

impl Motion {
    /// Number of points.
    pub fn point_count(&self) -> usize {
        self.names.len()
    }

    /// Length in seconds: frames over rate.
    pub fn seconds(&self) -> f64 {
        self.frames.len() as f64 / self.rate
    }

    /// The point called `name`: as written, else the only one that agrees without regard to case
    /// and to the subject before the last colon (`LKNE` finds `Anna:LKNE`).
    ///
    /// # Errors
    /// [`Error::Input`] if there is none or more than one, with the names there are.
    pub fn index_of(&self, name: &str) -> Result<usize> {
        if let Some(found) = self.names.iter().position(|n| n == name) {
            return Ok(found);
        }
        let mut matching = (0..self.names.len()).filter(|&k| bare(&self.names[k]) == bare(name));
        let file = self.path.display();
        match (matching.next(), matching.next()) {
            (Some(found), None) => Ok(found),
            (None, _) => {
                let mut known: Vec<&str> = self.names.iter().take(40).map(String::as_str).collect();
                if self.names.len() > known.len() {
                    known.push("...");
                }
                let what = format!("{file}: there is no marker or joint {:?}", shortened(name));
                Err(Error::input(what, format!("Use one of: {}", known.join(", "))))
            }
            (Some(a), Some(b)) => {
                let what = format!("{file}: {:?} may be {:?} or {:?}", shortened(name), self.names[a], self.names[b]);
                Err(Error::input(what, "Write the whole name"))
            }
        }
    }

    /// The part of the clip from frame `first` up to, without, frame `end`, taking every `step`-th
    /// frame; the rate follows.
    ///
    /// # Errors
    /// [`Error::Option`] if no frame is left.
    pub fn part(&self, first: usize, end: usize, step: usize) -> Result<Self> {
        let end = end.min(self.frames.len());
        if first >= end || step == 0 {
            let what = format!("frames {first} to {end} by {step} of {}", self.frames.len());
            return Err(Error::option("frames", what, "Choose at least one frame, counted from 0"));
        }
        let pick = || (first..end).step_by(step);
        let mut part = Self { frames: Vec::new(), skeleton: None, ..self.clone_head() };
        part.frames = pick().map(|f| self.frames[f].clone()).collect();
        part.skeleton = self.skeleton.as_ref().map(|s| s.part(pick()));
        part.rate = self.rate / step as f64;
        Ok(part)
    }

    /// All but the trajectories.
    fn clone_head(&self) -> Self {
        Self {
            path: self.path.clone(),
            names: self.names.clone(),
            rate: self.rate,
            frames: Vec::new(),
            metres_per_unit: self.metres_per_unit,
            skeleton: None,
            warnings: self.warnings.clone(),
        }
    }
}

/// A name as it is compared: without the subject before the last colon, in lower case.
fn bare(name: &str) -> String {
    name.rsplit(':').next().unwrap_or(name).trim().to_lowercase()
}

/// A name cut to a length that suits a message.
fn shortened(name: &str) -> String {
    name.chars().take(40).collect()
}

/// A clip of markers as it is read, row by row.
struct Clip<'a> {
    path: &'a Path,
    names: Vec<String>,
    frames: Vec<Vec<Option<DVec3>>>,
    notes: Notes,
}

impl<'a> Clip<'a> {
    /// Makes `names` distinct and not empty.
    fn new(path: &'a Path, names: Vec<String>, mut notes: Notes) -> Result<Self> {
        if names.is_empty() {
            return Err(Error::format(path, None, "there are no markers", "Export the trajectories with the file"));
        }
        Ok(Self { path, names: distinct(names, &mut notes), frames: Vec::new(), notes })
    }

    /// Appends a frame; what is missing at its end are gaps, and so are coordinates that are no
    /// measurement.
    fn push(&mut self, mut frame: Vec<Option<DVec3>>, line: Option<usize>) -> Result<()> {
        frame.resize(self.names.len(), None);
        for p in &mut frame {
            if p.is_some_and(|p| !(p.abs().max_element() <= MAX_COORDINATE)) {
                *p = None;
                self.notes.count("coordinates that are no measurement, taken as gaps", line);
            }
        }
        check_size(self.path, self.frames.len() + 1, self.names.len())?;
        self.frames.push(frame);
        Ok(())
    }

    /// The finished motion. `rate` is what the file says.
    fn finish(mut self, rate: Option<f64>, metres_per_unit: Option<f64>) -> Result<Motion> {
        if self.frames.is_empty() {
            return Err(Error::format(self.path, None, "there are no frames", "Export the trajectories with the file"));
        }
        let rate = known_rate(rate, &mut self.notes);
        Ok(Motion {
            path: self.path.to_path_buf(),
            names: self.names,
            rate,
            frames: self.frames,
            metres_per_unit,
            skeleton: None,
            warnings: self.notes.into_warnings(),
        })
    }
}

/// Names that are distinct and not empty.
fn distinct(names: Vec<String>, notes: &mut Notes) -> Vec<String> {
    let mut taken = HashSet::new();
    let mut named = |(k, name): (usize, String)| {
        let mut name = if name.trim().is_empty() { format!("point {k}") } else { name.trim().to_owned() };
        if taken.contains(&name) {
            let what =
                format!("the name {:?} is there more than once; later ones carry their number", shortened(&name));
            notes.say(what);
            while taken.contains(&name) {
                name = format!("{name} ({k})");
            }
        }
        taken.insert(name.clone());
        name
    };
    names.into_iter().enumerate().map(&mut named).collect()
}

/// The rate if it is one, else what is assumed.
fn known_rate(rate: Option<f64>, notes: &mut Notes) -> f64 {
    match rate {
        Some(rate) if (1e-3..=1e6).contains(&rate) => rate,
        _ => {
            notes.say(format!("the file gives no usable rate; {ASSUMED_RATE} frames a second are assumed"));
            ASSUMED_RATE
        }
    }
}

/// Refuses clips beyond [`MAX_POSITIONS`].
fn check_size(path: &Path, frames: usize, points: usize) -> Result<()> {
    if frames.saturating_mul(points) > MAX_POSITIONS {
        let what = format!("{frames} or more frames of {points} points are more than {MAX_POSITIONS} positions");
        return Err(Error::format(path, None, what, "Cut the clip into parts, or export fewer points"));
    }
    Ok(())
}

/// Metres per unit of length by its usual names.
fn unit(text: &str) -> Option<f64> {
    Some(match text.trim().to_ascii_lowercase().as_str() {
        "m" | "meter" | "meters" | "metre" | "metres" => 1.0,
        "dm" => 0.1,
        "cm" | "centimeters" | "centimetres" => 0.01,
        "mm" | "millimeters" | "millimetres" | "millimeter" => 0.001,
        "in" | "inch" | "inches" => 0.0254,
        "ft" | "feet" | "foot" => 0.3048,
        _ => return None,
    })
}

#[cfg(test)]
mod dialect_tests;
#[cfg(test)]
mod fuzz;
#[cfg(test)]
pub(super) mod tests;
