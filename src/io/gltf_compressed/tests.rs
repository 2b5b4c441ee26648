use std::path::Path;

use glam::DVec3;
use serde_json::{Value, json};

use crate::geometry::Mesh;
use crate::io::LoadedMesh;
use crate::io::gltf_container::{container, split};
use crate::io::gltf_read::parse_gltf;
use crate::io::gltf_samples::check_valid;

/// A bent sheet with a rig, vertex colours and a morph target: as it is, by gltfpack 1.3 (`-cc`,
/// `-cc -vpf -vtf`, `-cz -ce khr -vnf`), and by the encoder of Draco 1.5.7.
const PLAIN: &[u8] = include_bytes!("samples/plain.glb");
pub(in crate::io) const COMPRESSED: [(&str, &[u8]); 4] = [
    ("EXT_meshopt_compression", include_bytes!("samples/meshopt.glb")),
    ("EXT_meshopt_compression", include_bytes!("samples/meshopt_floats.glb")),
    ("KHR_meshopt_compression", include_bytes!("samples/meshopt_khr.glb")),
    ("KHR_draco_mesh_compression", include_bytes!("samples/draco.glb")),
];

fn read(bytes: &[u8]) -> LoadedMesh {
    parse_gltf(bytes, Path::new("sample.glb")).unwrap_or_else(|e| panic!("{e}"))
}

/// The largest distance of a vertex of `a` from its place in `b`, and the same of its normal,
/// texture coordinates and colour: encoders reorder vertices.
fn apart(a: &Mesh, b: &Mesh) -> [f64; 4] {
    let corners = |m: &Mesh| -> Vec<(DVec3, DVec3, glam::DVec2, [f32; 4])> {
        let of = |t: usize| {
            m.triangle_corners(t).map(|c| {
                let v = c.vertex as usize;
                (m.positions[v], m.normals[c.normal as usize], m.texcoords[c.texcoord as usize], m.colors[v])
            })
        };
        (0..m.triangle_count()).flat_map(of).collect()
    };
    let (a, b) = (corners(a), corners(b));
    let mut worst = [0.0_f64; 4];
    for (p, n, uv, color) in a {
        let near = b.iter().min_by(|x, y| x.0.distance(p).total_cmp(&y.0.distance(p))).unwrap();
        let tint = color.iter().zip(near.3).map(|(a, b)| f64::from((a - b).abs())).fold(0.0, f64::max);
        let off = [near.0.distance(p), near.1.distance(n), near.2.distance(uv), tint];
        worst = std::array::from_fn(|k| worst[k].max(off[k]));
    }
    worst
}

#[test]
fn compressed_files_are_the_plain_one_up_to_their_precision() {
    let plain = read(PLAIN);
    for (k, (name, bytes)) in COMPRESSED.into_iter().enumerate() {
        let loaded = read(bytes);
        assert_eq!(loaded.mesh.triangle_count(), plain.mesh.triangle_count());
        for off in [apart(&loaded.mesh, &plain.mesh), apart(&plain.mesh, &loaded.mesh)] {
            // 14 bits for positions, 8 for normals and colours, 12 for texture coordinates.
            // gltfpack says in the material where quantised coordinates lie: here no texture does.
            let most = [2e-4, 0.02, if k % 2 == 1 { 5e-4 } else { f64::INFINITY }, 0.05];
            assert!(off.iter().zip(most).all(|(off, most)| *off < most), "{name}: {off:?}");
        }
        let joints = loaded.scene.unwrap().skin_weights().unwrap().unwrap();
        assert_eq!(joints.names, ["hip", "chest"], "{name}");
        let p = &loaded.mesh.positions;
        // At rest a vertex follows the upper joint by its height.
        let off = joints.weights.chunks(2).zip(p).map(|(w, p)| (w[1] - p.y).abs()).fold(0.0, f64::max);
        assert!(off < 0.01, "{name}: {off}");
    }
    let mut moved = plain.mesh.clone();
    moved.positions.iter_mut().for_each(|p| p.z += 0.001);
    assert!(apart(&moved, &plain.mesh)[0] > 2e-4, "the comparison sees a shift");
}

