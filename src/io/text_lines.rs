//! Lines of text files, whatever ends them: LF, CR LF, or CR alone; mixed, too.

use std::io::BufRead;
use std::path::Path;

use crate::{Error, Result};

/// No line of a mesh is as long as this; a file without line ends is not a mesh.
const LONGEST_LINE: usize = 1 << 26;

/// The lines of a text with their numbers, from 1.
pub(crate) fn numbered(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let mut rest = Some(text);
    let lines = std::iter::from_fn(move || {
        let text = rest.take()?;
        let Some(end) = text.find(['\n', '\r']) else { return (!text.is_empty()).then_some(text) };
        let length = if text[end..].starts_with("\r\n") { 2 } else { 1 };
        rest = Some(&text[end + length..]);
        Some(&text[..end])
    });
    lines.enumerate().map(|(k, line)| (k + 1, line))
}

/// Number of the line that byte `at` of a text lies in, from 1. O(at).
pub(crate) fn line_at(bytes: &[u8], at: usize) -> usize {
    let before = &bytes[..at.min(bytes.len())];
    let ends = |k: &usize| match before[*k] {
        b'\n' => true,
        // Of CR LF, the second is counted.
        b'\r' => bytes.get(k + 1) != Some(&b'\n'),
        _ => false,
    };
    1 + (0..before.len()).filter(ends).count()
}

/// Statements of an OBJ or MTL file: lines, with those joined that a backslash continues.
#[derive(Debug)]
pub(crate) struct StatementLines<R> {
    input: R,
    /// Of the first line of the last statement.
    pub(crate) number: usize,
    next_number: usize,
}

impl<R: BufRead> StatementLines<R> {
    pub(crate) fn new(input: R) -> Self {
        Self { input, number: 0, next_number: 1 }
    }

    /// Puts the next statement into `line`, without its end; false at the end of the file.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] on a line without end.
    pub(crate) fn read(&mut self, line: &mut Vec<u8>, path: &Path) -> Result<bool> {
        line.clear();
        self.number = self.next_number;
        let mut got = false;
        loop {
            let more = self.physical_line(line, path)?;
            got |= more;
            match continued(line).filter(|_| more) {
                Some(length) => {
                    line.truncate(length);
                    line.push(b' ');
                }
                None => return Ok(got),
            }
        }
    }

    /// Appends a line without its end; false at the end of the file.
    fn physical_line(&mut self, line: &mut Vec<u8>, path: &Path) -> Result<bool> {
        let fault = |e| Error::io(path, e, "Check that the file may be read");
        let mut got = false;
        loop {
            let buffer = self.input.fill_buf().map_err(fault)?;
            if buffer.is_empty() {
                break;
            }
            got = true;
            let end = memchr::memchr2(b'\n', b'\r', buffer);
            let length = end.unwrap_or(buffer.len());
            if line.len() + length > LONGEST_LINE {
                let remedy = "Check that this is an OBJ file";
                return Err(Error::format(path, Some(self.number), "the line does not end", remedy));
            }
            line.extend_from_slice(&buffer[..length]);
            let Some(end) = end else {
                self.input.consume(length);
                continue;
            };
            let return_alone = buffer[end] == b'\r';
            self.input.consume(end + 1);
            if return_alone && self.input.fill_buf().map_err(fault)?.first() == Some(&b'\n') {
                self.input.consume(1);
            }
            break;
        }
        self.next_number += usize::from(got);
        Ok(got)
    }
}

/// Keywords whose statements hold names: their last letter may be a backslash, or a letter of two
/// bytes that ends in one.
const NAMES: [&[u8]; 14] = [
    b"g",
    b"o",
    b"usemtl",
    b"mtllib",
    b"newmtl",
    b"usemap",
    b"maplib",
    b"shadow_obj",
    b"trace_obj",
    b"bump",
    b"disp",
    b"decal",
    b"norm",
    b"refl",
];

/// Whether a statement goes on on the next line: the length of its part before the backslash.
///
/// A comment ends with its line. A backslash at the end of a name belongs to the name unless a
/// blank stands before it.
fn continued(line: &[u8]) -> Option<usize> {
    let before = line.trim_ascii_end().strip_suffix(b"\\")?;
    let mut words = line.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty());
    if words.any(|w| w[0] == b'#') {
        return None;
    }
    let statement = line.trim_ascii_start();
    let keyword = statement.split(u8::is_ascii_whitespace).next().unwrap_or_default();
    let named = NAMES.iter().any(|n| keyword.eq_ignore_ascii_case(n))
        || keyword.get(..4).is_some_and(|k| k.eq_ignore_ascii_case(b"map_"));
    let apart = before.last().is_none_or(u8::is_ascii_whitespace);
    (!named || apart).then_some(before.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn statements(text: &[u8]) -> Vec<(usize, String)> {
        // A small buffer, so that ends lie on its borders.
        let mut lines = StatementLines::new(std::io::BufReader::with_capacity(3, text));
        let (mut line, mut all) = (Vec::new(), Vec::new());
        while lines.read(&mut line, Path::new("x.obj")).unwrap() {
            all.push((lines.number, String::from_utf8_lossy(&line).into_owned()));
        }
        all
    }

    #[test]
    fn all_line_ends_count_once() {
        let expected = [(1, "a"), (2, "bb"), (3, ""), (4, "c"), (5, "d")].map(|(n, l)| (n, l.to_owned()));
        for text in ["a\nbb\n\nc\nd", "a\rbb\r\rc\rd\r", "a\r\nbb\r\n\r\nc\r\nd\r\n", "a\rbb\n\nc\r\nd"] {
            assert_eq!(statements(text.as_bytes()), expected, "{text:?}");
            let numbered: Vec<(usize, String)> = numbered(text).map(|(n, l)| (n, l.to_owned())).collect();
            assert_eq!(numbered, expected, "{text:?}");
            assert_eq!(line_at(text.as_bytes(), text.find('d').unwrap()), 5);
        }
    }

    #[test]
    fn comments_and_names_keep_their_backslash() {
        for (text, expected) in [
            ("f 1 2 \\\n3", &[(1, "f 1 2  3")][..]),
            ("f 1 2 \\ \t\r\n3\nf", &[(1, "f 1 2  3"), (3, "f")]),
            ("f 1\\\n2\\\r3", &[(1, "f 1 2 3")]),
            ("# C:\\dir\\\nf 1", &[(1, "# C:\\dir\\"), (2, "f 1")]),
            ("v 0 0 0 # \\\nf 1", &[(1, "v 0 0 0 # \\"), (2, "f 1")]),
            ("v 1.#IND 0 \\\n0", &[(1, "v 1.#IND 0  0")]),
            ("usemtl a\\\nf 1", &[(1, "usemtl a\\"), (2, "f 1")]),
            ("\tMap_Kd a\\\nf 1", &[(1, "\tMap_Kd a\\"), (2, "f 1")]),
            ("g a \\\nb", &[(1, "g a  b")]),
            ("f 1\\", &[(1, "f 1 ")]),
            ("\\\n\\\n", &[(1, "  ")]),
        ] {
            let expected: Vec<(usize, String)> = expected.iter().map(|(n, l)| (*n, (*l).to_owned())).collect();
            assert_eq!(statements(text.as_bytes()), expected, "{text:?}");
        }
    }
}
