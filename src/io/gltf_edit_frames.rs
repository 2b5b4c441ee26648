//! An animation for the meshes of a scene: morph targets behind those that they have, and a track
//! of their weights.

use glam::{DMat3, Vec3};
use serde_json::{Value, json};

use super::gltf_animation::{GlbAnimation, displacement_accessor, turned};
use super::gltf_components::Components;
use super::gltf_edit::{Edit, Elements, list_of};
use super::gltf_nodes::global_transforms;
use super::gltf_parts::FLOAT;
use super::gltf_pose::{Pose, default_weights, inverse};
use super::gltf_scene::{GltfScene, Part};
use super::gltf_split::vertex_normals;
use super::source::Notes;
use crate::Result;
use crate::geometry::Mesh;

/// Adds `targets` to the meshes of the scene, and an animation that plays them from the shape in
/// which `mesh` was read.
pub(super) fn set_frames(
    edit: &mut Edit<'_>,
    scene: &GltfScene,
    mesh: &Mesh,
    animation: &GlbAnimation<'_>,
    targets: &Components,
) -> Result<()> {
    let count = targets.shapes.len();
    if count == 0 {
        return Ok(());
    }
    let document = &scene.document;
    let globals = global_transforms(document)?;
    let smooth = vertex_normals(mesh, &mesh.positions);
    let mut lost = 0;
    for part in &scene.parts {
        let primitive = &document.root.meshes[part.mesh].primitives[part.primitive];
        let pose = Pose::new(document, &globals, part.node, primitive, part.vertices, &mut Notes::default())?;
        let back: Vec<Option<DMat3>> =
            (0..part.vertices).map(|v| inverse(&pose.matrix(v)).map(DMat3::from_mat4)).collect();
        lost += back.iter().filter(|m| m.is_none()).count();
        let normals = match primitive.attributes.get("NORMAL") {
            Some(&k) => Some(document.vectors(k, part.vertices)?),
            None => None,
        };
        let one = |v: usize| mesh.representative((part.first_vertex + v) as u32) as usize;
        for (shape, change) in targets.shapes.iter().zip(&targets.normals) {
            let stored = |v: usize| back[v].map_or(Vec3::ZERO, |m| (m * shape[one(v)].as_dvec3()).as_vec3());
            let moved: Vec<Vec3> = (0..part.vertices).map(stored).collect();
            let mut target = json!({"POSITION": add(edit, &moved, true)});
            if let Some(normals) = &normals {
                let changed = |v: usize| {
                    let shown = pose.normal(v, normals[v]);
                    let after = shown + turned(shown.as_vec3(), smooth[one(v)].as_vec3(), change[one(v)]).as_dvec3();
                    (pose.stored_normal(v, after) - pose.stored_normal(v, shown)).as_vec3()
                };
                let changes: Vec<Vec3> = (0..part.vertices).map(changed).collect();
                target["NORMAL"] = add(edit, &changes, false).into();
            }
            list_of(edit.primitive(part.mesh, part.primitive), "targets").push(target);
        }
    }
    if lost > 0 {
        edit.notes.push(format!(
            "{lost} vertices do not move: their joints or nodes flatten space, so that no stored position is shown \
             where they go"
        ));
    }
    let mut meshes: Vec<usize> = scene.parts.iter().map(|p| p.mesh).collect();
    meshes.dedup();
    for &mesh in &meshes {
        extend(edit, scene, mesh, count)?;
    }
    play(edit, scene, animation, targets);
    Ok(())
}

/// A new accessor of displacements; its number.
fn add(edit: &mut Edit<'_>, values: &[Vec3], bounds: bool) -> usize {
    let accessor = displacement_accessor(values, bounds, &mut |bytes, target| edit.view(bytes.to_vec(), None, target));
    edit.put(None, accessor)
}

/// Morph targets that a mesh of the file has.
fn old_targets(scene: &GltfScene, mesh: usize) -> usize {
    scene.document.root.meshes[mesh].primitives.iter().map(|p| p.targets.len()).max().unwrap_or(0)
}

/// Default weights of the morph targets that a mesh of the file has, at a node.
fn old_weights(scene: &GltfScene, node: usize, mesh: usize) -> Vec<f64> {
    let mut weights = default_weights(&scene.document, node);
    weights.resize(old_targets(scene, mesh), 0.0);
    weights
}

