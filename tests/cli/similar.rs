//! Every command on meshes far from the origin and in other units: the same as on those near it.
//!
//! All coordinates are multiples of 2^-20 and motions are shifts by whole numbers and scalings by
//! powers of two, so that the moved files hold the same shapes to the last bit. What commands
//! decide and draw must be the same then; what they place must be so but for the rounding of the
//! coordinates themselves.

use std::fmt::Write;

use barymap::geometry::{ClosestPoints, Mesh, Topology};
use barymap::io::{read_mesh, write_image, write_obj};
use barymap::models::shapes::{icosphere, uv_sphere};
use glam::{DQuat, DVec2, DVec3};
use serde_json::{Value, json};

use crate::support::{Folder, waves};

const GRID: f64 = 1.0 / (1 << 20) as f64;

fn snapped(p: DVec3) -> DVec3 {
    (p / GRID).round() * GRID
}

/// Shifted, then scaled.
#[derive(Clone, Copy, Debug)]
struct Motion {
    shift: DVec3,
    scale: f64,
}

impl Motion {
    const NONE: Self = Self { shift: DVec3::ZERO, scale: 1.0 };

    fn point(&self, p: DVec3) -> DVec3 {
        (p + self.shift) * self.scale
    }

    fn mesh(&self, mesh: &Mesh) -> Mesh {
        let mut moved = mesh.clone();
        moved.positions.iter_mut().for_each(|p| *p = self.point(*p));
        moved
    }

    fn json(&self, p: DVec3) -> Value {
        json!({"position": self.point(p).to_array()})
    }

    /// How far a place may be off: some roundings of its coordinates and of those at rest.
    fn rounding(&self) -> f64 {
        16.0 * f64::EPSILON * (4.0 + self.shift.abs().max_element()) * self.scale
    }
}

/// A lopsided potato in the direction `d`; `bend` makes two of them different.
fn potato(d: DVec3, bend: f64) -> DVec3 {
    let r = 1.0 + 0.25 * d.x * d.y + 0.2 * d.z * d.z * d.z + 0.15 * (2.0 * d.x + 0.4).sin();
    let p = d * r;
    snapped(DVec3::new(p.x, 1.4 * p.y + bend * p.x * p.x, p.z + bend * 0.5 * p.y))
}

fn shaped(mut mesh: Mesh, by: impl Fn(DVec3) -> DVec3) -> Mesh {
    mesh.positions.iter_mut().for_each(|p| *p = by(p.normalize()));
    mesh
}

/// A body with six limbs of different lengths in the direction `d`: what seeds are found on without
/// pairs.
fn limbs(d: DVec3, bend: f64) -> DVec3 {
    let limbs = [
        ([0.0, 1.0, 0.1], 0.9),
        ([1.0, 0.3, 0.0], 1.6),
        ([-1.0, 0.35, 0.1], 1.5),
        ([0.45, -1.0, 0.1], 1.9),
        ([-0.5, -1.0, 0.0], 1.7),
        ([0.1, -0.2, 1.0], 0.5),
    ];
    let r = limbs.iter().fold(0.5, |r, (a, h)| r + h * (14.0 * (DVec3::from(*a).normalize().dot(d) - 1.0)).exp());
    let p = d * r;
    snapped(DVec3::new(p.x * (1.0 + bend), p.y + bend * p.x * p.x, p.z + bend * 0.3 * p.y))
}

/// The cube around them, turned about y by up to `degrees`.
fn cage(degrees: f64) -> Mesh {
    let mut cube = icosphere(1.0, 1);
    cube.positions.iter_mut().for_each(|p| {
        let q = *p / p.abs().max_element() * 2.6;
        *p = snapped(DQuat::from_rotation_y((degrees * (0.2 * q.y).clamp(-0.5, 0.5)).to_radians()) * q);
    });
    cube
}

