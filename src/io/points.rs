//! Points on surfaces, maps and weights as CSV.

use std::io::Write;
use std::path::Path;

use glam::DVec3;

use super::anchors::normalised;
use super::npy::read_npy;
use super::obj::shortened;
use super::table::Table;
use super::{finite, output};
use crate::geometry::{Mesh, SurfacePoint};
use crate::{Error, Result};

/// One row of a map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapRow {
    /// The target vertex, or the row of the given points.
    pub index: u64,
    /// The source point and its position, or nothing.
    pub point: Option<(SurfacePoint, DVec3)>,
    /// `valid`, `doubtful` or `failed`.
    pub status: &'static str,
    /// Between 0 and 1.
    pub confidence: f64,
}

/// The first line of a map file.
#[doc(hidden)]
pub const MAP_HEADER: &str = "index,face,b0,b1,b2,x,y,z,status,confidence";

/// The header of a file of points.
const POINT_HEADER: [&str; 4] = ["face", "b0", "b1", "b2"];

/// A table of which some columns have been read; the others go into what is written in answer, in
/// its dialect.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Answered {
    table: Table,
    /// The columns that have not been read.
    others: Vec<usize>,
}

impl Answered {
    fn new(table: Table, read: &[usize]) -> Self {
        let others = (0..table.width()).filter(|c| !read.contains(c)).collect();
        Self { table, others }
    }

    /// What was passed over or assumed; one sentence each.
    pub fn notes(&self) -> &[String] {
        self.table.notes()
    }

    /// The names of the columns that have not been read.
    pub fn others(&self) -> Vec<String> {
        let names = self.table.names().unwrap_or_default();
        self.others.iter().map(|&c| names.get(c).map_or_else(|| format!("column {c}"), |n| (*n).to_owned())).collect()
    }

    /// Those names, changed where they are among `taken`.
    fn titles(&self, taken: &[&str]) -> Vec<String> {
        let is_taken = |n: &str| taken.iter().any(|t| t.eq_ignore_ascii_case(n));
        self.others().into_iter().map(|n| if is_taken(&n) { format!("{n}_given") } else { n }).collect()
    }

    /// Writes a table with the columns `header`, filled by `row`, and behind them those that have
    /// not been read.
    fn write<W: Write>(
        &self,
        out: W,
        header: &[&str],
        rows: usize,
        mut row: impl FnMut(&mut super::table_dialect::TableWriter<W>, usize) -> std::io::Result<()>,
    ) -> std::io::Result<()> {
        let mut w = self.table.writer(out)?;
        w.texts(header.iter().copied())?;
        w.texts(self.titles(header).iter().map(String::as_str))?;
        w.end_row()?;
        for r in 0..rows {
            row(&mut w, r)?;
            w.texts(self.others.iter().map(|&c| self.table.raw(r, c)))?;
            w.end_row()?;
        }
        w.finish()
    }
}

/// Reads points of `mesh`: a [`Table`] with columns `face`, `b0`, `b1` and `b2`, whatever case and
/// order, one point a row; and the table itself.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] naming the line: another header, a face out of range,
/// coordinates that are no point of the face.
pub fn read_points(path: impl AsRef<Path>, mesh: &Mesh) -> Result<(Vec<SurfacePoint>, Answered)> {
    const REMEDY: &str = "Write face,b0,b1,b2: a face from 0 and three coordinates of sum 1";
    let mut table = Table::read(path)?;
    table.lift_header(|_, _| true);
    let found: Vec<usize> = POINT_HEADER.iter().filter_map(|name| table.column(name)).collect();
    let [face, a, b, c] = found[..] else { return Err(no_header(&table)) };
    table.check_widths(REMEDY)?;
    table.settle_decimals(&[a, b, c])?;
    let point = |row: usize| {
        let fail = |what: String| table.fail(row, what, REMEDY);
        let cell = table.cell(row, face);
        let face = cell.parse::<u32>().map_err(|_| fail(format!("{:?} is not a face index", shortened(cell))))?;
        let count = mesh.file_triangle_count();
        if face as usize >= count {
            return Err(fail(format!("face {face} of the {count} of {}", mesh.name)));
        }
        let number = |column: usize| {
            let what = || format!("{:?} is not a number", shortened(table.cell(row, column)));
            table.number(row, column).ok_or_else(|| fail(what()))
        };
        let place = normalised([number(a)?, number(b)?, number(c)?]).map_err(fail)?;
        Ok(mesh.point_from_file(SurfacePoint::new(face, place)))
    };
    let points = (0..table.len()).map(point).collect::<Result<_>>()?;
    Ok((points, Answered::new(table, &found)))
}

fn no_header(table: &Table) -> Error {
    let what = format!("the header is {:?}", shortened(&table.names().unwrap_or_default().join(",")));
    Error::format(table.path(), Some(1), what, "Begin the file with the line face,b0,b1,b2")
}

