//! Wavefront OBJ, read line by line.
//!
//! Kept: `v` with colours, `vt`, `vn`, `f` with negative indices, `g`, `o`, `s`, `usemtl`,
//! `mtllib`. Lines, points and free-form geometry are passed over. Numbers follow the file: a
//! vertex index is the position of its `v` line.
//!
//! Why not the crate `tobj`: it reads text that is UTF-8 alone, single precision unless a feature
//! changes it in the whole program, no groups and no smoothing, keeps the options of a picture in
//! its name, and has no line number for what is wrong. It is the oracle of our tests instead
//! (`tests/cpu/tobj_oracle.rs`).

mod names;

use std::io::BufRead;
use std::path::Path;

use glam::{DVec2, DVec3};

use super::LoadedMesh;
use super::assemble::Faces;
use super::source::{self, Notes, refuse_utf16};
use super::text_lines::StatementLines;
use super::vertex_colors;
use crate::geometry::{Corner, MeshBuilder, NONE};
pub(super) use names::comment_start;

use crate::{Error, Result};
use names::Names;

/// Reads an OBJ file and the material libraries it names. O(file size) time and memory.
///
/// # Errors
/// [`Error::Io`], or [`Error::Format`] naming the line: a number that is none, a face index that is
/// 0 or out of range, a position that is not finite and used by a face, no face at all.
pub fn read_obj(path: impl AsRef<Path>) -> Result<LoadedMesh> {
    let path = path.as_ref();
    parse_obj(source::open(path)?, path)
}

/// Reads OBJ text from `input`; `path` names it in messages and locates its material libraries.
///
/// # Errors
/// As [`read_obj`].
pub fn parse_obj(input: impl BufRead, path: &Path) -> Result<LoadedMesh> {
    parse(input, path, Faces::Needed)
}

/// Reads OBJ text that may hold points alone.
pub(super) fn read_points(path: &Path) -> Result<LoadedMesh> {
    parse(source::open(path)?, path, Faces::Optional)
}

fn parse(input: impl BufRead, path: &Path, faces: Faces) -> Result<LoadedMesh> {
    let mut reader = Reader::new(path);
    let mut lines = StatementLines::new(input);
    let mut line = Vec::new();
    while lines.read(&mut line, path)? {
        if reader.line == 0 {
            refuse_utf16(path, &line)?;
        }
        reader.line = lines.number;
        reader.statement(line.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&line))?;
    }
    reader.finish(faces)
}

/// A position that is not finite, kept to be named if a face uses it.
struct NotFinite {
    index: u32,
    line: usize,
}

struct Reader<'a> {
    path: &'a Path,
    builder: MeshBuilder,
    notes: Notes,
    line: usize,
    /// Line of each polygon, for indices that can be checked only at the end.
    polygon_line: Vec<u32>,
    corners: Vec<Corner>,
    names: Names,
    /// Numbers behind the positions, and their count, once a vertex has colours.
    behind_positions: Vec<([f64; 4], u8)>,
    /// Colours in comments.
    polypaint: Vec<[f32; 4]>,
    bad_positions: Vec<NotFinite>,
    bad_texcoords: Vec<NotFinite>,
}

impl<'a> Reader<'a> {
    fn new(path: &'a Path) -> Self {
        Self {
            path,
            builder: MeshBuilder::new(path.display().to_string()),
            notes: Notes::default(),
            line: 0,
            polygon_line: Vec::new(),
            corners: Vec::new(),
            names: Names::default(),
            behind_positions: Vec::new(),
            polypaint: Vec::new(),
            bad_positions: Vec::new(),
            bad_texcoords: Vec::new(),
        }
    }

    fn error(&self, what: impl Into<String>, remedy: &str) -> Error {
        Error::format(self.path, Some(self.line), what, remedy)
    }

    fn statement(&mut self, line: &[u8]) -> Result<()> {
        let line = line.trim_ascii();
        let split = line.iter().position(u8::is_ascii_whitespace).unwrap_or(line.len());
        let (keyword, rest) = (&line[..split], line[split..].trim_ascii());
        match keyword {
            b"v" => {
                let ([x, y, z, more @ ..], count) = self.numbers::<7>(rest, 3, "vertex")?;
                let p = DVec3::new(x, y, z);
                self.behind_position(more, count - 3);
                let index = self.next_index(self.builder.mesh.positions.len())?;
                if !p.is_finite() {
                    self.bad_positions.push(NotFinite { index, line: self.line });
                }
                self.builder.mesh.positions.push(p);
            }
            b"vt" => {
                let ([u, v], _) = self.numbers(rest, 1, "texture coordinate")?;
                let p = DVec2::new(u, v);
                let index = self.next_index(self.builder.mesh.texcoords.len())?;
                if !p.is_finite() {
                    self.bad_texcoords.push(NotFinite { index, line: self.line });
                }
                self.builder.mesh.texcoords.push(p);
            }
            b"vn" => {
                let ([x, y, z], _) = self.numbers(rest, 3, "normal")?;
                self.next_index(self.builder.mesh.normals.len())?;
                self.builder.mesh.normals.push(DVec3::new(x, y, z));
            }
            b"f" | b"fo" => self.face(rest)?,
            b"g" => self.builder.group = self.names.group(rest, false),
            b"o" => {
                self.builder.object = self.names.group(rest, true);
                self.builder.group = self.builder.object;
            }
            b"s" => self.builder.smoothing = smoothing(rest),
            b"usemtl" => self.builder.material = self.names.material(rest),
            b"mtllib" => self.names.libraries(self.path, rest, &mut self.notes)?,
            b"#MRGB" => self.polypaint(rest),
            b"l" | b"p" => self.notes.count("lines and points were passed over", Some(self.line)),
            b"curv" | b"curv2" | b"surf" => {
                self.notes.count("free-form curves and surfaces were passed over", Some(self.line));
            }
            _ => {}
        }
        Ok(())
    }

