//! CSV as Motive (OptiTrack) exports it: rows of kinds, names, numbers and properties above the
//! columns.
//!
//! ```text
//! Format Version,1.23,Take Name,walk,...,Export Frame Rate,120.0,...,Length Units,Meters,Coordinate Space,Global
//! ,Type,Rigid Body,Rigid Body,...,Marker,Marker,Marker
//! ,Name,Head,Head,...,LKNE,LKNE,LKNE
//! ,ID,1,1,...,2,2,2
//! ,,Rotation,Rotation,...,Position,Position,Position
//! Frame,Time (Seconds),X,Y,...,X,Y,Z
//! ```
//!
//! Older versions leave the words `Type`, `Name` and `ID` out, newer ones add a row `Parent`. Rigid
//! bodies and bones are points at their pivots.

use super::csv::{Row, assemble, point};
use super::{Motion, check_size, unit};
use crate::io::source::Notes;
use crate::io::table::Table;
use crate::{Error, Result};

const REMEDY: &str = "Export the take as CSV with markers, rigid bodies or bones and their positions";

/// Whether a table is Motive's, by its first words.
pub(super) fn is_motive(table: &Table) -> bool {
    !table.is_empty() && table.cell(0, 0).eq_ignore_ascii_case("format version")
}

/// Reads such a table.
///
/// # Errors
/// [`Error::Format`] naming the line: no row that begins with `Frame`, no positions, a cell that is
/// no number.
pub(super) fn parse(mut table: Table) -> Result<Motion> {
    let path = table.path().to_path_buf();
    let head = (0..table.len()).find(|&r| table.cell(r, 0).eq_ignore_ascii_case("frame"));
    let Some(head) = head.filter(|&r| r >= 3) else {
        return Err(Error::format(&path, None, "the columns of Motive have no row that begins with Frame", REMEDY));
    };
    let value = |key: &str| {
        let place = (0..table.cells(0)).step_by(2).find(|&c| table.cell(0, c).eq_ignore_ascii_case(key))?;
        Some(table.cell(0, place + 1).to_owned()).filter(|v| !v.is_empty())
    };
    let rate = ["Export Frame Rate", "Capture Frame Rate"].iter().find_map(|k| value(k)?.parse::<f64>().ok());
    let metres = value("Length Units").and_then(|u| unit(&u));
    let turned = value("Coordinate Space").filter(|s| !s.eq_ignore_ascii_case("global"));

    // Rows between the first and the columns: by their words, else kinds, names, numbers.
    let labelled = |word: &str| (1..head).find(|&r| table.cell(r, 1).eq_ignore_ascii_case(word));
    let names = labelled("name").unwrap_or(2.min(head - 2));
    let kinds = labelled("type").unwrap_or(1);
    let properties = head - 1;
    let is = |row: usize, column: usize, word: &str| table.cell(row, column).eq_ignore_ascii_case(word);
    let mut points: Vec<(String, [usize; 3])> = Vec::new();
    let mut turning = 0;
    for column in 2..table.cells(head) {
        turning += usize::from(is(properties, column, "rotation") && is(head, column, "x"));
        let axes = ["x", "y", "z"].iter().enumerate().all(|(k, axis)| is(head, column + k, axis));
        let whole = axes && (0..3).all(|k| is(properties, column + k, "position"));
        if whole {
            points.push((table.cell(names, column).to_owned(), [column, column + 1, column + 2]));
        }
    }
    if points.is_empty() {
        return Err(Error::format(&path, Some(table.line(head)), "there are no columns of positions", REMEDY));
    }
    let mut notes = Notes::default();
    table.notes().iter().for_each(|note| notes.say(note.clone()));
    if turning > 0 {
        notes.say(format!("rotations of {turning} rigid bodies or bones are not used, their positions are"));
    }
    if let Some(space) = turned {
        notes.say(format!("the coordinates are {space:?}, not global: what moves is told from each body's own place"));
    }
    // A marker that is measured and one that a body predicts may have one name.
    let kinds: Vec<String> = points.iter().map(|(_, [x, ..])| table.cell(kinds, *x).to_owned()).collect();
    let twice = |k: usize| points.iter().filter(|p| p.0 == points[k].0).count() > 1;
    let names: Vec<String> = (0..points.len())
        .map(|k| {
            if twice(k) && k > 0 && points[..k].iter().any(|p| p.0 == points[k].0) {
                format!("{} ({})", points[k].0, kinds[k])
            } else {
                points[k].0.clone()
            }
        })
        .collect();

    let read: Vec<usize> = [0, 1].into_iter().chain(points.iter().flat_map(|p| p.1)).collect();
    table.drop_rows(head + 1);
    table.settle_decimals(&read)?;
    check_size(&path, table.len(), points.len())?;
    let mut rows = Vec::with_capacity(table.len());
    for r in 0..table.len() {
        let mut found = Vec::new();
        for (k, (name, columns)) in points.iter().enumerate() {
            found.extend(point(&table, r, columns, name)?.map(|p| (k, p)));
        }
        let number = |column: usize| table.number(r, column).filter(|x| x.is_finite());
        let Some(frame) = number(0) else {
            return Err(table.fail(r, format!("{:?} is not a frame number", table.cell(r, 0)), REMEDY));
        };
        rows.push(Row { line: table.line(r), frame: Some(frame), time: number(1), points: found });
    }
    assemble(&path, names, rows, false, rate, metres, notes)
}