/// Writes points as [`read_points`] reads them, with round-trip precision; `answered` is the table
/// that they answer, or an empty one.
///
/// # Errors
/// [`Error::Io`]; [`Error::NotFinite`] for a coordinate that is not finite; [`Error::Input`] if
/// they are not as many as its rows.
pub fn write_points(path: impl AsRef<Path>, points: &[SurfacePoint], answered: &Answered) -> Result<()> {
    let path = path.as_ref();
    answered.check(points.len())?;
    finite::numbers(path, points.iter().flat_map(|p| p.barycentric), |i| format!("row {}, b{}", i / 3, i % 3))?;
    output::write_atomically(path, |w| {
        let all = answered.write(w, &POINT_HEADER, points.len(), |w, r| {
            let SurfacePoint { face, barycentric } = points[r];
            w.number(format_args!("{face}"))?;
            barycentric.iter().try_for_each(|b| w.number(format_args!("{b:?}")))
        });
        all.map_err(output::failed(path))
    })
}

/// Writes a map with the header [`MAP_HEADER`]; the cells of a row without a point are empty.
/// `answered` is the table of the points, or an empty one.
///
/// # Errors
/// [`Error::Io`]; [`Error::NotFinite`] for a number that is not finite; [`Error::Input`] if there
/// are not as many rows as in the table.
pub fn write_map(path: impl AsRef<Path>, rows: &[MapRow], answered: &Answered) -> Result<()> {
    let path = path.as_ref();
    answered.check(rows.len())?;
    for MapRow { index, point, confidence, .. } in rows {
        let numbers = point.iter().flat_map(|(s, p)| s.barycentric.into_iter().chain(p.to_array()));
        finite::numbers(path, [*confidence].into_iter().chain(numbers), |i| {
            format!("row {index}, {}", ["confidence", "b0", "b1", "b2", "x", "y", "z"][i])
        })?;
    }
    let header: Vec<&str> = MAP_HEADER.split(',').collect();
    output::write_atomically(path, |w| {
        let all = answered.write(w, &header, rows.len(), |w, r| {
            let MapRow { index, point, status, confidence } = rows[r];
            w.number(format_args!("{index}"))?;
            match point {
                Some((SurfacePoint { face, barycentric }, p)) => {
                    w.number(format_args!("{face}"))?;
                    barycentric.iter().chain(&p.to_array()).try_for_each(|x| w.number(format_args!("{x:?}")))?;
                }
                None => w.texts([""; 7])?,
            }
            w.text(status)?;
            w.number(format_args!("{confidence:?}"))
        });
        all.map_err(output::failed(path))
    })
}

impl Answered {
    fn check(&self, rows: usize) -> Result<()> {
        if self.table.width() > 0 && self.table.len() != rows {
            let what = format!("{rows} rows in answer to {}", self.table.len());
            return Err(Error::input(what, "Give one for each row"));
        }
        Ok(())
    }
}

/// Reads weights: a [`Table`] with one query a row and `anchors` columns of numbers, with or
/// without a header, and the table itself, whose columns of text are no weights; or an NPY file, as
/// the inverse problem writes it.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] naming the line: another number of weights, one that is not a
/// finite number, no weights at all.
pub fn read_weights(path: impl AsRef<Path>, anchors: usize) -> Result<(Vec<Vec<f64>>, Answered)> {
    let path = path.as_ref();
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("npy")) {
        return Ok((read_weight_matrix(path, anchors)?, Answered::default()));
    }
    let mut table = Table::read(path)?;
    // A header has no number at all, which tells it from a row with a mistake.
    table.lift_header(|t, row| (0..t.cells(row)).all(|c| !t.is_number(row, c)));
    if table.is_empty() {
        return Err(Error::format(
            table.path(),
            None,
            "there are no weights",
            "Write one line of weights for each query",
        ));
    }
    let all = 0..table.width();
    let columns: Vec<usize> =
        if all.len() > anchors { all.filter(|&c| !table.is_text(c)).collect() } else { all.collect() };
    let width = table.width();
    for row in 0..table.len() {
        if columns.len() != anchors || table.cells(row) != width {
            let what = format!("{} weights for {anchors} anchors", table.cells(row) + columns.len() - width);
            return Err(table.fail(row, what, "Write one weight for each anchor on every line"));
        }
    }
    table.settle_decimals(&columns)?;
    let number = |row: usize, column: usize| {
        table.number(row, column).filter(|x| x.is_finite()).ok_or_else(|| {
            let what = format!("{:?} is not a finite number", shortened(table.cell(row, column)));
            table.fail(row, what, "Write decimal numbers")
        })
    };
    let weights = (0..table.len())
        .map(|r| columns.iter().map(|&c| number(r, c)).collect::<Result<Vec<f64>>>())
        .collect::<Result<_>>()?;
    Ok((weights, Answered::new(table, &columns)))
}

