//! `barymap decal` end to end: textures, coordinates, and what it refuses.

use barymap::geometry::Mesh;
use barymap::io::{read_mesh, write_image, write_obj};
use barymap::models::shapes::{Diagonal, plane_grid, uv_sphere};
use barymap::picture::{Image, Pixels};
use glam::DVec3;

use crate::support::Folder;

/// `plane.obj` of side 1 with its texture `t.png`, `d.png`, a red picture with a green lower left
/// quarter, and `a.json`, which lays it on [0.25, 0.75]^2.
fn plane() -> Folder {
    let folder = Folder::empty();
    write_obj(&plane_grid(20, 20, 1.0, 1.0, Diagonal::Alternating), folder.path("plane.obj")).unwrap();
    let fill = |n: u32, f: &dyn Fn(u32, u32) -> [u8; 3]| {
        let samples = (0..n * n).flat_map(|i| f(i % n, i / n)).collect();
        Image::new(n, n, 3, Pixels::U8(samples)).unwrap()
    };
    write_image(&fill(128, &|x, y| [x as u8, y as u8, 255]), folder.path("t.png")).unwrap();
    let green = |x, y| if x < 32 && y >= 32 { [0, 255, 0] } else { [255, 0, 0] };
    write_image(&fill(64, &green), folder.path("d.png")).unwrap();
    folder.write("a.json", &corners([(0.25, 0.25), (0.75, 0.25), (0.75, 0.75), (0.25, 0.75)]));
    folder
}

fn corners(at: [(f64, f64); 4]) -> String {
    let entries = at.map(|(x, y)| format!("{{\"position\": [{x}, {y}, 0]}}"));
    format!("{{\"anchors\": [{}]}}", entries.join(", "))
}

#[test]
fn a_picture_lands_where_its_anchors_are() {
    let f = plane();
    f.run("decal plane.obj --anchors a.json --image d.png --texture t.png -o o.png --report r.json").succeeds();
    let (out, before) = (f.image("o.png"), f.image("t.png"));
    assert_eq!((out.width, out.channels, out.depth()), (before.width, before.channels, before.depth()));
    // Texture row 0 is v = 1: the plane's y goes up.
    let color = |x: u32, y: u32| [0, 1, 2].map(|c| out.get(x, y, c));
    assert_eq!(color(48, 80), [0.0, 1.0, 0.0]);
    assert_eq!(color(80, 80), [1.0, 0.0, 0.0]);
    assert_eq!(color(48, 48), [1.0, 0.0, 0.0]);
    for (x, y) in [(10, 10), (29, 64), (98, 64), (64, 29), (64, 98), (127, 127)] {
        assert_eq!(color(x, y), [0, 1, 2].map(|c| before.get(x, y, c)), "{x} {y}");
    }
    let report = f.json("r.json");
    assert!(report["stretch_all"].as_f64().unwrap() > 0.9999 && report["shown"].as_f64().unwrap() == 1.0);
    assert_eq!(report["flipped_faces"], 0);
    // Alone, it is on transparent ground.
    f.run("decal plane.obj --anchors a.json --image d.png --size 64 -o alone.png --layout averages --backend cpu")
        .succeeds();
    let alone = f.image("alone.png");
    assert_eq!((alone.width, alone.channels), (64, 4));
    assert!(alone.get(2, 2, 3) == 0.0 && alone.get(32, 30, 3) == 1.0 && alone.get(32, 30, 0) > 0.9);
    // The same bytes again, on one thread.
    f.run_with(
        "decal plane.obj --anchors a.json --image d.png --size 64 -o again.png --layout averages --backend cpu",
        &[("RAYON_NUM_THREADS", "1")],
    )
    .succeeds();
    assert_eq!(f.bytes("alone.png"), f.bytes("again.png"));
}

#[test]
fn coordinates_are_written_with_the_mesh_or_the_patch_alone() {
    let f = Folder::empty();
    write_obj(&uv_sphere(1.0, 40, 24), f.path("s.obj")).unwrap();
    let at = [(-0.4, -0.4), (0.4, -0.4), (0.4, 0.4), (-0.4, 0.4)].map(|(x, y)| DVec3::new(x, y, 1.0).normalize());
    let entries = at.map(|p| format!("{{\"position\": [{}, {}, {}]}}", p.x, p.y, p.z)).join(", ");
    f.write("a.json", &format!("{{\"anchors\": [{entries}], \"uv\": [[0, 0], [1, 0], [1, 1], [0, 1]]}}"));
    f.run("decal s.obj --anchors a.json -o whole.obj --report r.json").succeeds();
    f.run("decal s.obj --anchors a.json -o part.obj --patch").succeeds();
    let load = |name: &str| -> Mesh { read_mesh(f.path(name)).unwrap().mesh };
    let (sphere, whole, part) = (load("s.obj"), load("whole.obj"), load("part.obj"));
    assert_eq!((&whole.positions, whole.triangles()), (&sphere.positions, sphere.triangles()));
    let shown = (0..whole.triangle_count()).filter(|&t| whole.triangle_texcoords(t).is_some()).count();
    assert!(shown == part.triangle_count() && shown < whole.triangle_count() / 5 && shown > 20, "{shown}");
    assert!((0..part.triangle_count()).all(|t| part.triangle_texcoords(t).is_some()));
    assert!(f.json("r.json")["stretch_all"].as_f64().unwrap() > 0.98);
    // The far side of the sphere is bare.
    assert!(part.positions.iter().all(|p| p.z > 0.5));
}

