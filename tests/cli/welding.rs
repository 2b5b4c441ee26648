//! Files that repeat vertices give what welded ones give, in every command; and their vertices come
//! back.

use std::collections::HashMap;

use barymap::geometry::{Corner, Mesh, MeshBuilder, NONE};
use barymap::io::{read_mesh, write_image, write_obj};
use barymap::models::shapes::uv_sphere;
use glam::{DVec2, DVec3};
use serde_json::{Value, json};

use crate::support::{Folder, waves};

/// Results of two forms may differ by this part of the mesh's size: they are computed from equal
/// numbers in equal order, but for sums over all vertices of a file.
const SAME: f64 = 1e-7;

/// A form of a mesh: the file, and the vertex of the welded form that each of its vertices is.
struct Form {
    name: &'static str,
    mesh: Mesh,
    welded: Vec<u32>,
}

/// `mesh` with six charts by the side that faces look to, in three forms with equal faces: welded,
/// split at the seams of the charts, and each face with its own vertices. Vertices are numbered as
/// the faces use them.
fn forms(mesh: &Mesh) -> [Form; 3] {
    let (low, high) = mesh.bounds().unwrap();
    let size = (high - low).max_element();
    let chart = |t: usize| {
        let n = mesh.triangle_area_normal(t).to_array();
        let axis = (0..3).fold(0, |best, k| if n[k].abs() > n[best].abs() { k } else { best });
        (2 * axis + usize::from(n[axis] < 0.0)) as u32
    };
    let place = |v: u32, chart: u32| {
        let p = (mesh.positions[v as usize] - low) / size;
        let axis = chart as usize / 2;
        let flat = DVec2::new(p[(axis + 1) % 3], p[(axis + 2) % 3]);
        let cell = DVec2::new(f64::from(chart % 3), f64::from(chart / 3));
        (cell + DVec2::splat(0.05) + 0.9 * flat) / DVec2::new(3.0, 2.0)
    };
    let build = |name: &'static str, key: &dyn Fn(usize) -> u32| {
        let mut builder = MeshBuilder::new(name);
        let (mut vertices, mut texcoords, mut first) = (HashMap::new(), HashMap::new(), HashMap::new());
        let mut welded = Vec::new();
        for t in 0..mesh.triangle_count() {
            let corners = mesh.triangle(t).map(|v| {
                let next = first.len() as u32;
                let number = *first.entry(v).or_insert(next);
                let vertex = *vertices.entry((v, key(t))).or_insert_with(|| {
                    builder.mesh.positions.push(mesh.positions[v as usize]);
                    welded.push(number);
                    welded.len() as u32 - 1
                });
                let texcoord = *texcoords.entry((v, chart(t))).or_insert_with(|| {
                    builder.mesh.texcoords.push(place(v, chart(t)));
                    builder.mesh.texcoords.len() as u32 - 1
                });
                Corner { vertex, texcoord, normal: NONE }
            });
            builder.polygon(corners);
        }
        Form { name, mesh: builder.build(), welded }
    };
    [build("welded", &|_| 0), build("seams", &chart), build("faces", &|t| t as u32)]
}

/// The same form, bent and stretched.
fn bent(mesh: &Mesh, size: f64) -> Mesh {
    let mut mesh = mesh.clone();
    for p in &mut mesh.positions {
        let q = *p / size;
        *p = DVec3::new(1.1 * q.x + 0.1 * q.y * q.y, q.y, 0.9 * q.z + 0.15 * (2.0 * q.x).sin()) * size;
    }
    mesh
}

/// Rows of numbers by vertex.
type Rows = Vec<Vec<f64>>;

/// Every number of a table without its header; words are left out.
fn table(text: &str) -> Rows {
    let row = |line: &str| line.split(',').skip(1).filter_map(|x| x.parse().ok()).collect();
    text.lines().skip(1).map(row).collect()
}

/// The rows of an array of doubles.
fn array(bytes: &[u8], columns: usize) -> Rows {
    let start = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let numbers: Vec<f64> = bytes[start..].chunks_exact(8).map(|b| f64::from_le_bytes(b.try_into().unwrap())).collect();
    numbers.chunks_exact(columns).map(<[f64]>::to_vec).collect()
}

