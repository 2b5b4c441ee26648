//! Small glTF files with everything that the format has, for tests.

use serde_json::{Value, json};

/// Fails unless the validator has nothing against GLB files.
#[track_caller]
pub(super) fn check_valid(files: &[(String, Vec<u8>)]) {
    let folder = tempfile::tempdir().unwrap();
    let write = |(name, bytes): &(String, Vec<u8>)| {
        let path = folder.path().join(format!("{name}.glb"));
        std::fs::write(&path, bytes).unwrap();
        path
    };
    super::gltf_validator::check(&files.iter().map(write).collect::<Vec<_>>(), &[]);
}

/// A file as it is put together.
pub(super) struct Sample {
    pub(super) json: Value,
    pub(super) binary: Vec<u8>,
}

impl Sample {
    pub(super) fn new() -> Self {
        let json = json!({
            "asset": {"version": "2.0", "generator": "sample", "extras": {"by": "test"}},
            "scene": 0, "scenes": [{"name": "the scene", "nodes": [0]}], "nodes": [], "meshes": [],
            "accessors": [], "bufferViews": []});
        Self { json, binary: Vec::new() }
    }

    fn push(&mut self, list: &str, value: Value) -> usize {
        let list = self.json[list].as_array_mut().unwrap();
        list.push(value);
        list.len() - 1
    }

    pub(super) fn view(&mut self, bytes: &[u8]) -> usize {
        let offset = self.binary.len();
        self.binary.extend_from_slice(bytes);
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        self.push("bufferViews", json!({"buffer": 0, "byteOffset": offset, "byteLength": bytes.len()}))
    }

    pub(super) fn accessor(&mut self, bytes: &[u8], component: u32, shape: &str, count: usize) -> usize {
        let view = self.view(bytes);
        self.push("accessors", json!({"bufferView": view, "componentType": component, "type": shape, "count": count}))
    }

    pub(super) fn floats<const N: usize>(&mut self, values: &[[f32; N]]) -> usize {
        let shape = ["SCALAR", "VEC2", "VEC3", "VEC4"].get(N - 1).copied().unwrap_or("MAT4");
        let bytes: Vec<u8> = values.as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
        let k = self.accessor(&bytes, 5126, shape, values.len());
        let extreme = |pick: fn(f32, f32) -> f32| -> Vec<f32> {
            (0..N).map(|c| values.iter().map(|v| v[c]).reduce(pick).unwrap()).collect()
        };
        self.json["accessors"][k]["min"] = json!(extreme(f32::min));
        self.json["accessors"][k]["max"] = json!(extreme(f32::max));
        k
    }

