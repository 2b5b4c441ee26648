//! Anchors: pairs of points that correspond, or points of one mesh.
//!
//! Forms of pairs: JSON `{"source": [...], "target": [...]}`; text lines `iS iT`; or two files
//! `S.vts,T.vts` paired by line, whose first column is the vertex. Forms for one mesh: JSON
//! `{"anchors": [...]}`; text with a vertex index first on every line. An entry of a JSON list is a
//! vertex index, `{"face": f, "barycentric": [b0, b1, b2]}` or `{"position": [x, y, z]}`.

use std::path::{Path, PathBuf};

use glam::DVec3;
use serde_json::Value;

use super::source;
use crate::geometry::off_mesh::{ELSEWHERE, FARTHEST, lies_off};
use crate::geometry::{Mesh, SurfacePoint, Topology};
use crate::{Error, Result};

/// An anchor as a file names it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AnchorSpec {
    /// A vertex, 0-based.
    Vertex(u32),
    /// A point of a triangle, with coordinates that are nonnegative and sum to one.
    Face {
        /// The 0-based triangle.
        face: u32,
        /// Barycentric coordinates with respect to its corners.
        barycentric: [f64; 3],
    },
    /// A point in space, to be moved to the closest point of the surface.
    Position(DVec3),
}

/// Anchors of one mesh, with the file they came from.
#[derive(Clone, Debug, PartialEq)]
pub struct AnchorList {
    /// The file, named in messages.
    pub path: PathBuf,
    /// The anchors in file order.
    pub anchors: Vec<AnchorSpec>,
}

/// Pairs of anchors: `source.anchors[k]` corresponds to `target.anchors[k]`.
#[derive(Clone, Debug, PartialEq)]
pub struct AnchorPairs {
    /// On the source mesh.
    pub source: AnchorList,
    /// On the target mesh, as many.
    pub target: AnchorList,
}

/// An anchor found on its mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
#[doc(hidden)]
pub struct ResolvedAnchor {
    /// The point.
    pub point: SurfacePoint,
    /// How far an anchor given by position was moved to the surface; 0 for the others.
    pub snap_distance: f64,
}

/// What a file says of a pair beside its points; readers pass over it.
#[derive(Clone, Debug, PartialEq)]
pub struct PairRemark {
    /// Where the pair comes from, in a word.
    pub origin: &'static str,
    /// The error expected, over the square root of the source's area.
    pub expected_error: f64,
    /// Why the pair is doubtful; `None` where nothing speaks against it.
    pub flagged: Option<String>,
}

/// Writes pairs as JSON, whole or not at all: `"source"` and `"target"` as [`read_pairs`] takes
/// them (vertices by index), and a list `"pairs"` with a remark on each, where there are remarks.
///
/// # Errors
/// [`Error::Io`]; [`Error::Input`] if the numbers of points or remarks differ, or a point is not on
/// its mesh.
pub fn write_pairs(
    path: impl AsRef<Path>,
    source: (&Mesh, &[SurfacePoint]),
    target: (&Mesh, &[SurfacePoint]),
    remarks: &[PairRemark],
) -> Result<()> {
    let (count, others) = (target.1.len(), source.1.len());
    if others != count || !(remarks.is_empty() || remarks.len() == count) {
        let what = format!("there are {others} points of the source, {count} of the target, {} remarks", remarks.len());
        return Err(Error::input(what, "Give as many points on both, and one remark for each pair or none"));
    }
    for (name, (mesh, points)) in [("source", source), ("target", target)] {
        if let Some(k) = points.iter().position(|p| p.face as usize >= mesh.triangle_count()) {
            let what = format!("{name}, point {k}: {} has no face {}", mesh.name, points[k].face);
            return Err(Error::input(what, "Give points of this mesh"));
        }
    }
    let points = |(mesh, points): (&Mesh, &[SurfacePoint])| -> Value {
        let entry = |p: &SurfacePoint| match p.barycentric.iter().position(|b| *b == 1.0) {
            Some(k) => Value::from(mesh.triangle(p.face as usize)[k]),
            None => {
                let p = mesh.point_in_file(*p);
                serde_json::json!({"face": p.face, "barycentric": p.barycentric})
            }
        };
        points.iter().map(entry).collect()
    };
    let remark = |r: &PairRemark| {
        let mut value = serde_json::json!({"origin": r.origin, "expected_error": r.expected_error});
        if let Some(why) = &r.flagged {
            value["flagged"] = Value::from(why.as_str());
        }
        value
    };
    let mut value = serde_json::json!({"source": points(source), "target": points(target)});
    if !remarks.is_empty() {
        value["pairs"] = remarks.iter().map(remark).collect();
    }
    super::report::write_report(path, &value)
}

