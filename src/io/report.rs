//! Reports as JSON.

use std::path::Path;

use serde_json::Value;

use super::output;
use crate::{Error, Result};

/// Writes a report, indented, with a line end; whole or not at all.
///
/// # Errors
/// [`Error::Io`].
pub fn write_report(path: impl AsRef<Path>, report: &Value) -> Result<()> {
    let path = path.as_ref();
    let mut text = serde_json::to_vec_pretty(report)
        .map_err(|e| Error::input(format!("the report cannot be written as JSON: {e}"), "Report this as a fault"))?;
    text.push(b'\n');
    output::write_bytes(path, &text)
}

#[cfg(test)]
mod tests {
    use super::*;

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
