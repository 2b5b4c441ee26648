//! `barymap unwrap`, `transfer --unwrap`, and what is said of texture coordinates that are unfit.

use barymap::geometry::texcoords::{Islands, OverlapOptions, overlaps};
use barymap::geometry::{Mesh, SurfacePoint};
use barymap::io::read_mesh;
use barymap::picture::Image;
use glam::DVec2;

use crate::support::{Folder, STRETCH, difference, waves};

const TRANSFER: &str = "transfer --backend cpu --source s.obj --target t.obj --texture s.png --anchors a.json --method rbf --size 256 --margin 4";

/// `name` without its texture coordinates.
fn strip(f: &Folder, name: &str) {
    let plain = |line: &str| line.split(' ').map(|w| w.split('/').next().unwrap()).collect::<Vec<_>>().join(" ") + "\n";
    let text: String = f.read(name).lines().filter(|l| !l.starts_with("vt")).map(plain).collect();
    f.write(name, &text);
}

#[track_caller]
fn is_sound(mesh: &Mesh) {
    let islands = Islands::new(mesh);
    assert!(islands.missing.is_empty());
    assert!(islands.islands.iter().all(|i| i.is_disk() && !i.mirrored), "{:?}", islands.islands);
    let found = overlaps(mesh, &islands, &OverlapOptions::default());
    assert!(found.overlaps.is_empty() && found.complete, "{found:?}");
}

#[test]
fn a_mesh_gets_charts_and_keeps_everything_else() {
    let f = Folder::spheres();
    strip(&f, "t.obj");
    let before = read_mesh(f.path("t.obj")).unwrap().mesh;
    assert!(!before.has_texcoords());
    let ran = f.run("unwrap t.obj -o u.obj --size 512 --margin 8 --layout l.png --report r.json").succeeds();
    assert!(ran.stdout.contains("charts") && ran.stdout.contains("of the texture used"), "{}", ran.stdout);
    let after = read_mesh(f.path("u.obj")).unwrap().mesh;
    assert_eq!((&after.positions, after.triangles()), (&before.positions, before.triangles()));
    is_sound(&after);
    let report = &f.json("r.json")["unwrap"];
    assert_eq!(report["charts"].as_u64().unwrap() as usize, Islands::new(&after).islands.len());
    assert_eq!((report["not_disks"].as_u64(), report["gap"].as_u64()), (Some(0), Some(8)));
    assert!(report["packing_efficiency"].as_f64().unwrap() > 0.4, "{report}");
    assert!(report["angle_distortion"]["p95"].as_f64().unwrap() < 1.2, "{report}");
    let layout = f.image("l.png");
    let drawn = (0..512)
        .flat_map(|y| (0..512).map(move |x| (x, y)))
        .filter(|&(x, y)| layout.get(x, y, 0) < 1.0 || layout.get(x, y, 2) < 1.0);
    let share = drawn.count() as f64 / (512.0 * 512.0);
    assert!((share - report["packing_efficiency"].as_f64().unwrap()).abs() < 0.02, "{share}");
    // The same bytes again, and on one thread.
    f.run_with("unwrap t.obj -o v.obj --size 512 --margin 8", &[("RAYON_NUM_THREADS", "1")]).succeeds();
    assert_eq!(f.bytes("u.obj"), f.bytes("v.obj"));
    f.run("unwrap t.obj -o u.glb").succeeds();
    is_sound(&read_mesh(f.path("u.glb")).unwrap().mesh);
}

/// The colour of a picture at texture coordinates, linearly between texels.
fn look_up(image: &Image, uv: DVec2, c: u32) -> f64 {
    let x = (uv.x * f64::from(image.width) - 0.5).clamp(0.0, f64::from(image.width - 1));
    let y = ((1.0 - uv.y) * f64::from(image.height) - 0.5).clamp(0.0, f64::from(image.height - 1));
    let (i, j) = (x as u32, y as u32);
    let at = |i: u32, j: u32| f64::from(image.get(i.min(image.width - 1), j.min(image.height - 1), c));
    let (s, t) = (x.fract(), y.fract());
    (1.0 - t) * ((1.0 - s) * at(i, j) + s * at(i + 1, j)) + t * ((1.0 - s) * at(i, j + 1) + s * at(i + 1, j + 1))
}

