//! GeoJSON (RFC 7946): the coordinates of a document, taken out and put back.

use std::path::Path;

use glam::DVec2;
use serde_json::{Value, json};

use super::obj::shortened;
use super::outline::{MappedShape, Part, Segment, Shape};
use super::{finite, output, source};
use crate::{Error, Result};

const REMEDY: &str = "Give a GeoJSON document as RFC 7946 has it";

/// A GeoJSON document. Everything but coordinates and bounding boxes stays as it was.
#[derive(Clone, Debug, PartialEq)]
pub struct GeoJson {
    root: Value,
}

/// How deep the positions of a geometry lie, and whether its lines are closed.
fn nesting(kind: &str) -> Option<(usize, bool, bool)> {
    Some(match kind {
        "Point" => (0, false, true),
        "MultiPoint" => (1, false, true),
        "LineString" => (1, false, false),
        "MultiLineString" => (2, false, false),
        "Polygon" => (2, true, false),
        "MultiPolygon" => (3, true, false),
        _ => return None,
    })
}

impl GeoJson {
    /// Reads a document of any kind: a geometry, a feature or a collection.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] naming the feature and the position.
    pub fn read(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        Self::parse(&source::read_text(path)?, path)
    }

    /// [`GeoJson::read`] of a text; `name` stands in messages.
    ///
    /// # Errors
    /// As [`GeoJson::read`].
    pub fn parse(text: &str, name: impl AsRef<Path>) -> Result<Self> {
        let name = name.as_ref();
        let root: Value = serde_json::from_str(text).map_err(|e| {
            let line = Some(e.line()).filter(|&line| line > 0);
            Error::format(name, line, format!("this is not JSON: {e}"), REMEDY)
        })?;
        let document = Self { root };
        // Everything is looked at once, so that what follows cannot fail.
        let mut ignored = Vec::new();
        collect(&document.root, "", &mut ignored).map_err(|what| Error::format(name, None, what, REMEDY))?;
        Ok(document)
    }

    /// The outlines of all geometries in the order of the document.
    pub fn shapes(&self) -> Vec<Shape> {
        let mut shapes = Vec::new();
        // Checked when it was read.
        let _ = collect(&self.root, "", &mut shapes);
        shapes
    }

    /// Puts the images of the [shapes](GeoJson::shapes) in their places; a geometry without an
    /// image becomes null. Coordinates beyond the second, heights for example, stay, and are
    /// interpolated at new vertices. Bounding boxes are removed: they no longer hold.
    pub fn replace(&mut self, images: &[Option<MappedShape>]) {
        replace(&mut self.root, &mut images.iter());
    }

    /// Writes the document, whole or not at all.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::NotFinite`] for a coordinate that is not finite.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<()> {
        let path = path.as_ref();
        if let Some(place) = missing_coordinate(&self.root, "") {
            return Err(finite::refused(path, place, f64::NAN));
        }
        let mut text = self.root.to_string();
        text.push('\n');
        output::write_bytes(path, text.as_bytes())
    }
}

/// Where a coordinate is no number: JSON has none for one that is not finite.
fn missing_coordinate(value: &Value, place: &str) -> Option<String> {
    match value {
        Value::Object(members) => members.iter().filter(|(key, _)| *key != "properties").find_map(|(key, value)| {
            let here = format!("{place}{key}");
            let coordinates = key == "coordinates";
            if coordinates { has_null(value).then_some(here) } else { missing_coordinate(value, &(here + ".")) }
        }),
        Value::Array(list) => {
            let at = |k: usize| format!("{}[{k}].", place.trim_end_matches('.'));
            list.iter().enumerate().find_map(|(k, value)| missing_coordinate(value, &at(k)))
        }
        _ => None,
    }
}

fn has_null(value: &Value) -> bool {
    value.is_null() || value.as_array().is_some_and(|list| list.iter().any(has_null))
}

