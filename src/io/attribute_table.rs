//! Data of vertices as tables: CSV, NumPy arrays, and the extra properties of PLY files.

use std::io::Write;
use std::path::Path;

use super::obj::shortened;
use super::ply::{VertexColumn, read_vertex_columns};
use super::ply_write::{PropertyValues, VertexProperty, write_ply_with};
use super::vertex_colors::Colors;
use super::{npy, output, source};
use crate::geometry::Mesh;
use crate::{Error, Result};

/// Vertex properties of PLY files that are the mesh itself.
const GEOMETRY: [&str; 12] = ["x", "y", "z", "nx", "ny", "nz", "s", "t", "u", "v", "texture_u", "texture_v"];
/// Names of colour properties.
const COLORS: [&str; 4] = ["red", "green", "blue", "alpha"];
/// Columns of our own tables that are no data.
const OWN: [&str; 2] = ["status", "confidence"];

/// Rows of numbers, one a vertex.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AttributeTable {
    /// Names of the columns.
    pub columns: Vec<String>,
    /// Row after row.
    pub values: Vec<f64>,
}

/// Which columns are read.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Columns {
    /// All that are data: of PLY files neither the mesh itself nor colours.
    #[default]
    Data,
    /// Of PLY files `nx`, `ny`, `nz`; of others as [`Columns::Data`].
    Normals,
    /// Those with these names, in this order.
    Named(Vec<String>),
}

/// How a column is written where the format has a choice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AttributeStyle {
    /// Colours of 0..1 become bytes in PLY files.
    pub colors: bool,
}

/// What kind of file a name says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Csv,
    Npy,
    Ply,
}

impl Format {
    fn of(path: &Path) -> Result<Self> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
        match extension.as_deref() {
            Some("csv" | "txt") => Ok(Self::Csv),
            Some("npy") => Ok(Self::Npy),
            Some("ply") => Ok(Self::Ply),
            _ => {
                let what = "the name does not say which kind of table this is";
                Err(Error::format(path, None, what, "Use a name that ends in .csv, .npy or .ply"))
            }
        }
    }
}

/// Fails unless attributes can be written under this name.
///
/// # Errors
/// [`Error::Format`] on another ending than `.csv`, `.npy` or `.ply`.
pub fn check_attribute_extension(path: impl AsRef<Path>) -> Result<()> {
    Format::of(path.as_ref()).map(|_| ())
}

/// Reads data of vertices, a row for each.
///
/// CSV: numbers separated by commas, with or without a header line; a first column named `index` or `vertex` gives the vertex of a row;
/// `status` and `confidence` are passed over. NPY: a matrix, or an array for one column. PLY: scalar properties of the vertices.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] naming the line: a cell that is no number, rows of different lengths, a vertex twice or left out, a
/// column that is not there.
pub fn read_attributes(path: impl AsRef<Path>, columns: &Columns) -> Result<AttributeTable> {
    let path = path.as_ref();
    match Format::of(path)? {
        Format::Csv => select(parse_csv(&source::read_text(path)?, path)?, columns, path),
        Format::Npy => {
            let (count, values) = npy::read_npy(path)?;
            select(AttributeTable { columns: numbered(count), values }, columns, path)
        }
        Format::Ply => read_ply_table(path, columns),
    }
}

/// Reads the colours of the vertices of a file, 0..1, as columns `red`, `green`, `blue` and, if there is one, `alpha`, and what
/// was decided on the way. PLY files need no faces. Of tables of numbers all columns are taken.
///
/// # Errors
/// As [`read_attributes`] and [`super::read_mesh`]; [`Error::Format`] where vertices have no colours.
pub fn read_colors(path: impl AsRef<Path>) -> Result<(AttributeTable, Vec<String>)> {
    let path = path.as_ref();
    let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    let missing = || {
        let what = "its vertices have no colours";
        Error::format(path, None, what, "Export the mesh with its vertex colours, or name columns with --columns")
    };
    let colors = match extension.as_str() {
        "ply" => super::ply::colors(&read_vertex_columns(path)?).ok_or_else(missing)?,
        "obj" | "off" | "gltf" | "glb" => {
            let loaded = super::read_mesh(path)?;
            let opaque = loaded.mesh.colors.iter().all(|c| c[3] == 1.0);
            let channels = if opaque { 3 } else { 4 };
            let values = loaded.mesh.colors.iter().flat_map(|c| c[..channels].iter().map(|&x| f64::from(x))).collect();
            Some(Colors { channels, values, note: None }).filter(|c| !c.values.is_empty()).ok_or_else(missing)?
        }
        _ => return Ok((read_attributes(path, &Columns::Data)?, Vec::new())),
    };
    let columns = COLORS[..colors.channels].iter().map(|n| (*n).to_owned()).collect();
    Ok((AttributeTable { columns, values: colors.values }, colors.note.into_iter().collect()))
}

