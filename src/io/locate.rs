//! Finding the files that a file refers to.
//!
//! References come from other machines: with other separators, letter cases, folders and encodings,
//! as absolute paths or URLs. A reference is looked up as it is written first. Where nothing is
//! there, the end of its path is looked for beside the referring file, and the caller tells where
//! it was found. Work inside [`confined`] finds files beside the referring one and below only.

use std::cell::Cell;
use std::ffi::OsString;
use std::path::{Component, Path, PathBuf};

use super::spelling;
use super::texture_name::TextureName;

thread_local! {
    /// Whether this thread keeps to the folders of referring files.
    static CONFINED: Cell<bool> = const { Cell::new(false) };
}

/// Runs `work` so that files which other files name (material libraries, textures, buffers, the
/// meshes of a list) are read only if they lie in the folder of the file that names them, or below
/// it; links that lead elsewhere count as elsewhere. What `work` names itself is read wherever it
/// lies. For files of others, as in a service. Readers look for references on the thread that
/// calls them.
///
/// ```
/// let dir = std::env::temp_dir();
/// # let dir = dir.join(format!("barymap-confined-{}", std::process::id()));
/// # std::fs::create_dir_all(&dir)?;
/// let path = dir.join("m.obj");
/// std::fs::write(&path, "mtllib /etc/hostname\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")?;
/// let mesh = barymap::io::confined(|| barymap::io::read_mesh(&path))?;
/// assert!(mesh.warnings[0].contains("outside"));
/// # std::fs::remove_dir_all(&dir)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn confined<T>(work: impl FnOnce() -> T) -> T {
    /// Puts back what was, however the work ends.
    struct Before(bool);
    impl Drop for Before {
        fn drop(&mut self) {
            CONFINED.set(self.0);
        }
    }
    let _before = Before(CONFINED.replace(true));
    work()
}

/// Whether `file` may be read on behalf of a file in `folder`.
pub(crate) fn is_allowed(folder: &Path, file: &Path) -> bool {
    if !CONFINED.get() {
        return true;
    }
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let Ok(folder) = folder.canonicalize() else { return false };
    let within = |file: &Path| file.canonicalize().is_ok_and(|real| real.starts_with(&folder));
    match tiles(file) {
        Some(tiles) => tiles.iter().all(|tile| within(tile)),
        None => within(file),
    }
}

/// What became of a reference.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Located {
    /// It is where the reference says.
    AsWritten(PathBuf),
    /// It was found elsewhere.
    Elsewhere(PathBuf),
    /// There is no such file; this is where the reference says.
    Missing(PathBuf),
    /// It leads out of the folder that the work is [`confined`] to. There is nothing at this path.
    Outside(PathBuf),
}

impl Located {
    pub(crate) fn path(&self) -> &Path {
        match self {
            Self::AsWritten(path) | Self::Elsewhere(path) | Self::Missing(path) | Self::Outside(path) => path,
        }
    }

    pub(crate) fn into_path(self) -> PathBuf {
        match self {
            Self::AsWritten(path) | Self::Elsewhere(path) | Self::Missing(path) | Self::Outside(path) => path,
        }
    }

    pub(crate) fn is_missing(&self) -> bool {
        matches!(self, Self::Missing(_) | Self::Outside(_))
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
    let there: Vec<PathBuf> = names.iter().map(|n| folder.join(n)).filter(|p| exists(p)).collect();
    let refused = !there.is_empty();
    if let Some(there) = there.into_iter().find(|p| is_allowed(folder, p)) {
        return Located::AsWritten(there);
    }
    let parts: Vec<Vec<String>> = readings.iter().map(|r| components(r)).collect();
    let longest = parts.iter().map(Vec::len).max().unwrap_or(0);
    for skipped in 0..longest {
        for part in parts.iter().filter(|p| skipped < p.len()) {
            if let Some(found) = descend(folder, &part[skipped..]).filter(|found| is_allowed(folder, found)) {
                return Located::Elsewhere(found);
            }
        }
    }
    let name = readings.first().map(|r| r.replace('\\', "/")).unwrap_or_default();
    let place = folder.join(name);
    let leads_up = place.strip_prefix(folder).map_or(true, |p| p.components().any(|c| c == Component::ParentDir));
    if CONFINED.get() && (leads_up || refused || place.symlink_metadata().is_ok()) {
        return Located::Outside(vacant(folder, &place));
    }
    Located::Missing(place)
}

/// A path in `folder` with the last name of `place` at which there is nothing, not even a link.
fn vacant(folder: &Path, place: &Path) -> PathBuf {
    let mut name = place.file_name().map_or_else(|| OsString::from("_"), OsString::from);
    while folder.join(&name).symlink_metadata().is_ok() || exists(&folder.join(&name)) {
        name.push("_");
    }
    folder.join(name)
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
    tiles(path).map_or_else(|| path.is_file(), |tiles| !tiles.is_empty())
}

/// The files of a name with a place for tiles; none for another name.
fn tiles(path: &Path) -> Option<Vec<PathBuf>> {
    let text = path.to_string_lossy();
    if !TextureName::new(text.as_ref()).has_tile() {
        return None;
    }
    let (Some(folder), Some(pattern)) = (path.parent(), path.file_name()) else { return Some(Vec::new()) };
    let pattern = TextureName::new(pattern.to_string_lossy());
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let all = entries(folder).into_iter().filter(|entry| pattern.matches_tile(&entry.to_string_lossy()));
    Some(all.map(|entry| folder.join(entry)).collect())
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

    #[cfg(unix)]
    #[test]
    fn confined_work_stays_beside_and_below() {
        use std::os::unix::fs::symlink;
        let (dir, file) = folder(&[b"in.png", b"below/in.png", b"t.1001.png"]);
        let (away, _) = folder(&[b"secret.png", b"s.1001.png"]);
        let secret = away.path().join("secret.png");
        symlink(&secret, dir.path().join("link.png")).unwrap();
        symlink(away.path(), dir.path().join("linked")).unwrap();
        symlink(away.path().join("s.1001.png"), dir.path().join("t.1002.png")).unwrap();
        let out = format!("../{}/secret.png", away.path().file_name().unwrap().display());
        let written = [secret.to_str().unwrap(), &out, "link.png", "linked/secret.png", "t.<UDIM>.png"];
        for written in written {
            assert!(matches!(locate(&file, written.as_bytes()), Located::AsWritten(_)), "{written}");
            let found = confined(|| locate(&file, written.as_bytes()));
            let Located::Outside(path) = &found else { panic!("{written}: {found:?}") };
            assert!(path.starts_with(dir.path()) && path.symlink_metadata().is_err(), "{found:?}");
        }
        for written in ["in.png", "below/in.png", "below/../in.png"] {
            assert!(matches!(confined(|| locate(&file, written.as_bytes())), Located::AsWritten(_)), "{written}");
        }
        // A file of that name beside is taken in place of one elsewhere.
        assert!(matches!(confined(|| locate(&file, b"/etc/in.png")), Located::Elsewhere(_)));
        assert!(matches!(confined(|| locate(&file, b"gone.png")), Located::Missing(_)));
        assert!(matches!(locate(&file, out.as_bytes()), Located::AsWritten(_)), "it ends with the work");
    }

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
