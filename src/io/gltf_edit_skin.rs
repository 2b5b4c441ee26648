//! A skin for the meshes of a scene: joints of this or of another file, and how far each vertex
//! follows them.

use std::collections::{BTreeSet, HashMap};

use glam::{DMat3, DMat4, DVec3};
use serde_json::{Value, json};

use super::gltf_edit::{Edit, Elements, list_of};
use super::gltf_nodes::{global_transforms, node_name, parents};
use super::gltf_parts::ARRAY;
use super::gltf_pose::{Pose, Transform, inverse};
use super::gltf_scene::{GltfScene, Part};
use super::source::Notes;
use crate::{Error, Result};

/// Weights of the joints for every vertex of a mesh.
#[derive(Clone, Copy, Debug)]
pub struct SkinWeights<'w> {
    /// The file with the joints.
    pub rig: &'w GltfScene,
    /// The nodes of the joints in that file.
    pub joints: &'w [usize],
    /// For each vertex of the mesh its row of `weights`.
    pub row_of: &'w [u32],
    /// A weight for each joint, row after row.
    pub weights: &'w [f64],
    /// Sets of four weights that a vertex may have: 1 or 2.
    pub sets: usize,
}

/// Binds the meshes of a scene to joints, in the pose in which both are shown: the shape stays what
/// it is.
pub(super) fn set_skin(edit: &mut Edit<'_>, scene: &GltfScene, skin: &SkinWeights<'_>) -> Result<()> {
    let rig = &skin.rig.document;
    let globals = global_transforms(rig)?;
    let mut inverses = Vec::with_capacity(skin.joints.len());
    for &joint in skin.joints {
        inverses.push(globals.get(joint).and_then(inverse).ok_or_else(|| {
            let what = format!("{} flattens space, so that nothing can be bound to it", node_name(rig, joint));
            Error::format(&rig.path, None, what, "Give the joint a scale that is not zero")
        })?);
    }
    let nodes = if std::ptr::eq(rig, &scene.document) { skin.joints.to_vec() } else { copy_joints(edit, skin)? };
    let place = global_transforms(&scene.document)?;
    let mut made: Vec<(Value, usize)> = Vec::new();
    let mut of_node: HashMap<usize, DMat4> = HashMap::new();
    for part in &scene.parts {
        let transform = stand(edit, scene, part, &place)?;
        of_node.entry(part.node).or_insert(transform);
    }
    let influences = Influences::new(skin);
    for part in &scene.parts {
        influences.write(edit, scene, part);
    }
    // What single precision makes of the matrices.
    let mut off = 0.0;
    let mut mesh_nodes: Vec<usize> = of_node.keys().copied().collect();
    mesh_nodes.sort_unstable();
    for node in mesh_nodes {
        let binds: Vec<f32> =
            inverses.iter().flat_map(|m| (*m * of_node[&node]).to_cols_array()).map(|x| x as f32).collect();
        let rounded = |j: usize| DMat4::from_cols_array(&std::array::from_fn(|k| f64::from(binds[16 * j + k])));
        let shift = |j: usize| {
            let (shown, wanted) = (globals[skin.joints[j]] * rounded(j), of_node[&node]);
            shown.w_axis.distance(wanted.w_axis)
        };
        off = (0..skin.joints.len()).map(shift).fold(off, f64::max);
        let key = json!(binds);
        let known = made.iter().find(|(k, _)| *k == key).map(|m| m.1);
        let number = match known {
            Some(number) => number,
            None => {
                let number = add_skin(edit, node, &nodes, &binds);
                made.push((key, number));
                number
            }
        };
        edit.json["nodes"][node]["skin"] = number.into();
    }
    edit.notes.extend(influences.notes());
    if off > 1e-5 * scene.size()? {
        edit.notes.push(format!(
            "far from the origin the single precision of skins moves vertices by up to {off:.1e}: bring the mesh and its \
             joints to the origin"
        ));
    }
    Ok(())
}