/// Reads pairs of anchors from a file, or from two files `S,T`.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] naming line or anchor: unequal counts, an entry of no known
/// form, a number that is not finite, barycentric coordinates that are negative or do not sum to
/// one within 1e-6.
pub fn read_pairs(path_or_pair: &str) -> Result<AnchorPairs> {
    let whole = Path::new(path_or_pair);
    let Some((source, target)) = path_or_pair.split_once(',').filter(|_| !whole.is_file()) else {
        return read_pair_file(whole);
    };
    let pairs = AnchorPairs { source: read_single(source.trim())?, target: read_single(target.trim())? };
    equal_counts(pairs, whole)
}

fn equal_counts(pairs: AnchorPairs, path: &Path) -> Result<AnchorPairs> {
    let (s, t) = (pairs.source.anchors.len(), pairs.target.anchors.len());
    if s != t {
        let what = format!("{s} anchors on the source and {t} on the target");
        return Err(Error::format(path, None, what, "Give as many of one as of the other, in the same order"));
    }
    Ok(pairs)
}

fn read_pair_file(path: &Path) -> Result<AnchorPairs> {
    let text = source::read_text(path)?;
    let list = |anchors| AnchorList { path: path.to_path_buf(), anchors };
    if text.trim_start().starts_with(['{', '[']) {
        let value = parse_json(&text, path)?;
        if value.get("source").is_none() && value.get("anchors").is_some() {
            let what = "these are anchors of one mesh, pairs are needed";
            return Err(Error::format(path, None, what, "Write {\"source\": [...], \"target\": [...]}"));
        }
        let pairs = AnchorPairs {
            source: list(entries(&value, "source", path)?),
            target: list(entries(&value, "target", path)?),
        };
        return equal_counts(pairs, path);
    }
    let (mut source, mut target) = (Vec::new(), Vec::new());
    for (line, words) in data_lines(&text) {
        let [s, t] = words[..] else {
            let what = format!("{} words where a pair \"source target\" of vertex indices is expected", words.len());
            let remedy = "Write two indices a line, or name two files as S.vts,T.vts";
            return Err(Error::format(path, Some(line), what, remedy));
        };
        source.push(vertex(s, path, line)?);
        target.push(vertex(t, path, line)?);
    }
    Ok(AnchorPairs { source: list(source), target: list(target) })
}

/// Reads the anchors of one mesh.
///
/// # Errors
/// As [`read_pairs`].
pub fn read_single(path: impl AsRef<Path>) -> Result<AnchorList> {
    let path = path.as_ref();
    let text = source::read_text(path)?;
    let mut anchors = Vec::new();
    if text.trim_start().starts_with(['{', '[']) {
        let value = parse_json(&text, path)?;
        if value.get("anchors").is_none() && value.get("source").is_some() {
            let what = "these are pairs of anchors, those of one mesh are needed";
            return Err(Error::format(path, None, what, "Write {\"anchors\": [...]}"));
        }
        anchors = entries(&value, "anchors", path)?;
    } else {
        for (line, words) in data_lines(&text) {
            anchors.push(vertex(words[0], path, line)?);
        }
    }
    Ok(AnchorList { path: path.to_path_buf(), anchors })
}

/// Reads points of one mesh that are no anchors, such as the control points of a curve: a JSON list
/// of entries, `{"points": [...]}`, and all that [`read_single`] takes.
///
/// # Errors
/// As [`read_single`].
pub fn read_places(path: impl AsRef<Path>) -> Result<AnchorList> {
    let path = path.as_ref();
    let text = source::read_text(path)?;
    if text.trim_start().starts_with(['{', '[']) {
        let mut value = parse_json(&text, path)?;
        if value.is_array() {
            value = serde_json::json!({ "points": value });
        }
        if value.get("points").is_some() {
            return Ok(AnchorList { path: path.to_path_buf(), anchors: entries(&value, "points", path)? });
        }
    }
    read_single(path)
}

/// Lines with something on them, without comments, as 1-based numbers and words.
fn data_lines(text: &str) -> impl Iterator<Item = (usize, Vec<&str>)> {
    let words = |line: &str| line.split('#').next().unwrap_or_default().len();
    text.lines()
        .enumerate()
        .map(move |(k, line)| {
            (k + 1, line[..words(line)].split([' ', '\t', ',', ';']).filter(|w| !w.trim().is_empty()))
        })
        .map(|(k, words)| (k, words.map(str::trim).take(16).collect::<Vec<_>>()))
        .filter(|(_, words)| !words.is_empty())
}