/// Mean and largest difference of two textured meshes of the same triangles at points of their
/// surface.
fn difference_on_surface(a: (&Mesh, &Image), b: (&Mesh, &Image)) -> (f64, f64) {
    let (mut sum, mut most, mut count) = (0.0, 0.0f64, 0);
    for t in 0..a.0.triangle_count() {
        for w in [[0.6, 0.2, 0.2], [0.2, 0.6, 0.2], [0.2, 0.2, 0.6], [0.34, 0.33, 0.33], [0.5, 0.49, 0.01]] {
            let uv = |m: &Mesh| {
                let c = m.triangle_texcoords(t).unwrap();
                c[0] * w[0] + c[1] * w[1] + c[2] * w[2]
            };
            for c in 0..3 {
                let d = (look_up(a.1, uv(a.0), c) - look_up(b.1, uv(b.0), c)).abs();
                (sum, most, count) = (sum + d, most.max(d), count + 1);
            }
        }
    }
    (sum / f64::from(count), most)
}

#[test]
fn a_texture_on_new_charts_is_the_one_on_the_targets_own() {
    let f = Folder::spheres();
    f.run(&format!("{TRANSFER} -o own.png --coverage c.png")).succeeds();
    assert!(difference(&f.image("own.png"), &waves(256), &f.image("c.png")) < 0.05);
    f.run(&format!("{TRANSFER} -o new.png --unwrap --unwrapped u.obj --model m.glb --report r.json")).succeeds();
    let (own, new) = (read_mesh(f.path("t.obj")).unwrap().mesh, read_mesh(f.path("u.obj")).unwrap().mesh);
    is_sound(&new);
    let (own_image, new_image) = (f.image("own.png"), f.image("new.png"));
    let (mean, most) = difference_on_surface((&own, &own_image), (&new, &new_image));
    assert!(mean < 0.012 && most < 0.15, "mean {mean}, largest {most}");
    // The comparison sees a texture on the wrong charts.
    let (wrong, _) = difference_on_surface((&own, &own_image), (&own, &new_image));
    assert!(wrong > 0.1, "{wrong}");
    let report = f.json("r.json");
    assert!(report["unwrap"]["charts"].as_u64().unwrap() > 1 && report["charts"].is_null(), "{report}");
    let model = read_mesh(f.path("m.glb")).unwrap().mesh;
    assert!(model.has_texcoords() && Islands::new(&model).islands.len() == Islands::new(&new).islands.len());
    // Points are where they were: the spheres' own.
    let p = SurfacePoint::new(3, [0.2, 0.3, 0.5]).position(&new);
    assert!(((p / STRETCH).length() - 1.0).abs() < 0.02);
}

#[test]
fn targets_without_texture_coordinates_need_the_option() {
    let f = Folder::spheres();
    strip(&f, "t.obj");
    f.run(&format!("{TRANSFER} -o o.png")).fails(1, &["t.obj", "no texture coordinates", "--unwrap"]);
    f.run(&format!("{TRANSFER} -o o.png --unwrap")).fails(2, &["--unwrap", "--unwrapped"]);
    f.run(&format!("{TRANSFER} -o o.png --unwrap --unwrapped u.ply")).fails(2, &["u.ply", ".obj"]);
    let wide = TRANSFER.replace("--size 256", "--size 256x128");
    f.run(&format!("{wide} -o o.png --unwrap --unwrapped u.obj")).fails(2, &["square"]);
    assert!(!f.path("o.png").exists() && !f.path("u.obj").exists());
    f.run(&format!("{TRANSFER} -o o.png --unwrap --unwrapped u.obj --report r.json")).succeeds();
    assert!(f.json("r.json")["valid_fraction"].as_f64().unwrap() > 0.9);
}

#[test]
fn a_batch_unwraps_too() {
    let f = Folder::spheres();
    std::fs::create_dir(f.path("in")).unwrap();
    strip(&f, "t.obj");
    for name in ["t.obj", "a.json"] {
        std::fs::copy(f.path(name), f.path(&format!("in/{}", name.replace("a.json", "t.json")))).unwrap();
    }
    let batch =
        "batch --backend cpu --source s.obj --texture s.png --targets in --method rbf --size 128 --margin 4 -o out";
    f.run(&format!("{batch} --unwrap --unwrapped charts.obj")).succeeds();
    is_sound(&read_mesh(f.path("out/t/charts.obj")).unwrap().mesh);
    assert!(f.json("out/t/item.json")["report"]["unwrap"]["charts"].as_u64().unwrap() > 1);
    f.run(&format!("{batch} --unwrap --unwrapped charts.obj --chart-angle 40 --report r.json")).succeeds();
    assert_eq!(f.json("r.json")["done"], 1, "another angle is another result");
}

