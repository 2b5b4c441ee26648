//! Finding the files that a file refers to.
//!
//! References come from other machines: with other separators, letter cases, folders and encodings,
//! as absolute paths or URLs. A reference is looked up as it is written first. Where nothing is
//! there, the end of its path is looked for beside the referring file, and the caller tells where
//! it was found.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use super::spelling;
use super::texture_name::TextureName;

/// What became of a reference.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Located {
    /// It is where the reference says.
    AsWritten(PathBuf),
    /// It was found elsewhere.
    Elsewhere(PathBuf),
    /// There is no such file; this is where the reference says.
    Missing(PathBuf),
}

impl Located {
    pub(crate) fn path(&self) -> &Path {
        match self {
            Self::AsWritten(path) | Self::Elsewhere(path) | Self::Missing(path) => path,
        }
    }

    pub(crate) fn into_path(self) -> PathBuf {
        match self {
            Self::AsWritten(path) | Self::Elsewhere(path) | Self::Missing(path) => path,
        }
    }

    pub(crate) fn is_missing(&self) -> bool {
        matches!(self, Self::Missing(_))
    }
}

/// Looks up `written`, a reference in `file`. O(entries of the folders on its path).
pub(crate) fn locate(file: &Path, written: &[u8]) -> Located {
    let folder = file.parent().unwrap_or(Path::new(""));
    let local = local_path(written);
    let mut names: Vec<OsString> = raw(&local).into_iter().collect();
    let readings = spelling::readings(&local);
    for reading in &readings {
        // A backslash may be part of a name here and a separator where the reference was written.
        for text in [reading.clone(), reading.replace('\\', "/")] {
            if !names.iter().any(|n| n.as_os_str() == text.as_str()) {
                names.push(text.into());
            }
        }
    }
    if let Some(there) = names.iter().map(|n| folder.join(n)).find(|p| exists(p)) {
        return Located::AsWritten(there);
    }
    let parts: Vec<Vec<String>> = readings.iter().map(|r| components(r)).collect();
    let longest = parts.iter().map(Vec::len).max().unwrap_or(0);
    for skipped in 0..longest {
        for part in parts.iter().filter(|p| skipped < p.len()) {
            if let Some(found) = descend(folder, &part[skipped..]) {
                return Located::Elsewhere(found);
            }
        }
    }
    let name = readings.first().map(|r| r.replace('\\', "/")).unwrap_or_default();
    Located::Missing(folder.join(name))
}

/// A `file:` URL as the path it names; anything else as it is.
fn local_path(written: &[u8]) -> Vec<u8> {
    let Some(rest) = written.get(..5).filter(|s| s.eq_ignore_ascii_case(b"file:")).map(|_| &written[5..]) else {
        return written.to_vec();
    };
    let rest = match rest.strip_prefix(b"//") {
        // An empty host, or one that is a share.
        Some(after) if after.starts_with(b"/") => after,
        Some(after) => after.strip_prefix(b"localhost").unwrap_or(rest),
        None => rest,
    };
    let path = percent_decoded(rest);
    let drive =
        path.first() == Some(&b'/') && path.get(1).is_some_and(u8::is_ascii_alphabetic) && path.get(2) == Some(&b':');
    if drive { path[1..].to_vec() } else { path }
}

/// Replaces `%` and two hexadecimal digits by the byte they stand for.
pub(crate) fn percent_decoded(text: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text;
    while let Some((&first, after)) = rest.split_first() {
        let hex = (first == b'%').then(|| after.get(..2)).flatten();
        let code = hex.and_then(|h| u8::from_str_radix(std::str::from_utf8(h).ok()?, 16).ok());
        bytes.push(code.unwrap_or(first));
        rest = if code.is_some() { &after[2..] } else { after };
    }
    bytes
}

/// The bytes as a name of the file system, where it has names of bytes.
#[cfg(unix)]
fn raw(name: &[u8]) -> Option<OsString> {
    Some(std::os::unix::ffi::OsStringExt::from_vec(name.to_vec()))
}

/// The bytes as a name of the file system, where it has names of bytes.
#[cfg(not(unix))]
fn raw(_name: &[u8]) -> Option<OsString> {
    None
}

/// The bytes of a path for a text file: as they are where the file system has names of bytes.
/// Separators are `/`.
pub(crate) fn path_bytes(path: &Path) -> Vec<u8> {
    #[cfg(unix)]
    {
        std::os::unix::ffi::OsStrExt::as_bytes(path.as_os_str()).to_vec()
    }
    #[cfg(not(unix))]
    {
        path.to_string_lossy().replace('\\', "/").into_bytes()
    }
}

/// Whether a file of this name is there; of a name with a place for tiles, any of them.
fn exists(path: &Path) -> bool {
    let text = path.to_string_lossy();
    let name = TextureName::new(text.as_ref());
    if !name.has_tile() {
        return path.is_file();
    }
    let (Some(folder), Some(pattern)) = (path.parent(), path.file_name()) else { return false };
    let pattern = TextureName::new(pattern.to_string_lossy());
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    entries(folder).iter().any(|entry| pattern.matches_tile(&entry.to_string_lossy()))
}