/// Copies the joints and the nodes above them into the scene; their new numbers.
fn copy_joints(edit: &mut Edit<'_>, skin: &SkinWeights<'_>) -> Result<Vec<usize>> {
    let rig = &skin.rig.document;
    let above = parents(rig)?;
    let mut wanted = BTreeSet::new();
    for &joint in skin.joints {
        let mut at = Some(joint);
        while let Some(n) = at.filter(|n| wanted.insert(*n)) {
            at = above[n];
        }
    }
    let first = list_of(&mut edit.json, "nodes").len();
    let number: HashMap<usize, usize> = wanted.iter().enumerate().map(|(k, &n)| (n, first + k)).collect();
    for &n in &wanted {
        let mut node = rig.json["nodes"][n].clone();
        if let Some(entries) = node.as_object_mut() {
            ["mesh", "skin", "camera", "weights", "extensions", "children"].iter().for_each(|key| {
                entries.remove(*key);
            });
        }
        let children: Vec<usize> = rig.root.nodes[n].children.iter().filter_map(|c| number.get(c)).copied().collect();
        if !children.is_empty() {
            node["children"] = json!(children);
        }
        list_of(&mut edit.json, "nodes").push(node);
    }
    let roots = wanted.iter().filter(|&&n| above[n].is_none()).map(|n| Value::from(number[n]));
    let shown = edit.document.root.scene.unwrap_or(0);
    if let Some(scene) = edit.json.get_mut("scenes").and_then(|s| s.get_mut(shown)) {
        list_of(scene, "nodes").extend(roots);
    }
    Ok(skin.joints.iter().map(|j| number[j]).collect())
}

/// A skin with these joints; it takes the place of the one that only `node` has.
fn add_skin(edit: &mut Edit<'_>, node: usize, joints: &[usize], binds: &[f32]) -> usize {
    let nodes = &edit.document.root.nodes;
    let old = nodes[node].skin.filter(|s| nodes.iter().filter(|n| n.skin == Some(*s)).count() == 1);
    let bytes: Vec<u8> = binds.iter().flat_map(|x| x.to_le_bytes()).collect();
    let matrices = old.and_then(|s| edit.document.root.skins.get(s)?.inverse_bind_matrices);
    let new = Elements {
        bytes: &bytes,
        count: joints.len(),
        component: 5126,
        shape: "MAT4",
        normalized: false,
        target: None,
    };
    let k = edit.replace(matrices, &new);
    let skins = list_of(&mut edit.json, "skins");
    match old.filter(|&s| s < skins.len()) {
        Some(s) => {
            skins[s]["joints"] = json!(joints);
            skins[s]["inverseBindMatrices"] = k.into();
            if let Some(skin) = skins[s].as_object_mut() {
                skin.remove("skeleton");
            }
            s
        }
        None => {
            skins.push(json!({"joints": joints, "inverseBindMatrices": k}));
            skins.len() - 1
        }
    }
}

/// What takes the stored positions of a part to those shown. Where that differs from vertex to
/// vertex, the positions that are shown are stored.
fn stand(edit: &mut Edit<'_>, scene: &GltfScene, part: &Part, globals: &[DMat4]) -> Result<DMat4> {
    let document = &scene.document;
    let primitive = &document.root.meshes[part.mesh].primitives[part.primitive];
    let pose = Pose::new(document, globals, part.node, primitive, part.vertices, &mut Notes::default())?;
    if let Transform::Rigid(matrix) = &pose.transform {
        return Ok(*matrix);
    }
    let same = (0..part.vertices).all(|v| pose.matrix(v).abs_diff_eq(DMat4::IDENTITY, 1e-6));
    if same {
        return Ok(DMat4::IDENTITY);
    }
    let linear = |v: usize| DMat3::from_mat4(pose.matrix(v));
    let replace = |edit: &mut Edit<'_>,
                   accessor: usize,
                   width: usize,
                   bounds: bool,
                   at: &dyn Fn(usize, DVec3) -> DVec3|
     -> Result<usize> {
        let old = document.numbers(accessor, width)?;
        let mut values: Vec<f32> = old.iter().map(|x| *x as f32).collect();
        for (v, (new, old)) in
            values.chunks_exact_mut(width).zip(old.chunks_exact(width)).take(part.vertices).enumerate()
        {
            new[..3].copy_from_slice(&at(v, DVec3::from_slice(old)).as_vec3().to_array());
        }
        edit.floats(Some(accessor), &values, if width == 4 { "VEC4" } else { "VEC3" }, bounds)
    };
    let place = |v: usize, p: DVec3| pose.matrix(v).transform_point3(p);
    let direction = |v: usize, d: DVec3| (linear(v) * d).normalize_or_zero();
    let normal = |v: usize, n: DVec3| pose.turned_normal(v, n);
    let displacement = |v: usize, d: DVec3| linear(v) * d;
    for (name, &accessor) in &primitive.attributes {
        let k = match name.as_str() {
            "POSITION" => replace(edit, accessor, 3, true, &place)?,
            "NORMAL" => replace(edit, accessor, 3, false, &normal)?,
            "TANGENT" => replace(edit, accessor, 4, false, &direction)?,
            _ => continue,
        };
        edit.primitive(part.mesh, part.primitive)["attributes"][name] = k.into();
    }
    for (t, target) in primitive.targets.iter().enumerate() {
        for (name, &accessor) in
            target.iter().filter(|(name, _)| ["POSITION", "NORMAL", "TANGENT"].contains(&name.as_str()))
        {
            let k = replace(edit, accessor, 3, name == "POSITION", &displacement)?;
            edit.primitive(part.mesh, part.primitive)["targets"][t][name] = k.into();
        }
    }
    Ok(DMat4::IDENTITY)
}

