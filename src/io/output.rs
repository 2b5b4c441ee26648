//! Outputs that appear whole or not at all.
//!
//! A file is written beside its final place under a temporary name and then renamed, so that a
//! reader never sees half of it and a failure leaves what was there before. The temporary names are
//! kept in a registry, which lets an interrupt handler remove them.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use crate::{Error, Result};

/// Temporary files and folders being written, and whether an interrupt has ended all writing.
pub(super) struct Registry {
    live: Vec<PathBuf>,
    /// Folders in which leftovers of killed runs have been looked for.
    swept: Vec<PathBuf>,
    pub(super) closed: bool,
}

static REGISTRY: Mutex<Registry> = Mutex::new(Registry { live: Vec::new(), swept: Vec::new(), closed: false });

pub(super) fn registry() -> MutexGuard<'static, Registry> {
    // The list stays correct whatever a panicking thread was doing: every change to it is a single
    // push or retain.
    REGISTRY.lock().unwrap_or_else(PoisonError::into_inner)
}

const REMEDY: &str = "Check the folder, its permissions and the free space, or name another output";

/// Writes `path` through `write`, whole or not at all.
///
/// The content goes to a temporary file in the same folder, which is renamed over `path` at the
/// end; on any error it is removed and what was at `path` stays. A symbolic link is followed.
/// Devices and pipes below `/dev` (`/dev/stdout`) are written directly; other pipes are refused,
/// because opening one waits for a reader.
///
/// # Errors
/// [`Error::Io`] if the folder is missing or cannot be written, and whatever `write` returns.
#[doc(hidden)]
pub fn write_atomically<T>(
    path: impl AsRef<Path>,
    write: impl FnOnce(&mut BufWriter<&mut File>) -> Result<T>,
) -> Result<T> {
    let path = path.as_ref();
    let target = final_place(path)?;
    if special(path, &target)?.is_some() {
        let mut file = fs::OpenOptions::new().write(true).open(&target).map_err(|e| Error::io(path, e, REMEDY))?;
        return fill(path, &mut file, write);
    }
    let mut temporary = Temporary::beside(path, &target)?;
    let mut file =
        File::options().write(true).create_new(true).open(&temporary.path).map_err(|e| Error::io(path, e, REMEDY))?;
    temporary.hold();
    let value = fill(path, &mut file, write)?;
    drop(file);
    temporary.rename_to(path, &target)?;
    Ok(value)
}

/// What is written as it comes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Special {
    Pipe,
    Device,
}

#[cfg(unix)]
fn is_pipe(metadata: &fs::Metadata) -> bool {
    std::os::unix::fs::FileTypeExt::is_fifo(&metadata.file_type())
}

/// Other systems have no pipes among files.
#[cfg(not(unix))]
fn is_pipe(_: &fs::Metadata) -> bool {
    false
}

/// What `target` is if it is no regular file. A pipe that is not below `/dev`, where a shell puts
/// those that have a reader, is refused.
fn special(path: &Path, target: &Path) -> Result<Option<Special>> {
    let Ok(metadata) = fs::metadata(target) else { return Ok(None) };
    if metadata.is_file() {
        return Ok(None);
    }
    if is_pipe(&metadata) {
        if path.starts_with("/dev") || target.starts_with("/dev") {
            return Ok(Some(Special::Pipe));
        }
        let what = io::Error::new(io::ErrorKind::InvalidInput, "this is a named pipe, which waits for its reader");
        return Err(Error::io(path, what, "Write to - and let the shell send that on: -o - > PIPE"));
    }
    Ok(Some(Special::Device))
}

fn fill<T>(path: &Path, file: &mut File, write: impl FnOnce(&mut BufWriter<&mut File>) -> Result<T>) -> Result<T> {
    let mut writer = BufWriter::with_capacity(1 << 16, file);
    let value = write(&mut writer)?;
    writer.flush().map_err(|e| Error::io(path, e, REMEDY))?;
    Ok(value)
}

/// [`write_atomically`] for content that is already in memory.
///
/// # Errors
/// As [`write_atomically`]; [`Error::NotFinite`] for a GLB file with a number that is not finite.
#[cfg(feature = "files")]
pub fn write_bytes(path: impl AsRef<Path>, bytes: &[u8]) -> Result<()> {
    let path = path.as_ref();
    super::finite_gltf::check(path, bytes)?;
    write_atomically(path, |w| w.write_all(bytes).map_err(|e| Error::io(path, e, REMEDY)))
}

/// Turns an error of a writer inside [`write_atomically`] into one that names the output.
pub(crate) fn failed(path: &Path) -> impl Fn(io::Error) -> Error + '_ {
    move |e| Error::io(path, e, REMEDY)
}

