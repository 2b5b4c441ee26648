//! What the readers share: opening files, telling text from UTF-16, counting what was passed over.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use super::locate::Located;
use super::{kept, open};
use crate::{Error, Result};

/// Opens an input, as [`open::open`].
pub(crate) fn open(path: &Path) -> Result<BufReader<File>> {
    kept::reading(path)?;
    open::open(path)
}

/// The bytes of an input.
pub(crate) fn read_all(path: &Path) -> Result<Vec<u8>> {
    kept::reading(path)?;
    open::read_all(path)
}

/// The text of a file that is UTF-8, with a byte order mark removed.
pub(crate) fn read_text(path: &Path) -> Result<String> {
    let bytes = read_all(path)?;
    refuse_utf16(path, &bytes)?;
    let text = String::from_utf8(bytes).map_err(|e| {
        let line = 1 + e.as_bytes()[..e.utf8_error().valid_up_to()].iter().filter(|b| **b == b'\n').count();
        Error::format(path, Some(line), "this is not UTF-8 text", "Name a text file, or save it as UTF-8")
    })?;
    Ok(text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text))
}

/// Fails with a clear message on UTF-16 text, told by its byte order mark or by zero bytes in every
/// other place.
pub(crate) fn refuse_utf16(path: &Path, head: &[u8]) -> Result<()> {
    let marked = head.starts_with(&[0xfe, 0xff]) || head.starts_with(&[0xff, 0xfe]);
    let pairs = head[..head.len().min(64)].chunks_exact(2);
    let alternating = head.len() >= 8 && {
        let (mut even, mut odd) = (true, true);
        for pair in pairs {
            even &= pair[0] == 0 && pair[1] != 0;
            odd &= pair[0] != 0 && pair[1] == 0;
        }
        even || odd
    };
    if marked || alternating {
        return Err(Error::format(
            path,
            None,
            "the text is encoded in UTF-16",
            "Save the file as UTF-8 or plain ASCII",
        ));
    }
    Ok(())
}

/// Things passed over while reading, each kind told once with its count and first line.
#[derive(Debug, Default)]
pub(crate) struct Notes {
    kinds: Vec<(&'static str, usize, Option<usize>)>,
    texts: Vec<String>,
    /// Sentences beyond those.
    more: usize,
}

impl Notes {
    /// Counts one occurrence of `what`.
    pub(crate) fn count(&mut self, what: &'static str, line: Option<usize>) {
        match self.kinds.iter_mut().find(|k| k.0 == what) {
            Some(kind) => kind.1 += 1,
            None => self.kinds.push((what, 1, line)),
        }
    }

    /// Adds a sentence; after twenty there is no more to learn from another.
    pub(crate) fn say(&mut self, text: String) {
        match self.texts.len() {
            0..20 if !self.texts.contains(&text) => self.texts.push(text),
            20 => self.more += 1,
            _ => {}
        }
    }

    /// Tells where a texture was found that is not where the file says, or that there is none.
    pub(crate) fn texture(&mut self, written: &[u8], found: &Located) {
        match found {
            Located::AsWritten(_) => {}
            Located::Elsewhere(path) => self.say(format!(
                "the texture {} is not there; {} is taken",
                String::from_utf8_lossy(written),
                path.display()
            )),
            Located::Missing(path) => self.say(format!("the texture {} does not exist", path.display())),
            Located::Outside(_) => self.outside("texture", &String::from_utf8_lossy(written)),
        }
    }

    /// Tells of a reference that the work is not allowed to follow.
    pub(crate) fn outside(&mut self, what: &str, written: &str) {
        self.say(format!("the {what} {written} lies outside the folder of the file that names it and is not read"));
    }

    /// All sentences.
    pub(crate) fn into_warnings(self) -> Vec<String> {
        let counted = self.kinds.into_iter().map(|(what, count, line)| match line {
            Some(line) => format!("{what}: {count}, first on line {line}"),
            None => format!("{what}: {count}"),
        });
        let more = (self.more > 0).then(|| format!("and {} more of the kind", self.more));
        self.texts.into_iter().chain(more).chain(counted).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn utf16_is_noticed_with_and_without_a_mark() {
        let utf16: Vec<u8> = "v 0 0 0\nv 1 0 0\n".encode_utf16().flat_map(u16::to_be_bytes).collect();
        assert!(refuse_utf16(Path::new("x"), &utf16).unwrap_err().to_string().contains("UTF-16"));
        let swapped: Vec<u8> = utf16.chunks(2).flat_map(|p| [p[1], p[0]]).collect();
        assert!(refuse_utf16(Path::new("x"), &swapped).is_err());
        assert!(refuse_utf16(Path::new("x"), &[0xff, 0xfe]).is_err());
        assert!(refuse_utf16(Path::new("x"), b"v 0 0 0\nv 1 0 0\n").is_ok());
        assert!(refuse_utf16(Path::new("x"), b"").is_ok());
    }

    #[test]
    fn notes_count_by_kind() {
        let mut notes = Notes::default();
        notes.count("lines left out", Some(7));
        notes.count("lines left out", Some(9));
        (0..23).for_each(|k| notes.say(format!("texture {} is not there", k % 23)));
        let warnings = notes.into_warnings();
        assert_eq!(warnings.len(), 22);
        assert_eq!(warnings[20..], ["and 3 more of the kind", "lines left out: 2, first on line 7"]);
    }
}
