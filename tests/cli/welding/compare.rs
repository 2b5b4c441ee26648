//! What two forms gave, compared: equal to the last bit, vertex by vertex of the surface.

use barymap::io::read_mesh;
use serde_json::Value;

use super::forms::Form;
use crate::support::Folder;

/// A table: numbers and words by row.
pub(super) type Rows = Vec<Vec<String>>;

/// What of a report depends on the numbers of the file or on the machine, and not on the surface.
const PASSED_OVER: &[&str] = &[
    // Numbers of vertices, and counts of rows.
    "anchors",
    "proposals",
    "points",
    "vertices",
    "valid",
    "doubtful",
    "failed",
    "residual",
    "seconds",
    "cpu_seconds",
    "nanoseconds_per_texel",
    "seconds_per_frame",
    "frames_per_second",
    "version",
    "backend",
    "stages_on",
    "bytes",
];

/// How the file `name` of a form differs from what the welded form gave, if it does.
pub(super) fn unlike(form: &Form, name: &str, made: &Folder, truth: &Folder) -> Option<String> {
    let by_vertex = |rows: &dyn Fn(&Folder) -> Rows| unlike_rows(&form.welded, &rows(made), &rows(truth));
    let whole = |same: bool| (!same).then(|| "another content".to_owned());
    match name {
        "e.npy" => by_vertex(&|f| array(f, name)),
        "m.csv" | "a.csv" | "i.csv" | "r.csv" | "d.csv" => by_vertex(&|f| table(&f.read(name))),
        "c.ply" | "p.obj" | "half.ply" | "caged.obj" => by_vertex(&|f| positions(f, name)),
        _ if name.starts_with("given/") => by_vertex(&|f| positions(f, name)),
        "unwrapped.obj" | "decal.obj" => {
            let (a, b) = (texcoords(made, name), texcoords(truth, name));
            unlike_rows(&(0..b.len() as u32).collect::<Vec<_>>(), &a, &b)
        }
        _ if name.ends_with(".png") => whole(made.image(name) == truth.image(name)),
        "report.json" => unlike_json(name, &made.json(name), &truth.json(name), &form.welded, false),
        _ if name.ends_with(".json") => unlike_json(name, &made.json(name), &truth.json(name), &form.welded, true),
        _ => whole(made.bytes(name) == truth.bytes(name)),
    }
}

/// The first row that is not that of the same vertex of the welded form, and the largest
/// difference of numbers.
pub(super) fn unlike_rows(welded: &[u32], rows: &Rows, truth: &Rows) -> Option<String> {
    if rows.len() != welded.len() {
        return Some(format!("{} rows for {} vertices", rows.len(), welded.len()));
    }
    let differ = |v: &usize| truth.get(welded[*v] as usize) != Some(&rows[*v]);
    let first = (0..rows.len()).find(differ)?;
    let apart = |a: &String, b: &String| match (a.parse::<f64>(), b.parse::<f64>()) {
        (Ok(a), Ok(b)) => (a - b).abs(),
        _ => 0.0,
    };
    let most = (0..rows.len())
        .filter_map(|v| Some(rows[v].iter().zip(truth.get(welded[v] as usize)?).map(|(a, b)| apart(a, b))))
        .flatten()
        .fold(0.0, f64::max);
    let count = (0..rows.len()).filter(differ).count();
    Some(format!(
        "{count} of {} rows, numbers by up to {most:e}; row {first}: {:?}, welded {:?}",
        rows.len(),
        rows[first],
        truth.get(welded[first] as usize)
    ))
}

/// Every cell of a table without its header and the number of the row.
fn table(text: &str) -> Rows {
    text.lines().skip(1).map(|line| line.split(',').skip(1).map(str::to_owned).collect()).collect()
}

fn array(f: &Folder, name: &str) -> Rows {
    let matrix = barymap::io::npy::read_npy(f.path(name)).unwrap();
    matrix.values.chunks_exact(matrix.columns).map(|row| row.iter().map(|x| format!("{x:?}")).collect()).collect()
}

fn positions(f: &Folder, name: &str) -> Rows {
    let mesh = read_mesh(f.path(name)).unwrap().mesh;
    mesh.positions.iter().map(|p| p.to_array().map(|x| format!("{x:?}")).to_vec()).collect()
}

/// The texture coordinates of each triangle.
fn texcoords(f: &Folder, name: &str) -> Rows {
    let mesh = read_mesh(f.path(name)).unwrap().mesh;
    (0..mesh.triangle_count())
        .map(|t| match mesh.triangle_texcoords(t) {
            Some(uv) => uv.iter().flat_map(|uv| [uv.x, uv.y]).map(|x| format!("{x:?}")).collect(),
            None => Vec::new(),
        })
        .collect()
}

/// The first difference of two reports, or of two lists of anchors, where numbers alone are
/// vertices.
pub(super) fn unlike_json(at: &str, a: &Value, b: &Value, welded: &[u32], anchors: bool) -> Option<String> {
    match (a, b) {
        (Value::Object(x), Value::Object(y)) if x.len() == y.len() => {
            x.iter().filter(|(key, _)| anchors || !PASSED_OVER.contains(&key.as_str())).find_map(|(key, x)| {
                let numbers = key == "vertex" || anchors && ["source", "target", "anchors"].contains(&key.as_str());
                unlike_json(&format!("{at}.{key}"), x, &y[key], welded, numbers)
            })
        }
        (Value::Array(x), Value::Array(y)) if x.len() == y.len() => x
            .iter()
            .zip(y)
            .enumerate()
            .find_map(|(i, (x, y))| unlike_json(&format!("{at}[{i}]"), x, y, welded, anchors)),
        (Value::Number(x), Value::Number(y)) if anchors => {
            let same = x.as_u64().and_then(|v| welded.get(v as usize)).map(|w| u64::from(*w)) == y.as_u64();
            (!same).then(|| format!("{at}: vertex {x}, welded {y}"))
        }
        _ => (a != b).then(|| format!("{at}: {a}, welded {b}")),
    }
}