fn vertex(word: &str, path: &Path, line: usize) -> Result<AnchorSpec> {
    word.parse().map(AnchorSpec::Vertex).map_err(|_| {
        let what = format!("{:?} is not a vertex index", super::obj::shortened(word));
        Error::format(path, Some(line), what, "Vertex indices are whole numbers counted from 0")
    })
}

fn parse_json(text: &str, path: &Path) -> Result<Value> {
    serde_json::from_str(text)
        .map_err(|e| Error::format(path, Some(e.line()), format!("this is not valid JSON: {e}"), "Correct the file"))
}

fn entries(value: &Value, key: &str, path: &Path) -> Result<Vec<AnchorSpec>> {
    let Some(list) = value.get(key).and_then(Value::as_array) else {
        let what = format!("there is no list {key:?}");
        let remedy = "Write {\"source\": [...], \"target\": [...]}, or {\"anchors\": [...]} for one mesh";
        return Err(Error::format(path, None, what, remedy));
    };
    let parsed = list.iter().enumerate().map(|(k, entry)| {
        parse_entry(entry).map_err(|what| {
            let remedy = "An anchor is a vertex index, {\"face\": f, \"barycentric\": [b0, b1, b2]} or {\"position\": [x, y, z]}";
            Error::format(path, None, format!("{key} anchor {k}: {what}"), remedy)
        })
    });
    parsed.collect()
}

pub(super) fn parse_entry(entry: &Value) -> std::result::Result<AnchorSpec, String> {
    let index = |v: &Value| v.as_u64().and_then(|i| u32::try_from(i).ok());
    let triple = |key: &str| -> Option<[f64; 3]> {
        let list = entry.get(key)?.as_array()?;
        let [a, b, c] = list.as_slice() else { return None };
        Some([a.as_f64()?, b.as_f64()?, c.as_f64()?])
    };
    if entry.is_number() {
        return index(entry).map(AnchorSpec::Vertex).ok_or_else(|| format!("{entry} is not a vertex index"));
    }
    if entry.get("face").is_some() {
        let face = index(&entry["face"]).ok_or_else(|| format!("{} is not a face index", entry["face"]))?;
        let barycentric = triple("barycentric").ok_or("\"barycentric\" is not a list of three numbers")?;
        return Ok(AnchorSpec::Face { face, barycentric: normalised(barycentric)? });
    }
    if entry.get("position").is_some() {
        let position = DVec3::from(triple("position").ok_or("\"position\" is not a list of three numbers")?);
        return if position.is_finite() { Ok(AnchorSpec::Position(position)) } else { Err("not finite".into()) };
    }
    if entry.get("vertex").is_some() {
        return index(&entry["vertex"])
            .map(AnchorSpec::Vertex)
            .ok_or_else(|| format!("{} is not a vertex index", entry["vertex"]));
    }
    Err("it has no known form".into())
}

/// How far written coordinates may lie off the triangle or off the sum 1, for rounding in text.
const SLACK: f64 = 1e-6;

/// Coordinates clamped and scaled to sum to one, if they are within [`SLACK`] of it.
pub(crate) fn normalised(barycentric: [f64; 3]) -> std::result::Result<[f64; 3], String> {
    let sum: f64 = barycentric.iter().sum();
    if !sum.is_finite() || (sum - 1.0).abs() > SLACK {
        return Err(format!("the barycentric coordinates sum to {sum}, not to 1"));
    }
    if let Some(negative) = barycentric.iter().find(|b| **b < -SLACK) {
        return Err(format!("the barycentric coordinate {negative} is negative: the point lies outside its face"));
    }
    let clamped = barycentric.map(|b| b.max(0.0));
    let sum: f64 = clamped.iter().sum();
    Ok(clamped.map(|b| b / sum))
}

impl AnchorList {
    /// Finds the anchors on their mesh. `closest` gives the closest point of the usable surface and
    /// its distance.
    ///
    /// # Errors
    /// [`Error::Input`] naming the file and the anchor: an index out of range, a vertex that no
    /// usable triangle touches, a degenerate triangle, a position farther
    /// from the mesh than 100 times the diagonal of its box.
    pub fn resolve(
        &self,
        mesh: &Mesh,
        topology: &Topology,
        closest: &dyn Fn(DVec3) -> (SurfacePoint, f64),
    ) -> Result<Vec<ResolvedAnchor>> {
        let diagonal = mesh.bounds().map_or(0.0, |(low, high)| low.distance(high));
        let all = self.anchors.iter().enumerate();
        all.map(|(k, spec)| self.resolve_one(k, spec, mesh, topology, (closest, diagonal))).collect()
    }