/// The parts of a path as another machine may have written it, without its root and steps upwards.
fn components(path: &str) -> Vec<String> {
    let kept = |part: &&str| !part.is_empty() && !matches!(*part, "." | "..") && !part.ends_with(':');
    path.split(['/', '\\']).filter(kept).map(str::to_owned).collect()
}

/// The file below `folder` that `parts` name, with letter case passed over where nothing is there
/// otherwise.
fn descend(folder: &Path, parts: &[String]) -> Option<PathBuf> {
    let (last, folders) = parts.split_last()?;
    let mut at = folder.to_path_buf();
    for part in folders {
        let direct = at.join(part);
        at = if direct.is_dir() { direct } else { at.join(alike(&at, part)?) };
    }
    let direct = at.join(last);
    if exists(&direct) {
        return Some(direct);
    }
    let name = TextureName::new(last.as_str());
    if name.has_tile() {
        return None;
    }
    Some(at.join(alike(&at, last)?)).filter(|found| found.is_file())
}

/// The first entry of a folder, in the order of names, that differs from `name` by letter case
/// alone.
fn alike(folder: &Path, name: &str) -> Option<OsString> {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let wanted = name.to_lowercase();
    entries(folder).into_iter().find(|entry| entry.to_str().is_some_and(|e| e.to_lowercase() == wanted))
}

/// Names in a folder, sorted.
fn entries(folder: &Path) -> Vec<OsString> {
    let Ok(read) = std::fs::read_dir(folder) else { return Vec::new() };
    let mut names: Vec<OsString> = read.flatten().map(|entry| entry.file_name()).collect();
    names.sort_unstable();
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder with some files, and a mesh file to look from.
    fn folder(files: &[&[u8]]) -> (tempfile::TempDir, PathBuf) {
        let dir = tempfile::tempdir().unwrap();
        for name in files {
            let path = dir.path().join(raw(name).unwrap());
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, b"").unwrap();
        }
        let file = dir.path().join("mesh.mtl");
        (dir, file)
    }

    #[test]
    fn references_as_written_come_first() {
        let (dir, file) = folder(&[b"t.png", b"sub/t.png", b"T.PNG", b"100%25.png"]);
        for (written, there) in [
            ("t.png", "t.png"),
            ("sub/t.png", "sub/t.png"),
            (".\\sub\\t.png", "./sub/t.png"),
            ("T.PNG", "T.PNG"),
            ("100%25.png", "100%25.png"),
        ] {
            let found = locate(&file, written.as_bytes());
            assert_eq!(found, Located::AsWritten(dir.path().join(there)), "{written}");
        }
        let absolute = dir.path().join("t.png");
        assert_eq!(locate(&file, path_bytes(&absolute).as_slice()), Located::AsWritten(absolute));
    }

    #[test]
    fn paths_of_other_machines_are_found_by_their_end() {
        let (dir, file) = folder(&[b"t.png", b"maps/Skin.PNG", b"my tex.png", b"d.1001.png"]);
        for (written, there) in [
            ("C:\\Users\\someone\\t.png", "t.png"),
            ("/home/someone/t.png", "t.png"),
            ("\\\\server\\share\\maps\\skin.png", "maps/Skin.PNG"),
            ("file:///D:/art/my%20tex.png", "my tex.png"),
            ("file://server/art/my%20tex.png", "my tex.png"),
            ("../elsewhere/T.png", "t.png"),
            ("X:/d.<UDIM>.png", "d.<UDIM>.png"),
        ] {
            let found = locate(&file, written.as_bytes());
            assert_eq!(found, Located::Elsewhere(dir.path().join(there)), "{written}");
        }
        for written in ["gone.png", "C:\\gone.png", "", "..", "maps", "e.<UDIM>.png"] {
            assert!(locate(&file, written.as_bytes()).is_missing(), "{written}");
        }
    }

    #[test]
    #[cfg(unix)]
    fn names_in_other_encodings_are_found_by_bytes_and_by_letters() {
        let (dir, file) = folder(&[b"K\xf6.png", "Fü.png".as_bytes(), b"\x95\x5c.png", "ソ.png".as_bytes()]);
        for (written, there) in [
            (&b"K\xf6.png"[..], &b"K\xf6.png"[..]),
            (b"F\xfc.png", "Fü.png".as_bytes()),
            (b"\x95\x5c.png", b"\x95\x5c.png"),
            (b"\x83\x5c.png", "ソ.png".as_bytes()),
        ] {
            assert_eq!(locate(&file, written), Located::AsWritten(dir.path().join(raw(there).unwrap())));
        }
        let found = locate(&file, b"C:\\art\\f\xfc.png");
        assert_eq!(found, Located::Elsewhere(dir.path().join("Fü.png")));
    }
}