fn numbered(count: usize) -> Vec<String> {
    (0..count).map(|k| format!("c{k}")).collect()
}

fn read_ply_table(path: &Path, columns: &Columns) -> Result<AttributeTable> {
    let all = read_vertex_columns(path)?;
    let known = |name: &str| GEOMETRY.contains(&name) || COLORS.contains(&name) || OWN.contains(&name);
    let names: Vec<String> = match columns {
        Columns::Named(names) => names.clone(),
        Columns::Normals => GEOMETRY[3..6].iter().map(|n| (*n).to_owned()).collect(),
        Columns::Data => all.iter().map(|c| c.name.clone()).filter(|n| !known(n)).collect(),
    };
    let found: Vec<&VertexColumn> = names
        .iter()
        .map(|name| {
            all.iter().find(|c| c.name == *name).ok_or_else(|| missing(path, name, all.iter().map(|c| &c.name)))
        })
        .collect::<Result<_>>()?;
    let rows = found.first().map_or(0, |c| c.values.len());
    if rows == 0 {
        let what = "the vertices have no properties beside positions, normals, texture coordinates and colours";
        return Err(Error::format(path, None, what, "Name the properties to take with --columns"));
    }
    let values = (0..rows).flat_map(|r| found.iter().map(move |c| c.values[r])).collect();
    Ok(AttributeTable { columns: names, values })
}

fn missing<'a>(path: &Path, name: &str, there: impl Iterator<Item = &'a String>) -> Error {
    let names: Vec<&str> = there.map(String::as_str).take(20).collect();
    let what = format!("there is no column {:?} among {}", shortened(name), names.join(", "));
    Error::format(path, None, what, "Name columns that are there")
}

/// The columns asked for by name; all of them otherwise.
fn select(table: AttributeTable, columns: &Columns, path: &Path) -> Result<AttributeTable> {
    let Columns::Named(names) = columns else { return Ok(table) };
    let place = |name: &String| {
        table.columns.iter().position(|c| c == name).ok_or_else(|| missing(path, name, table.columns.iter()))
    };
    let places: Vec<usize> = names.iter().map(place).collect::<Result<_>>()?;
    let rows = table.values.chunks_exact(table.columns.len().max(1));
    let values = rows.flat_map(|row| places.iter().map(|&k| row[k])).collect();
    Ok(AttributeTable { columns: names.clone(), values })
}

/// Reads the text of a CSV file; `path` names it in messages.
fn parse_csv(text: &str, path: &Path) -> Result<AttributeTable> {
    let remedy = "Write one row of numbers for each vertex, separated by commas";
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()).peekable();
    let cells = |line: &'_ str| line.split(',').map(|c| c.trim().trim_matches('"').to_owned()).collect::<Vec<_>>();
    let Some(&(_, first)) = lines.peek() else {
        return Err(Error::format(path, None, "the file is empty", remedy));
    };
    let first = cells(first);
    let header = first.iter().any(|c| c.parse::<f64>().is_err());
    let names = if header { first } else { numbered(first.len()) };
    if header {
        lines.next();
    }
    let indexed = matches!(names[0].to_ascii_lowercase().as_str(), "index" | "vertex");
    let data: Vec<usize> = (usize::from(indexed)..names.len()).filter(|&k| !OWN.contains(&names[k].as_str())).collect();
    if data.is_empty() {
        return Err(Error::format(path, Some(1), "there is no column of data", remedy));
    }
    let mut rows: Vec<(u64, usize)> = Vec::new();
    let mut values = Vec::new();
    for (k, line) in lines {
        let fail = |what: String| Error::format(path, Some(k + 1), what, remedy);
        let cells = cells(line);
        if cells.len() != names.len() {
            return Err(fail(format!("{} cells of {}", cells.len(), names.len())));
        }
        if indexed {
            let index = cells[0].parse().map_err(|_| fail(format!("{:?} is no vertex index", shortened(&cells[0]))))?;
            rows.push((index, k + 1));
        }
        for &c in &data {
            let cell = &cells[c];
            values.push(cell.parse::<f64>().map_err(|_| fail(format!("{:?} is not a number", shortened(cell))))?);
        }
    }
    let columns: Vec<String> = data.iter().map(|&k| names[k].clone()).collect();
    if indexed {
        values = in_order(&rows, columns.len(), &values, path)?;
    }
    Ok(AttributeTable { columns, values })
}

