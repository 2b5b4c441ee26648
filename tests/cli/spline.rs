//! `barymap spline`.

use barymap::geometry::{ClosestPoints, Mesh, Topology};
use barymap::io::read_mesh;
use barymap::models::shapes::{icosphere, plane_grid, uv_sphere};
use glam::DVec3;
use serde_json::json;

use crate::support::Folder;

/// A unit sphere and control points around its equator, given in all three forms.
fn sphere() -> Folder {
    let f = Folder::empty();
    barymap::io::write_obj(&uv_sphere(1.0, 24, 16), f.path("s.obj")).unwrap();
    let mesh = read_mesh(f.path("s.obj")).unwrap().mesh;
    let at = |i: usize| DVec3::new((i as f64 * 0.7).cos(), 0.3 * (i as f64).sin(), (i as f64 * 0.7).sin());
    let nearest = |p: DVec3| {
        (0..mesh.vertex_count())
            .min_by(|&a, &b| mesh.positions[a].distance(p).total_cmp(&mesh.positions[b].distance(p)))
            .unwrap()
    };
    let closest = ClosestPoints::new(&mesh, &Topology::new(&mesh));
    let points: Vec<_> = (0..9)
        .map(|i| match i % 3 {
            0 => json!(nearest(at(i))),
            1 => {
                let p = closest.nearest(at(i)).unwrap().0;
                json!({"face": p.face, "barycentric": p.barycentric})
            }
            _ => json!({"position": at(i).to_array()}),
        })
        .collect();
    f.write("p.json", &json!(points).to_string());
    f
}

/// The points and lines of an OBJ polyline.
fn polyline(text: &str) -> (Vec<DVec3>, Vec<Vec<usize>>) {
    let numbers = |line: &str| line[2..].split(' ').map(|x| x.parse::<f64>().unwrap()).collect::<Vec<_>>();
    let points = text.lines().filter(|l| l.starts_with("v ")).map(|l| DVec3::from_slice(&numbers(l))).collect();
    let lines = text
        .lines()
        .filter(|l| l.starts_with("l "))
        .map(|l| numbers(l).into_iter().map(|i| i as usize - 1).collect())
        .collect();
    (points, lines)
}

fn on_surface(mesh: &Mesh, points: &[DVec3]) -> f64 {
    let closest = ClosestPoints::new(mesh, &Topology::new(mesh));
    points.iter().map(|p| closest.nearest(*p).unwrap().1).fold(0.0, f64::max)
}

#[test]
fn curves_lie_on_the_mesh_and_closed_ones_are_closed() {
    let f = sphere();
    let mesh = read_mesh(f.path("s.obj")).unwrap().mesh;
    for (k, options) in [
        "",
        "--closed",
        "--closed --mode subdivision",
        "--degree 5",
        "--kind bezier --degree 4",
        "--kind bezier --closed",
        "--degree 1 --closed",
    ]
    .into_iter()
    .enumerate()
    {
        let name = format!("c{k}.obj");
        let ran = f.run(&format!("spline s.obj --points p.json -o {name} --report r.json {options}")).succeeds();
        assert!(ran.stdout.contains("direct and subdivided curves differ"), "{}", ran.stdout);
        let (points, lines) = polyline(&f.read(&name));
        assert_eq!(lines.len(), 1, "{options}");
        assert!(on_surface(&mesh, &points) < 1e-14, "{options}");
        let report = &f.json("r.json")["spline"];
        assert_eq!(report["points"], points.len());
        let closed = options.contains("closed");
        assert_eq!((points[0] == points[points.len() - 1], &report["closed"]), (closed, &json!(closed)));
        assert!(report["disagreement"]["distance"].as_f64().unwrap() < 0.2, "{report}");
        assert!(report["snap_distance"].as_array().unwrap().len() == 9);
    }
    // The same bytes again on one thread, and more points where asked for.
    f.run_with("spline s.obj --points p.json -o d.obj --closed", &[("RAYON_NUM_THREADS", "1")]).succeeds();
    assert_eq!(f.bytes("d.obj"), f.bytes("c1.obj"));
    f.run("spline s.obj --points p.json -o e.obj --closed --samples 5000").succeeds();
    assert!(polyline(&f.read("e.obj")).0.len() > 5000);
}

