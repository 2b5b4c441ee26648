//! Files that are read are not overwritten, however they came to be read: a texture that the
//! material of a mesh names is an input, too.
//!
//! A command line turns this on, for the process.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::{Error, Result};

/// What is known where this is on.
#[derive(Default)]
struct Known {
    /// Files that are going to be written.
    planned: Vec<PathBuf>,
    /// Files that were read.
    read: Vec<PathBuf>,
}

static KNOWN: Mutex<Option<Known>> = Mutex::new(None);

fn known() -> MutexGuard<'static, Option<Known>> {
    // Every change is a single push.
    KNOWN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Turns this on, with the outputs that are known by now; off without any list.
#[cfg_attr(not(feature = "cli"), expect(dead_code, reason = "for the command line"))]
pub(crate) fn keep_inputs(planned: Option<Vec<PathBuf>>) {
    let here = |paths: Vec<PathBuf>| paths.iter().filter_map(|p| p.canonicalize().ok()).collect();
    *known() = planned.map(|paths| Known { planned: here(paths), read: Vec::new() });
}

fn refused(path: &Path) -> Error {
    let what = format!("{} is a file that is read", path.display());
    Error::option("output", what, "Name another file, or give --overwrite")
}

/// A file is about to be read.
///
/// # Errors
/// [`Error::Option`] if it is to be written later: better now than when the work is done.
pub(super) fn reading(path: &Path) -> Result<()> {
    let mut known = known();
    let Some(known) = known.as_mut() else { return Ok(()) };
    let Ok(place) = path.canonicalize() else { return Ok(()) };
    let is_planned = known.planned.contains(&place);
    if !known.read.contains(&place) {
        known.read.push(place);
    }
    if is_planned { Err(refused(path)) } else { Ok(()) }
}

/// A file is about to be written.
///
/// # Errors
/// [`Error::Option`] if it was read.
pub(super) fn writing(path: &Path) -> Result<()> {
    let known = known();
    let Some(known) = known.as_ref().filter(|k| !k.read.is_empty()) else { return Ok(()) };
    let was_read = path.canonicalize().is_ok_and(|place| known.read.contains(&place));
    if was_read { Err(refused(path)) } else { Ok(()) }
}
