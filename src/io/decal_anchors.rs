//! Anchors of decals: points of a mesh with points of a picture.
//!
//! JSON `{"anchors": [...], "uv": [[u, v], ...]}`, the entries of `"anchors"` being those of
//! [`super::anchors`]. Exactly four anchors may be without `"uv"`, and in any form [`read_single`]
//! takes: they are the picture's corners, counter-clockwise from its lower left.

use std::path::Path;

use glam::DVec2;
use serde_json::Value;

use super::anchors::{AnchorList, read_single};
use super::source;
use crate::{Error, Result};

/// Reads the anchors of a decal: where on the mesh, and where in the picture's unit square.
///
/// # Errors
/// As [`read_single`]; [`Error::Format`] for `"uv"` of another form or length than `"anchors"`, or
/// missing with other than four anchors.
pub fn read_decal_anchors(path: impl AsRef<Path>) -> Result<(AnchorList, Vec<DVec2>)> {
    let path = path.as_ref();
    let list = read_single(path)?;
    let count = list.anchors.len();
    let text = source::read_text(path)?;
    // Text was parsed above where it is JSON.
    let given = serde_json::from_str::<Value>(&text).ok().and_then(|v| v.get("uv").cloned());
    let remedy = "Write \"uv\": [[u, v], ...] with a point of the unit square for each anchor";
    let fail = |what: String| Err(Error::format(path, None, what, remedy));
    let Some(given) = given else {
        return match count {
            4 => Ok((list, vec![DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y])),
            0..4 => fail(format!("{count} anchors are too few for a decal, four are the fewest")),
            _ => {
                fail(format!("there are {count} anchors and no \"uv\"; only four are taken for the picture's corners"))
            }
        };
    };
    let Some(entries) = given.as_array() else {
        return fail("\"uv\" is not a list".into());
    };
    let mut uv = Vec::with_capacity(entries.len());
    for (k, entry) in entries.iter().enumerate() {
        match entry.as_array().map(|a| a.iter().map(Value::as_f64).collect::<Vec<_>>()).as_deref() {
            Some([Some(u), Some(v)]) => uv.push(DVec2::new(*u, *v)),
            _ => return fail(format!("\"uv\" {k} is not two numbers")),
        }
    }
    if uv.len() != count {
        return fail(format!("{count} anchors and {} points in \"uv\"", uv.len()));
    }
    Ok((list, uv))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_are_corners_and_faults_are_named() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.json");
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            read_decal_anchors(&path)
        };
        let (list, uv) = read(r#"{"anchors": [1, 2, 3, 4]}"#).unwrap();
        assert_eq!((list.anchors.len(), uv[2]), (4, DVec2::ONE));
        assert_eq!(read("5\n6\n7\n8\n").unwrap().1[1], DVec2::X);
        let (_, uv) = read(r#"{"anchors": [1, 2, 3, 4, 5], "uv": [[0,0],[1,0],[1,1],[0,1],[0.5,0.25]]}"#).unwrap();
        assert_eq!(uv[4], DVec2::new(0.5, 0.25));
        for (text, expected) in [
            (r#"{"anchors": [1, 2, 3]}"#, "3 anchors are too few"),
            (r#"{"anchors": [1, 2, 3, 4, 5]}"#, "no \"uv\""),
            (r#"{"anchors": [1, 2, 3, 4], "uv": [[0,0],[1,0],[1,1]]}"#, "4 anchors and 3 points"),
            (r#"{"anchors": [1, 2, 3, 4], "uv": [[0,0],[1,0],[1,1],[0]]}"#, "\"uv\" 3"),
            (r#"{"anchors": [1, 2, 3, 4], "uv": [[0,0],[1,0],[1,1],[0,null]]}"#, "\"uv\" 3"),
            (r#"{"anchors": [1, 2, 3, 4], "uv": 7}"#, "not a list"),
            (r#"{"anchors": [1, 2, 3, 4], "uv": [[0,0],[1,0],[1,NaN],[0,1]]}"#, "JSON"),
        ] {
            let message = read(text).unwrap_err().to_string();
            assert!(message.contains(expected) && message.contains("a.json"), "{text}: {message}");
        }
    }
}
