//! glTF end to end: what a file holds beside its mesh goes through every command that writes it.

use barymap::geometry::Mesh;
use barymap::io::gltf_write::glb_bytes;
use barymap::io::{read_mesh, write_obj};
use glam::{DVec3, Mat4, Vec3};
use serde_json::{Value, json};

use crate::support::{Folder, STRETCH};

/// A GLB as its JSON and its binary chunk.
struct Glb {
    json: Value,
    binary: Vec<u8>,
}

impl Glb {
    fn parse(bytes: &[u8]) -> Self {
        let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
        let json = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
        Self { json, binary: bytes[28 + length..].to_vec() }
    }

    fn bytes(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        json["buffers"] = json!([{"byteLength": self.binary.len()}]);
        let mut text = json.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let total = 28 + text.len() + self.binary.len();
        let mut all = Vec::new();
        for word in [0x4654_6c67, 2, total as u32, text.len() as u32, 0x4e4f_534a] {
            all.extend_from_slice(&u32::to_le_bytes(word));
        }
        all.extend_from_slice(&text);
        all.extend_from_slice(&(self.binary.len() as u32).to_le_bytes());
        all.extend_from_slice(&0x004e_4942_u32.to_le_bytes());
        all.extend_from_slice(&self.binary);
        all
    }

    fn accessor(&mut self, bytes: &[u8], component: u32, shape: &str, count: usize) -> usize {
        let views = self.json["bufferViews"].as_array_mut().unwrap();
        views.push(json!({"buffer": 0, "byteOffset": self.binary.len(), "byteLength": bytes.len()}));
        let view = views.len() - 1;
        self.binary.extend_from_slice(bytes);
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        let accessors = self.json["accessors"].as_array_mut().unwrap();
        accessors.push(json!({"bufferView": view, "componentType": component, "type": shape, "count": count}));
        accessors.len() - 1
    }

    fn floats(&mut self, values: &[f32], shape: &str, width: usize) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.accessor(&bytes, 5126, shape, values.len() / width)
    }
}

/// How much of the upper bone is in a point.
fn upper(p: Vec3) -> f32 {
    (0.5 + 0.4 * p.z).clamp(0.0, 1.0)
}

/// `mesh` as GLB with two bones, a morph target, an animation, names and extras.
fn rigged(mesh: &Mesh) -> Vec<u8> {
    let plain = glb_bytes(mesh, &[]).unwrap();
    let (document, buffers, _) = ::gltf::import_slice(&plain).unwrap();
    let primitive = document.meshes().next().unwrap().primitives().next().unwrap();
    let positions: Vec<Vec3> =
        primitive.reader(|b| Some(&buffers[b.index()])).read_positions().unwrap().map(Vec3::from).collect();
    let n = positions.len();
    let mut glb = Glb::parse(&plain);
    let weights: Vec<f32> = positions.iter().flat_map(|&p| [1.0 - upper(p), upper(p), 0.0, 0.0]).collect();
    let joints = glb.accessor(&[0u8, 1, 0, 0].repeat(n), 5121, "VEC4", n);
    let weights = glb.floats(&weights, "VEC4", 4);
    let smile: Vec<f32> = positions.iter().flat_map(|p| [0.0, 0.0, 0.1 * p.x]).collect();
    let smile = glb.floats(&smile, "VEC3", 3);
    glb.json["accessors"][smile]["min"] = json!([0, 0, -1]);
    glb.json["accessors"][smile]["max"] = json!([0, 0, 1]);
    let binds = [Mat4::from_translation(Vec3::Z), Mat4::IDENTITY].map(|m| m.to_cols_array()).concat();
    let binds = glb.floats(&binds, "MAT4", 16);
    let times = glb.floats(&[0.0, 1.0], "SCALAR", 1);
    glb.json["accessors"][times]["min"] = json!([0]);
    glb.json["accessors"][times]["max"] = json!([1]);
    let turns = glb.floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0], "VEC4", 4);
    let primitive = &mut glb.json["meshes"][0]["primitives"][0];
    primitive["attributes"]["JOINTS_0"] = joints.into();
    primitive["attributes"]["WEIGHTS_0"] = weights.into();
    primitive["targets"] = json!([{"POSITION": smile}]);
    glb.json["meshes"][0]["extras"] = json!({"targetNames": ["smile"]});
    glb.json["nodes"] = json!([{"name": "body", "mesh": 0, "skin": 0}, {"name": "hip", "translation": [0, 0, -1], "children": [2]},
        {"name": "chest", "translation": [0, 0, 1], "extras": {"ik": true}}]);
    glb.json["scenes"] = json!([{"nodes": [0, 1]}]);
    glb.json["skins"] = json!([{"joints": [1, 2], "inverseBindMatrices": binds}]);
    glb.json["animations"] = json!([{"name": "wave", "channels": [{"sampler": 0, "target": {"node": 2, "path": "rotation"}}],
        "samplers": [{"input": times, "output": turns}]}]);
    glb.bytes()
}