    fn resolve_one(
        &self,
        k: usize,
        spec: &AnchorSpec,
        mesh: &Mesh,
        topology: &Topology,
        (closest, diagonal): (&dyn Fn(DVec3) -> (SurfacePoint, f64), f64),
    ) -> Result<ResolvedAnchor> {
        let fail = |what: String, remedy: &str| {
            Err(Error::input(format!("{}: anchor {k}: {what} (mesh {})", self.path.display(), mesh.name), remedy))
        };
        let swapped = "Check that the anchors belong to this mesh, that source and target are not swapped, and that indices count from 0";
        let elsewhere = "Choose another anchor nearby";
        let exact = |point| Ok(ResolvedAnchor { point, snap_distance: 0.0 });
        match *spec {
            AnchorSpec::Vertex(v) => {
                if v as usize >= mesh.vertex_count() {
                    return fail(format!("vertex {v} of {}", mesh.vertex_count()), swapped);
                }
                let representative = mesh.representative(v);
                let Some((&t, corner)) = topology
                    .vertex_triangles(representative)
                    .first()
                    .and_then(|t| Some((t, topology.corner_of(*t, representative)?)))
                else {
                    return fail(format!("vertex {v} belongs to no usable triangle"), elsewhere);
                };
                let mut barycentric = [0.0; 3];
                barycentric[corner] = 1.0;
                exact(SurfacePoint::new(t, barycentric))
            }
            AnchorSpec::Face { face, barycentric } => {
                if face as usize >= mesh.file_triangle_count() {
                    return fail(format!("face {face} of {}", mesh.file_triangle_count()), swapped);
                }
                let point = mesh.point_from_file(SurfacePoint::new(face, barycentric));
                if !topology.usable[point.face as usize] {
                    return fail(format!("face {face} is degenerate"), elsewhere);
                }
                exact(point)
            }
            AnchorSpec::Position(p) => {
                let (point, snap_distance) = closest(p);
                if !(snap_distance <= FARTHEST * diagonal) {
                    return fail(
                        format!("the position {} {}", super::place(p), lies_off(snap_distance, diagonal)),
                        ELSEWHERE,
                    );
                }
                Ok(ResolvedAnchor { point, snap_distance })
            }
        }
    }
}

