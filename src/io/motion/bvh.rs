//! BVH: a skeleton and the channels of its joints, as text.
//!
//! Forward kinematics (Meredith, Maddock, Motion Capture File Formats Explained, 2001): with column
//! vectors a joint's rotation is `R = R_parent R_1 R_2 R_3` for its rotation channels in the order
//! they are listed, and its position `p = p_parent + R_parent offset`. Position channels are added
//! to the offset of a root, and take the place of the offset of other joints, as programs write
//! them. Scale channels, which some programs add, would need bones of changing length: they are
//! passed over, with a note where they are not 1.
//!
//! Words are read as programs write them: in any encoding, with or without blanks around braces and
//! colons, with any line ends.

use std::iter::Peekable;
use std::path::Path;

use glam::{DQuat, DVec3};

use super::skeleton::{Segment, Skeleton};
use super::{MAX_COORDINATE, Motion, check_size, known_rate, shortened};
use crate::io::encoding;
use crate::io::source::Notes;
use crate::io::table_number;
use crate::{Error, Result};

/// Reads a BVH file; the points are its joints and, called `NAME_end`, the ends of its limbs.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] naming the line, for unknown words, numbers that are none, or a
/// motion without a whole frame.
pub fn read_bvh(path: impl AsRef<Path>) -> Result<Motion> {
    let path = path.as_ref();
    let text = encoding::read_text(path)?;
    let mut motion = parse(&text.text, path)?;
    motion.warnings.extend(text.note);
    Ok(motion)
}

/// What a channel changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Change {
    Turn,
    Shift,
    /// Nothing here: lengths of bones are fixed.
    Scale,
}

/// A channel: an axis and what it changes along or about it.
#[derive(Clone, Copy)]
struct Channel {
    axis: DVec3,
    change: Change,
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
    words: Peekable<Box<dyn Iterator<Item = (usize, &'a str)> + 'a>>,
    line: usize,
}

impl<'a> Words<'a> {
    fn new(text: &'a str, path: &'a Path) -> Self {
        // Old Macs end lines in CR alone.
        let end = if text.contains('\n') { '\n' } else { '\r' };
        let lines = text.split(end).enumerate();
        let words = lines.flat_map(|(k, l)| l.split_whitespace().flat_map(apart).map(move |w| (k + 1, w)));
        let words: Box<dyn Iterator<Item = (usize, &'a str)> + 'a> = Box::new(words);
        Self { path, words: words.peekable(), line: 1 }
    }

    /// The next word without taking it.
    fn peek(&mut self) -> Option<&'a str> {
        self.words.peek().map(|w| w.1)
    }

