//! Forms in other formats, and files that repeat vertices for other reasons than seams.

use std::collections::HashSet;
use std::fmt::Write;

use barymap::geometry::{Corner, Diagnosis, Material, Mesh, MeshBuilder, NONE, Topology};
use barymap::io::gltf_write::{glb_bytes, own_materials};
use barymap::io::{read_mesh, write_obj};
use barymap::models::shapes::uv_sphere;
use glam::DVec3;
use serde_json::json;

use super::forms::{Form, bent, form_of, forms};
use crate::support::Folder;

/// Positions and faces alone.
fn off(mesh: &Mesh) -> String {
    let mut text = format!("OFF\n{} {} 0\n", mesh.vertex_count(), mesh.polygon_count());
    mesh.positions.iter().for_each(|p| writeln!(text, "{:?} {:?} {:?}", p.x, p.y, p.z).unwrap());
    faces(mesh, &mut text);
    text
}

fn ply(mesh: &Mesh) -> String {
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        mesh.vertex_count(),
        mesh.polygon_count()
    );
    mesh.positions.iter().for_each(|p| writeln!(text, "{:?} {:?} {:?}", p.x, p.y, p.z).unwrap());
    faces(mesh, &mut text);
    text
}

fn faces(mesh: &Mesh, text: &mut String) {
    for p in 0..mesh.polygon_count() {
        let corners: Vec<String> = mesh.file_polygon(p).map(|c| c.vertex.to_string()).collect();
        writeln!(text, "{} {}", corners.len(), corners.join(" ")).unwrap();
    }
}

/// The cells of a map behind the number of its row, by vertex of the welded form; those of all
/// vertices that are one are equal.
fn map(f: &Folder, source: &str, target: &str, form: &Form) -> Vec<String> {
    f.run(&format!("map --source {source} --target {target} --anchors a.json -o m.csv --landmarks 60 --backend cpu"))
        .succeeds();
    let text = f.read("m.csv");
    let rows: Vec<&str> = text.lines().skip(1).map(|l| l.split_once(',').unwrap().1).collect();
    assert_eq!(rows.len(), form.welded.len());
    let count = form.welded.iter().max().unwrap() + 1;
    let mut all = vec![String::new(); count as usize];
    for (row, &w) in rows.iter().zip(&form.welded) {
        let known = &mut all[w as usize];
        assert!(known.is_empty() || *known == **row, "vertex {w}: {row} and {known}");
        *known = (*row).to_owned();
    }
    all
}

#[test]
fn forms_in_ply_and_off_are_as_in_obj() {
    let all = forms(&uv_sphere(1.0, 16, 10));
    let f = Folder::empty();
    let list: Vec<_> = (0..24)
        .map(|i| json!({"face": i * all[0].mesh.triangle_count() / 24, "barycentric": [0.2, 0.3, 0.5]}))
        .collect();
    f.write("a.json", &json!({"source": list, "target": list}).to_string());
    write_obj(&all[0].mesh, f.path("s.obj")).unwrap();
    write_obj(&bent(&all[0].mesh), f.path("t.obj")).unwrap();
    let truth = map(&f, "s.obj", "t.obj", &all[0]);
    for form in &all {
        for (kind, text) in [("off", off as fn(&Mesh) -> String), ("ply", ply as fn(&Mesh) -> String)] {
            f.write(&format!("s.{kind}"), &text(&form.mesh));
            f.write(&format!("t.{kind}"), &text(&bent(&form.mesh)));
            assert!(map(&f, &format!("s.{kind}"), &format!("t.{kind}"), form) == truth, "{} in {kind}", form.name);
        }
    }
}

/// What a file is as a surface: parts, boundary loops, genus, and its vertices that are used.
fn surface(f: &Folder, name: &str) -> (usize, usize, Option<usize>, usize) {
    let mesh = read_mesh(f.path(name)).unwrap().mesh;
    let d = Diagnosis::new(&mesh, &Topology::new(&mesh));
    let used: HashSet<u32> = mesh.triangles().into_iter().flatten().collect();
    (d.components.len(), d.boundary_loops(), d.genus(), used.len())
}

