//! `warp` and `warp-points` end to end: pictures, points and outlines, and everything that cannot
//! be used.

use barymap::picture::{Depth, Image};
use serde_json::{Value, json};

use crate::support::{Folder, waves};

/// The corner of a square moves in: folds in one step, not in several.
fn corner(size: f64, to: f64) -> Value {
    json!({"source": [[0, 0], [size, 0], [size, size], [0, size]], "target": [[0, 0], [size, 0], [to, to], [0, size]]})
}

fn folder() -> Folder {
    let f = Folder::empty();
    barymap::io::write_image(&waves(64), f.path("p.png")).unwrap();
    f.write("c.json", &corner(64.0, 16.0).to_string());
    f
}

const WARP: &str = "warp p.png --backend cpu --cage c.json -o o.png";
const POINTS: &str = "warp-points p.csv --backend cpu --cage c.json";

#[test]
fn a_picture_is_bent_without_folds_and_the_report_says_so() {
    let f = folder();
    let ran = f.run(&format!("{WARP} --report r.json --heatmap h.png --grid g.png --overlay v.png")).succeeds();
    assert!(ran.stdout.contains("bijective: sampled"), "{ran:?}");
    let (out, r) = (f.image("o.png"), f.json("r.json"));
    assert_eq!((out.width, out.height, out.channels, out.depth()), (64, 64, 3, Depth::U8));
    assert_eq!((r["command"].as_str(), r["bijective"].as_str()), (Some("warp"), Some("sampled")));
    let (knots, steps) = (r["partition"].as_array().unwrap(), r["steps"].as_array().unwrap());
    assert!(knots.len() == steps.len() + 1 && knots[0] == 0.0 && knots[knots.len() - 1] == 1.0);
    for (k, step) in steps.iter().enumerate() {
        assert!(step["j_min"].as_f64().unwrap() > 0.0 && step["from"] == knots[k] && step["to"] == knots[k + 1]);
        assert!(step["at"].as_array().unwrap().len() == 2 && step.get("lower_bound").is_none());
        assert!(["interior", "edge", "vertex"].contains(&step["kind"].as_str().unwrap()));
    }
    assert_eq!(r["sufficient_bound"]["sampled"], true);
    assert!(r["seconds_per_frame"].as_f64().unwrap() >= 0.0 && r["failed"]["inside"] == 0);
    for name in ["h.png", "g.png", "v.png"] {
        assert!(f.image(name).height == 64, "{name}");
    }
    // Two edges of the square stay where they are, and beyond the corner there is nothing of the
    // picture.
    assert!((out.get(0, 32, 0) - waves(64).get(0, 32, 0)).abs() < 0.06);
    assert!(out.get(10, 10, 0) > 0.0 && out.get(40, 40, 0) == 0.0);
}

#[test]
fn the_same_input_gives_the_same_bytes() {
    let f = folder();
    f.run(&format!("{WARP} --quiet")).succeeds();
    let first = f.bytes("o.png");
    f.run_with(&format!("{WARP} --quiet"), &[("RAYON_NUM_THREADS", "1")]).succeeds();
    assert_eq!(first, f.bytes("o.png"));
    f.write("p.csv", "x,y\n0.1,0.2\n30,40\n");
    f.run(&format!("{POINTS} -o q.csv --quiet")).succeeds();
    let first = f.bytes("q.csv");
    f.run_with(&format!("{POINTS} -o q.csv --quiet"), &[("RAYON_NUM_THREADS", "1")]).succeeds();
    assert_eq!(first, f.bytes("q.csv"));
}