/// Rows in the order of their vertices; each from 0 on must be there once.
fn in_order(rows: &[(u64, usize)], columns: usize, values: &[f64], path: &Path) -> Result<Vec<f64>> {
    let mut place = vec![usize::MAX; rows.len()];
    for (r, &(index, line)) in rows.iter().enumerate() {
        let fail = |what: String| Error::format(path, Some(line), what, "Give each vertex from 0 on once");
        match place.get_mut(usize::try_from(index).unwrap_or(usize::MAX)) {
            None => return Err(fail(format!("vertex {index} in a table of {} rows", rows.len()))),
            Some(p) if *p != usize::MAX => return Err(fail(format!("vertex {index} comes twice"))),
            Some(p) => *p = r,
        }
    }
    Ok(place.iter().flat_map(|&r| &values[r * columns..(r + 1) * columns]).copied().collect())
}

/// What is written of a vertex beside its data.
#[derive(Clone, Copy, Debug)]
pub struct RowStatus {
    /// A word, for CSV.
    pub word: &'static str,
    /// The same as a number, for PLY.
    pub number: u8,
    /// Between 0 and 1.
    pub confidence: f64,
}

/// Writes data of the vertices of `mesh` as the name's ending says. CSV has a first column `index` and last columns `status` and `confidence`,
/// and empty cells for NaN; PLY files hold the mesh, the columns as `double` (colours as `uchar` if `style` says so), `status` and
/// `confidence`; NPY the numbers alone.
///
/// # Errors
/// [`Error::Io`]; [`Error::Input`] if numbers of rows do not match, or a column's name is taken by the mesh in a PLY file.
pub fn write_attributes(
    path: impl AsRef<Path>,
    mesh: &Mesh,
    table: &AttributeTable,
    status: &[RowStatus],
    style: AttributeStyle,
) -> Result<()> {
    let path = path.as_ref();
    let n = table.columns.len();
    if n == 0 || status.len() != mesh.vertex_count() || table.values.len() != n * status.len() {
        let what = format!("{} numbers in {n} columns for {} vertices", table.values.len(), mesh.vertex_count());
        return Err(Error::input(what, "Give one row for each vertex"));
    }
    match Format::of(path)? {
        Format::Npy => npy::write_npy(path, n, &table.values),
        Format::Csv => output::write_atomically(path, |w| {
            let mut all = || {
                writeln!(w, "index,{},status,confidence", table.columns.join(","))?;
                for (v, (row, s)) in table.values.chunks_exact(n).zip(status).enumerate() {
                    write!(w, "{v}")?;
                    for x in row {
                        if x.is_nan() { write!(w, ",")? } else { write!(w, ",{x}")? }
                    }
                    writeln!(w, ",{},{}", s.word, s.confidence)?;
                }
                Ok(())
            };
            all().map_err(output::failed(path))
        }),
        Format::Ply => write_ply_table(path, mesh, table, status, style),
    }
}

