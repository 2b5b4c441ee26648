//! Notes, of which only the first of a kind are told.

/// Notes of a kind that are told one by one.
const NOTES_OF_A_KIND: usize = 5;

/// Notes that were told, by kind: those of one differ by names and numbers.
#[derive(Debug, Default)]
pub(crate) struct Told {
    /// The kind, its first note, how many there were.
    kinds: Vec<(String, String, usize)>,
}

impl Told {
    /// Whether a note is one of the first of its kind.
    pub(crate) fn is_new(&mut self, text: &str) -> bool {
        let differs = |word: &&str| !word.contains(|c: char| c.is_ascii_digit() || "\"/\\.".contains(c));
        let kind = text.split_whitespace().filter(differs).collect::<Vec<_>>().join(" ");
        match self.kinds.iter_mut().find(|k| k.0 == kind) {
            Some(known) => {
                known.2 += 1;
                known.2 <= NOTES_OF_A_KIND
            }
            None => {
                self.kinds.push((kind, text.to_owned(), 1));
                true
            }
        }
    }

    /// A sentence for each kind that has more.
    pub(crate) fn rest(&self) -> impl Iterator<Item = String> {
        let many = self.kinds.iter().filter(|k| k.2 > NOTES_OF_A_KIND);
        many.map(|(_, first, count)| format!("and {} more like: {first}", count - NOTES_OF_A_KIND))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn notes_of_a_kind_are_told_five_times() {
        let mut told = Told::default();
        let told_of = |told: &mut Told, k: usize| told.is_new(&format!("the texture \"t{k}.png\" does not exist"));
        assert!((0..5).all(|k| told_of(&mut told, k)));
        assert!(told.rest().next().is_none());
        assert!((5..12).all(|k| !told_of(&mut told, k)));
        assert!(told.is_new("the library m.mtl does not exist"));
        assert_eq!(told.rest().collect::<Vec<_>>(), ["and 7 more like: the texture \"t0.png\" does not exist"]);
    }
}