/// The two spheres, the target also as a rigged GLB.
fn spheres() -> Folder {
    let f = Folder::spheres();
    let target = read_mesh(f.path("t.obj")).unwrap().mesh;
    std::fs::write(f.path("t.glb"), rigged(&target)).unwrap();
    f
}

/// Everything of the rig is in a file.
#[track_caller]
fn has_the_rig(f: &Folder, name: &str) {
    let bytes = f.bytes(name);
    let (document, buffers, _) = ::gltf::import_slice(&bytes).unwrap();
    let names: Vec<&str> = document.nodes().filter_map(|n| n.name()).collect();
    assert_eq!(names, ["body", "hip", "chest"]);
    assert_eq!((document.skins().len(), document.animations().len()), (1, 1));
    assert_eq!(document.animations().next().unwrap().name(), Some("wave"));
    let json = Glb::parse(&bytes).json;
    assert_eq!(json["meshes"][0]["extras"]["targetNames"][0], "smile");
    assert_eq!(json["nodes"][2]["extras"]["ik"], true);
    for primitive in document.meshes().next().unwrap().primitives() {
        let reader = primitive.reader(|b| Some(&buffers[b.index()]));
        assert_eq!(reader.read_morph_targets().count(), 1);
        let positions: Vec<[f32; 3]> = reader.read_positions().unwrap().collect();
        let weights: Vec<[f32; 4]> = reader.read_weights(0).unwrap().into_f32().collect();
        let smile: Vec<[f32; 3]> = reader.read_morph_targets().next().unwrap().0.unwrap().collect();
        assert_eq!(
            (weights.len(), smile.len(), reader.read_joints(0).unwrap().into_u16().count()),
            (positions.len(), positions.len(), positions.len())
        );
    }
}

#[test]
fn a_model_keeps_the_rig_of_its_target() {
    let f = spheres();
    let say = f
        .run(
            "transfer --source s.obj --texture s.png --target t.glb --anchors a.json -o o.png --size 128 --model m.glb",
        )
        .succeeds();
    has_the_rig(&f, "m.glb");
    assert!(!say.stderr.contains("skeleton"), "{}", say.stderr);
    let (document, _, images) = ::gltf::import_slice(f.bytes("m.glb")).unwrap();
    assert_eq!((images.len(), images[0].width), (1, 128));
    let primitive = document.meshes().next().unwrap().primitives().next().unwrap();
    assert!(primitive.material().pbr_metallic_roughness().base_color_texture().is_some());
    // The vertices are where they were, in their order.
    let (before, after) = (read_mesh(f.path("t.glb")).unwrap().mesh, read_mesh(f.path("m.glb")).unwrap().mesh);
    assert_eq!(before.positions, after.positions);
    assert_eq!(before.triangles(), after.triangles());
    // With new charts, too, and by the same picture as of the same mesh as OBJ.
    f.run("transfer --source s.obj --texture s.png --target t.glb --anchors a.json -o u.png --size 128 --model u.glb --unwrap").succeeds();
    has_the_rig(&f, "u.glb");
    f.run("transfer --source s.obj --texture s.png --target t.obj --anchors a.json -o p.png --size 128").succeeds();
    assert_eq!(f.image("o.png").pixels, f.image("p.png").pixels);
}

