//! Animations and blends of rigged files.

use super::*;

/// Positions of the mesh with its last animation at its last key, before the skin.
fn last_frame(bytes: &[u8]) -> Vec<Vec3> {
    let (document, buffers, _) = ::gltf::import_slice(bytes).unwrap();
    let animation = document.animations().last().unwrap();
    let outputs = animation.channels().next().unwrap().reader(|b| Some(&buffers[b.index()])).read_outputs().unwrap();
    let ::gltf::animation::util::ReadOutputs::MorphTargetWeights(weights) = outputs else { panic!("no weights") };
    let weights: Vec<f32> = weights.into_f32().collect();
    let primitive = document.meshes().next().unwrap().primitives().next().unwrap();
    let reader = primitive.reader(|b| Some(&buffers[b.index()]));
    let count = primitive.morph_targets().count();
    let mut points: Vec<Vec3> = reader.read_positions().unwrap().map(Vec3::from).collect();
    for ((moved, ..), w) in reader.read_morph_targets().zip(&weights[weights.len() - count..]) {
        points.iter_mut().zip(moved.unwrap()).for_each(|(p, d)| *p += Vec3::from(d) * *w);
    }
    points
}

/// The rig is there, with an animation of this name beside its own.
#[track_caller]
fn has_the_rig_and(f: &Folder, name: &str, added: &str) {
    let (document, ..) = ::gltf::import_slice(f.bytes(name)).unwrap();
    let names: Vec<&str> = document.nodes().filter_map(|n| n.name()).collect();
    assert_eq!(names, ["body", "hip", "chest"]);
    let animations: Vec<&str> = document.animations().filter_map(|a| a.name()).collect();
    assert_eq!(animations, ["wave", added]);
    let json = Glb::parse(&f.bytes(name)).json;
    assert_eq!(json["meshes"][0]["extras"]["targetNames"][0], "smile");
    let primitive = document.meshes().next().unwrap().primitives().next().unwrap();
    assert!(primitive.get(&::gltf::Semantic::Joints(0)).is_some());
}

#[track_caller]
fn close(a: &[Vec3], b: &[DVec3], within: f64) {
    assert_eq!(a.len(), b.len());
    let off = a.iter().zip(b).map(|(a, b)| a.as_dvec3().distance(*b)).fold(0.0, f64::max);
    assert!(off < within, "{off}");
}

#[test]
fn in_betweens_of_rigged_files_keep_the_first_one() {
    let f = spheres();
    let first = read_mesh(f.path("t.glb")).unwrap().mesh;
    let mut second = Glb::parse(&f.bytes("t.glb"));
    // The same file, half as high.
    let accessor = second.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"].as_u64().unwrap() as usize;
    let view = second.json["accessors"][accessor]["bufferView"].as_u64().unwrap() as usize;
    let at = second.json["bufferViews"][view]["byteOffset"].as_u64().unwrap() as usize;
    for v in 0..first.vertex_count() {
        let y = &mut second.binary[at + 12 * v + 4..at + 12 * v + 8];
        let half = 0.5 * f32::from_le_bytes([y[0], y[1], y[2], y[3]]);
        y.copy_from_slice(&half.to_le_bytes());
    }
    std::fs::write(f.path("low.glb"), second.bytes()).unwrap();
    let low: Vec<DVec3> = first.positions.iter().map(|p| *p * DVec3::new(1.0, 0.5, 1.0)).collect();
    f.run("morph t.glb low.glb --frames 5 -o m.glb").succeeds();
    has_the_rig_and(&f, "m.glb", "morph");
    close(&last_frame(&f.bytes("m.glb")), &low, 1e-5);
    assert_eq!(read_mesh(f.path("m.glb")).unwrap().mesh.triangles(), first.triangles());
    // Files of plain meshes have no place for a rig, and say so.
    let ran = f.run("morph t.glb low.glb --frames 2 -o frames").succeeds();
    assert!(ran.stderr.contains("skins, morph targets, animations") && ran.stderr.contains(".glb"), "{}", ran.stderr);
    // One blend is the file in another shape.
    f.run("morph t.glb low.glb --weights 0,1 -o one.glb").succeeds();
    has_the_rig(&f, "one.glb");
    let one = read_mesh(f.path("one.glb")).unwrap().mesh;
    let off = one.positions.iter().zip(&low).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    assert!(off < 1e-5, "{off}");
    // Its normals are those of the shape: a low ellipsoid is flatter on top.
    let v = (0..first.vertex_count()).find(|&v| (0.5..0.9).contains(&first.normals[v].y)).unwrap();
    assert!(one.normals[v].y > first.normals[v].y + 0.05, "{} {}", one.normals[v], first.normals[v]);
}

#[test]
fn markers_move_a_rigged_file() {
    let f = spheres();
    let mesh = read_mesh(f.path("t.glb")).unwrap().mesh;
    let own = |v: usize| mesh.representative(v as u32) as usize == v;
    let bound: Vec<usize> = (0..mesh.vertex_count()).step_by(23).filter(|&v| own(v)).collect();
    let places: serde_json::Map<String, Value> =
        bound.iter().enumerate().map(|(k, v)| (format!("M{k}"), json!(v))).collect();
    f.write("m.json", &Value::Object(places).to_string());
    let head: String = (0..bound.len()).map(|k| format!(",M{k}.x,M{k}.y,M{k}.z")).collect();
    // A turn about the vertical, and a step.
    let moved = |p: DVec3, t: f64| DVec3::new(p.x * t.cos() + p.z * t.sin(), p.y, p.z * t.cos() - p.x * t.sin()) + t;
    let mut text = format!("time{head}");
    for frame in 0..6 {
        let t = f64::from(frame) * 0.1;
        text += &format!("\n{}", f64::from(frame) / 30.0);
        for &v in &bound {
            let p = moved(mesh.positions[v], t);
            text += &format!(",{},{},{}", p.x, p.y, p.z);
        }
    }
    f.write("walk.csv", &text);
    f.run("animate t.glb --motion walk.csv --markers m.json --reference 0 -o a.glb").succeeds();
    has_the_rig_and(&f, "a.glb", "walk");
    let wanted: Vec<DVec3> = mesh.positions.iter().map(|p| moved(*p, 0.5)).collect();
    close(&last_frame(&f.bytes("a.glb")), &wanted, 1e-3);
}
