//! A vertex of 20,000 neighbours against an even mesh of as many triangles: time and peak memory of
//! commands.
//!
//! `cargo build --release && cargo bench --bench valence`; the program is taken from `BARYMAP` or
//! beside this one. Peak memory is read from /proc on Linux.

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use barymap::geometry::Mesh;
use barymap::io::{write_image, write_obj};
use barymap::raster::{Image, Pixels};
use glam::DVec3;

/// Triangles of a mesh.
const TRIANGLES: u32 = 40_000;

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
    Mesh::from_triangles("sphere", positions, &triangles)
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

fn main() {
    let beside = std::env::current_exe().expect("a path").with_file_name("../barymap");
    let program = std::env::var_os("BARYMAP").map_or(beside, PathBuf::from);
    let folder = std::env::temp_dir().join(format!("barymap_valence_{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    let samples = (0..64 * 64 * 3).map(|i| (i % 251) as u8).collect();
    write_image(&Image::new(64, 64, 3, Pixels::U8(samples)).expect("a picture"), folder.join("t.png"))
        .expect("written");
    let mut rows = Vec::new();
    for (name, around, rings) in [("even", 200, TRIANGLES / 400 + 1), ("star", TRIANGLES / 2, 2)] {
        let mesh = sphere(around, rings);
        write_obj(&mesh, folder.join("m.obj")).expect("written");
        let n = mesh.vertex_count();
        let list: Vec<String> = (0..24).map(|k| (k * (n - 1) / 23).to_string()).collect();
        let list = list.join(", ");
        std::fs::write(folder.join("a.json"), format!("{{\"source\": [{list}], \"target\": [{list}]}}"))
            .expect("written");
        let handles: Vec<String> = [0, n / 3, 2 * n / 3, n - 1]
            .iter()
            .map(|&v| format!("{{\"vertex\": {v}, \"position\": {:?}}}", (mesh.positions[v] * 1.2).to_array()))
            .collect();
        std::fs::write(folder.join("h.json"), format!("{{\"handles\": [{}]}}", handles.join(", "))).expect("written");
        for command in [
            "embed m.obj -o e.npy",
            "map --source m.obj --target m.obj --anchors a.json -o m.csv",
            "unwrap m.obj -o u.obj",
            "deform m.obj --handles h.json -o d.obj",
            "render m.obj -o r.png",
        ] {
            rows.push((name, command, measure(&program, &folder, command)));
        }
    }
    std::fs::remove_dir_all(&folder).expect("removed");
    println!("{TRIANGLES} triangles; star: two vertices of {} neighbours", TRIANGLES / 2);
    let half = rows.len() / 2;
    for (even, star) in rows[..half].iter().zip(&rows[half..]) {
        let ((s, m), (t, k)) = (even.2, star.2);
        let command = even.1.split(' ').next().unwrap_or_default();
        println!(
            "{command:8} even {s:6.2} s {m:6.0} MiB   star {t:6.2} s {k:6.0} MiB   {:.2} x time, {:.2} x memory",
            t / s,
            k / m
        );
    }
}
