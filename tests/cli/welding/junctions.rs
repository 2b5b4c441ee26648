//! Files with T-junctions give what the same surface gives that has none, and their faces come
//! back.

use barymap::geometry::{Corner, Mesh, MeshBuilder};
use barymap::io::{read_mesh, write_image, write_obj};
use barymap::models::shapes::uv_sphere;
use glam::{DVec2, DVec3};
use serde_json::json;

use super::forms::{bent, form_of, forms};
use crate::support::{Folder, waves};

/// `mesh` with every third triangle in four; their neighbours stay as they are, and have corners of
/// others on their edges. The first `mesh.vertex_count()` vertices are those of `mesh`.
fn with_junctions(mesh: &Mesh) -> Mesh {
    let mut builder = MeshBuilder::new("junctions");
    builder.mesh.positions.clone_from(&mesh.positions);
    builder.mesh.texcoords.clone_from(&mesh.texcoords);
    for t in 0..mesh.triangle_count() {
        let corners = mesh.triangle_corners(t);
        if t % 3 != 0 {
            builder.polygon(corners);
            continue;
        }
        let middles = [0, 1, 2].map(|k| {
            let [a, b] = [corners[k], corners[(k + 1) % 3]];
            let middle: DVec3 = 0.5 * (mesh.positions[a.vertex as usize] + mesh.positions[b.vertex as usize]);
            let uv: DVec2 = 0.5 * (mesh.texcoords[a.texcoord as usize] + mesh.texcoords[b.texcoord as usize]);
            builder.mesh.positions.push(middle);
            builder.mesh.texcoords.push(uv);
            let [vertex, texcoord] = [builder.mesh.positions.len(), builder.mesh.texcoords.len()].map(|n| n as u32 - 1);
            Corner { vertex, texcoord, ..a }
        });
        for k in 0..3 {
            builder.polygon([corners[k], middles[k], middles[(k + 2) % 3]]);
        }
        builder.polygon(middles);
    }
    builder.build().unwrap()
}

/// The same surface without T-junctions: the triangles that a file is computed with, as its faces.
fn without_junctions(read: &Mesh) -> Mesh {
    let mut builder = MeshBuilder::new("conforming");
    builder.mesh.positions.clone_from(&read.positions);
    builder.mesh.texcoords.clone_from(&read.texcoords);
    (0..read.triangle_count()).for_each(|t| builder.polygon(read.triangle_corners(t)));
    builder.build().unwrap()
}

/// `j.obj` with T-junctions, `c.obj` without, and both bent; the vertices that lie on edges.
fn folder(mesh: &Mesh) -> (Folder, Vec<usize>) {
    let f = Folder::empty();
    let cracked = with_junctions(mesh);
    write_obj(&cracked, f.path("j.obj")).unwrap();
    let loaded = read_mesh(f.path("j.obj")).unwrap();
    assert!(loaded.warnings.iter().any(|w| w.contains("T-junction")), "{:?}", loaded.warnings);
    let read = loaded.mesh;
    assert!(read.triangle_count() > read.file_triangle_count());
    let conforming = without_junctions(&read);
    write_obj(&conforming, f.path("c.obj")).unwrap();
    // Corners on straight edges of the bent shape.
    write_obj(&with_junctions(&bent(mesh)), f.path("jt.obj")).unwrap();
    let target = read_mesh(f.path("jt.obj")).unwrap().mesh;
    assert_eq!(target.triangle_count(), read.triangle_count());
    write_obj(&without_junctions(&target), f.path("ct.obj")).unwrap();
    write_image(&waves(64), f.path("s.png")).unwrap();
    let count = cracked.file_triangle_count();
    // Vertices that the file does not repeat are those of both, and so are positions.
    let vertex = |i: usize| i * mesh.vertex_count() / 24;
    let place = |i: usize| {
        let [a, b, c] = cracked.triangle_positions(i * count / 24);
        json!({"position": (0.2 * a + 0.3 * b + 0.5 * c).to_array()})
    };
    let anchors: Vec<_> = (0..24).map(|i| if i % 2 == 0 { json!(vertex(i)) } else { place(i) }).collect();
    f.write("one.json", &json!({"anchors": anchors}).to_string());
    let vertices: Vec<usize> = (0..24).map(vertex).collect();
    f.write("pairs.json", &json!({"source": vertices, "target": vertices}).to_string());
    let size = super::forms::size_of(mesh);
    let handles: Vec<_> = (0..5)
        .map(|i| {
            let v = mesh.triangle(i * mesh.triangle_count() / 5)[0];
            let p = mesh.positions[v as usize] + DVec3::new(0.05, -0.02, 0.1) * (size * i as f64 * 0.5);
            json!({"vertex": v, "position": p.to_array()})
        })
        .collect();
    f.write("handles.json", &json!({"handles": handles}).to_string());
    let hanging = (mesh.vertex_count()..cracked.vertex_count()).collect();
    (f, hanging)
}

/// The cells of a table but the face and the place in it, which are those of each file.
fn places(text: &str) -> Vec<Vec<&str>> {
    text.lines().skip(1).map(|line| line.split(',').skip(5).collect()).collect()
}