#[test]
fn bad_input_is_refused_with_a_remedy() {
    let f = plane();
    let run = |words: &str| f.run(&format!("decal plane.obj --image d.png -o bad.png {words}"));
    f.write("three.json", r#"{"anchors": [0, 20, 440]}"#);
    run("--anchors three.json").fails(1, &["three.json", "3 anchors are too few", "uv"]);
    f.write("far.json", r#"{"anchors": [0, 20, 440, {"position": [5, 5, 5]}]}"#);
    run("--anchors far.json").fails(1, &["far.json", "anchor 3", "off"]);
    f.write("nan.json", r#"{"anchors": [0, 20, 440, {"position": [NaN, 5, 5]}]}"#);
    run("--anchors nan.json").fails(1, &["nan.json", "JSON"]);
    f.write("order.json", &corners([(0.25, 0.25), (0.75, 0.75), (0.75, 0.25), (0.25, 0.75)]));
    run("--anchors order.json").fails(1, &["contradict", "order"]);
    f.write("same.json", r#"{"anchors": [0, 20, 440, 440]}"#);
    run("--anchors same.json").fails(1, &["anchors 2 and 3", "contradict"]);
    f.write("line.json", r#"{"anchors": [0, 20, 440, 420], "uv": [[0, 0], [0.5, 0.5], [1, 1], [0.2, 0.2]]}"#);
    run("--anchors line.json").fails(1, &["one line"]);
    f.write("out.json", r#"{"anchors": [0, 20, 440, 9999]}"#);
    run("--anchors out.json").fails(1, &["out.json", "9999"]);
    run("--anchors a.json --patch").fails(2, &["--patch", ".obj"]);
    run("--anchors a.json --opacity 2").fails(2, &["--opacity"]);
    run("--anchors a.json --material skin").fails(2, &["--material", "skin"]);
    f.run("decal plane.obj --anchors a.json -o bad.png").fails(2, &["--image"]);
    f.run("decal plane.obj --anchors a.json --image d.png --texture t.png -o bad.obj").fails(2, &["--texture"]);
    f.run("decal plane.obj --anchors a.json --image d.png -o bad.gif").fails(2, &["bad.gif"]);
    f.run("decal plane.obj --anchors a.json --image a.json -o bad.png").fails(1, &["a.json", "picture"]);
    // Without texture coordinates.
    let bare = read_mesh(f.path("plane.obj")).unwrap().mesh;
    let bare = Mesh::from_triangles("bare", bare.positions.clone(), &bare.triangles()).unwrap();
    write_obj(&bare, f.path("bare.obj")).unwrap();
    f.run("decal bare.obj --anchors a.json --image d.png -o bad.png").fails(1, &["bare.obj", "barymap unwrap"]);
    f.run("decal bare.obj --anchors a.json -o fine.obj").succeeds();
    // On parts that are not connected.
    let mut positions = bare.positions.clone();
    positions.extend(bare.positions.iter().map(|p| *p + DVec3::X * 2.0));
    let n = bare.vertex_count() as u32;
    let mut triangles = bare.triangles();
    triangles.extend(bare.triangles().iter().map(|t| t.map(|v| v + n)));
    write_obj(&Mesh::from_triangles("two", positions, &triangles).unwrap(), f.path("two.obj")).unwrap();
    f.write("two.json", &format!("{{\"anchors\": [0, 20, {}, 420]}}", n + 440));
    f.run("decal two.obj --anchors two.json -o bad.obj").fails(1, &["anchors 0 and 2", "not connected"]);
    assert!(!f.names().iter().any(|name| name.starts_with("bad")), "{:?}", f.names());
}

#[test]
fn meshes_with_faults_are_survived() {
    let f = plane();
    let mesh = read_mesh(f.path("plane.obj")).unwrap().mesh;
    // A third sheet at an inner edge, a triangle without area, one twice.
    let mut positions = mesh.positions.clone();
    positions.push(DVec3::new(0.5, 0.5, 0.3));
    let mut triangles = mesh.triangles();
    let t = triangles[420];
    triangles.extend([[t[0], t[1], positions.len() as u32 - 1], [t[0], t[0], t[1]], triangles[5]]);
    write_obj(&Mesh::from_triangles("odd", positions, &triangles).unwrap(), f.path("odd.obj")).unwrap();
    f.run("decal odd.obj --anchors a.json -o o.obj --report r.json").succeeds();
    assert!(f.json("r.json")["shown"].as_f64().unwrap() > 0.98);
    f.run("decal odd.obj --anchors a.json -o p.obj --layout averages").succeeds();
}
