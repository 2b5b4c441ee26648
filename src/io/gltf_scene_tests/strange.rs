//! What files may hold that samples do not.

use super::*;

/// Reads a file, gives its mesh another shape, and writes it; what differs beside that, without the
/// meshes.
#[track_caller]
fn reshaped(name: &str, sample: &Sample, valid: bool) -> Vec<u8> {
    let before = sample.glb();
    let LoadedMesh { mesh, scene, .. } = read(&before);
    let new = bent(&mesh);
    let mut edit = scene.as_ref().unwrap().edit();
    edit.shape(&new).unwrap();
    let (after, notes) = edit.finish().unwrap();
    assert!(notes.is_empty(), "{name}: {notes:?}");
    let back = read(&after).mesh;
    assert!(close(&back.positions, &new.positions, 1e-6), "{name}: {:?}\n{:?}", back.positions, new.positions);
    assert!(close(&independent(&after), &new.positions, 1e-6), "{name}");
    let other: Vec<String> = changed(&before, &after)
        .into_iter()
        .filter(|path| !["POSITION", "NORMAL", "TANGENT"].iter().any(|a| path.ends_with(&format!("/attributes/{a}"))))
        .collect();
    assert!(other.is_empty(), "{name}: {other:?}");
    if valid {
        samples::check_valid(&[(format!("{name}, before"), before), (name.to_owned(), after.clone())]);
    }
    after
}

#[test]
fn positions_with_replacements_are_written_whole() {
    let mut sample = samples::rigged();
    let at = sample.view(&[3u16.to_le_bytes(), 7u16.to_le_bytes()].concat());
    let by = sample.view(&[[0.25f32, 0.5, 0.75]; 2].concat().iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>());
    let k = sample.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"].as_u64().unwrap() as usize;
    sample.json["accessors"][k]["sparse"] = json!({"count": 2,
        "indices": {"bufferView": at, "componentType": 5123}, "values": {"bufferView": by}});
    sample.json["accessors"][k]["max"][2] = json!(0.75);
    let mesh = read(&sample.glb()).mesh;
    assert_eq!((mesh.positions[3], mesh.positions[7]), (DVec3::new(0.25, 0.5, 0.75), DVec3::new(0.25, 0.5, 0.75)));
    let after = reshaped("sparse", &sample, true);
    // Nothing of the replacements is left.
    let document = Document::parse(after, Path::new("a.glb")).unwrap();
    assert!(document.accessor(k).unwrap().sparse.is_none());
}

#[test]
fn mirrored_and_scaled_nodes_above_skins_and_meshes() {
    let mut sample = samples::interleaved();
    sample.json["nodes"] = json!([{"mesh": 0, "scale": [-2, 1, 0.5], "translation": [3, 0, 1]}]);
    assert_eq!(read(&sample.glb()).mesh.positions[2], DVec3::new(1.0, 0.0, 1.0));
    reshaped("mirrored", &sample, true);
    // A skinned mesh does not follow its own node; a scale above its joints it does.
    let mut sample = samples::rigged();
    let plain = read(&sample.glb()).mesh.positions;
    sample.json["nodes"][1]["scale"] = json!([3, 3, 3]);
    assert_eq!(read(&sample.glb()).mesh.positions, plain);
    sample.json["nodes"][0]["scale"] = json!([2, 2, -2]);
    let scaled = read(&sample.glb()).mesh.positions;
    assert!(scaled.iter().zip(&plain).all(|(a, b)| a.distance(*b * DVec3::new(2.0, 2.0, -2.0)) < 1e-6));
    reshaped("scaled", &sample, false);
}

#[test]
fn a_morph_target_may_hold_normals_alone() {
    let mut sample = samples::morphed();
    let normals = sample.json["meshes"][0]["primitives"][0]["targets"][0]["NORMAL"].clone();
    sample.json["meshes"][0]["primitives"][0]["targets"] = json!([{"NORMAL": normals}, {"NORMAL": normals}]);
    // The independent reader wants positions in each.
    let before = sample.glb();
    let LoadedMesh { mesh, scene, .. } = read(&before);
    let mut edit = scene.as_ref().unwrap().edit();
    edit.shape(&bent(&mesh)).unwrap();
    edit.texcoords(&charted(&bent(&mesh)), KeepTextures::No).unwrap();
    let (after, _) = edit.finish().unwrap();
    let targets = &expanded(&after)["meshes"][0]["primitives"][0]["targets"];
    assert!(targets[0].get("POSITION").is_none() && targets[1]["NORMAL"].as_array().unwrap().len() > 16 * 3);
    samples::check_valid(&[("before".into(), before), ("normals".into(), after)]);
}