#[test]
fn folds_are_said_aloud_and_refused_if_strict() {
    let f = folder();
    let ran = f.run(&format!("{WARP} --partition direct --report r.json")).succeeds();
    assert!(ran.stderr.contains("the map folds"), "{ran:?}");
    assert_eq!(f.json("r.json")["bijective"], "failed");
    assert!(f.path("o.png").exists());
    std::fs::remove_file(f.path("o.png")).unwrap();
    let strict = format!("{WARP} --partition direct --strict --report s.json");
    f.run(&strict).fails(1, &["folds", "--strict"]);
    assert_eq!(f.json("s.json")["bijective"], "failed");
    assert!(!f.path("o.png").exists());
    f.run(&format!("{WARP} --strict")).succeeds();
}

#[test]
fn a_proof_is_told_from_samples() {
    let f = folder();
    f.write("c.json", &corner(64.0, 50.0).to_string());
    f.run(&format!("{WARP} --certify --report r.json")).succeeds();
    let r = f.json("r.json");
    assert_eq!(r["bijective"], "certified");
    let step = &r["steps"][0];
    assert!(step["lower_bound"].as_f64().unwrap() > 0.0 && step["lower_bound"].as_f64() <= step["j_min"].as_f64());
    f.run(&format!("{WARP} --certify --boxes 3 --report r.json")).succeeds();
    assert_eq!(f.json("r.json")["bijective"], "sampled");
    // Along the last path steps may become shorter than eps, which the note and the report say.
    f.write("c.json", &corner(64.0, 16.0).to_string());
    let ran = f.run(&format!("{WARP} --eps 1 --path compatible --report r.json")).succeeds();
    let r = f.json("r.json");
    assert!(ran.stderr.contains("shorter than eps"), "{}", ran.stderr);
    assert!(r["steps_below_eps"].as_u64() > Some(0) && r["shortest_step"].as_f64() < Some(0.5), "{r}");
    assert_eq!((r["eps"].as_f64(), &r["path"]), (Some(1.0), &json!("compatible")));
    f.run(&format!("{WARP} --certify --partition direct --coordinates wachspress")).fails(2, &["--certify"]);
}

#[test]
fn sequences_begin_with_the_picture_itself() {
    let f = folder();
    f.run(&format!("{WARP} --frames 3 --report r.json")).succeeds();
    assert!(!f.path("o.png").exists());
    assert_eq!(f.image("o_0000.png"), waves(64));
    f.run(&format!("{WARP} --quiet")).succeeds();
    assert_eq!(f.bytes("o_0002.png"), f.bytes("o.png"));
    assert_ne!(f.bytes("o_0001.png"), f.bytes("o.png"));
    let frames = f.json("r.json")["frames"].clone();
    assert_eq!((frames.as_array().unwrap().len(), &frames[1]["t"]), (3, &json!(0.5)));
    f.run(&format!("{WARP} --frames 0")).fails(2, &["--frames"]);
    // All of them or none: the last cannot be written, and the first keeps what it was.
    let before = (f.names(), f.bytes("o_0000.png"));
    std::fs::create_dir(f.path("o_0003.png")).unwrap();
    f.run(&format!("{WARP} --frames 4 --filter bilinear --outside transparent")).fails(1, &["o_0003.png"]);
    std::fs::remove_dir(f.path("o_0003.png")).unwrap();
    assert_eq!((f.names(), f.bytes("o_0000.png")), before);
}

