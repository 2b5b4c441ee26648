//! Directories of tags: the structure of TIFF files, of BigTIFF files and of EXIF blocks.

/// The directory of a photo's own tags inside the main one.
pub(super) const EXIF_DIRECTORY: u16 = 0x8769;
/// The directory of the place inside the main one.
pub(super) const GPS_DIRECTORY: u16 = 0x8825;
/// A directory inside that of the photo.
const INTEROPERABILITY_DIRECTORY: u16 = 0xa005;
/// Directories inside directories, at most.
const DEPTH: u32 = 4;

/// Type numbers of the format.
pub(super) const BYTE: u16 = 1;
pub(super) const SHORT: u16 = 3;
pub(super) const LONG: u16 = 4;
pub(super) const RATIONAL: u16 = 5;
pub(super) const UNDEFINED: u16 = 7;

/// Bytes of a value of a type, and of the numbers it is made of.
fn sizes(kind: u16) -> Option<(u64, usize)> {
    match kind {
        1 | 2 | 6 | 7 => Some((1, 1)),
        3 | 8 => Some((2, 2)),
        4 | 9 | 11 | 13 => Some((4, 4)),
        5 | 10 => Some((8, 4)),
        12 | 16 | 17 | 18 => Some((8, 8)),
        _ => None,
    }
}

/// The bytes that directories lie in.
#[derive(Clone, Copy, Debug)]
pub(super) struct Block<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) little: bool,
    big: bool,
}

/// A tag where it stands in its block.
#[derive(Clone, Copy, Debug)]
pub(super) struct Field {
    pub(super) tag: u16,
    pub(super) kind: u16,
    /// Where its values begin.
    pub(super) at: usize,
    /// Bytes of its values.
    pub(super) length: usize,
}

/// The tags of a directory, and where it says which one is next.
#[derive(Clone, Debug)]
pub(super) struct Fields {
    pub(super) list: Vec<Field>,
    pub(super) next: u64,
    pub(super) next_at: usize,
    /// Where the directory itself ends.
    pub(super) end: usize,
}

impl<'a> Block<'a> {
    /// The block and the place of its first directory, if it begins as one.
    pub(super) fn open(bytes: &'a [u8]) -> Option<(Self, u64)> {
        let little = match bytes.get(..2)? {
            b"II" => true,
            b"MM" => false,
            _ => return None,
        };
        let mut block = Self { bytes, little, big: false };
        match block.number(2, 2)? {
            42 => Some((block, block.number(4, 4)?)),
            43 if block.number(4, 2)? == 8 => {
                block.big = true;
                Some((block, block.number(8, 8)?))
            }
            _ => None,
        }
    }

    /// An unsigned number of `size` bytes.
    fn number(&self, at: usize, size: usize) -> Option<u64> {
        let bytes = self.bytes.get(at..at.checked_add(size)?)?;
        let step = |value: u64, b: &u8| value << 8 | u64::from(*b);
        Some(if self.little { bytes.iter().rev().fold(0, step) } else { bytes.iter().fold(0, step) })
    }

    /// The tags of the directory at `offset`; those whose values lie outside the block are left
    /// out.
    pub(super) fn directory(&self, offset: u64) -> Option<Fields> {
        let (count_size, entry, inline) = if self.big { (8, 20, 8) } else { (2, 12, 4) };
        let start = usize::try_from(offset).ok()?;
        let count = usize::try_from(self.number(start, count_size)?).ok()?;
        let first = start.checked_add(count_size)?;
        let next_at = first.checked_add(count.checked_mul(entry)?)?;
        // The number that stands behind the last tag proves that they are all there.
        let next = self.number(next_at, inline)?;
        let field = |k: usize| {
            let at = first + k * entry;
            let kind = self.number(at + 2, 2)? as u16;
            let count = self.number(at + 4, inline)?;
            let length = usize::try_from(sizes(kind)?.0.checked_mul(count)?).ok()?;
            let value = at + 4 + inline;
            let at_value = if length <= inline { value } else { usize::try_from(self.number(value, inline)?).ok()? };
            self.bytes.get(at_value..at_value.checked_add(length)?)?;
            Some(Field { tag: self.number(at, 2)? as u16, kind, at: at_value, length })
        };
        let list = (0..count).filter_map(field).collect();
        Some(Fields { list, next, next_at, end: next_at + inline })
    }