/// Directions spread evenly.
fn directions(count: usize) -> impl Iterator<Item = DVec3> {
    (0..count).map(move |i| {
        let y = 1.0 - 2.0 * (i as f64 + 0.5) / count as f64;
        let angle = std::f64::consts::TAU * i as f64 * 0.618_033_988_749_895;
        let r = (1.0 - y * y).sqrt();
        DVec3::new(r * angle.cos(), y, r * angle.sin())
    })
}

fn potatoes([slices, stacks]: [usize; 2], bend: f64) -> Mesh {
    shaped(uv_sphere(1.0, slices, stacks), |d| potato(d, bend))
}

/// The inputs of all commands, moved.
fn folder(motion: &Motion) -> Folder {
    let f = Folder::empty();
    let mesh = |name: &str, mesh: &Mesh| write_obj(&motion.mesh(mesh), f.path(name)).unwrap();
    let (source, target) = (potatoes([24, 16], 0.0), potatoes([30, 18], 0.25));
    mesh("s.obj", &source);
    mesh("t.obj", &target);
    mesh("bent.obj", &potatoes([24, 16], 0.4));
    mesh("body.obj", &shaped(uv_sphere(1.0, 36, 24), |d| limbs(d, 0.0)));
    mesh("other.obj", &shaped(uv_sphere(1.0, 40, 26), |d| limbs(d, 0.08)));
    mesh("from.obj", &cage(0.0));
    mesh("to.obj", &cage(50.0));
    write_image(&waves(64), f.path("s.png")).unwrap();
    let pairs = |bend: f64| -> Vec<Value> { directions(24).map(|d| motion.json(potato(d, bend))).collect() };
    f.write("a.json", &json!({"source": pairs(0.0), "target": pairs(0.25)}).to_string());
    f.write("few.json", &json!({"source": pairs(0.0)[..8], "target": pairs(0.25)[..8]}).to_string());
    f.write("single.json", &json!({"anchors": pairs(0.0)}).to_string());
    f.write("p.csv", "face,b0,b1,b2\n40,0.2,0.3,0.5\n300,0.6,0.3,0.1\n511,0.25,0.25,0.5\n");
    let mut values = String::from("height,side\n");
    for p in &source.positions {
        writeln!(values, "{},{}", p.y + p.x * p.z, u8::from(p.z > 0.1)).unwrap();
    }
    f.write("v.csv", &values);
    let handle =
        |v: usize, by: DVec3| json!({"vertex": v, "position": motion.point(source.positions[v] + by).to_array()});
    let handles = [handle(0, DVec3::ZERO), handle(361, DVec3::new(0.5, 0.25, 0.125)), handle(180, DVec3::ZERO)];
    f.write("h.json", &json!({"handles": handles}).to_string());
    let spline: Vec<Value> = directions(9).map(|d| motion.json(potato(d, 0.0))).collect();
    f.write("spline.json", &json!(spline).to_string());
    let corners = [[-0.4, -0.4], [0.4, -0.4], [0.4, 0.4], [-0.4, 0.4]];
    let decal = corners.map(|[x, y]| motion.json(potato(DVec3::new(x, y, 1.0).normalize(), 0.0)));
    f.write("decal.json", &json!({"anchors": decal}).to_string());
    clip(&f, &source);
    f
}

/// `walk.csv` and `m.json`: markers on vertices of the mesh at rest, which swing. The clip is where
/// it is, wherever the mesh lies.
fn clip(f: &Folder, mesh: &Mesh) {
    let vertices: Vec<usize> = (0..24).map(|k| (k * 71 + 5) % mesh.vertex_count()).collect();
    let names: serde_json::Map<String, Value> =
        vertices.iter().enumerate().map(|(k, v)| (format!("M{k}"), json!(v))).collect();
    f.write("m.json", &Value::Object(names).to_string());
    let mut text = String::from("time");
    (0..24).for_each(|k| write!(text, ",M{k}.x,M{k}.y,M{k}.z").unwrap());
    for frame in 0..4 {
        write!(text, "\n{}", f64::from(frame) / 30.0).unwrap();
        for &v in &vertices {
            let p = mesh.positions[v];
            let p = DQuat::from_rotation_x(0.06 * f64::from(frame) * p.y) * p;
            write!(text, ",{},{},{}", p.x, p.y, p.z).unwrap();
        }
    }
    f.write("walk.csv", &text);
}