#[test]
fn parts_of_a_sequence_are_frames_of_the_whole() {
    let f = folder();
    f.run(&format!("{WARP} --frames 7")).succeeds();
    let name = |k: u32| format!("o_{k:04}.png");
    let whole: Vec<Vec<u8>> = (0..7).map(|k| f.bytes(&name(k))).collect();
    let clear = || (0..7).for_each(|k| drop(std::fs::remove_file(f.path(&name(k)))));
    let kept = |words: &str, wanted: &[u32]| {
        clear();
        f.run(&format!("{WARP} --frames 7 {words} --report r.json")).succeeds();
        for k in 0..7 {
            assert_eq!(f.path(&name(k)).exists(), wanted.contains(&k), "{words} {k}");
            assert!(!wanted.contains(&k) || f.bytes(&name(k)) == whole[k as usize], "{words} {k}");
        }
        assert_eq!(f.json("r.json")["frames"].as_array().unwrap().len(), wanted.len());
    };
    kept("--range 2..4", &[2, 3]);
    kept("--range 5..", &[5, 6]);
    kept("--shard 2/3", &[1, 4]);
    kept("--range ..5 --shard 1/2", &[0, 2, 4]);
    f.run(&format!("{WARP} --frames 7 --range 5..9")).fails(2, &["--range"]);
    f.run(&format!("{WARP} --frames 7 --shard 9/9")).fails(2, &["--shard"]);
    assert_eq!(f.run(&format!("{WARP} --range 1..2")).code, Some(2), "a range of what");
    // What is done stays: the third frame cannot be written.
    clear();
    std::fs::create_dir(f.path(&name(2))).unwrap();
    f.run(&format!("{WARP} --frames 7 --range 0..5")).fails(1, &[&name(2)]);
    assert!(f.bytes(&name(0)) == whole[0] && f.bytes(&name(1)) == whole[1] && !f.path(&name(3)).exists());
}

#[test]
fn every_filter_gives_the_same_bytes_for_any_number_of_threads() {
    let f = folder();
    for filter in ["ewa", "anisotropic", "trilinear", "bilinear", "nearest", "lanczos", "lanczos4"] {
        let with = |threads: &str| {
            let words = format!("{WARP} --filter {filter} --canvas 150x90 --outside keep");
            f.run_with(&words, &[("RAYON_NUM_THREADS", threads)]).succeeds();
            f.bytes("o.png")
        };
        let one = with("1");
        assert!(one == with("2") && one == with("3"), "{filter}");
    }
}

#[test]
fn depths_and_channels_are_kept() {
    let f = folder();
    for (name, channels, depth) in
        [("a.png", 1, Depth::U16), ("b.png", 2, Depth::U8), ("c.tif", 4, Depth::U16), ("d.exr", 3, Depth::F32)]
    {
        let image = waves(64).converted(channels, depth).unwrap();
        barymap::io::write_image(&image, f.path(name)).unwrap();
        for filter in ["ewa", "bilinear", "lanczos"] {
            f.run(&format!("warp {name} --backend cpu --cage c.json -o out-{name} --filter {filter} --outside keep"))
                .succeeds();
            let out = f.image(&format!("out-{name}"));
            assert_eq!((out.channels, out.depth()), (channels, depth), "{name}");
        }
    }
    f.run(&format!("{WARP} --outside transparent --canvas 80x20 --linear-light")).succeeds();
    let out = f.image("o.png");
    assert_eq!((out.width, out.height, out.channels), (80, 20, 4));
    assert_eq!((out.get(79, 5, 3), out.get(20, 5, 3)), (0.0, 1.0));
}

#[test]
fn units_of_the_picture_count_upwards() {
    let f = folder();
    // The same cage: corners of the unit square, y up; the one at the top right moves.
    let unit = json!({"units": "unit", "source": [[0, 0], [1, 0], [1, 1], [0, 1]], "target": [[0, 0], [1, 0], [0.7, 0.8], [0, 1]]});
    let pixel =
        json!({"source": [[0, 64], [64, 64], [64, 0], [0, 0]], "target": [[0, 64], [64, 64], [44.8, 12.8], [0, 0]]});
    for (name, cage) in [("unit", unit), ("pixel", pixel)] {
        f.write("c.json", &cage.to_string());
        f.run(&format!("warp p.png --backend reference --cage c.json -o {name}.png")).succeeds();
    }
    let (u, p) = (f.image("unit.png"), f.image("pixel.png"));
    let worst = (0..u.pixels.len()).map(|i| (u.sample(i) - p.sample(i)).abs()).fold(0.0, f32::max);
    assert!(worst < 1.5 / 255.0, "{worst}");
}