fn assert_as_without(mesh: &Mesh) {
    let (f, hanging) = folder(mesh);
    // Those that the file repeats are in no face of the other one.
    let read = read_mesh(f.path("j.obj")).unwrap().mesh;
    let own: Vec<usize> = (0..read.vertex_count()).filter(|v| !read.is_repeated(*v as u32)).collect();
    let both = |command: &str, name: &str| {
        for form in ["j", "c"] {
            let options = "--backend cpu --report r.json";
            f.run(&format!("{} -o {form}_{name} {options}", command.replace('$', form))).succeeds();
            if command.contains("--target") {
                let valid = f.json("r.json")["valid_fraction"].as_f64().unwrap();
                assert!(valid > 0.99, "{command}: {valid}");
            }
        }
        [format!("j_{name}"), format!("c_{name}")]
    };
    let pair = "--source $.obj --target $t.obj --anchors pairs.json --landmarks 60";
    for method in ["field", "rbf"] {
        let [j, c] = both(&format!("map {pair} --method {method}"), "m.csv").map(|name| f.read(&name));
        let (j, c) = (places(&j), places(&c));
        assert!(own.iter().all(|&v| j[v] == c[v] && j[v].len() == 5), "{method}");
    }
    let pictures = [
        ("render $.obj --size 200 --texture s.png --anchors one.json".to_owned(), "v.png"),
        ("render $.obj --size 200".to_owned(), "g.png"),
        (format!("transfer {pair} --texture s.png --size 96"), "o.png"),
    ];
    for (command, name) in pictures {
        let [j, c] = both(&command, name);
        assert!(f.image(&j) == f.image(&c), "{command}");
    }
    let [j, c] = both("embed $.obj --landmarks 60", "e.npy");
    let [j, c] = [j, c].map(|name| barymap::io::npy::read_npy(f.path(&name)).unwrap());
    let row = |v: usize| v * j.columns..(v + 1) * j.columns;
    assert!(own.iter().all(|&v| j.values[row(v)] == c.values[row(v)]));
    // What is moved has no gap: vertices on an edge are on it still.
    let [j, c] = both("deform $.obj --handles handles.json", "d.obj");
    let [j, c] = [j, c].map(|name| read_mesh(f.path(&name)).unwrap());
    assert!(j.warnings.iter().any(|w| w.contains("T-junction")));
    let (j, c) = (j.mesh, c.mesh);
    assert!((0..j.vertex_count()).filter(|v| !hanging.contains(v)).all(|v| j.positions[v] == c.positions[v]));
    assert_eq!(j.file_triangle_count(), read_mesh(f.path("j.obj")).unwrap().mesh.file_triangle_count());
    assert_eq!(j.triangle_count(), c.triangle_count());
    // What is written has the faces of the file.
    f.run("unwrap j.obj -o u.obj --size 256").succeeds();
    f.run("unwrap j.obj -o u.glb --size 256").succeeds();
    let unwrapped = read_mesh(f.path("u.obj")).unwrap().mesh;
    let cracked = with_junctions(mesh);
    assert_eq!(unwrapped.polygon_count(), cracked.polygon_count());
    assert!(
        (0..cracked.polygon_count())
            .all(|p| { unwrapped.file_polygon(p).map(|c| c.vertex).eq(cracked.file_polygon(p).map(|c| c.vertex)) })
    );
    let triangles = |document: &gltf::Document| -> usize {
        document.meshes().flat_map(|m| m.primitives()).map(|p| p.indices().unwrap().count() / 3).sum()
    };
    assert_eq!(triangles(&gltf::import(f.path("u.glb")).unwrap().0), cracked.triangle_count());
}

#[test]
fn a_sphere_with_t_junctions_is_as_one_without() {
    let [welded, ..] = forms(&uv_sphere(1.0, 16, 10));
    assert_as_without(&welded.mesh);
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn real_meshes_with_t_junctions_are_as_those_without() {
    for name in ["mesh/goathead_5.5k.obj", "mesh/alligator_6k.obj"] {
        assert_as_without(&form_of(name).mesh);
    }
}

#[test]
fn points_by_face_are_on_the_faces_of_the_file() {
    let [welded, ..] = forms(&uv_sphere(1.0, 16, 10));
    let (f, _) = folder(&welded.mesh);
    let cracked = with_junctions(&welded.mesh);
    // Anchors and points by face, on faces that are cut and on others.
    let faces: Vec<usize> = (0..24).map(|i| i * cracked.triangle_count() / 24).collect();
    let anchors: Vec<_> = faces.iter().map(|t| json!({"face": t, "barycentric": [0.5, 0.3, 0.2]})).collect();
    f.write("faces.json", &json!({"source": anchors, "target": anchors}).to_string());
    let rows: String = faces.iter().map(|t| format!("{t},0.5,0.3,0.2\n")).collect();
    f.write("points.csv", &format!("face,b0,b1,b2\n{rows}"));
    f.run("map --source j.obj --target jt.obj --anchors faces.json --points points.csv -o m.csv --backend reference --landmarks 60")
        .succeeds();
    for (line, t) in f.read("m.csv").lines().skip(1).zip(&faces) {
        let cells: Vec<f64> = line.split(',').skip(1).take(7).map(|x| x.parse().unwrap()).collect();
        // An anchor goes to its partner, which has the same place on the same face.
        let [a, b, c] = cracked.triangle_positions(cells[0] as usize);
        let at = a * cells[1] + b * cells[2] + c * cells[3];
        let [a, b, c] = cracked.triangle_positions(*t);
        let wanted = 0.5 * a + 0.3 * b + 0.2 * c;
        assert!(at.distance(wanted) < 2e-3 && DVec3::from_slice(&cells[4..]).distance(at) < 1e-12, "face {t}: {line}");
    }
    let mesh = read_mesh(f.path("j.obj")).unwrap().mesh;
    f.write("beyond.csv", &format!("face,b0,b1,b2\n{},1,0,0\n", mesh.file_triangle_count()));
    f.run("map --source j.obj --target jt.obj --anchors faces.json --points beyond.csv -o m.csv --landmarks 60")
        .fails(1, &["face", "beyond.csv"]);
}
