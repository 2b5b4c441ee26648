//! A statement of an MTL file that names a texture: its options, before or behind the name, and the
//! name itself.

use glam::DVec2;

use crate::geometry::{Placement, Wrap};
use crate::io::locate::Located;
use crate::io::obj::comment_start;

/// What a statement says beside its keyword.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TextureStatement {
    /// The name of the file, as it is written.
    pub(super) name: Vec<u8>,
    /// Bytes from the beginning of the name to the end of the statement.
    pub(super) name_from_end: usize,
    scale: DVec2,
    offset: DVec2,
    clamp: bool,
    /// Factor of heights or normals.
    pub(super) bump: f32,
    /// Options that change what is seen and are not followed.
    pub(super) passed_over: Vec<&'static str>,
    /// Options that are not followed, as they are written, each with a blank before it.
    pub(super) kept: Vec<u8>,
}

impl TextureStatement {
    /// Reads what follows the keyword. A name may hold blanks, a `#`, and what looks like options:
    /// the longest reading that `find` has a file for is taken, the shortest where there is none.
    pub(super) fn read(rest: &[u8], find: impl Fn(&[u8]) -> Located) -> (Self, Located) {
        let mut statement = Self {
            name: Vec::new(),
            name_from_end: 0,
            scale: DVec2::ONE,
            offset: DVec2::ZERO,
            clamp: false,
            bump: 1.0,
            passed_over: Vec::new(),
            kept: Vec::new(),
        };
        let rest = statement.options(rest, true);
        statement.name_from_end = rest.len();
        let mut readings: Vec<(&[u8], &[u8])> = Vec::new();
        if let Some(end) = rest.strip_prefix(b"\"").and_then(|r| r.iter().position(|b| *b == b'"')) {
            readings.push((&rest[1..1 + end], &rest[end + 2..]));
        } else {
            let bare = comment_start(rest).map_or(rest, |at| rest[..at].trim_ascii_end());
            readings.push((rest, &[]));
            readings.push((bare, &[]));
            let options = word_starts(bare).skip(1).filter(|&k| bare[k] == b'-');
            let all_options = |k: &usize| statement.clone().options(&bare[*k..], false).is_empty();
            if let Some(k) = options.into_iter().find(all_options) {
                readings.push((bare[..k].trim_ascii_end(), &bare[k..]));
            }
            readings.dedup();
        }
        let mut found: Vec<Located> = readings.iter().map(|(name, _)| find(name)).collect();
        let best = (found.iter().position(|f| matches!(f, Located::AsWritten(_))))
            .or_else(|| found.iter().position(|f| !f.is_missing()))
            .unwrap_or(found.len() - 1);
        let (name, behind) = readings[best];
        statement.name = name.to_vec();
        statement.options(behind.trim_ascii(), false);
        (statement, found.swap_remove(best))
    }

    /// Takes options off the beginning; with `name_follows`, the last word is never theirs.
    fn options<'r>(&mut self, mut rest: &'r [u8], name_follows: bool) -> &'r [u8] {
        while rest.first() == Some(&b'-') {
            let (option, mut after) = split_word(rest);
            // How many words follow at least and at most; all but the least must be numbers.
            let option = option.to_ascii_lowercase();
            let (least, most) = match option.as_slice() {
                b"-s" | b"-o" | b"-t" => (1, 3),
                b"-mm" => (2, 2),
                b"-blendu" | b"-blendv" | b"-boost" | b"-texres" | b"-clamp" | b"-imfchan" | b"-cc" | b"-type"
                | b"-bm" => (1, 1),
                _ => return rest,
            };
            let numeric =
                !matches!(option.as_slice(), b"-clamp" | b"-blendu" | b"-blendv" | b"-imfchan" | b"-cc" | b"-type");
            let mut words: Vec<&[u8]> = Vec::new();
            for k in 0..most {
                let (word, beyond) = split_word(after);
                let is_name = name_follows && beyond.is_empty();
                if word.is_empty() || (numeric && number(word).is_none()) || (k >= least && is_name) {
                    break;
                }
                words.push(word);
                after = beyond;
            }
            self.option(&option, &words);
            rest = after;
        }
        rest
    }

    fn option(&mut self, option: &[u8], words: &[&[u8]]) {
        let numbers: Vec<f64> = words.iter().map_while(|w| number(w)).collect();
        let pair = |default: f64| {
            DVec2::new(numbers.first().copied().unwrap_or(default), numbers.get(1).copied().unwrap_or(default))
        };
        if !matches!(option, b"-s" | b"-o" | b"-clamp" | b"-bm") {
            for word in std::iter::once(&option).chain(words) {
                self.kept.push(b' ');
                self.kept.extend_from_slice(word);
            }
        }
        let on = words.first().is_some_and(|w| w.eq_ignore_ascii_case(b"on"));
        match option {
            b"-s" => self.scale = pair(1.0),
            b"-o" => self.offset = pair(0.0),
            b"-clamp" => self.clamp = on,
            b"-bm" => self.bump = numbers.first().map_or(1.0, |x| *x as f32),
            b"-t" if numbers.iter().any(|x| *x != 0.0) => self.passed_over.push("the turbulence (-t)"),
            b"-mm" if numbers[..] != [0.0, 1.0] => self.passed_over.push("the range of values (-mm)"),
            b"-imfchan" => self.passed_over.push("the choice of a channel (-imfchan)"),
            _ => {}
        }
    }

    /// How the texture lies on the surface: coordinates times `-s` plus `-o`.
    pub(super) fn placement(&self) -> Placement {
        let wrap = if self.clamp { Wrap::Clamp } else { Wrap::Repeat };
        Placement { wrap: [wrap; 2], ..Placement::scaled(self.scale, self.offset) }
    }
}

