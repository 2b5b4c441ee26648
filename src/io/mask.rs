//! How much of each mesh there is at every vertex of a blend: painted masks.

use std::path::Path;

use super::encoding;
use super::obj::shortened;
use super::ply::read_vertex_properties;
use super::table::Table;
use crate::{Error, Result};

/// Names under which programs store one number a vertex in PLY files.
const NAMES: [&str; 6] = ["mask", "weight", "quality", "scalar", "value", "scalar_mask"];
/// How far over one the shares of a vertex may sum, as rounded numbers do.
const ROUNDING: f64 = 1e-6;
const REMEDY: &str =
    "Give numbers from 0 to 1: one a vertex for two meshes, and for more the shares of all but the first";

/// Reads shares of `meshes` meshes (two or more) at `vertex_count` vertices: one entry a mesh,
/// vertex by vertex, summing to one.
///
/// A text file has a line for every vertex with the shares of the second mesh and, if there are
/// more, of the following ones (from 0 to 1, a [`Table`] without header; `#` begins a comment). A
/// PLY file has a vertex property `mask`, `weight`, `quality`, `scalar` or `value` with the share
/// of the second mesh, or vertex colours: for two meshes white is the second one, for three and
/// four red, green and blue are the second, third and fourth.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] naming the line or vertex: other numbers of vertices or shares,
/// shares out of range.
pub fn read_mask(path: impl AsRef<Path>, vertex_count: usize, meshes: usize) -> Result<Vec<f64>> {
    let path = path.as_ref();
    let others = meshes.max(2) - 1;
    let rows = if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("ply")) {
        from_ply(path, others)?
    } else {
        from_text(path, others)?
    };
    if rows.len() != vertex_count * others {
        let what = format!("{} vertices, the meshes have {vertex_count}", rows.len() / others);
        return Err(Error::format(path, None, what, "Paint the mask on one of the meshes and keep its vertices"));
    }
    let mut shares = Vec::with_capacity(vertex_count * meshes);
    for (v, row) in rows.chunks_exact(others).enumerate() {
        let sum: f64 = row.iter().sum();
        if row.iter().any(|w| !(*w >= 0.0)) || !(sum <= 1.0 + ROUNDING) {
            return Err(Error::format(path, None, format!("vertex {v} has the shares {row:?}"), REMEDY));
        }
        let scale = if sum > 1.0 { 1.0 / sum } else { 1.0 };
        let begin = shares.len();
        shares.push(0.0);
        shares.extend(row.iter().map(|w| w * scale));
        shares[begin] = (1.0 - shares[begin + 1..].iter().sum::<f64>()).max(0.0);
    }
    Ok(shares)
}

fn from_text(path: &Path, others: usize) -> Result<Vec<f64>> {
    let text = encoding::read_text(path)?.text;
    // A comment may stand behind numbers, too.
    let bare: Vec<&str> = text.lines().map(|line| line.split('#').next().unwrap_or_default()).collect();
    let mut table = Table::parse_text(&bare.join("\n"), path)?;
    let columns: Vec<usize> = (0..others).collect();
    for row in 0..table.len() {
        let found = table.cells(row);
        // The cell that is no number says more than the count.
        if let Some(k) = (0..found).find(|&k| !table.is_number(row, k)) {
            return Err(table.fail(row, format!("{:?} is not a number", shortened(table.cell(row, k))), REMEDY));
        }
        if found != others {
            return Err(table.fail(row, format!("{found} numbers instead of {others}"), REMEDY));
        }
    }
    table.settle_decimals(&columns)?;
    Ok((0..table.len())
        .flat_map(|r| columns.iter().map(move |&c| (r, c)))
        .map(|(r, c)| table.number(r, c).unwrap_or(f64::NAN))
        .collect())
}

