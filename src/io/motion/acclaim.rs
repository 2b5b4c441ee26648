//! AMC: the motion of a skeleton of an ASF file (Acclaim).
//!
//! With column vectors, a bone with axes `C`, rotation `R` by its degrees of freedom and parent
//! rotation `P` turns by `M = P C R C^-1`, and ends at `p = p_parent + M reach` (Schafer, Acclaim
//! Skeleton File Definition V1.10, 1994).

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use glam::{DQuat, DVec3};

use super::acclaim_skeleton::{self, Bone, Freedom};
use super::skeleton::{Segment, Skeleton};
use super::{MAX_COORDINATE, Motion, check_size, known_rate, shortened};
use crate::io::encoding;
use crate::io::source::Notes;
use crate::{Error, Result};

/// Reads the clip of an AMC file with the skeleton of an ASF file; the points are the root and the
/// end of each bone, by its name.
///
/// AMC files tell no rate: Carnegie Mellon's are 120 frames a second, which is assumed, with a
/// warning.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] naming the line: bones that do not hang together, unknown
/// bones, missing numbers, a clip cut inside a frame.
pub fn read_acclaim(skeleton: impl AsRef<Path>, clip: impl AsRef<Path>) -> Result<Motion> {
    let (skeleton, clip) = (skeleton.as_ref(), clip.as_ref());
    let (bones_text, clip_text) = (encoding::read_text(skeleton)?, encoding::read_text(clip)?);
    let bones = acclaim_skeleton::parse(&lines_of_lf(bones_text.text), skeleton)?;
    let mut motion = parse(&lines_of_lf(clip_text.text), clip, bones)?;
    motion.warnings.extend(bones_text.note.map(|note| format!("{}: {note}", skeleton.display())));
    motion.warnings.extend(clip_text.note);
    Ok(motion)
}

/// A text whose lines end in CR alone, as on old Macs, with LF.
fn lines_of_lf(text: String) -> String {
    if text.contains('\n') { text } else { text.replace('\r', "\n") }
}

/// `SKELETON.asf,CLIP.amc` as its two files.
pub(super) fn split_pair(path: &Path) -> Option<(PathBuf, PathBuf)> {
    let (skeleton, clip) = path.to_str()?.split_once(',').filter(|_| !path.is_file())?;
    let has = |text: &str, extension: &str| text.trim().to_ascii_lowercase().ends_with(extension);
    (has(skeleton, ".asf") && has(clip, ".amc")).then(|| (skeleton.trim().into(), clip.trim().into()))
}

/// The skeleton that belongs to a clip, by its name.
pub(super) fn skeleton_beside(clip: &Path) -> Result<PathBuf> {
    let stem = clip.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let shorter = stem.rsplit_once('_').map(|(subject, _)| subject.to_owned());
    for name in [Some(stem), shorter].into_iter().flatten() {
        for extension in ["asf", "ASF"] {
            let candidate = clip.with_file_name(format!("{name}.{extension}"));
            if candidate.is_file() {
                return Ok(candidate);
            }
        }
    }
    let folder = clip.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let entries = std::fs::read_dir(folder).map_err(|e| Error::io(folder, e, "Check the folder"))?;
    let is_skeleton = |p: &PathBuf| p.extension().is_some_and(|e| e.eq_ignore_ascii_case("asf"));
    let mut found: Vec<PathBuf> = entries.filter_map(|e| Some(e.ok()?.path())).filter(is_skeleton).collect();
    match (found.pop(), found.is_empty()) {
        (Some(only), true) => Ok(only),
        _ => {
            let what = "the file holds no bones and its skeleton was not found";
            Err(Error::format(clip, None, what, "Name both files as SKELETON.asf,CLIP.amc"))
        }
    }
}