#[test]
fn points_go_there_and_back() {
    let f = folder();
    let mut text = String::from("x,y\n");
    for k in 0..200 {
        text += &format!("{},{}\n", f64::from(k * 37 % 63) + 0.5, f64::from(k * 11 % 61) + 0.25);
    }
    f.write("p.csv", &text);
    f.run(&format!("{POINTS} -o q.csv --jacobian --report r.json")).succeeds();
    assert_eq!((&f.json("r.json")["points"], &f.json("r.json")["failed"]), (&json!(200), &json!(0)));
    let rows = |name: &str| -> Vec<Vec<String>> {
        f.read(name).lines().map(|l| l.split(',').map(str::to_owned).collect()).collect()
    };
    let forward = rows("q.csv");
    assert_eq!(forward[0], ["x", "y", "j", "status"]);
    let points: String = forward[1..].iter().map(|r| format!("{},{}\n", r[0], r[1])).collect();
    f.write("p.csv", &format!("x,y\n{points}"));
    f.run(&format!("{POINTS} -o b.csv --inverse --jacobian")).succeeds();
    for ((there, back), line) in forward[1..].iter().zip(&rows("b.csv")[1..]).zip(text.lines().skip(1)) {
        let number = |t: &str| t.parse::<f64>().unwrap();
        let (x, y) = line.split_once(',').unwrap();
        assert!(
            (number(&back[0]) - number(x)).abs() < 1e-9 && (number(&back[1]) - number(y)).abs() < 1e-9,
            "{line} {back:?}"
        );
        // The Jacobian is the forward one, either way.
        assert!((number(&back[2]) - number(&there[2])).abs() < 1e-6 * number(&there[2]).abs() && back[3] == "ok");
    }
}

#[test]
fn outlines_keep_their_document() {
    let f = folder();
    let feature = json!({"type": "Feature", "properties": {"name": "x", "n": [1, 2.5]}, "geometry":
        {"type": "Polygon", "coordinates": [[[10, 10], [40, 10], [40, 40], [10, 10]]]}});
    f.write("p.geojson", &feature.to_string());
    f.run("warp-points p.geojson --backend cpu --cage c.json -o q.geojson").succeeds();
    let out = f.json("q.geojson");
    assert_eq!(out["properties"], feature["properties"]);
    let ring = out["geometry"]["coordinates"][0].as_array().unwrap();
    assert!(ring.len() == 4 && ring[0] == ring[3] && ring[0] != json!([10, 10]));
    f.run("warp-points p.geojson --backend cpu --cage c.json -o fine.geojson --tolerance 0.01").succeeds();
    assert!(f.json("fine.geojson")["geometry"]["coordinates"][0].as_array().unwrap().len() > 10);
    f.run("warp-points q.geojson --backend cpu --cage c.json -o back.geojson --inverse").succeeds();
    let corner = f.json("back.geojson")["geometry"]["coordinates"][0][1].clone();
    assert!((corner[0].as_f64().unwrap() - 40.0).abs() < 1e-9 && (corner[1].as_f64().unwrap() - 10.0).abs() < 1e-9);

    f.write(
        "p.svg",
        "<svg xmlns=\"http://www.w3.org/2000/svg\"><!-- kept --><path class=\"a\" d=\"M10 10h30v30z\"/></svg>",
    );
    f.run("warp-points p.svg --backend cpu --cage c.json -o q.svg").succeeds();
    let text = f.read("q.svg");
    assert!(text.contains("<!-- kept -->") && text.contains("class=\"a\"") && text.matches('L').count() > 10, "{text}");
    f.run("warp-points p.svg --backend cpu --cage c.json -o q.csv").fails(2, &["--output", "SVG"]);
    f.run("warp-points p.svg --backend cpu --cage c.json -o q.svg --jacobian").fails(2, &["--jacobian"]);
}

