//! The GLB container, and the text forms of bytes and names in the JSON.

use std::ops::Range;
use std::path::Path;

use crate::{Error, Result};

/// Where the JSON and binary chunks are of a GLB container.
pub(super) fn split(bytes: &[u8], path: &Path) -> Result<(Range<usize>, Option<Range<usize>>)> {
    let remedy = "The file is damaged or cut short: export the model again";
    let word = |at: usize| -> Option<u32> { Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?)) };
    match word(4) {
        Some(2) => {}
        Some(version) => {
            let what = format!("glTF version {version} is not read");
            return Err(Error::format(path, None, what, "Export the model as glTF 2.0"));
        }
        None => return Err(Error::format(path, None, "the header is cut short", remedy)),
    }
    let mut at = 12;
    let (mut json, mut binary) = (None, None);
    while let (Some(length), Some(kind)) = (word(at), word(at + 4)) {
        let end = (at + 8).saturating_add(length as usize);
        if end > bytes.len() {
            let what = format!("a chunk of {length} bytes reaches beyond the end of the file");
            return Err(Error::format(path, None, what, remedy));
        }
        match kind {
            0x4e4f_534a if json.is_none() => json = Some(at + 8..end),
            0x004e_4942 if binary.is_none() => binary = Some(at + 8..end),
            _ => {}
        }
        at = end.next_multiple_of(4);
    }
    let json = json.ok_or_else(|| Error::format(path, None, "the JSON chunk is missing", remedy))?;
    Ok((json, binary))
}

/// Decodes standard base64, with or without padding; `None` on any other character.
pub(super) fn base64(text: &[u8]) -> Option<Vec<u8>> {
    let text = text.trim_ascii();
    let text = text.strip_suffix(b"==").or_else(|| text.strip_suffix(b"=")).unwrap_or(text);
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3 + 2);
    let (mut bits, mut held) = (0u32, 0);
    for &c in text {
        let value = match c {
            b'A'..=b'Z' => c - b'A',
            b'a'..=b'z' => c - b'a' + 26,
            b'0'..=b'9' => c - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => return None,
        };
        bits = bits << 6 | u32::from(value);
        held += 6;
        if held >= 8 {
            held -= 8;
            bytes.push((bits >> held) as u8);
        }
    }
    Some(bytes)
}

/// The two chunks, padded as the format asks.
pub(super) fn container(name: &str, mut json: Vec<u8>, binary: &[u8]) -> Result<Vec<u8>> {
    json.resize(json.len().next_multiple_of(4), b' ');
    let total = 12 + 8 + json.len() + 8 + binary.len();
    if u32::try_from(total).is_err() {
        let what = format!("the file would have {total} bytes, GLB allows 4 GiB");
        return Err(Error::mesh(name, what, "Use smaller textures"));
    }
    let mut file = Vec::with_capacity(total);
    for word in [0x4654_6c67, 2, total as u32, json.len() as u32, 0x4e4f_534a] {
        file.extend_from_slice(&u32::to_le_bytes(word));
    }
    file.extend_from_slice(&json);
    for word in [binary.len() as u32, 0x004e_4942] {
        file.extend_from_slice(&u32::to_le_bytes(word));
    }
    file.extend_from_slice(binary);
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_and_percent_codes() {
        assert_eq!(base64(b"aGVsbG8=").as_deref(), Some(&b"hello"[..]));
        assert_eq!(base64(b"aGVsbG8h").as_deref(), Some(&b"hello!"[..]));
        assert_eq!(base64(b"a*"), None);
    }
}
