//! What is written of a scene whose shape changes, or nothing: all that was there.

use super::*;

#[test]
fn vertices_are_those_of_an_independent_reader() {
    for (name, sample) in samples::all() {
        if name == "quantized" {
            // The independent reader takes positions for single precision.
            let mesh = read(&sample.glb()).mesh;
            assert!(close(
                &mesh.positions,
                &[[5.0, 0.0, 0.0], [6.0, 0.0, 0.0], [5.0, 1.0, 0.0], [6.0, 1.0, 0.5]].map(DVec3::from),
                1e-12
            ));
            continue;
        }
        let (mesh, expected) = (read(&sample.glb()).mesh, independent(&sample.glb()));
        assert!(close(&mesh.positions, &expected, 1e-6), "{name}: {:?}\n{:?}", mesh.positions, expected);
        assert!(!close(&mesh.positions[1..], &expected[..expected.len() - 1], 1e-6), "{name}");
    }
}

#[test]
fn without_a_change_nothing_changes() {
    let mut written = Vec::new();
    for (name, sample) in samples::all() {
        let before = sample.glb();
        let LoadedMesh { mesh, scene, .. } = read(&before);
        let mut edit = scene.as_ref().unwrap().edit();
        edit.shape(&mesh).unwrap();
        edit.texcoords(&mesh, KeepTextures::No).unwrap();
        let (after, notes) = edit.finish().unwrap();
        assert_eq!((changed(&before, &after), notes), (vec![], vec![]), "{name}");
        assert!(after.len() <= before.len() + 64, "{name}: {} of {}", after.len(), before.len());
        // The comparison sees what is lost.
        let mut less = Sample { json: sample.json.clone(), binary: sample.binary.clone() };
        less.json["nodes"][0] = json!({"name": "another"});
        assert!(!changed(&less.glb(), &after).is_empty(), "{name}");
        let mut less = Sample { json: sample.json, binary: sample.binary };
        less.binary[5] ^= 1;
        assert!(!changed(&less.glb(), &after).is_empty(), "{name}");
        // Weights that do not sum to one are no valid input.
        if name != "posed" {
            written.extend([(format!("{name}, before"), before), (name.to_owned(), after)]);
        }
    }
    samples::check_valid(&written);
}

#[test]
fn a_new_shape_comes_back_and_all_else_stays() {
    let mut written = Vec::new();
    for (name, sample) in samples::all() {
        let before = sample.glb();
        let LoadedMesh { mesh, scene, .. } = read(&before);
        let new = bent(&mesh);
        let mut edit = scene.as_ref().unwrap().edit();
        edit.shape(&new).unwrap();
        let (after, notes) = edit.finish().unwrap();
        let changed = changed(&before, &after);
        let allowed =
            |path: &String| ["POSITION", "TANGENT"].iter().any(|a| path.ends_with(&format!("/attributes/{a}")));
        assert!(!changed.is_empty() && changed.iter().all(allowed), "{name}: {changed:?}");
        assert!(notes.is_empty(), "{name}: {notes:?}");
        let back = read(&after).mesh;
        assert!(close(&back.positions, &new.positions, 1e-6), "{name}: {:?}\n{:?}", back.positions, new.positions);
        assert!(!close(&back.positions, &mesh.positions, 1e-3), "{name}");
        assert_eq!(back.triangles(), mesh.triangles(), "{name}");
        // Nothing that is not used any more stays behind.
        let apart = matches!(name, "quantized" | "shared");
        // Positions that were shared or whole numbers are written anew.
        let room = if apart { 2048 } else { 256 };
        assert!(after.len() <= before.len() + room, "{name}: {} of {}", after.len(), before.len());
        if name != "quantized" {
            ::gltf::import_slice(&after).unwrap();
        }
        if name != "posed" {
            written.push((name.to_owned(), after));
        }
    }
    samples::check_valid(&written);
}

#[test]
fn tangents_and_normals_turn_with_the_surface() {
    let LoadedMesh { mesh, scene, .. } = read(&samples::interleaved().glb());
    let mut turned = mesh.clone();
    // A quarter turn about x: normals to -y, the tangents along x stay; and a stretch along x.
    turned.positions.iter_mut().for_each(|p| *p = DVec3::new(3.0 * p.x, 0.0, p.y));
    turned.normals.iter_mut().for_each(|n| *n = -DVec3::Y);
    let mut edit = scene.as_ref().unwrap().edit();
    edit.shape(&turned).unwrap();
    let (bytes, _) = edit.finish().unwrap();
    let (document, buffers, _) = ::gltf::import_slice(&bytes).unwrap();
    let primitive = document.meshes().next().unwrap().primitives().next().unwrap();
    let reader = primitive.reader(|b| Some(&buffers[b.index()]));
    assert!(reader.read_normals().unwrap().all(|n| n == [0.0, -1.0, 0.0]));
    assert!(reader.read_tangents().unwrap().all(|t| (t[0] - 1.0).abs() < 1e-6 && t[3] == -1.0));
    let colors: Vec<[u8; 4]> = reader.read_colors(0).unwrap().into_rgba_u8().collect();
    assert_eq!(colors[5], [150, 255, 0, 255]);
    assert_eq!(reader.read_positions().unwrap().nth(7).unwrap(), [9.0, 0.0, 1.0]);
}

