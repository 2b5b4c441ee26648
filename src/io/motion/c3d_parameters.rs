//! The parameters of a C3D file, and its numbers.

use std::path::Path;

use crate::{Error, Result};

const BLOCK: usize = 512;

/// How a machine writes numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Numbers {
    Intel,
    Dec,
    Mips,
}

impl Numbers {
    /// A 16-bit word.
    pub(super) fn u16(self, b: &[u8]) -> u16 {
        match self {
            Self::Mips => u16::from_be_bytes([b[0], b[1]]),
            _ => u16::from_le_bytes([b[0], b[1]]),
        }
    }

    /// A 32-bit float. DEC swaps the halves, and its exponent is larger by two.
    pub(super) fn f32(self, b: &[u8]) -> f32 {
        match self {
            Self::Intel => f32::from_le_bytes([b[0], b[1], b[2], b[3]]),
            Self::Mips => f32::from_be_bytes([b[0], b[1], b[2], b[3]]),
            Self::Dec => f32::from_le_bytes([b[2], b[3], b[0], b[1]]) / 4.0,
        }
    }
}

/// One parameter: its raw values.
struct Parameter<'a> {
    group: i8,
    name: String,
    /// -1 text, 1 bytes, 2 words, 4 floats.
    kind: i8,
    /// First dimension; the length of each text.
    row: usize,
    data: &'a [u8],
}

/// All parameters of a file.
pub(super) struct Parameters<'a> {
    pub(super) numbers: Numbers,
    groups: Vec<(i8, String)>,
    all: Vec<Parameter<'a>>,
}

impl<'a> Parameters<'a> {
    /// Walks through the records. They are linked by offsets that only lead forward.
    pub(super) fn parse(bytes: &'a [u8], path: &Path) -> Result<Self> {
        let cut = |at: usize| {
            let what = format!("the parameters are cut or damaged at byte {at}");
            Error::format(path, None, what, "Fetch or export the file again")
        };
        let start = BLOCK * usize::from(bytes[0]).saturating_sub(1);
        let header = bytes.get(start..start + 4).filter(|_| start >= BLOCK).ok_or_else(|| cut(start))?;
        let numbers = match header[3] {
            84 => Numbers::Intel,
            85 => Numbers::Dec,
            86 => Numbers::Mips,
            other => {
                let what = format!("{other} is not a kind of numbers (84 Intel, 85 DEC, 86 MIPS)");
                return Err(Error::format(path, None, what, "Export the file again"));
            }
        };
        let mut parameters = Self { numbers, groups: Vec::new(), all: Vec::new() };
        let mut at = start + 4;
        loop {
            let length = usize::from(*bytes.get(at).ok_or_else(|| cut(at))?);
            // The sign tells that the entry is locked.
            let length = if length > 127 { 256 - length } else { length };
            if length == 0 {
                return Ok(parameters);
            }
            let id = *bytes.get(at + 1).ok_or_else(|| cut(at))? as i8;
            let name = bytes.get(at + 2..at + 2 + length).ok_or_else(|| cut(at))?;
            let name = text(name).to_ascii_uppercase();
            let link = at + 2 + length;
            let offset = usize::from(numbers.u16(bytes.get(link..link + 2).ok_or_else(|| cut(at))?));
            if id < 0 {
                parameters.groups.push((-id.max(-127), name));
            } else {
                let parameter = parameters.parameter(bytes, link + 2, id, name).ok_or_else(|| cut(at))?;
                parameters.all.push(parameter);
            }
            if offset == 0 {
                return Ok(parameters);
            }
            if offset < 2 {
                return Err(cut(link));
            }
            at = link + offset;
        }
    }

    fn parameter(&self, bytes: &'a [u8], at: usize, group: i8, name: String) -> Option<Parameter<'a>> {
        let kind = *bytes.get(at)? as i8;
        let count = usize::from(*bytes.get(at + 1)?);
        let sizes = bytes.get(at + 2..at + 2 + count)?;
        let values = sizes.iter().try_fold(1usize, |n, &s| n.checked_mul(usize::from(s)))?;
        let data = at + 2 + count;
        let length = values.checked_mul(usize::from(kind.unsigned_abs()))?;
        let data = bytes.get(data..data.checked_add(length)?)?;
        Some(Parameter { group, name, kind, row: sizes.first().map_or(1, |&s| usize::from(s)), data })
    }

    fn find(&self, group: &str, name: &str) -> Option<&Parameter<'a>> {
        let of_group = |p: &&Parameter| self.groups.iter().any(|(id, n)| *id == p.group && n == group);
        self.all.iter().filter(|p| p.name == name).find(of_group)
    }

    /// The numbers of a parameter; none for text and for what is not there. Words are signed.
    pub(super) fn numbers_of(&self, group: &str, name: &str) -> Vec<f64> {
        let Some(p) = self.find(group, name) else { return Vec::new() };
        match p.kind {
            1 => p.data.iter().map(|&b| f64::from(b)).collect(),
            2 => p.data.chunks_exact(2).map(|b| f64::from(self.numbers.u16(b) as i16)).collect(),
            4 => p.data.chunks_exact(4).map(|b| f64::from(self.numbers.f32(b))).collect(),
            _ => Vec::new(),
        }
    }

    /// The first number of a parameter, if it is finite. Words are counts here, without sign.
    pub(super) fn number(&self, group: &str, name: &str) -> Option<f64> {
        let first = *self.numbers_of(group, name).first()?;
        let word = self.find(group, name)?.kind == 2;
        Some(if word && first < 0.0 { first + 65536.0 } else { first }).filter(|x| x.is_finite())
    }

    /// The texts of a POINT parameter and of its continuations (LABELS, LABELS2, LABELS3, ...),
    /// trimmed.
    pub(super) fn series(&self, name: &str) -> Vec<String> {
        let mut texts = Vec::new();
        // A file has at most 65,535 points; records of a damaged file may overlap and promise far
        // more.
        for k in 1..=256 {
            let name = if k == 1 { name.to_owned() } else { format!("{name}{k}") };
            let Some(p) = self.find("POINT", &name).filter(|p| p.kind == -1) else { break };
            let room = usize::from(u16::MAX) - texts.len();
            texts.extend(p.data.chunks(p.row.max(1)).take(room).map(text));
        }
        texts
    }
}

/// Trimmed text. Bytes beyond ASCII are those of Latin-1, which is what old programs wrote.
fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|&b| b == 0).unwrap_or(bytes.len());
    // UTF-8, as newer programs write, else Latin-1.
    let latin = || bytes[..end].iter().map(|&b| char::from(b)).collect();
    let text: String = std::str::from_utf8(&bytes[..end]).map_or_else(|_| latin(), str::to_owned);
    text.trim().to_owned()
}
