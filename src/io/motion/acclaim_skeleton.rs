//! ASF: the bones of a skeleton.

use std::collections::HashMap;
use std::path::Path;

use glam::{DQuat, DVec3};

use super::{MAX_COORDINATE, shortened};
use crate::{Error, Result};

/// A degree of freedom.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Freedom {
    Turn(DVec3),
    Shift(DVec3),
    Length,
}

/// A bone, from the end of its parent to its own end.
#[derive(Clone, Debug)]
pub(super) struct Bone {
    pub(super) name: String,
    /// Earlier in the list; the root is first and has none.
    pub(super) parent: Option<usize>,
    /// From the parent's end to its own in the rest pose; the position of the root.
    pub(super) reach: DVec3,
    /// The axes its rotations are about.
    pub(super) axis: DQuat,
    pub(super) freedoms: Vec<Freedom>,
}

/// Bones with parents before children, and what the angles of clips are in.
pub(super) struct Bones {
    pub(super) bones: Vec<Bone>,
    pub(super) degrees: bool,
}

/// What is collected of a bone or the root while its lines are read.
#[derive(Default)]
struct Draft {
    name: String,
    direction: DVec3,
    length: f64,
    angles: DVec3,
    order: String,
    freedoms: Vec<Freedom>,
    position: DVec3,
}

struct Lines<'a> {
    path: &'a Path,
    degrees: bool,
}

impl Lines<'_> {
    fn fail<T>(&self, line: usize, what: String) -> Result<T> {
        Err(Error::format(self.path, Some(line), what, "Correct the file or fetch it again"))
    }

    fn numbers<const N: usize>(&self, line: usize, words: &[&str]) -> Result<[f64; N]> {
        let mut numbers = [0.0; N];
        if words.len() < N {
            return self.fail(line, format!("{} numbers where {N} are expected", words.len()));
        }
        for (x, word) in numbers.iter_mut().zip(words) {
            match word.parse::<f64>() {
                Ok(value) if value.abs() <= MAX_COORDINATE => *x = value,
                _ => return self.fail(line, format!("{:?} is not a number", shortened(word))),
            }
        }
        Ok(numbers)
    }

    fn freedoms(&self, line: usize, words: &[&str]) -> Result<Vec<Freedom>> {
        words
            .iter()
            .take(16)
            .map(|w| {
                freedom(w).map_or_else(|| self.fail(line, format!("{:?} is not a degree of freedom", shortened(w))), Ok)
            })
            .collect()
    }

    fn bone(&self, line: usize, draft: Draft, parent: Option<usize>) -> Result<Bone> {
        let Some(axis) = rotation(draft.angles, &draft.order, self.degrees) else {
            return self.fail(line, format!("{:?} is not an order of axes", shortened(&draft.order)));
        };
        let direction = draft.direction.try_normalize().unwrap_or(DVec3::ZERO);
        let reach = if parent.is_none() { draft.position } else { direction * draft.length };
        Ok(Bone { name: draft.name, parent, reach, axis, freedoms: draft.freedoms })
    }
}

fn freedom(word: &str) -> Option<Freedom> {
    let axis = |c: &str| match c {
        "x" => Some(DVec3::X),
        "y" => Some(DVec3::Y),
        "z" => Some(DVec3::Z),
        _ => None,
    };
    let word = word.to_ascii_lowercase();
    if word == "l" {
        return Some(Freedom::Length);
    }
    match word.strip_prefix('r') {
        Some(rest) => axis(rest).map(Freedom::Turn),
        None => word.strip_prefix('t').and_then(axis).map(Freedom::Shift),
    }
}

/// The rotation by three angles applied in the order of the letters: for XYZ with column vectors `R
/// = Rz Ry Rx`.
pub(super) fn rotation(angles: DVec3, order: &str, degrees: bool) -> Option<DQuat> {
    let mut rotation = DQuat::IDENTITY;
    for (k, letter) in order.bytes().enumerate() {
        let axis = match letter.to_ascii_lowercase() {
            b'x' => DVec3::X,
            b'y' => DVec3::Y,
            b'z' => DVec3::Z,
            _ => return None,
        };
        // The angles are listed in the order of the letters.
        let angle = *angles.to_array().get(k)?;
        rotation = DQuat::from_axis_angle(axis, if degrees { angle.to_radians() } else { angle }) * rotation;
    }
    Some(rotation)
}

