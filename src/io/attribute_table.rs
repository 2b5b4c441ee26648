//! Data of vertices as tables: CSV, NumPy arrays, and the extra properties of PLY files.

use std::collections::HashMap;
use std::io::Write;
use std::path::Path;

use super::npy::{self, IntegerType};
use super::obj::shortened;
use super::ply::{VertexColumn, read_vertex_columns};
use super::ply_write::{PropertyValues, VertexProperty, write_ply_with};
use super::table::{Dialect, Table};
use super::table_dialect::TableWriter;
use super::vertex_colors::Colors;
use super::{finite, output};
use crate::geometry::Mesh;
use crate::{Error, Result};

/// Vertex properties of PLY files that are the mesh itself.
const GEOMETRY: [&str; 12] = ["x", "y", "z", "nx", "ny", "nz", "s", "t", "u", "v", "texture_u", "texture_v"];
/// Names of colour properties.
const COLORS: [&str; 4] = ["red", "green", "blue", "alpha"];
/// Columns of our own tables that are no data.
const OWN: [&str; 2] = ["status", "confidence"];
/// Names of the column that gives the vertex of a row.
const INDEX: [&str; 2] = ["index", "vertex"];

/// Rows of numbers, one a vertex.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AttributeTable {
    /// Names of the columns of numbers.
    pub columns: Vec<String>,
    /// Row after row.
    pub values: Vec<f64>,
    /// Columns of text.
    pub texts: Vec<TextColumn>,
    /// How the file stores it, which what is written in answer follows if it can.
    pub storage: Storage,
    /// What was passed over or assumed; one sentence each.
    pub notes: Vec<String>,
}

/// How a file stores a table.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Storage {
    /// How text is written.
    pub dialect: Dialect,
    /// The whole numbers of a NumPy array.
    pub integers: Option<IntegerType>,
}

/// A column of text, such as names of parts.
#[derive(Clone, Debug, PartialEq)]
pub struct TextColumn {
    /// Its name.
    pub name: String,
    /// How many columns of numbers stand before it.
    pub place: usize,
    /// The different texts, in the order in which they come.
    pub words: Vec<String>,
    /// The number of each vertex' text among them; NaN for none.
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
/// CSV: a [`Table`] of numbers, with or without a header line; a column named `index` or `vertex`
/// gives the vertex of a row; `status` and `confidence` are passed over; columns without any number
/// are texts. NPY: a matrix, or an array for one column. PLY: scalar properties of the vertices.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] naming the line: a cell that is no number, rows of different
/// lengths, a vertex twice or left out, a column that is not there.
pub fn read_attributes(path: impl AsRef<Path>, columns: &Columns) -> Result<AttributeTable> {
    let path = path.as_ref();
    match Format::of(path)? {
        Format::Csv => from_table(Table::read(path)?, columns),
        Format::Npy => {
            let matrix = npy::read_npy(path)?;
            let storage = Storage { integers: matrix.integers, ..Storage::default() };
            let table = AttributeTable {
                columns: numbered(matrix.columns),
                values: matrix.values,
                storage,
                ..AttributeTable::default()
            };
            select(table, columns, path)
        }
        Format::Ply => read_ply_table(path, columns),
    }
}

/// Reads the colours of the vertices of a file, 0..1, as columns `red`, `green`, `blue` and, if
/// there is one, `alpha`. PLY files need no faces. Of tables of numbers all columns are taken.
///
/// # Errors
/// As [`read_attributes`] and [`super::read_mesh`]; [`Error::Format`] where vertices have no
/// colours.
pub fn read_colors(path: impl AsRef<Path>) -> Result<AttributeTable> {
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
        _ => return read_attributes(path, &Columns::Data),
    };
    let columns = COLORS[..colors.channels].iter().map(|n| (*n).to_owned()).collect();
    let notes = colors.note.into_iter().collect();
    Ok(AttributeTable { columns, values: colors.values, notes, ..AttributeTable::default() })
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
    Ok(AttributeTable { columns: names, values, ..AttributeTable::default() })
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
    Ok(AttributeTable { columns: names.clone(), values, ..table })
}

