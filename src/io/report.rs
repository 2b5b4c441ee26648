//! Reports as JSON.

use std::path::Path;

use serde_json::Value;

use super::{finite, output};
use crate::{Error, Result};

/// Keys that are null where there is no such thing. All others have a value: JSON has no number
/// that is not finite, and such a number becomes null without a word.
const MAY_BE_NULL: &[&str] = &[
    "alignment",
    "ambiguity",
    "field",
    "flagged",
    "file",
    "genus",
    "handed_back",
    "layout",
    "lemma_1",
    "metres_per_unit",
    "nanoseconds_per_texel",
    "round_trip",
    "size_ratio",
    "source",
    "target",
    "volume",
];

/// Fails if a value of `report` is null that has to be a number; `file` is named.
///
/// # Errors
/// [`Error::NotFinite`] naming the key.
pub fn check_report(file: &Path, report: &Value) -> Result<()> {
    match nothing(report, "", "") {
        Some(place) => Err(finite::refused(file, format!("key {place}"), f64::NAN)),
        None => Ok(()),
    }
}

/// Where `value`, under `key` at `place`, has a null that is not allowed.
fn nothing(value: &Value, key: &str, place: &str) -> Option<String> {
    match value {
        Value::Null if !MAY_BE_NULL.contains(&key) => Some(place.to_owned()),
        Value::Array(list) => list.iter().enumerate().find_map(|(k, v)| nothing(v, key, &format!("{place}[{k}]"))),
        Value::Object(members) => members.iter().find_map(|(key, value)| {
            let dot = if place.is_empty() { "" } else { "." };
            nothing(value, key, &format!("{place}{dot}{key}"))
        }),
        _ => None,
    }
}

/// Writes a report, indented, with a line end; whole or not at all.
///
/// # Errors
/// [`Error::Io`]; [`Error::NotFinite`] as [`check_report`].
pub fn write_report(path: impl AsRef<Path>, report: &Value) -> Result<()> {
    let path = path.as_ref();
    check_report(path, report)?;
    let mut text = serde_json::to_vec_pretty(report)
        .map_err(|e| Error::input(format!("the report cannot be written as JSON: {e}"), "Report this as a fault"))?;
    text.push(b'\n');
    output::write_bytes(path, &text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_that_is_not_finite_is_named_by_its_key() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("r.json");
        let says = |report: Value, words: &str| {
            let message = write_report(&path, &report).unwrap_err().to_string();
            assert!(message.contains("r.json") && message.contains(words) && !path.exists(), "{message}");
        };
        says(serde_json::json!({"deviation": f64::NAN}), "key deviation would be NaN");
        says(serde_json::json!({"a": {"list": [1.0, f64::INFINITY]}}), "key a.list[1]");
        says(serde_json::json!({"steps": [{"j_min": 1.0}, {"j_min": f64::NAN}]}), "key steps[1].j_min");
        write_report(&path, &serde_json::json!({"pairs": [{"flagged": null}]})).unwrap();
    }

    #[test]
    fn numbers_read_back() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("r.json");
        let report = serde_json::json!({"command": "transfer", "valid_fraction": 0.1 + 0.2, "texels": 4194304});
        write_report(&path, &report).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.ends_with("}\n") && text.lines().count() == 5);
        assert_eq!(serde_json::from_str::<Value>(&text).unwrap(), report);
    }
}
