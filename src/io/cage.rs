//! Cages: pairs of polygons that a picture or points are warped by.

use std::path::Path;

use glam::DVec2;
use serde_json::Value;

use super::cage_outline;
use super::obj::shortened;
use super::source;
use crate::{Error, Result};

/// More vertices than this in one cage are not read: every point of a picture is compared with
/// every edge.
#[doc(hidden)]
pub const MOST_VERTICES: usize = 1 << 16;

/// What the coordinates of a cage count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CageUnits {
    /// Pixels: x to the right, y down, from the upper left corner of the picture; the centres of
    /// pixels lie at halves.
    Pixel,
    /// Heights of the picture: x to the right, y up, from its lower left corner.
    Unit,
}

impl CageUnits {
    /// The word in the file.
    pub fn word(self) -> &'static str {
        match self {
            Self::Pixel => "pixel",
            Self::Unit => "unit",
        }
    }
}

/// The loops of a cage as the file has them: as many in the source as in the target, and as many
/// vertices in each pair of loops.
#[derive(Clone, Debug, PartialEq)]
#[doc(hidden)]
pub struct CageFile {
    /// Where the picture is.
    pub source: Vec<Vec<DVec2>>,
    /// Where it goes.
    pub target: Vec<Vec<DVec2>>,
    /// What the coordinates count, where the file says so.
    pub units: Option<CageUnits>,
}

/// Reads a cage: an SVG or GeoJSON document with two outlines, or `{"source": LOOPS, "target":
/// LOOPS, "units": "pixel" | "unit"}`, LOOPS being one loop `[[x, y], ...]` or a list of loops.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] naming the polygon, loop and vertex: no JSON, a missing
/// polygon, loops or vertices that do not pair up, fewer than three vertices, numbers that are not
/// finite, more than [`MOST_VERTICES`].
pub fn read_cage(path: impl AsRef<Path>) -> Result<CageFile> {
    let path = path.as_ref();
    parse_cage(&source::read_text(path)?, path)
}

/// [`read_cage`] of a text; `name` stands in messages.
///
/// # Errors
/// As [`read_cage`].
#[doc(hidden)]
pub fn parse_cage(text: &str, name: impl AsRef<Path>) -> Result<CageFile> {
    const SHAPE: &str = "Write {\"source\": [[x, y], ...], \"target\": [[x, y], ...]}, or lists of such loops";
    let name = name.as_ref();
    let svg = text.trim_start().starts_with('<');
    if svg {
        let [source, target] = cage_outline::of_svg(text, name)?;
        return checked(CageFile { source, target, units: None }, name);
    }
    let root: Value = serde_json::from_str(text).map_err(|e| {
        let line = Some(e.line()).filter(|&line| line > 0);
        Error::format(name, line, format!("this is not JSON: {e}"), SHAPE)
    })?;
    let fail = |what: String, remedy: &str| Error::format(name, None, what, remedy);
    let Value::Object(members) = &root else { return Err(fail("a cage is a JSON object".into(), SHAPE)) };
    if members.contains_key("type") && !members.contains_key("source") {
        let [source, target] = cage_outline::of_geojson(&root, name)?;
        return checked(CageFile { source, target, units: None }, name);
    }
    let polygon = |key: &str| -> Result<Vec<Vec<DVec2>>> {
        let value = members.get(key).ok_or_else(|| fail(format!("{key:?} is missing"), SHAPE))?;
        loops(value).map_err(|what| fail(format!("{key}, {what}"), SHAPE))
    };
    let (source, target) = (polygon("source")?, polygon("target")?);
    let units = match members.get("units") {
        None | Some(Value::Null) => None,
        Some(Value::String(word)) if word == "pixel" => Some(CageUnits::Pixel),
        Some(Value::String(word)) if word == "unit" => Some(CageUnits::Unit),
        Some(other) => {
            let what = format!("units are {}", shortened(&other.to_string()));
            return Err(fail(what, "Write \"units\": \"pixel\" or \"unit\""));
        }
    };
    checked(CageFile { source, target, units }, name)
}

/// A cage whose loops and vertices pair up.
fn checked(cage: CageFile, name: &Path) -> Result<CageFile> {
    let fail = |what: String, remedy: &str| Error::format(name, None, what, remedy);
    let CageFile { source, target, .. } = &cage;
    if source.len() != target.len() {
        let what = format!("source has {} loops, target {}", source.len(), target.len());
        return Err(fail(what, "Give each loop of the source its image in the target, in the same order"));
    }
    for (k, (a, b)) in source.iter().zip(target).enumerate() {
        if a.len() != b.len() {
            let what = format!("loop {k} has {} vertices in the source, {} in the target", a.len(), b.len());
            return Err(fail(what, "Give each vertex its image, in the same order"));
        }
        if a.len() < 3 {
            let what = format!("loop {k} has {} vertices", a.len());
            return Err(fail(what, "A loop has three vertices or more"));
        }
    }
    let vertices: usize = source.iter().map(Vec::len).sum();
    if vertices > MOST_VERTICES {
        let what = format!("there are {vertices} vertices");
        return Err(fail(what, &format!("Simplify the cage to {MOST_VERTICES} vertices or fewer")));
    }
    Ok(cage)
}

