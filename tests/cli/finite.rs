//! Numbers that are not finite, or would overflow, end in an error that names them; so do positions
//! far from their mesh.

use barymap::io::write_obj;
use barymap::models::shapes::uv_sphere;
use glam::DVec3;
use serde_json::json;

use crate::support::Folder;

/// A cube from -2 to 2 as OBJ text, leaning by `lean`, every coordinate times `scale`.
fn cube(lean: f64, scale: f64) -> String {
    let mut text = String::new();
    for z in [-2.0, 2.0] {
        for (x, y) in [(-2.0, -2.0), (2.0, -2.0), (2.0, 2.0), (-2.0, 2.0)] {
            let (x, y, z): (f64, f64, f64) = ((x + lean * y) * scale, y * scale, z * scale);
            text += &format!("v {x:?} {y:?} {z:?}\n");
        }
    }
    text + "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n"
}

/// A tetrahedron whose corners lie `size` along the axes.
fn tetrahedron(size: f64) -> String {
    format!("v 0 0 0\nv {size:?} 0 0\nv 0 {size:?} 0\nv 0 0 {size:?}\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
}

#[test]
fn a_cage_far_too_large_or_small_names_the_vertex_and_says_to_scale() {
    // Model, cage, deformed cage; and what is said.
    for (sizes, words) in [
        ([1e300, 1.0, 1.0], ["model.obj", "vertex 1 is at (1e300"]),
        ([1e155, 1.0, 1.0], ["model.obj", "vertex 1 is at (1e155"]),
        ([1.0, 1e300, 1.0], ["cage.obj", "vertex 0 is at (-2e300"]),
        ([1.0, 1.0, 1e300], ["deformed.obj", "vertex 0 is at"]),
        ([1.0, 1.0, 1e155], ["deformed.obj", "vertex 0 is at"]),
        ([1e-300, 1.0, 1.0], ["model.obj", "1e-300 wide"]),
        ([1.0, 1e-300, 1.0], ["cage.obj", "4e-300 wide"]),
    ] {
        let f = Folder::empty();
        f.write("model.obj", &tetrahedron(sizes[0]));
        f.write("cage.obj", &cube(0.0, sizes[1]));
        f.write("deformed.obj", &cube(0.2, sizes[2]));
        let ran = f.run("cage model.obj --from cage.obj --to deformed.obj -o o.obj --backend cpu --report r.json");
        ran.fails(1, &[words[0], words[1], "Scale the model"]);
        assert!(!f.path("o.obj").exists() && !f.path("r.json").exists());
    }
}

#[test]
fn sizes_that_numbers_hold_work_as_ever() {
    for size in [1e-60, 1e-6, 1e13, 1e60] {
        let f = Folder::empty();
        f.write("model.obj", &tetrahedron(size));
        f.write("cage.obj", &cube(0.0, size));
        f.write("deformed.obj", &cube(0.2, size));
        f.run("cage model.obj --from cage.obj --to deformed.obj -o o.obj --backend reference").succeeds();
        let found = barymap::io::read_mesh(f.path("o.obj")).unwrap().mesh;
        // Leaning is affine, which coordinates reproduce.
        for (v, at) in [DVec3::ZERO, DVec3::X, DVec3::new(0.2, 1.0, 0.0), DVec3::Z].into_iter().enumerate() {
            assert!(found.positions[v].distance(at * size) < 1e-9 * size, "{size:e}: {}", found.positions[v]);
        }
    }
}

#[test]
fn every_command_refuses_coordinates_that_overflow() {
    let f = Folder::spheres();
    f.write("huge.obj", &tetrahedron(1e300));
    f.write("h.json", &json!({"handles": [{"vertex": 0, "position": [0, 0, 1]}]}).to_string());
    f.write("b.json", &json!({"anchors": [0, 1, 2, 3]}).to_string());
    for command in [
        "check huge.obj --anchors b.json",
        "render huge.obj -o o.png",
        "embed huge.obj -o o.npy",
        "deform huge.obj --handles h.json -o o.obj",
        "remesh s.obj --base huge.obj --levels 1 -o o.obj",
        "remesh huge.obj --base s.obj --levels 1 -o o.obj",
        "morph huge.obj huge.obj --weights 0.5,0.5 -o o.obj",
        "unwrap huge.obj -o o.obj",
        "map --source huge.obj --target t.obj --anchors a.json -o o.csv",
        "map --source s.obj --target huge.obj --anchors a.json -o o.csv",
        "spline huge.obj --points b.json -o o.obj",
    ] {
        f.run(command).fails(1, &["huge.obj", "vertex 1 is at (1e300, 0.0, 0.0)", "Scale the model"]);
        assert!(["o.obj", "o.png", "o.npy", "o.csv"].iter().all(|o| !f.path(o).exists()), "{command}");
    }
}

#[test]
fn a_vertex_that_is_no_number_is_not_written() {
    let f = Folder::empty();
    f.write("m.obj", &(tetrahedron(1.0) + "v nan 0 0\n"));
    f.write("h.json", &json!({"handles": [{"vertex": 0, "position": [0, 0, 0]}, {"vertex": 1, "position": [1.5, 0, 0]}, {"vertex": 2, "position": [0, 1, 0]}]}).to_string());
    for output in ["o.obj", "o.ply"] {
        let ran = f.run(&format!("deform m.obj --handles h.json -o {output} --backend cpu"));
        ran.fails(1, &[output, "vertex 4, x would be NaN"]);
        assert!(!f.path(output).exists());
    }
}

/// Anchors for the spheres whose first source is `off` beyond the surface of `s.obj`, along x.
fn anchors(f: &Folder, off: f64) {
    let mut value = f.json("a.json");
    value["source"][0] = json!({"position": [1.0 + off, 0.0, 0.0]});
    value["target"][0] = json!({"position": [1.1, 0.0, 0.0]});
    f.write("far.json", &value.to_string());
}

/// The diagonal of the box around `s.obj`.
fn diagonal(f: &Folder) -> f64 {
    let (low, high) = barymap::io::read_mesh(f.path("s.obj")).unwrap().mesh.bounds().unwrap();
    low.distance(high)
}

#[test]
fn positions_beyond_a_hundred_sizes_are_errors_in_every_command() {
    let f = Folder::spheres();
    let size = diagonal(&f);
    let at = |sizes: f64| json!({"position": [1.0 + sizes * size, 0.0, 0.0]});
    for (sizes, fine) in [(99.0, true), (101.0, false), (1e200, false)] {
        anchors(&f, sizes * size);
        f.write("one.json", &json!({"anchors": [at(sizes), 1, 2, 3]}).to_string());
        f.write("points.json", &json!([0, 40, 80, at(sizes)]).to_string());
        f.write("h.json", &json!({"handles": [{"vertex": 0, "position": [0, 0, 1]}, {"vertex": 300, "position": [1.0 + sizes * size, 0, 0]}]}).to_string());
        let words: &[&str] =
            if sizes < 1e100 { &["101 times its diagonal", "Check its units"] } else { &["Check its units"] };
        for (command, file, entry) in [
            (
                "map --source s.obj --target t.obj --anchors far.json -o o.csv --method rbf --backend cpu",
                "far.json",
                "anchor 0",
            ),
            ("check s.obj --anchors one.json", "one.json", "anchor 0"),
            ("render s.obj --anchors one.json --size 32 -o o.png", "one.json", "anchor 0"),
            ("spline s.obj --points points.json -o o.obj", "points.json", "anchor 3"),
            (
                "deform s.obj --handles h.json --quality preview -o o.obj --backend cpu",
                "h.json",
                "handle 1 (vertex 300)",
            ),
        ] {
            let ran = f.run(command);
            if fine {
                assert!(!ran.stderr.contains("times its diagonal"), "{command}: {}", ran.stderr);
            } else {
                ran.fails(1, &[&[file, entry, "lies "], words].concat());
            }
        }
    }
}

#[test]
fn moves_of_positions_are_told_beyond_rounding() {
    let f = Folder::spheres();
    let size = diagonal(&f);
    for (part, told) in [(1e-7, false), (1e-5, true)] {
        // Beside a vertex of the surface, along its normal.
        f.write("one.json", &json!({"anchors": [{"position": [0.0, 0.0, 1.0 + part * size]}]}).to_string());
        let ran = f.run("check s.obj --anchors one.json").succeeds();
        assert_eq!(ran.stderr.contains("were moved by up to"), told, "{part}: {}", ran.stderr);
    }
}

#[test]
fn a_base_far_from_its_surface_is_refused() {
    let f = Folder::empty();
    write_obj(&uv_sphere(1.0, 24, 16), f.path("m.obj")).unwrap();
    // Far off; and so that all of it lands on one vertex, where edges would have no length.
    for (off, words) in [(1000.0, ["vertex 0", "times its diagonal"]), (100.0, ["b.obj", "closest to one point of"])] {
        let mut base = uv_sphere(1e-9, 4, 3);
        base.positions.iter_mut().for_each(|p| *p += off * DVec3::Y);
        write_obj(&base, f.path("b.obj")).unwrap();
        f.run("remesh m.obj --base b.obj --levels 1 -o o.obj --report r.json").fails(1, &words);
        assert!(!f.path("o.obj").exists() && !f.path("r.json").exists());
    }
}