/// Makes room for `count` targets more in all that goes through the targets of a mesh: its other
/// primitives, names, default weights, and animations.
fn extend(edit: &mut Edit<'_>, scene: &GltfScene, mesh: usize, count: usize) -> Result<()> {
    let (document, old) = (&scene.document, old_targets(scene, mesh));
    for (k, primitive) in document.root.meshes[mesh].primitives.iter().enumerate() {
        let taken = scene.parts.iter().any(|p| (p.mesh, p.primitive) == (mesh, k));
        let Some(&positions) = primitive.attributes.get("POSITION").filter(|_| !taken) else { continue };
        // Points and lines stay where they are.
        let still = vec![Vec3::ZERO; document.accessor(positions)?.count];
        for _ in 0..count {
            let target = json!({"POSITION": add(edit, &still, true)});
            list_of(edit.primitive(mesh, k), "targets").push(target);
        }
    }
    let lengthen = |list: &mut Vec<Value>| {
        list.resize(old, 0.0.into());
        list.resize(old + count, 0.0.into());
    };
    let description = &mut edit.json["meshes"][mesh];
    lengthen(list_of(description, "weights"));
    let named = description["extras"]["targetNames"].as_array().map_or(0, Vec::len);
    if named == old && (description.get("extras").is_none_or(Value::is_object)) {
        let names = list_of(&mut description["extras"], "targetNames");
        names.extend((0..count).map(|k| Value::from(format!("shape_{k}"))));
    }
    for (n, node) in document.root.nodes.iter().enumerate().filter(|(_, node)| node.mesh == Some(mesh)) {
        if node.weights.is_some() {
            lengthen(list_of(&mut edit.json["nodes"][n], "weights"));
        }
    }
    lengthen_tracks(edit, scene, mesh, count)
}

/// Gives the tracks of weights of the file's animations zeros for the targets that are new.
fn lengthen_tracks(edit: &mut Edit<'_>, scene: &GltfScene, mesh: usize, count: usize) -> Result<()> {
    let (document, old) = (&scene.document, old_targets(scene, mesh));
    if old == 0 {
        return Ok(());
    }
    let animations = document.json["animations"].as_array().map_or(&[][..], Vec::as_slice);
    for (a, animation) in animations.iter().enumerate() {
        let mut samplers: Vec<usize> = Vec::new();
        for channel in animation["channels"].as_array().into_iter().flatten() {
            let target = &channel["target"];
            let node = target["node"].as_u64().and_then(|n| document.root.nodes.get(n as usize));
            let (Some(node), Some(sampler)) = (node, channel["sampler"].as_u64()) else { continue };
            if target["path"] == "weights" && node.mesh == Some(mesh) && !samplers.contains(&(sampler as usize)) {
                samplers.push(sampler as usize);
            }
        }
        for sampler in samplers {
            let Some(output) = animation["samplers"][sampler]["output"].as_u64() else { continue };
            let weights = document.numbers(output as usize, 1)?;
            let wide: Vec<f32> = weights
                .chunks(old)
                .flat_map(|key| key.iter().map(|w| *w as f32).chain(std::iter::repeat_n(0.0, count)))
                .collect();
            let k = track(edit, Some(output as usize), &wide);
            edit.json["animations"][a]["samplers"][sampler]["output"] = k.into();
        }
    }
    Ok(())
}

/// An accessor of numbers over time, in the place of `old`; its number.
fn track(edit: &mut Edit<'_>, old: Option<usize>, values: &[f32]) -> usize {
    let bytes: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
    let (count, component) = (values.len(), FLOAT);
    edit.replace(old, &Elements { bytes: &bytes, count, component, shape: "SCALAR", normalized: false, target: None })
}

/// The animation itself: at each node with a part the weights that its mesh has there by default,
/// then those of the frames.
fn play(edit: &mut Edit<'_>, scene: &GltfScene, animation: &GlbAnimation<'_>, targets: &Components) {
    let times = track(edit, None, animation.times);
    let (first, last) = (animation.times.first(), animation.times.last());
    (edit.json["accessors"][times]["min"], edit.json["accessors"][times]["max"]) = (json!([first]), json!([last]));
    let mut parts: Vec<&Part> = scene.parts.iter().collect();
    parts.dedup_by_key(|p| p.node);
    let (mut samplers, mut channels) = (Vec::new(), Vec::new());
    for part in parts {
        let old = old_weights(scene, part.node, part.mesh);
        let frame = |weights: &Vec<f32>| old.iter().map(|w| *w as f32).chain(weights.clone()).collect::<Vec<_>>();
        let all: Vec<f32> = targets.weights.iter().flat_map(frame).collect();
        channels.push(json!({"sampler": samplers.len(), "target": {"node": part.node, "path": "weights"}}));
        samplers.push(json!({"input": times, "output": track(edit, None, &all), "interpolation": "LINEAR"}));
    }
    let made = json!({"name": animation.name, "channels": channels, "samplers": samplers});
    list_of(&mut edit.json, "animations").push(made);
}
