//! What the user is told at the end in plain words: whether a result is good.

use serde_json::{Value, json};

use crate::cli::common::Session;
use crate::{Error, Result};

/// What a result is worth, by its reasons.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Verdict {
    /// Why it is not usable.
    pub(crate) unusable: Vec<String>,
    /// What is to be looked at.
    pub(crate) look_at: Vec<String>,
}

impl Verdict {
    /// Judges a share that should be small: up to `good` it is no news, beyond `usable` nothing is
    /// worth using.
    pub(crate) fn share(&mut self, share: f64, good: f64, usable: f64, what: &str) {
        if !(share <= good) {
            let text = format!("{:.1} % {what}", 100.0 * share);
            if share <= usable { self.look_at.push(text) } else { self.unusable.push(text) }
        }
    }

    /// `good`, `look` or `not usable`.
    pub(crate) fn word(&self) -> &'static str {
        match (self.unusable.is_empty(), self.look_at.is_empty()) {
            (false, _) => "not usable",
            (true, false) => "look",
            (true, true) => "good",
        }
    }

    fn sentence(&self) -> String {
        match self.word() {
            "good" => "good".to_owned(),
            "look" => format!("look at the result: {}", self.look_at.join("; ")),
            _ => format!("not usable, because {}", self.unusable.join("; ")),
        }
    }

    /// For reports.
    pub(crate) fn describe(&self) -> Value {
        let because = [self.unusable.as_slice(), self.look_at.as_slice()].concat();
        json!({"word": self.word(), "because": because})
    }

    /// Tells it as the last line.
    ///
    /// # Errors
    /// [`Error::Unusable`] with `strict`, for what is not usable.
    pub(crate) fn tell(&self, session: &Session<'_>, strict: bool, remedy: &str) -> Result<()> {
        if strict && !self.unusable.is_empty() {
            return Err(Error::unusable(self.sentence(), remedy));
        }
        session.say(&self.sentence());
        if !self.unusable.is_empty() {
            session.say(remedy);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_good_worth_a_look_or_too_many() {
        let of = |share: f64| {
            let mut verdict = Verdict::default();
            verdict.share(share, 0.05, 0.5, "of it is wrong");
            verdict
        };
        assert_eq!(of(0.05).sentence(), "good");
        assert_eq!(of(0.1).sentence(), "look at the result: 10.0 % of it is wrong");
        assert_eq!(of(0.75).sentence(), "not usable, because 75.0 % of it is wrong");
        assert_eq!(of(f64::NAN).word(), "not usable");
    }
}