/// Reads the text of an ASF file.
pub(super) fn parse(text: &str, path: &Path) -> Result<Bones> {
    let mut state = Lines { path, degrees: true };
    let mut root = Draft { name: "root".into(), order: "XYZ".into(), ..Draft::default() };
    let mut drafts: Vec<(usize, Draft)> = Vec::new();
    let mut open: Option<(usize, Draft)> = None;
    let mut links: Vec<(usize, Vec<&str>)> = Vec::new();
    let (mut section, mut root_line) = (String::new(), 1);
    for (line, text) in text.lines().enumerate().map(|(k, t)| (k + 1, t)) {
        let words: Vec<&str> = text.split('#').next().unwrap_or_default().split_whitespace().collect();
        let Some((&first, rest)) = words.split_first() else { continue };
        if let Some(name) = first.strip_prefix(':') {
            section = name.to_ascii_lowercase();
            continue;
        }
        match (section.as_str(), first.to_ascii_lowercase().as_str()) {
            ("units", "angle") => {
                state.degrees = !rest.first().is_some_and(|w| w.to_ascii_lowercase().starts_with("rad"))
            }
            ("root", key) => {
                root_line = line;
                match key {
                    "order" => root.freedoms = state.freedoms(line, rest)?,
                    "axis" => root.order = rest.first().copied().unwrap_or_default().to_owned(),
                    "position" => root.position = DVec3::from(state.numbers(line, rest)?),
                    "orientation" => root.angles = DVec3::from(state.numbers(line, rest)?),
                    _ => {}
                }
            }
            ("bonedata", "begin") => {
                if let Some((begun, _)) = open.replace((line, Draft { order: "XYZ".into(), ..Draft::default() })) {
                    return state.fail(line, format!("begin, but the bone of line {begun} has no end"));
                }
            }
            ("bonedata", "end") => match open.take() {
                Some((begun, draft)) if !draft.name.is_empty() => drafts.push((begun, draft)),
                Some((begun, _)) => return state.fail(begun, "a bone without a name".into()),
                None => return state.fail(line, "end without begin".into()),
            },
            ("bonedata", key) => {
                let Some((_, bone)) = &mut open else { continue };
                match key {
                    "name" => bone.name = rest.join(" "),
                    "direction" => bone.direction = DVec3::from(state.numbers(line, rest)?),
                    "length" => [bone.length] = state.numbers(line, rest)?,
                    "axis" => {
                        bone.angles = DVec3::from(state.numbers(line, rest)?);
                        bone.order = rest.get(3).copied().unwrap_or("XYZ").to_owned();
                    }
                    "dof" => bone.freedoms = state.freedoms(line, rest)?,
                    _ => {}
                }
            }
            ("hierarchy", "begin" | "end") => {}
            ("hierarchy", _) => links.push((line, words)),
            _ => {}
        }
    }
    if let Some((begun, _)) = open {
        return state.fail(begun, "the file ends inside this bone".into());
    }
    let root = state.bone(root_line, root, None)?;
    let bones = connect(&state, root, drafts, &links)?;
    Ok(Bones { bones, degrees: state.degrees })
}

/// Hangs the bones below one another, parents first. Lines of the hierarchy read `parent child
/// child ...`.
fn connect(
    state: &Lines<'_>,
    root: Bone,
    drafts: Vec<(usize, Draft)>,
    links: &[(usize, Vec<&str>)],
) -> Result<Vec<Bone>> {
    let mut waiting: HashMap<String, (usize, Draft)> = HashMap::new();
    for (line, draft) in drafts {
        let name = draft.name.clone();
        if name == root.name || waiting.insert(name.clone(), (line, draft)).is_some() {
            return state.fail(line, format!("bone {:?} is there twice", shortened(&name)));
        }
    }
    let mut index = HashMap::from([(root.name.clone(), 0)]);
    let mut bones = vec![root];
    // A parent may be linked on a later line than its children: lines wait for their parent.
    let mut below: HashMap<&str, Vec<(usize, &str)>> = HashMap::new();
    for (line, words) in links {
        below.entry(words[0]).or_default().extend(words[1..].iter().map(|w| (*line, *w)));
    }
    let mut ready: Vec<String> = vec![bones[0].name.clone()];
    while let Some(parent) = ready.pop() {
        for (line, child) in below.remove(parent.as_str()).unwrap_or_default() {
            let Some((begun, draft)) = waiting.remove(child) else {
                let why = if index.contains_key(child) { "hangs below two bones" } else { "is not defined" };
                return state.fail(line, format!("bone {:?} {why}", shortened(child)));
            };
            let bone = state.bone(begun, draft, Some(index[&parent]))?;
            index.insert(child.to_owned(), bones.len());
            bones.push(bone);
            ready.push(child.to_owned());
        }
    }
    if let Some((line, name)) = waiting.values().map(|(line, d)| (*line, &d.name)).min() {
        return state.fail(line, format!("bone {:?} does not hang below the root", shortened(name)));
    }
    Ok(bones)
}
