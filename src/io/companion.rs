//! Files that appear beside an output without having been named: material libraries and textures.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use super::{open, output};
use crate::{Error, Result};

/// What becomes of a file that has the name a companion would have.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[doc(hidden)]
pub enum Taken {
    /// It stays; the companion gets a name that is free.
    #[default]
    Stays,
    /// It is overwritten.
    Overwritten,
}

/// The files beside an output that it refers to.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[doc(hidden)]
pub struct Companions {
    /// Those that were written, in their order.
    pub written: Vec<PathBuf>,
    /// Pairs of a name that was taken and the one that was written instead.
    pub renamed: Vec<(PathBuf, PathBuf)>,
    /// Material libraries of the source, which are as they were.
    pub referred: Vec<PathBuf>,
}

impl Companions {
    /// Writes `bytes` to `wanted`, or under a name that is free; returns where. A file that holds
    /// these bytes already is left alone. O(files of such names).
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be written, or no name is free.
    pub(crate) fn write(&mut self, wanted: &Path, bytes: &[u8], taken: Taken) -> Result<PathBuf> {
        let holds = |path: &Path| open::read_all(path).is_ok_and(|there| there == bytes);
        let free = |path: &Path| !path.exists() && !path.is_symlink();
        let numbered = (1u32..MOST).map(|n| with_number(wanted, n));
        let place = match taken {
            Taken::Overwritten => Some(wanted.to_path_buf()),
            Taken::Stays => std::iter::once(wanted.to_path_buf()).chain(numbered).find(|p| free(p) || holds(p)),
        };
        let Some(place) = place else {
            let what = std::io::Error::new(std::io::ErrorKind::AlreadyExists, "no name like this one is free");
            return Err(Error::io(wanted, what, "Name an output in another folder"));
        };
        if free(&place) || !holds(&place) {
            output::write_bytes(&place, bytes)?;
        }
        if place != wanted {
            self.renamed.push((wanted.to_path_buf(), place.clone()));
        }
        self.written.push(place.clone());
        Ok(place)
    }
}

/// Names that are tried.
const MOST: u32 = 10_000;

/// `out.mtl` as `out_1.mtl`.
fn with_number(path: &Path, n: u32) -> PathBuf {
    let mut name = OsString::from(path.file_stem().unwrap_or_default());
    name.push(format!("_{n}"));
    if let Some(extension) = path.extension() {
        name.push(".");
        name.push(extension);
    }
    path.with_file_name(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_there_stays_unless_told_otherwise() {
        let dir = tempfile::tempdir().unwrap();
        let wanted = dir.path().join("a.b.mtl");
        std::fs::write(&wanted, "by hand").unwrap();
        let write = |text: &str, taken: Taken| {
            let mut companions = Companions::default();
            let place = companions.write(&wanted, text.as_bytes(), taken).unwrap();
            assert_eq!(std::fs::read_to_string(&place).unwrap(), text);
            assert_eq!(companions.renamed.len(), usize::from(place != wanted));
            place.file_name().unwrap().to_str().unwrap().to_owned()
        };
        assert_eq!(write("new", Taken::Stays), "a.b_1.mtl");
        // What is there already is written once.
        assert_eq!(write("new", Taken::Stays), "a.b_1.mtl");
        assert_eq!(write("other", Taken::Stays), "a.b_2.mtl");
        assert_eq!(write("by hand", Taken::Stays), "a.b.mtl");
        assert_eq!(write("other", Taken::Overwritten), "a.b.mtl");
    }
}
