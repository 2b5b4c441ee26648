//! Errors of the library as exceptions with fields.

use barymap::Error;
use pyo3::prelude::*;

/// The exception of `barymap.errors` for an error: its class, what is wrong, where, and what to do.
pub(crate) fn exception(py: Python<'_>, error: &Error) -> PyErr {
    let (class, what, place, remedy) = parts(error);
    raised(py, class, &what, place.as_deref(), &remedy)
}

/// An exception of `barymap.errors`.
pub(crate) fn raised(py: Python<'_>, class: &str, what: &str, place: Option<&str>, remedy: &str) -> PyErr {
    let made = py
        .import("barymap.errors")
        .and_then(|module| module.getattr(class))
        .and_then(|class| class.call1((what, place, remedy)));
    match made {
        Ok(value) => PyErr::from_value(value),
        Err(error) => error,
    }
}

/// Class, what, where, remedy.
fn parts(error: &Error) -> (&'static str, String, Option<String>, String) {
    let with =
        |class, what: &str, place: Option<String>, remedy: &str| (class, what.to_owned(), place, remedy.to_owned());
    match error {
        Error::Io { path, source, remedy } => {
            with("FileError", &source.to_string(), Some(path.display().to_string()), remedy)
        }
        Error::Format { path, line, what, remedy } => {
            let line = line.map_or_else(String::new, |l| format!(", line {l}"));
            with("FormatError", what, Some(format!("{}{line}", path.display())), remedy)
        }
        Error::Mesh { name, what, remedy } => with("MeshError", what, Some(format!("mesh {name}")), remedy),
        Error::Input { what, remedy } => with("InputError", what, None, remedy),
        Error::Option { option, what, remedy } => {
            let name = option.trim_start_matches('-').replace('-', "_");
            with("OptionError", what, Some(name), remedy)
        }
        Error::NoAdapter { what, remedy } | Error::Device { what, remedy } => with("DeviceError", what, None, remedy),
        Error::Capability { .. } => with("DeviceError", &error.to_string(), None, "Use backend=\"cpu\""),
        Error::Memory { what, required, allowed } => {
            let what = format!("{what} needs {required} bytes, {allowed} are allowed");
            with("TooLargeError", &what, None, "Raise memory, or lower the size")
        }
        Error::NotFinite { element, value, remedy, .. } => {
            with("NumericError", &format!("{element} would be {value}"), None, remedy)
        }
        Error::Cancelled => with("CancelledError", "the work was cancelled", None, "Call it again"),
        Error::Unusable { what, remedy } => with("UnusableError", what, None, remedy),
        Error::Incomplete { what, remedy } => with("IncompleteError", what, None, remedy),
        Error::Numeric { what, remedy } => with("NumericError", what, None, remedy),
        other => with("BarymapError", &other.to_string(), None, "See what is said of the cause"),
    }
}