fn write_ply_table(
    path: &Path,
    mesh: &Mesh,
    table: &AttributeTable,
    status: &[RowStatus],
    style: AttributeStyle,
) -> Result<()> {
    let n = table.columns.len();
    let mut properties: Vec<VertexProperty> = Vec::with_capacity(n + 2);
    let taken = ["x", "y", "z", "status", "confidence"];
    for (k, name) in table.columns.iter().enumerate() {
        // The header separates words by spaces.
        let name: String = name.chars().map(|c| if c.is_whitespace() || c.is_control() { '_' } else { c }).collect();
        if taken.contains(&name.as_str()) || name.is_empty() || properties.iter().any(|p| p.name == name) {
            let what = format!("{}: a vertex property named {name:?} is there already, or has no name", path.display());
            return Err(Error::input(what, "Rename the column, or write CSV or NPY"));
        }
        let column = table.values.iter().skip(k).step_by(n);
        let values = if style.colors {
            PropertyValues::Byte(column.map(|v| (v * 255.0 + 0.5) as u8).collect())
        } else {
            PropertyValues::Double(column.copied().collect())
        };
        properties.push(VertexProperty { name, values });
    }
    let number = PropertyValues::Byte(status.iter().map(|s| s.number).collect());
    properties.push(VertexProperty { name: "status".into(), values: number });
    let confidence = PropertyValues::Double(status.iter().map(|s| s.confidence).collect());
    properties.push(VertexProperty { name: "confidence".into(), values: confidence });
    write_ply_with(mesh, &properties, path)
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    fn parse(text: &str) -> Result<AttributeTable> {
        parse_csv(text, Path::new("a.csv"))
    }

    #[test]
    fn csv_with_and_without_header_and_index() {
        let plain = parse("1,2\n3,4\n").unwrap();
        assert_eq!((plain.columns, plain.values), (vec!["c0".to_owned(), "c1".to_owned()], vec![1.0, 2.0, 3.0, 4.0]));
        let table = parse("\u{feff}vertex, hip ,\"knee\",status\n1,0.5,2e-1,valid\n\n0,1,0,failed\n").unwrap();
        assert_eq!(
            (table.columns, table.values),
            (vec!["hip".to_owned(), "knee".to_owned()], vec![1.0, 0.0, 0.5, 0.2])
        );
    }

    #[test]
    fn mistakes_are_named_by_line() {
        for (text, words) in [
            ("", "empty"),
            ("a,b\n1,2\n3\n", "line 3: 1 cells of 2"),
            ("a,b\n1,x\n", "\"x\" is not a number"),
            ("index,a\n0,1\n0,2\n", "vertex 0 comes twice"),
            ("index,a\n0,1\n7,2\n", "vertex 7 in a table of 2 rows"),
            ("index,a\n-1,1\n", "no vertex index"),
            ("index,status\n0,valid\n", "no column of data"),
        ] {
            let message = parse(text).unwrap_err().to_string();
            assert!(message.contains(words), "{message}");
        }
    }

    #[test]
    fn every_format_comes_back() {
        let dir = tempfile::tempdir().unwrap();
        let mesh = Mesh::from_triangles("one", vec![DVec3::ZERO, DVec3::X, DVec3::Y], &[[0, 1, 2]]);
        let table = AttributeTable {
            columns: vec!["a".into(), "b".into()],
            values: vec![0.1, 1.0 / 3.0, -2.0, 1e300, 7.0, 0.0],
        };
        let status = [RowStatus { word: "valid", number: 2, confidence: 0.5 }; 3];
        let style = AttributeStyle { colors: false };
        for name in ["a.csv", "a.npy", "a.ply"] {
            let path = dir.path().join(name);
            write_attributes(&path, &mesh, &table, &status, style).unwrap();
            let back = read_attributes(&path, &Columns::Data).unwrap();
            assert_eq!(back.values, table.values, "{name}");
            let first = if name == "a.npy" { "c0" } else { "a" };
            let one = read_attributes(&path, &Columns::Named(vec![first.into()])).unwrap();
            assert_eq!(one.values, [0.1, -2.0, 7.0]);
            let message = read_attributes(&path, &Columns::Named(vec!["zz".into()])).unwrap_err().to_string();
            assert!(message.contains("no column \"zz\""), "{message}");
        }
        assert!(write_attributes(dir.path().join("a.csv"), &mesh, &table, &status[1..], style).is_err());
        assert!(write_attributes(dir.path().join("a.xyz"), &mesh, &table, &status, style).is_err());
        let hidden = AttributeTable { columns: vec!["x".into(), "b".into()], ..table };
        assert!(write_attributes(dir.path().join("a.ply"), &mesh, &hidden, &status, style).is_err());
    }

    #[test]
    fn colours_are_bytes_in_ply() {
        let dir = tempfile::tempdir().unwrap();
        let mesh = Mesh::from_triangles("one", vec![DVec3::ZERO, DVec3::X, DVec3::Y], &[[0, 1, 2]]);
        let columns = ["red", "green", "blue"].map(str::to_owned).to_vec();
        let table =
            AttributeTable { columns, values: vec![0.0, 1.0, 128.0 / 255.0, 0.2, 0.4, 0.6, f64::NAN, 3.0, -1.0] };
        let status = [RowStatus { word: "valid", number: 2, confidence: 1.0 }; 3];
        let path = dir.path().join("c.ply");
        write_attributes(&path, &mesh, &table, &status, AttributeStyle { colors: true }).unwrap();
        let (back, _) = read_colors(&path).unwrap();
        assert_eq!(back.columns, table.columns);
        assert_eq!(back.values[..6], table.values[..6]);
        assert_eq!(back.values[6..], [0.0, 1.0, 0.0]);
        assert!(read_attributes(&path, &Columns::Data).unwrap_err().to_string().contains("no properties"));
    }
}
