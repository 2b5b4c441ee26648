//! `--memory` bounds the whole process, or the work is refused with the number.

use std::path::PathBuf;

use barymap::io::{write_image, write_obj};
use barymap::models::shapes::{Diagonal, plane_grid, uv_sphere};
use barymap::picture::{Image, Pixels};
use serde_json::{Value, json};

use crate::support::{Folder, Ran};

const MIB: u64 = 1 << 20;

/// Limits as they are given, and in MiB.
const LIMITS: [(&str, u64); 4] = [("250M", 250), ("500M", 500), ("1G", 1024), ("4G", 4096)];

/// What is wrong with a run under a limit of so many MiB: nothing where the process took at most
/// 1.1 times the limit and what the program takes itself, and ended well or was refused with the
/// number.
fn fault(ran: &Ran, limit: u64, on_device: bool) -> Option<String> {
    let program = if on_device { 400 } else { 100 };
    let bound = limit * MIB * 11 / 10 + program * MIB;
    let Some(peak) = ran.peak_memory else { return Some("the system does not tell the peak".into()) };
    if peak > bound {
        return Some(format!("{} MiB, {} are the bound: {}", peak / MIB, bound / MIB, ran.stderr));
    }
    match ran.code {
        Some(0) => None,
        Some(1) if ran.message().contains(&format!("{} are allowed", limit * MIB)) => None,
        code => Some(format!("{code:?}: {}", ran.stderr)),
    }
}

/// Runs a command, with the limit in place of LIMIT, under each of them. At the largest it must
/// succeed, or nothing would be shown.
#[track_caller]
fn check(f: &Folder, command: &str, on_device: bool) {
    let mut told = Vec::new();
    for (text, limit) in LIMITS {
        let ran = f.run(&format!("{} --no-cache --memory {text}", command.replace("LIMIT", text)));
        let fault = fault(&ran, limit, on_device);
        told.push(format!("{text}: {} MiB, {:?}", ran.peak_memory.unwrap_or(0) / MIB, ran.code));
        assert!(fault.is_none(), "{command}: {text}: {fault:?}");
        assert!(limit < 4096 || ran.code == Some(0), "{command}: {told:?} {}", ran.stderr);
    }
    println!("{command}: {}", told.join("; "));
}

/// Runs a command that is too large for 250M: it is refused with the number, before work begins.
#[track_caller]
fn check_refused(f: &Folder, command: &str, words: &[&str]) {
    let ran = f.run(&format!("{command} --no-cache --memory 250M"));
    ran.fails_like(1, &[words, &["bytes, 262144000 are allowed. Raise --memory"]].concat());
    // What no estimate foresaw ends with these words.
    assert!(!ran.message().contains("the work so far"), "{command}: {}", ran.stderr);
    assert!(ran.peak_memory.is_none_or(|peak| peak < 250 * MIB), "{command}: {:?}", ran.peak_memory);
}

/// `NAME.obj`, a sphere of about so many vertices, `NAME.json` with handles on it, `NAME.csv` with
/// a clip of four frames, and `NAME_markers.json`.
fn sphere(f: &Folder, name: &str, vertices: usize) {
    let slices = (vertices as f64 * 2.0).sqrt() as usize;
    let mesh = uv_sphere(1.0, slices, vertices / slices);
    write_obj(&mesh, f.path(&format!("{name}.obj"))).unwrap();
    let held: Vec<usize> = (0..12).map(|k| k * (mesh.vertex_count() - 1) / 11).collect();
    let at = |v: usize, frame: usize| (mesh.positions[v] * (1.0 + 0.02 * frame as f64)).to_array();
    let handles: Vec<Value> =
        held.iter().map(|&v| json!({"vertex": v, "position": at(v, usize::from(v == 0))})).collect();
    f.write(&format!("{name}.json"), &json!({"handles": handles}).to_string());
    let markers: serde_json::Map<String, Value> = held.iter().map(|v| (format!("M{v}"), json!(v))).collect();
    f.write(&format!("{name}_markers.json"), &Value::Object(markers).to_string());
    let mut clip = String::from("time,marker,x,y,z\n");
    for (frame, v) in (0..4).flat_map(|frame| held.iter().map(move |v| (frame, *v))) {
        let [x, y, z] = at(v, frame);
        clip += &format!("{},M{v},{x},{y},{z}\n", frame as f64 / 30.0);
    }
    f.write(&format!("{name}.csv"), &clip);
    let rows: String = mesh.positions.iter().map(|p| format!("{}\n", p.x)).collect();
    f.write(&format!("{name}_data.csv"), &format!("a\n{rows}"));
}

/// Commands on a mesh of the name NAME.
const ON_MESHES: [&str; 5] = [
    "deform NAME.obj --handles NAME.json -o o.ply --backend cpu",
    "animate NAME.obj --motion NAME.csv --markers NAME_markers.json --reference 0 -o o.glb --backend cpu",
    "morph NAME.obj NAME.obj --frames 3 -o o.glb",
    "attributes --source NAME.obj --target NAME.obj --anchors pairs.json --attributes NAME_data.csv -o o.csv --backend cpu",
    "unwrap NAME.obj -o o.obj",
];

