//! New texture coordinates and materials for a scene.

use super::*;

#[test]
fn vertices_that_are_split_keep_all_they_had() {
    let mut written = Vec::new();
    for (name, sample) in samples::all() {
        let before = sample.glb();
        let LoadedMesh { mesh, scene, .. } = read(&before);
        let new = charted(&mesh);
        let mut edit = scene.as_ref().unwrap().edit();
        edit.texcoords(&new, KeepTextures::No).unwrap();
        let (after, notes) = edit.finish().unwrap();
        assert_eq!(notes.is_empty(), name != "dressed", "{name}: {notes:?}");
        let changed = changed(&before, &after);
        assert!(changed.iter().all(|path| path.contains("/primitives/")), "{name}: {changed:?}");
        let back = read(&after).mesh;
        assert!(back.vertex_count() > mesh.vertex_count(), "{name}");
        for t in 0..mesh.triangle_count() {
            let (a, b) = (mesh.triangle_positions(t), back.triangle_positions(t));
            assert!(close(&a, &b, 1e-12), "{name}, triangle {t}");
            let normals = |m: &Mesh| m.triangle_corners(t).map(|c| m.normals.get(c.normal as usize).copied());
            assert_eq!(normals(&mesh), normals(&back), "{name}, triangle {t}");
            if name != "dressed" {
                let (a, b) = (new.triangle_texcoords(t).unwrap(), back.triangle_texcoords(t).unwrap());
                assert!((0..3).all(|k| a[k].distance(b[k]) < 1e-6), "{name}, triangle {t}: {a:?} {b:?}");
            }
        }
        if name != "quantized" {
            let (a, b) = (::gltf::import_slice(&before).unwrap().0, ::gltf::import_slice(&after).unwrap().0);
            let count = |d: &::gltf::Document| {
                d.meshes()
                    .flat_map(|m| m.primitives().map(|p| p.morph_targets().count()).collect::<Vec<_>>())
                    .sum::<usize>()
            };
            assert_eq!(count(&a), count(&b), "{name}");
        }
        if name != "posed" {
            written.push((name.to_owned(), after));
        }
    }
    samples::check_valid(&written);
}

#[test]
fn a_new_texture_replaces_its_role_and_nothing_else() {
    let before = samples::dressed().glb();
    let LoadedMesh { mesh, scene, .. } = read(&before);
    let material = GlbMaterial {
        name: "new".into(),
        base_color: [1.0, 0.5, 0.5, 1.0],
        texture: Some(picture(1.0).into()),
        ..GlbMaterial::default()
    };
    let mut edit = scene.as_ref().unwrap().edit();
    edit.materials(&mesh, &[material], &vec![0; mesh.triangle_count()]).unwrap();
    let (after, notes) = edit.finish().unwrap();
    assert_eq!(notes, Vec::<String>::new());
    let (old, new) = (expanded(&before), expanded(&after));
    let (cloth, metal) = (&new["materials"][0], &new["materials"][2]);
    // The first is changed where it is: all that use it change.
    assert_eq!(cloth["name"], "cloth");
    for kept in ["normalTexture", "extensions", "extras"] {
        assert_eq!(cloth[kept], old["materials"][0][kept], "{kept}");
    }
    let pbr = &cloth["pbrMetallicRoughness"];
    // The new picture lies on the coordinates as they are.
    assert!(pbr["baseColorTexture"].get("extensions").is_none());
    assert_eq!((&pbr["metallicFactor"], &pbr["baseColorFactor"]), (&json!(0.25), &json!([1.0, 0.5, 0.5, 1.0])));
    assert_eq!(new["images"][0]["bufferView"], json!(picture(1.0).to_vec()));
    // The second has variants, which keep the old one.
    assert_eq!(new["materials"][1], old["materials"][1]);
    assert_eq!(
        (&metal["name"], &metal["doubleSided"], &metal["pbrMetallicRoughness"]["baseColorTexture"]["index"]),
        (&json!("new"), &json!(true), &pbr["baseColorTexture"]["index"])
    );
    assert_eq!(new["meshes"][0]["primitives"][1]["material"], 2);
    assert_eq!((new["textures"].as_array().unwrap().len(), new["images"].as_array().unwrap().len()), (3, 3));
    for kept in ["nodes", "extensions", "scenes", "extensionsUsed"] {
        assert_eq!(new[kept], old[kept]);
    }
    samples::check_valid(&[("dressed".into(), after)]);
}

#[test]
fn new_coordinates_leave_the_old_ones_to_the_textures_that_stay() {
    let before = samples::dressed().glb();
    let LoadedMesh { mesh, scene, .. } = read(&before);
    let material = GlbMaterial {
        name: "new".into(),
        base_color: [1.0; 4],
        texture: Some(picture(1.0).into()),
        ..GlbMaterial::default()
    };
    let new = charted(&mesh);
    let mut edit = scene.as_ref().unwrap().edit();
    edit.materials(&new, &[material], &vec![0; mesh.triangle_count()]).unwrap();
    let (after, notes) = edit.finish().unwrap();
    assert_eq!(notes, Vec::<String>::new());
    let written = expanded(&after);
    let cloth = &written["materials"][0];
    assert_eq!(cloth["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"], 1);
    assert!(cloth["pbrMetallicRoughness"]["baseColorTexture"].get("extensions").is_none());
    assert!(cloth["normalTexture"].get("texCoord").is_none());
    let attributes = &written["meshes"][0]["primitives"][0]["attributes"];
    assert!(attributes["TEXCOORD_0"].as_array().unwrap().len() == attributes["TEXCOORD_1"].as_array().unwrap().len());
    let back = read(&after).mesh;
    for t in 0..mesh.triangle_count() {
        let (a, b) = (new.triangle_texcoords(t).unwrap(), back.triangle_texcoords(t).unwrap());
        assert!((0..3).all(|k| a[k].distance(b[k]) < 1e-6), "triangle {t}: {a:?} {b:?}");
    }
    samples::check_valid(&[("dressed".into(), after)]);
}

#[test]
fn parts_with_pictures_of_their_own_become_primitives_of_their_own() {
    let before = samples::rigged().glb();
    let LoadedMesh { mesh, scene, .. } = read(&before);
    let dress = |name: &str, value| GlbMaterial {
        name: name.into(),
        base_color: [1.0; 4],
        texture: Some(picture(value).into()),
        ..GlbMaterial::default()
    };
    let of: Vec<u32> = (0..mesh.triangle_count() as u32).map(|t| if t % 3 == 2 { NONE } else { t % 3 }).collect();
    let mut edit = scene.as_ref().unwrap().edit();
    edit.materials(&mesh, &[dress("a", 0.5), dress("b", 1.0)], &of).unwrap();
    let (after, _) = edit.finish().unwrap();
    let written = expanded(&after);
    let primitives = written["meshes"][0]["primitives"].as_array().unwrap();
    assert_eq!(primitives.len(), 3);
    assert_eq!(
        primitives.iter().map(|p| p["indices"].as_array().unwrap().len()).sum::<usize>(),
        3 * mesh.triangle_count()
    );
    assert_eq!(primitives.iter().filter(|p| p.get("material").is_some()).count(), 2);
    assert!(
        primitives
            .iter()
            .all(|p| p["targets"].as_array().unwrap().len() == 1 && p["attributes"].get("JOINTS_0").is_some())
    );
    ::gltf::import_slice(&after).unwrap();
    samples::check_valid(&[("parts".into(), after)]);
}
