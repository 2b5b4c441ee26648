//! Files that are read are not overwritten, however they came to be read: a texture that the
//! material of a mesh names is an input, too. Nor is what this run has written itself: of two
//! outputs of one name one would be lost. Nor is a file that is write-protected, which renaming
//! would go round.
//!
//! A command line turns this on, for the process.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::{Error, Result};

/// A file that is going to be written.
struct Planned {
    place: PathBuf,
    /// The option that names it.
    option: String,
    /// Whether it is there before anything is written.
    there: bool,
}

/// What is known where this is on.
#[derive(Default)]
struct Known {
    planned: Vec<Planned>,
    /// Files that were read.
    read: Vec<PathBuf>,
    /// Files that were written.
    written: Vec<PathBuf>,
    /// Whether files that were read may be overwritten.
    overwrite: bool,
}

static KNOWN: Mutex<Option<Known>> = Mutex::new(None);

fn known() -> MutexGuard<'static, Option<Known>> {
    // Every change is a single push.
    KNOWN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Turns this on, with the outputs that are known by now and the options that name them; off
/// without any list. With `overwrite` files that were read may be written.
#[cfg_attr(not(feature = "cli"), expect(dead_code, reason = "for the command line"))]
pub(crate) fn keep_inputs(planned: Option<Vec<(PathBuf, String)>>, overwrite: bool) {
    let plan = |(path, option): (PathBuf, String)| match path.canonicalize() {
        Ok(place) => Planned { place, option, there: true },
        Err(_) => Planned { place: path, option, there: false },
    };
    let here = |paths: Vec<(PathBuf, String)>| paths.into_iter().map(plan).collect();
    *known() = planned.map(|paths| Known { planned: here(paths), overwrite, ..Known::default() });
}

fn refused(path: &Path, option: &str) -> Error {
    let what = format!("{} is a file that is read", path.display());
    Error::option(option, what, "Name another file, or give --overwrite")
}

/// A file is about to be read.
///
/// # Errors
/// [`Error::Option`] if it is to be written later: better now than when the work is done.
pub(super) fn reading(path: &Path) -> Result<()> {
    let mut known = known();
    let Some(known) = known.as_mut() else { return Ok(()) };
    let Ok(place) = path.canonicalize() else { return Ok(()) };
    if known.overwrite {
        return Ok(());
    }
    let planned = known.planned.iter().find(|p| p.there && p.place == place).map(|p| refused(path, &p.option));
    if !known.read.contains(&place) {
        known.read.push(place);
    }
    planned.map_or(Ok(()), Err)
}

/// A file is about to be written.
///
/// # Errors
/// [`Error::Option`] if it was read, or written before; [`Error::Io`] if it is write-protected.
pub(super) fn writing(path: &Path) -> Result<()> {
    let known = known();
    let Some(known) = known.as_ref() else { return Ok(()) };
    if !known.overwrite && std::fs::metadata(path).is_ok_and(|m| m.is_file() && m.permissions().readonly()) {
        let what = std::io::Error::new(std::io::ErrorKind::PermissionDenied, "this file is write-protected");
        return Err(Error::io(path, what, "Allow writing to it, name another output, or give --overwrite"));
    }
    let Ok(place) = path.canonicalize() else { return Ok(()) };
    let option = known.planned.iter().find(|p| p.place == place).map_or("--output", |p| &p.option);
    if known.written.contains(&place) {
        let what = format!("{} would be written twice: it is another output, or stands beside one", path.display());
        return Err(Error::option(option, what, "Give each output a name of its own"));
    }
    if known.read.contains(&place) { Err(refused(path, option)) } else { Ok(()) }
}

/// A file was written.
pub(super) fn wrote(path: &Path) {
    if let (Some(known), Ok(place)) = (known().as_mut(), path.canonicalize()) {
        known.written.push(place);
    }
}