/// Takes the data out of a table of text.
fn from_table(mut table: Table, columns: &Columns) -> Result<AttributeTable> {
    let remedy = "Write one row of numbers for each vertex, separated by commas";
    table.lift_header(|t, row| (0..t.cells(row)).any(|c| !t.is_number(row, c)));
    let width = table.width();
    if width == 0 {
        return Err(Error::format(table.path(), None, "the file is empty", remedy));
    }
    let names: Vec<String> =
        table.names().map_or_else(|| numbered(width), |names| names.into_iter().map(str::to_owned).collect());
    let is = |k: usize, among: &[&str]| among.iter().any(|n| names[k].eq_ignore_ascii_case(n));
    let index = (0..width).find(|&k| is(k, &INDEX));
    table.check_widths(remedy)?;
    // A column without a name and without any content comes from separators at the ends of rows.
    let blank = |k: usize| names[k].is_empty() && (0..table.len()).all(|r| table.cell(r, k).is_empty());
    let data: Vec<usize> = match columns {
        Columns::Named(wanted) => wanted
            .iter()
            .map(|name| table.column(name).ok_or_else(|| missing(table.path(), name, names.iter())))
            .collect::<Result<_>>()?,
        _ => (0..width).filter(|&k| Some(k) != index && !is(k, &OWN) && !blank(k)).collect(),
    };
    let (texts, numbers): (Vec<usize>, Vec<usize>) = data.iter().copied().partition(|&k| table.is_text(k));
    if data.is_empty() {
        return Err(Error::format(table.path(), Some(1), "there is no column of data", remedy));
    }
    table.settle_decimals(&numbers)?;
    let order = match index {
        Some(column) => vertex_order(&table, column)?,
        None => (0..table.len()).collect(),
    };
    let mut values = Vec::with_capacity(order.len() * numbers.len());
    for &row in &order {
        for &column in &numbers {
            let what = || format!("{:?} is not a number", shortened(table.cell(row, column)));
            values.push(table.number(row, column).ok_or_else(|| table.fail(row, what(), remedy))?);
        }
    }
    let text = |&column: &usize| {
        let place =
            numbers.iter().filter(|k| data.iter().position(|d| d == *k) < data.iter().position(|d| *d == column));
        text_column(&table, names[column].clone(), place.count(), column, &order)
    };
    Ok(AttributeTable {
        columns: numbers.iter().map(|&k| names[k].clone()).collect(),
        values,
        texts: texts.iter().map(text).collect(),
        storage: Storage { dialect: table.dialect(), integers: None },
        notes: table.notes().to_vec(),
    })
}

fn text_column(table: &Table, name: String, place: usize, column: usize, order: &[usize]) -> TextColumn {
    let mut words = Vec::new();
    let mut known: HashMap<&str, usize> = HashMap::new();
    let mut number = |row: &usize| {
        let word = table.cell(*row, column);
        let count = known.len();
        *known.entry(word).or_insert_with(|| {
            words.push(word.to_owned());
            count
        }) as f64
    };
    let values = order.iter().map(&mut number).collect();
    TextColumn { name, place, words, values }
}