#[test]
fn text_with_buffers_and_pictures_of_its_own_becomes_one_file() {
    let folder = tempfile::tempdir().unwrap();
    let mut sample = samples::dressed();
    let view = sample.json["bufferViews"].as_array().unwrap().len();
    sample.json["buffers"] = json!([{"byteLength": sample.binary.len(), "uri": "the%20data.bin"},
        {"byteLength": sample.binary.len(), "uri": "the%20data.bin"}]);
    for k in (1..view).step_by(2) {
        sample.json["bufferViews"][k]["buffer"] = 1.into();
    }
    sample.json["images"][1] = json!({"uri": "bumps.png"});
    sample.json["images"][2] = json!({"uri": "gone.png"});
    std::fs::write(folder.path().join("the data.bin"), &sample.binary).unwrap();
    std::fs::write(folder.path().join("bumps.png"), picture(0.5)).unwrap();
    std::fs::write(folder.path().join("s.gltf"), sample.json.to_string()).unwrap();
    let loaded = read_mesh(folder.path().join("s.gltf")).unwrap();
    let mut edit = loaded.scene.as_ref().unwrap().edit();
    edit.shape(&bent(&loaded.mesh)).unwrap();
    let (bytes, notes) = edit.finish().unwrap();
    assert!(notes.len() == 1 && notes[0].contains("gone.png"), "{notes:?}");
    let written = expanded(&bytes);
    assert_eq!(written["images"][1]["bufferView"], json!(picture(0.5).to_vec()));
    assert_eq!(written["images"][1]["mimeType"], "image/png");
    assert_eq!(written["images"][0], expanded(&samples::dressed().glb())["images"][0]);
    assert!(close(&read(&bytes).mesh.positions, &bent(&loaded.mesh).positions, 1e-6));
}

#[test]
fn another_mesh_is_refused() {
    let loaded = read(&samples::rigged().glb());
    let other = Mesh::of_triangles("t", vec![DVec3::ZERO, DVec3::X, DVec3::Y], &[[0, 1, 2]]);
    let scene = loaded.scene.unwrap();
    assert!(scene.edit().shape(&other).unwrap_err().to_string().contains("3 vertices and 1 triangles"));
    assert!(scene.edit().texcoords(&other, KeepTextures::No).is_err());
    let mut huge = loaded.mesh.clone();
    huge.positions[3] = DVec3::splat(1e60);
    assert!(scene.edit().shape(&huge).unwrap_err().to_string().contains("vertex 3"));
}

#[test]
fn damaged_rigs_are_errors_or_notes() {
    let with = |pointer: &str, value: Value| {
        let mut sample = samples::rigged();
        let (parent, key) = pointer.rsplit_once('/').unwrap();
        sample.json.pointer_mut(parent).unwrap()[key] = value;
        parse_gltf(&sample.glb(), Path::new("rig.glb"))
    };
    let joints = samples::rigged().json["meshes"][0]["primitives"][0]["attributes"]["JOINTS_0"].as_u64().unwrap();
    let normals = samples::rigged().json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"].as_u64().unwrap();
    for (pointer, value, expected) in [
        ("/skins/0/joints".to_owned(), json!([2]), "follows joint 1 of 1"),
        ("/skins/0/joints".to_owned(), json!([2, 99]), "no node 99"),
        ("/skins/0/joints".to_owned(), json!([2, 3, 2]), "3 joints and 2 matrices"),
        ("/nodes/1/skin".to_owned(), json!(4), "no skin 4"),
        (format!("/accessors/{joints}/count"), json!(24), "before the last vertex"),
        (format!("/accessors/{normals}/count"), json!(3), "ends before the last"),
        ("/nodes/3/children".to_owned(), json!([0]), "two parents"),
    ] {
        let message = with(&pointer, value).unwrap_err().to_string();
        assert!(message.contains(expected), "{pointer}: {message}");
    }
    let none = with("/meshes/0/primitives/0/attributes/WEIGHTS_0", json!(0));
    assert!(none.is_err(), "three components are no weights");
    // A flat bone: positions cannot go back, and are named.
    let loaded = with("/nodes/2/scale", json!([1, 0, 1])).unwrap();
    let mut mesh = loaded.mesh.clone();
    mesh.positions.iter_mut().for_each(|p| *p += DVec3::ONE);
    let mut edit = loaded.scene.as_ref().unwrap().edit();
    edit.shape(&mesh).unwrap();
    let (bytes, notes) = edit.finish().unwrap();
    assert!(notes[0].contains("stay as they were stored"), "{notes:?}");
    assert!(read(&bytes).mesh.positions.iter().all(|p| p.is_finite()));
}
