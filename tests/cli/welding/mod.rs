//! Files that repeat vertices give what welded ones give, in every command; and their vertices come
//! back.

mod commands;
mod compare;
mod formats;
mod forms;
mod junctions;

use barymap::geometry::{Corner, Mesh, MeshBuilder, NONE};
use barymap::io::{read_mesh, write_image, write_obj};
use barymap::models::shapes::uv_sphere;
use glam::{DVec2, DVec3};
use serde_json::json;

use crate::support::{Folder, waves};
use commands::{Command, DRAWINGS, MAPS, SHAPES, SLOW};
use compare::{unlike, unlike_rows};
use forms::{bent, forms};

/// All forms of `mesh` give the same in every one of `commands`, to the last bit; a command that
/// fails does so for all. Returns those that do.
fn assert_forms_agree(mesh: &Mesh, commands: &[Command]) -> Vec<&'static str> {
    let [welded, seams, faces] = forms(mesh);
    let truth = commands::folder(&welded, 0);
    let others = [(&seams, commands::folder(&seams, 1)), (&faces, commands::folder(&faces, 2))];
    assert!(others.iter().all(|(form, _)| form.mesh.vertex_count() > welded.mesh.vertex_count()));
    let (mut wrong, mut failed) = (Vec::new(), Vec::new());
    for (command, outputs) in commands {
        let ran = commands::run(&truth, command);
        if ran.code != Some(0) {
            failed.push(*command);
        }
        for (form, f) in &others {
            let made = commands::run(f, command);
            let mut say = |what: String| wrong.push(format!("{} of {}: {command}: {what}", form.name, mesh.name));
            if made.code != ran.code {
                say(format!("exit code {:?}, not {:?}: {}", made.code, ran.code, made.stderr));
            } else if ran.code == Some(0) {
                let files = outputs.iter().chain(&["report.json"]);
                files.filter_map(|name| unlike(form, name, f, &truth)).for_each(&mut say);
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    failed
}

#[test]
fn forms_of_a_sphere_agree_in_every_command() {
    let mut mesh = uv_sphere(1.0, 20, 12);
    mesh.name = "sphere".into();
    for commands in [MAPS, SHAPES, DRAWINGS, SLOW] {
        assert!(assert_forms_agree(&mesh, commands).is_empty());
    }
}

/// Real meshes of different kinds: closed, with holes and handles, open, in parts, of polygons.
const REAL: [&str; 5] = [
    "mesh/goathead_5.5k.obj",
    "mesh/3holes_7k.obj",
    "mesh/alligator_6k.obj",
    "textured/knight/knight.obj",
    "textured/spot/spot_quads.obj",
];

/// Fails but for the decal of a mesh in parts, whose anchors lie on several of them.
fn assert_real_forms_agree(names: &[&str], commands: &[Command]) {
    let folder = std::path::PathBuf::from(std::env::var_os("BARYMAP_DATA").unwrap());
    for name in names {
        let failed = assert_forms_agree(&read_mesh(folder.join(name)).unwrap().mesh, commands);
        assert!(failed.iter().all(|c| name.contains("knight") && c.starts_with("decal")), "{name}: {failed:?}");
    }
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn maps_of_forms_of_real_meshes_agree() {
    assert_real_forms_agree(&REAL[..2], MAPS);
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn forms_of_real_meshes_agree_in_slow_commands() {
    assert_real_forms_agree(&["mesh/goathead_5.5k.obj", "textured/knight/knight.obj"], SLOW);
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn maps_of_forms_of_more_real_meshes_agree() {
    assert_real_forms_agree(&REAL[2..], MAPS);
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn shapes_and_drawings_of_forms_of_real_meshes_agree() {
    assert_real_forms_agree(&REAL, SHAPES);
    assert_real_forms_agree(&REAL, DRAWINGS);
}

#[test]
fn the_comparison_notices_a_moved_row_and_a_missing_one() {
    let [welded, _, faces] = forms(&uv_sphere(1.0, 6, 4));
    let row = |v: u32| vec![format!("{v}"), "1".to_owned()];
    let truth: compare::Rows = (0..welded.welded.len() as u32).map(row).collect();
    let rows: compare::Rows = faces.welded.iter().map(|&w| row(w)).collect();
    assert_eq!(unlike_rows(&faces.welded, &rows, &truth), None);
    for other in ["1.0000000000000002", "NaN", "valid"] {
        let mut moved = rows.clone();
        moved[17][1] = other.to_owned();
        assert!(unlike_rows(&faces.welded, &moved, &truth).unwrap().contains("row 17"));
    }
    assert!(unlike_rows(&faces.welded, &rows[1..].to_vec(), &truth).is_some());
    let json = |v: u32, x: f64| json!({"source": [v, {"face": 3, "barycentric": [x, 0.5, 0.25]}], "seconds": x});
    let same = |a, b| compare::unlike_json("", &a, &b, &faces.welded, true).is_none();
    let w = faces.welded[50];
    assert!(w != 50 && same(json(50, 0.25), json(w, 0.25)));
    assert!(!same(json(50, 0.25), json(50, 0.25)) && !same(json(50, 0.25), json(w, 0.5)));
}

#[test]
fn a_flat_shaded_sphere_is_mapped_and_apart_it_does_not_panic() {
    let mesh = uv_sphere(1.0, 18, 12);
    let [welded, _, faces] = forms(&mesh);
    let f = Folder::empty();
    write_image(&waves(64), f.path("s.png")).unwrap();
    let picked: Vec<usize> = (0..32).map(|k| k * mesh.triangle_count() / 32).collect();
    for form in [&welded, &faces] {
        write_obj(&form.mesh, f.path(&format!("{}.obj", form.name))).unwrap();
        // Another shape: the map of a mesh onto itself is known whatever hangs together.
        write_obj(&bent(&form.mesh), f.path(&format!("{}_t.obj", form.name))).unwrap();
        let list: Vec<_> = picked.iter().map(|t| json!({"face": t, "barycentric": [0.5, 0.3, 0.2]})).collect();
        f.write(&format!("{}.json", form.name), &json!({"source": list, "target": list}).to_string());
    }
    let transfer = |name: &str, extra: &str| {
        f.run(&format!(
            "transfer --source {name}.obj --target {name}_t.obj --texture s.png --anchors {name}.json --size 96 -o {name}.png \
             --report {name}_r.json --landmarks 100 --backend cpu {extra}"
        ))
    };
    transfer("welded", "").succeeds();
    let ran = transfer("faces", "").succeeds();
    assert!(ran.stderr.contains("of its vertices are repeated along"), "{}", ran.stderr);
    assert_eq!(f.bytes("welded.png"), f.bytes("faces.png"));
    assert!(f.json("faces_r.json")["valid_fraction"].as_f64().unwrap() > 0.999);
    // Every face alone: those with an anchor are mapped, and nothing else is claimed.
    let ran = transfer("faces", "--weld no").succeeds();
    assert!(ran.stderr.contains(&format!("{} components", mesh.triangle_count())), "{}", ran.stderr);
    let target = bent(&faces.mesh);
    let share = picked.iter().map(|&t| target.triangle_area(t)).sum::<f64>() / target.area();
    let valid = f.json("faces_r.json")["valid_fraction"].as_f64().unwrap();
    assert!((valid - share).abs() < 0.02 * share, "{valid} of {share}");
    let ran = f.run("render faces.obj -o r.png --weld much");
    assert!(ran.code == Some(2) && ran.stderr.contains("--weld"), "{}", ran.stderr);
    f.run("render faces.obj -o r.png --weld 100").fails(2, &["--weld", "mean edge"]);
}

#[test]
fn an_anchor_on_several_copies_of_a_vertex_is_one() {
    let [welded, _, faces] = forms(&uv_sphere(1.0, 16, 10));
    let f = Folder::empty();
    write_obj(&faces.mesh, f.path("s.obj")).unwrap();
    write_obj(&bent(&faces.mesh), f.path("t.obj")).unwrap();
    let count = welded.mesh.vertex_count();
    let known = &faces.welded;
    let copies = |i: usize| (0..known.len()).filter(move |&v| known[v] as usize == i * count / 24);
    let list: Vec<usize> = (0..24).filter_map(|i| copies(i).next()).chain(copies(5)).chain(copies(11)).collect();
    f.write("a.json", &json!({"source": list, "target": list}).to_string());
    let ran = f
        .run("map --source s.obj --target t.obj --anchors a.json -o m.csv --report r.json --landmarks 60 --backend cpu")
        .succeeds();
    assert!(ran.stderr.contains("coincide"), "{}", ran.stderr);
    assert!(f.json("r.json")["valid_fraction"].as_f64().unwrap() > 0.999);
}

#[test]
fn what_is_written_has_the_vertices_of_the_file() {
    let [_, seams, faces] = forms(&uv_sphere(1.0, 12, 8));
    let f = Folder::empty();
    for form in [&seams, &faces] {
        write_obj(&form.mesh, f.path("m.obj")).unwrap();
        let v = form.mesh.vertex_count() as u32 - 1;
        let p = form.mesh.positions[v as usize] * 1.2;
        let q = form.mesh.positions[0];
        let handles = json!([{"vertex": v, "position": p.to_array()}, {"vertex": 0, "position": q.to_array()}]);
        f.write("h.json", &json!({"handles": handles}).to_string());
        f.run("deform m.obj --handles h.json -o d.obj --backend cpu").succeeds();
        f.run("unwrap m.obj -o u.obj --size 128").succeeds();
        f.run("deform m.obj --handles h.json -o d.ply --backend cpu").succeeds();
        for name in ["d.obj", "u.obj", "d.ply"] {
            let written = read_mesh(f.path(name)).unwrap().mesh;
            assert_eq!(written.vertex_count(), form.mesh.vertex_count(), "{name}");
            for t in 0..form.mesh.triangle_count() {
                let vertices = written.file_triangle_corners(t).map(|c| c.vertex);
                assert_eq!(vertices, form.mesh.triangle(t), "{name}, triangle {t}");
            }
        }
        // The handle's vertex and all its copies are where it was put.
        let written = read_mesh(f.path("d.obj")).unwrap().mesh;
        for w in (0..=v as usize).filter(|&w| form.welded[w] == form.welded[v as usize]) {
            assert!(written.positions[w].distance(p) < 1e-12, "vertex {w}");
        }
    }
}

#[test]
fn a_concave_face_is_one_island_whatever_its_first_corner() {
    let l = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]];
    for first in 0..6 {
        let mut builder = MeshBuilder::new("l");
        builder.mesh.positions = l.map(|[x, y]| DVec3::new(x, y, 0.0)).to_vec();
        builder.mesh.texcoords = l.map(|p| DVec2::from(p) / 2.0).to_vec();
        builder.polygon((0..6).map(|k| (k + first) % 6).map(|v| Corner { vertex: v, texcoord: v, normal: NONE }));
        let f = Folder::empty();
        write_obj(&builder.build().unwrap(), f.path("l.obj")).unwrap();
        write_image(&waves(64), f.path("s.png")).unwrap();
        f.write("a.json", &json!({"source": [0, 1, 2, 3, 4, 5], "target": [0, 1, 2, 3, 4, 5]}).to_string());
        let ran = f
            .run("transfer --source l.obj --target l.obj --texture s.png --anchors a.json --size 64 --margin 0 -o o.png --report r.json --backend cpu")
            .succeeds();
        for word in ["overlap", "mirrored", "several triangles"] {
            assert!(!ran.stderr.contains(word), "first corner {first}: {}", ran.stderr);
        }
        let report = f.json("r.json");
        // Three of four quarters of the picture.
        assert_eq!((report["covered"].as_u64(), report["flipped_faces"].as_u64()), (Some(3 * 64 * 64 / 4), Some(0)));
    }
}
