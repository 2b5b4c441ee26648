//! One table for the words of an option: of the command line, of files, of reports and of messages.

use crate::error::{Error, Result};

/// Gives a plain enum its words: `word()`, `Display`, `FromStr`, serde, and the values of an option
/// with their help.
///
/// `words! { TYPE, "field", "what it is": VARIANT => "word" "help", ... }`; the help may be
/// missing.
macro_rules! words {
    ($type:ident, $field:literal, $what:literal: $($variant:ident => $word:literal $($help:literal)?,)+) => {
        impl $type {
            /// All values, in the order of help.
            pub(crate) const ALL: &'static [Self] = &[$(Self::$variant),+];

            /// The word of the command line and of reports.
            #[allow(unreachable_pub, reason = "some of the types are of the command line alone")]
            pub const fn word(self) -> &'static str {
                match self {
                    $(Self::$variant => $word,)+
                }
            }
        }

        impl std::fmt::Display for $type {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.pad(self.word())
            }
        }

        impl std::str::FromStr for $type {
            type Err = crate::error::Error;

            fn from_str(word: &str) -> crate::error::Result<Self> {
                $crate::words::find(Self::ALL, |value| value.word(), word, $field, $what)
            }
        }

        impl serde::Serialize for $type {
            fn serialize<S: serde::Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
                serializer.serialize_str(self.word())
            }
        }

        impl<'de> serde::Deserialize<'de> for $type {
            fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
                let word = <std::borrow::Cow<'de, str> as serde::Deserialize>::deserialize(deserializer)?;
                word.parse().map_err(serde::de::Error::custom)
            }
        }

        #[cfg(feature = "cli")]
        impl clap::ValueEnum for $type {
            fn value_variants<'a>() -> &'a [Self] {
                Self::ALL
            }

            fn to_possible_value(&self) -> Option<clap::builder::PossibleValue> {
                let help: &[&'static str] = match self {
                    $(Self::$variant => &[$($help)?],)+
                };
                let value = clap::builder::PossibleValue::new(self.word());
                Some(help.iter().fold(value, |value, help| value.help(help)))
            }
        }
    };
}

pub(crate) use words;

/// The value with this word.
///
/// # Errors
/// [`Error::Option`] with the words that there are.
pub(crate) fn find<T: Copy>(
    all: &[T],
    word_of: impl Fn(T) -> &'static str,
    word: &str,
    field: &str,
    what: &str,
) -> Result<T> {
    all.iter().copied().find(|value| word_of(*value) == word).ok_or_else(|| {
        let words: Vec<&str> = all.iter().map(|value| word_of(*value)).collect();
        let listed = match words.split_last() {
            Some((last, [])) => (*last).to_owned(),
            Some((last, rest)) => format!("{} or {last}", rest.join(", ")),
            None => String::new(),
        };
        Error::option(field, format!("'{word}' is not {what}"), format!("Use {listed}"))
    })
}

#[cfg(test)]
mod tests {
    use crate::engine::Backend;
    use crate::surface::correspondence::Method;
    use crate::tools::transfer::Fill;

    #[test]
    fn a_word_is_the_same_everywhere() {
        for value in Fill::ALL {
            let word = value.word();
            assert_eq!((value.to_string().as_str(), word.parse::<Fill>().unwrap()), (word, *value));
            let json = serde_json::to_string(value).unwrap();
            assert_eq!(json, format!("\"{word}\""));
            assert_eq!(serde_json::from_str::<Fill>(&json).unwrap(), *value);
        }
        assert_eq!(format!("{:>6}|{:<5}|", Backend::Cpu, Backend::Gpu), "   cpu|gpu  |");
    }

    #[test]
    fn an_unknown_word_is_told_those_that_there_are() {
        let message = |word: &str| word.parse::<Backend>().unwrap_err().to_string();
        assert!(
            message("GPU").contains("'GPU' is not a back end. Use auto, gpu, cpu or reference"),
            "{}",
            message("GPU")
        );
        assert!("fields".parse::<Method>().is_err() && "".parse::<Method>().is_err());
        let text = serde_json::from_str::<Method>("\"splines\"").unwrap_err().to_string();
        assert!(text.contains("Use averages, transport, field, rbf or closest"), "{text}");
    }

    #[cfg(feature = "cli")]
    #[test]
    fn options_have_the_words_and_their_help() {
        use clap::ValueEnum;
        for value in Method::value_variants() {
            let shown = value.to_possible_value().unwrap();
            assert_eq!(shown.get_name(), value.word());
            assert!(shown.get_help().is_some(), "{value}");
        }
        assert!(Fill::None.to_possible_value().unwrap().get_help().is_none());
    }
}