pub(super) fn parse(text: &str, path: &Path, skeleton: acclaim_skeleton::Bones) -> Result<Motion> {
    let fault = |line, what: String| Error::format(path, Some(line), what, "Fetch the file and its skeleton again");
    let bones = &skeleton.bones;
    let mut degrees = skeleton.degrees;
    let index: HashMap<&str, usize> = bones.iter().enumerate().map(|(k, b)| (b.name.as_str(), k)).collect();
    let moving = bones.iter().filter(|b| !b.freedoms.is_empty()).count();
    let mut values: Vec<Vec<f64>> = bones.iter().map(|b| vec![0.0; b.freedoms.len()]).collect();
    let mut seen = vec![usize::MAX; bones.len()];
    // The frame being read: its line, and how many bones have been given.
    let mut current: Option<(usize, usize)> = None;
    let (mut frames, mut rotations) = (Vec::new(), Vec::new());
    let mut finish = |current: Option<(usize, usize)>, values: &[Vec<f64>], degrees: bool, frames: &mut Vec<_>| {
        let Some((line, given)) = current else { return Ok(()) };
        if given < moving {
            return Err(fault(line, format!("frame {} gives {given} of {moving} bones", frames.len())));
        }
        // A bone has a position and a rotation.
        check_size(path, frames.len() + 1, 2 * bones.len())?;
        let (points, turns) = pose(bones, values, degrees);
        frames.push(points.into_iter().map(Some).collect::<Vec<_>>());
        rotations.push(turns);
        Ok(())
    };
    for (line, text) in text.lines().enumerate().map(|(k, t)| (k + 1, t)) {
        let mut words = text.split('#').next().unwrap_or_default().split_whitespace();
        let Some(first) = words.next() else { continue };
        if let Some(key) = first.strip_prefix(':') {
            match key.to_ascii_uppercase().as_str() {
                "DEGREES" => degrees = true,
                "RADIANS" => degrees = false,
                _ => {}
            }
            continue;
        }
        if first.bytes().all(|b| b.is_ascii_digit()) {
            finish(current, &values, degrees, &mut frames)?;
            current = Some((line, 0));
            continue;
        }
        let (Some((_, given)), Some(&bone)) = (&mut current, index.get(first)) else {
            let why = if current.is_none() { "before the first frame" } else { "is no bone of the skeleton" };
            return Err(fault(line, format!("{:?} {why}", shortened(first))));
        };
        if std::mem::replace(&mut seen[bone], frames.len()) == frames.len() {
            return Err(fault(line, format!("bone {first} is there twice in frame {}", frames.len())));
        }
        let freedoms = values[bone].len();
        *given += usize::from(freedoms > 0);
        for value in &mut values[bone] {
            match words.next().map(str::parse::<f64>) {
                Some(Ok(x)) if x.abs() <= MAX_COORDINATE => *value = x,
                _ => return Err(fault(line, format!("bone {first} needs {freedoms} numbers"))),
            }
        }
        if words.next().is_some() {
            return Err(fault(line, format!("bone {first} has {freedoms} degrees of freedom, there are more numbers")));
        }
    }
    finish(current, &values, degrees, &mut frames)?;
    if frames.is_empty() {
        return Err(fault(1, "there are no frames".into()));
    }
    let rest: Vec<Vec<f64>> = bones.iter().map(|b| vec![0.0; b.freedoms.len()]).collect();
    let rest = pose(bones, &rest, degrees).0;
    let segments = bones.iter().enumerate();
    let segments = segments.filter_map(|(to, b)| b.parent.map(|from| Segment { from, to, follows: to })).collect();
    let mut notes = Notes::default();
    notes.say("AMC files tell no rate; 120 frames a second are assumed".to_owned());
    Ok(Motion {
        path: path.to_path_buf(),
        names: super::distinct(bones.iter().map(|b| b.name.clone()).collect(), &mut notes),
        rate: known_rate(Some(120.0), &mut notes),
        frames,
        metres_per_unit: None,
        skeleton: Some(Skeleton { segments, rest, rotations }),
        warnings: notes.into_warnings(),
    })
}

/// Ends and rotations of all bones.
fn pose(bones: &[Bone], values: &[Vec<f64>], degrees: bool) -> (Vec<DVec3>, Vec<DQuat>) {
    let mut points: Vec<DVec3> = Vec::with_capacity(bones.len());
    let mut rotations: Vec<DQuat> = Vec::with_capacity(bones.len());
    for (bone, values) in bones.iter().zip(values) {
        let (mut turn, mut shift, mut longer) = (DQuat::IDENTITY, DVec3::ZERO, 0.0);
        for (freedom, &value) in bone.freedoms.iter().zip(values) {
            match freedom {
                Freedom::Turn(axis) => {
                    turn = DQuat::from_axis_angle(*axis, if degrees { value.to_radians() } else { value }) * turn;
                }
                Freedom::Shift(axis) => shift += *axis * value,
                Freedom::Length => longer += value,
            }
        }
        let turn = bone.axis * turn * bone.axis.inverse();
        let (point, rotation) = match bone.parent {
            None => (bone.reach + shift, turn),
            Some(p) => {
                let rotation = rotations[p] * turn;
                let reach = bone.reach + shift + bone.reach.normalize_or_zero() * longer;
                (points[p] + rotation * reach, rotation)
            }
        };
        points.push(point);
        rotations.push(rotation.normalize());
    }
    (points, rotations)
}