#[test]
fn cages_that_cannot_be_used() {
    let f = folder();
    let before = f.names();
    let square = json!([[0, 0], [64, 0], [64, 64], [0, 64]]);
    let cage = |source: &Value, target: &Value| json!({"source": source, "target": target}).to_string();
    for (what, text, words) in [
        ("bow tie", cage(&json!([[0, 0], [64, 64], [64, 0], [0, 64]]), &square), vec!["source", "edge"]),
        ("bow tie target", cage(&square, &json!([[0, 0], [64, 64], [64, 0], [0, 64]])), vec!["target", "edge"]),
        ("two vertices", cage(&json!([[0, 0], [1, 1]]), &json!([[0, 0], [1, 1]])), vec!["loop 0", "three"]),
        ("unequal", cage(&square, &json!([[0, 0], [64, 0], [64, 64]])), vec!["loop 0", "4", "3"]),
        ("repeated", cage(&json!([[0, 0], [64, 0], [64, 0], [0, 64]]), &square), vec!["apart"]),
        ("collinear", cage(&json!([[0, 0], [1, 1], [2, 2]]), &json!([[0, 0], [1, 1], [2, 2]])), vec!["line"]),
        ("mirrored", cage(&square, &json!([[64, 0], [0, 0], [0, 64], [64, 64]])), vec!["mirrored"]),
        (
            "no numbers",
            "{\"source\": [[0,0],[1,null],[1,1]], \"target\": [[0,0],[1,0],[1,1]]}".into(),
            vec!["vertex 1"],
        ),
        ("NaN", "{\"source\": [[0,0],[NaN,0],[1,1]], \"target\": []}".into(), vec!["JSON", "line 1"]),
        (
            "hole outside",
            cage(
                &json!([square, [[100, 100], [110, 100], [100, 110]]]),
                &json!([square, [[100, 100], [110, 100], [100, 110]]]),
            ),
            vec!["outside"],
        ),
        ("empty", String::new(), vec!["JSON"]),
        ("cut", "{\"source\": [[0,0],".into(), vec!["JSON"]),
        ("missing", "{}".into(), vec!["source"]),
    ] {
        f.write("c.json", &text);
        for command in [WARP.to_owned(), format!("{POINTS} -o q.csv")] {
            f.write("p.csv", "x,y\n1,2\n");
            let ran = f.run(&command);
            assert_eq!(ran.code, Some(1), "{what}: {ran:?}");
            for word in words.iter().chain(&["c.json"]) {
                assert!(ran.message().contains(word), "{what}: {word} not in {}", ran.message());
            }
            std::fs::remove_file(f.path("p.csv")).unwrap();
            assert_eq!(f.names(), before, "{what}: nothing is left");
        }
    }
    f.run("warp p.png --cage missing.json -o o.png").fails(1, &["missing.json"]);
}

#[test]
fn pictures_and_points_that_cannot_be_used() {
    let f = folder();
    let whole = f.bytes("p.png");
    for (what, bytes) in
        [("empty", Vec::new()), ("cut", whole[..whole.len() / 2].to_vec()), ("text", b"no picture".to_vec())]
    {
        std::fs::write(f.path("p.png"), bytes).unwrap();
        f.run(WARP).fails(1, &["p.png"]);
        assert!(!f.path("o.png").exists(), "{what}");
    }
    for (text, words) in [
        ("", ["empty", "p.csv"]),
        ("x,y\n1,nan\n", ["line 2", "nan"]),
        ("a,b\n", ["header", "x,y"]),
        ("x,y\n1\n", ["line 2", "cells"]),
    ] {
        f.write("p.csv", text);
        f.run(&format!("{POINTS} -o q.csv")).fails(1, &words);
    }
    f.write("p.svg", "<svg><path d='M0 0 L'/></svg>");
    f.run("warp-points p.svg --cage c.json --backend cpu -o q.svg").fails(1, &["p.svg", "line 1", "path"]);
    f.write("p.geojson", "{\"type\":\"Point\"}");
    f.run("warp-points p.geojson --cage c.json --backend cpu -o q.geojson").fails(1, &["p.geojson", "coordinates"]);
    f.run("warp-points p.xyz --cage c.json -o q.csv").fails(2, &["p.xyz"]);
    assert!(["q.csv", "q.svg", "q.geojson"].iter().all(|name| !f.path(name).exists()));
}

