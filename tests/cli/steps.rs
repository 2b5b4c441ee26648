//! The steps of the main job by themselves: `map`, `weights`, `average`, `check`, `embed`,
//! `render`, `devices`.

use barymap::engine::Engine;
use barymap::io::read_mesh;

use crate::support::{Folder, STRETCH};

/// Anchors for the source alone: vertices spread over it.
const SINGLE: &str = r#"{"anchors": [0, 3, 20, 47, 66, 90, 111, 130, 155, 170, 200, 222, 250, 277, 300, 333, 361]}"#;

#[test]
fn map_has_a_row_per_target_vertex() {
    let f = Folder::spheres();
    let map = "map --backend cpu --source s.obj --target t.obj --anchors a.json";
    f.run(&format!("{map} -o m.csv --report r.json")).succeeds();
    let text = f.read("m.csv");
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("index,face,b0,b1,b2,x,y,z,status,confidence"));
    let target = read_mesh(f.path("t.obj")).unwrap().mesh;
    let source = read_mesh(f.path("s.obj")).unwrap().mesh;
    let mut valid = 0;
    let mut total = 0.0;
    for (i, line) in lines.clone().enumerate() {
        let cells: Vec<&str> = line.split(',').collect();
        assert_eq!(cells.len(), 10, "{line}");
        assert_eq!(cells[0], i.to_string());
        assert!(["valid", "doubtful", "failed"].contains(&cells[8]), "{line}");
        let n = |k: usize| -> f64 { cells[k].parse().unwrap() };
        assert!((0.0..=1.0).contains(&n(9)), "{line}");
        if cells[8] == "valid" {
            valid += 1;
            assert!((n(2) + n(3) + n(4) - 1.0).abs() < 1e-6, "{line}");
            let p = glam::DVec3::new(n(5), n(6), n(7));
            let corners = source.triangle_positions(n(1) as usize);
            let at = corners[0] * n(2) + corners[1] * n(3) + corners[2] * n(4);
            assert!(p.distance(at) < 1e-5, "x, y, z are the point of the triangle: {line}");
            total += p.distance((target.positions[i] / STRETCH).normalize());
        }
    }
    assert_eq!(lines.count(), target.vertex_count());
    assert!(valid as f64 > 0.9 * target.vertex_count() as f64, "{valid} valid");
    assert!(total / f64::from(valid) < 0.06, "mean error {}", total / f64::from(valid));
    let report = f.json("r.json");
    for key in ["valid_fraction", "flipped_area", "flipped_faces", "stretch_all", "stretch_best95", "stress"] {
        assert!(!report[key].is_null(), "{key} is missing in {report}");
    }

    f.write("p.csv", "face,b0,b1,b2\n0,0.2,0.3,0.5\n7,1,0,0\n");
    f.run(&format!("{map} -o q.csv --points p.csv")).succeeds();
    assert_eq!(f.read("q.csv").lines().count(), 3);
    f.write("p.csv", "face,b0,b1,b2\n99999,0.2,0.3,0.5\n");
    f.run(&format!("{map} -o none.csv --points p.csv")).fails(1, &["p.csv", "99999"]);
    f.write("p.csv", "face,b0,b1,b2\n0,0.2,NaN,0.5\n");
    f.run(&format!("{map} -o none.csv --points p.csv")).fails(1, &["p.csv", "line 2"]);
    assert!(!f.path("none.csv").exists());
}

