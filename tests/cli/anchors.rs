//! `barymap anchors` end to end.

use barymap::geometry::SurfacePoint;
use barymap::models::character_pair;
use serde_json::{Value, json};

use crate::support::Folder;

/// The two built-in characters, with `count` true pairs, in which the sources of the pairs in
/// `exchanged` are swapped.
fn characters(count: usize, exchanged: Option<(usize, usize)>) -> Folder {
    let f = Folder::empty();
    let pair = character_pair();
    barymap::io::write_obj(&pair.source.mesh, f.path("s.obj")).unwrap();
    barymap::io::write_obj(&pair.target.mesh, f.path("t.obj")).unwrap();
    let (mut source, target) = pair.anchors(count);
    if let Some((i, j)) = exchanged {
        source.swap(i, j);
    }
    let entries = |points: &[SurfacePoint]| -> Value {
        points.iter().map(|p| json!({"face": p.face, "barycentric": p.barycentric})).collect()
    };
    f.write("a.json", &json!({"source": entries(&source), "target": entries(&target)}).to_string());
    f
}

#[test]
fn a_full_set_is_written_and_read_again() {
    let f = characters(8, None);
    f.run("anchors s.obj t.obj --anchors a.json --count 20 -o full.json --report r.json --picture p.png --suggest 3 --landmarks 400").succeeds();
    let (full, report) = (f.json("full.json"), f.json("r.json"));
    let pairs = full["pairs"].as_array().unwrap();
    assert!(pairs.len() > 8 && pairs.len() <= 20, "{full}");
    for key in ["source", "target"] {
        assert_eq!(full[key].as_array().unwrap().len(), pairs.len());
    }
    assert!(pairs[..8].iter().all(|p| p["origin"] == "given") && pairs[8]["origin"] != "given");
    assert_eq!(report["command"], "anchors");
    assert_eq!(report["pairs"].as_array().unwrap().len(), pairs.len());
    assert_eq!(report["suggestions"].as_array().unwrap().len(), 3);
    assert!(report["suggestions"][0]["target"]["vertex"].is_u64());
    assert!(f.image("p.png").width > 1600);
    // Other commands read the file; nothing is said of the pairs.
    f.run("map --source s.obj --target t.obj --anchors full.json -o m.csv --method rbf").succeeds();
    // Again: the same bytes.
    let first = f.read("full.json");
    f.run("anchors s.obj t.obj --anchors a.json --count 20 -o full.json --landmarks 400").succeeds();
    assert_eq!(f.read("full.json"), first);
}

#[test]
fn a_common_connectivity_is_used_unless_it_is_to_be_ignored() {
    let f = characters(8, None);
    // The target becomes the source, taller: the same triangles.
    let mut copy = character_pair().source.mesh;
    copy.positions.iter_mut().for_each(|p| p.y *= 1.2);
    barymap::io::write_obj(&copy, f.path("t.obj")).unwrap();
    let source = f.json("a.json")["source"].clone();
    f.write("a.json", &json!({"source": source, "target": source}).to_string());
    let origins = |more: &str| -> Vec<String> {
        let line = format!("anchors s.obj t.obj --anchors a.json --count 20 -o full.json --landmarks 400 {more}");
        let ran = f.run(&line).succeeds();
        assert_eq!(ran.stderr.contains("the same connectivity"), more.is_empty(), "{}", ran.stderr);
        let pairs = f.json("full.json")["pairs"].clone();
        pairs.as_array().unwrap()[8..].iter().map(|p| p["origin"].as_str().unwrap().to_owned()).collect()
    };
    let (same, by_shape) = (origins(""), origins("--ignore-connectivity"));
    assert!(same.len() == 12 && same.iter().all(|o| o == "connectivity"), "{same:?}");
    assert!(!by_shape.is_empty() && by_shape.iter().all(|o| o == "relief"), "{by_shape:?}");
}

