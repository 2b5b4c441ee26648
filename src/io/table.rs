//! Tables as text: CSV in the dialects that spreadsheets and programs write.
//!
//! Cells are separated by commas, semicolons, tabs or blanks ([`Separator`]), told by the first
//! rows. Cells in quotation marks may hold separators and line ends. Decimal signs are points or
//! commas, one of them in a table. Lines may end in LF, CR LF or CR. Lines that begin with `#` are
//! comments, as is `sep=;`, which spreadsheets write; a comment right above numbers with as many
//! words as they have columns is their header, as NumPy writes it. Columns are found by name,
//! whatever case and order.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use csv::StringRecord;

use super::encoding::{self, Text};
use super::obj::shortened;
use super::table_dialect::{self, TableWriter};
use super::table_number::{self, Shape};
use crate::{Error, Result};

#[doc(hidden)]
pub use super::table_dialect::{Dialect, Separator};

/// A row and the line that it begins on.
#[derive(Clone, Debug, PartialEq)]
struct Row {
    line: usize,
    cells: StringRecord,
}

/// A table of text.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    path: PathBuf,
    dialect: Dialect,
    /// Comments before the first row.
    preamble: Vec<String>,
    header: Option<StringRecord>,
    rows: Vec<Row>,
    notes: Vec<String>,
}

impl Table {
    /// Reads a table. No row is a header yet, unless it is a comment.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] naming the line of a zero byte or of a quotation mark that
    /// is never closed.
    pub fn read(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        Self::parse(encoding::read_text(path)?, path)
    }

    /// [`Table::read`] of a text; `name` stands in messages. O(bytes).
    ///
    /// # Errors
    /// As [`Table::read`].
    pub fn parse_text(text: &str, name: impl AsRef<Path>) -> Result<Self> {
        let marked = text.starts_with('\u{feff}');
        let text = text.strip_prefix('\u{feff}').unwrap_or(text).to_owned();
        Self::parse(Text { text, marked, note: None }, name.as_ref())
    }

    fn parse(Text { text, marked, note }: Text, path: &Path) -> Result<Self> {
        // The `csv` crate counts lines by LF.
        let text = if text.contains('\r') && !text.contains('\n') { text.replace('\r', "\n") } else { text };
        let mut dialect = Dialect { marked, crlf: text.contains("\r\n"), ..Dialect::default() };
        let mut preamble: Vec<String> = Vec::new();
        let (mut start, mut line) = (0, 1);
        let mut declared = None;
        for whole in text.split_inclusive('\n') {
            let content = whole.trim();
            declared = declared.or_else(|| declared_separator(content).filter(|_| preamble.is_empty()));
            if !(content.is_empty() || content.starts_with('#') || declared_separator(content).is_some()) {
                break;
            }
            if !content.is_empty() {
                preamble.push(content.to_owned());
            }
            (start, line) = (start + whole.len(), line + 1);
        }
        let body = &text[start..];
        dialect.separator = declared.unwrap_or_else(|| table_dialect::separator(body));
        let (body, comments) = without_comments(body, dialect.separator);
        let mut table = Self {
            path: path.to_path_buf(),
            dialect,
            preamble,
            header: None,
            rows: Vec::new(),
            notes: note.into_iter().collect(),
        };
        if dialect.separator == Separator::Blanks {
            table.split_at_blanks(&body, line);
        } else {
            table.split(&body, line)?;
        }
        if comments > 0 {
            table.notes.push(format!("{comments} lines between the rows that begin with # are passed over"));
        }
        // Spreadsheets write rows of empty cells behind the last.
        while table.rows.last().is_some_and(|r| r.cells.len() > 1 && r.cells.iter().all(|c| c.trim().is_empty())) {
            table.rows.pop();
        }
        table.take_commented_header();
        Ok(table)
    }

    fn split_at_blanks(&mut self, body: &str, first_line: usize) {
        for (k, line) in body.lines().enumerate().filter(|(_, l)| !l.trim().is_empty()) {
            self.rows.push(Row { line: first_line + k, cells: line.split_whitespace().collect() });
        }
    }

    fn split(&mut self, body: &str, first_line: usize) -> Result<()> {
        let mut reader = table_dialect::reader(body, self.dialect.separator);
        let mut cells = StringRecord::new();
        // Where lines have been counted to.
        let (mut counted, mut line) = (0, first_line);
        loop {
            let from = reader.position().byte() as usize;
            match reader.read_record(&mut cells) {
                Ok(true) => {}
                Ok(false) => return Ok(()),
                Err(e) => return Err(Error::format(&self.path, Some(line), e.to_string(), "Write rows of cells")),
            }
            let blank = body[from..].bytes().take_while(|b| matches!(b, b'\n' | b'\r')).count();
            let start = from + blank;
            line += body.as_bytes()[counted..start].iter().filter(|b| **b == b'\n').count();
            counted = start;
            let is_last = reader.position().byte() as usize >= body.len();
            if is_last && is_unclosed(&body[start..], self.dialect.separator.byte()) {
                let what = "a quotation mark in this row is never closed";
                return Err(Error::format(&self.path, Some(line), what, "Close it, or double it inside a cell"));
            }
            if cells.len() > 1 || !cells.iter().all(|c| c.trim().is_empty()) {
                self.rows.push(Row { line, cells: cells.clone() });
            }
        }
    }