/// Adds the shapes under `value`; the error says what is wrong.
fn collect(value: &Value, place: &str, shapes: &mut Vec<Shape>) -> std::result::Result<(), String> {
    let here = |what: String| if place.is_empty() { what } else { format!("{place}: {what}") };
    let Value::Object(members) = value else { return Err(here("there is no GeoJSON object".into())) };
    let kind = members.get("type").and_then(Value::as_str).ok_or_else(|| here("an object has no type".into()))?;
    let list = |key: &str| {
        members.get(key).and_then(Value::as_array).ok_or_else(|| here(format!("a {kind} has no list of {key}")))
    };
    match kind {
        "FeatureCollection" => {
            for (i, feature) in list("features")?.iter().enumerate() {
                collect(feature, &format!("feature {i}"), shapes)?;
            }
        }
        "Feature" => match members.get("geometry") {
            None | Some(Value::Null) => {}
            Some(geometry) => collect(geometry, if place.is_empty() { "the feature" } else { place }, shapes)?,
        },
        "GeometryCollection" => {
            for (i, geometry) in list("geometries")?.iter().enumerate() {
                let inner = if place.is_empty() { format!("geometry {i}") } else { format!("{place}, geometry {i}") };
                collect(geometry, &inner, shapes)?;
            }
        }
        kind => {
            let (depth, closed, points) =
                nesting(kind).ok_or_else(|| here(format!("{:?} is no GeoJSON type", shortened(kind))))?;
            let coordinates = members.get("coordinates").ok_or_else(|| here(format!("a {kind} has no coordinates")))?;
            let mut parts = Vec::new();
            lines(coordinates, depth, closed, points, &mut parts).map_err(|what| here(format!("{kind}: {what}")))?;
            let name = if place.is_empty() { kind.to_owned() } else { place.to_owned() };
            shapes.push(Shape { name, parts });
        }
    }
    Ok(())
}

fn lines(
    value: &Value,
    depth: usize,
    closed: bool,
    points: bool,
    parts: &mut Vec<Part>,
) -> std::result::Result<(), String> {
    let alone = |p: DVec2| Part { start: p, segments: Vec::new(), closed: false };
    if depth == 0 {
        // An empty list is a point that is nowhere.
        if !matches!(value, Value::Array(items) if items.is_empty()) {
            parts.push(alone(position(value)?));
        }
        return Ok(());
    }
    let Value::Array(items) = value else {
        return Err(format!("{} is no list of positions", shortened(&value.to_string())));
    };
    if depth > 1 {
        return items.iter().try_for_each(|item| lines(item, depth - 1, closed, points, parts));
    }
    let positions = items.iter().map(position).collect::<std::result::Result<Vec<_>, _>>()?;
    if points {
        parts.extend(positions.into_iter().map(alone));
    } else if let [first, rest @ ..] = &positions[..] {
        let closed = closed && rest.last() == Some(first);
        parts.push(Part { start: *first, segments: rest.iter().map(|p| Segment::Line(*p)).collect(), closed });
    }
    Ok(())
}

fn position(value: &Value) -> std::result::Result<DVec2, String> {
    let fail = || format!("{} is no position [x, y]", shortened(&value.to_string()));
    let Value::Array(numbers) = value else { return Err(fail()) };
    if numbers.len() < 2 || numbers.iter().any(|n| !n.is_number()) {
        return Err(fail());
    }
    let at = |i: usize| numbers[i].as_f64().filter(|v| v.is_finite()).ok_or_else(fail);
    Ok(DVec2::new(at(0)?, at(1)?))
}

/// Puts images in place; walks as [`collect`] does, on a document that it accepted.
fn replace<'m>(value: &mut Value, images: &mut impl Iterator<Item = &'m Option<MappedShape>>) {
    let Value::Object(members) = value else { return };
    members.remove("bbox");
    let kind = members.get("type").and_then(Value::as_str).unwrap_or_default().to_owned();
    match kind.as_str() {
        "FeatureCollection" | "GeometryCollection" => {
            let key = if kind == "FeatureCollection" { "features" } else { "geometries" };
            if let Some(Value::Array(items)) = members.get_mut(key) {
                items.iter_mut().for_each(|item| replace(item, images));
                // Only features may be without a geometry.
                items.retain(|item| !item.is_null());
            }
        }
        "Feature" => {
            if let Some(geometry) = members.get_mut("geometry") {
                replace(geometry, images);
            }
        }
        kind => {
            let Some((depth, closed, points)) = nesting(kind) else { return };
            match images.next() {
                Some(Some(image)) => {
                    if let Some(coordinates) = members.get_mut("coordinates") {
                        put(coordinates, depth, closed, points, &mut image.iter());
                    }
                }
                _ => *value = Value::Null,
            }
        }
    }
}

