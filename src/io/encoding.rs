//! Text in the encodings that programs write: UTF-8, UTF-16, and the older ones of single
//! countries.

use std::path::Path;

use chardetng::{EncodingDetector, Iso2022JpDetection, Utf8Detection};
use encoding_rs::{Encoding, UTF_8, UTF_16BE, UTF_16LE, WINDOWS_1252};

use super::source;
use crate::{Error, Result};

/// A text, however it was encoded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Text {
    /// The text without a byte order mark.
    pub(crate) text: String,
    /// Whether there was a byte order mark.
    pub(crate) marked: bool,
    /// A sentence on the encoding, if it is not UTF-8.
    pub(crate) note: Option<String>,
}

/// Reads a text file in any encoding: that of its byte order mark, else UTF-8, else the one that
/// the bytes look like.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] naming the line of a zero byte, which no text has.
pub(crate) fn read_text(path: &Path) -> Result<Text> {
    decode(source::read_all(path)?, path)
}

/// [`read_text`] of bytes; `path` names them in messages. O(bytes).
pub(crate) fn decode(bytes: Vec<u8>, path: &Path) -> Result<Text> {
    let (marked, skipped) = match Encoding::for_bom(&bytes) {
        Some((encoding, length)) => (Some(encoding), length),
        None => (None, 0),
    };
    if let Some(wide) = marked.filter(|e| *e != UTF_8).or_else(|| utf16_without_mark(&bytes)) {
        return Ok(decoded(wide, &bytes[skipped..], marked.is_some()));
    }
    if let Some(at) = bytes.iter().position(|b| *b == 0) {
        let line = 1 + bytes[..at].iter().filter(|b| **b == b'\n').count();
        let what = "this is not text: there is a zero byte";
        return Err(Error::format(path, Some(line), what, "Name a text file"));
    }
    match String::from_utf8(bytes) {
        Ok(mut text) => {
            text.drain(..skipped);
            Ok(Text { text, marked: marked.is_some(), note: None })
        }
        Err(error) => {
            let bytes = &error.as_bytes()[skipped..];
            let mut detector = EncodingDetector::new(Iso2022JpDetection::Deny);
            detector.feed(bytes, true);
            let guess = detector.guess(None, Utf8Detection::Deny);
            // Windows-1252 gives every byte a character.
            let fits = !guess.decode_without_bom_handling(bytes).1;
            Ok(decoded(if fits { guess } else { WINDOWS_1252 }, bytes, marked.is_some()))
        }
    }
}

fn decoded(encoding: &'static Encoding, bytes: &[u8], marked: bool) -> Text {
    let text = encoding.decode_without_bom_handling(bytes).0.into_owned();
    Text { text, marked, note: Some(format!("the text is not UTF-8: it is read as {}", encoding.name())) }
}

/// UTF-16 of mostly Latin letters, told by zeros in every other place.
fn utf16_without_mark(bytes: &[u8]) -> Option<&'static Encoding> {
    let head = &bytes[..bytes.len().min(64)];
    if head.len() < 8 || !bytes.len().is_multiple_of(2) {
        return None;
    }
    let all = |zero: usize| head.chunks_exact(2).all(|pair| pair[zero] == 0 && pair[1 - zero] != 0);
    if all(1) {
        Some(UTF_16LE)
    } else if all(0) {
        Some(UTF_16BE)
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use encoding_rs::{GBK, SHIFT_JIS, WINDOWS_1251};

    use super::*;

    fn read(bytes: Vec<u8>) -> Text {
        decode(bytes, Path::new("t")).unwrap()
    }

    #[test]
    fn names_of_many_countries_come_back() {
        let skeleton =
            |names: [&str; 3]| format!("HIERARCHY\nROOT {}\nJOINT {}\nJOINT {}\n", names[0], names[1], names[2]);
        for (encoding, names) in [
            (WINDOWS_1252, ["Hüfte", "Rücken", "Schädel"]),
            (WINDOWS_1252, ["tête", "épaule", "genou_été"]),
            (WINDOWS_1252, ["cabeça", "mão", "pé"]),
            (SHIFT_JIS, ["センター", "上半身", "首"]),
            (SHIFT_JIS, ["左足", "右ひざ", "頭"]),
            (WINDOWS_1251, ["таз", "позвоночник", "голова"]),
            (GBK, ["骨盆", "脊柱", "左膝盖"]),
        ] {
            let text = skeleton(names);
            let read = read(encoding.encode(&text).0.into_owned());
            assert_eq!(read.text, text, "{names:?}: {:?}", read.note);
            assert!(read.note.unwrap().contains("not UTF-8"));
        }
    }

    #[test]
    fn marks_and_utf16_are_read() {
        let text = "x;y\r\n1,5;Füße\r\n";
        assert_eq!(read(text.into()), Text { text: text.into(), marked: false, note: None });
        let marked = [b"\xef\xbb\xbf".to_vec(), text.into()].concat();
        assert_eq!(read(marked), Text { text: text.into(), marked: true, note: None });
        for (unit, mark) in [(u16::to_le_bytes as fn(u16) -> [u8; 2], [0xff, 0xfe]), (u16::to_be_bytes, [0xfe, 0xff])] {
            let bytes: Vec<u8> = text.encode_utf16().flat_map(unit).collect();
            for (bytes, marked) in [(bytes.clone(), false), ([mark.to_vec(), bytes].concat(), true)] {
                let read = read(bytes);
                assert_eq!((read.text.as_str(), read.marked), (text, marked));
                assert!(read.note.unwrap().contains("UTF-16"));
            }
        }
    }

    #[test]
    fn what_is_no_text_is_refused() {
        let message = decode(b"a,b\n1,\0\0\0\n".to_vec(), Path::new("junk.csv")).unwrap_err().to_string();
        assert!(message.contains("junk.csv, line 2") && message.contains("zero byte"), "{message}");
        // Bytes that no multi-byte encoding takes are still characters.
        assert_eq!(read(vec![b'a', 0x81, b'\n', 0xff, 0x80]).text.chars().count(), 5);
        assert_eq!(read(Vec::new()).text, "");
    }
}
