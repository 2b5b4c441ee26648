//! `barymap morph` end to end: folders, animations, masks.

use barymap::geometry::Mesh;
use barymap::io::{read_mesh, write_obj, write_ply};
use barymap::models::shapes::uv_sphere;
use glam::DVec3;

use crate::support::Folder;

/// `a.obj`, a ball, and `b.obj`, the ball with a rippled surface.
fn balls() -> (Folder, Mesh, Mesh) {
    let folder = Folder::empty();
    let a = uv_sphere(1.0, 32, 20);
    let mut b = a.clone();
    for p in &mut b.positions {
        *p *= 1.0 + 0.12 * (9.0 * p.y).sin();
    }
    write_obj(&a, folder.path("a.obj")).unwrap();
    write_obj(&b, folder.path("b.obj")).unwrap();
    (folder, a, b)
}

fn distance(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(p, q)| p.distance(*q)).fold(0.0, f64::max)
}

/// The largest distance of a point of `a` from the nearest one of `b`.
fn farthest(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().map(|p| b.iter().map(|q| p.distance(*q)).fold(f64::INFINITY, f64::min)).fold(0.0, f64::max)
}

#[test]
fn a_glb_holds_a_target_for_every_frame_and_an_animation() {
    let (f, a, b) = balls();
    f.run("morph a.obj b.obj -o m.glb --frames 5 --seconds 3 --report r.json").succeeds();
    let (document, buffers, _) = gltf::import(f.path("m.glb")).unwrap();
    let mesh = document.meshes().next().unwrap();
    let primitive = mesh.primitives().next().unwrap();
    let reader = primitive.reader(|buffer| Some(&buffers[buffer.index()]));
    // Vertices at the seams of the texture come twice.
    assert!(reader.read_positions().unwrap().count() >= a.vertex_count());
    assert_eq!(primitive.morph_targets().count(), 5);
    let animation = document.animations().next().unwrap();
    let channel = animation.channels().next().unwrap();
    let times: Vec<f32> = channel.reader(|buffer| Some(&buffers[buffer.index()])).read_inputs().unwrap().collect();
    assert_eq!((times[0], times[times.len() - 1]), (0.0, 3.0));
    // The last target moves the first mesh to the last one.
    let base: Vec<DVec3> = reader.read_positions().unwrap().map(|p| glam::Vec3::from(p).as_dvec3()).collect();
    let (moved, _, _) = reader.read_morph_targets().last().unwrap();
    let last: Vec<DVec3> = moved.unwrap().zip(&base).map(|(d, p)| *p + glam::Vec3::from(d).as_dvec3()).collect();
    assert!(farthest(&base, &a.positions) < 1e-6 && farthest(&last, &b.positions) < 1e-5);
    assert!(farthest(&base, &b.positions) > 0.05);
    assert_eq!(f.json("r.json")["frames"].as_array().unwrap().len(), 5);
    // One blend alone: a mesh without an animation.
    f.run("morph a.obj b.obj -o one.glb --weights 0,1").succeeds();
    let (document, _, _) = gltf::import(f.path("one.glb")).unwrap();
    assert_eq!(document.animations().count(), 0);
    f.run("morph a.obj b.obj -o one.obj --weights 0,1").succeeds();
    assert!(distance(&read_mesh(f.path("one.obj")).unwrap().mesh.positions, &b.positions) < 1e-9);
}

#[test]
fn qualities_go_nearer_and_nearer_to_the_minimum() {
    let (f, _, _) = balls();
    let g = |quality: &str| {
        f.run(&format!("morph a.obj b.obj -o {quality}.ply --weights 0.5,0.5 --quality {quality} --report r.json"))
            .succeeds();
        f.json("r.json")["frames"][0]["g"].as_f64().unwrap()
    };
    let [preview, default, converged] = ["preview", "default", "converged"].map(g);
    assert!(converged <= default * (1.0 + 1e-9) && default <= preview * (1.0 + 1e-9) && converged > 0.0);
    assert_eq!(f.run("morph a.obj b.obj -o bad.ply --weights 0.5,0.5 --quality best").code, Some(2));
}