    /// The last comment is the header if it has as many words as the first row has cells, and that
    /// row has numbers where it has none.
    fn take_commented_header(&mut self) {
        let (Some(comment), Some(first)) = (self.preamble.last().filter(|c| c.starts_with('#')), self.rows.first())
        else {
            return;
        };
        let numeric = |c: &str| !matches!(table_number::shape(c.trim()), Shape::Word);
        let cells: StringRecord = match self.dialect.separator {
            Separator::Blanks => comment.trim_start_matches('#').split_whitespace().collect(),
            other => comment.split(char::from(other.byte())).collect(),
        };
        let width = cells.len() == first.cells.len() && cells.len() > 1;
        if width && !cells.iter().any(numeric) && first.cells.iter().any(numeric) {
            self.preamble.pop();
            self.header = Some(cells);
        }
    }

    /// Makes the first row the header if there is none and `is_header` says so.
    pub fn lift_header(&mut self, is_header: impl Fn(&Self, usize) -> bool) {
        if self.header.is_none() && !self.rows.is_empty() && is_header(self, 0) {
            self.header = Some(self.rows.remove(0).cells);
        }
    }

    /// Removes the first `count` rows, which have been read.
    pub(crate) fn drop_rows(&mut self, count: usize) {
        self.rows.drain(..count.min(self.rows.len()));
    }

    /// The file, named in messages.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// How it is written.
    pub fn dialect(&self) -> Dialect {
        self.dialect
    }

    /// What was passed over or assumed; one sentence each.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// The names of the columns, without blanks around them and, of a commented header, without
    /// `#`.
    pub fn names(&self) -> Option<Vec<&str>> {
        let header = self.header.as_ref()?;
        Some(header.iter().map(|c| bare(c).trim_start_matches('#').trim()).collect())
    }

    /// The column of that name: as written, else whatever case.
    pub fn column(&self, name: &str) -> Option<usize> {
        let names = self.names()?;
        let exact = names.iter().position(|n| *n == name);
        exact.or_else(|| names.iter().position(|n| n.to_lowercase() == name.to_lowercase()))
    }

    /// Number of columns: of the header, else of the first row.
    pub fn width(&self) -> usize {
        self.header.as_ref().or(self.rows.first().map(|r| &r.cells)).map_or(0, StringRecord::len)
    }

    /// Number of rows, without the header.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The line on which a row begins.
    pub fn line(&self, row: usize) -> usize {
        self.rows[row].line
    }

    /// Number of cells of a row.
    pub fn cells(&self, row: usize) -> usize {
        self.rows[row].cells.len()
    }

    /// A cell without the blanks around it, and quotation marks behind such blanks; empty where the
    /// row is shorter.
    pub fn cell(&self, row: usize, column: usize) -> &str {
        bare(self.rows[row].cells.get(column).unwrap_or_default())
    }

    /// An error in a row.
    pub fn fail(&self, row: usize, what: impl Into<String>, remedy: &str) -> Error {
        Error::format(&self.path, Some(self.line(row)), what, remedy)
    }

    /// Every row has as many cells as the header; empty ones beyond are not counted.
    ///
    /// # Errors
    /// [`Error::Format`] naming the line.
    pub fn check_widths(&self, remedy: &str) -> Result<()> {
        let width = self.width();
        for row in 0..self.len() {
            let count = self.cells(row);
            if count < width || (width..count).any(|c| !self.cell(row, c).is_empty()) {
                return Err(self.fail(row, format!("{count} cells of {width}"), remedy));
            }
        }
        Ok(())
    }

    /// Whether a cell is a number with either decimal sign.
    pub fn is_number(&self, row: usize, column: usize) -> bool {
        !matches!(table_number::shape(self.cell(row, column)), Shape::Word | Shape::Groups)
    }

    /// Whether a column has no number at all: text, not numbers with a mistake.
    pub fn is_text(&self, column: usize) -> bool {
        !self.is_empty() && (0..self.len()).all(|r| !self.is_number(r, column))
    }