fn put<'m>(
    value: &mut Value,
    depth: usize,
    closed: bool,
    points: bool,
    parts: &mut impl Iterator<Item = &'m Vec<super::outline::Vertex>>,
) {
    let Value::Array(items) = value else { return };
    if depth == 0 {
        if !items.is_empty()
            && let Some(vertex) = parts.next().and_then(|part| part.first())
        {
            set(items, vertex.point);
        }
        return;
    }
    if depth > 1 {
        items.iter_mut().for_each(|item| put(item, depth - 1, closed, points, parts));
        return;
    }
    if points {
        items.iter_mut().for_each(|item| put(item, 0, closed, points, parts));
        return;
    }
    if items.is_empty() {
        return;
    }
    let Some(part) = parts.next() else { return };
    let closed = closed && items.first() == items.last();
    let old = std::mem::take(items);
    items.extend(part.iter().enumerate().map(|(k, vertex)| {
        let (segment, t) = vertex.from;
        let (a, b) = if k == 0 { (0, 0) } else { (segment, (segment + 1).min(old.len() - 1)) };
        let mut position = between(&old[a], &old[b], t);
        set(&mut position, vertex.point);
        Value::Array(position)
    }));
    if closed
        && let (Some(first), n) = (items.first().cloned(), items.len())
        && n > 1
    {
        items[n - 1] = first;
    }
}

fn set(position: &mut [Value], p: DVec2) {
    for (value, v) in position.iter_mut().zip([p.x, p.y]) {
        *value = json!(v);
    }
}

