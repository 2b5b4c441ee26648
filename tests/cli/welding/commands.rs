//! All commands run on a form of a mesh, with inputs that say the same of every form.

use std::collections::HashSet;
use std::fmt::Write;

use barymap::geometry::{Corner, Mesh, MeshBuilder, NONE};
use barymap::io::{write_image, write_obj};
use glam::{DQuat, DVec3};
use serde_json::{Value, json};

use super::forms::{Form, bent, forms, size_of};
use crate::support::{Folder, Ran, waves};

/// A command, and what it writes beside its report.
pub(super) type Command = (&'static str, &'static [&'static str]);

/// What maps one surface onto another.
pub(super) const MAPS: &[Command] = &[
    ("embed s.obj -o e.npy", &["e.npy"]),
    ("check s.obj --anchors one.json -o c.ply", &["c.ply"]),
    ("weights s.obj --anchors one.json --points points.csv -o w.npy", &["w.npy"]),
    ("average s.obj --anchors one.json --weights weights.csv -o q.csv", &["q.csv"]),
    ("map --source s.obj --target t.obj --anchors pairs.json -o m.csv", &["m.csv"]),
    ("map --source s.obj --target t.obj --anchors pairs.json -o a.csv --method averages", &["a.csv"]),
    ("map --source s.obj --target t.obj --anchors pairs.json -o i.csv --inverse", &["i.csv"]),
    ("map --source s.obj --target t.obj --anchors pairs.json -o r.csv --method rbf", &["r.csv"]),
    (
        "map --source s.obj --target t.obj --anchors pairs.json -o o.csv --points points.csv --method closest",
        &["o.csv"],
    ),
    ("attributes --source s.obj --target t.obj --anchors pairs.json --attributes data.csv -o d.csv", &["d.csv"]),
    (
        "transfer --source s.obj --target t.obj --anchors pairs.json --texture s.png --size 96 -o o.png --coverage cover.png",
        &["o.png", "cover.png"],
    ),
    (
        "batch --source s.obj --texture s.png --targets in --method rbf --size 48 --margin 2 -o out --coverage c.png",
        &["out/t/s.png", "out/t/c.png"],
    ),
];

/// What takes long.
pub(super) const SLOW: &[Command] = &[
    ("anchors s.obj t.obj --anchors pairs.json --count 40 -o more.json --ignore-connectivity", &["more.json"]),
    ("anchors s.obj t.obj --anchors pairs.json --check --suggest 3", &[]),
    ("morph s.obj t.obj -o half.ply --weights 0.5,0.5", &["half.ply"]),
];

/// What changes a shape.
pub(super) const SHAPES: &[Command] = &[
    ("deform s.obj --handles handles.json -o p.obj", &["p.obj"]),
    ("animate s.obj --motion walk.csv --markers m.json --reference 0 -o given", &["given/frame_0002.obj"]),
    ("cage s.obj --from from.obj --to to.obj -o caged.obj", &["caged.obj"]),
];

/// What draws on a surface, or covers it.
pub(super) const DRAWINGS: &[Command] = &[
    ("unwrap s.obj -o unwrapped.obj --size 256", &["unwrapped.obj"]),
    ("render s.obj -o v.png --size 160x120 --texture s.png --anchors one.json", &["v.png"]),
    ("render s.obj -o g.png --size 160x120", &["g.png"]),
    ("decal s.obj --anchors decal.json --image s.png -o decal.png --size 128", &["decal.png"]),
    ("decal s.obj --anchors decal.json -o decal.obj", &["decal.obj"]),
    ("spline s.obj --points spline.json -o curve.svg", &["curve.svg"]),
    ("remesh s.obj --base auto --base-vertices 60 --levels 2 --smooth 1 -o quads.obj", &["quads.obj"]),
];

/// Anchors and the rows of tables.
const COUNT: usize = 32;

/// The inputs of all commands for form `k` of `forms`, source and target alike.
pub(super) fn folder(form: &Form, k: usize) -> Folder {
    let f = Folder::empty();
    let (mesh, size) = (&form.mesh, size_of(&form.mesh));
    write_obj(mesh, f.path("s.obj")).unwrap();
    write_obj(&bent(mesh), f.path("t.obj")).unwrap();
    write_image(&waves(64), f.path("s.png")).unwrap();
    let chosen: Vec<usize> =
        (0..COUNT).map(|i| i * mesh.triangle_count() / COUNT + mesh.triangle_count() / (2 * COUNT)).collect();
    // Half of the anchors by number of a vertex, half by face.
    let anchor = |(i, &t): (usize, &usize)| -> Value {
        match i % 2 {
            0 => json!(mesh.triangle(t)[i % 3]),
            _ => json!({"face": t, "barycentric": [0.2, 0.3, 0.5]}),
        }
    };
    let anchors: Vec<Value> = chosen.iter().enumerate().map(anchor).collect();
    let pairs = json!({"source": anchors, "target": anchors}).to_string();
    f.write("pairs.json", &pairs);
    f.write("one.json", &json!({"anchors": anchors}).to_string());
    std::fs::create_dir(f.path("in")).unwrap();
    f.write("in/t.json", &pairs);
    std::fs::copy(f.path("t.obj"), f.path("in/t.obj")).unwrap();
    let points: String = chosen.iter().map(|t| format!("{t},0.1,0.6,0.3\n")).collect();
    f.write("points.csv", &format!("face,b0,b1,b2\n{points}"));
    let share = |row: usize, i: usize| {
        if i == row {
            0.5
        } else if i == row + 1 || i == row + 2 {
            0.25
        } else {
            0.0
        }
    };
    let row = |r: usize| (0..COUNT).map(|i| share(r, i).to_string()).collect::<Vec<_>>().join(",");
    f.write("weights.csv", &(0..COUNT - 2).map(|r| row(r) + "\n").collect::<String>());
    let data = |v: u32| f64::from(v % 97);
    let rows: String = form.welded.iter().enumerate().map(|(v, &w)| format!("{v},{}\n", data(w))).collect();
    f.write("data.csv", &format!("index,a\n{rows}"));
    let handle = |(i, &t): (usize, &usize)| {
        let v = mesh.triangle(t)[i % 3];
        let p = mesh.positions[v as usize] + DVec3::new(0.05, -0.02, 0.1) * (size * ((i % 3) as f64));
        json!({"vertex": v, "position": p.to_array()})
    };
    let handles: Vec<Value> = chosen.iter().step_by(6).enumerate().map(handle).collect();
    f.write("handles.json", &json!({"handles": handles}).to_string());
    markers(&f, form, &chosen);
    around_a_place(&f, mesh, size);
    for (name, degrees) in [("from.obj", 0.0), ("to.obj", 40.0)] {
        // The cage comes in the same form.
        write_obj(&forms(&cage(mesh, degrees))[k].mesh, f.path(name)).unwrap();
    }
    f
}

/// Markers on vertices, and a clip in which they swing.
fn markers(f: &Folder, form: &Form, chosen: &[usize]) {
    let mesh = &form.mesh;
    let mut vertices: Vec<u32> = chosen.iter().map(|&t| mesh.triangle(t)[0]).collect();
    let mut bound = HashSet::new();
    vertices.retain(|v| bound.insert(form.welded[*v as usize]));
    let names: serde_json::Map<String, Value> =
        vertices.iter().enumerate().map(|(k, v)| (format!("M{k}"), json!(v))).collect();
    f.write("m.json", &Value::Object(names).to_string());
    let mut text = String::from("time");
    (0..vertices.len()).for_each(|k| write!(text, ",M{k}.x,M{k}.y,M{k}.z").unwrap());
    for frame in 0..3 {
        write!(text, "\n{}", f64::from(frame) / 30.0).unwrap();
        for &v in &vertices {
            let p = mesh.positions[v as usize];
            let p = DQuat::from_rotation_x(0.1 * f64::from(frame)) * p;
            write!(text, ",{},{},{}", p.x, p.y, p.z).unwrap();
        }
    }
    f.write("walk.csv", &text);
}

/// Anchors of a decal and points of a curve around the middle of the largest triangle.
fn around_a_place(f: &Folder, mesh: &Mesh, size: f64) {
    let largest = |best: usize, t: usize| if mesh.triangle_area(t) > mesh.triangle_area(best) { t } else { best };
    let t = (0..mesh.triangle_count()).fold(0, largest);
    let [a, b, c] = mesh.triangle_positions(t);
    let (u, n) = ((b - a).normalize(), mesh.triangle_area_normal(t).normalize());
    let place = |x: f64, y: f64| {
        let p = (a + b + c) / 3.0 + (u * x + n.cross(u) * y) * (0.04 * size);
        json!({"position": p.to_array()})
    };
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[x, y]| place(x, y));
    f.write("decal.json", &json!({"anchors": corners}).to_string());
    let points: Vec<Value> = (0..7).map(|i| f64::from(i).sin_cos()).map(|(s, c)| place(c, s)).collect();
    f.write("spline.json", &json!(points).to_string());
}

/// A box around a mesh, turned about y by up to `degrees`.
fn cage(mesh: &Mesh, degrees: f64) -> Mesh {
    let (low, high) = mesh.bounds().unwrap();
    let (middle, half) = (0.5 * (low + high), 0.6 * (high - low).max_element());
    let mut builder = MeshBuilder::new("cage");
    for i in 0..8 {
        let p = DVec3::from_array([0, 1, 2].map(|k| if i >> k & 1 == 1 { half } else { -half }));
        let turn = DQuat::from_rotation_y((degrees * p.y.signum() * 0.5).to_radians());
        builder.mesh.positions.push(middle + turn * p);
    }
    for q in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]] {
        builder.polygon(q.map(|vertex| Corner { vertex, texcoord: NONE, normal: NONE }));
    }
    builder.build().unwrap()
}

/// Runs a command with a report, on the CPU, with few landmarks where there are any; embeddings are
/// made once a folder.
pub(super) fn run(f: &Folder, command: &str) -> Ran {
    let embeds = [
        "map",
        "embed",
        "check",
        "weights",
        "average",
        "attributes",
        "transfer",
        "batch",
        "anchors",
        "spline",
        "remesh",
    ];
    let landmarks = if embeds.iter().any(|c| command.starts_with(c)) { " --landmarks 60" } else { "" };
    let cache = f.path("cache");
    f.run_with(
        &format!("{command}{landmarks} --backend cpu --report report.json"),
        &[("BARYMAP_CACHE", cache.to_str().unwrap())],
    )
}