/// The commands, and what they write beside a report.
const COMMANDS: &[(&str, &[&str])] = &[
    ("map --source s.obj --target t.obj --anchors a.json -o m.csv", &["m.csv"]),
    ("map --source s.obj --target t.obj --anchors few.json -o r.csv --backend reference --align --cycle", &["r.csv"]),
    ("map --source s.obj --target t.obj --anchors a.json -o i.csv --backend cpu --inverse", &["i.csv"]),
    ("map --source s.obj --target t.obj --anchors a.json -o b.csv --method rbf --relax yes", &["b.csv"]),
    (
        "transfer --source s.obj --texture s.png --target t.obj --anchors a.json -o x.png --coverage c.png --size 128",
        &["x.png", "c.png"],
    ),
    (
        "transfer --source s.obj --texture s.png --kind normal --target t.obj --anchors a.json -o n.png --size 128 --backend cpu",
        &["n.png"],
    ),
    ("attributes --source s.obj --target t.obj --anchors a.json --attributes v.csv -o v2.csv", &["v2.csv"]),
    ("check s.obj --anchors single.json -o cover.ply", &["cover.ply"]),
    ("embed s.obj -o e.npy", &["e.npy"]),
    ("weights s.obj --anchors single.json --points p.csv -o w.npy", &["w.npy"]),
    ("average s.obj --anchors single.json --weights w.csv -o q.csv", &["q.csv"]),
    ("anchors s.obj t.obj --anchors few.json --count 16 -o full.json --suggest 2", &["full.json"]),
    ("anchors body.obj other.obj --count 12 -o none.json", &["none.json"]),
    ("anchors s.obj t.obj --anchors a.json --check", &[]),
    ("deform s.obj --handles h.json -o d.obj", &["d.obj"]),
    ("morph s.obj bent.obj --weights 0.5,0.5 -o between.obj", &["between.obj"]),
    ("morph s.obj t.obj --pairs a.json --compatible c.obj --weights 0.4,0.6 -o made.obj", &["c.obj", "made.obj"]),
    (
        "animate s.obj --motion walk.csv --markers m.json --reference 0 -o given --sheet sheet.png",
        &["given/frame_0003.obj", "sheet.png"],
    ),
    ("animate s.obj --motion walk.csv --reference 0 -o guessed", &["guessed/frame_0002.obj"]),
    ("cage s.obj --from from.obj --to to.obj -o caged.obj", &["caged.obj"]),
    ("cage s.obj --from from.obj --to to.obj -o back.obj --inverse --path linear", &["back.obj"]),
    ("spline s.obj --points spline.json -o curve.ply", &["curve.ply"]),
    ("spline s.obj --points spline.json -o curve.svg --mode subdivision --closed", &["curve.svg"]),
    ("remesh s.obj --base auto --base-vertices 60 --levels 2 --smooth 2 -o quads.obj", &["quads.obj"]),
    ("decal s.obj --anchors decal.json --image s.png -o decal.png --size 128", &["decal.png"]),
    ("decal s.obj --anchors decal.json --layout averages -o decal.obj", &["decal.obj"]),
    ("unwrap s.obj -o unwrapped.obj", &["unwrapped.obj"]),
    ("render s.obj --texture s.png --anchors single.json -o view.png --size 200x200", &["view.png"]),
];

/// Runs a command with a report, and with few landmarks where there are any.
fn run(f: &Folder, command: &str) {
    let embeds = !["deform", "cage", "decal", "unwrap", "render", "animate"].iter().any(|c| command.starts_with(c));
    let landmarks = if embeds { " --landmarks 120" } else { "" };
    f.run(&format!("{command}{landmarks} --report report.json")).succeeds();
}

/// The columns and the numbers of an array.
fn matrix(folder: &Folder, name: &str) -> (usize, Vec<f64>) {
    let matrix = barymap::io::npy::read_npy(folder.path(name)).unwrap();
    (matrix.columns, matrix.values)
}