impl AnchorPairs {
    /// What is odd about resolved pairs but not an error: anchors that lie on the same point.
    ///
    /// O(n^2) in the number of anchors.
    pub fn warnings(&self, source: (&Mesh, &[ResolvedAnchor]), target: (&Mesh, &[ResolvedAnchor])) -> Vec<String> {
        let positions = |(mesh, anchors): (&Mesh, &[ResolvedAnchor])| -> Vec<DVec3> {
            anchors.iter().map(|a| a.point.position(mesh)).collect()
        };
        let (source, target) = (positions(source), positions(target));
        let mut warnings = Vec::new();
        for i in 0..source.len().min(target.len()) {
            for j in 0..i {
                let said = match (source[i] == source[j], target[i] == target[j]) {
                    (true, true) => "are the same pair: one of them has no effect",
                    (true, false) => {
                        "lie on one point of the source but on two of the target: they contradict each other"
                    }
                    (false, true) => {
                        "lie on one point of the target but on two of the source: they contradict each other"
                    }
                    (false, false) => continue,
                };
                warnings.push(format!("{}: anchors {j} and {i} {said}", self.source.path.display()));
            }
        }
        warnings
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(dir: &tempfile::TempDir, name: &str, text: &str) -> String {
        let path = dir.path().join(name);
        std::fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_owned()
    }

    #[test]
    fn what_is_written_is_read_back() {
        let dir = tempfile::tempdir().unwrap();
        let mesh = crate::models::shapes::tetrahedron();
        let points = [SurfacePoint::new(1, [0.0, 1.0, 0.0]), SurfacePoint::new(2, [0.25, 0.1 + 0.2, 0.45])];
        let flagged = PairRemark { origin: "relief", expected_error: 0.03, flagged: Some("far from all".into()) };
        let remarks = [PairRemark { origin: "given", expected_error: 0.0, flagged: None }, flagged];
        let path = dir.path().join("w.json");
        write_pairs(&path, (&mesh, &points), (&mesh, &points), &remarks).unwrap();
        let pairs = read_pairs(path.to_str().unwrap()).unwrap();
        assert_eq!(pairs.source.anchors, pairs.target.anchors);
        assert_eq!(pairs.source.anchors[0], AnchorSpec::Vertex(mesh.triangle(1)[1]));
        let AnchorSpec::Face { face: 2, barycentric } = pairs.source.anchors[1] else { panic!("{pairs:?}") };
        assert!(barycentric.iter().zip(points[1].barycentric).all(|(a, b)| (a - b).abs() < 1e-15));
        let text = std::fs::read_to_string(&path).unwrap();
        assert_eq!(text.matches("flagged").count(), 1);
    }

    #[test]
    fn all_forms_are_read() {
        let dir = tempfile::tempdir().unwrap();
        let json = r#"{"source": [5, {"vertex": 6}, {"face": 2, "barycentric": [0.5, 0.5000001, 0]}],
            "target": [1, {"position": [0, 1.5, -2]}, {"face": 0, "barycentric": [1, 0, -1e-9]}]}"#;
        let pairs = read_pairs(&file(&dir, "a.json", json)).unwrap();
        assert_eq!(pairs.source.anchors[..2], [AnchorSpec::Vertex(5), AnchorSpec::Vertex(6)]);
        let AnchorSpec::Face { face: 2, barycentric } = pairs.source.anchors[2] else { panic!("{pairs:?}") };
        assert!((barycentric.iter().sum::<f64>() - 1.0).abs() < 1e-15 && barycentric[0] < 0.5);
        assert_eq!(pairs.target.anchors[1], AnchorSpec::Position(DVec3::new(0.0, 1.5, -2.0)));
        assert_eq!(pairs.target.anchors[2], AnchorSpec::Face { face: 0, barycentric: [1.0, 0.0, 0.0] });

        let pairs = read_pairs(&file(&dir, "b.txt", "\u{feff}# made by hand\r\n1 2\r\n\n 3\t4 # nose\n")).unwrap();
        assert_eq!(pairs.source.anchors, [AnchorSpec::Vertex(1), AnchorSpec::Vertex(3)]);
        assert_eq!(pairs.target.anchors, [AnchorSpec::Vertex(2), AnchorSpec::Vertex(4)]);

        let (s, t) = (file(&dir, "s.vts", "  7 0.5 0.5 0.1\n 8 1 2 3\n"), file(&dir, "t.vts", "9\n10\n"));
        let pairs = read_pairs(&format!("{s},{t}")).unwrap();
        assert_eq!(pairs.source.anchors, [AnchorSpec::Vertex(7), AnchorSpec::Vertex(8)]);
        assert_eq!(pairs.target.anchors, [AnchorSpec::Vertex(9), AnchorSpec::Vertex(10)]);

        for text in [r#"{"anchors": [1, 2]}"#, r#"{"points": [1, 2]}"#, "[1, 2]", "1\n2\n"] {
            let path = file(&dir, "c.json", text);
            assert_eq!(read_places(&path).unwrap().anchors, [AnchorSpec::Vertex(1), AnchorSpec::Vertex(2)]);
            assert_eq!(read_single(&path).is_ok(), !text.contains("points") && !text.starts_with('['));
        }
    }