#[test]
fn contradictory_pairs_are_named_flagged_and_left_out() {
    let f = characters(30, Some((7, 19)));
    let run = |more: &str| {
        f.run(&format!("anchors s.obj t.obj --anchors a.json --check --landmarks 400 -o c.json --report r.json {more}"))
    };
    let ran = run("").succeeds();
    assert!(ran.stderr.contains("pair 7 ") && ran.stderr.contains("pair 19 "), "{}", ran.stderr);
    let named: Vec<u64> =
        f.json("r.json")["outliers"].as_array().unwrap().iter().map(|o| o["pair"].as_u64().unwrap()).collect();
    assert!(named.contains(&7) && named.contains(&19) && named.len() <= 3, "{named:?}");
    let pairs = &f.json("c.json")["pairs"];
    assert_eq!(pairs.as_array().unwrap().len(), 30);
    assert!(pairs[7]["flagged"].is_string() && pairs[0]["flagged"].is_null(), "{pairs}");
    run("--drop-outliers").succeeds();
    assert_eq!(f.json("c.json")["source"].as_array().unwrap().len(), 30 - named.len());
}

#[test]
fn pairs_none_of_which_can_be_trusted_are_written_by_force_only() {
    // Left and right of a figure may be exchanged, and nobody says which is which.
    let f = characters(8, None);
    let command = "anchors s.obj t.obj -o o.json";
    let before = f.names();
    let ran = f.run(command);
    ran.fails(3, &["all ", "are doubtful", "no file is written", "--force"]);
    assert_eq!(f.names(), before);
    let ran = f.run(&format!("{command} --force")).succeeds();
    let pairs = f.json("o.json")["pairs"].clone();
    let pairs = pairs.as_array().unwrap();
    assert!(!pairs.is_empty() && pairs.iter().all(|p| p["flagged"].is_string()), "{pairs:?}");
    assert!(ran.stdout.contains("not usable, because 100.0 % of the pairs are doubtful"), "{}", ran.stdout);
}

#[test]
fn what_cannot_be_done_is_said() {
    let f = Folder::spheres();
    let before = f.names();
    // A sphere has no limbs.
    f.run("anchors s.obj t.obj -o o.json --landmarks 100").fails(3, &["limbs", "--anchors"]);
    f.run("anchors s.obj t.obj").fails(2, &["--suggest"]);
    f.run("anchors s.obj t.obj -o o.json --count 0 --anchors a.json --landmarks 100").fails(2, &["--count"]);
    f.run("anchors s.obj t.obj -o o.json --count 99999999 --anchors a.json --landmarks 100").fails(2, &["--count"]);
    f.run("anchors s.obj t.obj --suggest 99999999 --anchors a.json").fails(2, &["--suggest"]);
    f.run("anchors s.obj missing.obj -o o.json").fails(1, &["missing.obj"]);
    f.run("anchors s.obj t.obj --anchors a.json --suggest 1 --picture p.txt").fails(2, &["p.txt"]);
    assert_eq!(f.names(), before);
    assert_eq!(f.run("anchors s.obj t.obj --check -o o.json").code, Some(2));
}

#[test]
fn poor_seeds_give_a_result_or_clear_words() {
    let f = Folder::spheres();
    for seeds in [
        r#"{"source": [0], "target": [0]}"#,
        r#"{"source": [0, 0, 0], "target": [5, 6, 7]}"#,
        r#"{"source": [0, 10, 150, 200, 361, 20, 90, 120], "target": [0, 0, 200, 280, 511, 3, 3, 3]}"#,
    ] {
        f.write("x.json", seeds);
        let ran = f.run("anchors s.obj t.obj --anchors x.json --count 12 -o o.json --suggest 2 --landmarks 100");
        assert!(matches!(ran.code, Some(0 | 1)), "{seeds}: {ran:?}");
        if ran.code == Some(1) {
            ran.message();
        }
    }
    // More places than there are vertices: as many as there are.
    f.run("anchors s.obj t.obj --anchors a.json --check --suggest 1000 --report r.json --landmarks 100").succeeds();
    let count = f.json("r.json")["suggestions"].as_array().unwrap().len();
    assert!(count > 100 && count < 1000, "{count}");
}

#[test]
fn parts_that_cannot_be_paired_are_named() {
    let f = Folder::spheres();
    // Two tetrahedra against one sphere.
    f.write(
        "two.obj",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 5 0 0\nv 6 0 0\nv 5 1 0\nv 5 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\nf 5 7 6\nf 5 6 8\nf 5 8 7\nf 6 7 8\n",
    );
    f.run("anchors s.obj two.obj -o o.json --landmarks 100").fails(3, &["components", "--anchors"]);
}