/// Compares a file of two folders; `b` is moved.
fn same_file(name: &str, a: &Folder, b: &Folder, motion: &Motion) -> Result<(), String> {
    match name.rsplit('.').next().unwrap() {
        "png" => same_if(a.image(name) == b.image(name), || format!("{name}: other pixels")),
        "svg" => same_if(a.read(name) == b.read(name), || format!("{name}: another drawing")),
        "npy" => {
            let [(columns, x), (others, y)] = [a, b].map(|f| matrix(f, name));
            // Embeddings are as large as the mesh, weights are not.
            let scale = if name == "e.npy" { motion.scale } else { 1.0 };
            let same = columns == others && x.iter().zip(&y).all(|(x, y)| x * scale == *y);
            same_if(same && x.len() == y.len(), || format!("{name}: other numbers"))
        }
        "json" => same_json(name, &a.json(name), &b.json(name), motion),
        "csv" => same_table(name, &a.read(name), &b.read(name), motion),
        _ => {
            let [p, q] = [a, b].map(|f| if name == "curve.ply" { points(f, name) } else { mesh(f, name) });
            same_if(p.1 == q.1, || format!("{name}: other faces"))?;
            same_places(name, &p.0, &q.0, motion)
        }
    }
}

fn mesh(f: &Folder, name: &str) -> (Vec<DVec3>, String) {
    let mesh = read_mesh(f.path(name)).unwrap().mesh;
    (mesh.positions.clone(), format!("{:?} {:?}", mesh.triangles(), mesh.texcoords))
}

/// The vertices of a polyline, which is no mesh, and all the rest of the file.
fn points(f: &Folder, name: &str) -> (Vec<DVec3>, String) {
    let bytes = f.bytes(name);
    let start = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let header = String::from_utf8_lossy(&bytes[..start]).into_owned();
    let count: usize = header.lines().find_map(|l| l.strip_prefix("element vertex ")).unwrap().parse().unwrap();
    let width =
        header.lines().take_while(|l| !l.contains("element edge")).filter(|l| l.contains("property double")).count();
    assert!(header.contains("binary_little_endian") && width > 3, "{header}");
    let number = |i: usize| f64::from_le_bytes(bytes[start + 8 * i..start + 8 * i + 8].try_into().unwrap());
    let places = (0..count).map(|v| DVec3::new(number(v * width), number(v * width + 1), number(v * width + 2)));
    (places.collect(), header)
}

fn same_if(same: bool, what: impl FnOnce() -> String) -> Result<(), String> {
    if same { Ok(()) } else { Err(what()) }
}

fn same_places(name: &str, a: &[DVec3], b: &[DVec3], motion: &Motion) -> Result<(), String> {
    same_if(a.len() == b.len(), || format!("{name}: {} and {} places", a.len(), b.len()))?;
    let off = |(p, q): (&DVec3, &DVec3)| motion.point(*p).distance(*q);
    let most = a.iter().zip(b).map(off).fold(0.0, f64::max);
    same_if(most <= motion.rounding(), || format!("{name}: {most:e} off, {:e} is rounding", motion.rounding()))
}

/// Cells are equal, but for x, y and z.
fn same_table(name: &str, a: &str, b: &str, motion: &Motion) -> Result<(), String> {
    same_if(a.lines().count() == b.lines().count(), || format!("{name}: other rows"))?;
    let header: Vec<&str> = a.lines().next().unwrap().split(',').collect();
    let places: Vec<usize> = ["x", "y", "z"].iter().filter_map(|c| header.iter().position(|h| h == c)).collect();
    let (mut p, mut q) = (Vec::new(), Vec::new());
    for (x, y) in a.lines().zip(b.lines()) {
        let [x, y] = [x, y].map(|l| l.split(',').collect::<Vec<_>>());
        for k in (0..header.len()).filter(|k| !places.contains(k)) {
            // The residual of the inverse is as fine as coordinates are.
            let number = |x: &str| x.parse::<f64>().ok();
            let near = matches!((number(x[k]), number(y[k])), (Some(x), Some(y)) if (x - y).abs() <= 1e-9);
            same_if(x[k] == y[k] || header[k] == "residual" && near, || format!("{name}: {x:?} and {y:?}"))?;
        }
        let place = |cells: &[&str]| places.iter().map(|&k| cells[k].parse().ok()).collect::<Option<Vec<f64>>>();
        if let (3, Some(x), Some(y)) = (places.len(), place(&x), place(&y)) {
            p.push(DVec3::from_slice(&x));
            q.push(DVec3::from_slice(&y));
        }
    }
    same_places(name, &p, &q, motion)
}

