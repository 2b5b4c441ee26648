//! `barymap deform` end to end.

use barymap::io::read_mesh;
use glam::DVec3;

use crate::support::Folder;

/// Handles for the sphere of [`Folder::spheres`], both poles and three vertices of the equator,
/// each moved by `by`.
fn handles(f: &Folder, by: impl Fn(DVec3) -> DVec3) -> String {
    let mesh = read_mesh(f.path("s.obj")).unwrap().mesh;
    let last = mesh.vertex_count() - 1;
    let entries: Vec<String> = [0, last, last / 2, last / 2 + 5, last / 2 + 11]
        .iter()
        .map(|&v| format!(r#"{{"vertex": {v}, "position": {:?}}}"#, by(mesh.positions[v]).to_array()))
        .collect();
    format!(r#"{{"handles": [{}]}}"#, entries.join(", "))
}

#[test]
fn a_turn_is_exact_and_the_file_keeps_everything_else() {
    let f = Folder::spheres();
    let turn = |p: DVec3| DVec3::new(-p.y, p.x, p.z) * 2.0;
    f.write("h.json", &handles(&f, turn));
    f.run("deform s.obj --handles h.json -o out.obj --report r.json --backend cpu").succeeds();
    let (before, after) = (read_mesh(f.path("s.obj")).unwrap().mesh, read_mesh(f.path("out.obj")).unwrap().mesh);
    assert_eq!(before.triangles(), after.triangles());
    assert_eq!(before.texcoords, after.texcoords);
    for (p, q) in before.positions.iter().zip(&after.positions) {
        assert!(turn(*p).distance(*q) < 1e-12, "{p} {q}");
    }
    let report = f.json("r.json");
    assert_eq!(report["command"], "deform");
    for key in ["g", "g_normalised", "edge_rms", "edge_max", "volume_ratio", "flipped", "iterations"] {
        assert!(report[key].is_number(), "{key} is missing in {report}");
    }
    assert_eq!((report["flipped"].as_u64(), report["iterations"].as_u64()), (Some(0), Some(0)));
    assert!((report["volume_ratio"].as_f64().unwrap() - 8.0).abs() < 1e-9);
    assert_eq!(report["device_stages"], serde_json::json!([]));
    // Again, from the cache: the same bytes.
    let first = f.read("out.obj");
    f.run("deform s.obj --handles h.json -o out.obj --backend cpu").succeeds();
    assert_eq!(f.read("out.obj"), first);
    f.run("deform s.obj --handles h.json -o out.ply --quality converged --stiffness 0.5 --sweeps 1").succeeds();
    assert_eq!(read_mesh(f.path("out.ply")).unwrap().mesh.vertex_count(), before.vertex_count());
}

#[test]
fn a_device_is_used_when_asked_for_and_named() {
    let f = Folder::spheres();
    let turn = |p: DVec3| DVec3::new(-p.y, p.x, p.z) * 2.0;
    f.write("h.json", &handles(&f, turn));
    let ran = f.run("deform s.obj --handles h.json -o gpu.obj --quality splits --backend gpu --report r.json");
    if ran.code == Some(1) && std::env::var_os("BARYMAP_REQUIRE_GPU").is_none() {
        println!("SKIPPED: {}", ran.message());
        return;
    }
    ran.succeeds();
    let report = f.json("r.json");
    assert_eq!(report["backend"]["kind"], "gpu");
    assert_eq!(
        (&report["device_stages"], &report["notes"]),
        (&serde_json::json!(["split_level"]), &serde_json::json!([]))
    );
    let (before, after) = (read_mesh(f.path("s.obj")).unwrap().mesh, read_mesh(f.path("gpu.obj")).unwrap().mesh);
    let worst = before.positions.iter().zip(&after.positions).map(|(p, q)| turn(*p).distance(*q)).fold(0.0, f64::max);
    // Single precision, over a diagonal of about seven.
    assert!(worst > 0.0 && worst < 2e-6 * 7.0, "{worst:e}");
    f.run("deform s.obj --handles h.json -o again.obj --quality splits --backend gpu").succeeds();
    assert_eq!(f.read("gpu.obj"), f.read("again.obj"));
    // On the processor the splits are exact.
    f.run("deform s.obj --handles h.json -o cpu.obj --quality splits --backend cpu").succeeds();
    let exact = read_mesh(f.path("cpu.obj")).unwrap().mesh;
    assert!(before.positions.iter().zip(&exact.positions).all(|(p, q)| turn(*p).distance(*q) < 1e-12));
}

#[test]
fn a_region_holds_the_rest() {
    let f = Folder::spheres();
    let mesh = read_mesh(f.path("s.obj")).unwrap().mesh;
    let top: Vec<String> =
        (0..mesh.vertex_count()).filter(|&v| mesh.positions[v].y > 0.0).map(|v| v.to_string()).collect();
    f.write("roi.txt", &top.join("\n"));
    let last = mesh.vertex_count() - 1;
    let lifted = mesh.positions[last] * 1.5;
    f.write("h.json", &format!(r#"{{"handles": [{{"vertex": {last}, "position": {:?}}}]}}"#, lifted.to_array()));
    f.run("deform s.obj --handles h.json --roi roi.txt -o out.obj").succeeds();
    let after = read_mesh(f.path("out.obj")).unwrap().mesh;
    for v in 0..=last {
        let still = after.positions[v] == mesh.positions[v];
        assert_eq!(still, mesh.positions[v].y <= 0.0, "{v}");
    }
    assert_eq!(after.positions[last], lifted);
}

#[test]
fn faults_are_told_in_words() {
    let f = Folder::spheres();
    f.write("h.json", &handles(&f, |p| p));
    for (name, text, words) in [
        ("none.json", r#"{"handles": []}"#, &["no handles"][..]),
        ("far.json", r#"{"handles": [{"vertex": 99999, "position": [0, 0, 0]}]}"#, &["99999"]),
        ("bad.json", r#"{"handles": [{"vertex": 1}]}"#, &["bad.json", "handle 0"]),
        (
            "two.json",
            r#"{"handles": [{"vertex": 1, "position": [0,0,0]}, {"vertex": 1, "position": [0,0,1]}]}"#,
            &["vertex 1"],
        ),
    ] {
        f.write(name, text);
        f.run(&format!("deform s.obj --handles {name} -o out.obj")).fails(1, words);
    }
    f.write("roi.txt", "1\nx\n");
    f.run("deform s.obj --handles h.json --roi roi.txt -o out.obj").fails(1, &["roi.txt", "line 2"]);
    f.run("deform s.obj --handles gone.json -o out.obj").fails(1, &["gone.json"]);
    f.run("deform s.obj --handles h.json -o out.stl").fails(2, &["--output"]);
    f.run("deform s.obj --handles h.json -o out.obj --stiffness -1").fails(2, &["stiffness"]);
    assert!(!f.path("out.obj").exists());
}

#[test]
fn morphs_begin_and_end_at_their_inputs() {
    let f = Folder::spheres();
    let mut mesh = read_mesh(f.path("s.obj")).unwrap().mesh;
    mesh.positions.iter_mut().for_each(|p| *p *= DVec3::new(1.0, 1.5, 0.8));
    barymap::io::write_obj(&mesh, f.path("b.obj")).unwrap();
    f.run("morph s.obj b.obj -o out --frames 3 --report r.json").succeeds();
    for (file, like) in [("out/frame_0000.obj", "s.obj"), ("out/frame_0002.obj", "b.obj")] {
        let (a, b) = (read_mesh(f.path(file)).unwrap().mesh, read_mesh(f.path(like)).unwrap().mesh);
        let worst = a.positions.iter().zip(&b.positions).map(|(p, q)| p.distance(*q)).fold(0.0, f64::max);
        assert!(worst < 1e-9 && a.triangles() == b.triangles(), "{file}: {worst}");
    }
    assert_eq!(f.json("r.json")["frames"].as_array().unwrap().len(), 3);
    f.run("morph s.obj b.obj -o one --weights 0.4,0.6 --format ply").succeeds();
    assert!(f.path("one/frame_0000.ply").exists());
    f.run("morph s.obj t.obj -o none").fails(1, &["s.obj", "t.obj", "vertices"]);
    f.run("morph s.obj b.obj -o none --weights 0.4,0.7").fails(2, &["weights"]);
    f.run("morph s.obj -o none").code.filter(|c| *c == 2).expect("one mesh alone is wrong use");
}