#[test]
fn primitives_of_several_materials_are_one_surface() {
    let [welded, ..] = forms(&uv_sphere(1.0, 16, 10));
    let mesh = &welded.mesh;
    let mut builder = MeshBuilder::new("materials");
    builder.mesh.positions = mesh.positions.iter().map(|p| p.as_vec3().as_dvec3()).collect();
    builder.mesh.texcoords.clone_from(&mesh.texcoords);
    builder.mesh.materials = ["a", "b", "c"].map(|name| Material { name: name.into(), ..Material::default() }).to_vec();
    for t in 0..mesh.triangle_count() {
        builder.material = (t % 3) as u32;
        builder.polygon(mesh.triangle_corners(t));
    }
    let parted = builder.build().unwrap();
    let f = Folder::empty();
    std::fs::write(f.path("m.glb"), glb_bytes(&parted, &own_materials(&parted).0).unwrap()).unwrap();
    let read = read_mesh(f.path("m.glb")).unwrap().mesh;
    assert!(read.vertex_count() > 2 * mesh.vertex_count() && read.materials.len() == 3);
    assert_eq!(surface(&f, "m.glb"), (1, 0, Some(0), mesh.vertex_count()));
}

#[test]
fn rounding_beside_a_corner_is_no_gap() {
    let [welded, _, faces] = forms(&uv_sphere(1.0, 16, 10));
    let f = Folder::empty();
    let shaken = |mesh: &Mesh| {
        let mut mesh = mesh.clone();
        for (v, p) in mesh.positions.iter_mut().enumerate() {
            *p += DVec3::from_array([7, 11, 13].map(|k| ((v * k % 101) as f64 / 50.0 - 1.0) * 1e-12));
        }
        mesh
    };
    write_obj(&welded.mesh, f.path("s.obj")).unwrap();
    write_obj(&shaken(&faces.mesh), f.path("f.obj")).unwrap();
    let whole = surface(&f, "s.obj");
    assert_eq!(surface(&f, "f.obj"), (whole.0, whole.1, whole.2, welded.mesh.vertex_count()));
    let list: Vec<_> = (0..24)
        .map(|i| json!({"face": i * faces.mesh.triangle_count() / 24, "barycentric": [0.2, 0.3, 0.5]}))
        .collect();
    f.write("a.json", &json!({"source": list, "target": list}).to_string());
    f.run("map --source s.obj --target f.obj --anchors a.json -o m.csv --report r.json --landmarks 60 --backend cpu")
        .succeeds();
    assert!(f.json("r.json")["valid_fraction"].as_f64().unwrap() > 0.999);
    for (line, p) in f.read("m.csv").lines().skip(1).zip(&faces.mesh.positions) {
        let at: Vec<f64> = line.split(',').skip(5).take(3).map(|x| x.parse().unwrap()).collect();
        assert!(DVec3::from_slice(&at).distance(*p) < 1e-3, "{line}");
    }
}

/// `mesh` cut by the plane x = `x`, as two parts with vertices of their own there.
fn cut_by_a_plane(mesh: &Mesh, x: f64) -> Mesh {
    let mut builder = MeshBuilder::new("cut");
    for side in [-1.0, 1.0] {
        for t in 0..mesh.triangle_count() {
            let p = mesh.triangle_positions(t);
            let off = p.map(|p| side * (p.x - x));
            let mut ring = Vec::new();
            for k in 0..3 {
                let (a, b) = (k, (k + 1) % 3);
                if off[a] >= 0.0 {
                    ring.push(p[a]);
                }
                if off[a] * off[b] < 0.0 {
                    // The same numbers from both sides and both triangles.
                    let [low, high] = if p[a].to_array() < p[b].to_array() { [p[a], p[b]] } else { [p[b], p[a]] };
                    ring.push(low.lerp(high, (x - low.x) / (high.x - low.x)));
                }
            }
            if ring.len() > 2 {
                let first = builder.mesh.positions.len() as u32;
                let count = ring.len() as u32;
                builder.mesh.positions.extend(ring.into_iter().map(|p| (p * 1e6).round() / 1e6));
                builder.polygon((first..first + count).map(|vertex| Corner { vertex, texcoord: NONE, normal: NONE }));
            }
        }
    }
    builder.build().unwrap()
}

#[test]
fn a_body_cut_by_a_plane_is_whole_in_six_digits() {
    let f = Folder::empty();
    write_obj(&cut_by_a_plane(&uv_sphere(1.0, 16, 10), 0.1234567), f.path("m.obj")).unwrap();
    let (parts, loops, genus, _) = surface(&f, "m.obj");
    assert_eq!((parts, loops, genus), (1, 0, Some(0)));
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn a_real_body_cut_by_a_plane_is_whole_in_six_digits() {
    let f = Folder::empty();
    let mesh = form_of("mesh/goathead_5.5k.obj").mesh;
    let (low, high) = mesh.bounds().unwrap();
    write_obj(&cut_by_a_plane(&mesh, low.x + 0.37 * (high.x - low.x)), f.path("m.obj")).unwrap();
    let (parts, loops, genus, _) = surface(&f, "m.obj");
    assert_eq!((parts, loops, genus), (1, 0, Some(0)));
}
