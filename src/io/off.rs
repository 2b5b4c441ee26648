//! Object File Format (OFF), the text form with the prefixes `ST`, `C`, `N` and `4`.

use std::path::Path;

use glam::{DVec2, DVec3};

use super::LoadedMesh;
use super::assemble;
use super::obj::{parse_number, shortened};
use super::source::{self, Notes};
use super::text_lines::numbered;
use super::vertex_colors;
use crate::geometry::{Corner, MeshBuilder, NONE};
use crate::{Error, Result};

/// Reads an OFF file: positions, faces, after a `C` in the prefix colours of vertices, and after
/// `ST` texture coordinates. Colours of faces and normals are passed over.
///
/// # Errors
/// [`Error::Io`], or [`Error::Format`] naming the line.
pub fn read_off(path: impl AsRef<Path>) -> Result<LoadedMesh> {
    let path = path.as_ref();
    parse_off(&source::read_all(path)?, path)
}

/// Reads OFF content; `path` names it in messages.
///
/// # Errors
/// As [`read_off`].
pub fn parse_off(bytes: &[u8], path: &Path) -> Result<LoadedMesh> {
    source::refuse_utf16(path, bytes)?;
    let text = String::from_utf8_lossy(bytes);
    let mut lines = numbered(text.trim_start_matches('\u{feff}'))
        .map(|(k, line)| (k, line.split('#').next().unwrap_or_default().trim()))
        .filter(|(_, line)| !line.is_empty())
        .peekable();
    let remedy = "Check that this is a text OFF file, or export the mesh again";
    let fail = |line: Option<usize>, what: String| Error::format(path, line, what, remedy);
    let ended = |what: &str| fail(None, format!("the file ends before its {what}"));

    // The keyword may be missing, or stand on the line of the counts.
    let (line, first) = *lines.peek().ok_or_else(|| ended("counts"))?;
    let (word, rest) = first.split_once(char::is_whitespace).unwrap_or((first, ""));
    let mut has_texcoords = false;
    // Where the colours of a vertex begin.
    let mut colors_at = None;
    let mut counts = first;
    if let Some(prefix) = word.strip_suffix("OFF") {
        let known = prefix.replacen("ST", "", 1).replacen('C', "", 1).replacen('N', "", 1).replacen('4', "", 1);
        if !known.is_empty() || rest.trim_start().starts_with("BINARY") {
            return Err(fail(Some(line), format!("the variant {:?} is not read", shortened(first))));
        }
        has_texcoords = prefix.contains("ST");
        let bare = prefix.replacen("ST", "", 1);
        colors_at =
            bare.contains('C').then_some(3 + usize::from(bare.contains('4')) + 3 * usize::from(bare.contains('N')));
        counts = rest.trim();
        if counts.is_empty() {
            lines.next();
            counts = lines.peek().ok_or_else(|| ended("counts"))?.1;
        }
    }
    let (line, _) = lines.next().ok_or_else(|| ended("counts"))?;
    let mut numbers = counts.split_whitespace().map(str::parse::<u32>);
    let (Some(Ok(vertices)), Some(Ok(faces))) = (numbers.next(), numbers.next()) else {
        return Err(fail(Some(line), format!("{:?} are not the counts of vertices and faces", shortened(counts))));
    };

    let mut builder = MeshBuilder::new(path.display().to_string());
    let mut notes = Notes::default();
    let mut values = Vec::new();
    let mut colors: Vec<([f64; 4], u8)> = Vec::new();
    for k in 0..vertices {
        let (line, text) = lines.next().ok_or_else(|| ended(&format!("vertex {k} of {vertices}")))?;
        values.clear();
        for word in text.split_whitespace() {
            let number = parse_number(word);
            values.push(number.ok_or_else(|| fail(Some(line), format!("{:?} is not a number", shortened(word))))?);
        }
        if values.len() < 3 + 2 * usize::from(has_texcoords) {
            return Err(fail(Some(line), format!("vertex {k} has only {} numbers", values.len())));
        }
        builder.mesh.positions.push(DVec3::new(values[0], values[1], values[2]));
        if let Some(color) = colors_at.and_then(|at| values.get(at..values.len() - 2 * usize::from(has_texcoords))) {
            let mut numbers = [0.0; 4];
            let count = color.len().min(4);
            numbers[..count].copy_from_slice(&color[..count]);
            colors.push((numbers, count as u8));
        }
        if let [.., u, v] = values[..]
            && has_texcoords
        {
            builder.mesh.texcoords.push(DVec2::new(u, v));
        }
    }
    if let Some(colors) = vertex_colors::of_rows(&colors).filter(|c| c.values.len() == vertices as usize * c.channels) {
        builder.mesh.colors = colors.rgba();
        colors.note.into_iter().for_each(|note| notes.say(note));
    }
    for k in 0..faces {
        let (line, text) = lines.next().ok_or_else(|| ended(&format!("face {k} of {faces}")))?;
        let mut words = text.split_whitespace();
        let count = words.next().and_then(|w| w.parse::<usize>().ok());
        let mut corners = Vec::new();
        for word in words.take(count.unwrap_or(0)) {
            let index = word.parse::<u32>().ok().filter(|v| *v < vertices).ok_or_else(|| {
                fail(Some(line), format!("{:?} is not one of the {vertices} vertices", shortened(word)))
            })?;
            corners.push(Corner { vertex: index, texcoord: if has_texcoords { index } else { NONE }, normal: NONE });
        }
        if count != Some(corners.len()) {
            return Err(fail(Some(line), format!("face {k} is not a count and that many vertices")));
        }
        if corners.len() < 3 {
            notes.count("faces with fewer than three corners were left out", Some(line));
            continue;
        }
        builder.polygon(corners);
    }
    assemble::finish(builder, notes, path)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<LoadedMesh> {
        parse_off(text.as_bytes(), Path::new("test.off"))
    }

    #[test]
    fn header_variants() {
        let body = "0 0 0\n1 0 0 # comment\n\n1 1 0\n0 1 0\n4 0 1 2 3 255 0 0\n2 0 1\n3 3 2 1\n";
        for head in [
            "OFF\n4 3 0\n",
            "OFF 4 3 6\n",
            "# made\nOFF\n\n# counts\n4 3\n",
            "4 3 0\n",
            "COFF\r\n4 3 0\r\n",
            "OFF\r4 3 0\r",
            "NOFF\n4 3 0\n",
        ] {
            let loaded = parse(&format!("{head}{body}")).unwrap();
            assert_eq!(loaded.mesh.triangles(), [[0, 1, 2], [0, 2, 3], [3, 2, 1]], "{head}");
            assert_eq!(loaded.warnings.len(), 1);
        }
        let colored =
            parse("STCOFF\n3 1 0\n0 0 0 255 0 51 255 0 1\n1 0 0 0 0 0 255 0 0\n0 1 0 0 0 0 0 1 1\n3 0 1 2 9 9 9")
                .unwrap();
        assert_eq!(colored.mesh.colors, [[1.0, 0.0, 0.2, 1.0], [0.0, 0.0, 0.0, 1.0], [0.0; 4]]);
        assert_eq!((colored.warnings.len(), colored.mesh.texcoords[0]), (1, DVec2::new(0.0, 1.0)));
        let with_uv = parse("STOFF\n3 1 0\n0 0 0 0 1\n1 0 0 0.5 0.25\n0 1 0 1 1\n3 0 1 2").unwrap().mesh;
        assert_eq!(with_uv.triangle_texcoords(0).unwrap()[1], DVec2::new(0.5, 0.25));
    }

    #[test]
    fn faults_name_the_line() {
        for (text, expected) in [
            ("", "counts"),
            ("OFF", "counts"),
            ("OFF BINARY\n", "variant"),
            ("nOFF\n3\n", "variant"),
            ("OFF\n-3 1 0\n", "line 2"),
            ("OFF\n4000000000 1 0\n0 0 0", "ends before its vertex 1 of"),
            ("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3", "line 6: \"3\" is not one of the 3"),
            ("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1", "line 6: face 0"),
            ("OFF\n3 1 0\n0 0 0\n1 0 0\n0 nan 0\n3 0 1 2", "vertex 2 is not finite"),
            ("OFF\n3 1 0\n0 0 0\n1 0\n0 1 0\n3 0 1 2", "line 4: vertex 1"),
            ("OFF\n3 4000000000 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2", "face 1 of"),
        ] {
            let message = parse(text).unwrap_err().to_string();
            assert!(message.contains(expected), "{text:?}: {message:?} lacks {expected:?}");
        }
    }
}
