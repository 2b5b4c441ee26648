//! BVH: a skeleton and the channels of its joints, as text.
//!
//! Forward kinematics (Meredith, Maddock, Motion Capture File Formats Explained, 2001): with column vectors a joint's rotation is
//! `R = R_parent R_1 R_2 R_3` for its rotation channels in the order they are listed, and its position `p = p_parent + R_parent offset`. Position
//! channels are added to the offset of a root, and take the place of the offset of other joints, as programs write them.

use std::path::Path;

use glam::{DQuat, DVec3};

use super::skeleton::{Segment, Skeleton};
use super::{MAX_COORDINATE, Motion, check_size, known_rate, shortened};
use crate::io::source::{self, Notes};
use crate::{Error, Result};

/// Reads a BVH file; the points are its joints and, called `NAME_end`, the ends of its limbs.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] naming the line, for unknown words, missing numbers, or a motion that is cut short (naming the frame).
pub fn read_bvh(path: impl AsRef<Path>) -> Result<Motion> {
    let path = path.as_ref();
    parse(&source::read_text(path)?, path)
}

/// What a channel moves: an axis and whether it turns about it.
#[derive(Clone, Copy)]
struct Channel {
    axis: DVec3,
    turns: bool,
}

struct Joint {
    name: String,
    parent: Option<usize>,
    offset: DVec3,
    channels: Vec<Channel>,
    /// Whether it ends a limb.
    end: bool,
}

/// Words with their lines.
struct Words<'a> {
    path: &'a Path,
    words: Box<dyn Iterator<Item = (usize, &'a str)> + 'a>,
    line: usize,
}

impl<'a> Words<'a> {
    fn new(text: &'a str, path: &'a Path) -> Self {
        let words = text.lines().enumerate().flat_map(|(k, l)| l.split_whitespace().map(move |w| (k + 1, w)));
        Self { path, words: Box::new(words), line: 1 }
    }

    fn fail<T>(&self, what: String) -> Result<T> {
        Err(Error::format(self.path, Some(self.line), what, "Correct the file or export it again as BVH"))
    }

    fn next(&mut self, wanted: &str) -> Result<&'a str> {
        match self.words.next() {
            Some((line, word)) => {
                self.line = line;
                Ok(word)
            }
            None => self.fail(format!("the file ends where {wanted} is expected")),
        }
    }

    fn number(&mut self, wanted: &str) -> Result<f64> {
        let word = self.next(wanted)?;
        match word.parse::<f64>() {
            Ok(x) if x.abs() <= MAX_COORDINATE => Ok(x),
            _ => self.fail(format!("{:?} where {wanted} is expected", shortened(word))),
        }
    }

    fn expect(&mut self, wanted: &str) -> Result<()> {
        let word = self.next(wanted)?;
        if word.eq_ignore_ascii_case(wanted) {
            return Ok(());
        }
        self.fail(format!("{:?} where {wanted} is expected", shortened(word)))
    }
}

pub(super) fn parse(text: &str, path: &Path) -> Result<Motion> {
    let mut words = Words::new(text, path);
    let mut notes = Notes::default();
    words.expect("HIERARCHY")?;
    let joints = hierarchy(&mut words)?;
    let channels: usize = joints.iter().map(|j| j.channels.len()).sum();
    words.expect("Frames:")?;
    let count = words.next("the number of frames")?;
    let Some(count) = count.parse::<usize>().ok().filter(|&n| n > 0) else {
        return words.fail(format!("{:?} frames", shortened(count)));
    };
    words.expect("Frame")?;
    words.expect("Time:")?;
    let time = words.number("the time of a frame in seconds")?;
    if channels == 0 {
        return words.fail("no joint has channels: nothing moves".into());
    }
    // A joint has a position and a rotation.
    check_size(path, count, 2 * joints.len())?;

    let (mut frames, mut rotations) = (Vec::new(), Vec::new());
    let mut values = vec![0.0; channels];
    for f in 0..count {
        for value in &mut values {
            *value = words.number("a value of a channel").map_err(|e| match e {
                Error::Format { path, line, what, remedy } => {
                    Error::Format { path, line, what: format!("frame {f} of {count}: {what}"), remedy }
                }
                other => other,
            })?;
        }
        let (points, turns) = pose(&joints, &values);
        frames.push(points.into_iter().map(Some).collect());
        rotations.push(turns);
    }
    if words.words.next().is_some() {
        notes.say(format!("there is more after the {count} frames that are declared; it was left out"));
    }
    let (rest, _) = pose(&joints, &[]);
    let segments = joints.iter().enumerate();
    let segments = segments.filter_map(|(to, j)| j.parent.map(|from| Segment { from, to, follows: from })).collect();
    let rate = known_rate((time > 0.0).then(|| 1.0 / time), &mut notes);
    Ok(Motion {
        path: path.to_path_buf(),
        names: super::distinct(joints.into_iter().map(|j| j.name).collect(), &mut notes),
        rate,
        frames,
        metres_per_unit: None,
        skeleton: Some(Skeleton { segments, rest, rotations }),
        warnings: notes.into_warnings(),
    })
}