/// Numbers are equal, or lengths, areas or volumes in the other units; three in a row may be a
/// place. Times, and what depends on them, are not compared.
fn same_json(at: &str, a: &Value, b: &Value, motion: &Motion) -> Result<(), String> {
    const PASSED_OVER: [&str; 9] = [
        "nanoseconds_per_texel",
        "seconds",
        "cpu_seconds",
        // Work goes to a device in slices of about equal time.
        "traffic",
        "seconds_per_frame",
        "frames_per_second",
        "version",
        "backend",
        "bytes",
    ];
    let other = || format!("{at}: {a} and {b}");
    let number = |x: &Value| x.as_f64();
    match (a, b) {
        (Value::Object(x), Value::Object(y)) => {
            same_if(x.len() == y.len(), other)?;
            x.iter()
                .filter(|(key, _)| !PASSED_OVER.contains(&key.as_str()))
                .try_for_each(|(key, x)| same_json(&format!("{at}.{key}"), x, &y[key], motion))
        }
        (Value::Array(x), Value::Array(y)) => {
            same_if(x.len() == y.len(), other)?;
            let place = |v: &[Value]| v.iter().map(number).collect::<Option<Vec<f64>>>().filter(|v| v.len() == 3);
            if let (Some(p), Some(q)) = (place(x), place(y)) {
                let (p, q) = (DVec3::from_slice(&p), DVec3::from_slice(&q));
                if motion.point(p).distance(q) <= motion.rounding() {
                    return Ok(());
                }
            }
            x.iter().zip(y).enumerate().try_for_each(|(i, (x, y))| same_json(&format!("{at}[{i}]"), x, y, motion))
        }
        (Value::Number(_), Value::Number(_)) => {
            let (Some(x), Some(y)) = (number(a), number(b)) else { return Err(other()) };
            // Of lengths as the moved coordinates are rounded; of areas the square, and so on.
            let near = |power: i32| {
                let unit = motion.scale.powi(power);
                let rounding = motion.rounding() / motion.scale;
                (y / unit - x).abs() <= 1e-9 * x.abs() + rounding
            };
            same_if(x == y || (-1..=3).any(near), other)
        }
        _ => same_if(a == b, other),
    }
}