fn from_ply(path: &Path, others: usize) -> Result<Vec<f64>> {
    let mut names = NAMES.to_vec();
    names.extend(["red", "green", "blue"]);
    let mut found = read_vertex_properties(path, &names)?;
    let colours = found.split_off(NAMES.len());
    let single = found.into_iter().flatten().next().filter(|_| others == 1);
    if let Some(values) = single {
        return Ok(values);
    }
    let missing = || {
        let remedy = "Export vertex colours, or a vertex property named mask";
        Error::format(path, None, format!("there is no mask of {} meshes", others + 1), remedy)
    };
    let colours: Vec<Vec<f64>> = colours.into_iter().collect::<Option<_>>().ok_or_else(missing)?;
    if others > 3 {
        return Err(missing());
    }
    let row = |v: usize| -> Vec<f64> {
        match others {
            1 => vec![colours.iter().map(|c| c[v]).sum::<f64>() / 3.0],
            _ => colours[..others].iter().map(|c| c[v]).collect(),
        }
    };
    Ok((0..colours[0].len()).flat_map(row).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Mesh;
    use crate::io::write_ply;

    #[test]
    fn text_and_paint_say_the_same() {
        let dir = tempfile::tempdir().unwrap();
        let path = |name: &str| dir.path().join(name);
        std::fs::write(path("m.txt"), "# mask\n0\n1\n0.5 # half\n").unwrap();
        assert_eq!(read_mask(path("m.txt"), 3, 2).unwrap(), [1.0, 0.0, 0.0, 1.0, 0.5, 0.5]);
        std::fs::write(path("three.csv"), "0,0\n1,0\n0.25,0.5\n").unwrap();
        let three = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.25, 0.25, 0.5];
        assert_eq!(read_mask(path("three.csv"), 3, 3).unwrap(), three);
        std::fs::write(path("german.csv"), "0;0\r\n1;0 # all\r\n0,25;0,5\r\n").unwrap();
        assert_eq!(read_mask(path("german.csv"), 3, 3).unwrap(), three);
        std::fs::write(path("blanks.txt"), "0  0\n1 0\n 0.25 0.5\n").unwrap();
        assert_eq!(read_mask(path("blanks.txt"), 3, 3).unwrap(), three);
        let mesh = Mesh::of_triangles("t", vec![glam::DVec3::ZERO, glam::DVec3::X, glam::DVec3::Y], &[[0, 1, 2]]);
        write_ply(&mesh, Some(&[[0; 3], [255; 3], [51, 51, 51]]), path("m.ply")).unwrap();
        let near = |found: &[f64], expected: &[f64]| {
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
        };
        near(&read_mask(path("m.ply"), 3, 2).unwrap(), &[1.0, 0.0, 0.0, 1.0, 0.8, 0.2]);
        write_ply(&mesh, Some(&[[0; 3], [255, 0, 0], [51, 204, 0]]), path("c.ply")).unwrap();
        near(&read_mask(path("c.ply"), 3, 3).unwrap()[3..], &[0.0, 1.0, 0.0, 0.0, 0.2, 0.8]);
        let header = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
        let body = "property float quality\nend_header\n0 0 0 0\n1 0 0 1\n0 1 0 0.25\n";
        std::fs::write(path("q.ply"), [header, body].concat()).unwrap();
        assert_eq!(read_mask(path("q.ply"), 3, 2).unwrap()[4..], [0.75, 0.25]);
    }

    #[test]
    fn wrong_masks_are_told() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("m.txt");
        for (text, meshes, part) in [
            ("0\n1\n", 2, "2 vertices"),
            ("0\nx\n1", 2, "\"x\""),
            ("0\n1.5\n1", 2, "vertex 1"),
            ("0\n-1\n1", 2, "vertex 1"),
            ("0\nnan\n1", 2, "vertex 1"),
            ("0\n0 1\n1", 2, "\"0 1\""),
            ("0 0\n0.6 0.6\n1 0", 3, "vertex 1"),
        ] {
            std::fs::write(&path, text).unwrap();
            let message = read_mask(&path, 3, meshes).unwrap_err().to_string();
            assert!(message.contains(part), "{text:?}: {message}");
        }
    }
}
