//! Handles: vertices and where they go; and lists of vertices.
//!
//! Handles are JSON `{"handles": [{"vertex": i, "position": [x, y, z]}, ...]}`. In place of
//! `"vertex"` a handle may have `"at": [x, y, z]`, the place that is moved, or `"face": f` and
//! `"barycentric": [b0, b1, b2]`. A region is text, one vertex index a line; `#` begins a comment;
//! or a JSON list of places as anchors have them.

use std::path::Path;

use glam::DVec3;
use serde_json::Value;

use super::anchors::{AnchorSpec, parse_entry, read_places};
use super::source;
use crate::geometry::off_mesh::{ELSEWHERE, FARTHEST, lies_off};
use crate::geometry::{Mesh, SurfacePoint};
use crate::{Error, Result};

/// A vertex, and the way to it from the place that is meant; or what is wrong with that.
type Place = std::result::Result<(u32, DVec3), String>;

/// Reads handles as pairs of a 0-based vertex and its new position.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] naming the handle: not JSON, no list `handles`, a vertex that
/// is no index, a position that is not three finite numbers. Indices are not checked against a mesh
/// here.
#[doc(hidden)]
pub fn read_handles(path: impl AsRef<Path>) -> Result<Vec<(u32, DVec3)>> {
    let vertex = |entry: &Value| -> Place {
        let vertex = entry.get("vertex").and_then(Value::as_u64).and_then(|v| u32::try_from(v).ok());
        Ok((vertex.ok_or("\"vertex\" is not a vertex index")?, DVec3::ZERO))
    };
    read(path.as_ref(), &vertex)
}

/// As [`read_handles`], also for places of `mesh`: a position, or a face with barycentric
/// coordinates. The nearest vertex is the handle, and goes to where the place lies as seen from it.
/// O(handles x vertices).
///
/// # Errors
/// As [`read_handles`]; [`Error::Format`] for a place that is not on the mesh.
pub fn read_handles_on(path: impl AsRef<Path>, mesh: &Mesh) -> Result<Vec<(u32, DVec3)>> {
    let place = |entry: &Value| -> Place {
        let at = entry.get("at").map(|at| serde_json::json!({"position": at}));
        let spec = match (&at, entry.get("face")) {
            (Some(at), _) => parse_entry(at)?,
            (None, Some(_)) => {
                parse_entry(&serde_json::json!({"face": entry["face"], "barycentric": entry["barycentric"]}))?
            }
            _ => parse_entry(&serde_json::json!({"vertex": entry["vertex"]}))?,
        };
        vertex_at(&spec, mesh)
    };
    read(path.as_ref(), &place)
}

/// The vertex of `mesh` nearest to a place, and the way from the place to it: of a triangle the
/// corner of the largest coordinate. An index is what it is.
pub(crate) fn vertex_at(spec: &AnchorSpec, mesh: &Mesh) -> Place {
    let position = match *spec {
        AnchorSpec::Vertex(vertex) => return Ok((vertex, DVec3::ZERO)),
        AnchorSpec::Face { face, barycentric } => {
            if face as usize >= mesh.file_triangle_count() {
                return Err(format!("there is no face {face}, there are {}", mesh.file_triangle_count()));
            }
            let point = mesh.point_from_file(SurfacePoint::new(face, barycentric));
            let vertex = mesh.triangle(point.face as usize)[point.dominant_corner()];
            return Ok((vertex, mesh.positions[vertex as usize] - point.position(mesh)));
        }
        AnchorSpec::Position(position) => position,
    };
    let used = (0..mesh.triangle_count()).flat_map(|t| mesh.triangle(t));
    let distance = |v: u32| mesh.positions[v as usize].distance_squared(position);
    // Of several the first; vertices without a place are at no distance.
    let nearest = used.min_by(|&a, &b| distance(a).total_cmp(&distance(b)).then(a.cmp(&b)));
    let Some(vertex) = nearest else { return Err("the mesh has no faces".to_owned()) };
    let diagonal = mesh.bounds().map_or(0.0, |(low, high)| low.distance(high));
    let away = distance(vertex).sqrt();
    if !(away <= FARTHEST * diagonal) {
        return Err(format!("the position {} {}", super::place(position), lies_off(away, diagonal)));
    }
    Ok((vertex, mesh.positions[vertex as usize] - position))
}

