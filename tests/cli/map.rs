//! `barymap map`: the inverse, there and back, and what is relaxed.

use crate::support::Folder;

const MAP: &str = "map --backend cpu --source s.obj --target t.obj --anchors a.json --report r.json -o m.csv";

fn spheres() -> Folder {
    let f = Folder::spheres();
    f.anchors("a.json", 40, |p| p);
    f
}

#[test]
fn the_inverse_lists_the_source_and_its_residual() {
    let f = spheres();
    f.run(&format!("{MAP} --inverse")).succeeds();
    let vertices = f.read("s.obj").lines().filter(|l| l.starts_with("v ")).count();
    let table = f.read("m.csv");
    assert_eq!(table.lines().count(), vertices + 1);
    let report = f.json("r.json");
    assert!(report["residual"]["p95"].as_f64().unwrap() < 1e-3, "{}", report["residual"]);
    // Sent on by the map itself, a pre-image is where it began.
    let mut rows = String::from("face,b0,b1,b2\n");
    let mut wanted = Vec::new();
    for (v, line) in table.lines().skip(1).enumerate() {
        let cells: Vec<&str> = line.split(',').collect();
        if cells[8] == "valid" {
            rows += &format!("{},{},{},{}\n", cells[1], cells[2], cells[3], cells[4]);
            wanted.push(v);
        }
    }
    assert!(wanted.len() * 10 > vertices * 8, "{} of {vertices}", wanted.len());
    f.write("p.csv", &rows);
    f.run(&format!("{MAP} --points p.csv")).succeeds();
    let places: Vec<[f64; 3]> = f
        .read("s.obj")
        .lines()
        .filter_map(|l| l.strip_prefix("v "))
        .map(|l| {
            let n: Vec<f64> = l.split_whitespace().map(|x| x.parse().unwrap()).collect();
            [n[0], n[1], n[2]]
        })
        .collect();
    for (line, v) in f.read("m.csv").lines().skip(1).zip(wanted) {
        let cells: Vec<f64> = line.split(',').skip(5).take(3).map(|x| x.parse().unwrap()).collect();
        let off = (0..3).map(|k| (cells[k] - places[v][k]).powi(2)).sum::<f64>().sqrt();
        assert!(off < 1e-2, "vertex {v}: {off}");
    }
    assert_eq!(f.run(&format!("{MAP} --inverse --points p.csv")).code, Some(2));
}

#[test]
fn there_and_back_is_reported() {
    let f = spheres();
    f.run(&format!("{MAP} --cycle")).succeeds();
    let near = f.json("r.json")["cycle"]["mean"].as_f64().unwrap();
    assert!(near < 0.01, "{near}");
    assert!(f.json("r.json")["cycle"]["returned"].as_f64().unwrap() > 0.99);
    f.run(MAP).succeeds();
    assert!(f.json("r.json").get("cycle").is_none());
    // Pairs that contradict the others tear the two maps apart, where they are used.
    let mut pairs = f.json("a.json");
    let list = pairs["source"].as_array_mut().unwrap();
    list.swap(1, 20);
    list.swap(5, 30);
    f.write("a.json", &pairs.to_string());
    let ran = f.run(&format!("{MAP} --cycle")).succeeds();
    assert!(
        ran.stderr.contains("exchanged with pair 20") && ran.stderr.contains("exchanged with pair 5"),
        "{}",
        ran.stderr
    );
    let kept_out = f.json("r.json")["cycle"]["mean"].as_f64().unwrap();
    assert!(kept_out < 1.5 * near, "{kept_out} {near}");
    f.run(&format!("{MAP} --cycle --keep-all")).succeeds();
    let torn = f.json("r.json")["cycle"]["mean"].as_f64().unwrap();
    assert!(torn > 2.0 * near, "{torn} {near}");
}