fn read_weight_matrix(path: &Path, anchors: usize) -> Result<Vec<Vec<f64>>> {
    let matrix = read_npy(path)?;
    let fail = |what: String, remedy: &str| Err(Error::format(path, None, what, remedy));
    if matrix.values.is_empty() {
        return fail("there are no weights".into(), "Write one row of weights for each query");
    }
    if matrix.columns != anchors {
        let what = format!("{} weights for {anchors} anchors", matrix.columns);
        return fail(what, "Write one weight for each anchor in every row");
    }
    if let Some(k) = matrix.values.iter().position(|x| !x.is_finite()) {
        let what = format!("row {}, column {}: {} is not a finite number", k / anchors, k % anchors, matrix.values[k]);
        return fail(what, "Ask for weights of points that lie on a part with anchors");
    }
    Ok(matrix.values.chunks(anchors).map(<[f64]>::to_vec).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_and_maps() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("p.csv");
        let mesh = Mesh::of_triangles("m", vec![DVec3::ZERO, DVec3::X, DVec3::Y], &[[0, 1, 2]]);
        let points = [SurfacePoint::new(0, [0.1, 0.2, 0.7]), SurfacePoint::new(0, [1.0, 0.0, 0.0])];
        write_points(&path, &points, &Answered::default()).unwrap();
        let back = read_points(&path, &mesh).unwrap().0;
        assert!((back[0].barycentric[2] - 0.7).abs() < 1e-15 && back[1] == points[1]);
        for (text, expected) in [
            ("", "header"),
            ("face,u,v\n", "header"),
            ("face,b0,b1,b2\n\n1,1,0,0\n", "line 3: face 1 of the 1"),
            ("face,b0,b1,b2\n0,1,0\n", "3 cells of 4"),
            ("face,b0,b1,b2\n0,nan,0,1\n", "sum to NaN"),
            ("face,b0,b1,b2\n0,1,x,0\n", "\"x\""),
            ("face,b0,b1,b2\n-1,1,0,0\n", "\"-1\""),
        ] {
            std::fs::write(&path, text).unwrap();
            let message = read_points(&path, &mesh).unwrap_err().to_string();
            assert!(message.contains(expected), "{text:?}: {message}");
        }
        let row =
            MapRow { index: 3, point: Some((points[1], DVec3::new(0.1, 2.0, 1e-9))), status: "valid", confidence: 0.5 };
        let rows = [row, MapRow { index: 4, point: None, status: "failed", confidence: 0.0 }];
        write_map(&path, &rows, &Answered::default()).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert_eq!(text, format!("{MAP_HEADER}\n3,0,1.0,0.0,0.0,0.1,2.0,1e-9,valid,0.5\n4,,,,,,,,failed,0.0\n"));
        assert!(text.lines().all(|line| line.split(',').count() == 10));
    }

    #[test]
    fn weights_with_and_without_header() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("w.csv");
        for text in [
            "0.5,0.5\n1,0\n",
            "a, b\r\n0.5 ,0.5\r\n\r\n1,0",
            "0,5;0,5\n1;0\n",
            "0.5 0.5\n1 0\n",
            "a,name,b\n0.5,p,0.5\n1,q,0\n",
        ] {
            std::fs::write(&path, text).unwrap();
            assert_eq!(read_weights(&path, 2).unwrap().0, [[0.5, 0.5], [1.0, 0.0]]);
        }
        for (text, expected) in [
            ("1,2,3\n", "3 weights for 2"),
            ("1,nan\n", "line 1"),
            ("a,b\n", "no weights"),
            ("1,x\n", "\"x\""),
            ("", "no weights"),
        ] {
            std::fs::write(&path, text).unwrap();
            let message = read_weights(&path, 2).unwrap_err().to_string();
            assert!(message.contains(expected), "{text:?}: {message}");
        }
    }

    #[test]
    fn other_columns_go_into_the_answer() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("p.csv");
        let mesh = Mesh::of_triangles("m", vec![DVec3::ZERO, DVec3::X, DVec3::Y], &[[0, 1, 2]]);
        std::fs::write(&path, "Name;B2;b1;B0;FACE;x\nknee;0,25;0,5;0,25;0;7\n\"a;b\";0;1;0;0;8\n").unwrap();
        let (points, answered) = read_points(&path, &mesh).unwrap();
        assert_eq!(points, [SurfacePoint::new(0, [0.25, 0.5, 0.25]), SurfacePoint::new(0, [0.0, 1.0, 0.0])]);
        assert_eq!(answered.others(), ["Name", "x"]);
        let row = |k: usize| MapRow {
            index: k as u64,
            point: (k == 0).then(|| (points[0], DVec3::new(1.5, 2.0, 3.0))),
            status: "valid",
            confidence: 0.5,
        };
        write_map(&path, &[row(0), row(1)], &answered).unwrap();
        let header = MAP_HEADER.replace(',', ";");
        let body = "0;0;0,25;0,5;0,25;1,5;2,0;3,0;valid;0,5;knee;7\n1;;;;;;;;valid;0,5;\"a;b\";8\n";
        assert_eq!(std::fs::read_to_string(&path).unwrap(), format!("{header};Name;x_given\n{body}"));
        write_points(&path, &points, &answered).unwrap();
        assert_eq!(read_points(&path, &mesh).unwrap().0, points);
        assert!(write_points(&path, &points[..1], &answered).is_err());
    }
}
