//! Handles: vertices and where they go; and lists of vertices.
//!
//! Handles are JSON `{"handles": [{"vertex": i, "position": [x, y, z]}, ...]}`. A region is text,
//! one vertex index a line; `#` begins a comment.

use std::path::Path;

use glam::DVec3;
use serde_json::Value;

use super::source;
use crate::geometry::Mesh;
use crate::geometry::off_mesh::{ELSEWHERE, FARTHEST, lies_off};
use crate::{Error, Result};

/// Reads handles as pairs of a 0-based vertex and its new position.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] naming the handle: not JSON, no list `handles`, a vertex that
/// is no index, a position that is not three finite numbers. Indices are not checked against a mesh
/// here.
pub fn read_handles(path: impl AsRef<Path>) -> Result<Vec<(u32, DVec3)>> {
    let path = path.as_ref();
    let text = source::read_text(path)?;
    let remedy = "Write {\"handles\": [{\"vertex\": 0, \"position\": [0.0, 0.0, 0.0]}, ...]}";
    let value: Value = serde_json::from_str(&text)
        .map_err(|e| Error::format(path, Some(e.line()), format!("this is not valid JSON: {e}"), remedy))?;
    let Some(list) = value.get("handles").and_then(Value::as_array) else {
        return Err(Error::format(path, None, "there is no list \"handles\"", remedy));
    };
    let handle = |(k, entry): (usize, &Value)| {
        let wrong = |what: &str| Error::format(path, None, format!("handle {k}: {what}"), remedy);
        let vertex = entry
            .get("vertex")
            .and_then(Value::as_u64)
            .and_then(|v| u32::try_from(v).ok())
            .ok_or_else(|| wrong("\"vertex\" is not a vertex index"))?;
        let position = entry.get("position").and_then(Value::as_array).filter(|p| p.len() == 3);
        let number = |x: &Value| x.as_f64().filter(|x| x.is_finite());
        let xyz = position.and_then(|p| Some([number(&p[0])?, number(&p[1])?, number(&p[2])?]));
        Ok((vertex, DVec3::from(xyz.ok_or_else(|| wrong("\"position\" is not three finite numbers"))?)))
    };
    list.iter().enumerate().map(handle).collect()
}

/// Fails for a handle that is put farther from the mesh than 100 times the diagonal of the box
/// around it, from that box.
///
/// # Errors
/// [`Error::Format`] naming the handle and the distance.
pub fn check_handles(path: impl AsRef<Path>, mesh: &Mesh, handles: &[(u32, DVec3)]) -> Result<()> {
    let Some((low, high)) = mesh.bounds() else { return Ok(()) };
    let diagonal = low.distance(high);
    for (k, (vertex, p)) in handles.iter().enumerate() {
        let away = p.distance(p.clamp(low, high));
        if !(away <= FARTHEST * diagonal) {
            let what =
                format!("handle {k} (vertex {vertex}): the position {} {}", super::place(*p), lies_off(away, diagonal));
            return Err(Error::format(path, None, what, ELSEWHERE));
        }
    }
    Ok(())
}

/// Reads a list of 0-based vertex indices, one a line (several on a line are taken too).
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] naming the line of a word that is no index.
pub fn read_vertex_list(path: impl AsRef<Path>) -> Result<Vec<u32>> {
    let path = path.as_ref();
    let mut list = Vec::new();
    for (k, line) in source::read_text(path)?.lines().enumerate() {
        let line = line.split('#').next().unwrap_or_default();
        for word in line.split([' ', '\t', ',', ';', '\r']).filter(|w| !w.is_empty()) {
            let vertex = word.parse().map_err(|_| {
                let what = format!("{:?} is not a vertex index", super::obj::shortened(word));
                Error::format(path, Some(k + 1), what, "Write one vertex index a line, counted from 0")
            })?;
            list.push(vertex);
        }
    }
    Ok(list)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn handles_are_read_and_faults_are_named() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("h.json");
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            read_handles(&path).map_err(|e| e.to_string())
        };
        let good = read(r#"{"handles": [{"vertex": 3, "position": [1, 2.5, -3e1]}], "note": 1}"#).unwrap();
        assert_eq!(good, [(3, DVec3::new(1.0, 2.5, -30.0))]);
        assert_eq!(read(r#"{"handles": []}"#).unwrap(), []);
        for (text, part) in [
            ("", "JSON"),
            ("[]", "no list"),
            (r#"{"handles": [{"vertex": -1, "position": [1,2,3]}]}"#, "handle 0"),
            (
                r#"{"handles": [{"vertex": 1, "position": [1,2,3]}, {"vertex": 4294967296, "position": [1,2,3]}]}"#,
                "handle 1",
            ),
            (r#"{"handles": [{"vertex": 1, "position": [1,2]}]}"#, "three"),
            (r#"{"handles": [{"vertex": 1, "position": [1,2,"x"]}]}"#, "three"),
            (r#"{"handles": [{"vertex": 1, "position": [1,2,1e999]}]}"#, "h.json"),
        ] {
            let message = read(text).unwrap_err();
            assert!(message.contains(part), "{text}: {message}");
        }
    }

    #[test]
    fn handles_beyond_a_hundred_diagonals_are_refused() {
        let mesh = Mesh::of_triangles("m", vec![DVec3::ZERO, DVec3::X, DVec3::Y], &[[0, 1, 2]]);
        let diagonal = 2f64.sqrt();
        let at =
            |sizes: f64| check_handles("h.json", &mesh, &[(1, DVec3::X), (2, DVec3::new(0.0, 0.0, sizes * diagonal))]);
        at(99.0).unwrap();
        let message = at(101.0).unwrap_err().to_string();
        assert!(message.contains("h.json") && message.contains("handle 1 (vertex 2)"), "{message}");
        assert!(message.contains("101 times its diagonal"), "{message}");
        assert!(at(1e300).is_err() && at(-101.0).is_err());
    }

    #[test]
    fn lists_of_vertices() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("roi.txt");
        std::fs::write(&path, "# region\n3\r\n 4, 5 # more\n\n9").unwrap();
        assert_eq!(read_vertex_list(&path).unwrap(), [3, 4, 5, 9]);
        std::fs::write(&path, "3\nx\n").unwrap();
        let message = read_vertex_list(&path).unwrap_err().to_string();
        assert!(message.contains("line 2") && message.contains("\"x\""), "{message}");
    }
}