    pub(super) fn indices(&mut self, values: &[u16]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|i| i.to_le_bytes()).collect();
        self.accessor(&bytes, 5123, "SCALAR", values.len())
    }

    /// A GLB file.
    pub(super) fn glb(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        json["buffers"] = json!([{"byteLength": self.binary.len()}]);
        super::gltf_container::container("sample", json.to_string().into_bytes(), &self.binary).unwrap()
    }

    /// A grid of `n` x `n` squares in the unit square, its seam at `seam` columns: attributes and
    /// indices.
    fn grid(&mut self, n: usize, height: f32) -> (Value, Vec<[f32; 3]>) {
        let at = |k: usize| ((k % (n + 1)) as f32 / n as f32, (k / (n + 1)) as f32 / n as f32);
        let all: Vec<(f32, f32)> = (0..(n + 1) * (n + 1)).map(at).collect();
        let positions: Vec<[f32; 3]> = all.iter().map(|&(x, y)| [x, y, height * x * (1.0 - y)]).collect();
        let normal = |(x, y): (f32, f32)| {
            let v = glam::Vec3::new(-height * (1.0 - y), height * x, 1.0).normalize();
            v.to_array()
        };
        let normals: Vec<[f32; 3]> = all.iter().copied().map(normal).collect();
        let texcoords: Vec<[f32; 2]> = all.iter().map(|&(x, y)| [x, 1.0 - y]).collect();
        let w = n as u16 + 1;
        let square = |k: u16| {
            let a = k / n as u16 * w + k % n as u16;
            [a, a + 1, a + w + 1, a, a + w + 1, a + w]
        };
        let indices: Vec<u16> = (0..(n * n) as u16).flat_map(square).collect();
        let (p, m, t) = (self.floats(&positions), self.floats(&normals), self.floats(&texcoords));
        let i = self.indices(&indices);
        (json!({"attributes": {"POSITION": p, "NORMAL": m, "TEXCOORD_0": t}, "indices": i}), positions)
    }

    fn skin(&mut self, joints: &[usize], binds: &[glam::Mat4]) {
        let binds: Vec<[f32; 16]> = binds.iter().map(glam::Mat4::to_cols_array).collect();
        let matrices = self.floats(&binds);
        let accessor = self.json["accessors"][matrices].as_object_mut().unwrap();
        accessor.remove("min");
        accessor.remove("max");
        self.json["skins"] = json!([{"name": "rig", "joints": joints, "inverseBindMatrices": matrices,
            "skeleton": joints[0], "extras": {"kind": "biped"}}]);
    }

    fn animation(&mut self, node: usize) {
        let times = self.floats(&[[0.0], [1.0]]);
        let turns = self.floats(&[[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.0]]);
        self.json["animations"] = json!([{"name": "wave", "samplers": [{"input": times, "output": turns}],
            "channels": [{"sampler": 0, "target": {"node": node, "path": "rotation"}}], "extras": {"loop": true}}]);
    }

    fn picture(&mut self, value: u8) -> usize {
        let mut image = crate::picture::Image::zeros(2, 2, 3, crate::picture::Depth::U8).unwrap();
        // Every place and channel once: four and three have no common factor.
        (0..12).for_each(|k| image.set(k % 2, k / 2 % 2, k % 3, f32::from(value) / 255.0));
        let bytes = crate::io::image_file::encode_png(&image).unwrap();
        self.view(&bytes)
    }
}

/// A rig of two bones, one morph target that is sparse, an animation, names and extras.
pub(super) fn rigged() -> Sample {
    let mut s = Sample::new();
    let (mut primitive, positions) = s.grid(4, 0.3);
    let count = positions.len();
    let weight = |p: &[f32; 3]| [1.0 - p[1], p[1], 0.0, 0.0];
    let weights: Vec<[f32; 4]> = positions.iter().map(weight).collect();
    // Joints without a weight are the first.
    let joint = |p: &[f32; 3]| [0, u8::from(p[1] > 0.0), 0, 0];
    let joints: Vec<u8> = positions.iter().flat_map(joint).collect();
    let joints = s.accessor(&joints, 5121, "VEC4", count);
    primitive["attributes"]["JOINTS_0"] = joints.into();
    primitive["attributes"]["WEIGHTS_0"] = s.floats(&weights).into();
    let at = s.view(&[3u16, 7, 12].iter().flat_map(|i| i.to_le_bytes()).collect::<Vec<_>>());
    let by = s.view(&[[0.0f32, 0.0, 0.5]; 3].concat().iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>());
    let smile = s.push(
        "accessors",
        json!({"componentType": 5126, "type": "VEC3", "count": count,
        "min": [0, 0, 0], "max": [0, 0, 0.5], "sparse": {"count": 3,
        "indices": {"bufferView": at, "componentType": 5123}, "values": {"bufferView": by}}}),
    );
    primitive["targets"] = json!([{"POSITION": smile}]);
    s.push(
        "meshes",
        json!({"name": "body", "primitives": [primitive], "weights": [0.0],
        "extras": {"targetNames": ["smile"]}}),
    );
    s.json["nodes"] = json!([
        {"name": "armature", "children": [2]},
        {"name": "body", "mesh": 0, "skin": 0},
        {"name": "hip", "children": [3], "translation": [0.0, 0.0, 0.0]},
        {"name": "chest", "translation": [0.0, 0.5, 0.0], "extras": {"ik": 1}}]);
    let up = glam::Mat4::from_translation(glam::Vec3::new(0.0, -0.5, 0.0));
    s.json["scenes"][0]["nodes"] = json!([0, 1]);
    s.skin(&[2, 3], &[glam::Mat4::IDENTITY, up]);
    s.animation(3);
    s
}