#[test]
fn posed_and_unwrapped_files_keep_their_rig() {
    let f = spheres();
    let mesh = read_mesh(f.path("t.glb")).unwrap().mesh;
    let turn = |p: DVec3| DVec3::new(-p.y, p.x, p.z);
    let entries: Vec<Value> = (0..mesh.vertex_count())
        .step_by(29)
        .filter(|&v| mesh.representative(v as u32) as usize == v)
        .map(|v| json!({"vertex": v, "position": turn(mesh.positions[v]).to_array()}))
        .collect();
    f.write("h.json", &json!({"handles": entries}).to_string());
    f.run("deform t.glb --handles h.json -o d.glb --backend cpu").succeeds();
    has_the_rig(&f, "d.glb");
    let after = read_mesh(f.path("d.glb")).unwrap().mesh;
    assert_eq!(after.triangles(), mesh.triangles());
    let off = mesh.positions.iter().zip(&after.positions).map(|(p, q)| turn(*p).distance(*q)).fold(0.0, f64::max);
    assert!(off < 1e-6, "{off}");
    let normals = after.normals.iter().zip(&mesh.normals).map(|(a, b)| a.distance(turn(*b))).fold(0.0, f64::max);
    assert!(normals < 1e-5, "{normals}");

    f.run("unwrap t.glb -o u.glb").succeeds();
    has_the_rig(&f, "u.glb");
    let unwrapped = read_mesh(f.path("u.glb")).unwrap().mesh;
    assert!((0..mesh.triangle_count()).all(|t| unwrapped.triangle_positions(t) == mesh.triangle_positions(t)));
    f.run("unwrap t.glb -o u.obj").succeeds();
    let same = read_mesh(f.path("u.obj")).unwrap().mesh;
    for t in 0..mesh.triangle_count() {
        let (a, b) = (unwrapped.triangle_texcoords(t).unwrap(), same.triangle_texcoords(t).unwrap());
        assert!((0..3).all(|k| a[k].distance(b[k]) < 1e-6), "triangle {t}: {a:?} {b:?}");
    }

    let cube = |s: f64| {
        let p = (0..8)
            .map(|k| DVec3::new(f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2)) * 4.0 - 2.0)
            .map(|p| p * s);
        let faces = [
            [0, 2, 3],
            [0, 3, 1],
            [4, 5, 7],
            [4, 7, 6],
            [0, 1, 5],
            [0, 5, 4],
            [2, 6, 7],
            [2, 7, 3],
            [0, 4, 6],
            [0, 6, 2],
            [1, 3, 7],
            [1, 7, 5],
        ];
        Mesh::from_triangles("cage", p.collect(), &faces)
    };
    write_obj(&cube(1.0), f.path("a.obj")).unwrap();
    write_obj(&cube(1.5), f.path("b.obj")).unwrap();
    f.run("cage t.glb --from a.obj --to b.obj --path linear --partition direct --backend cpu -o c.glb").succeeds();
    has_the_rig(&f, "c.glb");
    let caged = read_mesh(f.path("c.glb")).unwrap().mesh;
    let off = mesh.positions.iter().zip(&caged.positions).map(|(p, q)| (*p * 1.5).distance(*q)).fold(0.0, f64::max);
    assert!(off < 1e-5, "{off}");
    // From another format the same, without a rig.
    f.run("cage t.obj --from a.obj --to b.obj --path linear --partition direct --backend cpu -o o.glb").succeeds();
    let plain = read_mesh(f.path("o.glb")).unwrap().mesh;
    assert_eq!(plain.triangle_count(), mesh.triangle_count());
    f.run("cage t.obj --from a.obj --to b.obj -o o.stl").fails(2, &["--output", ".obj or .ply or .glb"]);
}