/// Fails unless `path` can be written, so that long work does not end at a missing folder. Leaves
/// nothing behind.
pub fn check_writable(path: impl AsRef<Path>) -> Result<()> {
    let path = path.as_ref();
    let target = final_place(path)?;
    match special(path, &target)? {
        // Its reader would take the closing for the end of all.
        Some(Special::Pipe) => return Ok(()),
        Some(Special::Device) => {
            return fs::OpenOptions::new().write(true).open(&target).map(drop).map_err(|e| Error::io(path, e, REMEDY));
        }
        None => {}
    }
    let temporary = Temporary::beside(path, &target)?;
    File::options().write(true).create_new(true).open(&temporary.path).map(drop).map_err(|e| Error::io(path, e, REMEDY))
}

/// Removes the temporary files and folders of all outputs being written and lets no new one begin:
/// for an interrupt handler that then ends the process.
pub fn remove_all_temporary() {
    let mut registry = registry();
    registry.closed = true;
    for path in registry.live.drain(..) {
        // Nothing can be done about a file that does not go away while the process ends.
        let _ = remove(&path);
    }
}

fn remove(path: &Path) -> io::Result<()> {
    if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) }
}

/// Where the bytes go: `path` itself or what it links to. Folders are refused.
pub(super) fn final_place(path: &Path) -> Result<PathBuf> {
    let other = |kind, what: &str| Err(Error::io(path, io::Error::new(kind, what.to_owned()), REMEDY));
    if path.file_name().is_none() {
        return other(io::ErrorKind::InvalidInput, "this is not the name of a file");
    }
    if path.is_dir() {
        return other(io::ErrorKind::IsADirectory, "this is a folder, a file is to be written");
    }
    let target = followed(path);
    let folder = folder_of(&target);
    if !folder.is_dir() {
        return other(io::ErrorKind::NotFound, &format!("the folder {} does not exist", folder.display()));
    }
    #[cfg(feature = "files")]
    super::kept::writing(&target)?;
    Ok(target)
}

/// Most links that are followed, as systems have it.
const LINKS: usize = 40;

/// What a symbolic link leads to, there or not yet; any other path as it is, and a link to what has
/// no name, such as a pipe of a shell.
pub(crate) fn followed(path: &Path) -> PathBuf {
    if let Some(there) = path.is_symlink().then(|| fs::canonicalize(path).ok()).flatten() {
        return there;
    }
    let mut place = path.to_path_buf();
    if place.exists() {
        return place;
    }
    for _ in 0..LINKS {
        let Ok(to) = fs::read_link(&place) else { break };
        place = folder_of(&place).join(to);
    }
    place
}

pub(super) fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// A registered temporary path; the file or folder there is removed when dropped.
#[derive(Debug)]
pub(super) struct Temporary {
    path: PathBuf,
    /// Holds a lock on it, by which other processes see that it is in use.
    held: Option<File>,
}

impl Temporary {
    pub(super) fn beside(path: &Path, target: &Path) -> Result<Self> {
        let stem = target.file_name().unwrap_or_default().to_string_lossy();
        let stem: String = stem.chars().take(40).collect();
        let folder = folder_of(target);
        let mut registry = registry();
        if registry.closed {
            return Err(Error::io(path, io::ErrorKind::Interrupted.into(), "Run the command again"));
        }
        sweep(folder, &mut registry);
        // Unique in this process by the counter and among processes by the id; a leftover of a
        // killed process with the same id is skipped.
        let candidate = (0u32..)
            .map(|n| folder.join(format!(".{stem}.{}-{n}.partial", std::process::id())))
            .find(|p| !registry.live.contains(p) && !p.exists());
        let candidate = candidate.unwrap_or_else(|| folder.join(".barymap.partial"));
        registry.live.push(candidate.clone());
        Ok(Self { path: candidate, held: None })
    }

    /// Marks the file or folder, which is there now, as one in use.
    pub(super) fn hold(&mut self) {
        // Locks of other systems keep its own writer out.
        if cfg!(unix) {
            self.held = File::open(&self.path).ok().filter(|file| file.try_lock().is_ok());
        }
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    pub(super) fn rename_to(self, path: &Path, target: &Path) -> Result<()> {
        // Under the lock, so that an interrupt finds the file either still temporary or finished.
        let mut registry = registry();
        if registry.closed {
            return Err(Error::io(path, io::ErrorKind::Interrupted.into(), "Run the command again"));
        }
        fs::rename(self.path(), target).map_err(|e| Error::io(path, e, REMEDY))?;
        registry.live.retain(|p| *p != self.path);
        #[cfg(feature = "files")]
        super::kept::wrote(target);
        Ok(())
    }
}

/// Removes what killed runs left in `folder`, when it is first written to. O(entries).
fn sweep(folder: &Path, registry: &mut Registry) {
    if registry.swept.iter().any(|f| f == folder) {
        return;
    }
    registry.swept.push(folder.to_path_buf());
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let Some(process) = writer_of(&name.to_string_lossy()) else { continue };
        let path = entry.path();
        if !registry.live.contains(&path) && is_over(process, &path) {
            // One that cannot be removed does no harm.
            let _ = remove(&path);
        }
    }
}

