//! Names in an OBJ file: groups, and materials that are found in libraries once the whole file is
//! read.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use crate::geometry::{Material, MeshBuilder, NONE};
use crate::io::locate::{Located, locate};
use crate::io::material_library::{self, LibraryMaterial};
use crate::io::source::Notes;
use crate::io::spelling::{self, Spellings};
use crate::{Error, Result};

/// A material as the faces refer to it: by name, at a place among the statements that name
/// libraries.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct Use {
    name: Vec<u8>,
    /// Library statements before it.
    before: usize,
}

/// A library's material: number of the library, place in it.
type Entry = (usize, usize);

/// What the names of a file stand for. Names are bytes: see [`spelling`].
#[derive(Debug, Default)]
pub(super) struct Names {
    groups: Vec<Vec<u8>>,
    group_index: HashMap<(Vec<u8>, bool), u32>,
    uses: Vec<Use>,
    use_index: HashMap<Use, u32>,
    libraries: Vec<Vec<LibraryMaterial>>,
    library_index: HashMap<PathBuf, usize>,
    /// The libraries of each `mtllib`.
    statements: Vec<Vec<usize>>,
}

impl Names {
    /// Index of a group, or of an object, by its name; [`NONE`] without a name.
    pub(super) fn group(&mut self, name: &[u8], object: bool) -> u32 {
        if name.is_empty() {
            return NONE;
        }
        let next = self.groups.len() as u32;
        let index = *self.group_index.entry((name.to_vec(), object)).or_insert(next);
        if index == next {
            self.groups.push(name.to_vec());
        }
        index
    }

    /// Number of a material that faces use, to be resolved by [`Names::finish`]; [`NONE`] without a
    /// name.
    pub(super) fn material(&mut self, name: &[u8]) -> u32 {
        if name.is_empty() {
            return NONE;
        }
        let used = Use { name: name.to_vec(), before: self.statements.len() };
        let next = self.uses.len() as u32;
        let index = *self.use_index.entry(used.clone()).or_insert(next);
        if index == next {
            self.uses.push(used);
        }
        index
    }

    /// Reads the libraries of a `mtllib` statement.
    ///
    /// # Errors
    /// [`Error::Option`] if one of them is to be overwritten; other faults become notes.
    pub(super) fn libraries(&mut self, file: &Path, names: &[u8], notes: &mut Notes) -> Result<()> {
        let mut statement = Vec::new();
        for (name, found) in library_files(file, names) {
            if let Located::Elsewhere(path) = &found {
                let name = String::from_utf8_lossy(&name);
                notes.say(format!("material library {name}: taken from {}", path.display()));
            }
            if let Located::Outside(_) = &found {
                notes.outside("material library", &String::from_utf8_lossy(&name));
                continue;
            }
            let path = found.into_path();
            if let Some(&known) = self.library_index.get(&path) {
                statement.push(known);
                continue;
            }
            match material_library::read(&path, notes) {
                Ok(materials) => {
                    self.library_index.insert(path, self.libraries.len());
                    statement.push(self.libraries.len());
                    self.libraries.push(materials);
                }
                // What is to be overwritten is no fault of the library.
                Err(error @ Error::Option { .. }) => return Err(error),
                Err(error) => notes.say(format!("material library not read: {error}")),
            }
        }
        self.statements.push(statement);
        Ok(())
    }

    /// The material that a use means: that of the last `mtllib` before it, then of those before
    /// that one, then of later ones; within a statement the first library that has it (as the
    /// format says). Spelt alike first, else alike without quotation marks and comments.
    fn resolve(&self, used: &Use) -> Option<Entry> {
        let before = (0..used.before.min(self.statements.len())).rev();
        let order: Vec<usize> = before.chain(used.before..self.statements.len()).collect();
        let find = |alike: &dyn Fn(&[u8]) -> bool| {
            let libraries = order.iter().flat_map(|&s| &self.statements[s]);
            libraries.into_iter().find_map(|&l| Some((l, self.libraries[l].iter().position(|m| alike(&m.name))?)))
        };
        let plain = plain_name(&used.name);
        find(&|name| name == used.name)
            .or_else(|| find(&|name| name == plain))
            .or_else(|| find(&|name| plain_name(name) == plain))
    }

