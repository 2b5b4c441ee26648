//! `barymap transfer` and `demo`.

use barymap::io::read_mesh;
use glam::DVec3;
use serde_json::Value;

use crate::support::{Folder, difference, waves};

const TRANSFER: &str =
    "transfer --backend cpu --source s.obj --target t.obj --texture s.png --anchors a.json --size 128";

#[test]
fn names_in_a_model_are_the_targets() {
    let f = Folder::spheres();
    f.run("transfer --source s.obj --target t.obj --texture s.png --anchors a.json --backend cpu --size 32 --method rbf --model m.glb")
        .succeeds();
    let (document, _, _) = ::gltf::import(f.path("m.glb")).unwrap();
    let nodes: Vec<_> = document.nodes().map(|n| n.name().unwrap_or_default().to_owned()).collect();
    let meshes: Vec<_> = document.meshes().map(|m| m.name().unwrap_or_default().to_owned()).collect();
    assert_eq!((nodes, meshes), (vec!["t".to_owned()], vec!["t".to_owned()]));
}

#[test]
fn the_texture_arrives_with_coverage_model_and_report() {
    let f = Folder::spheres();
    let ran = f.run(&format!("{TRANSFER} -o o.png --coverage c.png --model m.glb --report r.json")).succeeds();
    assert!(ran.stdout.contains("o.png: 128 x 128") && ran.stdout.contains("cpu"), "{}", ran.stdout);
    let coverage = f.image("c.png");
    assert_eq!(coverage.channels, 1);
    let (result, truth) = (f.image("o.png"), waves(128));
    let error = difference(&result, &truth, &coverage);
    assert!(error < 0.03, "mean difference {error}");

    let model = read_mesh(f.path("m.glb")).unwrap().mesh;
    let target = read_mesh(f.path("t.obj")).unwrap().mesh;
    assert_eq!(model.triangle_count(), target.triangle_count());
    assert!(model.has_texcoords());
    let embedded = model.materials[0].embedded_texture.as_ref().expect("the model carries its texture");
    assert_eq!(barymap::io::image_file::decode_image(embedded, "m.glb").unwrap(), result);

    let report = f.json("r.json");
    for key in [
        "command",
        "version",
        "backend",
        "seconds",
        "cpu_seconds",
        "texels",
        "covered",
        "valid_fraction",
        "flipped_area",
        "flipped_faces",
        "stretch_all",
        "stretch_best95",
        "stress",
        "nanoseconds_per_texel",
    ] {
        assert!(!report[key].is_null(), "{key} is missing in {report}");
    }
    assert_eq!(report["command"], "transfer");
    assert_eq!(report["texels"], 128 * 128);
    assert_eq!(report["device_stages"], serde_json::json!([]));
    for key in ["name", "driver"] {
        assert!(report["backend"][key].is_string(), "{report}");
    }
    for times in ["seconds", "cpu_seconds"] {
        assert!(report[times].as_object().unwrap().values().all(|t| t.as_f64().unwrap() >= 0.0), "{report}");
    }
    let fraction = |key: &str| report[key].as_f64().unwrap();
    assert!((0.9..=1.0).contains(&fraction("valid_fraction")), "{report}");
    assert!((0.0..0.05).contains(&fraction("flipped_area")), "{report}");
    let counted = (0..128).flat_map(|y| (0..128).map(move |x| (x, y)));
    let values: Vec<u8> = counted.map(|(x, y)| (coverage.get(x, y, 0) * 255.0).round() as u8).collect();
    assert!(values.iter().all(|v| [0, 64, 128, 255].contains(v)));
    let valid = values.iter().filter(|&&v| v == 255).count();
    assert_eq!(report["valid"].as_u64().unwrap(), valid as u64);
}

#[test]
fn the_comparison_notices_anchors_of_a_turned_source() {
    let f = Folder::spheres();
    f.anchors("turned.json", 40, |p| DVec3::new(-p.x, p.y, -p.z));
    f.run(&format!("{TRANSFER} -o o.png --coverage c.png --anchors turned.json").replace("--anchors a.json", ""))
        .succeeds();
    let error = difference(&f.image("o.png"), &waves(128), &f.image("c.png"));
    assert!(error > 0.2, "mean difference {error}");
}