#[test]
fn pairs_of_one_side_count_for_both() {
    let f = spheres();
    let plain = f.run(MAP).succeeds();
    assert!(!plain.stdout.contains("count for both"), "{}", plain.stdout);
    let (half, whole) = (f.run(&format!("{MAP} --mirror")).succeeds(), f.json("a.json"));
    let given = whole["source"].as_array().unwrap().len();
    assert!(half.stdout.contains(&format!("pairs of one side count for both: {given} given")), "{}", half.stdout);
    // With any method, and not where a shape is no mirror image of itself.
    f.run(&format!("{MAP} --mirror --method rbf")).succeeds();
    f.write("lame.obj", "v 0 0 0\nv 3 0 0\nv 0 1 0\nv 0 0 2\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n");
    f.write("pairs.txt", "0 0\n");
    let lame = "map --source lame.obj --target lame.obj --anchors pairs.txt --mirror -o m.csv --overwrite";
    f.run(lame).fails(1, &["lame", "mirror image", "--mirror"]);
}

#[test]
fn a_map_says_what_it_is_worth() {
    let f = spheres();
    let told = f.run(MAP).succeeds().stdout;
    let line = told.lines().find(|l| l.contains("expected error")).unwrap_or_else(|| panic!("{told}"));
    assert!(line.contains("for 95 %") && line.contains("would help most at vertex"), "{line}");
    let expected = &f.json("r.json")["field"]["expected"];
    let (median, p95) = (expected["median"].as_f64().unwrap(), expected["p95"].as_f64().unwrap());
    assert!(0.0 < median && median <= p95 && p95 < 0.2, "{expected}");
    // Methods that have no evidence say nothing.
    assert!(!f.run(&format!("{MAP} --method rbf")).succeeds().stdout.contains("expected error"));
}

#[test]
fn what_is_relaxed_is_a_choice_where_there_is_one() {
    let f = spheres();
    let table = |options: &str| {
        f.run(&format!("{MAP} {options}")).succeeds();
        (f.read("m.csv"), f.json("r.json")["method"].as_str().unwrap().to_owned())
    };
    let (default, named) = (table(""), table("--method field --relax yes"));
    assert_eq!(default, named.clone());
    assert_eq!(named.1, "field");
    let (plain, relaxed) = (table("--method rbf"), table("--method rbf --relax"));
    assert!(plain.0 != relaxed.0 && relaxed.1 == "rbf, relaxed");
    assert_ne!(table("--method field --relax no").0, default.0);
    f.run(&format!("{MAP} --method transport --relax")).fails(2, &["--relax", "transport"]);
    assert_eq!(f.run(&format!("{MAP} --relax maybe")).code, Some(2));
}

#[test]
fn every_dimension_of_the_embedding_has_its_field() {
    let f = spheres();
    for dimension in [4, 8, 12, 16] {
        f.run(&format!("{MAP} --dimension {dimension} --landmarks 150")).succeeds();
        assert_eq!(f.json("r.json")["method"], "field");
    }
    f.run(&format!("{MAP} --dimension 5")).fails(2, &["dimension"]);
}

#[test]
fn an_alignment_is_reported_and_needs_anchors_and_the_field() {
    let f = spheres();
    f.run(&format!("{MAP} --landmarks 200 --align")).succeeds();
    let report = f.json("r.json");
    let a = &report["alignment"];
    let number = |key: &str| a[key].as_f64().unwrap_or_else(|| panic!("{key}: {a}"));
    assert!(
        number("before") > 0.0 && number("after") > 0.0 && number("seconds") > 0.0 && a["kept"].is_boolean(),
        "{a}"
    );
    let kept = a["kept"].as_bool().unwrap();
    let first = f.read("m.csv");
    f.run(&format!("{MAP} --landmarks 200 --align --cycle")).succeeds();
    assert_eq!(f.read("m.csv"), first);
    let again = f.json("r.json");
    assert_eq!((&again["alignment"]["before"], &again["alignment"]["after"]), (&a["before"], &a["after"]));
    f.run(&format!("{MAP} --landmarks 200")).succeeds();
    assert!(f.json("r.json").get("alignment").is_none());
    // Kept or not, the map is that of the report.
    assert_eq!(f.read("m.csv") == first, !kept);

    f.run(&format!("{MAP} --align --method rbf")).fails(2, &["--align", "field"]);
    f.anchors("a.json", 4, |p| p);
    f.run(&format!("{MAP} --landmarks 200 --align")).fails(1, &["4 anchors", "do not align"]);
}