/// Twelve pairs of directions, which are near vertices of any of the spheres.
fn pairs(f: &Folder) {
    f.anchors("pairs.json", 12, |p| p);
    let mut all = f.json("pairs.json");
    all["target"] = all["source"].clone();
    f.write("pairs.json", &all.to_string());
}

#[test]
#[cfg(target_os = "linux")]
fn work_on_meshes_stays_within_the_limit() {
    let f = Folder::empty();
    pairs(&f);
    sphere(&f, "small", 6000);
    for command in ON_MESHES {
        check(&f, &format!("{} --overwrite", command.replace("NAME", "small")), false);
    }
}

#[test]
#[cfg(target_os = "linux")]
fn work_on_meshes_is_allowed_just_below_the_limit_and_stays_within_it() {
    let f = Folder::empty();
    // 262,144,000 bytes over those that a vertex takes, less a little.
    for (vertices, command) in [78_000, 32_000, 34_000].into_iter().zip(ON_MESHES) {
        sphere(&f, "edge", vertices);
        let ran = f.run(&format!("{} --no-cache --memory 250M", command.replace("NAME", "edge"))).succeeds();
        assert_eq!(fault(&ran, 250, false), None, "{command}");
        println!("{command}: {vertices} vertices: {} MiB", ran.peak_memory.unwrap_or(0) / MIB);
    }
}

#[test]
#[cfg(target_os = "linux")]
fn work_on_large_meshes_is_refused_before_it_begins() {
    let f = Folder::empty();
    pairs(&f);
    sphere(&f, "large", 205_000);
    for command in ON_MESHES {
        check_refused(&f, &command.replace("NAME", "large"), &["large.obj", " vertices"]);
    }
    check_refused(&f, "render large.obj --size 8192 -o o.png", &["8192 x 8192"]);
    write_obj(&uv_sphere(1.0, 24, 16), f.path("s.obj")).unwrap();
    check_refused(&f, "remesh s.obj --base auto --levels 7 -o q.obj --backend cpu", &["7 levels of "]);
}

#[test]
#[cfg(target_os = "linux")]
fn decals_and_batches_stay_within_the_limit() {
    let f = Folder::empty();
    f.run("demo --size 256 --backend cpu").succeeds();
    std::fs::create_dir(f.path("in")).unwrap();
    std::fs::copy(f.path("out/target.obj"), f.path("in/a.obj")).unwrap();
    std::fs::copy(f.path("out/pairs.json"), f.path("in/a.json")).unwrap();
    check(&f, "batch --source out/source.obj --targets in -o done-LIMIT --size 2048 --backend cpu", false);
    write_obj(&plane_grid(20, 20, 1.0, 1.0, Diagonal::Alternating), f.path("plane.obj")).unwrap();
    let corner = |x: f64, y: f64| json!({"position": [x, y, 0]});
    let corners = [corner(0.2, 0.2), corner(0.8, 0.2), corner(0.8, 0.8), corner(0.2, 0.8)];
    f.write("corners.json", &json!({"anchors": corners}).to_string());
    let decal = "decal plane.obj --anchors corners.json --image out/demo.png -o o.png --backend cpu";
    check(&f, &format!("{decal} --size 2048"), false);
    check_refused(&f, &format!("{decal} --size 8192"), &["8192 x 8192"]);
    // The texture fits, a decal upon it and the result do not.
    let texture = Image::zeros(8000, 5000, 3, barymap::picture::Depth::U8).unwrap();
    write_image(&texture, f.path("black.png")).unwrap();
    check_refused(&f, &format!("{decal} --texture black.png"), &["8000 x 5000"]);
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
#[cfg(target_os = "linux")]
fn a_motion_of_a_real_mesh_stays_within_the_limit() {
    let data = PathBuf::from(std::env::var_os("BARYMAP_DATA").expect("BARYMAP_DATA names the folder of real models"));
    let f = Folder::empty();
    // 49,999 vertices.
    let (mesh, clip) = (data.join("mesh/koala_100k.obj"), data.join("mocap/mh_walk1.bvh"));
    check(&f, &format!("animate {} --motion {} --end 4 -o o.glb --overwrite", mesh.display(), clip.display()), false);
}

/// A picture of noise, which no codec makes small.
fn noise(width: u32, height: u32) -> Image {
    let mut state = 1u32;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 24) as u8
    };
    Image::new(width, height, 3, Pixels::U8((0..width * height * 3).map(|_| next()).collect())).unwrap()
}

const TRANSFER: &str =
    "transfer --source out/source.obj --target out/target.obj --anchors out/pairs.json -o skin.png --model m.glb";

#[test]
#[cfg(target_os = "linux")]
fn a_transfer_stays_within_the_limit() {
    let f = Folder::empty();
    f.run("demo --size 256 --backend cpu").succeeds();
    check(&f, &format!("{TRANSFER} --backend cpu --size 4096"), false);
}