#[test]
fn every_method_and_back_end_agrees_on_easy_shapes() {
    let f = Folder::spheres();
    for method in ["averages", "transport", "rbf", "closest"] {
        f.run(&format!("{TRANSFER} --method {method} -o o.png --coverage c.png")).succeeds();
        let error = difference(&f.image("o.png"), &waves(128), &f.image("c.png"));
        assert!(error < 0.06, "{method}: mean difference {error}");
    }
    let reference = TRANSFER.replace("cpu", "reference");
    f.run(&format!("{TRANSFER} -o single.png --coverage c.png")).succeeds();
    f.run(&format!("{reference} -o double.png")).succeeds();
    let error = difference(&f.image("single.png"), &f.image("double.png"), &f.image("c.png"));
    assert!(error < 1e-3, "single against double precision: {error}");
}

#[test]
fn a_device_does_all_heavy_stages_where_there_is_one() {
    let f = Folder::spheres();
    f.run(&format!("{TRANSFER} -o cpu.png --coverage c.png")).succeeds();
    let auto = TRANSFER.replace("--backend cpu", "--backend auto");
    f.run(&format!("{auto} -o auto.png --coverage d.png --report r.json")).succeeds();
    let report = f.json("r.json");
    if report["backend"]["kind"] == "gpu" {
        let stages: Vec<&str> = report["device_stages"].as_array().unwrap().iter().filter_map(|s| s.as_str()).collect();
        for stage in ["rasterize_atlas", "locate", "footprint", "sample_texture", "store_texel", "tally", "pad_seams"] {
            assert!(stages.contains(&stage), "{stage}: {stages:?}");
        }
    } else {
        assert!(
            std::env::var_os("BARYMAP_REQUIRE_GPU").is_none(),
            "BARYMAP_REQUIRE_GPU is set and there is no adapter"
        );
    }
    let error = difference(&f.image("cpu.png"), &f.image("auto.png"), &f.image("c.png"));
    assert!(error < 1e-3, "device against CPU: {error}");
    // What the device leaves does not fit: the CPU does it, and the user is told.
    let ran = f.run(&format!("{auto} -o small.png --memory 24M --report s.json")).succeeds();
    if report["backend"]["kind"] == "gpu" {
        assert_eq!(f.json("s.json")["device_stages"], serde_json::json!([]));
        assert!(ran.stderr.contains("note: the transfer runs on the CPU"), "{}", ran.stderr);
    }
}

#[test]
fn several_layers_come_from_one_correspondence() {
    let f = Folder::spheres();
    barymap::io::write_image(&waves(32).converted(1, barymap::picture::Depth::U16).unwrap(), f.path("grey.png"))
        .unwrap();
    f.run(&format!("{TRANSFER} --texture grey.png -o o.png -o p.png --coverage c.png")).succeeds();
    f.run(&format!("{TRANSFER} -o alone.png")).succeeds();
    assert_eq!(f.bytes("o.png"), f.bytes("alone.png"));
    assert_eq!(f.image("p.png").depth(), barymap::picture::Depth::U16, "a layer keeps its depth");
    f.run(&format!("{TRANSFER} --texture grey.png -o o2.png")).fails(2, &["output", "1 outputs for 2 layers"]);
    assert!(!f.path("o2.png").exists());
}

#[test]
fn materials_take_their_own_textures() {
    let f = Folder::spheres();
    // The lower half of the faces gets one material, the upper another.
    let text = f.read("s.obj");
    let faces: Vec<&str> = text.lines().filter(|l| l.starts_with("f ")).collect();
    let rest: Vec<&str> = text.lines().filter(|l| !l.starts_with("f ") && !l.starts_with("usemtl")).collect();
    let (low, high) = faces.split_at(faces.len() / 2);
    let parted = format!("{}\nusemtl low\n{}\nusemtl high\n{}\n", rest.join("\n"), low.join("\n"), high.join("\n"));
    f.write("s.obj", &parted);
    let command = TRANSFER.replace("--texture s.png", "--texture low=s.png --texture high=s.png");
    f.run(&format!("{command} -o o.png --coverage c.png")).succeeds();
    let error = difference(&f.image("o.png"), &waves(128), &f.image("c.png"));
    assert!(error < 0.03, "mean difference {error}");

    let half = TRANSFER.replace("--texture s.png", "--texture low=s.png");
    f.run(&format!("{half} -o o.png --report r.json")).succeeds();
    let fraction = f.json("r.json")["valid_fraction"].as_f64().unwrap();
    assert!((0.3..0.7).contains(&fraction), "half of the source has no texture: {fraction}");

    let mixed = TRANSFER.replace("--texture s.png", "--texture low=s.png --texture s.png");
    f.run(&format!("{mixed} -o o3.png -o o4.png")).fails(2, &["texture", "name a material"]);
}