    fn next_index(&self, count: usize) -> Result<u32> {
        u32::try_from(count)
            .ok()
            .filter(|i| *i < NONE - 1)
            .ok_or_else(|| self.error("more elements than 32-bit indices can number", "Split the mesh"))
    }

    /// Keeps what stands behind a position, if some vertex has colours there.
    fn behind_position(&mut self, numbers: [f64; 4], count: usize) {
        let before = self.builder.mesh.positions.len();
        if self.behind_positions.is_empty() && count < 3 {
            return;
        }
        self.behind_positions.resize(before, ([0.0; 4], 0));
        self.behind_positions.push((numbers, count as u8));
    }

    /// Colours that ZBrush writes as comments: eight hexadecimal digits a vertex, of which the
    /// first two are a mask.
    fn polypaint(&mut self, digits: &[u8]) {
        for vertex in digits.trim_ascii().chunks_exact(8) {
            let byte = |k: usize| u8::from_str_radix(std::str::from_utf8(&vertex[k..k + 2]).ok()?, 16).ok();
            let color = [2, 4, 6].map(|k| byte(k).map(|b| f32::from(b) / 255.0));
            let [Some(r), Some(g), Some(b)] = color else { return };
            self.polypaint.push([r, g, b, 1.0]);
        }
    }

    /// Up to `N` numbers, at least `least`, and how many; what is missing is 0. A number that is
    /// none (as `1.#IND`) is NaN where it is spelled so.
    fn numbers<const N: usize>(&self, rest: &[u8], least: usize, element: &str) -> Result<([f64; N], usize)> {
        let mut values = [0.0; N];
        let mut count = 0;
        for token in tokens(rest).take(N) {
            let text = String::from_utf8_lossy(token);
            values[count] = parse_number(&text).ok_or_else(|| {
                let what = format!("{:?} in a {element} is not a number", shortened(&text));
                self.error(what, "Write decimal numbers with a point, such as -0.5 or 1e-3")
            })?;
            count += 1;
        }
        if count < least {
            let what = format!("a {element} with {count} of {least} numbers");
            return Err(self.error(what, "Complete the line, or export the mesh again"));
        }
        Ok((values, count))
    }

    fn face(&mut self, rest: &[u8]) -> Result<()> {
        self.corners.clear();
        for token in tokens(rest) {
            let mut parts = token.split(|b| *b == b'/');
            let mesh = &self.builder.mesh;
            let vertex = self.index(parts.next(), mesh.positions.len(), token, "vertex")?;
            let texcoord = self.index(parts.next(), mesh.texcoords.len(), token, "texture coordinate")?;
            let normal = self.index(parts.next(), mesh.normals.len(), token, "normal")?;
            if vertex == NONE || parts.next().is_some() {
                let what = format!("{:?} is not a face corner", shortened(&String::from_utf8_lossy(token)));
                return Err(self.error(what, "A corner is v, v/vt, v//vn or v/vt/vn"));
            }
            self.corners.push(Corner { vertex, texcoord, normal });
        }
        if self.corners.len() < 3 {
            self.notes.count("faces with fewer than three corners were left out", Some(self.line));
            return Ok(());
        }
        let corner_count = self.builder.corners_mut().len() + self.corners.len();
        self.next_index(corner_count)?;
        self.builder.polygon(self.corners.iter().copied());
        self.polygon_line.push(u32::try_from(self.line).unwrap_or(u32::MAX));
        Ok(())
    }

