//! The command line, and pictures of files.

use std::path::PathBuf;
use std::process::ExitCode;

use barymap::io::{read_image, write_image};
use pyo3::prelude::*;

use crate::arrays::{image, of_image};
use crate::work::run;

/// Runs the command line; returns its exit code.
#[pyfunction]
pub(crate) fn program(py: Python<'_>, arguments: Vec<String>) -> u8 {
    let code = py.detach(|| barymap::cli::run(arguments));
    // An exit code does not tell its number, but it can be compared.
    (0..=u8::MAX).find(|&n| ExitCode::from(n) == code).unwrap_or(1)
}

/// A picture of a file: (h, w, c).
#[pyfunction]
pub(crate) fn read_picture(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyAny>> {
    let picture = run(py, None, u64::MAX, |_| read_image(&path))?;
    of_image(py, picture)
}

/// Writes a picture; the extension names the format.
#[pyfunction]
pub(crate) fn write_picture(py: Python<'_>, path: PathBuf, picture: &Bound<'_, PyAny>) -> PyResult<()> {
    let picture = image(picture)?;
    run(py, None, u64::MAX, |_| write_image(&picture, &path))
}
