//! What is kept of work that was not saved, so that a crash loses little.
//!
//! Each running studio has a file in a folder of the user. It is written when the document has
//! changed, at most every [`EVERY`], and removed at a regular end. A file whose process is gone
//! is what a crash left.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::document::Document;
use super::project;

/// The time that passes between two writes at least.
pub const EVERY: Duration = Duration::from_secs(5);

/// Writes the recovery file of this process.
#[derive(Debug)]
pub struct Recovery {
    path: PathBuf,
    /// The revision that is in the file, and when it was written.
    written: Option<(u64, Instant)>,
}

impl Recovery {
    /// For this process, in a folder that is made when it is needed.
    pub fn new(folder: &Path) -> Self {
        Self { path: folder.join(format!("recovery-{}.json", std::process::id())), written: None }
    }

    /// Writes the document if it has changed and the last time was long enough ago.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn keep(&mut self, document: &Document, revision: u64, now: Instant) -> barymap::Result<bool> {
        let due = self.written.is_none_or(|(r, at)| r != revision && now.duration_since(at) >= EVERY);
        if !due || revision == 0 {
            return Ok(false);
        }
        self.written = Some((revision, now));
        if let Some(folder) = self.path.parent() {
            let remedy = "Work is not kept in case of a crash: save it by hand";
            std::fs::create_dir_all(folder).map_err(|e| barymap::Error::io(folder, e, remedy))?;
        }
        project::save(document, &self.path)?;
        Ok(true)
    }

    /// Nothing is left to recover.
    pub fn forget(&mut self) {
        // Where there is no file there is nothing to remove.
        _ = std::fs::remove_file(&self.path);
        self.written = None;
    }
}

/// Files in the folder that no running process has, newest first.
pub fn left(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let mut found: Vec<_> = entries
        .flatten()
        .filter_map(|entry| {
            let path = entry.path();
            let name = path.file_name()?.to_str()?;
            let process: u32 = name.strip_prefix("recovery-")?.strip_suffix(".json")?.parse().ok()?;
            let written = entry.metadata().ok()?.modified().ok()?;
            (!is_running(process, written)).then_some((written, path))
        })
        .collect();
    found.sort();
    found.into_iter().rev().map(|f| f.1).collect()
}

/// Whether a process runs. Where processes are no files, one that wrote in the last half minute
/// counts as running.
fn is_running(process: u32, written: std::time::SystemTime) -> bool {
    if process == std::process::id() {
        return true;
    }
    let processes = Path::new("/proc/self");
    if processes.exists() {
        return Path::new("/proc").join(process.to_string()).exists();
    }
    written.elapsed().is_ok_and(|e| e < 6 * EVERY)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_are_written_at_most_every_few_seconds() {
        let folder = tempfile::tempdir().unwrap();
        let inner = folder.path().join("new");
        let mut recovery = Recovery::new(&inner);
        let (document, start) = (Document::default(), Instant::now());
        assert!(!recovery.keep(&document, 0, start).unwrap(), "nothing was done yet");
        assert!(recovery.keep(&document, 1, start).unwrap());
        assert!(!recovery.keep(&document, 1, start + 2 * EVERY).unwrap(), "nothing has changed");
        assert!(!recovery.keep(&document, 2, start + EVERY / 2).unwrap());
        assert!(recovery.keep(&document, 2, start + EVERY).unwrap());
        assert!(left(&inner).is_empty(), "this process runs");
        recovery.forget();
        assert_eq!(std::fs::read_dir(&inner).unwrap().count(), 0);
    }

    #[test]
    fn what_a_crash_left_is_found() {
        let folder = tempfile::tempdir().unwrap();
        // No process has this number: Linux counts to 2^22.
        let crashed = folder.path().join("recovery-4294967294.json");
        std::fs::write(&crashed, "{}").unwrap();
        std::fs::write(folder.path().join("other.json"), "{}").unwrap();
        if Path::new("/proc/self").exists() {
            assert_eq!(left(folder.path()), [crashed]);
        }
        assert!(left(&folder.path().join("none")).is_empty());
    }
}
