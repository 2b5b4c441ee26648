//! glTF 2.0 and GLB, read as one mesh.
//!
//! All triangle meshes of the default scene are taken with the transforms of their nodes. glTF repeats a vertex along texture seams, which
//! would cut the surface there: vertices of one mesh with exactly equal positions become one, and every face corner keeps its own texture
//! coordinate. A vertex index counts the vertices that remain, in file order of their first occurrence. Texture coordinates are turned to the OBJ
//! convention (v = 1 is the top of the picture).

use std::collections::{HashMap, HashSet};
use std::path::Path;

use glam::{DMat4, DQuat, DVec2, DVec3};

use super::LoadedMesh;
use super::assemble::{self, TexcoordPool};
use super::gltf_document::{Document, MeshData, Node, Primitive, TextureUse};
use super::source::{self, Notes};
use super::{gltf_colors, gltf_materials};
use crate::Result;
use crate::geometry::{Corner, MeshBuilder, NONE};

/// Reads a `.gltf` or `.glb` file with its buffers. O(file size) time and memory.
///
/// # Errors
/// [`crate::Error::Io`], or [`crate::Error::Format`]: damaged data, a compressed mesh, an extension that is required and not known, no triangles.
pub fn read_gltf(path: impl AsRef<Path>) -> Result<LoadedMesh> {
    let path = path.as_ref();
    parse_gltf(&source::read_all(path)?, path)
}

/// Reads glTF content; `path` names it in messages and locates its buffers and textures.
///
/// # Errors
/// As [`read_gltf`].
pub fn parse_gltf(bytes: &[u8], path: &Path) -> Result<LoadedMesh> {
    let document = Document::parse(bytes, path)?;
    let mut scene = SceneReader {
        // Instances may repeat data, but a small file must not grow without bound.
        budget: document.byte_count.saturating_mul(16).saturating_add(1 << 20),
        document: &document,
        builder: MeshBuilder::new(path.display().to_string()),
        notes: Notes::default(),
        file_vertices: 0,
    };
    scene.builder.mesh.materials = gltf_materials::read(&document, &mut scene.notes)?;
    for (node, transform) in scene.placed_meshes()? {
        scene.mesh(node, transform)?;
    }
    let SceneReader { mut builder, mut notes, file_vertices, .. } = scene;
    if !builder.mesh.colors.is_empty() {
        builder.mesh.colors.resize(builder.mesh.positions.len(), [1.0; 4]);
    }
    let left = builder.mesh.positions.len();
    if left < file_vertices {
        notes.say(format!("{file_vertices} vertices were joined to {left} where their positions are exactly equal"));
    }
    assemble::finish(builder, notes, path)
}

struct SceneReader<'a> {
    document: &'a Document<'a>,
    builder: MeshBuilder,
    notes: Notes,
    /// Elements that may still be added.
    budget: usize,
    file_vertices: usize,
}

/// A mesh to be added: its name and data, and where it stands.
type Placed<'a> = ((String, &'a MeshData), DMat4);

