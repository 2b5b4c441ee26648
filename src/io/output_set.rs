//! Several outputs that appear together or not at all: a new folder, or files in one that is there.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::output::{Temporary, failed, final_place, folder_of, registry};
use crate::{Error, Result};

const REMEDY: &str = "Name a folder that does not exist yet, or an empty one, in a folder that may be written";

/// A folder that is filled under a temporary name beside its place and then takes it. It is removed
/// if [`OutputFolder::finish`] is not called, and at an interrupt.
#[derive(Debug)]
pub struct OutputFolder {
    place: PathBuf,
    building: Temporary,
    /// What is at the place goes away.
    replaces: bool,
}

impl OutputFolder {
    /// Begins the folder `place`, which must not exist or be an empty folder.
    ///
    /// # Errors
    /// [`Error::Io`] if it exists with content or its parent cannot be written.
    pub fn create(place: impl AsRef<Path>) -> Result<Self> {
        let place = place.as_ref().to_path_buf();
        let failed = |e| Error::io(&place, e, REMEDY);
        if place.exists() && fs::read_dir(&place).map_err(failed)?.next().is_some() {
            return Err(failed(io::Error::new(io::ErrorKind::AlreadyExists, "the folder is not empty")));
        }
        Self::begin(place, false)
    }

    /// Begins a folder that takes the place of the one at `place`, if there is one, and of all that
    /// is in it, when it is finished.
    ///
    /// # Errors
    /// [`Error::Io`] if there is a file at `place` or its parent cannot be written.
    pub fn replace(place: impl AsRef<Path>) -> Result<Self> {
        let place = place.as_ref().to_path_buf();
        if place.exists() && !place.is_dir() {
            return Err(Error::io(
                &place,
                io::Error::new(io::ErrorKind::AlreadyExists, "this is not a folder"),
                REMEDY,
            ));
        }
        Self::begin(place, true)
    }

    fn begin(place: PathBuf, replaces: bool) -> Result<Self> {
        let mut building = Temporary::beside(&place, &place)?;
        fs::create_dir(building.path()).map_err(|e| Error::io(&place, e, REMEDY))?;
        building.hold();
        Ok(Self { place, building, replaces })
    }

    /// Where its files are written meanwhile.
    pub fn path(&self) -> &Path {
        self.building.path()
    }

    /// Gives the folder its name.
    ///
    /// # Errors
    /// [`Error::Io`] if that is not possible; its files are removed then.
    pub fn finish(self) -> Result<()> {
        if self.replaces && self.place.is_dir() {
            // What was there is removed when this is dropped.
            let old = Temporary::beside(&self.place, &self.place)?;
            // Under the lock, so that an interrupt finds the old folder or the new one. Released
            // before `old` is dropped.
            let registry = registry();
            let failed = |e| Error::io(&self.place, e, REMEDY);
            if registry.closed {
                return Err(failed(io::ErrorKind::Interrupted.into()));
            }
            fs::rename(&self.place, old.path()).map_err(failed)?;
            return fs::rename(self.building.path(), &self.place).map_err(|error| {
                // A second failure while mending the first cannot be mended.
                let _ = fs::rename(old.path(), &self.place);
                failed(error)
            });
        }
        if self.place.is_dir() {
            // Empty, or this fails and nothing is lost.
            fs::remove_dir(&self.place).map_err(|e| Error::io(&self.place, e, REMEDY))?;
        }
        self.building.rename_to(&self.place, &self.place)
    }
}

/// Files that replace what is at their places at once, when [`OutputSet::finish`] is called: until
/// then they are in a temporary folder beside them. Of files that are not finished nothing is left,
/// nor at an interrupt.
#[derive(Debug)]
pub struct OutputSet {
    folder: Temporary,
    /// Where each is, and where it will be.
    files: Vec<(PathBuf, PathBuf)>,
}

impl OutputSet {
    /// Begins a set in the folder of `path`, one of its files.
    ///
    /// # Errors
    /// [`Error::Io`] if there is no such folder or it cannot be written.
    pub fn beside(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let mut folder = Temporary::beside(path, &final_place(path)?)?;
        fs::create_dir(folder.path()).map_err(failed(path))?;
        folder.hold();
        Ok(Self { folder, files: Vec::new() })
    }

    /// Where the file that is to be at `path`, in the same folder, is written meanwhile: a name
    /// that ends as its own.
    ///
    /// # Errors
    /// [`Error::Io`] if `path` is a folder or in another one.
    pub fn file(&mut self, path: impl AsRef<Path>) -> Result<PathBuf> {
        let path = path.as_ref();
        let target = final_place(path)?;
        if folder_of(&target) != folder_of(self.folder.path()) {
            let other = io::Error::new(io::ErrorKind::InvalidInput, "the file is not in the folder of the others");
            return Err(failed(path)(other));
        }
        let name = target.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let meanwhile = self.folder.path().join(format!("{}_{name}", self.files.len()));
        self.files.push((meanwhile.clone(), target));
        Ok(meanwhile)
    }