/// The process in the name of a temporary file: `.NAME.PROCESS-NUMBER.partial`.
fn writer_of(name: &str) -> Option<u32> {
    let (_, numbers) = name.strip_prefix('.')?.strip_suffix(".partial")?.rsplit_once('.')?;
    let (process, number) = numbers.split_once('-')?;
    number.parse::<u32>().ok()?;
    process.parse().ok()
}

/// Whether nobody writes a temporary file any more: no process of this machine has its number, and
/// none of another, in a shared folder, has it locked.
fn is_over(process: u32, path: &Path) -> bool {
    let numbers = Path::new("/proc/self/status").exists();
    let gone = if process == std::process::id() {
        true
    } else if numbers {
        !Path::new(&format!("/proc/{process}")).exists()
    } else {
        let age = fs::metadata(path).and_then(|m| m.modified()).ok().and_then(|t| t.elapsed().ok());
        age.is_some_and(|age| age > UNSEEN)
    };
    gone && File::open(path).is_ok_and(|file| file.try_lock().is_ok())
}

/// How old a temporary file is taken to be left behind where processes cannot be seen.
const UNSEEN: Duration = Duration::from_secs(24 * 3600);

impl Drop for Temporary {
    fn drop(&mut self) {
        let mut registry = registry();
        if registry.live.contains(&self.path) {
            let _ = remove(&self.path);
            registry.live.retain(|p| *p != self.path);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entries(dir: &Path) -> usize {
        fs::read_dir(dir).unwrap().count()
    }

    #[test]
    fn an_error_keeps_the_old_file_and_leaves_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("out.txt");
        write_bytes(&path, b"old").unwrap();
        let failed: Result<()> = write_atomically(&path, |w| {
            w.write_all(b"half of the new").unwrap();
            Err(Error::input("no", "Stop"))
        });
        assert!(failed.is_err());
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(entries(dir.path()), 1);
        write_bytes(&path, b"new").unwrap();
        assert_eq!((fs::read(&path).unwrap().as_slice(), entries(dir.path())), (&b"new"[..], 1));
    }

    #[test]
    fn nothing_is_seen_before_the_end() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("out.txt");
        write_atomically(&path, |w| {
            w.write_all(&[1; 100_000]).unwrap();
            assert!(!path.exists());
            assert!(registry().live.iter().any(|p| p.parent() == Some(dir.path())));
            Ok(())
        })
        .unwrap();
        assert_eq!(fs::read(&path).unwrap().len(), 100_000);
        assert!(!registry().live.iter().any(|p| p.parent() == Some(dir.path())));
    }

    #[test]
    fn unwritable_places_are_known_beforehand() {
        let dir = tempfile::tempdir().unwrap();
        for bad in [dir.path().to_path_buf(), dir.path().join("missing/out.png"), PathBuf::from("/")] {
            let message = check_writable(&bad).unwrap_err().to_string();
            assert!(message.contains("folder") || message.contains("not the name"), "{message}");
        }
        check_writable(dir.path().join("fine.png")).unwrap();
        assert_eq!(entries(dir.path()), 0);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn what_a_killed_run_left_is_removed_and_nothing_else() {
        let dir = tempfile::tempdir().unwrap();
        let place = |name: &str| dir.path().join(name);
        // No process has a number beyond the largest that the system gives.
        let (file, folder) = (place(".a.png.4194305-0.partial"), place(".b.4194305-3.partial"));
        fs::write(&file, "half").unwrap();
        fs::create_dir(&folder).unwrap();
        fs::write(folder.join("x"), "half").unwrap();
        let others = [".a.png.1-0.partial", ".a.partial", "a.4194305-0.partial", ".held.4194305-0.partial"].map(place);
        others.iter().for_each(|other| fs::write(other, "kept").unwrap());
        let held = File::open(&others[3]).unwrap();
        held.try_lock().unwrap();
        write_bytes(place("new"), b"1").unwrap();
        assert!(!file.exists() && !folder.exists());
        assert!(others.iter().all(|other| other.exists()));
        assert_eq!(entries(dir.path()), 5);
    }

    #[cfg(unix)]
    #[test]
    fn links_are_followed() {
        let dir = tempfile::tempdir().unwrap();
        write_bytes(dir.path().join("real"), b"1").unwrap();
        std::os::unix::fs::symlink(dir.path().join("real"), dir.path().join("link")).unwrap();
        write_bytes(dir.path().join("link"), b"2").unwrap();
        assert_eq!(fs::read(dir.path().join("real")).unwrap(), b"2");
        assert!(dir.path().join("link").is_symlink());
    }
}