#[test]
fn averages_of_the_weights_are_the_points() {
    let f = Folder::spheres();
    f.write("single.json", SINGLE);
    f.write("p.csv", "face,b0,b1,b2\n40,0.2,0.3,0.5\n300,0.6,0.3,0.1\n511,0.25,0.25,0.5\n");
    f.run("weights s.obj --backend cpu --anchors single.json --points p.csv -o w.npy").succeeds();
    let barymap::io::npy::NpyMatrix { columns, values: weights, .. } =
        barymap::io::npy::read_npy(f.path("w.npy")).unwrap();
    assert_eq!((columns, weights.len()), (17, 51));
    let rows: Vec<String> = weights
        .chunks(17)
        .map(|row| {
            assert!((row.iter().sum::<f64>() - 1.0).abs() < 1e-9, "weights sum to one");
            row.iter().map(|w| format!("{w:e}")).collect::<Vec<_>>().join(",")
        })
        .collect();
    f.write("w.csv", &(rows.join("\n") + "\n"));
    f.run("average s.obj --backend cpu --anchors single.json --weights w.csv -o q.csv").succeeds();
    // What the one command writes the other one reads.
    f.run("average s.obj --backend cpu --anchors single.json --weights w.npy -o n.csv").succeeds();
    assert_eq!(f.bytes("n.csv"), f.bytes("q.csv"));
    let mesh = read_mesh(f.path("s.obj")).unwrap().mesh;
    let place = |file: &str| -> Vec<glam::DVec3> {
        barymap::io::points::read_points(f.path(file), &mesh).unwrap().0.iter().map(|p| p.position(&mesh)).collect()
    };
    for (p, q) in place("p.csv").iter().zip(place("q.csv")) {
        assert!(p.distance(q) < 1e-6, "{p} came back as {q}");
    }
    f.write("w.csv", "0.5,0.5\n");
    f.run("average s.obj --backend cpu --anchors single.json --weights w.csv -o none.csv").fails(1, &["w.csv", "17"]);
    f.write("w.csv", &(vec!["1"; 17].join(",") + "\n"));
    f.run("average s.obj --backend cpu --anchors single.json --weights w.csv -o none.csv").fails(1, &["sum"]);
    assert!(!f.path("none.csv").exists());
}

