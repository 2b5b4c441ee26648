//! glTF end to end: what a file holds beside its mesh goes through every command that writes it.

mod kept;
mod moving;
mod plain;

use barymap::geometry::Mesh;
use barymap::io::gltf_write::glb_bytes;
use barymap::io::{read_mesh, write_obj};
use glam::{DVec3, Mat4, Vec3};
use serde_json::{Value, json};

use crate::support::{Folder, STRETCH};

/// A GLB as its JSON and its binary chunk.
struct Glb {
    json: Value,
    binary: Vec<u8>,
}

impl Glb {
    fn parse(bytes: &[u8]) -> Self {
        let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
        let json = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
        Self { json, binary: bytes[28 + length..].to_vec() }
    }

    fn bytes(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        json["buffers"] = json!([{"byteLength": self.binary.len()}]);
        let mut text = json.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let total = 28 + text.len() + self.binary.len();
        let mut all = Vec::new();
        for word in [0x4654_6c67, 2, total as u32, text.len() as u32, 0x4e4f_534a] {
            all.extend_from_slice(&u32::to_le_bytes(word));
        }
        all.extend_from_slice(&text);
        all.extend_from_slice(&(self.binary.len() as u32).to_le_bytes());
        all.extend_from_slice(&0x004e_4942_u32.to_le_bytes());
        all.extend_from_slice(&self.binary);
        all
    }

    fn accessor(&mut self, bytes: &[u8], component: u32, shape: &str, count: usize) -> usize {
        let views = self.json["bufferViews"].as_array_mut().unwrap();
        views.push(json!({"buffer": 0, "byteOffset": self.binary.len(), "byteLength": bytes.len()}));
        let view = views.len() - 1;
        self.binary.extend_from_slice(bytes);
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        let accessors = self.json["accessors"].as_array_mut().unwrap();
        accessors.push(json!({"bufferView": view, "componentType": component, "type": shape, "count": count}));
        accessors.len() - 1
    }

    fn floats(&mut self, values: &[f32], shape: &str, width: usize) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.accessor(&bytes, 5126, shape, values.len() / width)
    }
}

/// How much of the upper bone is in a point.
fn upper(p: Vec3) -> f32 {
    (0.5 + 0.4 * p.z).clamp(0.0, 1.0)
}

/// `mesh` as GLB with two bones, a morph target, an animation, names and extras.
fn rigged(mesh: &Mesh) -> Vec<u8> {
    let plain = glb_bytes(mesh, &[]).unwrap();
    let (document, buffers, _) = ::gltf::import_slice(&plain).unwrap();
    let primitive = document.meshes().next().unwrap().primitives().next().unwrap();
    let positions: Vec<Vec3> =
        primitive.reader(|b| Some(&buffers[b.index()])).read_positions().unwrap().map(Vec3::from).collect();
    let n = positions.len();
    let mut glb = Glb::parse(&plain);
    let weights: Vec<f32> = positions.iter().flat_map(|&p| [1.0 - upper(p), upper(p), 0.0, 0.0]).collect();
    let joints = glb.accessor(&[0u8, 1, 0, 0].repeat(n), 5121, "VEC4", n);
    let weights = glb.floats(&weights, "VEC4", 4);
    let smile: Vec<f32> = positions.iter().flat_map(|p| [0.0, 0.0, 0.1 * p.x]).collect();
    let smile = glb.floats(&smile, "VEC3", 3);
    let rises = || positions.iter().map(|p| 0.1 * p.x);
    glb.json["accessors"][smile]["min"] = json!([0.0, 0.0, rises().reduce(f32::min)]);
    glb.json["accessors"][smile]["max"] = json!([0.0, 0.0, rises().reduce(f32::max)]);
    let binds = [Mat4::from_translation(Vec3::Z), Mat4::IDENTITY].map(|m| m.to_cols_array()).concat();
    let binds = glb.floats(&binds, "MAT4", 16);
    let times = glb.floats(&[0.0, 1.0], "SCALAR", 1);
    glb.json["accessors"][times]["min"] = json!([0]);
    glb.json["accessors"][times]["max"] = json!([1]);
    let turns = glb.floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0], "VEC4", 4);
    let primitive = &mut glb.json["meshes"][0]["primitives"][0];
    primitive["attributes"]["JOINTS_0"] = joints.into();
    primitive["attributes"]["WEIGHTS_0"] = weights.into();
    primitive["targets"] = json!([{"POSITION": smile}]);
    glb.json["meshes"][0]["extras"] = json!({"targetNames": ["smile"]});
    glb.json["nodes"] = json!([{"name": "body", "mesh": 0, "skin": 0}, {"name": "hip", "translation": [0, 0, -1], "children": [2]},
        {"name": "chest", "translation": [0, 0, 1], "extras": {"ik": true}}]);
    glb.json["scenes"] = json!([{"nodes": [0, 1]}]);
    glb.json["skins"] = json!([{"joints": [1, 2], "inverseBindMatrices": binds}]);
    glb.json["animations"] = json!([{"name": "wave", "channels": [{"sampler": 0, "target": {"node": 2, "path": "rotation"}}],
        "samplers": [{"input": times, "output": turns}]}]);
    glb.bytes()
}

/// The two spheres, the target also as a rigged GLB.
fn spheres() -> Folder {
    let f = Folder::spheres();
    let target = read_mesh(f.path("t.obj")).unwrap().mesh;
    std::fs::write(f.path("t.glb"), rigged(&target)).unwrap();
    f
}

/// Everything of the rig is in a file.
#[track_caller]
fn has_the_rig(f: &Folder, name: &str) {
    let bytes = f.bytes(name);
    let (document, buffers, _) = ::gltf::import_slice(&bytes).unwrap();
    let names: Vec<&str> = document.nodes().filter_map(|n| n.name()).collect();
    assert_eq!(names, ["body", "hip", "chest"]);
    assert_eq!((document.skins().len(), document.animations().len()), (1, 1));
    assert_eq!(document.animations().next().unwrap().name(), Some("wave"));
    let json = Glb::parse(&bytes).json;
    assert_eq!(json["meshes"][0]["extras"]["targetNames"][0], "smile");
    assert_eq!(json["nodes"][2]["extras"]["ik"], true);
    for primitive in document.meshes().next().unwrap().primitives() {
        let reader = primitive.reader(|b| Some(&buffers[b.index()]));
        assert_eq!(reader.read_morph_targets().count(), 1);
        let positions: Vec<[f32; 3]> = reader.read_positions().unwrap().collect();
        let weights: Vec<[f32; 4]> = reader.read_weights(0).unwrap().into_f32().collect();
        let smile: Vec<[f32; 3]> = reader.read_morph_targets().next().unwrap().0.unwrap().collect();
        assert_eq!(
            (weights.len(), smile.len(), reader.read_joints(0).unwrap().into_u16().count()),
            (positions.len(), positions.len(), positions.len())
        );
    }
}