#[test]
fn a_mask_pastes_the_detail_of_one_mesh_onto_another() {
    let (f, a, b) = balls();
    let share = |p: &DVec3| (0.5 + 3.0 * p.y).clamp(0.0, 1.0);
    let lines: Vec<String> = a.positions.iter().map(|p| share(p).to_string()).collect();
    f.write("mask.txt", &lines.join("\n"));
    f.run("morph a.obj b.obj -o pasted.obj --mask mask.txt").succeeds();
    let pasted = read_mesh(f.path("pasted.obj")).unwrap().mesh.positions;
    // Below it is the ball, above it is rippled, each in its own shape; what joins them may move
    // and turn the parts a little.
    let fitted = |of: &dyn Fn(&DVec3) -> bool, like: &Mesh| {
        let pairs: Vec<(DVec3, DVec3)> =
            (0..pasted.len()).filter(|&v| of(&a.positions[v])).map(|v| (like.positions[v], pasted[v])).collect();
        let fit = barymap::encoding::Similarity::fit(&pairs);
        pairs.iter().map(|(p, q)| fit.apply(*p).distance(*q)).fold(0.0, f64::max)
    };
    let (low, high) = (|p: &DVec3| p.y < -0.3, |p: &DVec3| p.y > 0.3);
    assert!(fitted(&low, &a) < 0.03, "{}", fitted(&low, &a));
    assert!(fitted(&high, &b) < 0.04, "{}", fitted(&high, &b));
    assert!(fitted(&high, &a) > 0.05, "the bounds tell the shapes apart: {}", fitted(&high, &a));
    // Painted white on the mesh it says the same; with frames the way there is shown.
    let paint: Vec<[u8; 3]> = a.positions.iter().map(|p| [(share(p) * 255.0).round() as u8; 3]).collect();
    write_ply(&a, Some(&paint), f.path("mask.ply")).unwrap();
    f.run("morph a.obj b.obj -o way --mask mask.ply --frames 3 --format ply").succeeds();
    let frame = |k: usize| read_mesh(f.path(&format!("way/frame_000{k}.ply"))).unwrap().mesh.positions;
    assert!(distance(&frame(0), &a.positions) < 1e-6);
    assert!(distance(&frame(2), &pasted) < 0.01, "{}", distance(&frame(2), &pasted));
}

#[test]
fn three_meshes_are_passed_through() {
    let (f, a, b) = balls();
    let mut c = a.clone();
    c.positions.iter_mut().for_each(|p| p.y *= 1.5);
    let count = c.vertex_count();
    write_obj(&c, f.path("c.obj")).unwrap();
    f.run("morph a.obj b.obj c.obj -o out --frames 3").succeeds();
    for (k, mesh) in [a, b, c].iter().enumerate() {
        let shape = read_mesh(f.path(&format!("out/frame_000{k}.obj"))).unwrap().mesh.positions;
        assert!(distance(&shape, &mesh.positions) < 1e-9, "{k}");
    }
    // Shares of the second and the third mesh, line by line.
    f.write("mask.txt", &vec!["0.25 0.5"; count].join("\n"));
    f.run("morph a.obj b.obj c.obj -o third.ply --mask mask.txt").succeeds();
    f.run("morph a.obj b.obj c.obj -o same.ply --weights 0.25,0.25,0.5").succeeds();
    let [third, same] = ["third.ply", "same.ply"].map(|name| read_mesh(f.path(name)).unwrap().mesh.positions);
    assert!(distance(&third, &same) < 1e-3, "{}", distance(&third, &same));
}

#[test]
fn masks_and_outputs_that_do_not_fit_are_told() {
    let (f, a, _) = balls();
    let n = a.vertex_count();
    f.write("short.txt", "0\n1\n");
    f.write("range.txt", &vec!["2"; n].join("\n"));
    f.write("words.txt", "white\n");
    f.run("morph a.obj b.obj -o out.obj --mask short.txt").fails(1, &["short.txt", "2 vertices"]);
    f.run("morph a.obj b.obj -o out.obj --mask range.txt").fails(1, &["range.txt", "vertex 0"]);
    f.run("morph a.obj b.obj -o out.obj --mask words.txt").fails(1, &["words.txt", "line 1"]);
    f.run("morph a.obj b.obj -o out.obj --mask a.obj").fails(1, &["a.obj"]);
    f.run("morph a.obj b.obj -o a.obj/such/out.glb").fails(1, &["a.obj"]);
    assert_eq!(f.run("morph a.obj b.obj -o out --mask short.txt --weights 0.5,0.5").code, Some(2));
    f.run("morph a.obj b.obj -o out.glb --seconds 0").fails(2, &["seconds"]);
    f.write("anchors.txt", "99999\n");
    f.run("morph a.obj b.obj -o out.glb --anchors anchors.txt").fails(1, &["99999"]);
    assert!(!f.path("out.obj").exists() && !f.path("out.glb").exists() && !f.path("out").exists());
}