    /// The values of a field as unsigned numbers; parts of a fraction follow one another.
    pub(super) fn numbers(&self, field: &Field) -> Vec<u64> {
        let size = sizes(field.kind).map_or(1, |s| s.1);
        (0..field.length / size).filter_map(|k| self.number(field.at + k * size, size)).collect()
    }

    /// The first value of a field as an unsigned number.
    pub(super) fn first(&self, fields: &Fields, tag: u16) -> Option<u64> {
        fields.list.iter().find(|f| f.tag == tag).and_then(|f| self.numbers(f).first().copied())
    }

    /// A fraction.
    pub(super) fn fraction(&self, fields: &Fields, tag: u16) -> Option<f64> {
        let field = fields.list.iter().find(|f| f.tag == tag && f.kind == RATIONAL)?;
        match self.numbers(field)[..] {
            [n, d, ..] if d > 0 => Some(n as f64 / d as f64),
            _ => None,
        }
    }

    /// The tags from `offset` on that `wanted` takes, with the directories inside.
    pub(super) fn tree(&self, offset: u64, wanted: &dyn Fn(u16) -> bool) -> Directory {
        self.subtree(offset, wanted, DEPTH)
    }

    fn subtree(&self, offset: u64, wanted: &dyn Fn(u16) -> bool, depth: u32) -> Directory {
        let Some(fields) = self.directory(offset).filter(|_| depth > 0) else { return Directory::default() };
        let mut directory = Directory::default();
        for field in fields.list.iter().filter(|f| wanted(f.tag)) {
            if is_directory(field.tag) {
                let place = self.numbers(field).first().copied().unwrap_or(0);
                // Everything inside a photo's own directory belongs to it.
                let inside = self.subtree(place, &|_| true, depth - 1);
                if !inside.entries.is_empty() {
                    directory.entries.push(Entry { tag: field.tag, value: Value::Directory(inside) });
                }
                continue;
            }
            let mut data = self.bytes[field.at..field.at + field.length].to_vec();
            let size = sizes(field.kind).map_or(1, |s| s.1);
            if !self.little {
                data.chunks_exact_mut(size).for_each(<[u8]>::reverse);
            }
            let kind = match field.kind {
                // 64-bit numbers are BigTIFF's alone.
                16..=18 => continue,
                kind => kind,
            };
            directory.set(field.tag, kind, data);
        }
        directory
    }
}

/// Whether the value of a tag is the place of a directory.
fn is_directory(tag: u16) -> bool {
    [EXIF_DIRECTORY, GPS_DIRECTORY, INTEROPERABILITY_DIRECTORY].contains(&tag)
}

/// Tags with their values, in little-endian order whatever they came from.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Directory {
    entries: Vec<Entry>,
}

#[derive(Clone, Debug, PartialEq)]
struct Entry {
    tag: u16,
    value: Value,
}

#[derive(Clone, Debug, PartialEq)]
enum Value {
    Plain { kind: u16, data: Vec<u8> },
    Directory(Directory),
}

impl Directory {
    /// Whether there are no tags.
    pub(super) fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Sets a tag to little-endian `data`.
    pub(super) fn set(&mut self, tag: u16, kind: u16, data: Vec<u8>) {
        self.entries.retain(|e| e.tag != tag);
        self.entries.push(Entry { tag, value: Value::Plain { kind, data } });
    }

    /// Sets a tag to numbers of 16 bits.
    pub(super) fn set_shorts(&mut self, tag: u16, values: &[u16]) {
        self.set(tag, SHORT, values.iter().flat_map(|v| v.to_le_bytes()).collect());
    }

    /// Sets a tag to numbers of 32 bits.
    pub(super) fn set_longs(&mut self, tag: u16, values: &[u32]) {
        self.set(tag, LONG, values.iter().flat_map(|v| v.to_le_bytes()).collect());
    }

    /// A block of its own: a header and these directories.
    pub(super) fn to_block(&self) -> Vec<u8> {
        let mut bytes = b"II*\0\x08\0\0\0".to_vec();
        self.append(&mut bytes);
        bytes
    }