#[test]
fn weights_come_from_a_rig_and_go_into_one() {
    let f = spheres();
    // The rig on the source; the target is larger.
    let source = read_mesh(f.path("s.obj")).unwrap().mesh;
    std::fs::write(f.path("s.glb"), rigged(&source)).unwrap();
    let run = |target: &str, out: &str| {
        f.run(&format!(
            "attributes --source s.glb --target {target} --anchors a.json --attributes s.glb --kind weights -o {out}"
        ))
        .succeeds()
    };
    run("t.obj", "w.csv");
    let table = f.read("w.csv");
    assert!(table.starts_with("index,hip,chest,status"), "{}", table.lines().next().unwrap());
    for (target, out) in [("t.obj", "o.glb"), ("t.glb", "g.glb")] {
        run(target, out);
        let (document, buffers, _) = ::gltf::import_slice(f.bytes(out)).unwrap();
        let skin = document.skins().next().unwrap();
        let names: Vec<&str> = skin.joints().filter_map(|j| j.name()).collect();
        assert_eq!(names, ["hip", "chest"], "{out}");
        let mut worst = 0.0_f32;
        for primitive in document.meshes().next().unwrap().primitives() {
            let reader = primitive.reader(|b| Some(&buffers[b.index()]));
            let positions: Vec<Vec3> = reader.read_positions().unwrap().map(Vec3::from).collect();
            let joints: Vec<[u16; 4]> = reader.read_joints(0).unwrap().into_u16().collect();
            let weights: Vec<[f32; 4]> = reader.read_weights(0).unwrap().into_f32().collect();
            assert_eq!((joints.len(), weights.len()), (positions.len(), positions.len()));
            for ((p, j), w) in positions.iter().zip(&joints).zip(&weights) {
                assert!((w.iter().sum::<f32>() - 1.0).abs() < 1e-6);
                let got: f32 = (0..4).filter(|&k| j[k] == 1).map(|k| w[k]).sum();
                worst = worst.max((got - upper(*p / STRETCH.as_vec3())).abs());
            }
        }
        assert!(worst < 0.02, "{out}: {worst}");
        // The shape is shown as it was.
        let (before, after) = (read_mesh(f.path(target)).unwrap().mesh, read_mesh(f.path(out)).unwrap().mesh);
        for t in 0..before.triangle_count() {
            let (a, b) = (before.triangle_positions(t), after.triangle_positions(t));
            assert!((0..3).all(|k| a[k].distance(b[k]) < 1e-5), "{out}, triangle {t}");
        }
    }
    // A table whose columns are joints of the source.
    f.run("attributes --source s.glb --target t.obj --anchors a.json --attributes s.glb --kind weights --top 1 -o one.glb").succeeds();
    f.run("attributes --source s.glb --target t.glb --anchors a.json --attributes s.glb -o x.glb")
        .fails(2, &["--kind weights"]);
    f.run("attributes --source s.obj --target t.obj --anchors a.json --attributes s.obj --kind weights -o x.glb")
        .fails(1, &["s.obj"]);
    f.run("attributes --source s.obj --target t.obj --anchors a.json --attributes t.png.glb --kind weights -o x.csv")
        .fails(1, &["t.png.glb"]);
}

#[test]
fn a_model_far_from_the_origin_keeps_its_vertices_apart() {
    let f = Folder::empty();
    for offset in [DVec3::new(5e5, 4.6e6, 0.0), DVec3::new(-3.3e6, 120.5, 7e4), DVec3::ZERO] {
        let mut mesh =
            barymap::models::shapes::plane_grid(2, 2, 1.0, 1.0, barymap::models::shapes::Diagonal::Alternating);
        mesh.positions.iter_mut().for_each(|p| *p += offset);
        write_obj(&mesh, f.path("p.obj")).unwrap();
        barymap::io::write_image(
            &barymap::raster::Image::zeros(8, 8, 3, barymap::raster::Depth::U8).unwrap(),
            f.path("p.png"),
        )
        .unwrap();
        f.write("p.txt", "0 0\n2 2\n6 6\n8 8\n");
        f.run(
            "transfer --source p.obj --texture p.png --target p.obj --anchors p.txt -o o.png --size 16 --model m.glb",
        )
        .succeeds();
        let back = read_mesh(f.path("m.glb")).unwrap().mesh;
        let sorted = |m: &Mesh| {
            let mut p: Vec<[u64; 3]> =
                m.positions.iter().map(|p| (*p + DVec3::ZERO).to_array().map(f64::to_bits)).collect();
            p.sort_unstable();
            p
        };
        assert_eq!(sorted(&back), sorted(&mesh), "{offset}");
    }
}

