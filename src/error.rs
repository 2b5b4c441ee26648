//! The one error type of the crate.
//!
//! Every message says what is wrong, where (file, line, element) and what to do about it, so that
//! the command line can print it as it stands.

use std::path::{Path, PathBuf};

/// What can go wrong in barymap.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file could not be opened, read or written.
    #[error("{path}: {source}. {remedy}", path = path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
        /// What the user can do.
        remedy: String,
    },
    /// A file was read but its content is not what its format asks for.
    #[error("{path}{place}: {what}. {remedy}", path = path.display(), place = line.map(|l| format!(", line {l}")).unwrap_or_default())]
    Format {
        /// The file.
        path: PathBuf,
        /// 1-based line, where the format has lines.
        line: Option<usize>,
        /// What is wrong.
        what: String,
        /// What the user can do.
        remedy: String,
    },
    /// A mesh cannot be used for what was asked.
    #[error("mesh {name}: {what}. {remedy}")]
    Mesh {
        /// Name of the mesh, usually its file.
        name: String,
        /// What is wrong, with the element's index.
        what: String,
        /// What the user can do.
        remedy: String,
    },
    /// Anchors, weights or points do not fit the mesh or one another.
    #[error("{what}. {remedy}")]
    Input {
        /// What is wrong, with the element's index.
        what: String,
        /// What the user can do.
        remedy: String,
    },
    /// An option has a value outside its range.
    #[error("option {option}: {what}. {remedy}")]
    Option {
        /// The option as the command line or the library spells it.
        option: String,
        /// What is wrong with its value.
        what: String,
        /// What the user can do.
        remedy: String,
    },
    /// No graphics adapter could be used.
    #[error("no usable graphics adapter: {what}. {remedy}")]
    NoAdapter {
        /// What was looked for and found.
        what: String,
        /// What to do.
        remedy: String,
    },
    /// The adapter lacks something a kernel needs.
    #[error("the adapter offers {actual} of {limit}, {required} are needed. Use --backend cpu or another adapter")]
    Capability {
        /// Name of the limit.
        limit: String,
        /// What is needed.
        required: u64,
        /// What there is.
        actual: u64,
    },
    /// The device was lost, ran out of memory or refused a command.
    #[error("graphics device: {what}. {remedy}")]
    Device {
        /// What the device or driver said.
        what: String,
        /// What the user can do.
        remedy: String,
    },
    /// The work would need more memory than the user allows.
    #[error("{what} needs {required} bytes, {allowed} are allowed. Raise --memory or lower the size")]
    Memory {
        /// What needs it.
        what: String,
        /// Bytes needed.
        required: u64,
        /// Bytes allowed.
        allowed: u64,
    },
    /// An output would hold a number that is NaN or infinite; it is not written.
    #[error("{path}: {element} would be {value}, which is not written. {remedy}", path = path.display())]
    NotFinite {
        /// The file that is not written.
        path: PathBuf,
        /// Where in the file: a vertex, a row and column, a key.
        element: String,
        /// NaN or infinity.
        value: f64,
        /// What the user can do.
        remedy: String,
    },
    /// The work was cancelled by its [`Control`](crate::control::Control).
    #[error("the work was cancelled")]
    Cancelled,
    /// The input was read, and no result comes of it that would be worth writing.
    #[error("{what}. {remedy}")]
    Unusable {
        /// Why not.
        what: String,
        /// What the user can do.
        remedy: String,
    },
    /// Some of several results failed; all others are done.
    #[error("{what}. {remedy}")]
    Incomplete {
        /// Which ones failed.
        what: String,
        /// What the user can do.
        remedy: String,
    },
    /// A numerical step failed (a factorisation that broke down, an embedding that is not finite).
    #[error("{what}. {remedy}")]
    Numeric {
        /// Which step, on which input.
        what: String,
        /// What the user can do.
        remedy: String,
    },
}

/// Shorthand for results of this crate.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// An [`Error::Io`] on `path`.
    pub fn io(path: impl AsRef<Path>, source: std::io::Error, remedy: impl Into<String>) -> Self {
        Self::Io { path: path.as_ref().to_path_buf(), source, remedy: remedy.into() }
    }

    /// An [`Error::Format`] of `path` at a 1-based `line`.
    pub fn format(
        path: impl AsRef<Path>,
        line: Option<usize>,
        what: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Self::Format { path: path.as_ref().to_path_buf(), line, what: what.into(), remedy: remedy.into() }
    }

    /// An [`Error::Input`].
    pub fn input(what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Input { what: what.into(), remedy: remedy.into() }
    }

    /// An [`Error::Mesh`].
    pub fn mesh(name: impl Into<String>, what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Mesh { name: name.into(), what: what.into(), remedy: remedy.into() }
    }

    /// An [`Error::Option`].
    pub fn option(option: impl Into<String>, what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Option { option: option.into(), what: what.into(), remedy: remedy.into() }
    }

    /// An [`Error::Unusable`].
    pub fn unusable(what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Unusable { what: what.into(), remedy: remedy.into() }
    }

    /// An [`Error::Numeric`].
    pub fn numeric(what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Numeric { what: what.into(), remedy: remedy.into() }
    }
}