/// The rows in the order of their vertices; each from 0 on must be there once.
fn vertex_order(table: &Table, column: usize) -> Result<Vec<usize>> {
    let mut place = vec![usize::MAX; table.len()];
    for row in 0..table.len() {
        let fail = |what: String| table.fail(row, what, "Give each vertex from 0 on once");
        let cell = table.cell(row, column);
        let index: u64 = cell.parse().map_err(|_| fail(format!("{:?} is no vertex index", shortened(cell))))?;
        match place.get_mut(usize::try_from(index).unwrap_or(usize::MAX)) {
            None => return Err(fail(format!("vertex {index} in a table of {} rows", table.len()))),
            Some(p) if *p != usize::MAX => return Err(fail(format!("vertex {index} comes twice"))),
            Some(p) => *p = row,
        }
    }
    Ok(place)
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

/// Writes data of the vertices of `mesh` as the name's ending says. CSV has a first column `index`
/// and last columns `status` and `confidence`, and empty cells for NaN; PLY files hold the mesh,
/// the columns as `double` (colours as `uchar` if `style` says so), `status` and `confidence`; NPY
/// the numbers alone.
///
/// # Errors
/// [`Error::Io`]; [`Error::NotFinite`] for a number that is not finite, other than NaN of a vertex
/// whose status is `failed`; [`Error::Input`] if numbers of rows do not match, a column's name is
/// taken by the mesh in a PLY file, or a number is none of the [whole numbers](Storage::integers)
/// of an NPY file. Texts go into CSV alone.
pub fn write_attributes(
    path: impl AsRef<Path>,
    mesh: &Mesh,
    table: &AttributeTable,
    status: &[RowStatus],
    style: AttributeStyle,
) -> Result<()> {
    let path = path.as_ref();
    let n = table.columns.len();
    let rows = mesh.vertex_count();
    let texts_fit = table.texts.iter().all(|t| t.values.len() == rows);
    if n + table.texts.len() == 0 || status.len() != rows || table.values.len() != n * rows || !texts_fit {
        let what = format!("{} numbers in {n} columns for {rows} vertices", table.values.len());
        return Err(Error::input(what, "Give one row for each vertex"));
    }
    // Failed vertices have nothing, which is NaN.
    let blank = |v: usize| status[v].word == "failed";
    let told = table.values.iter().enumerate().map(|(i, &x)| if x.is_nan() && blank(i / n) { 0.0 } else { x });
    finite::numbers(path, told, |i| format!("{} of vertex {}", table.columns[i % n], i / n))?;
    finite::numbers(path, status.iter().map(|s| s.confidence), |v| format!("confidence of vertex {v}"))?;
    let format = Format::of(path)?;
    if n == 0 && format != Format::Csv {
        let what = format!("{}: there are texts only, which this format does not hold", path.display());
        return Err(Error::input(what, "Write CSV"));
    }
    match format {
        Format::Npy => match table.storage.integers {
            Some(integers) => npy::write_npy_integers(path, n, &table.values, integers),
            None => npy::write_npy(path, n, &table.values, blank),
        },
        Format::Csv => output::write_atomically(path, |w| write_rows(w, table, status).map_err(output::failed(path))),
        Format::Ply => write_ply_table(path, mesh, table, status, style),
    }
}

fn write_rows(out: impl Write, table: &AttributeTable, status: &[RowStatus]) -> std::io::Result<()> {
    let n = table.columns.len();
    let mut w = TableWriter::new(out, table.storage.dialect, &[])?;
    // Numbers and texts in the order of the file: those that stand before number `k`, and at last
    // those behind all.
    let texts = |k: usize| table.texts.iter().filter(move |t| t.place == k || (k == n && t.place > n));
    w.text("index")?;
    for k in 0..=n {
        w.texts(texts(k).map(|t| t.name.as_str()).chain(table.columns.get(k).map(String::as_str)))?;
    }
    w.texts(["status", "confidence"])?;
    w.end_row()?;
    for (v, s) in status.iter().enumerate() {
        w.number(format_args!("{v}"))?;
        for k in 0..=n {
            for text in texts(k) {
                let word = text.values[v];
                w.text(if word >= 0.0 { text.words.get(word as usize).map_or("", String::as_str) } else { "" })?;
            }
            match table.values.get(n * v + k).filter(|_| k < n) {
                Some(x) if x.is_nan() => w.text("")?,
                Some(x) => w.number(format_args!("{x}"))?,
                None => {}
            }
        }
        w.text(s.word)?;
        w.number(format_args!("{}", s.confidence))?;
        w.end_row()?;
    }
    w.finish()
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
#[path = "attribute_table_tests.rs"]
mod tests;
