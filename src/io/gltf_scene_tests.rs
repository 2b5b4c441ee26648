use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use glam::{DMat4, DVec2, DVec3};
use serde_json::{Value, json};

use super::*;
use crate::geometry::{Corner, MeshBuilder, NONE};
use crate::io::gltf_read::parse_gltf;
use crate::io::gltf_samples::{self as samples, Sample};
use crate::io::image_file::encode_png;
use crate::io::{LoadedMesh, read_mesh};
use crate::raster::{Depth, Image};

fn read(bytes: &[u8]) -> LoadedMesh {
    parse_gltf(bytes, Path::new("sample.glb")).unwrap_or_else(|e| panic!("{e}"))
}

/// Where an independent reader has the vertices of the default scene, mesh by mesh in file order.
fn independent(bytes: &[u8]) -> Vec<DVec3> {
    fn visit<'a>(node: ::gltf::Node<'a>, above: DMat4, out: &mut BTreeMap<usize, (::gltf::Node<'a>, DMat4)>) {
        let own = DMat4::from_cols_array(&node.transform().matrix().concat().map_f64());
        let global = above * own;
        out.insert(node.index(), (node.clone(), global));
        node.children().for_each(|child| visit(child, global, out));
    }
    trait Wide {
        fn map_f64(self) -> [f64; 16];
    }
    impl Wide for Vec<f32> {
        fn map_f64(self) -> [f64; 16] {
            std::array::from_fn(|k| f64::from(self[k]))
        }
    }
    let (document, buffers, _) = ::gltf::import_slice(bytes).unwrap();
    let mut nodes = BTreeMap::new();
    let mut order = Vec::new();
    for root in document.default_scene().unwrap().nodes() {
        visit(root.clone(), DMat4::IDENTITY, &mut nodes);
        let mut stack = vec![root];
        while let Some(node) = stack.pop() {
            order.push(node.index());
            stack.extend(node.children().collect::<Vec<_>>().into_iter().rev());
        }
    }
    let mut all = Vec::new();
    for mesh in document.meshes() {
        let user = order.iter().map(|n| &nodes[n]).find(|(n, _)| n.mesh().is_some_and(|m| m.index() == mesh.index()));
        let Some((node, global)) = user else { continue };
        let weights = node.weights().or(mesh.weights()).unwrap_or(&[]);
        let triangles =
            [::gltf::mesh::Mode::Triangles, ::gltf::mesh::Mode::TriangleStrip, ::gltf::mesh::Mode::TriangleFan];
        for primitive in mesh.primitives().filter(|p| triangles.contains(&p.mode())) {
            let reader = primitive.reader(|b| Some(&buffers[b.index()]));
            let vector = |p: [f32; 3]| DVec3::from(p.map(f64::from));
            let mut points: Vec<DVec3> = reader.read_positions().unwrap().map(vector).collect();
            for ((moved, ..), &w) in reader.read_morph_targets().zip(weights) {
                points.iter_mut().zip(moved.unwrap()).for_each(|(p, d)| *p += vector(d) * f64::from(w));
            }
            let mut blended = vec![*global; points.len()];
            if let Some(skin) = node.skin() {
                let binds: Vec<_> =
                    skin.reader(|b| Some(&buffers[b.index()])).read_inverse_bind_matrices().unwrap().collect();
                let joints: Vec<DMat4> = skin
                    .joints()
                    .zip(binds)
                    .map(|(j, bind)| nodes[&j.index()].1 * DMat4::from_cols_array(&bind.concat().map_f64()))
                    .collect();
                let mut sums = vec![0.0; points.len()];
                blended = vec![DMat4::ZERO; points.len()];
                for set in 0..2 {
                    let (Some(of), Some(by)) = (reader.read_joints(set), reader.read_weights(set)) else { continue };
                    for (v, (j, w)) in of.into_u16().zip(by.into_f32()).enumerate() {
                        for k in 0..4 {
                            blended[v] += joints[usize::from(j[k])] * f64::from(w[k]);
                            sums[v] += f64::from(w[k]);
                        }
                    }
                }
                blended.iter_mut().zip(sums).for_each(|(m, s)| *m *= 1.0 / s);
            }
            all.extend(points.iter().zip(&blended).map(|(p, m)| m.transform_point3(*p)));
        }
    }
    all
}