/// A rig in another pose than that of its binding, with two sets of weights that do not sum to one.
pub(super) fn posed() -> Sample {
    let mut s = rigged();
    let count = 25;
    let turn = glam::Quat::from_rotation_z(0.7).to_array();
    s.json["nodes"][3]["rotation"] = json!(turn);
    s.json["nodes"][0]["translation"] = json!([0.0, 0.0, 2.0]);
    let joints = s.accessor(&[[1u8, 0, 0, 0]; 25].concat(), 5121, "VEC4", count);
    let weights = s.accessor(&[[51u8, 0, 0, 0]; 25].concat(), 5121, "VEC4", count);
    s.json["accessors"][weights]["normalized"] = true.into();
    let attributes = &mut s.json["meshes"][0]["primitives"][0]["attributes"];
    attributes["JOINTS_1"] = joints.into();
    attributes["WEIGHTS_1"] = weights.into();
    s.json["meshes"][0]["weights"] = json!([0.5]);
    s
}

/// Three meshes in a tree of nodes, one shown twice, one mirrored, with a camera and a light.
pub(super) fn several() -> Sample {
    let mut s = Sample::new();
    for height in [0.0, 0.5, 1.0] {
        let (primitive, _) = s.grid(3, height);
        s.push("meshes", json!({"name": format!("part{height}"), "primitives": [primitive]}));
    }
    s.json["nodes"] = json!([
        {"name": "root", "children": [1, 2, 3, 4, 5], "rotation": [0.0, 0.6, 0.0, 0.8], "scale": [2, 2, 2]},
        {"name": "c", "mesh": 2, "translation": [3, 0, 0]},
        {"name": "a", "mesh": 0, "matrix": [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 7, 0, 0, 1]},
        {"name": "again", "mesh": 2, "translation": [9, 0, 0]},
        {"name": "b", "mesh": 1, "extras": {"tag": [1, 2]}},
        {"name": "eye", "camera": 0, "extensions": {"KHR_lights_punctual": {"light": 0}}}]);
    s.json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.01}}]);
    s.json["extensionsUsed"] = json!(["KHR_lights_punctual"]);
    s.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "point", "name": "lamp"}]}});
    s
}

/// Quantised positions, normals and texture coordinates (KHR_mesh_quantization).
pub(super) fn quantized() -> Sample {
    let mut s = Sample::new();
    let p: Vec<u8> = [[0u16, 0, 0, 0], [1000, 0, 0, 0], [0, 1000, 0, 0], [1000, 1000, 500, 0]]
        .concat()
        .iter()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    let view = s.view(&p);
    s.json["bufferViews"][view]["byteStride"] = 8.into();
    let p = s.push("accessors", json!({"bufferView": view, "componentType": 5123, "type": "VEC3", "count": 4, "min": [0, 0, 0], "max": [1000, 1000, 500]}));
    let view = s.view(&[[0u8, 0, 127, 0]; 4].concat());
    s.json["bufferViews"][view]["byteStride"] = 4.into();
    let n = s.push(
        "accessors",
        json!({"bufferView": view, "componentType": 5120, "type": "VEC3", "count": 4, "normalized": true}),
    );
    let t: Vec<u8> =
        [[0u16, 0], [65535, 0], [0, 65535], [65535, 65535]].concat().iter().flat_map(|x| x.to_le_bytes()).collect();
    let t = s.accessor(&t, 5123, "VEC2", 4);
    s.json["accessors"][t]["normalized"] = true.into();
    let i = s.indices(&[0, 1, 2, 2, 1, 3]);
    s.push(
        "meshes",
        json!({"primitives": [{"attributes": {"POSITION": p, "NORMAL": n, "TEXCOORD_0": t}, "indices": i}]}),
    );
    s.json["nodes"] = json!([{"mesh": 0, "scale": [0.001, 0.001, 0.001], "translation": [5, 0, 0]}]);
    s.json["extensionsUsed"] = json!(["KHR_mesh_quantization"]);
    s.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    s
}