fn positions(f: &Folder, name: &str) -> Rows {
    read_mesh(f.path(name)).unwrap().mesh.positions.iter().map(|p| p.to_array().to_vec()).collect()
}

/// The first row of `form` that is not what the welded form has at the same vertex.
fn unlike(form: &Form, rows: &Rows, truth: &Rows, scale: f64) -> Option<String> {
    if rows.len() != form.welded.len() {
        return Some(format!("{} rows for {} vertices", rows.len(), form.welded.len()));
    }
    rows.iter().zip(&form.welded).enumerate().find_map(|(v, (row, &w))| {
        let wanted = &truth[w as usize];
        let near = row.len() == wanted.len() && row.iter().zip(wanted).all(|(a, b)| (a - b).abs() <= SAME * scale);
        (!near).then(|| format!("vertex {v}: {row:?}, welded {wanted:?}"))
    })
}

/// What the commands make of one form: rows by vertex, and what has no vertices as it is.
struct Made {
    rows: Vec<(&'static str, Rows)>,
    others: Vec<(&'static str, Vec<u8>)>,
}

/// Runs the commands on a form, source and target alike.
fn run_all(form: &Form, size: f64) -> Made {
    let f = Folder::empty();
    write_obj(&form.mesh, f.path("s.obj")).unwrap();
    write_obj(&bent(&form.mesh, size), f.path("t.obj")).unwrap();
    write_image(&waves(64), f.path("s.png")).unwrap();
    let faces = form.mesh.triangle_count();
    let chosen: Vec<usize> = (0..32).map(|k| k * faces / 32 + faces / 64).collect();
    // Half of the anchors by number of a vertex, half by face.
    let anchor = |(k, &t): (usize, &usize)| -> Value {
        match k % 2 {
            0 => json!(form.mesh.triangle(t)[k % 3]),
            _ => json!({"face": t, "barycentric": [0.2, 0.3, 0.5]}),
        }
    };
    let anchors: Vec<Value> = chosen.iter().enumerate().map(anchor).collect();
    f.write("pairs.json", &json!({"source": anchors, "target": anchors}).to_string());
    f.write("one.json", &json!({"anchors": anchors}).to_string());
    let points: String = chosen.iter().map(|t| format!("{t},0.1,0.6,0.3\n")).collect();
    f.write("points.csv", &format!("face,b0,b1,b2\n{points}"));
    let handle = |(k, &t): (usize, &usize)| {
        let v = form.mesh.triangle(t)[k % 3];
        let p = form.mesh.positions[v as usize] + DVec3::new(0.05, -0.02, 0.1) * (size * ((k % 3) as f64));
        json!({"vertex": v, "position": p.to_array()})
    };
    let handles: Vec<Value> = chosen.iter().step_by(6).enumerate().map(handle).collect();
    f.write("handles.json", &json!({"handles": handles}).to_string());
    let data = |v: u32| f64::from(v % 97);
    let rows: String = form.welded.iter().enumerate().map(|(v, &w)| format!("{v},{}\n", data(w))).collect();
    f.write("data.csv", &format!("index,a\n{rows}"));
    let common = "--backend cpu --no-cache --landmarks 60";
    let pair = "--source s.obj --target t.obj --anchors pairs.json";
    for command in [
        format!("embed s.obj -o e.npy {common}"),
        format!("check s.obj --anchors one.json -o c.ply {common}"),
        format!("weights s.obj --anchors one.json --points points.csv -o w.npy {common}"),
        format!("map {pair} -o m.csv {common}"),
        // Of turned-over and thin triangles the inverse multiplies single precision by their
        // stretch.
        format!("map {pair} -o i.csv --inverse {common}").replace("--backend cpu", "--backend reference"),
        format!("map {pair} -o r.csv --method rbf {common}"),
        format!("attributes {pair} --attributes data.csv -o d.csv {common}"),
        format!("transfer {pair} --texture s.png --size 96 -o o.png --coverage cover.png {common}"),
        format!("anchors s.obj t.obj --anchors pairs.json --count 40 -o more.json --ignore-connectivity {common}"),
        "deform s.obj --handles handles.json -o p.obj --backend cpu --no-cache".into(),
        "morph s.obj t.obj -o half.ply --weights 0.5,0.5".into(),
        "unwrap s.obj -o u.obj --size 256".into(),
        "render s.obj -o v.png --size 160x120 --texture s.png".into(),
        "render s.obj -o g.png --size 160x120".into(),
    ] {
        f.run(&command).succeeds();
    }
    let unwrapped = read_mesh(f.path("u.obj")).unwrap().mesh;
    let charts: Vec<u8> = (0..faces)
        .flat_map(|t| unwrapped.triangle_texcoords(t).unwrap())
        .flat_map(|uv| [uv.x, uv.y])
        .flat_map(|x| ((x * 1e6).round() as i64).to_le_bytes())
        .collect();
    // Which vertices are proposed depends on ties between them; how many does not.
    let proposed = f.json("more.json")["source"].as_array().unwrap().len().to_le_bytes().to_vec();
    Made {
        rows: vec![
            ("embed", array(&f.bytes("e.npy"), 8)),
            ("map", table(&f.read("m.csv"))),
            ("map --inverse", table(&f.read("i.csv"))),
            ("map --method rbf", table(&f.read("r.csv"))),
            ("attributes", table(&f.read("d.csv"))),
            ("deform", positions(&f, "p.obj")),
            ("morph", positions(&f, "half.ply")),
            ("check", positions(&f, "c.ply")),
        ],
        others: vec![
            ("weights", f.bytes("w.npy")),
            ("picture: transfer", levels(&f, "o.png")),
            ("picture: coverage", levels(&f, "cover.png")),
            ("picture: render with a texture", levels(&f, "v.png")),
            ("picture: render", levels(&f, "g.png")),
            ("unwrap", charts),
            ("anchors", proposed),
        ],
    }
}

/// The samples of a picture, as 8 bits.
fn levels(f: &Folder, name: &str) -> Vec<u8> {
    let image = f.image(name);
    let rows = (0..image.height).flat_map(|y| (0..image.width).map(move |x| (x, y)));
    rows.flat_map(|(x, y)| (0..image.channels).map(move |c| (x, y, c)))
        .map(|(x, y, c)| (255.0 * image.get(x, y, c)).round() as u8)
        .collect()
}

/// Pictures are the same up to a level, where a rounding decides, but for one sample in a thousand,
/// where an edge of a triangle passes through the centre of a pixel; all else is equal.
fn same(what: &str, made: &[u8], wanted: &[u8]) -> bool {
    if !what.starts_with("picture") {
        return made == wanted;
    }
    let off = made.iter().zip(wanted).filter(|(a, b)| a.abs_diff(**b) > 1).count();
    made.len() == wanted.len() && 1000 * off <= made.len()
}

/// All forms of `mesh` give the same in every command.
fn assert_forms_agree(mesh: &Mesh) {
    let (low, high) = mesh.bounds().unwrap();
    let size = (high - low).max_element();
    let [welded, seams, faces] = forms(mesh);
    let truth = run_all(&welded, size);
    for form in [seams, faces] {
        assert!(form.mesh.vertex_count() > welded.mesh.vertex_count());
        let made = run_all(&form, size);
        for ((what, rows), (_, wanted)) in made.rows.iter().zip(&truth.rows) {
            // Faces and barycentric coordinates of a map are equal too; a vertex may be a corner of
            // another face.
            let trim = |rows: &Rows| -> Rows {
                let skip = if what.starts_with("map") { 4 } else { 0 };
                rows.iter().map(|r| r.get(skip..).unwrap_or_default().to_vec()).collect()
            };
            // Maps are in single precision here, and a vertex may be a corner of another face: some
            // tens of roundings.
            let scale = match *what {
                // The data go up and down by 97 from one vertex to the next.
                "attributes" => 10.0 * 97.0 * size / mesh.mean_edge_length(),
                _ if what.starts_with("map") => 10.0 * size,
                // An in-between ends where its iteration stops, and the way there follows the order
                // of the vertices.
                "morph" => 5e-3 / SAME * size,
                _ => size,
            };
            if let Some(first) = unlike(&form, &trim(rows), &trim(wanted), scale) {
                panic!("{} of {}, {what}: {first}", form.name, mesh.name);
            }
        }
        for ((what, bytes), (_, wanted)) in made.others.iter().zip(&truth.others) {
            assert!(
                same(what, bytes, wanted),
                "{} of {}: {what} is not what the welded form gives",
                form.name,
                mesh.name
            );
        }
    }
}

#[test]
fn forms_of_a_sphere_agree_in_every_command() {
    let mut mesh = uv_sphere(1.0, 20, 12);
    mesh.name = "sphere".into();
    assert_forms_agree(&mesh);
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn forms_of_real_meshes_agree_in_every_command() {
    let folder = std::path::PathBuf::from(std::env::var_os("BARYMAP_DATA").unwrap());
    for name in ["mesh/goathead_5.5k.obj", "gt/cat_lion/lion-00.obj", "mesh/alligator_6k.obj"] {
        assert_forms_agree(&read_mesh(folder.join(name)).unwrap().mesh);
    }
}

#[test]
fn the_comparison_notices_a_moved_row_and_a_missing_one() {
    let [welded, _, faces] = forms(&uv_sphere(1.0, 6, 4));
    let truth: Rows = (0..welded.welded.len()).map(|v| vec![v as f64, 1.0]).collect();
    let rows: Rows = faces.welded.iter().map(|&w| truth[w as usize].clone()).collect();
    assert_eq!(unlike(&faces, &rows, &truth, 1.0), None);
    let mut moved = rows.clone();
    moved[17][1] += 1e-5;
    assert!(unlike(&faces, &moved, &truth, 1.0).unwrap().starts_with("vertex 17"));
    moved[17][1] = f64::NAN;
    assert!(unlike(&faces, &moved, &truth, 1.0).is_some());
    assert!(unlike(&faces, &rows[1..].to_vec(), &truth, 1.0).is_some());
    let picture = vec![100; 2000];
    let with = |off: usize, by: u8| (0..2000).map(|i| if i < off { 100 + by } else { 100 }).collect::<Vec<u8>>();
    assert!(same("picture", &with(2000, 1), &picture) && same("picture", &with(2, 9), &picture));
    assert!(!same("picture", &with(3, 2), &picture) && !same("charts", &with(1, 1), &picture));
    assert!(!same("picture", &picture[1..], &picture));
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
        let list: Vec<u32> = picked.iter().map(|&t| form.mesh.triangle(t)[0]).collect();
        f.write(&format!("{}.json", form.name), &json!({"source": list, "target": list}).to_string());
    }
    let transfer = |name: &str, extra: &str| {
        f.run(&format!(
            "transfer --source {name}.obj --target {name}.obj --texture s.png --anchors {name}.json --size 96 -o {name}.png \
             --report {name}_r.json --landmarks 100 --backend cpu {extra}"
        ))
    };
    transfer("welded", "").succeeds();
    let ran = transfer("faces", "").succeeds();
    assert!(ran.stderr.contains("of its vertices are repeated along"), "{}", ran.stderr);
    assert_eq!(f.bytes("welded.png"), f.bytes("faces.png"));
    assert!(f.json("faces_r.json")["valid_fraction"].as_f64().unwrap() > 0.999);
    // Every face alone: no panic, whatever comes of it.
    let ran = transfer("faces", "--weld no");
    assert!(
        !ran.stderr.contains("panicked") && ran.stderr.contains(&format!("{} components", mesh.triangle_count()))
            || ran.code == Some(1),
        "{}",
        ran.stderr
    );
    let ran = f.run("render faces.obj -o r.png --weld much");
    assert!(ran.code == Some(2) && ran.stderr.contains("--weld"), "{}", ran.stderr);
    f.run("render faces.obj -o r.png --weld 100").fails(2, &["--weld", "mean edge"]);
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
        write_obj(&builder.build(), f.path("l.obj")).unwrap();
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
