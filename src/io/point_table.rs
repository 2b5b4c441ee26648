//! Points in the plane as CSV.

use std::path::Path;

use glam::DVec2;

use super::obj::shortened;
use super::table::Table;
use super::{finite, output};
use crate::{Error, Result};

/// Names of columns that are added where points are mapped.
const ADDED: [&str; 2] = ["j", "status"];

/// Points with what else their table holds.
#[derive(Clone, Debug, PartialEq)]
pub struct PointTable {
    /// The points, row after row.
    pub points: Vec<DVec2>,
    table: Table,
    /// Columns of x and y.
    columns: [usize; 2],
}

/// Reads points: a [`Table`] with columns `x` and `y`, whatever case and order, one point a row.
/// Empty lines are passed over.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] naming the line: another header, another number of cells, no
/// finite number.
pub fn read_point_table(path: impl AsRef<Path>) -> Result<PointTable> {
    from_table(Table::read(path)?)
}

/// [`read_point_table`] of a text; `name` stands in messages.
///
/// # Errors
/// As [`read_point_table`].
pub fn parse_point_table(text: &str, name: impl AsRef<Path>) -> Result<PointTable> {
    from_table(Table::parse_text(text, name)?)
}

fn from_table(mut table: Table) -> Result<PointTable> {
    const REMEDY: &str = "Write two finite numbers, as 1.5,2";
    const HEADER: &str = "Begin the file with the line x,y";
    let first = (!table.is_empty()).then(|| table.line(0));
    table.lift_header(|_, _| true);
    let Some(names) = table.names() else {
        return Err(Error::format(table.path(), None, "the file is empty", HEADER));
    };
    let (Some(x), Some(y)) = (table.column("x"), table.column("y")) else {
        let what = format!("the header is {:?}", shortened(&names.join(",")));
        return Err(Error::format(table.path(), first, what, HEADER));
    };
    table.check_widths(REMEDY)?;
    table.settle_decimals(&[x, y])?;
    let number = |row: usize, column: usize| {
        table.number(row, column).filter(|v| v.is_finite()).ok_or_else(|| {
            table.fail(row, format!("{:?} is not a finite number", shortened(table.cell(row, column))), REMEDY)
        })
    };
    let points = (0..table.len()).map(|r| Ok(DVec2::new(number(r, x)?, number(r, y)?))).collect::<Result<Vec<_>>>()?;
    Ok(PointTable { points, table, columns: [x, y] })
}

impl PointTable {
    /// What was passed over or assumed; one sentence each.
    pub fn notes(&self) -> &[String] {
        self.table.notes()
    }

    /// The names of the added columns, with a number where the table has such a column already.
    fn added(&self) -> [String; 2] {
        ADDED.map(|name| {
            let free = |n: &String| self.table.column(n).is_none();
            let numbered = (2..).map(|k| format!("{name}_{k}"));
            std::iter::once(name.to_owned()).chain(numbered).find(free).unwrap_or_default()
        })
    }
}

/// One row of a table of mapped points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointRow {
    /// Where the point goes and the Jacobian of the map, or nothing where it was not found.
    pub point: Option<(DVec2, f64)>,
}