/// One interleaved buffer with positions, normals, tangents and colours, as a strip without
/// indices.
pub(super) fn interleaved() -> Sample {
    let mut s = Sample::new();
    let mut bytes = Vec::new();
    for k in 0..8u8 {
        let p = [f32::from(k / 2), f32::from(k % 2), 0.0];
        let numbers = [p.to_vec(), vec![0.0, 0.0, 1.0], vec![1.0, 0.0, 0.0, -1.0]].concat();
        bytes.extend(numbers.iter().flat_map(|x| x.to_le_bytes()));
        bytes.extend([k * 30, 255, 0, 255]);
    }
    let view = s.view(&bytes);
    s.json["bufferViews"][view]["byteStride"] = 44.into();
    let mut attributes = json!({});
    for (name, offset, component, shape) in [
        ("POSITION", 0, 5126, "VEC3"),
        ("NORMAL", 12, 5126, "VEC3"),
        ("TANGENT", 24, 5126, "VEC4"),
        ("COLOR_0", 40, 5121, "VEC4"),
    ] {
        let mut value =
            json!({"bufferView": view, "byteOffset": offset, "componentType": component, "type": shape, "count": 8});
        if name == "POSITION" {
            value["min"] = json!([0, 0, 0]);
            value["max"] = json!([3, 1, 0]);
        }
        if name == "COLOR_0" {
            value["normalized"] = true.into();
        }
        attributes[name] = s.push("accessors", value).into();
    }
    s.push("meshes", json!({"primitives": [{"attributes": attributes, "mode": 5}]}));
    s.json["nodes"] = json!([{"mesh": 0}]);
    s
}

/// Two textured materials with a transform, factors, extensions and variants; one is used by two
/// primitives.
pub(super) fn dressed() -> Sample {
    let mut s = Sample::new();
    let mut primitives = Vec::new();
    for (height, material) in [(0.0, 0), (0.4, 1), (0.8, 0)] {
        let (mut primitive, _) = s.grid(2, height);
        primitive["material"] = material.into();
        primitives.push(primitive);
    }
    primitives[1]["extensions"] = json!({"KHR_materials_variants": {"mappings": [{"material": 1, "variants": [0]}]}});
    s.push("meshes", json!({"name": "clothes", "primitives": primitives}));
    s.json["nodes"] = json!([{"name": "clothes", "mesh": 0}]);
    let views: Vec<usize> = (0..3).map(|k| s.picture(80 * k)).collect();
    s.json["images"] =
        views.iter().map(|v| json!({"bufferView": v, "mimeType": "image/png", "name": format!("i{v}")})).collect();
    s.json["samplers"] = json!([{"wrapS": 33071, "wrapT": 33648}]);
    s.json["textures"] = json!([{"source": 0, "sampler": 0}, {"source": 1}, {"source": 2, "sampler": 0}]);
    s.json["materials"] = json!([
        {"name": "cloth", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "extensions":
            {"KHR_texture_transform": {"scale": [2, 2], "offset": [0.5, 0]}}}, "metallicFactor": 0.25},
            "normalTexture": {"index": 1, "scale": 0.5}, "extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": 0.5}},
            "extras": {"shop": "here"}},
        {"name": "metal", "pbrMetallicRoughness": {"baseColorTexture": {"index": 2}}, "doubleSided": true,
            "alphaMode": "MASK", "alphaCutoff": 0.3}]);
    s.json["extensionsUsed"] = json!(["KHR_texture_transform", "KHR_materials_clearcoat", "KHR_materials_variants"]);
    s.json["extensions"] = json!({"KHR_materials_variants": {"variants": [{"name": "night"}]}});
    s
}

/// Two primitives that share their accessors, and one of lines.
pub(super) fn shared() -> Sample {
    let mut s = Sample::new();
    let (first, _) = s.grid(3, 0.2);
    let half = s.indices(&[0, 1, 5, 0, 5, 4]);
    let line = s.indices(&[0, 1]);
    let mut second = first.clone();
    second["indices"] = half.into();
    let lines = json!({"attributes": {"POSITION": first["attributes"]["POSITION"]}, "indices": line, "mode": 1});
    s.push("meshes", json!({"primitives": [first, lines, second]}));
    s.json["nodes"] = json!([{"mesh": 0}]);
    s
}