/// A position with what it has beside x and y between those of two others.
fn between(a: &Value, b: &Value, t: f64) -> Vec<Value> {
    let (Value::Array(a), Value::Array(b)) = (a, b) else { return vec![json!(0.0), json!(0.0)] };
    if t <= 0.0 {
        return a.clone();
    }
    if t >= 1.0 {
        return b.clone();
    }
    let mix = |(a, b): (&Value, &Value)| json!(a.as_f64().unwrap_or(0.0) * (1.0 - t) + b.as_f64().unwrap_or(0.0) * t);
    a.iter().zip(b).map(mix).collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::outline::Vertex;
    use super::*;

    /// The image under a translation, with the middle of every segment as a new vertex if
    /// `refined`.
    fn moved(shapes: &[Shape], by: DVec2, refined: bool) -> Vec<Option<MappedShape>> {
        let part = |part: &Part| {
            let mut vertices = vec![Vertex { point: part.start + by, from: (0, 0.0) }];
            let mut at = part.start;
            for (i, s) in part.segments.iter().enumerate() {
                if refined {
                    vertices.push(Vertex { point: s.at(at, 0.5) + by, from: (i, 0.5) });
                }
                vertices.push(Vertex { point: s.end() + by, from: (i, 1.0) });
                at = s.end();
            }
            vertices
        };
        shapes.iter().map(|s| Some(s.parts.iter().map(part).collect())).collect()
    }

    const ALL: &str = r#"{"type":"FeatureCollection","crs":{"a":[1]},"bbox":[0,0,9,9],"features":[
        {"type":"Feature","properties":{"zeta":1,"name":"p \u00e9","list":[1,{"x":null}]},"id":7,"geometry":{"type":"Point","coordinates":[1,2,30.5]}},
        {"type":"Feature","properties":null,"geometry":null},
        {"type":"Feature","properties":{},"geometry":{"type":"MultiPoint","coordinates":[[1,2],[3,4]]}},
        {"type":"Feature","properties":{},"geometry":{"type":"LineString","coordinates":[[1,2,10],[3,4,20]]}},
        {"type":"Feature","properties":{},"geometry":{"type":"MultiLineString","coordinates":[[[1,2],[3,4]],[],[[5,6],[7,8],[9,9]]]}},
        {"type":"Feature","properties":{},"geometry":{"type":"Polygon","coordinates":[[[0,0],[4,0],[4,4],[0,0]],[[1,1],[2,2],[2,1],[1,1]]]}},
        {"type":"Feature","properties":{},"geometry":{"type":"MultiPolygon","coordinates":[[[[0,0],[4,0],[4,4],[0,0]]],[[[5,5],[6,5],[6,6],[5,5]]]]}},
        {"type":"Feature","properties":{},"geometry":{"type":"GeometryCollection","geometries":[{"type":"Point","coordinates":[5,6]},{"type":"Point","coordinates":[]}]}}
    ]}"#;

    #[test]
    fn every_geometry_moves_and_the_rest_stays() {
        let document = GeoJson::parse(ALL, "a.geojson").unwrap();
        let shapes = document.shapes();
        assert_eq!(shapes.len(), 8);
        assert_eq!((shapes[0].name.as_str(), shapes[4].parts.len(), shapes[4].parts[0].closed), ("feature 0", 2, true));
        let mut there = document.clone();
        there.replace(&moved(&shapes, DVec2::new(10.0, 0.5), false));
        assert_ne!(there, document);
        assert_eq!(there.root["features"][0]["geometry"]["coordinates"], json!([11.0, 2.5, 30.5]));
        assert_eq!(there.root["features"][0]["properties"], document.root["features"][0]["properties"]);
        assert_eq!(there.root["features"][4]["geometry"]["coordinates"][1], json!([]));
        assert!(there.root.get("bbox").is_none() && there.root.get("crs").is_some());
        let mut back = there.clone();
        back.replace(&moved(&there.shapes(), DVec2::new(-10.0, -0.5), false));
        assert_eq!(back.shapes(), shapes);
        // New vertices have heights between the others', and rings stay closed.
        there.replace(&moved(&there.shapes(), DVec2::ZERO, true));
        assert_eq!(
            there.root["features"][3]["geometry"]["coordinates"],
            json!([[11.0, 2.5, 10], [12.0, 3.5, 15.0], [13.0, 4.5, 20]])
        );
        let ring = there.root["features"][5]["geometry"]["coordinates"][0].as_array().unwrap();
        assert_eq!((ring.len(), &ring[0]), (7, &ring[6]));
        // Without an image a feature loses its geometry, a collection the member.
        let mut none = document.clone();
        none.replace(&vec![None; 8]);
        assert_eq!(none.root["features"][0]["geometry"], Value::Null);
        assert_eq!(none.root["features"][7]["geometry"]["geometries"], json!([]));
    }

    #[test]
    fn order_and_digits_of_properties_stay() {
        let text = r#"{"type":"Feature","properties":{"b":0.30000000000000004,"a":1e-7,"c":12345678901234567890},"geometry":null}"#;
        let document = GeoJson::parse(text, "x").unwrap();
        assert_eq!(document.root.to_string(), text);
    }

    #[test]
    fn mistakes_name_the_feature() {
        for (text, expected) in [
            ("", "not JSON"),
            ("[]", "no GeoJSON object"),
            ("{}", "no type"),
            (r#"{"type":"Pointy","coordinates":[]}"#, "Pointy"),
            (r#"{"type":"Point"}"#, "no coordinates"),
            (r#"{"type":"Point","coordinates":[1]}"#, "[1]"),
            (r#"{"type":"Polygon","coordinates":[3]}"#, "no list of positions"),
            (r#"{"type":"Point","coordinates":[1,null]}"#, "null"),
            (r#"{"type":"Point","coordinates":7}"#, "7"),
            (r#"{"type":"LineString","coordinates":[[1,2],"x"]}"#, "x"),
            (r#"{"type":"Polygon","coordinates":[[1,2],[3,4]]}"#, "1 is no position"),
            (
                r#"{"type":"FeatureCollection","features":[{"type":"Feature","geometry":null},{"type":"Feature","geometry":{"type":"Point","coordinates":["a","b"]}}]}"#,
                "feature 1",
            ),
            (r#"{"type":"FeatureCollection"}"#, "features"),
        ] {
            let message = GeoJson::parse(text, "a.geojson").unwrap_err().to_string();
            assert!(message.contains(expected) && message.contains("a.geojson"), "{text}: {message}");
        }
        let deep = r#"{"type":"GeometryCollection","geometries":["#.repeat(300);
        assert!(GeoJson::parse(&deep, "a").is_err());
    }

    proptest! {
        #[test]
        fn broken_documents_are_refused(cut in 0..ALL.len(), with in "[\\[\\]{}\",:0-9a]{0,3}") {
            let cut = (0..=cut).rev().find(|&i| ALL.is_char_boundary(i)).unwrap_or(0);
            let text = format!("{}{with}{}", &ALL[..cut], &ALL[cut + ALL[cut..].chars().next().map_or(0, char::len_utf8)..]);
            if let Ok(mut document) = GeoJson::parse(&text, "x") {
                let images = moved(&document.shapes(), DVec2::X, true);
                document.replace(&images);
            }
        }
    }
}