impl<'a> SceneReader<'a> {
    /// The meshes of the default scene in depth-first order.
    fn placed_meshes(&mut self) -> Result<Vec<Placed<'a>>> {
        let root = &self.document.root;
        let all: Vec<usize>;
        let roots = match root.scenes.get(root.scene.unwrap_or(0)) {
            Some(scene) => &scene.nodes,
            None => {
                let children: HashSet<usize> = root.nodes.iter().flat_map(|n| n.children.iter().copied()).collect();
                all = (0..root.nodes.len()).filter(|n| !children.contains(n)).collect();
                &all
            }
        };
        let mut stack: Vec<(usize, DMat4)> = roots.iter().rev().map(|&n| (n, DMat4::IDENTITY)).collect();
        let mut seen = vec![false; root.nodes.len()];
        let mut placed = Vec::new();
        while let Some((index, parent)) = stack.pop() {
            let Some(node) = root.nodes.get(index) else {
                return Err(self.damaged(format!("there is no node {index}")));
            };
            if std::mem::replace(&mut seen[index], true) {
                return Err(self.damaged(format!("node {index} has two parents")));
            }
            let transform = parent * local_transform(node);
            if let Some(mesh) = node.mesh {
                let Some(data) = root.meshes.get(mesh) else {
                    return Err(self.damaged(format!("there is no mesh {mesh}")));
                };
                let name = node.name.as_ref().or(data.name.as_ref()).cloned();
                let name = name.unwrap_or_else(|| format!("mesh{mesh}"));
                if node.skin.is_some() {
                    self.notes.say("the mesh has a skeleton: it is read in the pose it is stored in".to_owned());
                }
                // The transform of a skinned node does not count (glTF 2.0, section 3.7.3.3).
                let transform = if node.skin.is_some() { DMat4::IDENTITY } else { transform };
                placed.push(((name, data), transform));
            }
            stack.extend(node.children.iter().rev().map(|&child| (child, transform)));
        }
        Ok(placed)
    }

    fn damaged(&self, what: String) -> crate::Error {
        self.document.error(what, "The file is damaged: export the model again")
    }

    fn spend(&mut self, count: usize) -> Result<()> {
        self.budget = self.budget.checked_sub(count).ok_or_else(|| {
            let what = "its instances expand to far more than the file holds";
            self.document.error(what, "Export the model with its instances applied")
        })?;
        if self.builder.corners_mut().len().saturating_add(count) >= NONE as usize - 1 {
            let what = "more face corners than 32-bit indices can number";
            return Err(self.document.error(what, "Split the model"));
        }
        Ok(())
    }

    fn mesh(&mut self, (name, data): (String, &MeshData), transform: DMat4) -> Result<()> {
        self.builder.group = self.builder.mesh.groups.len() as u32;
        self.builder.mesh.groups.push(name);
        let mut welded = HashMap::new();
        let mut pool = TexcoordPool::default();
        for primitive in &data.primitives {
            match (primitive.mode.unwrap_or(4), primitive.attributes.get("POSITION")) {
                (mode @ 4..=6, Some(&positions)) => {
                    self.primitive(primitive, mode, positions, transform, &mut welded, &mut pool)?;
                }
                (0..=3, _) => self.notes.count("sets of points or lines were passed over", None),
                _ => return Err(self.damaged("a primitive has no positions or an unknown mode".to_owned())),
            }
        }
        Ok(())
    }

    fn primitive(
        &mut self,
        primitive: &Primitive,
        mode: u32,
        positions: usize,
        transform: DMat4,
        welded: &mut HashMap<[u64; 3], u32>,
        pool: &mut TexcoordPool,
    ) -> Result<()> {
        let positions = self.document.numbers(positions, 3)?;
        let count = positions.len() / 3;
        self.spend(count)?;
        self.file_vertices += count;
        let mesh = &mut self.builder.mesh;
        let vertex: Vec<u32> = positions
            .chunks_exact(3)
            .map(|p| {
                // Adding zero makes -0 equal to 0.
                *welded.entry([p[0] + 0.0, p[1] + 0.0, p[2] + 0.0].map(f64::to_bits)).or_insert_with(|| {
                    mesh.positions.push(transform.transform_point3(DVec3::new(p[0], p[1], p[2])));
                    mesh.positions.len() as u32 - 1
                })
            })
            .collect();
        if let Some(colors) = gltf_colors::read(self.document, primitive)? {
            // Vertices of primitives without colours are white.
            self.builder.mesh.colors.resize(self.builder.mesh.positions.len(), [1.0; 4]);
            for (&v, color) in vertex.iter().zip(colors) {
                self.builder.mesh.colors[v as usize] = color;
            }
        }
        let texture = primitive.material.and_then(|m| self.document.root.materials.get(m));
        let texture = texture.and_then(|m| m.pbr_metallic_roughness.as_ref()?.base_color_texture.as_ref());
        let placement = Placement::of(texture);
        let texcoords = match primitive.attributes.get(&format!("TEXCOORD_{}", placement.set)) {
            Some(&accessor) => self.document.numbers(accessor, 2)?,
            None => Vec::new(),
        };
        let indices: Vec<f64> = match primitive.indices {
            Some(accessor) => self.document.numbers(accessor, 1)?,
            None => (0..count).map(|i| i as f64).collect(),
        };
        self.spend(indices.len().saturating_mul(if mode == 4 { 1 } else { 3 }))?;
        if let Some(bad) = indices.iter().find(|i| !(**i >= 0.0 && **i < count as f64)) {
            return Err(self.damaged(format!("a triangle refers to vertex {bad} of {count}")));
        }
        let mut corner = Vec::with_capacity(indices.len());
        for &index in &indices {
            let i = index as usize;
            let uv = texcoords.get(2 * i..2 * i + 2).map(|uv| placement.apply(DVec2::new(uv[0], uv[1])));
            let texcoord = uv.map_or(NONE, |uv| pool.add(vertex[i], uv, &mut self.builder.mesh.texcoords));
            corner.push(Corner { vertex: vertex[i], texcoord, normal: NONE });
        }
        let known = primitive.material.filter(|m| *m < self.document.root.materials.len());
        self.builder.material = known.map_or(NONE, |m| m as u32);
        // A reflection turns triangles inside out.
        let reflected = transform.determinant() < 0.0;
        let triangles = if mode == 4 { corner.len() / 3 } else { corner.len().saturating_sub(2) };
        for t in 0..triangles {
            let [a, mut b, mut c] = match mode {
                4 => [3 * t, 3 * t + 1, 3 * t + 2],
                5 if t % 2 == 1 => [t + 1, t, t + 2],
                5 => [t, t + 1, t + 2],
                _ => [0, t + 1, t + 2],
            };
            if reflected {
                std::mem::swap(&mut b, &mut c);
            }
            self.builder.polygon([corner[a], corner[b], corner[c]]);
        }
        Ok(())
    }
}

