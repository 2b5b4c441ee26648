//! `barymap attributes`.

use std::fmt::Write;

use barymap::io::attribute_table::{Columns, read_attributes};
use barymap::io::read_mesh;
use glam::DVec3;

use crate::support::{Folder, STRETCH};

const ATTRIBUTES: &str = "attributes --backend cpu --source s.obj --target t.obj --anchors a.json";

/// The direction of each vertex, the same for corresponding points.
fn directions(f: &Folder, mesh: &str) -> Vec<DVec3> {
    let stretch = if mesh == "t.obj" { STRETCH } else { DVec3::ONE };
    read_mesh(f.path(mesh)).unwrap().mesh.positions.iter().map(|p| (*p / stretch).normalize()).collect()
}

fn csv(header: &str, rows: impl Iterator<Item = Vec<f64>>) -> String {
    let mut text = format!("{header}\n");
    for row in rows {
        let cells: Vec<String> = row.iter().map(f64::to_string).collect();
        writeln!(text, "{}", cells.join(",")).unwrap();
    }
    text
}

/// Shares of six bones along the axes.
fn bones(d: DVec3) -> Vec<f64> {
    d.to_array().iter().flat_map(|c| [c.max(0.0).powi(2), c.min(0.0).powi(2)]).collect()
}

#[test]
fn weights_labels_and_normals_arrive() {
    let f = Folder::spheres();
    let (source, target) = (directions(&f, "s.obj"), directions(&f, "t.obj"));
    f.write("w.csv", &csv("a,b,c,d,e,f", source.iter().map(|d| bones(*d))));
    let side = |d: &DVec3| if d.y > 0.3 { 7.0 } else { 2.0 };
    f.write("l.csv", &csv("side", source.iter().map(|d| vec![side(d)])));
    f.write("n.csv", &csv("nx,ny,nz", source.iter().map(|d| d.to_array().to_vec())));
    let kinds = "--kind weights --kind labels --kind normals --top 3";
    f.run(&format!("{ATTRIBUTES} --attributes w.csv l.csv n.csv {kinds} -o w.npy l.csv.out.csv n.ply --report r.json"))
        .succeeds();

    let weights = read_attributes(f.path("w.npy"), &Columns::Data).unwrap();
    assert_eq!((weights.columns.len(), weights.values.len()), (6, 6 * target.len()));
    let mut error = 0.0;
    for (row, d) in weights.values.chunks_exact(6).zip(&target) {
        assert!((row.iter().sum::<f64>() - 1.0).abs() < 1e-12 && row.iter().filter(|w| **w > 0.0).count() <= 3);
        error += row.iter().zip(bones(*d)).map(|(a, b)| (a - b).abs()).sum::<f64>() / target.len() as f64;
    }
    assert!(error < 0.15, "{error}");

    let labels = read_attributes(f.path("l.csv.out.csv"), &Columns::Data).unwrap();
    assert!(labels.values.iter().all(|l| [7.0, 2.0].contains(l)));
    let right = labels.values.iter().zip(&target).filter(|(l, d)| **l == side(d)).count();
    assert!(right * 100 >= target.len() * 90, "{right} of {}", target.len());
    assert!(f.read("l.csv.out.csv").starts_with("index,side,status,confidence\n0,2,"));

    // The surface is stretched, and with it its normals turn.
    let normals =
        read_attributes(f.path("n.ply"), &Columns::Named(vec!["nx".into(), "ny".into(), "nz".into()])).unwrap();
    let (mut turned, mut kept) = (0.0, 0.0);
    for (row, d) in normals.values.chunks_exact(3).zip(&target) {
        let n = DVec3::from_slice(row);
        assert!((n.length() - 1.0).abs() < 1e-9);
        turned += n.angle_between((*d / STRETCH).normalize()).to_degrees() / target.len() as f64;
        kept += n.angle_between(*d).to_degrees() / target.len() as f64;
    }
    assert!(turned < 4.0 && turned < kept, "{turned} {kept}");
    assert_eq!(read_mesh(f.path("n.ply")).unwrap().mesh.positions, read_mesh(f.path("t.obj")).unwrap().mesh.positions);

    let report = f.json("r.json");
    assert_eq!(
        (report["command"].as_str(), report["vertices"].as_u64()),
        (Some("attributes"), Some(target.len() as u64))
    );
    let count = |key: &str| report[key].as_u64().unwrap();
    assert_eq!(count("valid") + count("filled") + count("doubtful") + count("failed"), target.len() as u64);
    assert!(report["attributes"].as_array().unwrap().len() == 3 && report["stress"]["source"].is_number());
}

#[test]
fn bad_data_are_refused_with_their_place() {
    let f = Folder::spheres();
    let n = directions(&f, "s.obj").len();
    let rows = |value: f64| (0..n).map(move |i| vec![if i == 5 { value } else { 0.5 }, 0.5]);
    f.write("good.csv", &csv("a,b", rows(0.5)));
    f.write("short.csv", &csv("a,b", rows(0.5).skip(1)));
    f.write("nan.csv", &csv("a,b", rows(f64::NAN)));
    f.write("negative.csv", &csv("a,b", rows(-0.5)));
    f.write("words.csv", "a,b\n1,2\n1,two\n");
    f.write("junk.npy", "no array");
    let before = f.names().len();
    for (options, code, words) in [
        ("--attributes short.csv -o o.csv", 1, ["short.csv", "vertices"]),
        ("--attributes nan.csv -o o.csv", 1, ["vertex 5, column 0", "not a finite number"]),
        ("--attributes negative.csv --kind weights -o o.csv", 1, ["vertex 5, column 0", "negative"]),
        ("--attributes words.csv -o o.csv", 1, ["line 3", "two"]),
        ("--attributes junk.npy -o o.csv", 1, ["junk.npy", "NumPy"]),
        ("--attributes missing.csv -o o.csv", 1, ["missing.csv", ""]),
        ("--attributes good.csv --columns a,z -o o.csv", 1, ["no column \"z\"", "a, b"]),
        ("--attributes good.csv --kind vectors -o o.csv", 1, ["2 columns", "three columns"]),
        ("--attributes good.csv -o o.xyz", 1, ["o.xyz", ".csv, .npy or .ply"]),
        ("--attributes good.csv good.csv -o o.csv", 2, ["--output", "1 outputs for 2 files"]),
        ("--attributes good.csv --kind scalars --kind labels -o o.csv", 2, ["--kind", "2 kinds for 1"]),
        ("--attributes good.csv --top 4 -o o.csv", 2, ["--top", "weights"]),
    ] {
        f.run(&format!("{ATTRIBUTES} {options}")).fails(code, &words);
        assert_eq!(f.names().len(), before, "{options}: {:?}", f.names());
    }
    f.run(&format!("{ATTRIBUTES} --attributes negative.csv --fill none -o o.csv")).succeeds();
}
