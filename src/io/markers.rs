//! Which marker or joint moves which vertices: JSON from names to places on a mesh.
//!
//! `{"LKNE": 4711, "HEAD": [0.0, 1.7, 0.1], "LeftArm": {"vertices": [17, 29, 80]}}`; a place is a
//! vertex index, a position (the nearest vertex is taken), `{"vertex": i}`, `{"vertices": [i,
//! ...]}`, `{"position": [x, y, z]}` or `{"face": f, "barycentric": [b0, b1, b2]}`. All may stand
//! in an object `"markers"`.

use std::path::Path;

use glam::DVec3;
use serde_json::Value;

use super::anchors::{AnchorSpec, parse_entry};
use super::source;
use crate::{Error, Result};

/// A place on a mesh.
#[derive(Clone, Debug, PartialEq)]
#[doc(hidden)]
pub enum MarkerPlace {
    /// These vertices, 0-based.
    Vertices(Vec<u32>),
    /// The vertex nearest to this position.
    Position(DVec3),
    /// The corner of this triangle, 0-based, that has the largest barycentric coordinate.
    Face(u32, [f64; 3]),
}

/// Reads names of markers or joints with their places, in alphabetical order.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] naming the marker.
pub fn read_markers(path: impl AsRef<Path>) -> Result<Vec<(String, MarkerPlace)>> {
    let path = path.as_ref();
    let text = source::read_text(path)?;
    let value: Value = serde_json::from_str(&text)
        .map_err(|e| Error::format(path, Some(e.line()), format!("this is not valid JSON: {e}"), "Correct the file"))?;
    let remedy = "Write {\"LKNE\": 4711, \"HEAD\": [x, y, z], \"LeftArm\": {\"vertices\": [17, 29]}}";
    let list = value.get("markers").filter(|m| m.is_object()).unwrap_or(&value);
    let Some(list) = list.as_object().filter(|l| !l.is_empty()) else {
        return Err(Error::format(path, None, "there is no object from names to places", remedy));
    };
    let mut places: Vec<(String, MarkerPlace)> = Vec::new();
    for (name, entry) in list {
        let Some(place) = place(entry) else {
            let short: String = name.chars().take(40).collect();
            let what = format!("marker {short:?} has no place of a known form");
            return Err(Error::format(path, None, what, remedy));
        };
        places.push((name.clone(), place));
    }
    places.sort_by(|a, b| a.0.cmp(&b.0));
    Ok(places)
}

fn place(entry: &Value) -> Option<MarkerPlace> {
    let index = |v: &Value| v.as_u64().and_then(|i| u32::try_from(i).ok());
    match entry {
        Value::Number(_) => Some(MarkerPlace::Vertices(vec![index(entry)?])),
        Value::Array(list) => {
            let [x, y, z] = list.as_slice() else { return None };
            let p = DVec3::new(x.as_f64()?, y.as_f64()?, z.as_f64()?);
            p.is_finite().then_some(MarkerPlace::Position(p))
        }
        Value::Object(object) => {
            if let Some(vertex) = object.get("vertex") {
                return Some(MarkerPlace::Vertices(vec![index(vertex)?]));
            }
            if let Some(list) = object.get("vertices") {
                let list: Option<Vec<u32>> = list.as_array()?.iter().map(index).collect();
                return list.filter(|l| !l.is_empty()).map(MarkerPlace::Vertices);
            }
            if object.contains_key("face") {
                let Ok(AnchorSpec::Face { face, barycentric }) = parse_entry(entry) else { return None };
                return Some(MarkerPlace::Face(face, barycentric));
            }
            place(object.get("position").filter(|p| p.is_array())?)
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_forms_are_read_and_faults_are_named() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("m.json");
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            read_markers(&path)
        };
        let places = read(r#"{"b": 3, "a": [0, 1.5, -2], "d": {"vertices": [1, 2]}, "c": {"vertex": 9}, "e": {"position": [1, 2, 3]}}"#).unwrap();
        let names: Vec<&str> = places.iter().map(|p| p.0.as_str()).collect();
        assert_eq!(names, ["a", "b", "c", "d", "e"]);
        assert_eq!(places[0].1, MarkerPlace::Position(DVec3::new(0.0, 1.5, -2.0)));
        assert_eq!(places[3].1, MarkerPlace::Vertices(vec![1, 2]));
        assert_eq!(read(r#"{"markers": {"b": 3}}"#).unwrap().len(), 1);
        for bad in [
            "",
            "[]",
            "{}",
            "{\"knee\": -1}",
            "{\"knee\": [1, 2]}",
            "{\"knee\": {\"vertices\": []}}",
            "{\"knee\": null}",
            "{\"knee\": 4294967296}",
        ] {
            let message = read(bad).unwrap_err().to_string();
            assert!(message.contains("m.json") && (message.contains("knee") || !bad.contains("knee")), "{message}");
        }
    }
}