#[test]
#[cfg(target_os = "linux")]
fn a_transfer_on_a_device_stays_within_the_limit() {
    if barymap::engine::Engine::adapters().is_empty() {
        assert!(std::env::var_os("BARYMAP_REQUIRE_GPU").is_none(), "there is no adapter");
        println!("not run: there is no adapter");
        return;
    }
    let f = Folder::empty();
    f.run("demo --size 256 --backend cpu").succeeds();
    check(&f, &format!("{TRANSFER} --backend gpu --size 2048"), true);
}

#[test]
#[cfg(target_os = "linux")]
fn an_embedding_stays_within_the_limit() {
    let f = Folder::empty();
    write_obj(&uv_sphere(1.0, 400, 190), f.path("s.obj")).unwrap();
    check(&f, "embed s.obj -o e.npy", false);
}

#[test]
#[cfg(target_os = "linux")]
fn a_warp_stays_within_the_limit() {
    let f = Folder::empty();
    write_image(&noise(4000, 3000), f.path("big.bmp")).unwrap();
    f.write(
        "cage.json",
        r#"{"units": "unit", "source": [[0, 0], [1.3, 0], [1.3, 1], [0, 1]], "target": [[0, 0], [1.2, 0.1], [1.3, 0.9], [0.1, 1]]}"#,
    );
    check(&f, "warp big.bmp --cage cage.json -o w.png --backend cpu", false);
}

#[test]
#[cfg(target_os = "linux")]
fn pictures_that_do_not_fit_are_refused_before_they_are_decoded() {
    let f = Folder::spheres();
    // Black: 288 MB in a file of less than one.
    write_image(&Image::zeros(12_000, 8000, 3, barymap::picture::Depth::U8).unwrap(), f.path("black.png")).unwrap();
    f.write("cage.json", r#"{"source": [[0, 0], [9, 0], [9, 9]], "target": [[0, 0], [8, 0], [9, 9]]}"#);
    for command in [
        "warp black.png --cage cage.json -o o.png",
        "transfer --source s.obj --target t.obj --texture black.png --anchors a.json -o o.png",
    ] {
        let ran = f.run(&format!("{command} --backend cpu --memory 500M"));
        ran.fails_like(1, &["black.png", "12000 x 8000", "524288000 are allowed", "--memory"]);
        assert!(ran.peak_memory.is_none_or(|peak| peak < 100 * MIB), "{:?}", ran.peak_memory);
    }
}

#[test]
#[cfg(target_os = "linux")]
fn very_many_pairs_are_refused_under_the_default_limit() {
    let f = Folder::spheres();
    f.anchors("many.json", 20_000, |p| p);
    for command in [
        "map --source s.obj --target t.obj --anchors many.json --method rbf -o m.csv",
        "map --source s.obj --target t.obj --anchors many.json --method field -o m.csv",
    ] {
        let ran = f.run(&format!("{command} --backend cpu --no-cache"));
        let fault = fault(&ran, 4096, false);
        assert!(fault.is_none() && ran.code == Some(1), "{command}: {:?} {fault:?} {}", ran.code, ran.stderr);
    }
}

/// The chunks of a PNG file with this name, joined.
fn chunks(png: &[u8], name: &[u8; 4]) -> Vec<u8> {
    let (mut found, mut at) = (Vec::new(), 8);
    while at < png.len() {
        let length = u32::from_be_bytes(png[at..at + 4].try_into().unwrap()) as usize;
        if png[at + 4..at + 8] == *name {
            found.extend_from_slice(&png[at + 8..at + 8 + length]);
        }
        at += 12 + length;
    }
    found
}

#[test]
#[cfg(target_os = "linux")]
fn a_profile_that_unpacks_to_very_much_is_refused_with_the_number() {
    let f = Folder::spheres();
    // The packed pixels of a black picture are a profile of 256 MB.
    write_image(&Image::zeros(16_000, 16_000, 1, barymap::picture::Depth::U8).unwrap(), f.path("black.png")).unwrap();
    let packed = chunks(&f.bytes("black.png"), b"IDAT");
    let mut chunk = [b"iCCPbomb\0\0", packed.as_slice()].concat();
    let (length, checksum) = ((chunk.len() - 4) as u32, crc32fast::hash(&chunk));
    chunk.splice(0..0, length.to_be_bytes());
    chunk.extend_from_slice(&checksum.to_be_bytes());
    let mut png = f.bytes("s.png");
    png.splice(33..33, chunk);
    std::fs::write(f.path("bomb.png"), png).unwrap();
    f.write("cage.json", r#"{"source": [[0, 0], [9, 0], [9, 9]], "target": [[0, 0], [8, 0], [9, 9]]}"#);
    for command in ["warp bomb.png --cage cage.json -o o.png", "render s.obj --texture bomb.png -o o.png"] {
        let ran = f.run(&format!("{command} --backend cpu --memory 250M"));
        // A row of the black picture begins with a byte for its filter.
        let unpacked = (16_000 * 16_001).to_string();
        ran.fails_like(1, &["bomb.png", "colour profile", &unpacked, "33554432 are allowed"]);
        assert!(ran.peak_memory.is_some_and(|peak| peak < 150 * MIB), "{:?}", ran.peak_memory);
    }
}