fn local_transform(node: &Node) -> DMat4 {
    if let Some(matrix) = &node.matrix {
        return DMat4::from_cols_array(matrix);
    }
    let rotation = DQuat::from_array(node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]));
    // Rotations are stored in single precision.
    let rotation = if rotation.length_squared() > 0.0 { rotation.normalize() } else { DQuat::IDENTITY };
    let scale = DVec3::from(node.scale.unwrap_or([1.0; 3]));
    DMat4::from_scale_rotation_translation(scale, rotation, DVec3::from(node.translation.unwrap_or([0.0; 3])))
}

/// Which texture coordinates of the file the mesh has. How pictures lie on them is said by the materials.
struct Placement {
    set: usize,
}

impl Placement {
    fn of(texture: Option<&TextureUse>) -> Self {
        Self { set: texture.map_or(0, TextureUse::set) }
    }

    /// From glTF's v, which runs down from the top of the picture, to OBJ's, which runs up from the bottom.
    fn apply(&self, uv: DVec2) -> DVec2 {
        DVec2::new(uv.x, 1.0 - uv.y)
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;

    /// A triangle in an embedded buffer: three positions, then indices 0 1 2 as bytes.
    fn triangle() -> Value {
        json!({
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
            "accessors": [
                {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
                {"bufferView": 0, "byteOffset": 36, "componentType": 5121, "count": 3, "type": "SCALAR"}
            ],
            "bufferViews": [{"buffer": 0, "byteLength": 39}],
            "buffers": [{"byteLength": 39, "uri":
                "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAEC"}]
        })
    }

    fn read(value: &Value) -> Result<LoadedMesh> {
        parse_gltf(value.to_string().as_bytes(), Path::new("test.gltf"))
    }

    #[test]
    fn transforms_multiply_and_reflections_turn_faces() {
        let mut value = triangle();
        value["nodes"] = json!([
            {"children": [1, 2], "translation": [0, 0, 5], "rotation": [0, 0, 1, 1]},
            {"mesh": 0, "scale": [2, 2, 2]},
            {"mesh": 0, "matrix": [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 7, 0, 0, 1]}
        ]);
        let mesh = read(&value).unwrap().mesh;
        assert_eq!((mesh.triangle_count(), mesh.vertex_count()), (2, 6));
        assert!(mesh.positions[1].distance(DVec3::new(0.0, 2.0, 5.0)) < 1e-6);
        assert!(mesh.positions[3].distance(DVec3::new(0.0, 7.0, 5.0)) < 1e-6);
        assert_eq!(mesh.triangle(1), [3, 5, 4]);
        assert!(mesh.triangle_area_normal(0).z > 0.0 && mesh.triangle_area_normal(1).z > 0.0);
    }

    #[test]
    fn strips_fans_and_sparse_data() {
        let mut value = triangle();
        value["meshes"][0]["primitives"][0]["mode"] = 5.into();
        value["accessors"][0]["sparse"] = json!({"count": 1,
            "indices": {"bufferView": 0, "byteOffset": 37, "componentType": 5121}, "values": {"bufferView": 0, "byteOffset": 24}});
        let mesh = read(&value).unwrap().mesh;
        assert_eq!(mesh.triangles(), [[0, 1, 1]], "vertex 1 is moved onto vertex 2, and the two are joined");
    }

    #[test]
    fn faults_are_named() {
        for (pointer, new, expected) in [
            ("/extensionsRequired", json!(["KHR_draco_mesh_compression"]), "compressed"),
            ("/extensionsRequired", json!(["VENDOR_thing"]), "VENDOR_thing"),
            ("/nodes/0/mesh", json!(7), "no mesh 7"),
            ("/nodes/0/children", json!([0]), "two parents"),
            ("/scenes/0/nodes", json!([3]), "no node 3"),
            ("/accessors/0/count", json!(4), "beyond the 39 bytes"),
            ("/accessors/0/count", json!(u64::MAX), "beyond the 39 bytes"),
            ("/accessors/0/type", json!("VEC2"), "VEC2"),
            ("/accessors/0/bufferView", json!(9), "no buffer view 9"),
            ("/accessors/1/count", json!(2), "no face with three"),
            ("/bufferViews/0/byteStride", json!(0), "beyond"),
            ("/bufferViews/0/byteLength", json!(40), "beyond the 39 bytes of buffer 0"),
            ("/buffers/0/uri", json!("data:;base64,@@"), "base64"),
            ("/buffers/0/uri", json!("http://x/y.bin"), "http"),
            ("/buffers/0/uri", json!("gone.bin"), "gone.bin"),
            ("/buffers/0/uri", json!(null), "buffer 0 has no data"),
            ("/meshes/0/primitives/0/attributes", json!({}), "no positions"),
            ("/meshes/0/primitives/0/mode", json!(1), "no face with three"),
            ("/meshes", json!("x"), "JSON"),
        ] {
            let mut value = triangle();
            let parent = pointer.rsplit_once('/').unwrap();
            value.pointer_mut(parent.0).unwrap()[parent.1] = new;
            let message = read(&value).unwrap_err().to_string();
            assert!(message.contains(expected), "{pointer}: {message:?} lacks {expected:?}");
        }
        let mut many = triangle();
        many["nodes"] = (0..100_000).map(|_| json!({"mesh": 0})).collect();
        many["scenes"][0]["nodes"] = (0..100_000).collect();
        assert!(read(&many).is_ok());
        let mut children = triangle();
        children["meshes"] = json!([{"primitives": vec![triangle()["meshes"][0]["primitives"][0].clone(); 1000]}]);
        children["nodes"] = (0..10_000).map(|_| json!({"mesh": 0})).collect();
        children["scenes"][0]["nodes"] = (0..10_000).collect();
        assert!(read(&children).unwrap_err().to_string().contains("expand"));
    }
}