#[test]
fn options_out_of_range() {
    let f = folder();
    for (option, words) in [
        ("--eps 0", ["--eps", "0"]),
        ("--eps nan", ["--eps", "NaN"]),
        ("--resolution 0", ["--resolution", "0"]),
        ("--partition uniform:0", ["uniform:0", "uniform:M"]),
        ("--partition twice", ["twice", "binary"]),
        ("--partition uniform:4000000000", ["--partition", "4000000000 steps"]),
        ("--partition uniform:1000000", ["1000000 steps", "at most 10000"]),
        ("--canvas 0x5", ["--size", "width"]),
        ("--size 5000000x5", ["--size", "width"]),
        ("--filter cubic", ["cubic", "ewa"]),
        ("-o o.psd", ["o.psd", "png"]),
        ("--heatmap h.gif", ["h.gif", "png"]),
    ] {
        let ran = f.run(&format!(
            "warp p.png --backend cpu --cage c.json {} {option}",
            if option.starts_with("-o") { "" } else { "-o o.png" }
        ));
        assert_eq!(ran.code, Some(2), "{option}: {ran:?}");
        for word in words {
            assert!(ran.stderr.contains(word), "{option}: {word} is not in {}", ran.stderr);
        }
        assert!(!f.path("o.png").exists());
    }
    f.run(&format!("{WARP} --memory 1K")).fails(1, &["--memory"]);
    f.run(&WARP.replace("o.png", "p.png/o.png")).fails(1, &["p.png/o.png"]);
}

#[test]
fn pictures_of_one_pixel_and_cages_of_any_size() {
    let f = folder();
    let one = Image::new(1, 1, 3, barymap::picture::Pixels::U8(vec![10, 200, 30])).unwrap();
    barymap::io::write_image(&one, f.path("one.png")).unwrap();
    for (size, to) in [(1.0, 0.9), (1e6, 0.5e6), (1e-3, 0.5e-3)] {
        f.write("c.json", &corner(size, to).to_string());
        for outside in ["map", "keep", "transparent"] {
            f.run(&format!("warp one.png --backend cpu --cage c.json -o o.png --outside {outside}")).succeeds();
            assert_eq!(f.image("o.png").width, 1);
            f.run(&format!("{WARP} --outside {outside}")).succeeds();
        }
    }
    // A tiny cage that is kept outside leaves the picture as it was.
    f.run(&format!("{WARP} --outside keep")).succeeds();
    assert!(f.image("o.png") == waves(64) || f.json("c.json")["source"][1][0].as_f64().unwrap() >= 1.0);
}