/// The joints, parents before children, up to and without the word MOTION.
fn hierarchy(words: &mut Words<'_>) -> Result<Vec<Joint>> {
    let mut joints: Vec<Joint> = Vec::new();
    // Open braces: the joints around the current place. No recursion, so that no depth of nesting overflows the stack.
    let mut open: Vec<usize> = Vec::new();
    loop {
        let word = words.next("MOTION")?;
        let upper = word.to_ascii_uppercase();
        match (upper.as_str(), open.last().copied()) {
            ("MOTION", None) if !joints.is_empty() => return Ok(joints),
            ("ROOT", None) | ("JOINT" | "END", Some(_)) => {
                let parent = open.last().copied();
                let word = words.next("a name")?;
                let mut name = match (upper.as_str(), parent) {
                    ("END", Some(p)) => format!("{}_end", joints[p].name),
                    _ => word.chars().take(100).collect(),
                };
                // Names may have blanks.
                loop {
                    match words.next("{")? {
                        "{" => break,
                        more if upper != "END" && name.len() < 100 => name = format!("{name} {}", shortened(more)),
                        other => return words.fail(format!("{:?} where {{ is expected", shortened(other))),
                    }
                }
                if parent.is_some_and(|p| joints[p].end) {
                    return words.fail("a joint below the end of a limb".into());
                }
                open.push(joints.len());
                joints.push(Joint { name, parent, offset: DVec3::ZERO, channels: Vec::new(), end: upper == "END" });
            }
            ("OFFSET", Some(j)) => {
                let mut xyz = [0.0; 3];
                for x in &mut xyz {
                    *x = words.number("an offset")?;
                }
                joints[j].offset = DVec3::from(xyz);
            }
            ("CHANNELS", Some(j)) => {
                let count = words.number("a number of channels")?;
                if !(0.0..=16.0).contains(&count) {
                    return words.fail(format!("a joint with {count} channels"));
                }
                for _ in 0..count as usize {
                    let word = words.next("a channel")?;
                    match channel(word) {
                        Some(channel) => joints[j].channels.push(channel),
                        None => return words.fail(format!("{:?} is not a channel", shortened(word))),
                    }
                }
            }
            ("}", Some(_)) => {
                open.pop();
            }
            _ => return words.fail(format!("{:?} is not expected here", shortened(word))),
        }
    }
}

fn channel(word: &str) -> Option<Channel> {
    let word = word.to_ascii_lowercase();
    let axis = match word.chars().next()? {
        'x' => DVec3::X,
        'y' => DVec3::Y,
        'z' => DVec3::Z,
        _ => return None,
    };
    let turns = match &word[1..] {
        "rotation" => true,
        "position" => false,
        _ => return None,
    };
    Some(Channel { axis, turns })
}

/// Positions and rotations of all joints from the values of all channels; without values, the rest pose.
fn pose(joints: &[Joint], values: &[f64]) -> (Vec<DVec3>, Vec<DQuat>) {
    let mut points: Vec<DVec3> = Vec::with_capacity(joints.len());
    let mut rotations: Vec<DQuat> = Vec::with_capacity(joints.len());
    let mut next = values.iter();
    for joint in joints {
        let (mut offset, mut rotation) = (joint.offset, DQuat::IDENTITY);
        for (channel, &value) in joint.channels.iter().zip(&mut next) {
            if channel.turns {
                rotation *= DQuat::from_axis_angle(channel.axis, value.to_radians());
            } else {
                let kept = if joint.parent.is_none() { offset } else { offset * (DVec3::ONE - channel.axis) };
                offset = kept + channel.axis * value;
            }
        }
        let (point, rotation) = match joint.parent {
            None => (offset, rotation),
            Some(p) => (points[p] + rotations[p] * offset, rotations[p] * rotation),
        };
        points.push(point);
        rotations.push(rotation.normalize());
    }
    (points, rotations)
}