#[test]
fn all_formats_are_written() {
    let f = sphere();
    f.run("spline s.obj --points p.json -o c.ply --closed").succeeds();
    let bytes = f.bytes("c.ply");
    let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let head = String::from_utf8(bytes[..end].to_vec()).unwrap();
    let count = |element: &str| -> usize {
        head.lines().find_map(|l| l.strip_prefix(element)).unwrap().trim().parse().unwrap()
    };
    let (points, edges) = (count("element vertex"), count("element edge"));
    assert!(head.contains("property double parameter") && head.contains("property double b2"), "{head}");
    assert_eq!((edges, bytes.len() - end), (points - 1, points * 64 + edges * 8));
    f.run("spline s.obj --points p.json -o c.svg --closed --view 90,20 --size 300x200").succeeds();
    let text = f.read("c.svg");
    let svg = is_whole(&text);
    assert!(svg && text.contains("width=\"300\" height=\"200\"") && text.matches("<circle").count() == 9, "{text}");
}

/// Whether every element that is opened is closed.
fn is_whole(text: &str) -> bool {
    let opened = text.matches("<g").count() + text.matches("<svg").count();
    let closed = text.matches("</g>").count() + text.matches("</svg>").count();
    opened == closed && !text.contains("NaN") && !text.contains("inf")
}

#[test]
fn bad_input_is_refused_in_one_paragraph() {
    let f = sphere();
    let spline = |points: &str, more: &str| {
        f.write("q.json", points);
        f.run(&format!("spline s.obj --points q.json -o q.obj {more}"))
    };
    spline("[0, 1, 2]", "").fails(1, &["4 control points or more, there are 3"]);
    spline("[]", "").fails(1, &["there are 0"]);
    spline("", "").fails(1, &["there are 0"]);
    spline("[0, 1", "").fails(1, &["q.json", "JSON"]);
    spline("[0, 1, 2, 100000]", "").fails(1, &["anchor 3", "vertex 100000"]);
    spline("[0, 1, 2, {\"position\": [0, 1e999, 0]}]", "").fails(1, &["JSON"]);
    spline("[0, 1, 2, {\"face\": 3, \"barycentric\": [0.5, 0.6, 0.2]}]", "").fails(1, &["sum to 1.3"]);
    spline("[0, 1, 2, 3]", "--degree 6").fails(2, &["--degree", "6"]);
    spline("[0, 1, 2, 3]", "--degree 0").fails(2, &["--degree"]);
    spline("[0, 1, 2, 3, 4]", "--kind bezier --degree 3").fails(1, &["3 k + 1"]);
    spline("[0, 1, 2, 3]", "--tolerance 0").fails(2, &["--tolerance"]);
    spline("[0, 1, 2, 3]", "--tolerance NaN").fails(2, &["--tolerance"]);
    spline("[0, 1, 2, 3]", "--samples 99999999999").fails(2, &["--samples"]);
    f.run("spline s.obj --points p.json -o c.png").fails(2, &["--output", "neither PLY, OBJ nor SVG"]);
    f.run("spline s.obj --points p.json -o c.svg --view NaN,3").fails(2, &["--view"]);
    assert!(!f.names().contains("q.obj") && !f.names().contains("c.svg"), "{:?}", f.names());
}

#[test]
fn points_far_off_are_told_and_those_of_two_parts_refused() {
    let f = sphere();
    f.write("q.json", "[0, 10, 20, {\"position\": [9, 0, 0]}]");
    let ran = f.run("spline s.obj --points q.json -o q.obj --report r.json").succeeds();
    assert!(ran.stderr.contains("point 3 lies 8.0") && ran.stderr.contains("check its units"), "{}", ran.stderr);
    let moved = f.json("r.json")["spline"]["snap_distance"][3].as_f64().unwrap();
    assert!((7.9..8.1).contains(&moved), "{moved}");
    // Two spheres in one file.
    let one = icosphere(1.0, 2);
    let n = one.vertex_count() as u32;
    let positions = one.positions.iter().copied().chain(one.positions.iter().map(|p| *p + DVec3::X * 3.0)).collect();
    let triangles: Vec<[u32; 3]> =
        one.triangles().into_iter().chain(one.triangles().into_iter().map(|t| t.map(|v| v + n))).collect();
    barymap::io::write_obj(&Mesh::from_triangles("two", positions, &triangles).unwrap(), f.path("two.obj")).unwrap();
    f.write("q.json", &json!([0, 5, n + 3, 9]).to_string());
    f.run("spline two.obj --points q.json -o t.obj").fails(1, &["control point 2 lies on component 1", "one part"]);
    f.write("q.json", &json!([n, n + 5, n + 3, n + 9]).to_string());
    f.run("spline two.obj --points q.json -o t.obj").succeeds();
}