    /// Takes `wanted` if it comes next, whatever case.
    fn take(&mut self, wanted: &str) -> bool {
        let there = self.peek().is_some_and(|w| w.eq_ignore_ascii_case(wanted));
        if there {
            self.words.next();
        }
        there
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
        match table_number::number(word, true) {
            Some(x) if x.abs() <= MAX_COORDINATE => Ok(x),
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

    /// Takes the words of a key, such as `Frame Time:`, however they are set apart.
    fn key(&mut self, wanted: &str) -> Result<()> {
        let plain = |text: &str| text.to_ascii_lowercase().replace([' ', '_', ':'], "");
        let mut found = String::new();
        while found != plain(wanted) {
            let word = self.next(wanted)?;
            found += &plain(word);
            if !plain(wanted).starts_with(&found) {
                return self.fail(format!("{:?} where {wanted} is expected", shortened(word)));
            }
        }
        self.take(":");
        Ok(())
    }
}

/// A word without blanks as the words that it stands for: braces, and keys with what follows their
/// colon.
fn apart(word: &str) -> impl Iterator<Item = &str> {
    let mut rest = word;
    std::iter::from_fn(move || {
        let key = |key: &str| rest.get(..key.len()).is_some_and(|k| k.eq_ignore_ascii_case(key)).then_some(key.len());
        let length = match rest.find(['{', '}']) {
            Some(0) => 1,
            Some(n) => n,
            None => key("frames:").or(key("time:")).or(key("frametime:")).unwrap_or(rest.len()),
        };
        let (first, others) = rest.split_at(length);
        rest = others;
        Some(first).filter(|f| !f.is_empty())
    })
}

pub(super) fn parse(text: &str, path: &Path) -> Result<Motion> {
    let mut words = Words::new(text, path);
    let mut notes = Notes::default();
    words.expect("HIERARCHY")?;
    let joints = hierarchy(&mut words)?;
    let channels: usize = joints.iter().map(|j| j.channels.len()).sum();
    words.key("Frames:")?;
    let count = words.next("the number of frames")?;
    let Some(count) = count.parse::<usize>().ok().filter(|&n| n > 0) else {
        return words.fail(format!("{:?} frames", shortened(count)));
    };
    // Files without the time of a frame begin with their numbers.
    let timed = words.peek().is_some_and(|w| w.parse::<f64>().is_err());
    let time = if timed {
        words.key("Frame Time:")?;
        words.number("the time of a frame in seconds")?
    } else {
        0.0
    };
    if channels == 0 {
        return words.fail("no joint has channels: nothing moves".into());
    }
    // A joint has a position and a rotation.
    check_size(path, count, 2 * joints.len())?;

    let scales: Vec<usize> = joints
        .iter()
        .flat_map(|j| &j.channels)
        .enumerate()
        .filter(|(_, c)| c.change == Change::Scale)
        .map(|(k, _)| k)
        .collect();
    let (mut frames, mut rotations) = (Vec::new(), Vec::new());
    let mut values = vec![0.0; channels];
    'frames: for f in 0..count {
        for (k, value) in values.iter_mut().enumerate() {
            if words.peek().is_none() && f > 0 {
                let partly = if k > 0 { format!(" and {k} of {channels} numbers of another") } else { String::new() };
                notes.say(format!("{count} frames are declared, the file holds {f}{partly}: those {f} are read"));
                break 'frames;
            }
            *value = words.number("a value of a channel").map_err(|e| match e {
                Error::Format { path, line, what, remedy } => {
                    Error::Format { path, line, what: format!("frame {f} of {count}: {what}"), remedy }
                }
                other => other,
            })?;
        }
        if scales.iter().any(|&k| (values[k] - 1.0).abs() > 1e-6) {
            notes.count("frames with scales other than 1, which are not used", Some(words.line));
        }
        let (points, turns) = pose(&joints, &values);
        frames.push(points.into_iter().map(Some).collect());
        rotations.push(turns);
    }
    if words.peek().is_some() {
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
    // Open braces: the joints around the current place. No recursion, so that no depth of nesting
    // overflows the stack.
    let mut open: Vec<usize> = Vec::new();
    loop {
        let word = words.next("MOTION")?;
        let upper = word.to_ascii_uppercase();
        match (upper.as_str(), open.last().copied()) {
            ("MOTION", None) if !joints.is_empty() => return Ok(joints),
            ("ROOT", None) | ("JOINT" | "END" | "ENDSITE", Some(_)) => {
                let parent = open.last().copied();
                // Names may have blanks, or be missing.
                let mut name = String::new();
                while !words.take("{") {
                    let more = shortened(words.next("{")?);
                    if name.len() > 100 || more == "}" {
                        return words.fail(format!("{more:?} where {{ is expected"));
                    }
                    name = if name.is_empty() { more } else { format!("{name} {more}") };
                }
                let ends = upper.starts_with("END");
                if let (true, Some(p)) = (ends, parent) {
                    name = format!("{}_end", joints[p].name);
                }
                if parent.is_some_and(|p| joints[p].end) {
                    return words.fail("a joint below the end of a limb".into());
                }
                open.push(joints.len());
                joints.push(Joint { name, parent, offset: DVec3::ZERO, channels: Vec::new(), end: ends });
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
    let change = match &word[1..] {
        "rotation" => Change::Turn,
        "position" | "translation" => Change::Shift,
        "scale" | "scaling" => Change::Scale,
        _ => return None,
    };
    Some(Channel { axis, change })
}

/// Positions and rotations of all joints from the values of all channels; without values, the rest
/// pose.
fn pose(joints: &[Joint], values: &[f64]) -> (Vec<DVec3>, Vec<DQuat>) {
    let mut points: Vec<DVec3> = Vec::with_capacity(joints.len());
    let mut rotations: Vec<DQuat> = Vec::with_capacity(joints.len());
    let mut next = values.iter();
    for joint in joints {
        let (mut offset, mut rotation) = (joint.offset, DQuat::IDENTITY);
        for (channel, &value) in joint.channels.iter().zip(&mut next) {
            match channel.change {
                Change::Turn => rotation *= DQuat::from_axis_angle(channel.axis, value.to_radians()),
                Change::Shift => {
                    let kept = if joint.parent.is_none() { offset } else { offset * (DVec3::ONE - channel.axis) };
                    offset = kept + channel.axis * value;
                }
                Change::Scale => {}
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