#[test]
fn meshes_of_other_connectivity_take_that_of_the_first() {
    let f = Folder::spheres();
    f.run("morph s.obj t.obj --pairs a.json -o out --frames 5 --compatible c.obj --landmarks 150 --report r.json")
        .succeeds();
    let load = |name: &str| read_mesh(f.path(name)).unwrap().mesh;
    let (s, t, c) = (load("s.obj"), load("t.obj"), load("c.obj"));
    let frames: Vec<Mesh> = (0..5).map(|k| load(&format!("out/frame_000{k}.obj"))).collect();
    for frame in &frames {
        assert_eq!(frame.triangles(), s.triangles());
    }
    // The ends are exact, to the last bit.
    assert_eq!(frames[0].positions, s.positions);
    assert_eq!(frames[4].positions, c.positions);
    // The last one lies on the other mesh and fills it.
    let closest = barymap::geometry::ClosestPoints::new(&t, &barymap::geometry::Topology::new(&t));
    let off = c.positions.iter().map(|p| closest.nearest(*p).unwrap().1).fold(0.0, f64::max);
    assert!(off < 1e-5, "{off}");
    let report = f.json("r.json");
    let volume = |k: usize| report["frames"][k]["volume"].as_f64().unwrap();
    let (low, high) = (volume(0).min(volume(4)), volume(0).max(volume(4)));
    for k in 0..5 {
        assert!(volume(k) > 0.8 * low && volume(k) < 1.2 * high, "{k}: {}", volume(k));
        assert_eq!(report["frames"][k]["inverted"], 0);
    }
    assert_eq!(report["frames"][0]["stretch_all"].as_f64().unwrap(), 1.0);
    let inside = |m: &Mesh| -> f64 {
        (0..m.triangle_count()).map(|k| m.triangle_positions(k)).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
    };
    assert!((volume(4) / inside(&t) - 1.0).abs() < 0.03 && (volume(0) / inside(&s) - 1.0).abs() < 1e-9);
    assert_eq!(report["compatible"][0]["bad"], 0);
    // The same bytes on one thread; one blend and an animation go the same way.
    f.run_with(
        "morph s.obj t.obj --pairs a.json -o again --frames 2 --landmarks 150 --compatible d.obj",
        &[("RAYON_NUM_THREADS", "1")],
    )
    .succeeds();
    assert_eq!(f.bytes("c.obj"), f.bytes("d.obj"));
    f.run("morph s.obj t.obj --pairs a.json -o half.ply --weights 0.5,0.5 --landmarks 150").succeeds();
    f.run("morph s.obj t.obj --pairs a.json -o half.glb --frames 3 --landmarks 150").succeeds();
    assert!(load("half.ply").vertex_count() == s.vertex_count() && f.path("half.glb").exists());
}

