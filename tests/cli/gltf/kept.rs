//! What a rigged target had is in what commands write of it.

use super::*;

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
        Mesh::from_triangles("cage", p.collect(), &faces).unwrap()
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
            .map(|i| f64::from((own.get(i % 128, i / 128, 0) - other.get(at(i % 128), i / 128, 0)).abs()))
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