/// The JSON with the data in the place of references to accessors and pictures: all that a file
/// says.
fn expanded(bytes: &[u8]) -> Value {
    let document = Document::parse(bytes.to_vec(), Path::new("sample.glb")).unwrap();
    let data = |k: &Value| -> Value {
        let k = k.as_u64().unwrap() as usize;
        let accessor = document.accessor(k).unwrap();
        let width = match accessor.shape.as_str() {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        json!(document.numbers(k, width).unwrap())
    };
    let mut all = document.json.clone();
    let fill = |object: &mut Value| {
        for (_, k) in object.as_object_mut().into_iter().flatten() {
            *k = data(k);
        }
    };
    for mesh in all["meshes"].as_array_mut().unwrap() {
        for primitive in mesh["primitives"].as_array_mut().unwrap() {
            fill(&mut primitive["attributes"]);
            primitive.get_mut("targets").and_then(Value::as_array_mut).into_iter().flatten().for_each(&fill);
            if let Some(k) = primitive.get_mut("indices") {
                *k = data(k);
            }
        }
    }
    for skin in all.get_mut("skins").and_then(Value::as_array_mut).into_iter().flatten() {
        skin["inverseBindMatrices"] = data(&skin["inverseBindMatrices"]);
    }
    for animation in all.get_mut("animations").and_then(Value::as_array_mut).into_iter().flatten() {
        for sampler in animation["samplers"].as_array_mut().unwrap() {
            (sampler["input"], sampler["output"]) = (data(&sampler["input"]), data(&sampler["output"]));
        }
    }
    for image in all.get_mut("images").and_then(Value::as_array_mut).into_iter().flatten() {
        if let Some(view) = image.get_mut("bufferView") {
            *view = json!(document.view(view.as_u64().unwrap() as usize).unwrap().0);
        }
    }
    for list in ["accessors", "bufferViews", "buffers"] {
        all.as_object_mut().unwrap().remove(list);
    }
    all
}

/// The paths at which two documents differ.
fn differences(a: &Value, b: &Value, path: &str, out: &mut Vec<String>) {
    match (a, b) {
        (Value::Object(x), Value::Object(y)) => {
            let keys: std::collections::BTreeSet<&String> = x.keys().chain(y.keys()).collect();
            for key in keys {
                differences(
                    x.get(key).unwrap_or(&Value::Null),
                    y.get(key).unwrap_or(&Value::Null),
                    &format!("{path}/{key}"),
                    out,
                );
            }
        }
        (Value::Array(x), Value::Array(y)) if x.len() == y.len() && x.iter().any(|v| !v.is_number()) => {
            x.iter().zip(y).enumerate().for_each(|(k, (x, y))| differences(x, y, &format!("{path}/{k}"), out));
        }
        _ if a != b => out.push(path.to_owned()),
        _ => {}
    }
}

fn changed(before: &[u8], after: &[u8]) -> Vec<String> {
    let mut out = Vec::new();
    differences(&expanded(before), &expanded(after), "", &mut out);
    out
}

/// A shape with a bend in it.
fn bent(mesh: &Mesh) -> Mesh {
    let mut bent = mesh.clone();
    let (low, high) = mesh.bounds().unwrap();
    let size = (high - low).max_element();
    for p in &mut bent.positions {
        p.z += 0.2 * (*p - low).y / size * size;
        p.x += 0.1 * ((*p - low).z / size).powi(2) * size;
    }
    bent
}

/// The mesh with a chart of its own for every triangle.
fn charted(mesh: &Mesh) -> Mesh {
    let mut builder = MeshBuilder::new("charted");
    builder.mesh.positions.clone_from(&mesh.positions);
    builder.mesh.normals.clone_from(&mesh.normals);
    builder.mesh.materials.clone_from(&mesh.materials);
    for t in 0..mesh.triangle_count() {
        builder.material = mesh.triangle_material(t);
        let first = builder.mesh.texcoords.len() as u32;
        let place = |k: usize| DVec2::new([0.25, 0.5, 0.25][k], [0.25, 0.25, 0.5][k]) + t as f64 / 256.0;
        builder.mesh.texcoords.extend((0..3).map(place));
        let corners = mesh.file_triangle_corners(t);
        builder.polygon((0..3).map(|k| Corner { texcoord: first + k as u32, ..corners[k] }));
    }
    builder.build()
}

fn close(a: &[DVec3], b: &[DVec3], tolerance: f64) -> bool {
    let size = a.iter().map(|p| (*p - a[0]).abs().max_element()).fold(1.0, f64::max);
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.distance(*b) <= tolerance * size)
}

