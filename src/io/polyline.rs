//! Writing polylines: PLY with edges, OBJ with `l` elements.

use std::io::Write;
use std::path::Path;

use glam::DVec3;

use super::{finite, output};
use crate::{Error, Result};

/// A number of each point beside its place, in double precision.
#[derive(Clone, Debug, PartialEq)]
pub struct PointProperty<'a> {
    /// Its name in the file, without spaces.
    pub name: &'a str,
    /// One value for each point.
    pub values: Vec<f64>,
}

fn check(runs: &[Vec<DVec3>], properties: &[PointProperty<'_>]) -> Result<usize> {
    let count = runs.iter().map(Vec::len).sum();
    match properties.iter().find(|p| p.values.len() != count) {
        None => Ok(count),
        Some(p) => {
            let what = format!("{} values of {:?} for {count} points", p.values.len(), p.name);
            Err(Error::input(what, "Give one a point"))
        }
    }
}

fn check_places(path: &Path, runs: &[Vec<DVec3>]) -> Result<()> {
    let numbers = runs.iter().flatten().flat_map(|p| p.to_array());
    finite::numbers(path, numbers, |i| format!("point {}, {}", i / 3, ["x", "y", "z"][i % 3]))
}

/// Writes runs of joined points as little-endian binary PLY: vertices in double precision with
/// their properties, and an element `edge` that joins neighbours of each run.
///
/// # Errors
/// [`Error::Io`]; [`Error::NotFinite`] for a number that is not finite; [`Error::Input`] if a
/// property has not as many values as there are points.
pub fn write_polyline_ply(runs: &[Vec<DVec3>], properties: &[PointProperty<'_>], path: impl AsRef<Path>) -> Result<()> {
    let path = path.as_ref();
    let count = check(runs, properties)?;
    for p in properties {
        finite::numbers(path, p.values.iter().copied(), |i| format!("{} of point {i}", p.name))?;
    }
    check_places(path, runs)?;
    let edges: usize = runs.iter().map(|r| r.len().saturating_sub(1)).sum();
    let write = |w: &mut dyn Write| -> std::io::Result<()> {
        writeln!(w, "ply\nformat binary_little_endian 1.0\nelement vertex {count}")?;
        writeln!(w, "property double x\nproperty double y\nproperty double z")?;
        for p in properties {
            writeln!(w, "property double {}", p.name)?;
        }
        writeln!(w, "element edge {edges}\nproperty int vertex1\nproperty int vertex2\nend_header")?;
        for (i, p) in runs.iter().flatten().enumerate() {
            for x in p.to_array().into_iter().chain(properties.iter().map(|q| q.values[i])) {
                w.write_all(&x.to_le_bytes())?;
            }
        }
        let mut first = 0u32;
        for run in runs {
            for i in first..(first + run.len() as u32).saturating_sub(1) {
                w.write_all(&i.to_le_bytes())?;
                w.write_all(&(i + 1).to_le_bytes())?;
            }
            first += run.len() as u32;
        }
        Ok(())
    };
    output::write_atomically(path, |w| write(w).map_err(output::failed(path)))
}

/// Writes runs of joined points as OBJ: a `v` line a point with round-trip precision, an `l` line a
/// run.
///
/// # Errors
/// [`Error::Io`]; [`Error::NotFinite`] for a coordinate that is not finite.
pub fn write_polyline_obj(runs: &[Vec<DVec3>], path: impl AsRef<Path>) -> Result<()> {
    let path = path.as_ref();
    check_places(path, runs)?;
    let write = |w: &mut dyn Write| -> std::io::Result<()> {
        for p in runs.iter().flatten() {
            writeln!(w, "v {} {} {}", p.x, p.y, p.z)?;
        }
        let mut first = 1;
        for run in runs.iter() {
            if run.len() > 1 {
                write!(w, "l")?;
                for i in first..first + run.len() {
                    write!(w, " {i}")?;
                }
                writeln!(w)?;
            }
            first += run.len();
        }
        Ok(())
    };
    output::write_atomically(path, |w| write(w).map_err(output::failed(path)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_stay_apart() {
        let dir = tempfile::tempdir().unwrap();
        let p = |k: usize| DVec3::new(0.1 * k as f64, 1.0 / 3.0, -1e-17);
        let runs = vec![(0..3).map(p).collect::<Vec<_>>(), vec![p(3)], vec![p(4), p(5)]];
        let path = dir.path().join("a.obj");
        write_polyline_obj(&runs, &path).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert_eq!(text.lines().filter(|l| l.starts_with('l')).collect::<Vec<_>>(), ["l 1 2 3", "l 5 6"]);
        let first: Vec<f64> = text.lines().nth(5).unwrap()[2..].split(' ').map(|x| x.parse().unwrap()).collect();
        assert_eq!(DVec3::from_slice(&first), p(5));
        let path = dir.path().join("a.ply");
        let property = PointProperty { name: "parameter", values: vec![0.5; 6] };
        write_polyline_ply(&runs, std::slice::from_ref(&property), &path).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
        let head = String::from_utf8(bytes[..end].to_vec()).unwrap();
        assert!(head.contains("element vertex 6") && head.contains("element edge 3"), "{head}");
        let edges: Vec<u32> =
            bytes[end + 6 * 32..].chunks(4).map(|b| u32::from_le_bytes(b.try_into().unwrap())).collect();
        assert_eq!(edges, [0, 1, 1, 2, 4, 5]);
        assert!(write_polyline_ply(&runs[..1], &[property], &path).is_err());
    }
}
