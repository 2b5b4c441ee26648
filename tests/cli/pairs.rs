//! Anchors that do not fit, and anchors that are poor but possible.

use crate::support::{Folder, Ran};

const TRANSFER: &str =
    "transfer --backend cpu --source s.obj --target t.obj --texture s.png --size 32 -o o.png --anchors";

fn with(f: &Folder, anchors: &str) -> Ran {
    f.write("x.json", anchors);
    f.run(&format!("{TRANSFER} x.json"))
}

#[test]
fn anchors_that_do_not_fit_are_refused() {
    let f = Folder::spheres();
    let before = f.names().len() + 1;
    for (anchors, words) in [
        (r#"{"source": [0, 1, 99999], "target": [0, 1, 2]}"#, ["99999", "source"]),
        (r#"{"source": [0, 1, 2], "target": [0, 1, 99999]}"#, ["99999", "target"]),
        (r#"{"source": [0, 1, 2], "target": [0, 1]}"#, ["3", "2"]),
        (r#"{"source": [], "target": []}"#, ["x.json", "anchor"]),
        (r#"{"source": [-1, 1, 2], "target": [0, 1, 2]}"#, ["x.json", "-1"]),
        (r#"{"source": [0.5, 1, 2], "target": [0, 1, 2]}"#, ["x.json", "0.5"]),
        (r#"{"source": [{"position": [0, 1]}], "target": [0]}"#, ["x.json", "position"]),
        (r#"{"source": [{"position": [1e999, 1, 0]}], "target": [0]}"#, ["x.json", ""]),
        (r#"{"source": [{"position": [NaN, 1, 0]}], "target": [0]}"#, ["x.json", ""]),
        (r#"{"source": [{"face": 7, "barycentric": [2, -1, 0]}], "target": [0]}"#, ["source", "barycentric"]),
        (r#"{"source": [{"face": 99999, "barycentric": [1, 0, 0]}], "target": [0]}"#, ["source", "99999"]),
        (r#"{"source": 5}"#, ["x.json", ""]),
        ("not anchors", ["x.json", "line 1"]),
        ("0 0\n1 1 1\n", ["x.json", "line 2"]),
        ("0 0\n1 99999\n", ["99999", ""]),
        ("", ["x.json", ""]),
    ] {
        with(&f, anchors).fails(1, &words);
        assert_eq!(f.names().len(), before, "{anchors}: {:?}", f.names());
    }
    f.run(&format!("{TRANSFER} missing.json")).fails(1, &["missing.json"]);
    f.run(&format!("{TRANSFER} s.vts,missing.vts")).fails(1, &[".vts"]);
}

#[test]
fn poor_anchors_give_a_result_and_a_word_about_it() {
    let f = Folder::spheres();
    for (anchors, word) in [
        (r#"{"source": [0], "target": [0]}"#, "anchor"),
        (r#"{"source": [0, 361], "target": [0, 511]}"#, "anchors"),
        // The same place twice, and twice with different partners.
        (r#"{"source": [0, 0, 150, 200, 361], "target": [0, 0, 200, 280, 511]}"#, "coincide"),
        (r#"{"source": [0, 10, 150, 200, 361], "target": [0, 0, 200, 280, 511]}"#, "coincide"),
    ] {
        let ran = with(&f, anchors).succeeds();
        assert!(ran.stderr.contains("note: ") && ran.stderr.contains(word), "{anchors}: {}", ran.stderr);
        assert!(f.path("o.png").exists());
    }
    // Along one meridian: nothing says where the sides go.
    let meridian = r#"{"source": [1, 49, 97, 145, 193, 241], "target": [1, 61, 121, 181, 241, 301]}"#;
    with(&f, meridian).succeeds();
    for method in ["averages", "rbf", "closest"] {
        for anchors in [meridian, r#"{"source": [0], "target": [0]}"#, r#"{"source": [0, 0, 0], "target": [5, 5, 5]}"#]
        {
            f.write("x.json", anchors);
            let ran = f.run(&format!("{TRANSFER} x.json --method {method}"));
            assert!(matches!(ran.code, Some(0 | 1)), "{method} {anchors}: {ran:?}");
            if ran.code == Some(1) {
                ran.message();
            }
        }
    }
}

#[test]
fn text_and_paired_files_mean_the_same() {
    let f = Folder::spheres();
    let json = r#"{"source": [0, 40, 150, 200, 361], "target": [0, 60, 200, 280, 511]}"#;
    with(&f, json).succeeds();
    let expected = f.bytes("o.png");
    with(&f, "0 0\n40 60\n150 200\n200 280\n361 511\n").succeeds();
    assert_eq!(f.bytes("o.png"), expected);
    f.write("s.vts", "0 1 0 0\n40\n150\n200\n361\n");
    f.write("t.vts", "0 0 0 1\n60\n200\n280\n511\n");
    f.run(&format!("{TRANSFER} s.vts,t.vts")).succeeds();
    assert_eq!(f.bytes("o.png"), expected);
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn parts_without_an_anchor_are_named() {
    let f = Folder::spheres();
    let knight = std::path::Path::new(&std::env::var("BARYMAP_DATA").unwrap()).join("textured/knight/knight.obj");
    f.write("x.json", r#"{"source": [0, 40, 150, 200, 361], "target": [0, 10, 20, 30, 40]}"#);
    let run = |method: &str| {
        f.run(&format!(
            "transfer --backend cpu --source s.obj --texture s.png --target {} --size 64 -o o.png --anchors x.json --method {method} --report r.json",
            knight.display()
        ))
    };
    for method in ["transport", "averages", "rbf", "closest"] {
        let ran = run(method).succeeds();
        assert!(
            ran.stderr.contains("component") && ran.stderr.contains("without an anchor"),
            "{method}: {}",
            ran.stderr
        );
    }
}