#[test]
fn open_meshes_and_single_faces_have_curves_too() {
    let f = Folder::empty();
    let mesh = plane_grid(10, 10, 1.0, 1.0, barymap::models::shapes::Diagonal::Alternating);
    barymap::io::write_obj(&mesh, f.path("s.obj")).unwrap();
    // Along the boundary, where averages leave the mesh or not.
    f.write("p.json", "[0, 5, 10, 54, 120, 115, 110]");
    f.run("spline s.obj --points p.json -o c.obj --closed --tolerance 1e-6").succeeds();
    let (points, lines) = polyline(&f.read("c.obj"));
    assert_eq!(lines.len(), 1);
    assert!(on_surface(&mesh, &points) < 1e-12);
    // Within one face: the planar curve.
    let face = 77;
    let b = [[0.9, 0.05, 0.05], [0.1, 0.8, 0.1], [0.2, 0.2, 0.6], [0.3, 0.35, 0.35]];
    let entries: Vec<_> = b.iter().map(|b| json!({"face": face, "barycentric": b})).collect();
    f.write("p.json", &json!(entries).to_string());
    f.run("spline s.obj --points p.json -o c.obj --samples 100").succeeds();
    let corners = mesh.triangle_positions(face);
    let controls = b.map(|b| corners[0] * b[0] + corners[1] * b[1] + corners[2] * b[2]);
    let planar = |s: f64| {
        let r = 1.0 - s;
        controls[0] * r.powi(3)
            + controls[1] * 3.0 * r * r * s
            + controls[2] * 3.0 * r * s * s
            + controls[3] * s.powi(3)
    };
    let (points, _) = polyline(&f.read("c.obj"));
    assert_eq!(points.len(), 101);
    for (i, p) in points.iter().enumerate() {
        assert!(p.distance(planar(i as f64 / 100.0)) < 1e-9, "{i}");
    }
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn curves_on_a_real_mesh_are_whole() {
    let f = Folder::empty();
    let horse = std::path::PathBuf::from(std::env::var("BARYMAP_DATA").unwrap()).join("mesh/horse_8k.obj");
    let mesh = read_mesh(&horse).unwrap().mesh;
    // Around the trunk: the points that lie farthest in directions about the middle.
    let (low, high) = mesh.bounds().unwrap();
    let d = high - low;
    let axis = if d.x > d.z { DVec3::X } else { DVec3::Z };
    let middle = 0.5 * (low + high);
    let around: Vec<_> = (0..8)
        .map(|i| {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(i) / 8.0).sin_cos();
            let p = middle + 0.3 * d.y * (DVec3::Y * sin + axis.cross(DVec3::Y) * cos) + 0.05 * d * axis * sin;
            json!({"position": p.to_array()})
        })
        .collect();
    f.write("p.json", &json!(around).to_string());
    for mode in ["direct", "subdivision"] {
        let command = format!(
            "spline {} --points p.json -o c.obj --closed --landmarks 600 --mode {mode} --samples 2000 --report r.json",
            horse.display()
        );
        f.run(&command).succeeds();
        let (points, lines) = polyline(&f.read("c.obj"));
        assert_eq!((lines.len(), points[0]), (1, points[points.len() - 1]));
        assert!(points.len() > 2000 && on_surface(&mesh, &points) < 1e-12);
        // No segment is longer than an edge.
        let step = points.windows(2).map(|w| w[0].distance(w[1])).fold(0.0, f64::max);
        assert!(step < 5.0 * mesh.mean_edge_length(), "{step}");
    }
}
