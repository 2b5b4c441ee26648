//! Names in files that are not UTF-8: how they are read as text, and how they were spelt.
//!
//! Text formats without a declared encoding hold names in whatever the writing program's system
//! used. Names are told apart by their bytes. For people they are decoded; [`Spellings`] keeps the
//! bytes for writing.

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};

use encoding_rs::{Encoding, SHIFT_JIS, WINDOWS_1252};

/// The encoding of `names` of one file, used for those that are not UTF-8.
///
/// Shift-JIS where every name is valid in it and some byte lies in 80 to 9F, which begins most of
/// its letters and no letter of Latin-1; Windows-1252, a superset of Latin-1, otherwise.
pub(crate) fn guess<'n>(names: impl Iterator<Item = &'n [u8]>) -> &'static Encoding {
    let (mut lead, mut valid) = (false, true);
    for name in names.filter(|n| std::str::from_utf8(n).is_err()) {
        lead |= name.iter().any(|b| (0x80..0xa0).contains(b));
        valid &= !SHIFT_JIS.decode_without_bom_handling(name).1;
    }
    if lead && valid { SHIFT_JIS } else { WINDOWS_1252 }
}

/// A name as text: UTF-8 where it is valid, else in `encoding`.
pub(crate) fn decode<'n>(name: &'n [u8], encoding: &'static Encoding) -> Cow<'n, str> {
    match std::str::from_utf8(name) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => encoding.decode_without_bom_handling(name).0,
    }
}

/// Texts that a name may stand for on this machine's file system: as it is, and decoded.
pub(crate) fn readings(name: &[u8]) -> Vec<String> {
    match std::str::from_utf8(name) {
        Ok(text) => vec![text.to_owned()],
        Err(_) => [guess(std::iter::once(name)), WINDOWS_1252, SHIFT_JIS]
            .iter()
            .map(|e| e.decode_without_bom_handling(name).0.into_owned())
            .fold(Vec::new(), |mut all, text| {
                if !all.contains(&text) {
                    all.push(text);
                }
                all
            }),
    }
}

/// Gives distinct names distinct texts, and remembers the bytes of those that are not UTF-8.
#[derive(Debug)]
pub(crate) struct Spellings {
    encoding: &'static Encoding,
    taken: HashSet<String>,
    texts: HashMap<Vec<u8>, String>,
}

impl Spellings {
    pub(crate) fn new(encoding: &'static Encoding) -> Self {
        Self { encoding, taken: HashSet::new(), texts: HashMap::new() }
    }

    /// The text of a name. The same bytes give the same text; different bytes that are not UTF-8
    /// give different ones.
    pub(crate) fn text(&mut self, name: &[u8]) -> String {
        if let Ok(text) = std::str::from_utf8(name) {
            self.taken.insert(text.to_owned());
            return text.to_owned();
        }
        if let Some(text) = self.texts.get(name) {
            return text.clone();
        }
        let mut text = decode(name, self.encoding).into_owned();
        while !self.taken.insert(text.clone()) {
            text.push('\'');
        }
        self.texts.insert(name.to_vec(), text.clone());
        text
    }

    /// Each text whose name is not UTF-8, with its bytes.
    pub(crate) fn into_bytes(self) -> impl Iterator<Item = (String, Vec<u8>)> {
        self.texts.into_iter().map(|(bytes, text)| (text, bytes))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn latin_1_and_shift_jis_are_told_apart() {
        // "Körper" and "Füße" in Latin-1; "表" (its second byte is a backslash) and "ソ" in
        // Shift-JIS.
        let latin: [&[u8]; 2] = [b"K\xf6rper", b"F\xfc\xdfe"];
        let japanese: [&[u8]; 2] = [b"\x95\x5c", b"\x83\x5c"];
        let (l, j) = (guess(latin.into_iter()), guess(japanese.into_iter()));
        assert_eq!([decode(latin[0], l), decode(latin[1], l)], ["Körper", "Füße"]);
        assert_eq!([decode(japanese[0], j), decode(japanese[1], j)], ["表", "ソ"]);
        assert_eq!(decode("ä表".as_bytes(), j), "ä表");
        // Quotes of Windows-1252 are lead bytes too, but no valid pairs.
        assert_eq!(guess([&b"\x93a\x94"[..], b"\x93"].into_iter()), WINDOWS_1252);
    }

    #[test]
    fn distinct_bytes_are_distinct_texts() {
        let mut spellings = Spellings::new(WINDOWS_1252);
        assert_eq!(spellings.text("é".as_bytes()), "é");
        let (one, two) = (spellings.text(b"\xe9"), spellings.text(b"\xe8"));
        assert_eq!((one.as_str(), two.as_str(), spellings.text(b"\xe9").as_str()), ("é'", "è", "é'"));
        let mut bytes: Vec<(String, Vec<u8>)> = spellings.into_bytes().collect();
        bytes.sort();
        assert_eq!(bytes, [("è".to_owned(), vec![0xe8]), ("é'".to_owned(), vec![0xe9])]);
    }

    #[test]
    fn a_file_name_is_read_in_every_likely_encoding() {
        assert_eq!(readings(b"a.png"), ["a.png"]);
        assert_eq!(readings(b"K\xf6.png")[0], "Kö.png");
        assert!(readings(b"\x95\x5c.png").contains(&"表.png".to_owned()));
    }
}
