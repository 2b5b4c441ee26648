//! Animations that are added to a scene.

use glam::{DQuat, Vec3};

use super::*;
use crate::io::gltf_animation::{GlbAnimation, MorphForm, animated_scene_bytes};
use crate::io::gltf_container::{container, split};

/// The file with its last animation at key `frame` as the default weights of its nodes.
fn stopped(bytes: &[u8], frame: usize) -> Vec<u8> {
    let document = Document::parse(bytes.to_vec(), Path::new("a.glb")).unwrap();
    let (json, binary) = split(bytes, Path::new("a.glb")).unwrap();
    let mut json: Value = serde_json::from_slice(&bytes[json]).unwrap();
    let animation = json["animations"].as_array().unwrap().last().unwrap().clone();
    for channel in animation["channels"].as_array().unwrap() {
        assert_eq!(channel["target"]["path"], "weights");
        let sampler = &animation["samplers"][channel["sampler"].as_u64().unwrap() as usize];
        let number = |key: &str| sampler[key].as_u64().unwrap() as usize;
        let keys = document.numbers(number("input"), 1).unwrap().len();
        let weights = document.numbers(number("output"), 1).unwrap();
        let node = channel["target"]["node"].as_u64().unwrap() as usize;
        json["nodes"][node]["weights"] = json!(weights.chunks(weights.len() / keys).nth(frame).unwrap());
    }
    container("a", json.to_string().into_bytes(), &bytes[binary.unwrap()]).unwrap()
}

/// Frames from the mesh to its bent shape, the last of them moved and turned as a whole.
fn frames(mesh: &Mesh) -> Vec<Vec<Vec3>> {
    let end = bent(mesh);
    let at = |f: usize| {
        let t = f as f64 / 4.0;
        mesh.positions.iter().zip(&end.positions).map(move |(a, b)| a.lerp(*b, t).as_vec3()).collect()
    };
    (0..5).map(at).collect()
}

#[test]
fn frames_are_played_and_all_else_stays() {
    let mut written = Vec::new();
    for (name, sample) in samples::all().into_iter().filter(|(name, _)| *name != "far") {
        let before = sample.glb();
        let LoadedMesh { mesh, scene, .. } = read(&before);
        let (frames, times) = (frames(&mesh), [0.0, 0.25, 0.5, 0.75, 1.0]);
        let turn = DQuat::from_rotation_z(0.5);
        let still = (DQuat::IDENTITY, DVec3::ZERO);
        let placements = [still, still, still, still, (turn, DVec3::new(1.0, 2.0, 3.0))];
        let animation = GlbAnimation {
            name: "bend",
            times: &times,
            frames: &frames,
            placements: &placements,
            form: MorphForm::Frames,
        };
        let (after, notes, report) = animated_scene_bytes(scene.as_ref().unwrap(), &mesh, &animation).unwrap();
        assert_eq!((notes, report.targets, report.bytes), (vec![], 5, after.len()), "{name}");
        for (f, frame) in frames.iter().enumerate() {
            let (turn, shift) = placements[f];
            let wanted: Vec<DVec3> = frame.iter().map(|p| turn * p.as_dvec3() + shift).collect();
            let shown = stopped(&after, f);
            let back = read(&shown).mesh;
            assert!(close(&back.positions, &wanted, 2e-6), "{name}, frame {f}");
            if name != "quantized" {
                assert!(close(&independent(&shown), &wanted, 2e-6), "{name}, frame {f}");
            }
            // Normals turn with the surface.
            let smooth = crate::io::gltf_split::vertex_normals(&mesh, &wanted);
            for (v, n) in back.normals.iter().enumerate().filter(|_| back.normals.len() == back.vertex_count()) {
                assert!(
                    !mesh_is_smooth(&mesh) || n.dot(smooth[mesh.representative(v as u32) as usize]) > 0.9,
                    "{name}"
                );
            }
        }
        // At rest it is what it was.
        assert!(close(&read(&after).mesh.positions, &mesh.positions, 1e-6), "{name}");
        let lost: Vec<String> = changed(&before, &after)
            .into_iter()
            .filter(|p| !["/targets", "/weights", "/extras", "/animations"].iter().any(|k| p.contains(k)))
            .collect();
        assert!(lost.is_empty(), "{name}: {lost:?}");
        let (old, new) = (expanded(&before), expanded(&after));
        let count = |json: &Value| json.get("animations").and_then(Value::as_array).map_or(0, Vec::len);
        assert_eq!(count(&new), count(&old) + 1, "{name}");
        if name != "posed" {
            written.push((name.to_owned(), after));
        }
    }
    samples::check_valid(&written);
}

/// Whether the normals of the file are those of its triangles.
fn mesh_is_smooth(mesh: &Mesh) -> bool {
    let smooth = crate::io::gltf_split::vertex_normals(mesh, &mesh.positions);
    mesh.normals.iter().zip(smooth).all(|(a, b)| a.dot(b) > 0.98)
}

#[test]
fn tracks_of_weights_that_are_there_get_room() {
    let mut sample = samples::morphed();
    let times = sample.floats(&[[0.0], [1.0], [2.0]]);
    let weights = sample.floats(&[[0.0], [0.5], [1.0], [0.25], [0.0], [1.0]]);
    let accessor = sample.json["accessors"][weights].as_object_mut().unwrap();
    accessor.remove("min");
    accessor.remove("max");
    sample.json["animations"] = json!([{"name": "old", "samplers": [{"input": times, "output": weights}],
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}]}]);
    let LoadedMesh { mesh, scene, .. } = read(&sample.glb());
    let frames = frames(&mesh);
    let animation = GlbAnimation {
        name: "new",
        times: &[0.0, 1.0],
        frames: &frames[3..],
        placements: &[],
        form: MorphForm::Frames,
    };
    let (after, _, _) = animated_scene_bytes(scene.as_ref().unwrap(), &mesh, &animation).unwrap();
    let json = expanded(&after);
    let output = &json["animations"][0]["samplers"][0]["output"];
    assert_eq!(output, &json!([0.0, 0.5, 0.0, 0.0, 1.0, 0.25, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0]));
    assert_eq!(json["meshes"][0]["extras"]["targetNames"], json!(["up", "down", "shape_0", "shape_1"]));
    assert_eq!(json["meshes"][0]["weights"], json!([0.0, 0.25, 0.0, 0.0]));
    assert_eq!(json["animations"][1]["samplers"][0]["output"], json!([0.5, 0.0, 1.0, 0.0, 0.5, 0.0, 0.0, 1.0]));
    samples::check_valid(&[("tracks".into(), after)]);
    let other = Mesh::of_triangles("t", vec![DVec3::ZERO, DVec3::X, DVec3::Y], &[[0, 1, 2]]);
    let short: Vec<Vec<Vec3>> = frames.iter().map(|f| f[..3].to_vec()).collect();
    let animation = GlbAnimation { frames: &short[3..], ..animation };
    assert!(animated_scene_bytes(scene.as_ref().unwrap(), &other, &animation).is_err());
}
