//! Vertices of 20,000 neighbours, copies of a face and a face of 20,000 corners against even meshes
//! of as many triangles: time and peak memory of commands, and the bar of 1.5 that both must stay
//! under.
//!
//! `cargo build --release && cargo bench --bench valence [-- MESH|COMMAND ...]`; the program is
//! taken from `BARYMAP` or beside this one. Peak memory is read from /proc on Linux. Times below a
//! tenth of a second are not compared.

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use barymap::geometry::{Corner, Mesh, MeshBuilder, NONE};
use barymap::io::write_obj;
use glam::DVec3;

/// Neighbours of a vertex, copies of a face, corners of a face.
const MANY: u32 = 20_000;
/// Time and memory may be this many times those of the even mesh.
const BAR: f64 = 1.5;
/// Seconds below which times are those of starting a program.
const LEAST: f64 = 0.1;

/// A sphere of rings; with `rings` = 2 its poles have half of the triangles each.
fn sphere(around: u32, rings: u32) -> Mesh {
    let mut positions = vec![DVec3::Y];
    for r in 1..rings {
        let a = f64::from(r) / f64::from(rings) * std::f64::consts::PI;
        positions.extend((0..around).map(|i| {
            let b = f64::from(i) / f64::from(around) * TAU;
            DVec3::new(a.sin() * b.cos(), a.cos(), a.sin() * b.sin())
        }));
    }
    positions.push(-DVec3::Y);
    let last = positions.len() as u32 - 1;
    let at = |r: u32, i: u32| 1 + (r - 1) * around + i % around;
    let mut triangles: Vec<[u32; 3]> = (0..around).map(|i| [0, at(1, i + 1), at(1, i)]).collect();
    for r in 1..rings - 1 {
        triangles
            .extend((0..around).flat_map(|i| {
                [[at(r, i), at(r, i + 1), at(r + 1, i)], [at(r, i + 1), at(r + 1, i + 1), at(r + 1, i)]]
            }));
    }
    triangles.extend((0..around).map(|i| [last, at(rings - 1, i), at(rings - 1, i + 1)]));
    Mesh::from_triangles("sphere", positions, &triangles).unwrap()
}