#[test]
fn extras_are_kept_at_every_level() {
    let mut sample = samples::rigged();
    sample.json["extras"] = json!({"whole": [1, {"bufferView": 7}]});
    for list in ["scenes", "nodes", "meshes", "skins", "animations", "accessors", "bufferViews"] {
        for k in 0..sample.json[list].as_array().unwrap().len() {
            sample.json[list][k]["extras"] = json!({"of": list, "number": k, "index": 99, "material": 3});
        }
    }
    let primitive = &mut sample.json["meshes"][0]["primitives"][0];
    primitive["extras"] = json!({"attributes": {"x": 1}});
    sample.json["animations"][0]["samplers"][0]["extras"] = json!({"input": 5});
    sample.json["animations"][0]["channels"][0]["target"]["extras"] = json!({"node": 99});
    let after = reshaped("extras", &sample, true);
    let json = Document::parse(after, Path::new("a.glb")).unwrap().json;
    assert_eq!(json["extras"], sample.json["extras"]);
    let accessors = json["accessors"].as_array().unwrap();
    assert!(accessors.iter().enumerate().all(|(k, a)| a["extras"]["number"] == k), "{accessors:?}");
}

#[test]
fn of_several_scenes_the_first_is_taken_and_what_it_lacks_is_told() {
    let mut sample = samples::hidden();
    sample.json.as_object_mut().unwrap().remove("scene");
    let loaded = read(&sample.glb());
    assert_eq!(loaded.mesh.vertex_count(), 5);
    let said = loaded.warnings.join("\n");
    assert!(said.contains("unseen") && said.contains("not in the scene"), "{said}");
    let mut edit = loaded.scene.as_ref().unwrap().edit();
    edit.shape(&bent(&loaded.mesh)).unwrap();
    let (after, _) = edit.finish().unwrap();
    let lost = changed(&sample.glb(), &after).into_iter().filter(|p| !p.ends_with("/attributes/POSITION")).count();
    assert_eq!(lost, 0);
    samples::check_valid(&[("scenes".into(), after)]);
}

#[test]
fn buffers_and_pictures_in_the_text_become_bytes() {
    use crate::io::gltf_container::base64;
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let encoded = |bytes: &[u8]| -> String {
        let mut text = String::new();
        for three in bytes.chunks(3) {
            let word = three.iter().fold(0u32, |w, b| w << 8 | u32::from(*b)) << (8 * (3 - three.len()));
            (0..4).for_each(|k| text.push(DIGITS[(word >> (18 - 6 * k) & 63) as usize] as char));
            text.truncate(text.len() + three.len() - 3);
            text.extend(std::iter::repeat_n('=', 3 - three.len()));
        }
        text
    };
    let mut sample = samples::dressed();
    assert_eq!(base64(encoded(&sample.binary).as_bytes()).unwrap(), sample.binary);
    let uri = format!("data:application/octet-stream;base64,{}", encoded(&sample.binary));
    sample.json["buffers"] = json!([{"byteLength": sample.binary.len(), "uri": uri}]);
    let png = format!("data:image/png;base64,{}", encoded(&picture(0.5)));
    sample.json["images"][1] = json!({"uri": png});
    let loaded = parse_gltf(sample.json.to_string().as_bytes(), Path::new("text.gltf")).unwrap();
    let mut edit = loaded.scene.as_ref().unwrap().edit();
    edit.shape(&bent(&loaded.mesh)).unwrap();
    let (after, notes) = edit.finish().unwrap();
    assert!(notes.is_empty(), "{notes:?}");
    let json = expanded(&after);
    assert_eq!(json["images"][1], json!({"bufferView": picture(0.5).to_vec(), "mimeType": "image/png"}));
    assert!(close(&read(&after).mesh.positions, &bent(&loaded.mesh).positions, 1e-6));
    samples::check_valid(&[("text".into(), after)]);
}
