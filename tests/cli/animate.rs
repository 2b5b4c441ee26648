//! `barymap animate` end to end: a walking body driven by markers on it.

use std::fmt::Write;
use std::path::PathBuf;

use barymap::geometry::sampling::farthest_points;
use barymap::geometry::{Geodesics, Mesh};
use barymap::io::{read_mesh, write_obj};
use barymap::models::Walker;
use glam::DVec3;
use serde_json::json;

use crate::support::Folder;

/// 40 vertices far from one another.
fn markers(mesh: &Mesh) -> Vec<usize> {
    let geodesics = Geodesics::new(&mesh.positions, &mesh.triangles()).unwrap();
    farthest_points(&geodesics, 0, 40).into_iter().map(|v| v as usize).collect()
}

/// `body.obj`, 40 markers on it by name in `m.json`, and `walk.csv`: `frames` frames at 30 a
/// second, in centimetres, z up. `cell` may change what is seen.
fn walk(frames: usize, cell: impl Fn(usize, usize, DVec3) -> Option<DVec3>) -> (Folder, Walker) {
    let folder = Folder::empty();
    let walker = Walker::new(0.04);
    write_obj(&walker.mesh, folder.path("body.obj")).unwrap();
    let vertices = markers(&walker.mesh);
    let places: serde_json::Map<String, serde_json::Value> =
        vertices.iter().enumerate().map(|(k, v)| (format!("M{k}"), json!(v))).collect();
    folder.write("m.json", &serde_json::Value::Object(places).to_string());
    let mut text = String::from("time");
    for k in 0..40 {
        write!(text, ",M{k}.x,M{k}.y,M{k}.z").unwrap();
    }
    for f in 0..frames {
        let shape = walker.positions(f as f64 / 30.0, (f as f64 / 15.0).min(1.0));
        write!(text, "\n{}", f as f64 / 30.0).unwrap();
        for (k, &v) in vertices.iter().enumerate() {
            let p = shape[v] * 100.0;
            match cell(f, k, DVec3::new(p.x, -p.z, p.y)) {
                Some(p) => write!(text, ",{},{},{}", p.x, p.y, p.z).unwrap(),
                None => text.push_str(",,,"),
            }
        }
    }
    folder.write("walk.csv", &text);
    (folder, walker)
}

#[test]
fn markers_set_a_body_walking() {
    let (f, walker) = walk(40, |_, _, p| Some(p));
    f.run("animate body.obj --motion walk.csv --markers m.json --reference 0 -o walk.glb --report r.json").succeeds();
    let report = f.json("r.json");
    assert_eq!((report["frames"].as_u64(), report["bound_vertices"].as_u64()), (Some(40), Some(40)));
    assert!(report["found_anew"].as_array().unwrap().is_empty(), "{report}");
    assert!(report["fit_rms"].as_f64().unwrap() < 1e-9);
    let (document, _, _) = gltf::import(f.path("walk.glb")).unwrap();
    assert_eq!(document.animations().count(), 1);
    f.run("animate body.obj --motion walk.csv --markers m.json --reference 0 --stiffness 1 -o out --sheet s.png")
        .succeeds();
    // The body that was measured is known: its markers are met, and the rest is near.
    let truth = walker.positions(39.0 / 30.0, 1.0);
    let made = read_mesh(f.path("out/frame_0039.obj")).unwrap().mesh.positions;
    let off: Vec<f64> = truth.iter().zip(&made).map(|(p, q)| p.distance(*q)).collect();
    assert!(markers(&walker.mesh).iter().all(|&v| off[v] < 1e-9));
    let rms = (off.iter().map(|d| d * d).sum::<f64>() / off.len() as f64).sqrt();
    println!("rms from the true body {rms} m");
    assert!(rms < 0.03, "{rms}");
    assert!(f.image("s.png").width > 360);
    for quality in ["preview", "fine"] {
        f.run(&format!("animate body.obj --motion walk.csv --markers m.json --reference 0 --end 3 --quality {quality} -o {quality}.glb"))
            .succeeds();
    }
}

#[test]
fn parts_of_a_clip_are_those_of_the_whole() {
    let (f, _) = walk(12, |_, _, p| Some(p));
    let command = "animate body.obj --motion walk.csv --markers m.json --reference 0 --format ply";
    f.run(&format!("{command} -o whole")).succeeds();
    f.run(&format!("{command} --range 5..8 -o part")).succeeds();
    let names = |folder: &str| -> Vec<String> {
        let entries = std::fs::read_dir(f.path(folder)).unwrap();
        let mut names: Vec<String> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    };
    assert_eq!(names("part"), ["frame_0005.ply", "frame_0006.ply", "frame_0007.ply"]);
    let mut all = Vec::new();
    for shard in 1..=3 {
        f.run(&format!("{command} --shard {shard}/3 -o s{shard}")).succeeds();
        all.extend(names(&format!("s{shard}")).into_iter().map(|name| format!("s{shard}/{name}")));
    }
    all.extend(names("part").into_iter().map(|name| format!("part/{name}")));
    assert_eq!(all.len(), 15);
    for name in all {
        let whole = format!("whole/{}", name.split_once('/').unwrap().1);
        assert!(f.bytes(&name) == f.bytes(&whole), "{name}");
    }
    f.run(&format!("{command} --range 5..8 --quality fine -o fine")).succeeds();
    f.run(&format!("{command} --range 5..13 -o bad")).fails(2, &["range", "12 frames"]);
    for wrong in ["--range 5..5", "--range 5", "--shard 0/3", "--shard 1/3 --range 0..1"] {
        assert_eq!(f.run(&format!("{command} {wrong} -o bad")).code, Some(2), "{wrong}");
    }
    f.run(&format!("{command} --shard 1/13 -o bad")).fails(2, &["shard", "12 frames"]);
    assert!(!f.path("bad").exists());
}