/// Two sets of texture coordinates and dense morph targets with normals, at weights other than
/// zero.
pub(super) fn morphed() -> Sample {
    let mut s = Sample::new();
    let (mut primitive, positions) = s.grid(3, 0.0);
    let moved = |by: f32| positions.iter().map(|p| [0.0, 0.0, by * p[0]]).collect::<Vec<_>>();
    let turned: Vec<[f32; 3]> = positions.iter().map(|_| [-0.3, 0.0, 0.0]).collect();
    let (a, b, n) = (s.floats(&moved(1.0)), s.floats(&moved(-2.0)), s.floats(&turned));
    primitive["targets"] = json!([{"POSITION": a, "NORMAL": n}, {"POSITION": b}]);
    let second: Vec<[f32; 2]> = positions.iter().map(|p| [0.5 * p[0], 0.25 * p[1]]).collect();
    primitive["attributes"]["TEXCOORD_1"] = s.floats(&second).into();
    s.push(
        "meshes",
        json!({"primitives": [primitive], "weights": [0.0, 0.25], "extras": {"targetNames": ["up", "down"]}}),
    );
    s.json["nodes"] = json!([{"mesh": 0, "weights": [0.5, 0.0], "translation": [0, 1, 0]}]);
    s
}

/// A mesh split at a seam, far down a chain of nodes at a place on a map.
pub(super) fn far() -> Sample {
    let mut s = Sample::new();
    for shift in [0.0, 1.0] {
        let (primitive, _) = s.grid(2, 0.0);
        let p = primitive["attributes"]["POSITION"].as_u64().unwrap() as usize;
        let view = s.json["accessors"][p]["bufferView"].as_u64().unwrap() as usize;
        let offset = s.json["bufferViews"][view]["byteOffset"].as_u64().unwrap() as usize;
        for v in 0..9 {
            let at = offset + 12 * v;
            let x = f32::from_le_bytes(s.binary[at..at + 4].try_into().unwrap()) + shift;
            s.binary[at..at + 4].copy_from_slice(&x.to_le_bytes());
        }
        s.json["accessors"][p]["min"] = json!([shift, 0, 0]);
        s.json["accessors"][p]["max"] = json!([shift + 1.0, 1, 0]);
        if shift == 0.0 {
            s.push("meshes", json!({"primitives": [primitive]}));
        } else {
            s.json["meshes"][0]["primitives"].as_array_mut().unwrap().push(primitive);
        }
    }
    s.json["nodes"] =
        json!([{"children": [1], "translation": [500000.25, 4600000.5, 0]}, {"mesh": 0, "scale": [0.5, 0.5, 0.5]}]);
    s
}

/// A fan with bytes as indices in a mesh that is not shown beside one that is.
pub(super) fn hidden() -> Sample {
    let mut s = Sample::new();
    let (unseen, _) = s.grid(2, 0.9);
    s.push("meshes", json!({"name": "unseen", "primitives": [unseen]}));
    let p = s.floats(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.5], [9.0, 9.0, 9.0]]);
    let i = s.accessor(&[0, 1, 2, 3], 5121, "SCALAR", 4);
    s.push("meshes", json!({"name": "seen", "primitives": [{"attributes": {"POSITION": p}, "indices": i, "mode": 6}]}));
    s.json["nodes"] = json!([{"name": "shown", "mesh": 1}, {"name": "elsewhere", "mesh": 0}]);
    s.json["scenes"] = json!([{"nodes": [0]}, {"name": "other", "nodes": [1]}]);
    s
}

/// All of them, with their names.
pub(super) fn all() -> Vec<(&'static str, Sample)> {
    vec![
        ("rigged", rigged()),
        ("posed", posed()),
        ("several", several()),
        ("quantized", quantized()),
        ("interleaved", interleaved()),
        ("dressed", dressed()),
        ("shared", shared()),
        ("morphed", morphed()),
        ("far", far()),
        ("hidden", hidden()),
    ]
}