/// One loop or a list of them.
fn loops(value: &Value) -> std::result::Result<Vec<Vec<DVec2>>, String> {
    let Value::Array(items) = value else { return Err("which should be a list of vertices".into()) };
    if items.is_empty() {
        return Err("which has no vertices".into());
    }
    // A vertex is a list of numbers, a loop a list of vertices.
    let single = matches!(&items[0], Value::Array(first) if first.first().is_none_or(|v| !v.is_array()));
    if single {
        return Ok(vec![vertices(items, 0)?]);
    }
    items
        .iter()
        .enumerate()
        .map(|(k, ring)| match ring {
            Value::Array(items) => vertices(items, k),
            _ => Err(format!("loop {k}: it should be a list of vertices")),
        })
        .collect()
}

fn vertices(items: &[Value], ring: usize) -> std::result::Result<Vec<DVec2>, String> {
    items
        .iter()
        .enumerate()
        .map(|(i, vertex)| {
            let fail = || format!("loop {ring}, vertex {i}: {} is not [x, y]", shortened(&vertex.to_string()));
            let Value::Array(pair) = vertex else { return Err(fail()) };
            let [x, y] = &pair[..] else { return Err(fail()) };
            let point = DVec2::new(x.as_f64().ok_or_else(fail)?, y.as_f64().ok_or_else(fail)?);
            if point.is_finite() { Ok(point) } else { Err(fail()) }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn one_loop_or_several() {
        let one = parse_cage(r#"{"source": [[0,0],[1,0],[0,1]], "target": [[0,0],[2,0.5],[0,1e1]]}"#, "c").unwrap();
        assert_eq!((one.source.len(), one.target[0][2], one.units), (1, DVec2::new(0.0, 10.0), None));
        let two = r#"{"units": "unit", "source": [[[0,0],[1,0],[0,1]],[[0.1,0.1],[0.2,0.1],[0.1,0.2]]],
            "target": [[[0,0],[1,0],[0,1]],[[0.1,0.1],[0.2,0.1],[0.1,0.2]]], "more": {}}"#;
        let two = parse_cage(two, "c").unwrap();
        assert_eq!((two.source.len(), two.units), (2, Some(CageUnits::Unit)));
    }

    #[test]
    fn mistakes_are_named() {
        let with = |source: &str, target: &str| format!("{{\"source\": {source}, \"target\": {target}}}");
        let triangle = "[[0,0],[1,0],[0,1]]";
        for (text, words) in [
            (String::new(), vec!["not JSON"]),
            ("{\n\"source\": [[0,0],\n[1,0".into(), vec!["line 3"]),
            ("[1]".into(), vec!["object"]),
            (format!("{{\"source\": {triangle}}}"), vec!["\"target\" is missing"]),
            (with(triangle, "[[0,0],[1,0]]"), vec!["loop 0", "3 vertices", "2 in the target"]),
            (with("[[0,0],[1,0]]", "[[0,0],[1,0]]"), vec!["loop 0 has 2 vertices", "three"]),
            (with(triangle, "[[0,0],[1,null],[0,1]]"), vec!["target, loop 0, vertex 1", "null"]),
            (with(triangle, "[[0,0],[1,0,2],[0,1]]"), vec!["vertex 1"]),
            (with(triangle, "[[0,0],[1],[0,1]]"), vec!["vertex 1"]),
            (with(triangle, &format!("[{triangle}, 7]")), vec!["target, loop 1"]),
            (with(triangle, &format!("[{triangle}, {triangle}]")), vec!["1 loops, target 2"]),
            (with(triangle, "[]"), vec!["no vertices"]),
            (with(triangle, "[[]]"), vec!["vertex 0"]),
            (with(triangle, "{}"), vec!["target"]),
            (with(triangle, "[[0,0],[1e999,0],[0,1]]"), vec!["c.json"]),
            (with(triangle, "[[0,0],[NaN,0],[0,1]]"), vec!["not JSON", "line 1"]),
            (format!("{{\"source\": {triangle}, \"target\": {triangle}, \"units\": \"feet\"}}"), vec!["feet", "pixel"]),
        ] {
            let message = parse_cage(&text, "c.json").unwrap_err().to_string();
            for word in words {
                assert!(message.contains(word) && message.contains("c.json"), "{text}: {message}");
            }
        }
        let many = format!("[{}]", vec!["[0,1]"; MOST_VERTICES + 1].join(","));
        assert!(parse_cage(&with(&many, &many), "c").unwrap_err().to_string().contains("Simplify"));
    }

    proptest! {
        #[test]
        fn any_text_is_read_or_refused(text in "[\\[\\]{}\":,0-9eE.sourcetagn \\-]{0,80}") {
            let _ = parse_cage(&text, "c");
        }

        #[test]
        fn what_is_written_is_read(points in prop::collection::vec((-1e9f64..1e9, -1e9f64..1e9), 3..20)) {
            let list: Vec<[f64; 2]> = points.iter().map(|p| [p.0, p.1]).collect();
            let text = serde_json::json!({"source": list, "target": [list]}).to_string();
            let cage = parse_cage(&text, "c").unwrap();
            prop_assert_eq!(&cage.source, &cage.target);
            for (v, p) in cage.source[0].iter().zip(&points) {
                prop_assert_eq!((v.x, v.y), *p);
            }
        }
    }
}