/// Reads handles whose vertex `place` finds, with the way from the place that is meant to it.
fn read(path: &Path, place: &dyn Fn(&Value) -> Place) -> Result<Vec<(u32, DVec3)>> {
    let text = source::read_text(path)?;
    let remedy = "Write {\"handles\": [{\"vertex\": 0, \"position\": [0.0, 0.0, 0.0]}, ...]}";
    let value: Value = serde_json::from_str(&text)
        .map_err(|e| Error::format(path, Some(e.line()), format!("this is not valid JSON: {e}"), remedy))?;
    let Some(list) = value.get("handles").and_then(Value::as_array) else {
        return Err(Error::format(path, None, "there is no list \"handles\"", remedy));
    };
    let handle = |(k, entry): (usize, &Value)| {
        let wrong = |what: &str| Error::format(path, None, format!("handle {k}: {what}"), remedy);
        let (vertex, way) = place(entry).map_err(|what| wrong(&what))?;
        let position = entry.get("position").and_then(Value::as_array).filter(|p| p.len() == 3);
        let number = |x: &Value| x.as_f64().filter(|x| x.is_finite());
        let xyz = position.and_then(|p| Some([number(&p[0])?, number(&p[1])?, number(&p[2])?]));
        Ok((vertex, way + DVec3::from(xyz.ok_or_else(|| wrong("\"position\" is not three finite numbers"))?)))
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
#[doc(hidden)]
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

/// As [`read_vertex_list`], or a JSON list of places as anchors have them (`{"position": [x, y,
/// z]}`, `{"face": f, "barycentric": [..]}`, indices), each of which stands for the nearest vertex.
///
/// # Errors
/// As [`read_vertex_list`]; [`Error::Format`] for a place that is not on the mesh.
pub fn read_vertices_on(path: impl AsRef<Path>, mesh: &Mesh) -> Result<Vec<u32>> {
    let path = path.as_ref();
    if !source::read_text(path)?.trim_start().starts_with(['{', '[']) {
        return read_vertex_list(path);
    }
    let vertex = |(k, spec): (usize, &AnchorSpec)| {
        let found =
            vertex_at(spec, mesh).map_err(|what| Error::format(path, None, format!("place {k}: {what}"), ELSEWHERE));
        found.map(|(vertex, _)| vertex)
    };
    read_places(path)?.anchors.iter().enumerate().map(vertex).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn handles_and_regions_are_places_too() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("h.json");
        let mesh = Mesh::of_triangles("m", vec![DVec3::ZERO, DVec3::X, DVec3::Y], &[[0, 1, 2]]);
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            read_handles_on(&path, &mesh).map_err(|e| e.to_string())
        };
        let handles = r#"{"handles": [{"vertex": 2, "position": [0, 0, 1]}, {"at": [0.9, 0, 0], "position": [0.9, 0, 5]},
            {"face": 0, "barycentric": [0.25, 0, 0.75], "position": [0, 0, 1]}]}"#;
        // What is meant goes where it is told: the vertex beside it goes as far beside that.
        let expected = [(2, DVec3::Z), (1, DVec3::new(1.0, 0.0, 5.0)), (2, DVec3::new(0.0, 0.25, 1.0))];
        for ((vertex, at), (v, to)) in read(handles).unwrap().into_iter().zip(expected) {
            assert!(vertex == v && at.distance(to) < 1e-12, "{vertex} {at}");
        }
        for (handle, part) in [
            (r#""at": [0, 1]"#, "position"),
            (r#""at": [1e6, 0, 0]"#, "diagonal"),
            (r#""face": 1, "barycentric": [1, 0, 0]"#, "no face 1"),
            (r#""face": 0, "barycentric": [1, 1, 0]"#, "sum"),
            (r#""x": 0"#, "vertex"),
        ] {
            let message = read(&format!(r#"{{"handles": [{{{handle}, "position": [0, 0, 0]}}]}}"#)).unwrap_err();
            assert!(message.contains("handle 0") && message.contains(part), "{handle}: {message}");
        }
        std::fs::write(&path, r#"[2, {"position": [0.1, 0, 0]}, {"face": 0, "barycentric": [0, 1, 0]}]"#).unwrap();
        assert_eq!(read_vertices_on(&path, &mesh).unwrap(), [2, 0, 1]);
        std::fs::write(&path, "2 # a comment\n0\n").unwrap();
        assert_eq!(read_vertices_on(&path, &mesh).unwrap(), [2, 0]);
    }

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
