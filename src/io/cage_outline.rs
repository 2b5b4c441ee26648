//! Cages that were drawn: the outlines `source` and `target` of an SVG or GeoJSON document.

use std::path::Path;

use glam::DVec2;
use serde_json::Value;

use super::outline::{Part, Segment, Shape};
use super::svg::Svg;
use crate::{Error, Result};

/// Points on a curve: its end, and as many less one in between.
const POINTS_OF_A_CURVE: usize = 8;
const REMEDY: &str =
    "Name one outline source and the other target (id in SVG, the property role or name in GeoJSON), or give two alone";

/// The loops of both polygons.
type Both = [Vec<Vec<DVec2>>; 2];

/// The polygons of an SVG document: the outlines whose `id` holds "source" and "target", or the
/// first and the second of two. Curves become eight lines each.
pub(super) fn of_svg(text: &str, name: &Path) -> Result<Both> {
    let shapes = Svg::parse(text.to_owned(), name)?.shapes();
    let loops = |shape: &Shape| shape.parts.iter().map(corners).collect();
    let named = shapes.iter().map(|shape| (shape.name.clone(), loops(shape))).collect();
    chosen(named, name)
}

/// The polygons of a GeoJSON document, told by `role`, `name` or `id` of its features.
pub(super) fn of_geojson(root: &Value, name: &Path) -> Result<Both> {
    let alone = std::slice::from_ref(root);
    let features = root.get("features").and_then(Value::as_array).map_or(alone, Vec::as_slice);
    let mut named = Vec::new();
    for feature in features {
        let geometry = feature.get("geometry").unwrap_or(feature);
        let label = ["role", "name"].iter().find_map(|key| feature.get("properties")?.get(key)?.as_str());
        let label = label.or_else(|| feature.get("id")?.as_str()).unwrap_or_default().to_owned();
        let positions = &geometry["coordinates"];
        let rings: Vec<&Value> = match geometry["type"].as_str() {
            Some("Polygon") => positions.as_array().into_iter().flatten().collect(),
            Some("MultiPolygon") => {
                positions.as_array().into_iter().flatten().filter_map(Value::as_array).flatten().collect()
            }
            Some("LineString") => vec![positions],
            _ => continue,
        };
        let wrong = || Error::format(name, None, format!("{label:?} has a position that is not two numbers"), REMEDY);
        let point = |p: &Value| Some(DVec2::new(p.get(0)?.as_f64()?, p.get(1)?.as_f64()?));
        let ring = |ring: &&Value| -> Option<Vec<DVec2>> {
            Some(open(ring.as_array()?.iter().map(point).collect::<Option<Vec<_>>>()?))
        };
        named.push((label.clone(), rings.iter().map(ring).collect::<Option<Vec<_>>>().ok_or_else(wrong)?));
    }
    chosen(named, name)
}

/// Source and target among outlines with names.
fn chosen(named: Vec<(String, Vec<Vec<DVec2>>)>, name: &Path) -> Result<Both> {
    let of = |word: &str| -> Vec<Vec<DVec2>> {
        let own = named.iter().filter(|(label, _)| label.to_ascii_lowercase().contains(word));
        own.flat_map(|(_, loops)| loops.clone()).collect()
    };
    let (source, target) = (of("source"), of("target"));
    if !source.is_empty() && !target.is_empty() {
        return Ok([source, target]);
    }
    match <[_; 2]>::try_from(named) {
        Ok([(_, source), (_, target)]) => Ok([source, target]),
        Err(named) => {
            let what = format!("{} outlines, of which none are the source and the target", named.len());
            Err(Error::format(name, None, what, REMEDY))
        }
    }
}

/// The corners of an outline.
fn corners(part: &Part) -> Vec<DVec2> {
    let mut corners = vec![part.start];
    let mut at = part.start;
    for segment in &part.segments {
        let count = if matches!(segment, Segment::Line(_)) { 1 } else { POINTS_OF_A_CURVE };
        corners.extend((1..=count).map(|k| segment.at(at, k as f64 / count as f64)));
        at = segment.end();
    }
    open(corners)
}

/// A loop without the repetition of its first point at the end.
fn open(mut corners: Vec<DVec2>) -> Vec<DVec2> {
    while corners.len() > 1 && corners.last() == corners.first() {
        corners.pop();
    }
    corners
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::cage::parse_cage;

    #[test]
    fn drawn_cages_are_those_of_json() {
        let json = parse_cage(
            r#"{"source": [[0, 0], [8, 0], [8, 8], [0, 8]], "target": [[0, 0], [8, 0], [6, 7], [0, 8]]}"#,
            "a.json",
        );
        let json = json.unwrap();
        let svg = |a: &str, b: &str| {
            format!(
                r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 8 8"><polygon {b} points="0,0 8,0 6,7 0,8"/><path {a} d="M0 0H8V8H0Z"/></svg>"#
            )
        };
        let named = parse_cage(&svg(r#"id="the-source""#, r#"id="Target""#), "a.svg").unwrap();
        assert_eq!((&named.source, &named.target), (&json.source, &json.target));
        // Without names they come in their order.
        let turned = parse_cage(&svg("", ""), "a.svg").unwrap();
        assert_eq!((&turned.source, &turned.target), (&json.target, &json.source));
        let feature = |role: &str, ring: &str| {
            format!(
                r#"{{"type": "Feature", "properties": {{"role": "{role}"}}, "geometry": {{"type": "Polygon", "coordinates": [{ring}]}}}}"#
            )
        };
        let document =
            |features: &[String]| format!(r#"{{"type": "FeatureCollection", "features": [{}]}}"#, features.join(","));
        let target = feature("target", "[[0,0],[8,0],[6,7],[0,8],[0,0]]");
        let source = feature("source", "[[0,0],[8,0],[8,8],[0,8],[0,0]]");
        let read = parse_cage(&document(&[target.clone(), source]), "a.geojson").unwrap();
        assert_eq!((read.source, read.target), (json.source, json.target));
        for wrong in [document(std::slice::from_ref(&target)), document(&[target.clone(), target.clone(), target])] {
            let message = parse_cage(&wrong, "a.geojson").unwrap_err().to_string();
            assert!(message.contains("outlines") && message.contains("role"), "{message}");
        }
        let curve = r#"<svg xmlns="http://www.w3.org/2000/svg"><circle id="source" cx="4" cy="4" r="3"/><circle id="target" cx="4" cy="4" r="2"/></svg>"#;
        let round = parse_cage(curve, "c.svg").unwrap();
        assert!(round.source[0].len() >= 8 && round.source[0].len() == round.target[0].len());
        assert!(round.source[0].iter().all(|p| (p.distance(DVec2::splat(4.0)) - 3.0).abs() < 1e-6));
    }
}