#[test]
fn hard_edges_stay_hard_in_a_model() {
    let f = Folder::empty();
    let mut obj = String::new();
    for k in 0..8 {
        obj += &format!("v {} {} {}\n", k & 1, k >> 1 & 1, k >> 2);
    }
    obj += "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
    for n in ["0 0 -1", "0 0 1", "0 -1 0", "0 1 0", "-1 0 0", "1 0 0"] {
        obj += &format!("vn {n}\n");
    }
    for (n, face) in
        [[1, 3, 4, 2], [5, 6, 8, 7], [1, 2, 6, 5], [3, 7, 8, 4], [1, 5, 7, 3], [2, 4, 8, 6]].iter().enumerate()
    {
        let corners: Vec<String> = face.iter().zip(1..).map(|(v, t)| format!("{v}/{t}/{}", n + 1)).collect();
        obj += &format!("f {}\n", corners.join(" "));
    }
    f.write("c.obj", &obj);
    f.write("c.txt", "0 0\n1 1\n2 2\n4 4\n7 7\n");
    barymap::io::write_image(
        &barymap::raster::Image::zeros(8, 8, 3, barymap::raster::Depth::U8).unwrap(),
        f.path("c.png"),
    )
    .unwrap();
    f.run("transfer --source c.obj --texture c.png --target c.obj --anchors c.txt -o o.png --size 16 --model m.glb")
        .succeeds();
    let (document, buffers, _) = ::gltf::import_slice(f.bytes("m.glb")).unwrap();
    let primitive = document.meshes().next().unwrap().primitives().next().unwrap();
    let reader = primitive.reader(|b| Some(&buffers[b.index()]));
    let (positions, normals): (Vec<Vec3>, Vec<Vec3>) =
        reader.read_positions().unwrap().map(Vec3::from).zip(reader.read_normals().unwrap().map(Vec3::from)).unzip();
    assert_eq!(positions.len(), 24);
    for triangle in reader.read_indices().unwrap().into_u32().collect::<Vec<_>>().chunks(3) {
        let p = [0, 1, 2].map(|k| positions[triangle[k] as usize]);
        let flat = (p[1] - p[0]).cross(p[2] - p[0]).normalize();
        assert!(triangle.iter().all(|&v| normals[v as usize] == flat), "{flat}");
    }
    // New texture coordinates leave them.
    f.run("unwrap m.glb -o n.glb").succeeds();
    let (document, buffers, _) = ::gltf::import_slice(f.bytes("n.glb")).unwrap();
    let primitive = document.meshes().next().unwrap().primitives().next().unwrap();
    let reader = primitive.reader(|b| Some(&buffers[b.index()]));
    assert!(reader.read_normals().unwrap().all(|n| Vec3::from(n).abs().max_element() == 1.0));
}

#[test]
fn a_set_of_texture_coordinates_is_chosen() {
    let f = spheres();
    // A second set, turned over from left to right.
    let mut glb = Glb::parse(&f.bytes("t.glb"));
    let plain = read_mesh(f.path("t.glb")).unwrap().mesh;
    let (document, buffers, _) = ::gltf::import_slice(f.bytes("t.glb")).unwrap();
    let primitive = document.meshes().next().unwrap().primitives().next().unwrap();
    let first = primitive.reader(|b| Some(&buffers[b.index()])).read_tex_coords(0).unwrap().into_f32();
    let mirrored: Vec<f32> = first.flat_map(|uv| [1.0 - uv[0], uv[1]]).collect();
    let k = glb.floats(&mirrored, "VEC2", 2);
    glb.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_1"] = k.into();
    std::fs::write(f.path("t.glb"), glb.bytes()).unwrap();
    let command = "transfer --source s.obj --texture s.png --target t.glb --anchors a.json --size 128 --margin 0";
    f.run(&format!("{command} -o o.png")).succeeds();
    f.run(&format!("{command} --uv-set 0,1 -o m.png --model m.glb")).succeeds();
    let (own, other) = (f.image("o.png"), f.image("m.png"));
    let difference = |turn: bool| {
        let at = |x: u32| if turn { 127 - x } else { x };
        let sum: f64 = (0..128 * 128)
            .map(|i| f64::from((own.get(i % 128, i / 128, 1) - other.get(at(i % 128), i / 128, 1)).abs()))
            .sum();
        sum / f64::from(128 * 128)
    };
    assert!(difference(true) < 0.01 && difference(false) > 0.05, "{} {}", difference(true), difference(false));
    let model = Glb::parse(&f.bytes("m.glb")).json;
    assert_eq!(model["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"], 1);
    let back = read_mesh(f.path("m.glb")).unwrap().mesh;
    assert_eq!(back.positions, plain.positions);
    f.run(&format!("{command} --uv-set 1,0 -o x.png")).fails(1, &["s.obj", "set 1", "--uv-set"]);
    f.run(&format!("{command} --uv-set 0,3 -o x.png")).fails(1, &["t.glb", "TEXCOORD_3"]);
}