#[test]
fn markers_that_stand_still_do_not_jitter_and_gaps_are_closed() {
    let (f, _) = walk(12, |frame, k, p| {
        // Marker 7 is hidden for a while, marker 9 from the beginning.
        let hidden = (k == 7 && (4..9).contains(&frame)) || (k == 9 && frame < 3);
        (!hidden).then_some(p)
    });
    let text = f.read("walk.csv");
    let lines: Vec<&str> = text.lines().collect();
    // Frame 11 three times more, at later times.
    let tail = lines[12].split_once(',').unwrap().1;
    let still: Vec<String> = (12..15).map(|k| format!("{},{tail}", f64::from(k) / 30.0)).collect();
    f.write("walk.csv", &format!("{text}\n{}", still.join("\n")));
    let ran = f.run("animate body.obj --motion walk.csv --markers m.json --reference 5 -o out").fails(1, &["M7"]);
    assert!(ran.message().contains("reference"));
    let ran = f.run("animate body.obj --motion walk.csv --markers m.json --reference 10 -o out").succeeds();
    assert!(ran.stderr.contains("M7") && ran.stderr.contains("M9"), "{}", ran.stderr);
    let last = f.bytes("out/frame_0011.obj");
    for k in 12..15 {
        assert!(f.bytes(&format!("out/frame_00{k}.obj")) == last, "frame {k}");
    }
    assert!(f.bytes("out/frame_0010.obj") != last);
    // The number of threads changes nothing.
    let command = "animate body.obj --motion walk.csv --markers m.json --reference 10 -o one";
    f.run_with(command, &[("RAYON_NUM_THREADS", "1")]).succeeds();
    assert!(f.bytes("one/frame_0011.obj") == last);
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn every_bad_mesh_and_every_cut_clip_gives_a_result_or_a_clear_message() {
    let (f, _) = walk(3, |_, _, p| Some(p));
    let data = PathBuf::from(std::env::var("BARYMAP_DATA").unwrap());
    let mut files: Vec<PathBuf> = std::fs::read_dir(data.join("bad")).unwrap().map(|e| e.unwrap().path()).collect();
    files.retain(|path| path.extension().is_some_and(|e| e != "png"));
    files.sort();
    assert!(files.len() >= 14, "{} bad meshes", files.len());
    f.write("h.json", r#"{"handles": [{"vertex": 0, "position": [0, 0, 0]}, {"vertex": 1, "position": [1, 0, 0]}, {"vertex": 2, "position": [0, 1, 0]}]}"#);
    f.write("few.json", r#"{"M0": 0, "M1": 1, "M2": 2, "M3": 3}"#);
    let before = f.names();
    let check = |command: &str, outputs: &[&str]| {
        let ran = f.run(command);
        match ran.code {
            Some(0) => {}
            Some(1) => {
                ran.message();
                assert_eq!(f.names(), before, "{command}: something is left behind");
            }
            _ => panic!("{command}: {ran:?}"),
        }
        outputs.iter().for_each(|output| drop(std::fs::remove_file(f.path(output))));
        // Materials stand beside an OBJ.
        drop(std::fs::remove_file(f.path("o.mtl")));
        assert_eq!(f.names(), before, "{command}: something is left behind");
        ran.code == Some(0)
    };
    for file in &files {
        let name = file.display();
        check(&format!("deform {name} --handles h.json -o o.obj"), &["o.obj"]);
        check(&format!("morph {name} {name} -o o.glb --frames 2"), &["o.glb"]);
        check(&format!("morph body.obj {name} -o o.glb --frames 2"), &["o.glb"]);
        check(&format!("animate {name} --motion walk.csv --markers few.json --reference 0 -o o.glb"), &["o.glb"]);
        check(&format!("animate {name} --motion walk.csv --reference 0 -o o.glb"), &["o.glb"]);
    }
    // Clips cut in the middle: what is there, or a message that names the file.
    for clip in ["qualisys_walk.c3d", "movement_trial.c3d", "cmu_01_01.bvh", "mh_walk1.bvh", "cmu_11_01.amc"] {
        let bytes = std::fs::read(data.join("mocap").join(clip)).unwrap();
        let cut = format!("cut.{}", clip.rsplit('.').next().unwrap());
        for length in [0, 100, 700, bytes.len() / 3] {
            std::fs::write(f.path(&cut), &bytes[..length]).unwrap();
            let ran = f.run(&format!("animate body.obj --motion {cut} --end 2 --quality preview -o o.glb"));
            assert!(matches!(ran.code, Some(0 | 1)), "{clip} cut at {length}: {ran:?}");
            if ran.code == Some(1) {
                assert!(ran.message().contains("cut."), "{clip} cut at {length}: {}", ran.message());
            }
            assert!(ran.code == Some(1) || length > 700, "{clip} cut at {length} is no clip");
            let _ = std::fs::remove_file(f.path("o.glb"));
            std::fs::remove_file(f.path(&cut)).unwrap();
        }
    }
}

#[test]
fn clips_and_bindings_that_cannot_be_used_are_told() {
    let (f, _) = walk(6, |_, k, p| (k != 5).then_some(p));
    let fails = |command: &str, words: &[&str]| {
        f.run(&format!("animate body.obj {command} -o out.glb")).fails(1, words);
    };
    // A marker that is never seen, and a binding without it.
    fails("--motion walk.csv --markers m.json --reference 0", &["M5"]);
    fails("--motion gone.csv --markers m.json", &["gone.csv"]);
    f.write("cut.csv", &f.read("walk.csv")[..300]);
    assert_eq!(f.run("animate body.obj --motion cut.csv --markers m.json -o out.glb").code, Some(1));
    f.write("far.json", r#"{"M0": 0, "M1": 99999, "M2": 7}"#);
    fails("--motion walk.csv --markers far.json", &["M1", "99999"]);
    f.write("two.json", r#"{"M0": 0, "M1": 9}"#);
    fails("--motion walk.csv --markers two.json", &["three markers"]);
    f.write("name.json", r#"{"M0": 0, "M1": 9, "NOSE": 12, "M3": 30}"#);
    fails("--motion walk.csv --markers name.json", &["NOSE"]);
    f.write("empty.json", "{}");
    assert_eq!(f.run("animate body.obj --motion walk.csv --markers empty.json -o out.glb").code, Some(1));
    // Truncated and damaged files of every kind.
    f.write("t.bvh", "HIERARCHY\nROOT hips\n{\n OFFSET 0 0 0\n CHANNELS 3 Xrotation Yrotation Zrotation\n");
    fails("--motion t.bvh", &["t.bvh"]);
    std::fs::write(f.path("t.c3d"), [2u8, 0x50, 1, 0, 9, 9]).unwrap();
    fails("--motion t.c3d", &["t.c3d"]);
    f.write("t.trc", "PathFileType\t4\n");
    fails("--motion t.trc", &["t.trc"]);
    f.write("t.amc", ":FULLY-SPECIFIED\n1\nroot 0 0 0\n");
    assert_eq!(f.run("animate body.obj --motion t.amc -o out.glb").code, Some(1));
    assert_eq!(f.run("animate body.obj --motion walk.csv --stiffness -1 -o out.glb").code, Some(2));
    for tolerance in ["nan", "inf", "-1"] {
        let ran =
            f.run(&format!("animate body.obj --motion walk.csv --markers m.json --tolerance={tolerance} -o out.glb"));
        ran.fails(2, &["--tolerance"]);
    }
    assert!(!f.path("out.glb").exists());
}

#[test]
fn a_take_of_motive_moves_as_the_plain_table_does() {
    let (f, _) = walk(4, |frame, k, p| (k != 7 || frame != 2).then_some(p));
    let text = f.read("walk.csv");
    let row = |cell: &dyn Fn(usize) -> String| (0..120).map(cell).collect::<Vec<_>>().join(",");
    let axis = |k: usize| ["X", "Y", "Z"][k % 3].to_owned();
    let mut take = String::from(
        "Format Version,1.25,Take Name,walk,Capture Frame Rate,240,Export Frame Rate,30,Length Units,Centimeters\r\n\r\n",
    );
    for (word, cell) in [
        ("Type", &|_: usize| "Marker".to_owned()),
        ("Name", &|k: usize| format!("Anna:M{}", k / 3)),
        ("ID", &|k: usize| (k / 3).to_string()),
        ("", &|_: usize| "Position".to_owned()),
    ] as [(&str, &dyn Fn(usize) -> String); 4]
    {
        write!(take, ",{word},{}\r\n", row(cell)).unwrap();
    }
    write!(take, "Frame,Time (Seconds),{}\r\n", row(&axis)).unwrap();
    for (k, line) in text.lines().skip(1).enumerate() {
        write!(take, "{k},{line}\r\n").unwrap();
    }
    f.write("take.csv", &take);
    for (clip, out) in [("walk.csv", "plain"), ("take.csv", "motive")] {
        f.run(&format!("animate body.obj --motion {clip} --markers m.json --reference 0 --quality preview -o {out}"))
            .succeeds();
    }
    for frame in 0..4 {
        let name = format!("frame_000{frame}.obj");
        assert_eq!(f.bytes(&format!("plain/{name}")), f.bytes(&format!("motive/{name}")), "{name}");
    }
}