    /// Gives the mesh its groups and materials. All materials of the libraries come first, in file
    /// order, those of one name once unless faces mean both; then what no library defines.
    pub(super) fn finish(self, builder: &mut MeshBuilder, notes: &mut Notes) {
        let resolved: Vec<Option<Entry>> = self.uses.iter().map(|u| self.resolve(u)).collect();
        let library_names = self.libraries.iter().flatten().map(|m| m.name.as_slice());
        let all = library_names.chain(self.uses.iter().map(|u| u.name.as_slice()));
        let encoding = spelling::guess(all.chain(self.groups.iter().map(Vec::as_slice)));
        let mut spellings = Spellings::new(encoding);
        builder.mesh.groups = self.groups.iter().map(|g| spellings.text(g)).collect();

        let mut users: HashMap<Entry, Vec<&Use>> = HashMap::new();
        for (used, entry) in self.uses.iter().zip(&resolved) {
            if let Some(entry) = entry {
                users.entry(*entry).or_default().push(used);
            }
        }
        let mut place: HashMap<Entry, u32> = HashMap::new();
        let mut of_name: HashMap<Vec<u8>, u32> = HashMap::new();
        let mut files: Vec<(&PathBuf, &usize)> = self.library_index.iter().collect();
        files.sort_by_key(|f| f.1);
        builder.mesh.libraries = files.into_iter().map(|f| f.0.clone()).collect();
        let materials = &mut builder.mesh.materials;
        for (l, library) in self.libraries.iter().enumerate() {
            for (k, entry) in library.iter().enumerate() {
                let wanted = users.get(&(l, k)).map_or(&[][..], Vec::as_slice);
                let next = materials.len() as u32;
                let known = *of_name.entry(entry.name.clone()).or_insert(next);
                if known != next {
                    if wanted.is_empty() || same_look(&materials[known as usize], &entry.material) {
                        place.insert((l, k), known);
                        continue;
                    }
                    let name = spellings.text(plain_name(&entry.name));
                    notes.say(format!("material {name:?} is defined twice: faces show the definition of their mtllib"));
                }
                // Its whole line is the name if faces spell it so; else a comment or quotation
                // marks stand beside it.
                let whole = wanted.iter().any(|u| u.name == entry.name);
                let name = spellings.text(if whole { &entry.name } else { plain_name(&entry.name) });
                place.insert((l, k), next);
                materials.push(Material { name, ..entry.material.clone() });
            }
        }
        let of_use: Vec<u32> = (self.uses.iter().zip(&resolved))
            .map(|(used, found)| match found {
                Some(entry) => place[entry],
                None => *of_name.entry(plain_name(&used.name).to_vec()).or_insert_with(|| {
                    let name = spellings.text(plain_name(&used.name));
                    notes.say(format!("material {name:?} is not defined by a material library; it has no texture"));
                    materials.push(Material { name, ..Material::default() });
                    materials.len() as u32 - 1
                }),
            })
            .collect();
        builder.map_materials(|m| of_use[m as usize]);
        builder.mesh.spellings = spellings.into_bytes().collect();
    }
}

/// Whether two definitions say the same beside their name and comments.
fn same_look(a: &Material, b: &Material) -> bool {
    let plain = |m: &Material| {
        let mut m = Material { name: String::new(), ..m.clone() };
        m.statements.retain(|s| !s.text.starts_with(b"#"));
        m
    };
    plain(a) == plain(b)
}

/// A name without the quotation marks around it and the comment behind it.
fn plain_name(name: &[u8]) -> &[u8] {
    if let Some(end) = name.strip_prefix(b"\"").and_then(|rest| rest.iter().position(|b| *b == b'"')) {
        return &name[1..1 + end];
    }
    match comment_start(name) {
        Some(at) if !name[..at].trim_ascii().is_empty() => name[..at].trim_ascii(),
        _ => name,
    }
}