    /// Moves all files to their places.
    ///
    /// # Errors
    /// [`Error::Io`] if one of them cannot be moved; then what was there before is there again.
    pub fn finish(self) -> Result<()> {
        // Under the lock, so that an interrupt finds all of them moved, or none. Parameters outlive
        // locals: it is released before the folder is removed.
        let registry = registry();
        if registry.closed {
            return Err(Error::io(self.folder.path(), io::ErrorKind::Interrupted.into(), "Run the command again"));
        }
        self.exchange()
    }

    fn exchange(&self) -> Result<()> {
        for (k, (_, target)) in self.files.iter().enumerate() {
            if let Err(error) = self.place(k) {
                for k in (0..k).rev() {
                    // A second failure while mending the first cannot be mended.
                    let _ = self.take_back(k);
                }
                return Err(failed(target)(error));
            }
        }
        Ok(())
    }

    /// Moves file `k` to its place, and what was there into the folder. If that fails, nothing has
    /// changed.
    fn place(&self, k: usize) -> io::Result<()> {
        let (meanwhile, target) = &self.files[k];
        let old = self.old(k);
        if target.exists() {
            fs::rename(target, &old)?;
        }
        fs::rename(meanwhile, target).inspect_err(|_| {
            let _ = fs::rename(&old, target);
        })
    }

    fn take_back(&self, k: usize) -> io::Result<()> {
        let target = &self.files[k].1;
        fs::remove_file(target)?;
        if self.old(k).exists() { fs::rename(self.old(k), target) } else { Ok(()) }
    }

    fn old(&self, k: usize) -> PathBuf {
        self.folder.path().join(format!("{k}.old"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(dir: &Path) -> Vec<String> {
        let mut names: Vec<String> =
            fs::read_dir(dir).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_folder_takes_the_place_of_another_only_at_its_end() {
        let dir = tempfile::tempdir().unwrap();
        let place = dir.path().join("f");
        for (round, name) in ["a", "b", "c"].into_iter().enumerate() {
            let folder = OutputFolder::replace(&place).unwrap();
            fs::write(folder.path().join(name), name).unwrap();
            assert_eq!(
                place.is_dir().then(|| names(&place)),
                [None, Some(vec!["a".into()]), Some(vec!["b".into()])][round]
            );
            folder.finish().unwrap();
            assert_eq!((names(&place), names(dir.path())), (vec![name.to_owned()], vec!["f".to_owned()]));
        }
        drop(OutputFolder::replace(&place).unwrap());
        assert_eq!((names(&place), names(dir.path())), (vec!["c".to_owned()], vec!["f".to_owned()]));
        fs::write(dir.path().join("file"), "").unwrap();
        assert!(OutputFolder::replace(dir.path().join("file")).is_err());
        assert!(OutputFolder::create(&place).is_err(), "only replacing removes what is there");
    }

    #[test]
    fn sets_of_files_replace_all_or_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let path = |name: &str| dir.path().join(name);
        fs::write(path("b"), "old").unwrap();
        let mut set = OutputSet::beside(path("a")).unwrap();
        for name in ["a", "b", "c"] {
            fs::write(set.file(path(name)).unwrap(), name).unwrap();
        }
        assert_eq!(fs::read_to_string(path("b")).unwrap(), "old");
        assert!(!path("a").exists() && !path("c").exists());
        set.finish().unwrap();
        assert_eq!(names(dir.path()), ["a", "b", "c"]);
        assert_eq!(fs::read_to_string(path("b")).unwrap(), "b");

        // Given up, or with a file that never came: what was there is there again.
        for written in [&["a", "b"][..], &["a"], &[]] {
            let mut set = OutputSet::beside(path("a")).unwrap();
            for name in ["a", "d", "b"] {
                let place = set.file(path(name)).unwrap();
                if written.contains(&name) {
                    fs::write(place, "new").unwrap();
                }
            }
            assert!(set.finish().is_err());
            assert_eq!(names(dir.path()), ["a", "b", "c"], "{written:?}");
            assert_eq!(fs::read_to_string(path("a")).unwrap(), "a");
            assert_eq!(fs::read_to_string(path("b")).unwrap(), "b");
        }
        fs::create_dir(path("e")).unwrap();
        let mut set = OutputSet::beside(path("a")).unwrap();
        assert!(set.file(path("e")).is_err() && set.file(path("e").join("f")).is_err());
        drop(set);
        assert_eq!(names(dir.path()), ["a", "b", "c", "e"]);
        assert!(OutputSet::beside(path("no").join("a")).is_err());
    }

    #[test]
    fn folders_appear_whole_or_not_at_all() {
        let dir = tempfile::tempdir().unwrap();
        let place = dir.path().join("out");
        let folder = OutputFolder::create(&place).unwrap();
        fs::write(folder.path().join("a"), "a").unwrap();
        assert!(!place.exists());
        folder.finish().unwrap();
        assert_eq!((names(dir.path()), names(&place)), (vec!["out".to_owned()], vec!["a".to_owned()]));
        assert!(OutputFolder::create(&place).unwrap_err().to_string().contains("not empty"));
        let other = OutputFolder::create(dir.path().join("other")).unwrap();
        fs::write(other.path().join("a"), "a").unwrap();
        drop(other);
        assert_eq!(names(dir.path()), ["out"]);
    }
}