    /// Appends the directory, its values and the directories inside; returns where it begins.
    /// Places count from the beginning of `bytes`, whose length is even.
    pub(super) fn append(&self, bytes: &mut Vec<u8>) -> u32 {
        let mut entries: Vec<&Entry> = self.entries.iter().collect();
        entries.sort_by_key(|e| e.tag);
        let start = bytes.len();
        bytes.extend_from_slice(&(entries.len() as u16).to_le_bytes());
        bytes.resize(start + 2 + 12 * entries.len() + 4, 0);
        for (k, entry) in entries.into_iter().enumerate() {
            let (kind, count, value) = match &entry.value {
                Value::Plain { kind, data } => {
                    let count = data.len() as u64 / sizes(*kind).map_or(1, |s| s.0);
                    let mut inline = [0; 4];
                    match inline.get_mut(..data.len()) {
                        Some(place) => place.copy_from_slice(data),
                        None => inline = append_even(bytes, data).to_le_bytes(),
                    }
                    (*kind, count as u32, inline)
                }
                Value::Directory(inside) => (LONG, 1, inside.append(bytes).to_le_bytes()),
            };
            let field = &mut bytes[start + 2 + 12 * k..][..12];
            field[..2].copy_from_slice(&entry.tag.to_le_bytes());
            field[2..4].copy_from_slice(&kind.to_le_bytes());
            field[4..8].copy_from_slice(&count.to_le_bytes());
            field[8..].copy_from_slice(&value);
        }
        start as u32
    }
}

/// Appends data at an even place, as the format asks for, and keeps the length even; returns the
/// place.
pub(super) fn append_even(bytes: &mut Vec<u8>, data: &[u8]) -> u32 {
    let at = bytes.len();
    bytes.extend_from_slice(data);
    if bytes.len() % 2 == 1 {
        bytes.push(0);
    }
    at as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A big-endian block: make "Cam", orientation 6, a photo directory with its width 7.
    fn big_endian() -> Vec<u8> {
        let mut b = b"MM\0*\0\0\0\x08\0\x03".to_vec();
        b.extend_from_slice(b"\x01\x0f\0\x02\0\0\0\x04Cam\0");
        b.extend_from_slice(b"\x01\x12\0\x03\0\0\0\x01\0\x06\0\0");
        b.extend_from_slice(b"\x87\x69\0\x04\0\0\0\x01\0\0\0\x32\0\0\0\0");
        assert_eq!(b.len(), 0x32);
        b.extend_from_slice(b"\0\x01\xa0\x02\0\x04\0\0\0\x01\0\0\0\x07\0\0\0\0");
        b
    }

    #[test]
    fn a_block_is_read_in_either_order_and_written_again() {
        let bytes = big_endian();
        let (block, first) = Block::open(&bytes).unwrap();
        let fields = block.directory(first).unwrap();
        assert_eq!((block.first(&fields, 0x112), fields.list.len(), fields.next), (Some(6), 3, 0));
        let tree = block.tree(first, &|_| true);
        let written = tree.to_block();
        let (again, first) = Block::open(&written).unwrap();
        assert!(again.little);
        let fields = again.directory(first).unwrap();
        assert_eq!(again.first(&fields, 0x112), Some(6));
        let photo = again.directory(again.first(&fields, EXIF_DIRECTORY).unwrap()).unwrap();
        assert_eq!(again.first(&photo, 0xa002), Some(7));
        assert_eq!(again.tree(first, &|_| true), tree);
        assert!(block.tree(first, &|tag| tag == 0x112) != tree, "the comparison must see a missing tag");
    }

    #[test]
    fn damaged_blocks_give_less_and_never_panic() {
        let bytes = big_endian();
        for length in 0..bytes.len() {
            if let Some((block, first)) = Block::open(&bytes[..length]) {
                drop(block.tree(first, &|_| true));
            }
        }
        // A directory that contains itself.
        let mut loops = bytes.clone();
        loops[0x2e - 4..0x2e].copy_from_slice(&[0, 0, 0, 8]);
        let (block, first) = Block::open(&loops).unwrap();
        drop(block.tree(first, &|_| true));
        for k in 0..bytes.len() {
            let mut changed = bytes.clone();
            changed[k] = 0xff;
            if let Some((block, first)) = Block::open(&changed) {
                drop(block.tree(first, &|_| true));
            }
        }
    }
}
