//! Wavefront OBJ, read line by line.
//!
//! Kept: `v`, `vt`, `vn`, `f` with negative indices, `g`, `o`, `usemtl`, `mtllib`. Vertex colours, smoothing groups, lines, points and
//! free-form geometry are passed over. Numbers follow the file: a vertex index is the position of its `v` line.

use std::collections::{HashMap, HashSet};
use std::io::BufRead;
use std::path::{Path, PathBuf};

use glam::{DVec2, DVec3};

use super::LoadedMesh;
use super::material_library;
use super::source::{self, Notes, refuse_utf16};
use crate::geometry::{Corner, Material, MeshBuilder, NONE};
use crate::{Error, Result};

/// No line of a mesh is as long as this; a file without line ends is not a mesh.
const LONGEST_LINE: u64 = 1 << 26;

/// Reads an OBJ file and the material libraries it names. O(file size) time and memory.
///
/// # Errors
/// [`Error::Io`], or [`Error::Format`] naming the line: a number that is none, a face index that is 0 or out of range, a position that is not
/// finite and used by a face, no face at all.
pub fn read_obj(path: impl AsRef<Path>) -> Result<LoadedMesh> {
    let path = path.as_ref();
    parse_obj(source::open(path)?, path)
}

/// Reads OBJ text from `input`; `path` names it in messages and locates its material libraries.
///
/// # Errors
/// As [`read_obj`].
pub fn parse_obj(input: impl BufRead, path: &Path) -> Result<LoadedMesh> {
    let mut reader = Reader::new(path);
    let mut lines = Lines { input, number: 0, next_number: 1 };
    let mut line = Vec::new();
    while lines.read(&mut line, path)? {
        if reader.line == 0 {
            refuse_utf16(path, &line)?;
        }
        reader.line = lines.number;
        reader.statement(line.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&line))?;
    }
    reader.finish()
}

/// Logical lines: line ends removed, lines ending in a backslash joined with the next.
struct Lines<R> {
    input: R,
    /// Of the first physical line of the last logical one.
    number: usize,
    next_number: usize,
}