/// Writes mapped points: the rows and columns of `table` in its dialect, x and y replaced, with
/// round-trip precision, and behind them `j` if `jacobian`, and `status`: `ok`, or `failed`, and
/// then the cells of the point are empty.
///
/// # Errors
/// [`Error::Io`]; [`Error::NotFinite`] for a number that is not finite; [`Error::Input`] if there
/// are not as many rows as points.
pub fn write_point_table(path: impl AsRef<Path>, table: &PointTable, rows: &[PointRow], jacobian: bool) -> Result<()> {
    let path = path.as_ref();
    let PointTable { table: given, columns, .. } = table;
    if rows.len() != given.len() {
        let what = format!("{} mapped points for {} rows", rows.len(), given.len());
        return Err(Error::input(what, "Give one for each row"));
    }
    let cells = |(p, j): (DVec2, f64)| [p.x, p.y, if jacobian { j } else { 0.0 }];
    for (k, point) in rows.iter().enumerate().filter_map(|(k, row)| Some((k, row.point?))) {
        finite::numbers(path, cells(point), |i| format!("row {k}, {}", ["x", "y", "j"][i]))?;
    }
    let added = table.added();
    let added = &added[usize::from(!jacobian)..];
    output::write_atomically(path, |w| {
        let all = || {
            let mut w = given.writer(w)?;
            w.texts(given.raw_header().chain(added.iter().map(String::as_str)))?;
            w.end_row()?;
            for (r, row) in rows.iter().enumerate() {
                for column in 0..given.width() {
                    match (columns.iter().position(|c| *c == column), row.point) {
                        (Some(k), Some((p, _))) => w.number(format_args!("{:?}", p[k]))?,
                        (Some(_), None) => w.text("")?,
                        (None, _) => w.text(given.raw(r, column))?,
                    }
                }
                match row.point {
                    Some((_, j)) if jacobian => w.number(format_args!("{j:?}"))?,
                    None if jacobian => w.text("")?,
                    _ => {}
                }
                w.text(if row.point.is_some() { "ok" } else { "failed" })?;
                w.end_row()?;
            }
            w.finish()
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
        let table = read_point_table(&path).unwrap();
        assert_eq!(table.points, [DVec2::new(0.1, -2.0), DVec2::new(1e-300, 7.25)]);
        write_point_table(&path, &table, &ROWS, true).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert_eq!(text, "\u{feff} x , y,j,status\r\n0.3333333333333333,-0.0,2.5,ok\r\n,,,failed\r\n");
        write_point_table(&path, &parse_point_table("x,y\n0,0\n1,1\n", "p").unwrap(), &ROWS, false).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "x,y,status\n0.3333333333333333,-0.0,ok\n,,failed\n");
        assert!(write_point_table(&path, &table, &ROWS[..1], true).is_err());
    }

    const ROWS: [PointRow; 2] =
        [PointRow { point: Some((DVec2::new(1.0 / 3.0, -0.0), 2.5)) }, PointRow { point: None }];

    #[test]
    fn other_columns_and_the_dialect_are_kept() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("p.csv");
        for (given, expected) in [
            (
                "id,x,y,name\n7,10,10,\"a, b\"\n8,1,1,c\n",
                "id,x,y,name,j,status\n7,0.3333333333333333,-0.0,\"a, b\",2.5,ok\n8,,,c,,failed\n",
            ),
            (
                "# survey\nName;Y;X\nä;1,5;2\n;3;4,5\n",
                "# survey\nName;Y;X;j;status\nä;-0,0;0,3333333333333333;2,5;ok\n;;;;failed\n",
            ),
            (
                "x\ty\tstatus\n1\t2\tnew\n3\t4\told\n",
                "x\ty\tstatus\tj\tstatus_2\n0.3333333333333333\t-0.0\tnew\t2.5\tok\n\t\told\t\tfailed\n",
            ),
            ("x y\n1 2\n3 4\n", "x,y,j,status\n0.3333333333333333,-0.0,2.5,ok\n,,,failed\n"),
        ] {
            let table = parse_point_table(given, "p").unwrap();
            write_point_table(&path, &table, &ROWS, true).unwrap();
            assert_eq!(std::fs::read_to_string(&path).unwrap(), expected);
        }
    }

    #[test]
    fn mistakes_name_their_line() {
        for (text, expected) in [
            ("", "empty"),
            ("\n \n", "empty"),
            ("1,2\n", "line 1"),
            ("x,z\n1,2\n", "x,z"),
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
        assert_eq!(parse_point_table("x,y\n", "p").unwrap().points, []);
    }

    proptest! {
        #[test]
        fn any_text_is_read_or_refused(text in "(x,y\n)?[-xy,0-9eEna.\n\r \u{feff}]{0,60}") {
            if let Ok(table) = parse_point_table(&text, "p") {
                prop_assert!(table.points.iter().all(|p| p.is_finite()));
            }
        }

        #[test]
        fn numbers_survive(points in prop::collection::vec((any::<f64>(), any::<f64>()), 0..20)) {
            let points: Vec<_> = points.into_iter().filter(|p| p.0.is_finite() && p.1.is_finite()).collect();
            let text: String = points.iter().map(|p| format!("{:?},{:?}\n", p.0, p.1)).collect();
            let read = parse_point_table(&format!("x,y\n{text}"), "p").unwrap().points;
            prop_assert_eq!(read.iter().map(|p| (p.x, p.y)).collect::<Vec<_>>(), points);
        }
    }
}
