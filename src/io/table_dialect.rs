//! How tables separate their cells: told by their first rows, and kept where a table is written in
//! answer to one.

use std::io::{self, Write};

/// More rows than this are not looked at to tell the separator.
const SAMPLE: usize = 20;

/// What stands between the cells of a row.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Separator {
    /// `,`
    #[default]
    Comma,
    /// `;`, as spreadsheets write where the comma is the decimal sign.
    Semicolon,
    /// A tabulator.
    Tab,
    /// Any number of blanks. Written as commas, because an empty cell could not be seen.
    Blanks,
}

impl Separator {
    /// The byte that the `csv` crate is told.
    pub(super) fn byte(self) -> u8 {
        match self {
            Self::Comma | Self::Blanks => b',',
            Self::Semicolon => b';',
            Self::Tab => b'\t',
        }
    }
}

/// How a table is written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Dialect {
    /// What stands between the cells.
    pub separator: Separator,
    /// Whether the decimal sign is a comma.
    pub decimal_comma: bool,
    /// Whether lines end in CR and LF.
    pub crlf: bool,
    /// Whether the file begins with a byte order mark, by which spreadsheets tell UTF-8.
    pub marked: bool,
}

/// The separator of `body`: tabs or semicolons where every row has as many of them, else commas,
/// else blanks.
pub(super) fn separator(body: &str) -> Separator {
    const SIGNS: [Separator; 3] = [Separator::Tab, Separator::Semicolon, Separator::Comma];
    let counts = SIGNS.map(|s| cell_counts(body, s));
    let even = |counts: &Vec<usize>| counts.first().is_some_and(|&c| c > 1 && counts.iter().all(|&n| n == c));
    if let Some(k) = counts.iter().position(even) {
        return SIGNS[k];
    }
    // Rows with a mistake: the header is believed.
    let first = |k: usize| counts[k].first().copied().unwrap_or(0);
    let best = [2, 1, 0].into_iter().max_by_key(|&k| first(k)).filter(|&k| first(k) > 1);
    match best {
        Some(k) => SIGNS[k],
        None if separated_by_blanks(body) => Separator::Blanks,
        // A name above a column of decimal commas.
        None if counts[2].contains(&2) && counts[2].iter().all(|&n| n <= 2) => Separator::Semicolon,
        None => Separator::Comma,
    }
}

/// Numbers of cells in the first rows.
fn cell_counts(body: &str, separator: Separator) -> Vec<usize> {
    let mut rows = reader(body, separator).into_records();
    rows.by_ref()
        .map_while(Result::ok)
        .filter(|r| r.iter().any(|c| !c.trim().is_empty()))
        .map(|r| r.len())
        .take(SAMPLE)
        .collect()
}

/// Whether the first rows are as many numbers each, below a row of words or not.
fn separated_by_blanks(body: &str) -> bool {
    let rows = body.lines().map(|l| l.split_whitespace().collect::<Vec<_>>()).filter(|r| !r.is_empty());
    let rows: Vec<Vec<&str>> = rows.take(SAMPLE).collect();
    let numbers = |row: &[&str]| row.iter().all(|w| w.parse::<f64>().is_ok());
    let columns = rows.first().map_or(0, Vec::len);
    let from = usize::from(rows.len() > 1);
    columns > 1 && rows.iter().all(|r| r.len() == columns) && rows[from..].iter().all(|r| numbers(r))
}

/// A reader of rows of any length.
pub(super) fn reader(body: &str, separator: Separator) -> csv::Reader<&[u8]> {
    csv::ReaderBuilder::new().has_headers(false).flexible(true).delimiter(separator.byte()).from_reader(body.as_bytes())
}

/// Writes rows in a dialect.
pub(crate) struct TableWriter<W: Write> {
    inner: csv::Writer<W>,
    decimal_comma: bool,
    scratch: String,
}

impl<W: Write> TableWriter<W> {
    /// Begins a table; `preamble` are lines that stand before it.
    pub(crate) fn new(mut out: W, dialect: Dialect, preamble: &[String]) -> io::Result<Self> {
        if dialect.marked {
            out.write_all("\u{feff}".as_bytes())?;
        }
        let end = if dialect.crlf { "\r\n" } else { "\n" };
        for line in preamble {
            write!(out, "{line}{end}")?;
        }
        let terminator = if dialect.crlf { csv::Terminator::CRLF } else { csv::Terminator::Any(b'\n') };
        let mut builder = csv::WriterBuilder::new();
        builder.delimiter(dialect.separator.byte()).terminator(terminator).flexible(true);
        // A decimal comma needs quotation marks where commas stand between cells; the crate gives
        // them.
        Ok(Self { inner: builder.from_writer(out), decimal_comma: dialect.decimal_comma, scratch: String::new() })
    }