#[test]
fn every_command_is_the_same_far_from_the_origin_and_in_other_units() {
    let motions = [
        Motion { shift: DVec3::new(500_000.0, 4_600_000.0, 300.0), scale: 1.0 },
        Motion { shift: DVec3::new(-16_000_000.0, 1.0, 9_000_000.0), scale: 2f64.powi(-20) },
    ];
    let rest = folder(&Motion::NONE);
    let moved: Vec<Folder> = motions.iter().map(folder).collect();
    let mut failures = Vec::new();
    for (command, outputs) in COMMANDS {
        if command.starts_with("average") {
            // The weights that were found before.
            for f in moved.iter().chain([&rest]) {
                let (columns, weights) = matrix(f, "w.npy");
                let row = |r: &[f64]| r.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
                f.write("w.csv", &weights.chunks(columns).map(row).collect::<Vec<_>>().join("\n"));
            }
        }
        run(&rest, command);
        for (f, motion) in moved.iter().zip(&motions) {
            run(f, command);
            for name in outputs.iter().chain([&"report.json"]) {
                if let Err(what) = same_file(name, &rest, f, motion) {
                    failures.push(format!("{command} {motion:?}: {}", &what[..what.len().min(300)]));
                }
            }
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn what_differs_is_seen() {
    let motion = Motion { shift: DVec3::new(500_000.0, 4_600_000.0, 300.0), scale: 1.0 };
    let (a, b) = (folder(&Motion::NONE), folder(&motion));
    assert_eq!(same_file("s.obj", &a, &b, &motion), Ok(()));
    assert!(same_file("s.obj", &a, &b, &Motion { shift: motion.shift + DVec3::X * 1e-6, ..motion }).is_err());
    assert!(same_file("s.obj", &a, &b, &Motion::NONE).is_err());
    let apart = [motion.shift, motion.shift, motion.shift + 1e-7];
    assert!(same_places("p", &[DVec3::ZERO; 3], &apart, &motion).is_err());
    let map = "index,face,x,y,z,status\n0,1,0.5,0.5,0.5,valid\n";
    let there = "index,face,x,y,z,status\n0,1,500000.5,4600000.5,300.5,valid\n";
    assert_eq!(same_table("t", map, there, &motion), Ok(()));
    assert!(same_table("t", map, &there.replace("valid", "doubtful"), &motion).is_err());
    assert!(same_table("t", map, &there.replace("300.5", "300.500001"), &motion).is_err());
    let report = |area: f64, count: u64| json!({"area": area, "count": count, "seconds": {"map": area}});
    let scaled = Motion { scale: 0.25, ..Motion::NONE };
    assert_eq!(same_json("r", &report(2.0, 7), &report(0.125, 7), &scaled), Ok(()));
    assert!(same_json("r", &report(2.0, 7), &report(0.1251, 7), &scaled).is_err());
    assert!(same_json("r", &report(2.0, 7), &report(2.0, 8), &Motion::NONE).is_err());
    b.write("few.json", "{}");
    assert!(same_file("few.json", &a, &b, &motion).is_err());
    let mut other = waves(64);
    if let barymap::picture::Pixels::U8(samples) = &mut other.pixels {
        samples[77] ^= 1;
    }
    write_image(&other, b.path("s.png")).unwrap();
    assert!(same_file("s.png", &a, &b, &motion).is_err());
}

/// Cages and points of the plane, through the map and back.
#[test]
fn points_of_the_plane_are_the_same_far_from_the_origin() {
    let rest = Folder::empty();
    let inner = |i: usize| DVec2::new(0.2 + 0.6 * (i as f64 * 0.618).fract(), 0.2 + 0.6 * (i as f64 * 0.414).fract());
    let source = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.5, 0.625], [0.0, 1.0]];
    let target = [[0.125, 0.0], [1.25, 0.25], [1.0, 1.25], [0.625, 0.75], [0.0, 1.0]];
    let write = |f: &Folder, shift: DVec2, scale: f64| {
        let moved = |p: DVec2| (p + shift) * scale;
        let loops = |l: &[[f64; 2]]| l.iter().map(|p| moved(DVec2::from(*p)).to_array()).collect::<Vec<_>>();
        f.write("cage.json", &json!({"source": loops(&source), "target": loops(&target)}).to_string());
        let rows = (0..40).map(|i| moved((inner(i) / GRID).round() * GRID)).map(|p| format!("{},{}", p.x, p.y));
        f.write("p.csv", &format!("x,y\n{}\n", rows.collect::<Vec<_>>().join("\n")));
    };
    let read = |f: &Folder, name: &str| -> Vec<DVec2> {
        let number = |x: &str| x.parse::<f64>().unwrap();
        let row = |l: &str| l.split(',').take(2).map(number).collect::<Vec<_>>();
        f.read(name).lines().skip(1).map(|l| DVec2::from_slice(&row(l))).collect()
    };
    for coordinates in ["mean-value", "mean-value --partition continuous --path intrinsic", "mean-value --certify"] {
        write(&rest, DVec2::ZERO, 1.0);
        let run = |f: &Folder| {
            let command = format!("--cage cage.json --coordinates {coordinates} --report r.json");
            f.run(&format!("warp-points p.csv -o q.csv {command}")).succeeds();
            // The images without their status.
            let rows =
                f.read("q.csv").lines().map(|l| l.split(',').take(2).collect::<Vec<_>>().join(",")).collect::<Vec<_>>();
            f.write("images.csv", &rows.join("\n"));
            f.run(&format!("warp-points images.csv -o back.csv --inverse {command}")).succeeds();
        };
        run(&rest);
        for (shift, scale) in [
            (DVec2::new(500_000.0, 4_600_000.0), 1.0),
            (DVec2::new(-1e7, 1e7), 1.0),
            (DVec2::ZERO, 1e-6),
            (DVec2::ZERO, 1e6),
        ] {
            let there = Folder::empty();
            write(&there, shift, scale);
            run(&there);
            let rounding = 100.0 * f64::EPSILON * (4.0 + shift.abs().max_element()) * scale;
            for name in ["q.csv", "back.csv"] {
                for (p, q) in read(&rest, name).iter().zip(read(&there, name)) {
                    let off = ((*p + shift) * scale).distance(q);
                    assert!(off <= rounding, "{coordinates} {shift} {scale} {name}: {off:e}, {rounding:e} is rounding");
                }
            }
            let [a, b] = [&rest, &there].map(|f| f.json("r.json"));
            // Steps tell where their smallest Jacobian is, which moves along.
            let steps = |r: &Value| r["steps"].as_array().map(Vec::len);
            assert_eq!(steps(&a), steps(&b), "{coordinates} {shift} {scale}: steps");
            for key in ["bijective", "points", "failed"] {
                assert_eq!(a[key], b[key], "{coordinates} {shift} {scale}: {key}");
            }
        }
    }
    // The points go somewhere, and come back.
    let [p, q, back] = ["p.csv", "q.csv", "back.csv"].map(|name| read(&rest, name));
    assert!(p.iter().zip(&q).any(|(p, q)| p.distance(*q) > 0.05));
    assert!(p.iter().zip(&back).all(|(p, q)| p.distance(*q) < 1e-12));
}

/// The cases of `BARYMAP_DATA/../cases`: identity between a mesh and itself far away.
#[test]
fn a_mesh_in_map_coordinates_is_met_exactly() {
    let f = Folder::empty();
    let plane = |motion: &Motion| {
        let mut mesh =
            barymap::models::shapes::plane_grid(12, 12, 1.0, 1.0, barymap::models::shapes::Diagonal::Forward);
        mesh.positions.iter_mut().for_each(|p| {
            let height = 0.25 * (3.0 * p.x).sin() * p.y;
            *p = motion.point(snapped(DVec3::new(p.x, p.y, height)));
        });
        mesh
    };
    let motion = Motion { shift: DVec3::new(500_000.0, 4_600_000.0, 300.0), scale: 1.0 };
    let (source, target) = (plane(&motion), plane(&Motion::NONE));
    write_obj(&source, f.path("s.obj")).unwrap();
    write_obj(&target, f.path("t.obj")).unwrap();
    let vertices: Vec<usize> = (0..12).map(|k| (k * 29 + 3) % 169).collect();
    f.write("a.json", &json!({"source": vertices, "target": vertices}).to_string());
    for backend in ["cpu", "reference", "auto"] {
        f.run(&format!(
            "map --source s.obj --target t.obj --anchors a.json -o m.csv --report r.json --backend {backend}"
        ))
        .succeeds();
        for (line, wanted) in f.read("m.csv").lines().skip(1).zip(&source.positions) {
            let cells: Vec<&str> = line.split(',').collect();
            let n = |k: usize| cells[k].parse::<f64>().unwrap();
            assert!(DVec3::new(n(5), n(6), n(7)).distance(*wanted) < 1e-5, "{backend}: {line}, {wanted}");
            assert_eq!(cells[8], "valid", "{line}");
        }
        assert_eq!(f.json("r.json")["flipped_faces"], 0);
    }
    let closest = ClosestPoints::new(&source, &Topology::new(&source));
    assert!(source.positions.iter().all(|p| closest.nearest(*p).unwrap().1 == 0.0));
}