/// Seconds of wall time and peak memory in MiB.
fn measure(program: &Path, folder: &Path, command: &str) -> (f64, f64) {
    let started = Instant::now();
    let mut child = Command::new(program)
        .args(command.split_whitespace())
        .args(["--backend", "cpu", "--no-cache", "--quiet"])
        .current_dir(folder)
        .stdin(Stdio::null())
        .spawn()
        .expect("the program starts");
    let status = PathBuf::from(format!("/proc/{}/status", child.id()));
    let mut peak = 0.0f64;
    loop {
        let text = std::fs::read_to_string(&status).unwrap_or_default();
        let line = text.lines().find_map(|l| l.strip_prefix("VmHWM:"));
        let kib = line.and_then(|l| l.trim().split(' ').next()?.parse::<f64>().ok());
        peak = peak.max(kib.unwrap_or(0.0) / 1024.0);
        if let Some(done) = child.try_wait().expect("the program can be waited for") {
            assert!(done.success(), "{command} failed");
            return (started.elapsed().as_secs_f64(), peak);
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Half a disk with a wavy rim around a vertex on its border; with one ring that has all triangles.
/// Of the same shape whatever the rings: how long an embedding takes depends on the shape.
fn fan(around: u32, rings: u32) -> Mesh {
    let mut positions = vec![DVec3::ZERO];
    for r in 1..=rings {
        positions.extend((0..=around).map(|i| {
            let a = f64::from(i) / f64::from(around) * 0.5 * TAU;
            f64::from(r) / f64::from(rings) * DVec3::new(a.cos(), 0.05 * (9.0 * a).sin(), a.sin())
        }));
    }
    let at = |r: u32, i: u32| 1 + (r - 1) * (around + 1) + i;
    let mut triangles: Vec<[u32; 3]> = (0..around).map(|i| [0, at(1, i + 1), at(1, i)]).collect();
    for r in 1..rings {
        triangles
            .extend((0..around).flat_map(|i| {
                [[at(r, i), at(r, i + 1), at(r + 1, i)], [at(r, i + 1), at(r + 1, i + 1), at(r + 1, i)]]
            }));
    }
    Mesh::from_triangles("fan", positions, &triangles).unwrap()
}

/// A sphere with one face many times.
fn copies() -> Mesh {
    let one = sphere(40, 21);
    let mut triangles = one.triangles();
    triangles.extend(vec![triangles[300]; MANY as usize]);
    Mesh::from_triangles("copies", one.positions, &triangles).unwrap()
}

/// A star of one face.
fn polygon() -> Mesh {
    let mut builder = MeshBuilder::new("polygon");
    builder.mesh.positions = (0..MANY)
        .map(|i| {
            let (s, c) = (f64::from(i) / f64::from(MANY) * TAU).sin_cos();
            let r = if i % 2 == 0 { 1.0 } else { 0.5 };
            DVec3::new(r * c, 0.0, -r * s)
        })
        .collect();
    builder.polygon((0..MANY).map(|vertex| Corner { vertex, texcoord: NONE, normal: NONE }));
    builder.build().unwrap()
}

const COMMANDS: [&str; 6] = [
    "check m.obj --anchors c.json",
    "embed m.obj -o e.npy",
    "map --source m.obj --target m.obj --anchors a.json -o m.csv",
    "unwrap m.obj -o u.obj",
    "deform m.obj --handles h.json -o d.obj",
    "render m.obj -o r.png",
];

fn write_inputs(mesh: &Mesh, folder: &Path) {
    write_obj(mesh, folder.join("m.obj")).expect("written");
    let write = |name: &str, text: String| std::fs::write(folder.join(name), text).expect("written");
    let n = mesh.vertex_count();
    let list: Vec<String> = (0..24).map(|k| (k * (n - 1) / 23).to_string()).collect();
    let list = list.join(", ");
    write("a.json", format!("{{\"source\": [{list}], \"target\": [{list}]}}"));
    write("c.json", format!("{{\"anchors\": [{list}]}}"));
    let handles: Vec<String> = [0, n / 3, 2 * n / 3, n - 1]
        .iter()
        .map(|&v| format!("{{\"vertex\": {v}, \"position\": {:?}}}", (mesh.positions[v] * 1.2).to_array()))
        .collect();
    write("h.json", format!("{{\"handles\": [{}]}}", handles.join(", ")));
}

fn main() {
    let beside = std::env::current_exe().expect("a path").with_file_name("../barymap");
    let program = std::env::var_os("BARYMAP").map_or(beside, PathBuf::from);
    let folder = std::env::temp_dir().join(format!("barymap_valence_{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    let wanted: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let is_wanted = |one: &str, all: &[&str]| {
        let mut of_these = wanted.iter().filter(|w| all.contains(&w.as_str())).peekable();
        of_these.peek().is_none() || of_these.any(|w| w == one)
    };
    // Each with the even mesh of as many triangles.
    let meshes = [
        ("star", sphere(MANY, 2), sphere(200, MANY / 200 + 1)),
        ("fan", fan(MANY, 1), fan(100, MANY / 200)),
        ("copies", copies(), sphere(200, MANY / 400 + 5)),
        ("polygon", polygon(), sphere(200, MANY / 400 + 1)),
    ];
    let names = meshes.each_ref().map(|m| m.0);
    let verbs = COMMANDS.map(|c| c.split(' ').next().unwrap_or_default());
    for (name, mesh, even) in meshes.iter().filter(|m| is_wanted(m.0, &names)) {
        println!("{name}: {} triangles, the even mesh {}", mesh.triangle_count(), even.triangle_count());
        for (command, verb) in COMMANDS.iter().zip(verbs).filter(|c| is_wanted(c.1, &verbs)) {
            write_inputs(even, &folder);
            let (s, m) = measure(&program, &folder, command);
            write_inputs(mesh, &folder);
            let (t, k) = measure(&program, &folder, command);
            let under = (t < LEAST || t / s <= BAR) && k / m <= BAR;
            println!(
                "{verb:8} even {s:6.2} s {m:6.0} MiB   {name} {t:6.2} s {k:6.0} MiB   {:.2} x time, {:.2} x memory{}",
                t / s,
                k / m,
                if under { "" } else { "   ABOVE THE BAR" }
            );
        }
    }
    std::fs::remove_dir_all(&folder).expect("removed");
}