/// The largest weights of every vertex.
struct Influences {
    joints: usize,
    sets: usize,
    /// Joint and weight, `4 * sets` a vertex.
    all: Vec<(u16, f32)>,
    /// Vertices with more, and the largest part of one's weight that is lost.
    cut: (usize, f64),
    /// Vertices without any.
    loose: usize,
}

impl Influences {
    fn new(skin: &SkinWeights<'_>) -> Self {
        let (joints, width) = (skin.joints.len(), 4 * skin.sets);
        let mut all = Vec::with_capacity(width * skin.row_of.len());
        let (mut cut, mut loose) = ((0, 0.0_f64), 0);
        for &row in skin.row_of {
            let row = &skin.weights[joints * row as usize..][..joints];
            let mut found: Vec<(u16, f64)> =
                (0..).zip(row).filter(|(_, w)| **w > 0.0 && w.is_finite()).map(|(j, w)| (j, *w)).collect();
            found.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
            let sum: f64 = found.iter().map(|f| f.1).sum();
            let lost: f64 = found.iter().skip(width).map(|f| f.1).sum();
            if lost > 0.0 {
                cut = (cut.0 + 1, cut.1.max(lost / sum));
            }
            found.truncate(width);
            if found.is_empty() {
                loose += 1;
                found.push((0, 1.0));
            }
            let kept: f64 = found.iter().map(|f| f.1).sum();
            found.resize(width, (0, 0.0));
            all.extend(found.into_iter().map(|(j, w)| (j, (w / kept) as f32)));
        }
        Self { joints, sets: skin.sets, all, cut, loose }
    }

    fn write(&self, edit: &mut Edit<'_>, scene: &GltfScene, part: &Part) {
        let primitive = &scene.document.root.meshes[part.mesh].primitives[part.primitive];
        let width = 4 * self.sets;
        let vertices = &self.all[width * part.first_vertex..width * (part.first_vertex + part.vertices)];
        for set in 0..self.sets {
            let four = || vertices.chunks_exact(width).flat_map(move |v| &v[4 * set..4 * set + 4]);
            let small = self.joints <= 256;
            let joints: Vec<u8> = if small {
                four().map(|i| i.0 as u8).collect()
            } else {
                four().flat_map(|i| i.0.to_le_bytes()).collect()
            };
            let weights: Vec<u8> = four().flat_map(|i| i.1.to_le_bytes()).collect();
            for (name, bytes, component) in
                [("JOINTS", &joints, if small { 5121 } else { 5123 }), ("WEIGHTS", &weights, 5126)]
            {
                let name = format!("{name}_{set}");
                let new = Elements {
                    bytes,
                    count: part.vertices,
                    component,
                    shape: "VEC4",
                    normalized: false,
                    target: Some(ARRAY),
                };
                let k = edit.replace(primitive.attributes.get(&name).copied(), &new);
                edit.primitive(part.mesh, part.primitive)["attributes"][&name] = k.into();
            }
        }
        if let Some(attributes) = edit.primitive(part.mesh, part.primitive)["attributes"].as_object_mut() {
            let set =
                |name: &str| name.strip_prefix("JOINTS_").or(name.strip_prefix("WEIGHTS_"))?.parse::<usize>().ok();
            attributes.retain(|name, _| set(name).is_none_or(|set| set < self.sets));
        }
    }

    fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        let (count, most) = self.cut;
        if count > 0 {
            let more = if self.sets == 1 { "; --top 8 keeps eight" } else { "" };
            let (width, percent) = (4 * self.sets, 100.0 * most);
            notes.push(format!("{count} vertices follow more than {width} joints: the {width} largest weights are kept, at most {percent:.1} % is lost{more}"));
        }
        if self.loose > 0 {
            notes.push(format!("{} vertices have no weights: they follow the first joint", self.loose));
        }
        notes
    }
}