#[test]
fn what_is_written_is_plain_and_has_all_that_was_there() {
    let mut written = Vec::new();
    for (k, (name, bytes)) in COMPRESSED.into_iter().enumerate() {
        let LoadedMesh { mesh, scene, .. } = read(bytes);
        let mut new = mesh.clone();
        new.positions.iter_mut().for_each(|p| p.z += 0.3 * p.x);
        let mut edit = scene.as_ref().unwrap().edit();
        edit.shape(&new).unwrap();
        let (after, notes) = edit.finish().unwrap();
        assert!(notes.len() == 1 && notes[0].contains(name), "{notes:?}");
        let (json, _) = split(&after, Path::new("after.glb")).unwrap();
        let json = String::from_utf8_lossy(&after[json]);
        assert!(!json.contains("_compression"), "{json}");
        assert!(["hip", "wave", "red"].iter().all(|name| json.contains(name)), "{json}");
        assert_eq!(json.contains("smile"), k < 3);
        let back = read(&after).mesh;
        let off = back.positions.iter().zip(&new.positions).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        assert!(off < 1e-6 && back.triangles() == mesh.triangles(), "{name}: {off}");
        written.push((format!("{k}"), after));
    }
    check_valid(&written);
}

#[test]
fn flipped_bytes_are_errors_or_other_shapes_and_end() {
    for (name, bytes) in COMPRESSED {
        let start = split(bytes, Path::new("s.glb")).unwrap().1.unwrap().start;
        let mut refused = 0;
        for k in start..bytes.len() {
            for mask in [0xff, 1 << (k % 8)] {
                let mut bytes = bytes.to_vec();
                bytes[k] ^= mask;
                refused += usize::from(parse_gltf(&bytes, Path::new("s.glb")).is_err());
            }
        }
        assert!(refused > 0, "{name}");
        for length in 0..400 {
            let (json, _) = split(bytes, Path::new("s.glb")).unwrap();
            let cut = container("s", bytes[json].to_vec(), &bytes[start..start + length]).unwrap();
            assert!(parse_gltf(&cut, Path::new("s.glb")).is_err(), "{name} of {length} bytes");
        }
    }
}

#[test]
fn faults_of_the_description_are_named() {
    let meshopt = "/bufferViews/0/extensions/EXT_meshopt_compression";
    let draco = "/meshes/0/primitives/0/extensions/KHR_draco_mesh_compression";
    for (file, pointer, value, expected) in [
        (0, format!("{meshopt}/mode"), json!("WORDS"), "WORDS"),
        (0, format!("{meshopt}/filter"), json!("BLUR"), "BLUR"),
        (0, format!("{meshopt}/count"), json!(97), "buffer view 0"),
        (0, format!("{meshopt}/count"), json!(1_u64 << 60), "more than a file holds"),
        (0, format!("{meshopt}/count"), json!(1 << 26), "buffer view 0"),
        (0, format!("{meshopt}/byteStride"), json!(3), "cannot be decompressed"),
        (0, format!("{meshopt}/buffer"), json!(7), "beyond their buffer"),
        (0, format!("{meshopt}/byteOffset"), json!(u64::MAX), "beyond their buffer"),
        (0, "/bufferViews/0/byteLength".into(), json!(780), "another number of bytes"),
        (3, format!("{draco}/attributes/NORMAL"), json!(77), "there is no NORMAL"),
        (3, format!("{draco}/attributes/NORMAL"), json!(3), "NORMAL does not fit"),
        (3, format!("{draco}/attributes"), json!(3), "cannot be decompressed"),
        (3, format!("{draco}/bufferView"), json!(1), "cannot be decompressed"),
        (3, format!("{draco}/bufferView"), json!(9), "no buffer view 9"),
        (3, "/meshes/0/primitives/0/indices".into(), json!(null), "no accessor of indices"),
    ] {
        let bytes = COMPRESSED[file].1;
        let (text, binary) = split(bytes, Path::new("s.glb")).unwrap();
        let mut json: Value = serde_json::from_slice(&bytes[text]).unwrap();
        let (parent, key) = pointer.rsplit_once('/').unwrap();
        json.pointer_mut(parent).unwrap()[key] = value;
        let changed = container("s", json.to_string().into_bytes(), &bytes[binary.unwrap()]).unwrap();
        let message = parse_gltf(&changed, Path::new("s.glb")).unwrap_err().to_string();
        assert!(message.contains(expected), "{pointer}: {message}");
    }
}
