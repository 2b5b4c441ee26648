//! Points in the plane as CSV.

use std::io::Write;
use std::path::Path;

use glam::DVec2;

use super::obj::shortened;
use super::{output, source};
use crate::{Error, Result};

/// Reads points: CSV with the header `x,y`, one point a line. Empty lines are passed over.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] naming the line: another header, another number of cells, no finite number.
pub fn read_point_table(path: impl AsRef<Path>) -> Result<Vec<DVec2>> {
    let path = path.as_ref();
    parse_point_table(&source::read_text(path)?, path)
}

/// [`read_point_table`] of a text; `name` stands in messages.
///
/// # Errors
/// As [`read_point_table`].
pub fn parse_point_table(text: &str, name: impl AsRef<Path>) -> Result<Vec<DVec2>> {
    let name = name.as_ref();
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    let header: Option<(usize, String)> =
        lines.next().map(|(k, line)| (k + 1, line.split(',').map(str::trim).collect::<Vec<_>>().join(",")));
    match &header {
        Some((_, header)) if header == "x,y" => {}
        Some((line, header)) => {
            let what = format!("the header is {:?}", shortened(header));
            return Err(Error::format(name, Some(*line), what, "Begin the file with the line x,y"));
        }
        None => return Err(Error::format(name, None, "the file is empty", "Begin it with the line x,y")),
    }
    lines
        .map(|(k, line)| {
            let fail = |what: String| Error::format(name, Some(k + 1), what, "Write two finite numbers, as 1.5,2");
            let cells: Vec<&str> = line.split(',').map(str::trim).collect();
            let [x, y] = cells[..] else { return Err(fail(format!("{} cells of 2", cells.len()))) };
            let number = |cell: &str| {
                let value = cell.parse::<f64>().ok().filter(|v| v.is_finite());
                value.ok_or_else(|| fail(format!("{:?} is not a finite number", shortened(cell))))
            };
            Ok(DVec2::new(number(x)?, number(y)?))
        })
        .collect()
}

/// One row of a table of mapped points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointRow {
    /// Where the point goes and the Jacobian of the map, or nothing where it was not found.
    pub point: Option<(DVec2, f64)>,
}

/// Writes mapped points with the header `x,y,status`, or `x,y,j,status` if `jacobian`, with round-trip precision; the status is `ok`
/// or `failed`, and then the other cells are empty.
///
/// # Errors
/// [`Error::Io`].
pub fn write_point_table(
    path: impl AsRef<Path>,
    rows: impl IntoIterator<Item = PointRow>,
    jacobian: bool,
) -> Result<()> {
    let path = path.as_ref();
    output::write_atomically(path, |w| {
        let all = || {
            writeln!(w, "{}", if jacobian { "x,y,j,status" } else { "x,y,status" })?;
            rows.into_iter().try_for_each(|row| match (row.point, jacobian) {
                (Some((p, j)), true) => writeln!(w, "{:?},{:?},{j:?},ok", p.x, p.y),
                (Some((p, _)), false) => writeln!(w, "{:?},{:?},ok", p.x, p.y),
                (None, true) => writeln!(w, ",,,failed"),
                (None, false) => writeln!(w, ",,failed"),
            })
        };
        all().map_err(output::failed(path))
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn rows_keep_their_order_and_digits() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("p.csv");
        std::fs::write(&path, "\u{feff} x , y\r\n0.1,-2\r\n\r\n1e-300, 7.25 \n").unwrap();
        assert_eq!(read_point_table(&path).unwrap(), [DVec2::new(0.1, -2.0), DVec2::new(1e-300, 7.25)]);
        let rows = [PointRow { point: Some((DVec2::new(1.0 / 3.0, -0.0), 2.5)) }, PointRow { point: None }];
        write_point_table(&path, rows, true).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert_eq!(text, "x,y,j,status\n0.3333333333333333,-0.0,2.5,ok\n,,,failed\n");
        write_point_table(&path, rows, false).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "x,y,status\n0.3333333333333333,-0.0,ok\n,,failed\n");
    }

    #[test]
    fn mistakes_name_their_line() {
        for (text, expected) in [
            ("", "empty"),
            ("\n \n", "empty"),
            ("1,2\n", "line 1"),
            ("x,y,z\n", "x,y,z"),
            ("x,y\n1\n", "line 2: 1 cells"),
            ("x,y\n\n1,2,3\n", "line 3: 3 cells"),
            ("x,y\n1,nan\n", "\"nan\""),
            ("x,y\ninf,1\n", "\"inf\""),
            ("x,y\n1,1e999\n", "1e999"),
            ("x,y\na,1\n", "\"a\""),
            ("x,y\n1,\n", "\"\""),
        ] {
            let message = parse_point_table(text, "p.csv").unwrap_err().to_string();
            assert!(message.contains(expected) && message.contains("p.csv"), "{text:?}: {message}");
        }
        assert_eq!(parse_point_table("x,y\n", "p").unwrap(), []);
    }

    proptest! {
        #[test]
        fn any_text_is_read_or_refused(text in "(x,y\n)?[-xy,0-9eEna.\n\r \u{feff}]{0,60}") {
            if let Ok(points) = parse_point_table(&text, "p") {
                prop_assert!(points.iter().all(|p| p.is_finite()));
            }
        }

        #[test]
        fn numbers_survive(points in prop::collection::vec((any::<f64>(), any::<f64>()), 0..20)) {
            let points: Vec<_> = points.into_iter().filter(|p| p.0.is_finite() && p.1.is_finite()).collect();
            let text: String = points.iter().map(|p| format!("{:?},{:?}\n", p.0, p.1)).collect();
            let read = parse_point_table(&format!("x,y\n{text}"), "p").unwrap();
            prop_assert_eq!(read.iter().map(|p| (p.x, p.y)).collect::<Vec<_>>(), points);
        }
    }
}