    /// A 1-based or negative index as a 0-based one; [`NONE`] where nothing is written. A positive
    /// one may refer to a later line.
    fn index(&self, part: Option<&[u8]>, count: usize, token: &[u8], element: &str) -> Result<u32> {
        let Some(part) = part.filter(|p| !p.is_empty()) else { return Ok(NONE) };
        let parsed = std::str::from_utf8(part).ok().and_then(|t| t.parse::<i64>().ok());
        let in_token = || shortened(&String::from_utf8_lossy(token));
        match parsed {
            None => {
                let what = format!("face corner {:?} has a {element} index that is no integer", in_token());
                Err(self.error(what, "A corner is v, v/vt, v//vn or v/vt/vn"))
            }
            Some(0) => {
                let what = format!("face corner {:?} has {element} index 0", in_token());
                Err(self.error(what, "Indices of OBJ files begin at 1: correct the line, or export the mesh again"))
            }
            Some(i) if i > 0 => {
                u32::try_from(i - 1).ok().filter(|i| *i < NONE - 1).ok_or_else(|| self.out_of_range(i, element, count))
            }
            Some(i) => usize::try_from(i.unsigned_abs())
                .ok()
                .and_then(|back| count.checked_sub(back))
                .map(|i| i as u32)
                .ok_or_else(|| self.out_of_range(i, element, count)),
        }
    }

    fn out_of_range(&self, index: i64, element: &str, count: usize) -> Error {
        let what = match index {
            1.. => format!("a face refers to {element} {index}, the file has {count}"),
            _ => format!("a face refers to {element} {index}, {count} lie before it"),
        };
        self.error(what, "The file is damaged or cut short: export the mesh again")
    }

    fn finish(mut self, faces: Faces) -> Result<LoadedMesh> {
        let mesh = &self.builder.mesh;
        let (positions, texcoords, normals) = (mesh.positions.len(), mesh.texcoords.len(), mesh.normals.len());
        for (p, &line) in self.polygon_line.iter().enumerate() {
            for c in mesh.polygon(p) {
                self.line = line as usize;
                for (index, count, element) in
                    [(c.vertex, positions, "vertex"), (c.texcoord, texcoords, "texture coordinate")]
                {
                    if index != NONE && index as usize >= count {
                        return Err(self.out_of_range(i64::from(index) + 1, element, count));
                    }
                }
                if let Ok(k) = self.bad_positions.binary_search_by_key(&c.vertex, |b| b.index) {
                    let what = format!(
                        "the position of vertex {} (line {}) is not finite, and this face uses it",
                        c.vertex, self.bad_positions[k].line
                    );
                    return Err(self.error(what, "Correct the vertex or remove the face"));
                }
            }
        }
        if faces == Faces::Needed && !self.builder.has_faces() {
            let what = format!("there is no face with three or more corners ({positions} vertices)");
            return Err(Error::format(self.path, None, what, "Export a surface mesh, with faces, as OBJ"));
        }
        for bad in &self.bad_positions {
            self.notes.count("positions that are not finite, used by no face", Some(bad.line));
        }
        for bad in &self.bad_texcoords {
            self.notes.count("texture coordinates that are not finite were dropped", Some(bad.line));
        }
        let bad_texcoords = &self.bad_texcoords;
        let mut lost = 0;
        for c in self.builder.corners_mut() {
            if bad_texcoords.binary_search_by_key(&c.texcoord, |b| b.index).is_ok() {
                c.texcoord = NONE;
            }
            if c.normal != NONE && c.normal as usize >= normals {
                c.normal = NONE;
                lost += 1;
            }
        }
        if lost > 0 {
            self.notes.say(format!("{lost} face corners refer to normals that do not exist; they were dropped"));
        }
        self.names.finish(&mut self.builder, &mut self.notes);
        if let Some(colors) = vertex_colors::behind_positions(&self.behind_positions) {
            self.builder.mesh.colors = colors.rgba();
            colors.note.into_iter().for_each(|note| self.notes.say(note));
        } else if self.polypaint.len() == positions && positions > 0 {
            self.builder.mesh.colors = self.polypaint;
        }
        Ok(LoadedMesh { mesh: self.builder.build()?, warnings: self.notes.into_warnings(), scene: None })
    }
}

/// The number of a smoothing group; 0 for `off`, [`NONE`] where there is no number.
fn smoothing(rest: &[u8]) -> u32 {
    match tokens(rest).next() {
        Some(word) if word.eq_ignore_ascii_case(b"off") => 0,
        Some(word) => std::str::from_utf8(word).ok().and_then(|w| w.parse().ok()).unwrap_or(NONE),
        None => NONE,
    }
}

/// Words up to a comment, which begins with a word: the spelling `1.#IND` holds the sign too.
fn tokens(rest: &[u8]) -> impl Iterator<Item = &[u8]> {
    rest.split(u8::is_ascii_whitespace).filter(|t| !t.is_empty()).take_while(|t| t[0] != b'#')
}

/// A number as text formats spell it, with the non-finite spellings of C libraries.
pub(crate) fn parse_number(text: &str) -> Option<f64> {
    if let Ok(x) = text.parse() {
        return Some(x);
    }
    let bare = text.trim_start_matches(['-', '+']).to_ascii_lowercase();
    (bare.starts_with("nan(") || bare.starts_with("1.#")).then_some(f64::NAN)
}

/// The beginning of a word, for messages.
pub(crate) fn shortened(text: &str) -> String {
    let mut short: String = text.chars().take(40).collect();
    if short.len() < text.len() {
        short.push_str("...");
    }
    short
}

#[cfg(test)]
mod tests;
