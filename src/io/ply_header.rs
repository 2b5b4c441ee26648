//! The header of PLY files and the numbers it declares.

use std::path::Path;

use super::obj::shortened;
use crate::{Error, Result};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Encoding {
    Ascii,
    Little,
    Big,
}

#[derive(Clone, Copy, Debug)]
pub(crate) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

#[derive(Clone, Copy, Debug)]
pub(crate) enum Kind {
    Scalar(Scalar),
    /// Type of the length, type of the numbers.
    List(Scalar, Scalar),
}

#[derive(Debug)]
pub(crate) struct Property {
    pub(crate) name: String,
    pub(crate) kind: Kind,
}

#[derive(Debug)]
pub(crate) struct Element {
    pub(crate) name: String,
    pub(crate) count: u64,
    pub(crate) properties: Vec<Property>,
}

#[derive(Debug)]
pub(crate) struct Header {
    pub(crate) encoding: Encoding,
    pub(crate) elements: Vec<Element>,
    /// Files of `comment TextureFile`, in order.
    pub(crate) textures: Vec<Vec<u8>>,
    /// Bytes up to and with the line `end_header`.
    pub(crate) length: usize,
}

impl Scalar {
    fn parse(word: &str) -> Option<Self> {
        Some(match word {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    /// Bytes in binary files.
    pub(crate) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// The number at the beginning of `bytes`; every type fits f64 exactly.
    pub(crate) fn read(self, bytes: &[u8], encoding: Encoding) -> Option<f64> {
        let mut le = [0; 8];
        let size = self.size();
        le[..size].copy_from_slice(bytes.get(..size)?);
        if encoding == Encoding::Big {
            le[..size].reverse();
        }
        let [a, b, c, d, ..] = le;
        Some(match self {
            Self::I8 => f64::from(a as i8),
            Self::U8 => f64::from(a),
            Self::I16 => f64::from(i16::from_le_bytes([a, b])),
            Self::U16 => f64::from(u16::from_le_bytes([a, b])),
            Self::I32 => f64::from(i32::from_le_bytes([a, b, c, d])),
            Self::U32 => f64::from(u32::from_le_bytes([a, b, c, d])),
            Self::F32 => f64::from(f32::from_le_bytes([a, b, c, d])),
            Self::F64 => f64::from_le_bytes(le),
        })
    }
}

/// What ends the lines of a header. The data of a binary file begin behind the last of them, so
/// that there must be one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum LineEnd {
    /// With a carriage return before it, or without.
    LineFeed,
    /// A carriage return alone.
    Return,
}

impl LineEnd {
    fn of(bytes: &[u8]) -> Self {
        let first = bytes.iter().position(|b| matches!(b, b'\n' | b'\r'));
        match first.map(|k| &bytes[k..]) {
            Some([b'\r', next, ..]) if *next != b'\n' => Self::Return,
            _ => Self::LineFeed,
        }
    }

    fn lines(self, bytes: &[u8]) -> impl Iterator<Item = &[u8]> {
        let end = if self == Self::Return { b'\r' } else { b'\n' };
        bytes.split_inclusive(move |b| *b == end)
    }
}

impl Header {
    pub(crate) fn parse(bytes: &[u8], path: &Path) -> Result<Self> {
        let remedy = "Check that this is a PLY file, or export the mesh again";
        let mut encoding = None;
        let (mut elements, mut textures) = (Vec::<Element>::new(), Vec::new());
        let mut length = 0;
        let end = LineEnd::of(bytes);
        for (k, line) in end.lines(bytes).enumerate() {
            length += line.len();
            let text = String::from_utf8_lossy(line);
            let text = text.trim();
            let fail = |what: String| Error::format(path, Some(k + 1), what, remedy);
            let words: Vec<&str> = text.split_whitespace().take(6).collect();
            if k == 0 {
                if text != "ply" {
                    return Err(fail("the file does not begin with the line \"ply\"".into()));
                }
                continue;
            }
            match words[..] {
                [] | ["obj_info", ..] => {}
                ["comment", "TextureFile", ..] => {
                    let name =
                        line.windows(11).position(|w| w == b"TextureFile").map_or(&[][..], |at| &line[at + 11..]);
                    textures.push(name.trim_ascii().to_vec());
                }
                ["comment", ..] => {}
                ["format", word, ..] => {
                    encoding = Some(match word {
                        "ascii" => Encoding::Ascii,
                        "binary_little_endian" => Encoding::Little,
                        "binary_big_endian" => Encoding::Big,
                        _ => return Err(fail(format!("unknown format {:?}", shortened(word)))),
                    });
                }
                ["element", name, count] => {
                    let count = count
                        .parse()
                        .map_err(|_| fail(format!("{:?} is not a number of elements", shortened(count))))?;
                    if elements.iter().any(|e| e.name == name) {
                        return Err(fail(format!("element {:?} is declared twice", shortened(name))));
                    }
                    // Elements are looked up by name: a list that long is no mesh.
                    if elements.len() >= 64 {
                        return Err(fail("more than 64 kinds of elements".into()));
                    }
                    elements.push(Element { name: name.to_owned(), count, properties: Vec::new() });
                }
                ["property", ..] => {
                    let kind = match words[1..] {
                        ["list", length, item, _] => {
                            Scalar::parse(length).zip(Scalar::parse(item)).map(|(l, i)| Kind::List(l, i))
                        }
                        [scalar, _] => Scalar::parse(scalar).map(Kind::Scalar),
                        _ => None,
                    };
                    let (Some(kind), Some(element), Some(name)) = (kind, elements.last_mut(), words.last()) else {
                        return Err(fail(format!("{:?} does not declare a property", shortened(text))));
                    };
                    element.properties.push(Property { name: (*name).to_owned(), kind });
                }
                ["end_header"] => {
                    let encoding = encoding.ok_or_else(|| fail("the header names no format".into()))?;
                    return Ok(Self { encoding, elements, textures, length });
                }
                _ => return Err(fail(format!("{:?} is no statement of a PLY header", shortened(text)))),
            }
        }
        Err(Error::format(path, None, "the header has no line \"end_header\"", remedy))
    }
}