impl<R: BufRead> Lines<R> {
    fn read(&mut self, line: &mut Vec<u8>, path: &Path) -> Result<bool> {
        line.clear();
        self.number = self.next_number;
        let mut got = false;
        loop {
            let room = LONGEST_LINE - line.len() as u64;
            let read = std::io::Read::take(&mut self.input, room).read_until(b'\n', line);
            let read = read.map_err(|e| Error::io(path, e, "Check that the file may be read"))?;
            got |= read > 0;
            self.next_number += usize::from(read > 0);
            if read as u64 == room && line.last() != Some(&b'\n') {
                let remedy = "Check that this is an OBJ file";
                return Err(Error::format(path, Some(self.number), "the line does not end", remedy));
            }
            while matches!(line.last(), Some(b'\n' | b'\r')) {
                line.pop();
            }
            if read == 0 || line.last() != Some(&b'\\') {
                return Ok(got);
            }
            line.pop();
            line.push(b' ');
        }
    }
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
    group_index: HashMap<String, u32>,
    material_index: HashMap<String, u32>,
    libraries_read: HashSet<PathBuf>,
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
            group_index: HashMap::new(),
            material_index: HashMap::new(),
            libraries_read: HashSet::new(),
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
                let [x, y, z] = self.numbers(rest, 3, "vertex")?;
                let p = DVec3::new(x, y, z);
                let index = self.next_index(self.builder.mesh.positions.len())?;
                if !p.is_finite() {
                    self.bad_positions.push(NotFinite { index, line: self.line });
                }
                self.builder.mesh.positions.push(p);
            }
            b"vt" => {
                let [u, v, _] = self.numbers(rest, 1, "texture coordinate")?;
                let p = DVec2::new(u, v);
                let index = self.next_index(self.builder.mesh.texcoords.len())?;
                if !p.is_finite() {
                    self.bad_texcoords.push(NotFinite { index, line: self.line });
                }
                self.builder.mesh.texcoords.push(p);
            }
            b"vn" => {
                let [x, y, z] = self.numbers(rest, 3, "normal")?;
                self.next_index(self.builder.mesh.normals.len())?;
                self.builder.mesh.normals.push(DVec3::new(x, y, z));
            }
            b"f" | b"fo" => self.face(rest)?,
            b"g" | b"o" => {
                let name = String::from_utf8_lossy(rest);
                self.builder.group = if name.is_empty() { NONE } else { self.group(&name) };
            }
            b"usemtl" => {
                let name = String::from_utf8_lossy(rest);
                self.builder.material = if name.is_empty() { NONE } else { self.material(&name) };
            }
            b"mtllib" => self.libraries(&String::from_utf8_lossy(rest)),
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

    /// Up to three numbers, at least `least`; what is missing is 0. A number that is none (as `1.#IND`) is NaN where it is spelled so.
    fn numbers(&self, rest: &[u8], least: usize, element: &str) -> Result<[f64; 3]> {
        let mut values = [0.0; 3];
        let mut count = 0;
        for token in tokens(rest).take(3) {
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
        Ok(values)
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

    /// A 1-based or negative index as a 0-based one; [`NONE`] where nothing is written. A positive one may refer to a later line.
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

    fn group(&mut self, name: &str) -> u32 {
        if let Some(&index) = self.group_index.get(name) {
            return index;
        }
        let groups = &mut self.builder.mesh.groups;
        groups.push(name.to_owned());
        let index = groups.len() as u32 - 1;
        self.group_index.insert(name.to_owned(), index);
        index
    }

    fn material(&mut self, name: &str) -> u32 {
        if let Some(&index) = self.material_index.get(name) {
            return index;
        }
        self.notes.say(format!("material {name:?} is not defined by a material library; it has no texture"));
        self.add_material(Material { name: name.to_owned(), ..Material::default() })
    }

    fn add_material(&mut self, material: Material) -> u32 {
        let index = self.builder.mesh.materials.len() as u32;
        self.material_index.insert(material.name.clone(), index);
        self.builder.mesh.materials.push(material);
        index
    }

    /// A name may hold spaces: the whole rest of the line is tried before its words.
    fn libraries(&mut self, names: &str) {
        let whole = source::sibling(self.path, names);
        let files = if whole.is_file() || !names.contains(char::is_whitespace) {
            vec![whole]
        } else {
            names.split_whitespace().map(|n| source::sibling(self.path, n)).collect()
        };
        for file in files {
            if !self.libraries_read.insert(file.clone()) {
                continue;
            }
            match material_library::read(&file, &mut self.notes) {
                Ok(materials) => {
                    for material in materials {
                        if !self.material_index.contains_key(&material.name) {
                            self.add_material(material);
                        }
                    }
                }
                Err(error) => self.notes.say(format!("material library not read: {error}")),
            }
        }
    }

    fn finish(mut self) -> Result<LoadedMesh> {
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
        if !self.builder.has_faces() {
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
        Ok(LoadedMesh { mesh: self.builder.build(), warnings: self.notes.into_warnings() })
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
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<LoadedMesh> {
        parse_obj(text.as_bytes(), Path::new("test.obj"))
    }

    const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

    fn message(text: &str) -> String {
        parse(text).unwrap_err().to_string()
    }

    #[test]
    fn vertex_index_is_the_line_and_faces_are_fans() {
        let text =
            "v 9 9 9\r\nv 0 0 0 1 0 0\r\nv 1 0 0\r\nf 2 3 4 5 # quad\r\nv 1 1 0\r\nv 0 1 0\r\nf -1 -3 \\\r\n -4\r\n";
        let loaded = parse(text).unwrap();
        assert_eq!(loaded.mesh.triangles(), [[1, 2, 3], [1, 3, 4], [4, 2, 1]]);
        assert_eq!((loaded.mesh.vertex_count(), loaded.mesh.polygon_count()), (5, 2));
        assert_eq!(loaded.mesh.positions[1], DVec3::ZERO);
        assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
    }

    #[test]
    fn corners_hold_all_four_forms() {
        let text = format!("{TRIANGLE}vt 0.25 0.5\nvn 0 0 1\nf 1/1 2//1 3/1/1\nf 1/1/ 2// 3\n");
        let mesh = parse(&text).unwrap().mesh;
        let [a, b, c] = mesh.triangle_corners(0);
        assert_eq!([a.texcoord, a.normal, b.texcoord, b.normal, c.texcoord, c.normal], [0, NONE, NONE, 0, 0, 0]);
        assert_eq!(mesh.triangle_texcoords(0), None);
        let [a, b, _] = mesh.triangle_corners(1);
        assert_eq!([a.texcoord, a.normal, b.texcoord, b.normal], [0, NONE, NONE, NONE]);
    }

    #[test]
    fn groups_and_materials_interleave() {
        let text =
            format!("{TRIANGLE}f 1 2 3\ng a\nusemtl m\nf 1 2 3\no b c\nf 1 2 3\ng a\nusemtl\nf 1 2 3\ng\nf 1 2 3");
        let mesh = parse(&text).unwrap().mesh;
        assert_eq!(mesh.groups, ["a", "b c"]);
        let groups: Vec<u32> = (0..5).map(|p| mesh.polygon_group(p)).collect();
        let materials: Vec<u32> = (0..5).map(|p| mesh.polygon_material(p)).collect();
        assert_eq!((groups, materials), (vec![NONE, 0, 1, 0, NONE], vec![NONE, 0, 0, NONE, NONE]));
    }

    #[test]
    fn errors_name_the_line() {
        let cases = [
            (format!("{TRIANGLE}f 1 2 4\n"), "line 4: a face refers to vertex 4, the file has 3"),
            (format!("{TRIANGLE}f 0 1 2\n"), "vertex index 0"),
            (format!("{TRIANGLE}f 1 2 -4\n"), "line 4: a face refers to vertex -4, 3 lie before it"),
            (format!("{TRIANGLE}f 1/1 2/1 3/1\n"), "texture coordinate 1, the file has 0"),
            (format!("{TRIANGLE}f 1 2 x\n"), "no integer"),
            (format!("{TRIANGLE}f 1 2 /3\n"), "not a face corner"),
            (format!("{TRIANGLE}f 1 2 99999999999999999999\n"), "no integer"),
            (format!("{TRIANGLE}f 1 2 9999999999\n"), "vertex 9999999999"),
            ("v 0 0\n".to_owned(), "line 1: a vertex with 2 of 3 numbers"),
            ("v 0 0,5 0\n".to_owned(), "not a number"),
            ("v nan 0 0\nv 1 0 0\nv 0 1 0\n\nf 3 2 1\n".to_owned(), "line 5: the position of vertex 0 (line 1)"),
            ("v 1.#IND 0 0\nv 1 0 0\nv 0 1 0\nf 3 2 1\n".to_owned(), "not finite"),
            (String::new(), "no face"),
            (format!("{TRIANGLE}l 1 2\n"), "no face"),
            ("\u{0}v\u{0} \u{0}0\u{0} \u{0}0".to_owned(), "UTF-16"),
        ];
        for (text, expected) in cases {
            let message = message(&text);
            assert!(message.contains(expected), "{message:?} lacks {expected:?}");
        }
    }

    #[test]
    fn harmless_faults_become_warnings() {
        let text = format!(
            "{TRIANGLE}v inf 0 0\nvt nan 0\nf 1 2\nf\nf 1/1 2/1 3/1\nf 1//7 2//7 3//7\nl 1 2\nmtllib gone.mtl\n"
        );
        let loaded = parse(&text).unwrap();
        assert_eq!(loaded.mesh.triangle_count(), 2);
        assert!(!loaded.mesh.has_texcoords());
        let all = loaded.warnings.join("\n");
        for expected in [
            "three corners were left out: 2, first on line 6",
            "positions that",
            "texture coordinates that",
            "normals",
            "lines and points",
            "gone.mtl",
        ] {
            assert!(all.contains(expected), "{all:?} lacks {expected:?}");
        }
    }
}