/// The half-way shape of two meshes keeps its volume, and few triangles are inverted; `most` of
/// them in parts of all.
fn half_way(f: &Folder, meshes: &str, most: f64) {
    f.run(&format!("morph {meshes} -o half.ply --weights 0.5,0.5 --landmarks 200 --compatible c.obj --report r.json"))
        .succeeds();
    let report = f.json("r.json");
    let ends: Vec<f64> = report["volumes"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
    let frame = &report["frames"][0];
    let volume = frame["volume"].as_f64().unwrap();
    assert!(volume > 0.8 * ends[0].min(ends[1]) && volume < 1.2 * ends[0].max(ends[1]), "{volume} {ends:?}");
    // Better than that: between them.
    assert!((volume - ends[0]) * (volume - ends[1]) < 0.0, "{volume} {ends:?}");
    let triangles = read_mesh(f.path("half.ply")).unwrap().mesh.triangle_count() as f64;
    assert!(frame["inverted"].as_f64().unwrap() <= most * triangles, "{frame}");
    assert!(report["compatible"][0]["bad_area"].as_f64().unwrap() < 0.01, "{report}");
    assert!(report["compatible"][0]["bad"].as_u64() <= report["compatible"][0]["bad_before"].as_u64());
}

#[test]
fn the_built_in_characters_do_not_collapse_half_way() {
    let f = Folder::empty();
    let pair = barymap::models::character_pair();
    write_obj(&pair.source.mesh, f.path("a.obj")).unwrap();
    write_obj(&pair.target.mesh, f.path("b.obj")).unwrap();
    let (on_a, on_b) = pair.anchors(60);
    let list = |points: &[barymap::geometry::SurfacePoint]| -> serde_json::Value {
        points.iter().map(|p| serde_json::json!({"face": p.face, "barycentric": p.barycentric})).collect()
    };
    f.write("p.json", &serde_json::json!({"source": list(&on_a), "target": list(&on_b)}).to_string());
    half_way(&f, "a.obj b.obj --pairs p.json", 1e-3);
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn a_cat_becomes_a_lion() {
    let data = std::path::PathBuf::from(std::env::var("BARYMAP_DATA").unwrap());
    let folder = data.join("gt/cat_lion");
    let f = Folder::empty();
    for name in ["cat-00.obj", "lion-00.obj", "landmarks.txt"] {
        std::fs::copy(folder.join(name), f.path(name)).unwrap();
    }
    half_way(&f, "cat-00.obj lion-00.obj --pairs landmarks.txt", 5e-3);
}

#[test]
fn pairs_that_do_not_fit_are_told() {
    let f = Folder::spheres();
    f.run("morph s.obj t.obj -o bad").fails(1, &["vertices", "--pairs"]);
    f.run("morph s.obj t.obj --pairs a.json --pairs a.json -o bad").fails(2, &["--pairs", "2 files for 1"]);
    f.write("few.json", r#"{"source": [0, 50, 100], "target": [0, 50, 100]}"#);
    f.run("morph s.obj t.obj --pairs few.json -o bad").fails(1, &["few.json", "too few"]);
    f.write("far.json", r#"{"source": [0, 50, 100, 99999], "target": [0, 50, 100, 7]}"#);
    f.run("morph s.obj t.obj --pairs far.json -o bad").fails(1, &["far.json", "99999"]);
    f.write("nan.json", r#"{"source": [0, 50, 100, NaN], "target": [0, 50, 100, 7]}"#);
    f.run("morph s.obj t.obj --pairs nan.json -o bad").fails(1, &["nan.json", "JSON"]);
    f.write("one.json", r#"{"anchors": [0, 50, 100, 200]}"#);
    f.run("morph s.obj t.obj --pairs one.json -o bad").fails(1, &["one.json", "pairs are needed"]);
    assert_eq!(f.run("morph s.obj t.obj -o bad --compatible c.obj").code, Some(2));
    f.run("morph s.obj t.obj --pairs a.json -o bad --compatible s.obj/such/c.obj").fails(1, &["s.obj"]);
    // Two pairs that contradict one another are told.
    let pairs = f.json("a.json");
    let list = |side: &str, change: &dyn Fn(&mut Vec<serde_json::Value>)| {
        let mut list = pairs[side].as_array().unwrap().clone();
        change(&mut list);
        list
    };
    let (source, target) = (list("source", &|l| l[1] = l[0].clone()), list("target", &|_| ()));
    f.write("same.json", &serde_json::json!({"source": source, "target": target}).to_string());
    let ran = f.run("morph s.obj t.obj --pairs same.json -o same.ply --weights 0,1 --landmarks 150").succeeds();
    assert!(ran.stderr.contains("source anchors 0 and 1 coincide"), "{}", ran.stderr);
    // A second part without any pair has a guess, not a fault.
    let (sphere, mut far) = (read_mesh(f.path("s.obj")).unwrap().mesh, Vec::new());
    let n = sphere.vertex_count() as u32;
    let mut positions = sphere.positions.clone();
    positions.extend(sphere.positions.iter().map(|p| *p + DVec3::X * 3.0));
    far.extend(sphere.triangles());
    far.extend(sphere.triangles().iter().map(|t| t.map(|v| v + n)));
    // And an edge of three triangles, and one without area.
    far.extend([[0, 1, n + 5], [3, 3, 4]]);
    write_obj(&Mesh::from_triangles("two", positions, &far).unwrap(), f.path("two.obj")).unwrap();
    let ran = f.run("morph two.obj t.obj --pairs a.json -o odd.ply --weights 0.5,0.5 --landmarks 150");
    assert!(matches!(ran.code, Some(0 | 1)) && !ran.stderr.contains("panicked"), "{}", ran.stderr);
    assert!(!f.path("bad").exists() && !f.path("c.obj").exists());
}
