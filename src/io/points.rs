//! Points on surfaces, maps and weights as CSV.

use std::io::Write;
use std::path::Path;

use glam::DVec3;

use super::anchors::normalised;
use super::obj::shortened;
use super::{output, source};
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
pub const MAP_HEADER: &str = "index,face,b0,b1,b2,x,y,z,status,confidence";

/// Reads points of `mesh`: CSV with the header `face,b0,b1,b2`, one point a line.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] naming the line: another header, a face out of range, coordinates that are no point of the face.
pub fn read_points(path: impl AsRef<Path>, mesh: &Mesh) -> Result<Vec<SurfacePoint>> {
    let path = path.as_ref();
    let text = source::read_text(path)?;
    let mut lines = rows(&text);
    let header = lines.next().map(|(_, cells)| cells.join(",")).unwrap_or_default();
    if header != "face,b0,b1,b2" {
        let what = format!("the header is {:?}", shortened(&header));
        return Err(Error::format(path, Some(1), what, "Begin the file with the line face,b0,b1,b2"));
    }
    let point = |(line, cells): (usize, Vec<&str>)| {
        let fail = |what: String| {
            Error::format(path, Some(line), what, "Write face,b0,b1,b2: a face from 0 and three coordinates of sum 1")
        };
        let [face, a, b, c] = cells[..] else { return Err(fail(format!("{} cells of 4", cells.len()))) };
        let face = face.parse::<u32>().map_err(|_| fail(format!("{:?} is not a face index", shortened(face))))?;
        if face as usize >= mesh.triangle_count() {
            return Err(fail(format!("face {face} of the {} of {}", mesh.triangle_count(), mesh.name)));
        }
        let number =
            |cell: &str| cell.parse::<f64>().map_err(|_| fail(format!("{:?} is not a number", shortened(cell))));
        Ok(SurfacePoint::new(face, normalised([number(a)?, number(b)?, number(c)?]).map_err(fail)?))
    };
    lines.map(point).collect()
}

/// Writes points as [`read_points`] reads them, with round-trip precision.
///
/// # Errors
/// [`Error::Io`].
pub fn write_points(path: impl AsRef<Path>, points: &[SurfacePoint]) -> Result<()> {
    let path = path.as_ref();
    output::write_atomically(path, |w| {
        let mut all = || {
            writeln!(w, "face,b0,b1,b2")?;
            points.iter().try_for_each(|p| {
                let [a, b, c] = p.barycentric;
                writeln!(w, "{},{a:?},{b:?},{c:?}", p.face)
            })
        };
        all().map_err(output::failed(path))
    })
}

/// Writes a map with the header [`MAP_HEADER`]; the cells of a row without a point are empty.
///
/// # Errors
/// [`Error::Io`].
pub fn write_map(path: impl AsRef<Path>, rows: impl IntoIterator<Item = MapRow>) -> Result<()> {
    let path = path.as_ref();
    output::write_atomically(path, |w| {
        let all = || {
            writeln!(w, "{MAP_HEADER}")?;
            rows.into_iter().try_for_each(|MapRow { index, point, status, confidence }| match point {
                Some((SurfacePoint { face, barycentric: [a, b, c] }, p)) => {
                    let DVec3 { x, y, z } = p;
                    writeln!(w, "{index},{face},{a:?},{b:?},{c:?},{x:?},{y:?},{z:?},{status},{confidence:?}")
                }
                None => writeln!(w, "{index},,,,,,,,{status},{confidence:?}"),
            })
        };
        all().map_err(output::failed(path))
    })
}

/// Reads weights: CSV with one query a line and `anchors` weights on each, with or without a header line of words.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] naming the line: another number of weights, one that is not a finite number, no weights at all.
pub fn read_weights(path: impl AsRef<Path>, anchors: usize) -> Result<Vec<Vec<f64>>> {
    let path = path.as_ref();
    let text = source::read_text(path)?;
    let mut weights = Vec::new();
    for (k, (line, cells)) in rows(&text).enumerate() {
        // A header has no number at all, which tells it from a row with a mistake.
        if k == 0 && cells.iter().all(|c| c.parse::<f64>().is_err()) {
            continue;
        }
        if cells.len() != anchors {
            let what = format!("{} weights for {anchors} anchors", cells.len());
            return Err(Error::format(path, Some(line), what, "Write one weight for each anchor on every line"));
        }
        let number = |cell: &&str| {
            cell.parse::<f64>().ok().filter(|x| x.is_finite()).ok_or_else(|| {
                let what = format!("{:?} is not a finite number", shortened(cell));
                Error::format(path, Some(line), what, "Write decimal numbers with a point")
            })
        };
        weights.push(cells.iter().map(number).collect::<Result<Vec<f64>>>()?);
    }
    if weights.is_empty() {
        return Err(Error::format(path, None, "there are no weights", "Write one line of weights for each query"));
    }
    Ok(weights)
}

/// The cells of lines that are not empty, with 1-based line numbers.
fn rows(text: &str) -> impl Iterator<Item = (usize, Vec<&str>)> {
    let lines = text.lines().enumerate().map(|(k, line)| (k + 1, line.trim())).filter(|(_, line)| !line.is_empty());
    lines.map(|(k, line)| (k, line.split(',').map(str::trim).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_and_maps() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("p.csv");
        let mesh = Mesh::from_triangles("m", vec![DVec3::ZERO, DVec3::X, DVec3::Y], &[[0, 1, 2]]);
        let points = [SurfacePoint::new(0, [0.1, 0.2, 0.7]), SurfacePoint::new(0, [1.0, 0.0, 0.0])];
        write_points(&path, &points).unwrap();
        let back = read_points(&path, &mesh).unwrap();
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
        write_map(&path, [row, MapRow { index: 4, point: None, status: "failed", confidence: 0.0 }]).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert_eq!(text, format!("{MAP_HEADER}\n3,0,1.0,0.0,0.0,0.1,2.0,1e-9,valid,0.5\n4,,,,,,,,failed,0.0\n"));
        assert!(text.lines().all(|line| line.split(',').count() == 10));
    }

    #[test]
    fn weights_with_and_without_header() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("w.csv");
        for text in ["0.5,0.5\n1,0\n", "a, b\r\n0.5 ,0.5\r\n\r\n1,0"] {
            std::fs::write(&path, text).unwrap();
            assert_eq!(read_weights(&path, 2).unwrap(), [[0.5, 0.5], [1.0, 0.0]]);
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
}
