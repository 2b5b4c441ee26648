//! The scenes of small files that have everything, changed and written: what is new is right, and
//! all else is as it was.

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
use crate::picture::{Depth, Image};

mod frames;
mod kept;
mod looks;
mod skins;
mod strange;

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
    builder.finish()
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