#[test]
fn textures_of_the_materials_are_the_default() {
    let f = Folder::spheres();
    let text = f.read("s.obj");
    f.write("s.mtl", "newmtl skin\nmap_Kd s.png\n");
    f.write("s.obj", &format!("mtllib s.mtl\nusemtl skin\n{text}"));
    let command = TRANSFER.replace("--texture s.png", "");
    f.run(&format!("{command} -o o.png --coverage c.png")).succeeds();
    let error = difference(&f.image("o.png"), &waves(128), &f.image("c.png"));
    assert!(error < 0.03, "mean difference {error}");
    f.write("s.obj", &text);
    f.run(&format!("{command} -o o2.png")).fails(2, &["s.obj", "no texture", "--texture"]);
}

#[test]
fn sizes_from_one_texel_up() {
    let f = Folder::spheres();
    for (size, width, height) in [("1", 1, 1), ("1x1000", 1, 1000), ("7x3", 7, 3)] {
        f.run(&format!("{TRANSFER} --size {size} -o o.png").replace("--size 128", "")).succeeds();
        let image = f.image("o.png");
        assert_eq!((image.width, image.height), (width, height));
    }
    for size in ["0", "0x5", "16385", "99999999999", "12by9", "-4"] {
        let ran = f.run(&format!("{TRANSFER} --size={size} -o none.png").replace("--size 128", ""));
        assert_eq!(ran.code, Some(2), "--size {size}: {}", ran.stderr);
        assert!(ran.stderr.contains("size") || ran.stderr.contains("width"), "{}", ran.stderr);
    }
    assert!(!f.path("none.png").exists());
}

#[test]
fn memory_is_a_limit() {
    let f = Folder::spheres();
    // A map by `field` takes more.
    let transport = format!("{TRANSFER} --method transport");
    f.run(&format!("{transport} -o o.png")).succeeds();
    f.run(&format!("{transport} -o small.png --memory 3M --report r.json")).succeeds();
    f.run(&format!("{TRANSFER} -o none.png --memory 3M")).fails(1, &["the map from t.obj", "memory"]);
    let report: Value = f.json("r.json");
    assert!(report["memory"].as_u64().unwrap() <= 3 << 20, "{report}");
    assert_eq!(f.bytes("o.png"), f.bytes("small.png"), "bands do not show");
    f.run(&format!("{TRANSFER} -o huge.png --memory 9000000G")).succeeds();
    let ran = f.run(&format!("{TRANSFER} -o none.png --memory 1K"));
    assert!(ran.message().contains("memory") && matches!(ran.code, Some(1 | 2)), "{ran:?}");
    assert!(!f.path("none.png").exists());
    for wrong in ["0", "abc", "99999999999999999999G", "1T", "G", ""] {
        let ran = f.run(&format!("{TRANSFER} -o none.png --memory={wrong}"));
        assert_eq!(ran.code, Some(2), "--memory={wrong}: {}", ran.stderr);
    }
}

#[test]
fn demo_makes_its_pictures_and_knows_its_error() {
    let f = Folder::empty();
    let ran = f.run("demo --backend cpu --out results --size 128 --report r.json").succeeds();
    assert!(ran.stdout.contains("true error"), "{}", ran.stdout);
    let report = f.json("r.json");
    assert!(report["error"]["mean"].as_f64().unwrap() < 0.012, "{report}");
    assert_eq!(report["command"], "demo");
    for name in ["demo.png", "texture.png", "coverage.png", "source_texture.png", "model.glb", "report.json"] {
        assert!(f.path("results").join(name).exists(), "{name}");
    }
    f.run("demo --backend cpu --anchors 0 --out none --size 16").fails(1, &["no anchors"]);
}