    /// Tells the decimal sign by the cells of `columns`; without decimals there, by all others.
    ///
    /// # Errors
    /// [`Error::Format`] naming the line: points and commas in one table, digits set apart in
    /// groups, or `1,234` where that may be either.
    pub fn settle_decimals(&mut self, columns: &[usize]) -> Result<()> {
        const REMEDY: &str = "Write numbers with one decimal sign and nothing between the other digits";
        let (mut point, mut comma, mut group) = (None, None, None);
        for row in 0..self.len() {
            for &column in columns {
                let cell = self.cell(row, column);
                match table_number::shape(cell) {
                    Shape::Whole | Shape::Word => {}
                    Shape::Point => point = point.or(Some((row, column))),
                    Shape::Comma => comma = comma.or(Some((row, column))),
                    Shape::Group => group = group.or(Some((row, column))),
                    Shape::Groups => {
                        let what = format!("{:?} sets its digits apart in groups", shortened(cell));
                        return Err(self.fail(row, what, REMEDY));
                    }
                }
            }
        }
        let show = |(row, column): (usize, usize)| format!("{:?}", shortened(self.cell(row, column)));
        if let (Some(p), Some(c)) = (point, comma.or(group)) {
            let what = format!("{} has a decimal point, {} on line {} a comma", show(p), show(c), self.line(c.0));
            return Err(self.fail(p.0, what, REMEDY));
        }
        if let (Some(g), None, false) = (group, comma, self.dialect.separator == Separator::Semicolon) {
            let what = format!("{} may be a decimal fraction or thousands", show(g));
            return Err(self.fail(g.0, what, REMEDY));
        }
        self.dialect.decimal_comma = match point {
            Some(_) => false,
            None => comma.or(group).is_some() || self.commas_are_usual(),
        };
        Ok(())
    }

    /// Whether other cells, or else the separator, let decimal commas expect.
    fn commas_are_usual(&self) -> bool {
        let shapes = || self.rows.iter().flat_map(|r| r.cells.iter()).map(|c| table_number::shape(c.trim()));
        let has = |shape: Shape| shapes().any(|s| s == shape);
        has(Shape::Comma) || (self.dialect.separator == Separator::Semicolon && !has(Shape::Point))
    }

    /// The number in a cell, with the decimal sign that [`Table::settle_decimals`] found.
    pub fn number(&self, row: usize, column: usize) -> Option<f64> {
        table_number::number(self.cell(row, column), self.dialect.decimal_comma)
    }

    /// Begins a table in this one's dialect and with its comments.
    pub(crate) fn writer<W: std::io::Write>(&self, out: W) -> std::io::Result<TableWriter<W>> {
        TableWriter::new(out, self.dialect, &self.preamble)
    }

    /// The header as it stands in the file.
    pub(crate) fn raw_header(&self) -> impl Iterator<Item = &str> {
        self.header.iter().flatten()
    }

    /// A cell as it stands in the file, without its quotation marks.
    pub(crate) fn raw(&self, row: usize, column: usize) -> &str {
        self.rows[row].cells.get(column).unwrap_or_default()
    }
}

/// A cell without blanks around it, and without quotation marks that stand behind blanks, which the
/// `csv` crate leaves there.
fn bare(cell: &str) -> &str {
    let cell = cell.trim();
    cell.strip_prefix('"').and_then(|c| c.strip_suffix('"')).map_or(cell, str::trim)
}

/// The separator of a line such as `sep=;`.
fn declared_separator(line: &str) -> Option<Separator> {
    let sign = line.get(..4).filter(|k| k.eq_ignore_ascii_case("sep=")).map(|_| &line[4..])?;
    match sign {
        "," => Some(Separator::Comma),
        ";" => Some(Separator::Semicolon),
        // The tabulator itself is gone with the blanks around the line.
        "" | "\\t" => Some(Separator::Tab),
        _ => None,
    }
}

/// `body` with empty lines in the place of comments, and their number.
///
/// A line that begins with `#` outside of quotation marks is none if it has as many cells as the
/// row before it and a number behind the first: `#b,2` below `#a,1`.
fn without_comments(body: &str, separator: Separator) -> (Cow<'_, str>, usize) {
    if !body.contains('#') {
        return (body.into(), 0);
    }
    let (mut text, mut comments) = (String::with_capacity(body.len()), 0);
    let (mut quoted, mut width) = (false, 0);
    for line in body.split_inclusive('\n') {
        let cells: Vec<&str> = match separator {
            Separator::Blanks => line.split_whitespace().collect(),
            other => line.split(char::from(other.byte())).collect(),
        };
        if !quoted && line.trim_start().starts_with('#') {
            let has_number = cells.iter().skip(1).any(|c| table_number::shape(c.trim()) != Shape::Word);
            if cells.len() != width || !has_number {
                comments += 1;
                text.push('\n');
                continue;
            }
        }
        quoted ^= line.bytes().filter(|b| *b == b'"').count() % 2 == 1;
        if !line.trim().is_empty() {
            width = cells.len();
        }
        text.push_str(line);
    }
    (text.into(), comments)
}

/// Whether the last row, `rest` of the text, ends inside a quotation mark, by the rules of the
/// `csv` crate.
fn is_unclosed(rest: &str, separator: u8) -> bool {
    #[derive(Clone, Copy, PartialEq)]
    enum Place {
        Begin,
        Plain,
        Quoted,
        /// Behind a mark that closes the cell, or is the first of two.
        Closed,
    }
    let last = rest.bytes().fold(Place::Begin, |place, byte| match (place, byte) {
        (Place::Begin | Place::Closed, b'"') => Place::Quoted,
        (Place::Quoted, b'"') => Place::Closed,
        (Place::Quoted, _) => Place::Quoted,
        (_, b) if b == separator || b == b'\n' || b == b'\r' => Place::Begin,
        _ => Place::Plain,
    });
    last == Place::Quoted
}

#[cfg(test)]
#[path = "table_tests.rs"]
mod tests;