    /// Adds a cell of text.
    pub(crate) fn text(&mut self, cell: &str) -> io::Result<()> {
        Ok(self.inner.write_field(cell)?)
    }

    /// Adds cells of text.
    pub(crate) fn texts<'a>(&mut self, cells: impl IntoIterator<Item = &'a str>) -> io::Result<()> {
        cells.into_iter().try_for_each(|cell| self.text(cell))
    }

    /// Adds a number, with the decimal sign of the dialect. Its digits are those of `value`'s own
    /// format, so that it can be read back exactly.
    pub(crate) fn number(&mut self, value: std::fmt::Arguments<'_>) -> io::Result<()> {
        self.scratch.clear();
        // A string takes every text.
        let _ = std::fmt::write(&mut self.scratch, value);
        if self.decimal_comma {
            self.scratch = self.scratch.replace('.', ",");
        }
        Ok(self.inner.write_field(&self.scratch)?)
    }

    /// Ends the row.
    pub(crate) fn end_row(&mut self) -> io::Result<()> {
        Ok(self.inner.write_record(None::<&[u8]>)?)
    }

    /// Ends the table.
    pub(crate) fn finish(mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn separators_are_told_by_rows() {
        for (body, expected) in [
            ("a,b\n1,2\n", Separator::Comma),
            ("1\n2\n", Separator::Comma),
            ("", Separator::Comma),
            ("a;b\n0,5;1\n", Separator::Semicolon),
            ("0,5;1,5\n0,1;2,5\n", Separator::Semicolon),
            ("0,5;1\n1;2\n", Separator::Semicolon),
            ("0,5\t1\n1\t2\n", Separator::Tab),
            ("x,y,note\n1,2,a;b\n", Separator::Comma),
            ("x,y,note\n1,2,\"a;b\nc;d\"\n", Separator::Comma),
            ("x;y;note\n1;2;a, b, c\n", Separator::Semicolon),
            ("a,b\n1,2\n3\n", Separator::Comma),
            ("a;b\n1,5;2\n3,5\n", Separator::Semicolon),
            ("hips\n0,5\n1\n", Separator::Semicolon),
            ("0.5 1\n2   3\n", Separator::Blanks),
            ("left right\n2   3\n", Separator::Blanks),
            ("left hip\n2\n", Separator::Comma),
            ("1 2\n", Separator::Blanks),
            ("not a table\nat all really\n", Separator::Comma),
            ("\n\n \na;b;c\n1;2;3\n", Separator::Semicolon),
        ] {
            assert_eq!(separator(body), expected, "{body:?}");
        }
    }

    #[test]
    fn what_is_written_is_quoted_where_it_must_be() {
        let write = |dialect: Dialect| {
            let mut out = Vec::new();
            let mut writer = TableWriter::new(&mut out, dialect, &["# made".to_owned()]).unwrap();
            writer.texts(["a;b", "c,d", "e\tf", "g\"h"]).unwrap();
            writer.number(format_args!("{:?}", 1.5)).unwrap();
            writer.end_row().unwrap();
            writer.finish().unwrap();
            String::from_utf8(out).unwrap()
        };
        let plain = Dialect::default();
        assert_eq!(write(plain), "# made\na;b,\"c,d\",e\tf,\"g\"\"h\",1.5\n");
        let german = Dialect { separator: Separator::Semicolon, decimal_comma: true, crlf: true, marked: true };
        assert_eq!(write(german), "\u{feff}# made\r\n\"a;b\";c,d;e\tf;\"g\"\"h\";1,5\r\n");
        assert_eq!(write(Dialect { decimal_comma: true, ..plain }), "# made\na;b,\"c,d\",e\tf,\"g\"\"h\",\"1,5\"\n");
        let blanks = Dialect { separator: Separator::Blanks, ..plain };
        assert_eq!(write(blanks), write(plain));
    }
}