#[test]
fn overlapping_and_mirrored_islands_are_named() {
    let f = Folder::spheres();
    f.run(&format!("{TRANSFER} -o o.png --report r.json")).succeeds();
    let sound = &f.json("r.json")["charts"];
    assert_eq!((sound["islands"].as_u64(), sound["overlapping_pairs"].as_u64()), (Some(1), Some(0)), "{sound}");
    // The lower half of the sphere's texture is folded onto the upper.
    let text = f.read("t.obj");
    let fold = |line: &str| match line.strip_prefix("vt ") {
        None => line.to_owned() + "\n",
        Some(uv) => {
            let (u, v) = uv.split_once(' ').unwrap();
            let v: f64 = v.parse().unwrap();
            format!("vt {u} {}\n", 0.5 + (v - 0.5).abs())
        }
    };
    f.write("t.obj", &text.lines().map(fold).collect::<String>());
    let ran = f.run(&format!("{TRANSFER} -o o.png --report r.json")).succeeds();
    let charts = &f.json("r.json")["charts"];
    assert_eq!((charts["islands"].as_u64(), charts["overlapping_pairs"].as_u64()), (Some(2), Some(1)), "{charts}");
    assert!(charts["overlapping_area"].as_f64().unwrap() > 0.99 && charts["overlaps_complete"] == true);
    assert!((charts["overlaps"][0]["share_of_texture"].as_f64().unwrap() - 0.5).abs() < 0.05, "{charts}");
    assert!((charts["mirrored_area"].as_f64().unwrap() - 0.5).abs() < 0.01);
    for part in ["t.obj", "island 0", "island 1", "overlap", "--unwrap", "1 of 2 islands", "mirrored"] {
        assert!(ran.stderr.contains(part), "{part:?} is not in {}", ran.stderr);
    }
    let ran = f.run(&format!("{TRANSFER} -o o.png --unwrap --unwrapped u.obj")).succeeds();
    assert!(!ran.stderr.contains("overlap"), "{}", ran.stderr);
    is_sound(&read_mesh(f.path("u.obj")).unwrap().mesh);
}

#[test]
fn what_cannot_be_unwrapped_is_refused() {
    let f = Folder::spheres();
    for (command, code, word) in [
        ("unwrap t.obj -o u.ply", 2, "u.ply"),
        ("unwrap t.obj -o t.obj/u.obj", 1, "t.obj"),
        ("unwrap t.obj -o u.obj --layout l.gif", 2, "l.gif"),
        ("unwrap t.obj -o u.obj --size 4", 2, "--size"),
        ("unwrap t.obj -o u.obj --chart-angle 90", 2, "--chart-angle"),
        ("unwrap nothing.obj -o u.obj", 1, "nothing.obj"),
    ] {
        f.run(command).fails(code, &[word]);
        assert!(!f.path("u.obj").exists(), "{command}");
    }
    f.write("flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n");
    assert_eq!(f.run("unwrap flat.obj -o u.obj").code, Some(1));
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn real_meshes_get_sound_charts_in_seconds() {
    let data = std::path::PathBuf::from(std::env::var_os("BARYMAP_DATA").expect("BARYMAP_DATA"));
    let f = Folder::empty();
    // Genus 3, open and many components, non-manifold, textured quads, 100,000 faces.
    for (name, angle, stretch) in [
        ("mesh/3holes_7k.obj", 1.05, 1.2),
        ("mesh/goathead_5.5k.obj", 1.15, 1.5),
        ("bad/camel_nonmanifold.obj", 1.05, 1.2),
        ("textured/human_male/human_male.obj", 1.05, 1.2),
        ("textured/spot/spot_quads.obj", 1.05, 1.2),
        ("mesh/koala_100k.obj", 1.05, 1.2),
    ] {
        let path = data.join(name);
        let start = std::time::Instant::now();
        let mut command = f.command();
        command.arg("unwrap").arg(&path).args(["-o", "u.obj", "--report", "r.json", "--quiet"]);
        f.finish(&mut command).succeeds();
        assert!(start.elapsed().as_secs() < 100, "{name} took {:?}", start.elapsed());
        let (before, after) = (read_mesh(&path).unwrap().mesh, read_mesh(f.path("u.obj")).unwrap().mesh);
        assert_eq!(before.triangles(), after.triangles(), "{name}");
        is_sound(&after);
        let report = &f.json("r.json")["unwrap"];
        assert!(report["angle_distortion"]["p95"].as_f64().unwrap() < angle, "{name}: {report}");
        assert!(report["stretch"]["p95"].as_f64().unwrap() < stretch, "{name}: {report}");
        assert!(report["packing_efficiency"].as_f64().unwrap() > 0.35, "{name}: {report}");
    }
    for entry in std::fs::read_dir(data.join("bad")).unwrap() {
        let path = entry.unwrap().path();
        let mut command = f.command();
        command.arg("unwrap").arg(&path).args(["-o", "b.obj"]);
        let ran = f.finish(&mut command);
        match ran.code {
            Some(0) => is_sound(&read_mesh(f.path("b.obj")).unwrap().mesh),
            Some(1) => assert!(ran.message().len() > 20, "{ran:?}"),
            _ => panic!("{}: {ran:?}", path.display()),
        }
    }
}