fn picture(value: f32) -> Arc<[u8]> {
    let mut image = Image::zeros(2, 2, 3, Depth::U8).unwrap();
    image.set(0, 0, 0, value);
    encode_png(&image).unwrap().into()
}

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
    }
}

#[test]
fn a_new_shape_comes_back_and_all_else_stays() {
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
    }
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
fn vertices_that_are_split_keep_all_they_had() {
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
    }
}

#[test]
fn a_new_texture_replaces_its_role_and_nothing_else() {
    let before = samples::dressed().glb();
    let LoadedMesh { mesh, scene, .. } = read(&before);
    let material = GlbMaterial {
        name: "new".into(),
        base_color: [1.0, 0.5, 0.5, 1.0],
        texture: Some(picture(1.0)),
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
}

#[test]
fn new_coordinates_leave_the_old_ones_to_the_textures_that_stay() {
    let before = samples::dressed().glb();
    let LoadedMesh { mesh, scene, .. } = read(&before);
    let material =
        GlbMaterial { name: "new".into(), base_color: [1.0; 4], texture: Some(picture(1.0)), ..GlbMaterial::default() };
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
}

#[test]
fn parts_with_pictures_of_their_own_become_primitives_of_their_own() {
    let before = samples::rigged().glb();
    let LoadedMesh { mesh, scene, .. } = read(&before);
    let dress = |name: &str, value| GlbMaterial {
        name: name.into(),
        base_color: [1.0; 4],
        texture: Some(picture(value)),
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
    let other = Mesh::from_triangles("t", vec![DVec3::ZERO, DVec3::X, DVec3::Y], &[[0, 1, 2]]);
    let scene = loaded.scene.unwrap();
    assert!(scene.edit().shape(&other).unwrap_err().to_string().contains("3 vertices and 1 triangles"));
    assert!(scene.edit().texcoords(&other, KeepTextures::No).is_err());
    let mut huge = loaded.mesh.clone();
    huge.positions[3] = DVec3::splat(1e60);
    assert!(scene.edit().shape(&huge).unwrap_err().to_string().contains("vertex 3"));
}

#[test]
fn weights_are_a_column_for_each_joint() {
    let table = read(&samples::rigged().glb()).scene.unwrap().skin_weights().unwrap().unwrap();
    assert_eq!((table.names, table.joints), (vec!["hip".to_owned(), "chest".to_owned()], vec![2, 3]));
    assert_eq!(table.weights.len(), 50);
    assert_eq!(table.weights[..2], [1.0, 0.0]);
    assert_eq!(table.weights[10..12], [0.75, 0.25]);
    let table = read(&samples::posed().glb()).scene.unwrap().skin_weights().unwrap().unwrap();
    assert!(table.weights.chunks(2).all(|w| (w[0] + w[1] - 1.0).abs() < 1e-12));
    assert!((table.weights[1] - 0.2 / 1.2).abs() < 1e-12, "{:?}", &table.weights[..2]);
    assert_eq!(read(&samples::several().glb()).scene.unwrap().skin_weights().unwrap(), None);
}

#[test]
fn a_new_skin_leaves_the_shape_as_it_is_shown() {
    let rig = read(&samples::posed().glb()).scene.unwrap();
    let joints = rig.skin_weights().unwrap().unwrap().joints;
    for (name, sample) in samples::all().into_iter().filter(|(name, _)| *name != "quantized") {
        let before = sample.glb();
        let LoadedMesh { mesh, scene, .. } = read(&before);
        let scene = scene.unwrap();
        // Its own rig, where it has one, else that of another file.
        let own = if name == "posed" { &scene } else { &rig };
        let row_of: Vec<u32> = (0..mesh.vertex_count() as u32).collect();
        let weights: Vec<f64> = row_of.iter().flat_map(|&v| [f64::from(v % 5), 2.0]).collect();
        let mut edit = scene.edit();
        edit.skin(&SkinWeights { rig: own, joints: &joints, row_of: &row_of, weights: &weights, sets: 1 }).unwrap();
        let (after, notes) = edit.finish().unwrap();
        if name == "far" {
            assert!(notes[0].contains("single precision of skins"), "{notes:?}");
            continue;
        }
        assert!(notes.is_empty(), "{name}: {notes:?}");
        let back = read(&after);
        assert!(close(&back.mesh.positions, &mesh.positions, 2e-6), "{name}");
        assert_eq!(back.mesh.triangles(), mesh.triangles(), "{name}");
        let normals = back.mesh.normals.iter().zip(&mesh.normals).all(|(a, b)| a.distance(*b) < 1e-5);
        assert!(normals && back.mesh.normals.len() == mesh.normals.len(), "{name}");
        assert!(close(&independent(&after), &mesh.positions, 2e-6), "{name}");
        let table = back.scene.unwrap().skin_weights().unwrap().unwrap();
        assert_eq!(table.names, ["hip", "chest"], "{name}");
        for (v, w) in table.weights.chunks(2).enumerate() {
            let k = (v % 5) as f64;
            assert!((w[0] - k / (k + 2.0)).abs() < 1e-6, "{name}, vertex {v}: {w:?}");
        }
        let lost: Vec<String> = changed(&before, &after)
            .into_iter()
            .filter(|p| !["/primitives/", "/skin", "/nodes", "/scenes"].iter().any(|k| p.contains(k)))
            .collect();
        assert!(lost.is_empty(), "{name}: {lost:?}");
    }
}

#[test]
fn only_the_largest_weights_are_written_and_what_is_lost_is_told() {
    let LoadedMesh { mesh, scene, .. } = read(&samples::rigged().glb());
    let scene = scene.unwrap();
    let row_of = vec![0; mesh.vertex_count()];
    let joints = [2, 3, 2, 3, 2, 3];
    let weights = [0.3, 0.25, 0.2, 0.15, 0.06, 0.04];
    let skin = SkinWeights { rig: &scene, joints: &joints, row_of: &row_of, weights: &weights, sets: 1 };
    let mut edit = scene.edit();
    edit.skin(&skin).unwrap();
    let (_, notes) = edit.finish().unwrap();
    assert!(notes[0].contains("25 vertices follow more than 4 joints") && notes[0].contains("10.0 %"), "{notes:?}");
    let mut edit = scene.edit();
    edit.skin(&SkinWeights { sets: 2, ..skin }).unwrap();
    let (bytes, notes) = edit.finish().unwrap();
    assert!(notes.is_empty());
    let attributes = &expanded(&bytes)["meshes"][0]["primitives"][0]["attributes"];
    assert_eq!(attributes["WEIGHTS_1"].as_array().unwrap().len(), 100);
    let none = SkinWeights { weights: &[0.0; 6], ..skin };
    let mut edit = scene.edit();
    edit.skin(&none).unwrap();
    assert!(edit.finish().unwrap().1[0].contains("no weights"));
    assert!(scene.edit().skin(&SkinWeights { row_of: &row_of[1..], ..skin }).is_err());
    assert!(scene.edit().skin(&SkinWeights { joints: &[99], weights: &[1.0], ..skin }).is_err());
}

/// See the same of animations for how it is run.
#[cfg(barymap_gltf_validator)]
#[test]
fn the_validator_accepts_what_is_written() {
    let script = std::env::var_os("BARYMAP_GLTF_VALIDATOR").expect("BARYMAP_GLTF_VALIDATOR");
    let folder = tempfile::tempdir().unwrap();
    // Weights that do not sum to one are no valid input.
    for (name, sample) in samples::all().into_iter().filter(|(name, _)| *name != "posed") {
        let LoadedMesh { mesh, scene, .. } = read(&sample.glb());
        let scene = scene.unwrap();
        let dress = GlbMaterial { base_color: [1.0; 4], texture: Some(picture(1.0)), ..GlbMaterial::default() };
        let mut shaped = scene.edit();
        shaped.shape(&bent(&mesh)).unwrap();
        let mut split = scene.edit();
        split.texcoords(&charted(&mesh), KeepTextures::No).unwrap();
        let mut dressed = scene.edit();
        dressed.materials(&charted(&mesh), &[dress], &vec![0; mesh.triangle_count()]).unwrap();
        let written = [shaped, split, dressed].map(|edit| edit.finish().unwrap().0);
        let mut run = std::process::Command::new("node");
        run.arg(&script);
        for (k, bytes) in [&[sample.glb()][..], &written].concat().iter().enumerate() {
            let path = folder.path().join(format!("{name}{k}.glb"));
            std::fs::write(&path, bytes).unwrap();
            run.arg(path);
        }
        let run = run.output().unwrap();
        assert!(
            run.status.success(),
            "{name}: {}{}",
            String::from_utf8_lossy(&run.stdout),
            String::from_utf8_lossy(&run.stderr)
        );
    }
}