/// The first word, and what follows the blanks behind it.
fn split_word(text: &[u8]) -> (&[u8], &[u8]) {
    let end = text.iter().position(u8::is_ascii_whitespace).unwrap_or(text.len());
    (&text[..end], text[end..].trim_ascii_start())
}

fn word_starts(text: &[u8]) -> impl Iterator<Item = usize> + '_ {
    (0..text.len()).filter(|&k| !text[k].is_ascii_whitespace() && (k == 0 || text[k - 1].is_ascii_whitespace()))
}

fn number(word: &[u8]) -> Option<f64> {
    std::str::from_utf8(word).ok()?.parse().ok().filter(|x: &f64| x.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::PathBuf;

    /// The statement's name and placement, where only files of these names exist.
    fn read(rest: &str, files: &[&str]) -> (String, TextureStatement) {
        let find = |name: &[u8]| {
            let text = String::from_utf8_lossy(name).into_owned();
            let path = PathBuf::from(&text);
            if files.contains(&text.as_str()) { Located::AsWritten(path) } else { Located::Missing(path) }
        };
        let (statement, _) = TextureStatement::read(rest.as_bytes(), find);
        (String::from_utf8_lossy(&statement.name).into_owned(), statement)
    }

    #[test]
    fn names_are_found_among_options_and_comments() {
        for (line, name) in [
            ("a b.png", "a b.png"),
            ("-s 1 1 1 -o 0 0 a.png", "a.png"),
            ("-clamp on -mm 0 1 dir/a b.png", "dir/a b.png"),
            ("-s 2 5", "5"),
            ("-odd.png", "-odd.png"),
            ("-clamp on", ""),
            ("-s a.png", "a.png"),
            ("a.png -s 1 1 1", "a.png"),
            ("a b.png -s 2 -clamp on # tiled", "a b.png"),
            ("a -s.png", "a -s.png"),
            ("\"my tex.png\"", "my tex.png"),
            ("-bm 2 \"my tex.png\" -s 3", "my tex.png"),
            ("a.png # the skin", "a.png"),
            ("a#1.png", "a#1.png"),
        ] {
            assert_eq!(read(line, &[]).0, name, "{line}");
        }
        // What exists wins.
        assert_eq!(read("a #1.png", &["a #1.png"]).0, "a #1.png");
        assert_eq!(read("a.png -s 1 1", &["a.png -s 1 1"]).0, "a.png -s 1 1");
        assert_eq!(read("a.png -s 1 1", &["a.png"]).0, "a.png");
    }

    #[test]
    fn options_count_before_and_behind() {
        let placed = |scale: [f64; 2], offset: [f64; 2]| Placement::scaled(scale.into(), offset.into());
        let (_, s) = read("-s 2 3 1 -o 0.5 -bm 0.25 a.png -clamp on", &[]);
        assert_eq!(s.placement(), Placement { wrap: [Wrap::Clamp; 2], ..placed([2.0, 3.0], [0.5, 0.0]) });
        assert_eq!(s.bump, 0.25);
        assert_eq!(read("-clamp off -s -2 a.png", &[]).1.placement(), placed([-2.0, 1.0], [0.0, 0.0]));
        // What is not followed is kept, word by word; what is followed is not kept twice.
        let kept = |line: &str| String::from_utf8(read(line, &[]).1.kept).unwrap();
        assert_eq!(kept("-blendu off -s 2 -mm 0.1 0.9 a.png -imfchan r -bm 2"), " -blendu off -mm 0.1 0.9 -imfchan r");
        assert_eq!(kept("-t 0 0 0 -s 1 1 1 a.png"), " -t 0 0 0");
        assert_eq!(kept("-odd a.png"), "");
        assert_eq!(read("-clamp on -s 2 2 t.png", &[]).1.placement().wrap, [Wrap::Clamp; 2]);
        assert_eq!(read("-t 0 0 0 -mm 0 1 a.png", &[]).1.passed_over, [""; 0]);
        assert_eq!(read("-t 1 -mm 0.5 2 -imfchan r a.png", &[]).1.passed_over.len(), 3);
    }
}