    #[test]
    fn faults_name_file_and_anchor() {
        let dir = tempfile::tempdir().unwrap();
        for (text, expected) in [
            (r#"{"source": [1, 2], "target": [1]}"#, "2 anchors on the source and 1 on the target"),
            (r#"{"source": [1, -2], "target": [1, 2]}"#, "source anchor 1: -2 is not a vertex index"),
            (r#"{"source": [1], "target": [1.5]}"#, "target anchor 0"),
            (r#"{"source": ["1"], "target": [1]}"#, "no known form"),
            (r#"{"source": [{"face": 0, "barycentric": [0.5, 0.6, 0.1]}], "target": [1]}"#, "sum to 1.2"),
            (r#"{"source": [{"face": 0, "barycentric": [1.5, -0.5, 0]}], "target": [1]}"#, "-0.5 is negative"),
            (r#"{"source": [{"face": 0, "barycentric": [1, 0]}], "target": [1]}"#, "three numbers"),
            (r#"{"source": [{"position": [0, null, 0]}], "target": [1]}"#, "three numbers"),
            (r#"{"source": [{"position": [0, 1e999, 0]}], "target": [1]}"#, "JSON"),
            (r#"{"source": [1]}"#, "no list \"target\""),
            (r#"{"anchors": [1]}"#, "pairs are needed"),
            ("[1, 2]", "no list"),
            ("{\n\"source\": [1,\n}", "line 3"),
            ("1 2\n3\n", "line 2: 1 words"),
            ("1 2\n3 x\n", "line 2: \"x\" is not a vertex index"),
            ("1 2\n3 -4\n", "\"-4\""),
        ] {
            let path = file(&dir, "bad", text);
            let message = read_pairs(&path).unwrap_err().to_string();
            assert!(message.contains(expected) && message.contains(&path), "{text}: {message:?} lacks {expected:?}");
        }
        let message = read_pairs("/no/a.vts,/no/b.vts").unwrap_err().to_string();
        assert!(message.contains("/no/a.vts:"), "{message}");
        let message = read_single(file(&dir, "p", r#"{"source": [1], "target": [1]}"#)).unwrap_err().to_string();
        assert!(message.contains("those of one mesh"), "{message}");
    }

    #[test]
    fn resolution_checks_ranges() {
        let positions = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, DVec3::X * 2.0];
        let mesh = Mesh::of_triangles("m", positions, &[[0, 1, 4], [0, 1, 2]]);
        let topology = Topology::new(&mesh);
        let closest = |p: DVec3| (SurfacePoint::new(1, [1.0, 0.0, 0.0]), p.length());
        let resolve = |anchor| {
            let list = AnchorList { path: "a.txt".into(), anchors: vec![anchor] };
            list.resolve(&mesh, &topology, &closest).map(|r| r[0])
        };
        let face = |face| AnchorSpec::Face { face, barycentric: [0.0, 1.0, 0.0] };
        assert_eq!(resolve(AnchorSpec::Vertex(1)).unwrap().point, SurfacePoint::new(1, [0.0, 1.0, 0.0]));
        assert_eq!(resolve(face(1)).unwrap().snap_distance, 0.0);
        assert_eq!(resolve(AnchorSpec::Position(DVec3::new(0.0, 0.0, 3.0))).unwrap().snap_distance, 3.0);
        let diagonal = 5f64.sqrt();
        let off = |sizes: f64| resolve(AnchorSpec::Position(DVec3::Z * sizes * diagonal));
        assert_eq!(off(99.0).unwrap().snap_distance, 99.0 * diagonal);
        for sizes in [101.0, 1e200] {
            let message = off(sizes).unwrap_err().to_string();
            assert!(
                message.contains("a.txt: anchor 0: the position (0.0, 0.0, ") && message.contains("lies"),
                "{message}"
            );
            assert!(sizes > 1e3 || message.contains("2.2584e2 off the mesh, 101 times its diagonal"), "{message}");
        }
        for (anchor, expected) in [
            (AnchorSpec::Vertex(5), "vertex 5 of 5"),
            (AnchorSpec::Vertex(3), "no usable triangle"),
            (AnchorSpec::Vertex(4), "no usable triangle"),
            (face(2), "face 2 of 2"),
            (face(0), "face 0 is degenerate"),
        ] {
            let message = resolve(anchor).unwrap_err().to_string();
            assert!(message.contains(expected) && message.contains("a.txt: anchor 0"), "{message}");
        }
    }

    #[test]
    fn coincident_anchors_are_told() {
        let mesh = Mesh::of_triangles("m", vec![DVec3::ZERO, DVec3::X, DVec3::Y], &[[0, 1, 2]]);
        let at = |k: usize| {
            let mut b = [0.0; 3];
            b[k] = 1.0;
            ResolvedAnchor { point: SurfacePoint::new(0, b), snap_distance: 0.0 }
        };
        let list = AnchorList { path: "a.txt".into(), anchors: Vec::new() };
        let pairs = AnchorPairs { source: list.clone(), target: list };
        let said = pairs.warnings((&mesh, &[at(0), at(1), at(0), at(0)]), (&mesh, &[at(0), at(1), at(2), at(0)]));
        assert_eq!(said.len(), 3);
        assert!(said[0].contains("anchors 0 and 2") && said[0].contains("contradict"), "{said:?}");
        assert!(said[1].contains("anchors 0 and 3") && said[1].contains("same pair"), "{said:?}");
        let none = pairs.warnings((&mesh, &[at(0), at(1)]), (&mesh, &[at(1), at(0)]));
        assert!(none.is_empty());
    }
}
