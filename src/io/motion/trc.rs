//! TRC: markers as tab-separated text, by Motion Analysis; read and written by OpenSim.

use std::path::Path;

use glam::DVec3;

use super::{Clip, Motion, shortened, unit};
use crate::io::encoding;
use crate::io::source::Notes;
use crate::{Error, Result};

/// Reads a TRC file: three lines of header, two of column names, one row a frame. Empty cells are
/// gaps.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] naming the line, for a header without markers or a cell that is
/// not a number.
pub fn read_trc(path: impl AsRef<Path>) -> Result<Motion> {
    let path = path.as_ref();
    let text = encoding::read_text(path)?;
    let mut motion = parse(&text.text, path)?;
    motion.warnings.extend(text.note);
    Ok(motion)
}

pub(super) fn parse(text: &str, path: &Path) -> Result<Motion> {
    let cut = |line: usize, what: &str| {
        Error::format(path, Some(line), format!("{what} is missing"), "Export the file again as TRC")
    };
    // Old Macs end lines in CR alone.
    let end = if text.contains('\n') { '\n' } else { '\r' };
    let mut lines = text.split(end).enumerate().map(|(k, line)| (k + 1, line.trim_end_matches('\r')));
    let (_, first) = lines.next().ok_or_else(|| cut(1, "the header"))?;
    if !first.trim_start().starts_with("PathFileType") {
        let what = "a TRC file begins with PathFileType";
        return Err(Error::format(path, Some(1), what, "Name a TRC file"));
    }
    let (_, keys) = lines.next().ok_or_else(|| cut(2, "the line of keys"))?;
    let (_, values) = lines.next().ok_or_else(|| cut(3, "the line of values"))?;
    let header = |key: &str| {
        keys.split_whitespace()
            .zip(values.split_whitespace())
            .find(|(k, _)| k.eq_ignore_ascii_case(key))
            .map(|(_, v)| v)
    };
    let number = |key| header(key).and_then(|v| v.parse::<f64>().ok());

    let (line, columns) = lines.next().ok_or_else(|| cut(4, "the line of marker names"))?;
    let names = marker_names(columns);
    if names.is_empty() {
        return Err(cut(line, "every marker name"));
    }
    let mut notes = Notes::default();
    if let Some(declared) = number("NumMarkers").filter(|&n| n != names.len() as f64) {
        notes.say(format!("the header counts {declared} markers, there are {} names", names.len()));
    }
    let mut clip = Clip::new(path, names, notes)?;
    for (line, text) in lines {
        // The second line of column names (X1, Y1, Z1, ...) and the empty one after it.
        if text.trim().is_empty() || (clip.frames.is_empty() && text.trim_start().starts_with(['X', 'x'])) {
            continue;
        }
        let frame = row(text, &clip.names, path, line)?;
        clip.push(frame, Some(line))?;
    }
    if let Some(declared) = number("NumFrames").filter(|&n| n > clip.frames.len() as f64) {
        let what = format!("the header counts {declared} frames, there are {}", clip.frames.len());
        return Err(Error::format(path, None, what, "Fetch or export the file again, or correct NumFrames"));
    }
    clip.finish(number("DataRate"), header("Units").and_then(unit))
}

/// Names stand above the first of three columns each, after `Frame#` and `Time`.
fn marker_names(columns: &str) -> Vec<String> {
    let names: Vec<&str> = columns.split('\t').map(str::trim).filter(|n| !n.is_empty()).collect();
    // Some programs separate by blanks.
    let names = if names.len() < 3 { columns.split_whitespace().collect() } else { names };
    names.into_iter().skip(2).map(str::to_owned).collect()
}

fn row(text: &str, names: &[String], path: &Path, line: usize) -> Result<Vec<Option<DVec3>>> {
    let cells: Vec<&str> =
        if text.contains('\t') { text.split('\t').map(str::trim).collect() } else { text.split_whitespace().collect() };
    let limit = 2 + 3 * names.len();
    if cells.len() > limit && cells[limit..].iter().any(|c| !c.is_empty()) {
        let what = format!("{} cells in the row, {} markers have {limit}", cells.len(), names.len());
        return Err(Error::format(path, Some(line), what, "Correct the row or the marker names"));
    }
    let cells = &cells[2.min(cells.len())..limit.min(cells.len())];
    cells.chunks(3).zip(names).map(|(cells, name)| point(cells, name, path, line)).collect()
}

/// Three cells as a position; a gap if one of them is empty, missing or not finite.
fn point(cells: &[&str], name: &str, path: &Path, line: usize) -> Result<Option<DVec3>> {
    let mut xyz = [f64::NAN; 3];
    for (x, cell) in xyz.iter_mut().zip(cells) {
        if cell.is_empty() {
            return Ok(None);
        }
        *x = cell.parse().map_err(|_| {
            let what = format!("marker {}: {:?} is not a number", shortened(name), shortened(cell));
            Error::format(path, Some(line), what, "Write numbers with a decimal point, and leave gaps empty")
        })?;
    }
    let p = DVec3::from(xyz);
    Ok(p.is_finite().then_some(p))
}