#[test]
fn check_tells_what_is_covered() {
    let f = Folder::spheres();
    f.write("single.json", SINGLE);
    let ran = f.run("check s.obj --backend cpu --anchors single.json -o cover.ply --report r.json").succeeds();
    assert!(ran.stdout.contains("17 anchors cover"), "{}", ran.stdout);
    let all = f.json("r.json")["covered_fraction"].as_f64().unwrap();
    assert!((0.9..=1.0).contains(&all), "{all}");
    let mesh = read_mesh(f.path("cover.ply")).unwrap().mesh;
    assert_eq!(mesh.vertex_count(), read_mesh(f.path("s.obj")).unwrap().mesh.vertex_count());
    // Of pairs it has one side.
    f.run("check s.obj --backend cpu --anchors a.json").succeeds();
    let pairs = f.run("check t.obj --backend cpu --anchors a.json --side target").succeeds();
    assert!(pairs.stdout.contains("40 anchors cover"), "{}", pairs.stdout);
    // All anchors on the lower side leave the upper one uncovered.
    f.write("few.json", r#"{"anchors": [0, 1, 5, 10]}"#);
    f.run("check s.obj --backend cpu --anchors few.json --report r.json").succeeds();
    let report = f.json("r.json");
    assert!(report["covered_fraction"].as_f64().unwrap() < all, "{report}");
    assert!(!report["proposals"].as_array().unwrap().is_empty(), "{report}");
}

#[test]
fn embed_writes_a_row_per_vertex_line() {
    let f = Folder::spheres();
    // A vertex that no face uses keeps its number.
    f.write("s.obj", &format!("v 9 9 9\n{}", shifted(&f.read("s.obj"))));
    f.run("embed s.obj --backend cpu -o e.npy --report r.json").succeeds();
    let barymap::io::npy::NpyMatrix { columns, values, .. } = barymap::io::npy::read_npy(f.path("e.npy")).unwrap();
    let mesh = read_mesh(f.path("s.obj")).unwrap().mesh;
    assert_eq!((columns, values.len()), (8, 8 * mesh.vertex_count()));
    assert!(values[..8].iter().all(|x| x.is_nan()), "an unused vertex has no place");
    assert!(values[8..].iter().all(|x| x.is_finite()));
    assert!(f.json("r.json")["stress"].as_f64().unwrap() < 0.02);
    f.run("embed s.obj --backend cpu -o e4.npy --dimension 4 --sampling decimation --landmarks 100").succeeds();
    for wrong in ["--dimension 5", "--dimension 0", "--dimension 100000", "--landmarks 0", "--landmarks 1"] {
        let ran = f.run(&format!("embed s.obj --backend cpu -o none.npy {wrong}"));
        assert!(matches!(ran.code, Some(1 | 2)), "{wrong}: {ran:?}");
        assert!(!f.path("none.npy").exists(), "{wrong}");
        ran.message();
    }
}

/// The faces of an OBJ file with one more vertex before all others.
fn shifted(text: &str) -> String {
    let corner = |word: &str| {
        let (v, rest) = word.split_once('/').unwrap_or((word, ""));
        let v: usize = v.parse().unwrap();
        if rest.is_empty() { format!("{}", v + 1) } else { format!("{}/{rest}", v + 1) }
    };
    text.lines()
        .map(|line| match line.strip_prefix("f ") {
            Some(face) => format!("f {}", face.split_whitespace().map(corner).collect::<Vec<_>>().join(" ")),
            None => line.to_owned(),
        })
        .collect::<Vec<_>>()
        .join("\n")
}

#[test]
fn render_draws_the_mesh() {
    let f = Folder::spheres();
    f.write("single.json", SINGLE);
    f.run("render s.obj --texture s.png --anchors single.json --numbers --view -30,20 --size 90x60 -o p.png")
        .succeeds();
    let picture = f.image("p.png");
    assert_eq!((picture.width, picture.height), (90, 60));
    assert!(picture.get(0, 0, 0) > 0.99 && picture.get(45, 30, 0) + picture.get(45, 30, 1) < 1.98, "a shape on white");
    f.run("render s.obj --size 40 --wireframe -o q.png").succeeds();
    f.run("render s.obj --size 0 -o none.png").fails(2, &["width"]);
    f.run("render s.obj -o none.psd").fails(2, &["none.psd"]);
    assert_eq!(f.run("render s.obj --view up -o none.png").code, Some(2));
    assert_eq!(f.run("render s.obj --view NaN,0 -o none.png").code, Some(2));
    assert!(!f.path("none.png").exists());
}

#[test]
fn devices_tells_what_auto_takes() {
    let f = Folder::empty();
    let ran = f.run("devices --report r.json").succeeds();
    assert!(ran.stdout.contains("in use: "), "{}", ran.stdout);
    let report = f.json("r.json");
    assert!(report["adapters"].is_array() && report["backend"]["name"].is_string(), "{report}");
}

#[test]
fn devices_checks_every_kernel_and_says_how_many_passed() {
    let f = Folder::empty();
    f.run("devices --check --backend cpu").fails(2, &["--backend"]);
    if Engine::adapters().is_empty() {
        f.run("devices --check").fails(1, &["adapter"]);
        return;
    }
    let ran = f.run("devices --check --report r.json").succeeds();
    let report = f.json("r.json");
    let rows = report["checks"].as_array().unwrap();
    let last = ran.stdout.lines().last().unwrap();
    assert_eq!(last, format!("{} passed, 0 failed", rows.len()), "{}", ran.stdout);
    let kernels = rows.iter().filter(|r| r["faults"].is_array()).count();
    assert_eq!(kernels, barymap::conformance::kernels().len());
    for row in rows.iter().filter(|r| r["check"].is_string()) {
        assert!(row["error"].as_f64().unwrap() <= row["tolerance"].as_f64().unwrap(), "{row}");
        assert!(row["seconds"].as_f64().unwrap() > 0.0 && row["cpu_seconds"].as_f64().unwrap() > 0.0, "{row}");
    }
}

#[test]
fn auto_takes_hardware_alone_and_an_unknown_adapter_is_answered_with_those_there_are() {
    let f = Folder::spheres();
    let run = |arguments: &str| {
        let mut command = f.command();
        command.args(arguments.split_whitespace()).env_remove("WGPU_ADAPTER_NAME").env_remove("XDG_RUNTIME_DIR");
        f.finish(&mut command)
    };
    let ran = run("embed s.obj -o e.npy --landmarks 30 --no-cache").succeeds();
    let Some(best) = Engine::adapters().into_iter().next() else { return };
    assert_eq!(best.preferred, !best.software);
    assert_eq!(ran.stderr.contains("working on the CPU"), best.software, "{}", ran.stderr);
    assert!(!ran.stderr.contains("XDG_RUNTIME_DIR"), "{}", ran.stderr);
    let ran = run("devices --adapter no-such-adapter").fails(1, &["no-such-adapter", &best.name]);
    assert!(!ran.stderr.contains("Install"), "{}", ran.stderr);
}

#[test]
fn every_stage_says_where_it_ran() {
    let f = Folder::spheres();
    f.write("single.json", SINGLE);
    f.write("p.csv", "face,b0,b1,b2\n0,0.2,0.3,0.5\n7,1,0,0\n");
    let row = |k: usize| (0..17).map(|i| if i == k { "1" } else { "0" }).collect::<Vec<_>>().join(",");
    f.write("w.csv", &format!("{}\n{}\n", row(3), row(8)));
    let report = |command: &str| {
        f.run(&format!("{command} --report r.json")).succeeds();
        let report = f.json("r.json");
        let keys = |k: &str| report[k].as_object().unwrap().keys().cloned().collect::<Vec<_>>();
        assert_eq!(keys("seconds"), keys("stages_on"), "{command}");
        // Traffic is counted where there is a device, and kernels ran exactly where it shows some.
        if report.get("traffic").is_some() {
            assert_eq!(keys("seconds"), keys("traffic"), "{command}");
        }
        for (stage, place) in report["stages_on"].as_object().unwrap() {
            let dispatches = report["traffic"][stage]["dispatches"].as_u64().unwrap_or(0);
            assert_eq!(place == "gpu", dispatches > 0, "{command}, {stage}");
        }
        report
    };
    let all =
        |report: &serde_json::Value, word: &str| report["stages_on"].as_object().unwrap().values().all(|w| w == word);
    let map = "map --source s.obj --target t.obj --anchors a.json -o m.csv";
    // No kernel runs in these, on whatever machine.
    for command in [
        "embed s.obj -o e.npy",
        "weights s.obj --anchors single.json --points p.csv -o w.npy",
        "average s.obj --anchors single.json --weights w.csv -o q.csv",
        &format!("{map} --method rbf"),
        &format!("{map} --method closest"),
        &format!("{map} --backend cpu"),
    ] {
        let r = report(command);
        assert!(all(&r, "cpu"), "{command}: {}", r["stages_on"]);
        assert_eq!(r["backend"]["kind"], "cpu", "{command}");
        assert!(r.get("handed_back").is_none(), "{command}");
    }
    assert!(all(&report(&format!("{map} --backend reference")), "reference"));
    for method in ["field", "transport", "averages"] {
        let r = report(&format!("{map} --method {method}"));
        assert_eq!(r["stages_on"]["read"], "cpu");
        assert_eq!(r["stages_on"]["embed"], "cpu");
        assert_eq!(r["stages_on"]["map"], r["backend"]["kind"]);
        assert_eq!(r["handed_back"].is_u64(), r["backend"]["kind"] == "gpu", "{r}");
        let down = r["traffic"]["map"]["bytes_down"].as_u64().unwrap_or(0);
        assert_eq!(down > 0, r["backend"]["kind"] == "gpu", "{r}");
    }
    let r = report("transfer --source s.obj --texture s.png --target t.obj --anchors a.json --size 64 -o o.png");
    assert_eq!(r["stages_on"]["transfer.map"], r["backend"]["kind"]);
    assert_eq!(r["stages_on"]["transfer.fill"].as_str().unwrap_or("cpu"), "cpu");
}

#[test]
fn a_transfer_on_a_device_brings_back_its_result_and_no_more() {
    if Engine::adapters().is_empty() {
        return;
    }
    let f = Folder::spheres();
    let job = "transfer --source s.obj --texture s.png --target t.obj --anchors a.json --size 64 --backend gpu";
    f.run(&format!("{job} -o o.png --report r.json")).succeeds();
    let r = f.json("r.json");
    let sum = |key: &str| -> u64 {
        let stages = r["traffic"].as_object().unwrap().iter();
        stages.filter(|(stage, _)| stage.starts_with("transfer.")).map(|(_, t)| t[key].as_u64().unwrap()).sum()
    };
    let bands = r["bands"].as_u64().unwrap();
    // Four bytes of RGBA and one of coverage a texel, 32 a row of counts, and of a band the head of
    // the list of points left and 512 records.
    assert_eq!(sum("bytes_down"), 64 * 64 * 5 + 64 * 32 + bands * 513 * 16, "{}", r["traffic"]);
    assert_eq!(sum("waits"), bands + 1);
    for kernel in ["locate", "store_texel", "tally"] {
        assert!(r["device_stages"].as_array().unwrap().iter().any(|s| s == kernel), "{}", r["device_stages"]);
    }
    // A kernel that stays on the CPU lets texels return, and the result is the same but for a step
    // of a sample here and there.
    f.run(&format!("{job} -o h.png --report h.json --host locate")).succeeds();
    let h = f.json("h.json");
    assert!(!h["device_stages"].as_array().unwrap().iter().any(|s| s == "locate"), "{}", h["device_stages"]);
    assert_eq!((&h["covered"], &h["valid"], &h["padded"]), (&r["covered"], &r["valid"], &r["padded"]));
    f.run(&format!("{job} -o n.png --host no-such-kernel")).fails(2, &["no-such-kernel", "sample_texture"]);
}
