//! Opening files.

use std::fs::{self, File};
use std::io::{self, BufReader, Read};
use std::path::Path;

use crate::{Error, Result, control};

/// Opens a regular file for reading. What it is is seen before it is opened: opening a pipe waits
/// for somebody to write.
pub(crate) fn open(path: &Path) -> Result<BufReader<File>> {
    let missing = "Check the path and that the file may be read";
    let metadata = fs::metadata(path).map_err(|e| Error::io(path, e, missing))?;
    if !metadata.is_file() {
        let kind = if metadata.is_dir() { "this is a folder" } else { "this is a pipe or a device, not a file" };
        return Err(Error::io(path, io::Error::new(io::ErrorKind::InvalidInput, kind), "Name a file"));
    }
    let file = File::open(path).map_err(|e| Error::io(path, e, missing))?;
    Ok(BufReader::with_capacity(1 << 16, file))
}

/// The bytes of a regular file.
pub(crate) fn read_all(path: &Path) -> Result<Vec<u8>> {
    let mut file = open(path)?;
    let length = file.get_ref().metadata().map_or(0, |m| m.len());
    control::require(length, || format!("reading {}", path.display()))?;
    let mut bytes = Vec::with_capacity(usize::try_from(length).unwrap_or(0));
    file.read_to_end(&mut bytes).map_err(|e| Error::io(path, e, "Check that the file may be read"))?;
    Ok(bytes)
}