fn data(name: &str) -> std::path::PathBuf {
    std::path::PathBuf::from(std::env::var_os("BARYMAP_DATA").expect("BARYMAP_DATA names the folder of test data"))
        .join(name)
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn countries_keep_every_vertex_there_and_back() {
    let f = Folder::empty();
    f.write("c.json", &json!({"source": [[-30, -40], [60, -40], [60, 60], [-30, 60]], "target": [[-30, -40], [60, -20], [30, 35], [-20, 60]]}).to_string());
    for country in ["france", "italy", "south_africa"] {
        let path = data(&format!("polygon/{country}.geojson"));
        let original = std::fs::read_to_string(&path).unwrap();
        f.run(&format!("warp-points {} --backend cpu --cage c.json -o there.geojson", path.display())).succeeds();
        f.run("warp-points there.geojson --backend cpu --cage c.json -o back.geojson --inverse").succeeds();
        let (a, b): (Value, Value) = (serde_json::from_str(&original).unwrap(), f.json("back.geojson"));
        assert_eq!(a["properties"], b["properties"]);
        let (mut from, mut to) = (Vec::new(), Vec::new());
        numbers(&a["geometry"]["coordinates"], &mut from);
        numbers(&b["geometry"]["coordinates"], &mut to);
        assert!(from.len() > 800 && from.len() == to.len());
        assert!(from.iter().zip(&to).all(|(a, b)| (a - b).abs() < 1e-9), "{country}");
        numbers(&f.json("there.geojson")["geometry"]["coordinates"], &mut to);
        assert!(from.iter().zip(&to[from.len()..]).any(|(a, b)| (a - b).abs() > 1.0), "the comparison sees the warp");
    }
}

fn numbers(value: &Value, out: &mut Vec<f64>) {
    match value {
        Value::Array(items) => items.iter().for_each(|item| numbers(item, out)),
        other => out.extend(other.as_f64()),
    }
}

#[test]
fn a_continuous_partition_moves_points_with_the_cage() {
    let f = Folder::empty();
    let mut points = "x,y\n".to_owned();
    for k in 0..100 {
        points += &format!("{},{}\n", 0.05 + 0.1 * f64::from(k / 10), 0.05 + 0.1 * f64::from(k % 10));
    }
    f.write("p.csv", &points);
    let images = |s: f64, partition: &str| -> Vec<[f64; 2]> {
        f.write("c.json", &corner(1.0, 1.0 - s).to_string());
        f.run(&format!("{POINTS} --partition {partition} --strict -o o.csv --report r.json")).succeeds();
        assert_eq!(f.json("r.json")["bijective"], "sampled");
        let text = f.read("o.csv");
        let number = |cell: &str| cell.parse::<f64>().unwrap();
        let row =
            |line: &str| line.split_once(',').map(|(x, rest)| [number(x), number(rest.split(',').next().unwrap())]);
        text.lines().skip(1).map(|line| row(line).unwrap()).collect()
    };
    let moved = |from: f64, to: f64, partition: &str| {
        let (a, b) = (images(from, partition), images(to, partition));
        assert_eq!((a.len(), b.len()), (100, 100));
        a.iter().zip(&b).map(|(p, q)| f64::hypot(p[0] - q[0], p[1] - q[1])).fold(0.0, f64::max)
    };
    // The corner goes the square root of two times as far as s.
    for (from, to) in [(0.965, 0.966), (0.9656, 0.9657), (0.9657, 0.9658), (0.952, 0.953), (0.546, 0.547)] {
        let most = 6.0 * (to - from) * 2f64.sqrt();
        let found = moved(from, to, "continuous");
        assert!(found <= most, "{from}: {found} of {most}");
    }
    // In a binary partition a step appears where one folds: at 0.5469 (Fig. 9 of the paper) for the
    // straight path.
    assert!(moved(0.54, 0.55, "binary --path linear") > moved(0.54, 0.55, "continuous --path linear"));
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn photographs_and_given_cages() {
    let f = Folder::empty();
    for (image, cage) in
        [("kodim23", "square_concave"), ("brick", "square_wavy"), ("horse", "disc_star5"), ("chelsea", "lshape_square")]
    {
        let cage = data(&format!("polygon/{cage}.json"));
        let mut unit: Value = serde_json::from_str(&std::fs::read_to_string(cage).unwrap()).unwrap();
        unit["units"] = json!("unit");
        f.write("c.json", &unit.to_string());
        let picture = data(&format!("image/{image}.png"));
        f.run(&format!(
            "warp {} --backend cpu --cage c.json -o o.png --strict --report r.json --outside keep",
            picture.display()
        ))
        .succeeds();
        let (before, after) = (barymap::io::read_image(&picture).unwrap(), f.image("o.png"));
        assert_eq!((before.width, before.channels, before.depth()), (after.width, after.channels, after.depth()));
        assert!(before != after);
        assert_eq!(
            (f.json("r.json")["bijective"].as_str(), &f.json("r.json")["failed"]["inside"]),
            (Some("sampled"), &json!(0)),
            "{image}"
        );
    }
}