/// Where a comment begins: at a `#` that begins a word.
pub(in crate::io) fn comment_start(text: &[u8]) -> Option<usize> {
    (1..text.len()).find(|&k| text[k] == b'#' && text[k - 1].is_ascii_whitespace())
}

/// The files of a `mtllib` statement: in quotation marks, or as many words as name a file, the most
/// that do.
fn library_files(file: &Path, names: &[u8]) -> Vec<(Vec<u8>, Located)> {
    let mut files = Vec::new();
    let mut rest = names.trim_ascii();
    while !rest.is_empty() {
        if let Some(end) = rest.strip_prefix(b"\"").and_then(|r| r.iter().position(|b| *b == b'"')) {
            let name = &rest[1..1 + end];
            files.push((name.to_vec(), locate(file, name)));
            rest = rest[end + 2..].trim_ascii();
            continue;
        }
        // Ends of the words, the farthest first.
        let mut ends: Vec<usize> = (1..rest.len())
            .filter(|&k| rest[k].is_ascii_whitespace() && !rest[k - 1].is_ascii_whitespace())
            .chain([rest.len()])
            .collect();
        ends.reverse();
        // More words than this are several names.
        let most = ends.len().saturating_sub(32);
        let there = ends[most..].iter().map(|&end| (end, locate(file, &rest[..end]))).find(|(_, l)| !l.is_missing());
        let (end, found) = there.unwrap_or_else(|| {
            // A missing file reaches to the first ending of its kind, or takes all of the line.
            let ending = |end: &&usize| rest[..**end].to_ascii_lowercase().ends_with(b".mtl");
            let comment = comment_start(rest).unwrap_or(rest.len());
            let end = ends.iter().rev().find(ending).copied().unwrap_or(comment);
            (end, locate(file, rest[..end].trim_ascii()))
        });
        files.push((rest[..end].trim_ascii().to_vec(), found));
        rest = rest[end..].trim_ascii();
        if rest.first() == Some(&b'#') {
            break;
        }
    }
    files
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_stand_beside_marks_and_comments() {
        for (name, plain) in [
            ("skin", "skin"),
            ("\"my skin\"", "my skin"),
            ("\"my skin\" # of a cat", "my skin"),
            ("skin # of a cat", "skin"),
            ("a\t#b", "a"),
            ("mat#1", "mat#1"),
            ("#1", "#1"),
            ("\"open", "\"open"),
        ] {
            assert_eq!(String::from_utf8_lossy(plain_name(name.as_bytes())), plain, "{name}");
        }
    }

    #[test]
    fn a_statement_names_several_libraries() {
        let dir = tempfile::tempdir().unwrap();
        for name in ["a.mtl", "my lib.mtl", "b c d.mtl", "#1.mtl"] {
            std::fs::write(dir.path().join(name), "").unwrap();
        }
        let file = dir.path().join("x.obj");
        let names = |line: &str| {
            let names: Vec<String> = library_files(&file, line.as_bytes())
                .into_iter()
                .map(|(name, found)| {
                    let mark = if found.is_missing() { "!" } else { "" };
                    format!("{}{mark}", String::from_utf8_lossy(&name))
                })
                .collect();
            names.join("|")
        };
        assert_eq!(names("a.mtl"), "a.mtl");
        assert_eq!(names("my lib.mtl a.mtl"), "my lib.mtl|a.mtl");
        assert_eq!(names("a.mtl\tmy lib.mtl  b c d.mtl"), "a.mtl|my lib.mtl|b c d.mtl");
        assert_eq!(names("\"my lib.mtl\" \"a.mtl\""), "my lib.mtl|a.mtl");
        assert_eq!(names("gone one.mtl a.mtl gone"), "gone one.mtl!|a.mtl|gone!");
        assert_eq!(names("a.mtl # and b.mtl"), "a.mtl");
        assert_eq!(names("gone # really"), "gone!");
        assert_eq!(names("#1.mtl"), "#1.mtl");
        assert_eq!(names(""), "");
    }
}
