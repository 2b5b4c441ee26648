//! glTF 2.0 and GLB, read as one mesh.
//!
//! The meshes of the default scene are taken in the order of the file's list of meshes, each once:
//! at the first node that shows it (depth first); a note names the others. They stand in the pose
//! that viewers show (`gltf_pose`).
//!
//! **A vertex number is the one in the file**: numbers run through the elements of the position
//! accessor of each primitive of triangles, primitive after primitive, used or not; an accessor
//! that two primitives share counts for each of them. glTF repeats a vertex along the seams of
//! texture coordinates and normals, which would cut the surface: vertices of a mesh are joined
//! along open edges ([`crate::geometry::weld`]), unless a morph target or a joint parts them.
//!
//! Normals are kept, one for each vertex. Texture coordinates are those that the material's base
//! colour uses, or the set that [`ReadOptions`] name; turned to the OBJ convention (v = 1 is the
//! top of the picture).

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use glam::{DMat4, DVec2, DVec3};

use super::assemble::{self, TexcoordPool};
use super::gltf_document::{Document, Primitive};
use super::gltf_nodes::{Placed, global_transforms, placed_meshes};
use super::gltf_pose::Pose;
use super::gltf_scene::{GltfScene, Part};
use super::source::{self, Notes};
use super::{LoadedMesh, ReadOptions, gltf_colors, gltf_extensions, gltf_materials};
use crate::Result;
use crate::control;
use crate::geometry::{Corner, MeshBuilder, NONE, weld};

/// Reads a `.gltf` or `.glb` file with its buffers. O(file size) time and memory.
///
/// # Errors
/// [`crate::Error::Io`], or [`crate::Error::Format`]: damaged data, an extension that is required
/// and not known, no triangles.
pub fn read_gltf(path: impl AsRef<Path>) -> Result<LoadedMesh> {
    read_gltf_with(path.as_ref(), &ReadOptions::default())
}

/// As [`read_gltf`], with options.
pub(super) fn read_gltf_with(path: &Path, options: &ReadOptions) -> Result<LoadedMesh> {
    parse(source::read_all(path)?, path, options)
}

/// Reads glTF content; `path` names it in messages and locates its buffers and textures.
///
/// # Errors
/// As [`read_gltf`].
pub fn parse_gltf(bytes: &[u8], path: &Path) -> Result<LoadedMesh> {
    parse(bytes.to_vec(), path, &ReadOptions::default())
}

fn parse(bytes: Vec<u8>, path: &Path, options: &ReadOptions) -> Result<LoadedMesh> {
    let document = Document::parse(bytes, path)?;
    let mut notes = Notes::default();
    if let Some(note) = gltf_extensions::note(&document.root.extensions_used) {
        notes.say(note);
    }
    let mut builder = MeshBuilder::new(path.display().to_string());
    builder.mesh.materials = gltf_materials::read(&document, &mut notes)?;
    let placed = placed_meshes(&document, &mut notes)?;
    let bytes = expanded_bytes(&document, &placed);
    control::require(bytes, || format!("{}: its {} meshes with all they repeat", path.display(), placed.len()))?;
    let mut scene = SceneReader {
        globals: global_transforms(&document)?,
        // An accessor may be used many times, but a small file must not grow without bound.
        budget: document.byte_count.saturating_mul(16).saturating_add(1 << 20),
        document: &document,
        builder,
        notes,
        uv_set: options.uv_set,
        known: Classes::default(),
        classes: Vec::new(),
        parts: Vec::new(),
    };
    for placed in &placed {
        scene.mesh(placed)?;
    }
    let SceneReader { mut builder, notes, classes, parts, .. } = scene;
    if !builder.mesh.colors.is_empty() {
        builder.mesh.colors.resize(builder.mesh.positions.len(), [1.0; 4]);
    }
    if let Some(set) = options.uv_set.filter(|_| builder.mesh.texcoords.is_empty()) {
        let what = format!("no mesh has a set {set} of texture coordinates (TEXCOORD_{set})");
        return Err(document.error(what, "Name a set that is there"));
    }
    let mut loaded = assemble::finish(builder, notes, path)?;
    // As positions, classes keep apart what is not of one.
    let layer: Vec<DVec3> = classes.iter().map(|&class| DVec3::X * f64::from(class)).collect();
    let welded = weld::weld(&mut loaded.mesh, options.weld, &[&layer])?;
    loaded.warnings.extend(welded.notes());
    loaded.scene = Some(Arc::new(GltfScene::new(document, parts)));
    Ok(loaded)
}

/// Bytes that the meshes take once the primitives have vertices and triangles of their own, at
/// least. O(primitives).
fn expanded_bytes(document: &Document, placed: &[Placed]) -> u64 {
    let count = |accessor: Option<usize>| accessor.and_then(|a| document.accessor(a).ok()).map_or(0, |a| a.count);
    let primitives = placed.iter().flat_map(|p| &document.root.meshes[p.mesh].primitives);
    let bytes = primitives.map(|p| {
        let vertices = count(p.attributes.get("POSITION").copied());
        let corners = if p.indices.is_some() { count(p.indices) } else { vertices };
        (vertices as u64).saturating_mul(BYTES_PER_VERTEX).saturating_add(corners as u64 * BYTES_PER_CORNER)
    });
    bytes.fold(0, u64::saturating_add)
}

/// A position as it is stored and as it is placed, and a class.
const BYTES_PER_VERTEX: u64 = 100;
/// A corner of a polygon, of a triangle, and of what both are made of.
const BYTES_PER_CORNER: u64 = 40;

struct SceneReader<'a> {
    document: &'a Document,
    globals: Vec<DMat4>,
    builder: MeshBuilder,
    notes: Notes,
    /// Elements that may still be added.
    budget: usize,
    uv_set: Option<usize>,
    known: Classes,
    /// Of every vertex.
    classes: Vec<u32>,
    parts: Vec<Part>,
}

impl SceneReader<'_> {
    fn spend(&mut self, count: usize) -> Result<()> {
        self.budget = self.budget.checked_sub(count).ok_or_else(|| {
            let what = "its primitives expand to far more than the file holds";
            self.document.error(what, "Export the model again, without primitives that share their vertices")
        })?;
        if self.builder.corners_mut().len().saturating_add(count) >= NONE as usize - 1 {
            let what = "more face corners than 32-bit indices can number";
            return Err(self.document.error(what, "Split the model"));
        }
        Ok(())
    }

    fn mesh(&mut self, placed: &Placed) -> Result<()> {
        let document = self.document;
        let (data, node) = (&document.root.meshes[placed.mesh], &document.root.nodes[placed.node]);
        let name = node.name.as_ref().or(data.name.as_ref()).cloned();
        self.builder.group = self.builder.mesh.groups.len() as u32;
        self.builder.mesh.groups.push(name.unwrap_or_else(|| format!("mesh{}", placed.mesh)));
        let first_part = self.parts.len();
        for (k, primitive) in data.primitives.iter().enumerate() {
            match (primitive.mode.unwrap_or(4), primitive.attributes.get("POSITION")) {
                (4..=6, Some(&positions)) => self.vertices(placed, k, positions)?,
                (0..=3, _) => self.notes.count("sets of points or lines were passed over", None),
                _ => return Err(document.damaged("a primitive has no positions or an unknown mode".to_owned())),
            }
        }
        let mut pool = TexcoordPool::default();
        for part in first_part..self.parts.len() {
            self.triangles(part, &mut pool)?;
        }
        Ok(())
    }

    /// Adds the vertices of a primitive of triangles.
    fn vertices(&mut self, placed: &Placed, primitive: usize, positions: usize) -> Result<()> {
        let document = self.document;
        let data = &document.root.meshes[placed.mesh].primitives[primitive];
        let count = document.accessor(positions)?.count;
        let stored = document.vectors(positions, count)?;
        self.spend(count)?;
        let pose = Pose::new(document, &self.globals, placed.node, data, count, &mut self.notes)?;
        let first_vertex = self.builder.mesh.positions.len();
        self.builder.mesh.positions.extend(stored.iter().enumerate().map(|(v, &p)| pose.place(v, p)));
        let material = data.material.and_then(|m| document.root.materials.get(m));
        let set = self.uv_set.unwrap_or_else(|| material.map_or(0, gltf_materials::base_set));
        let placement = Placement { set };
        if let Some(colors) = gltf_colors::read(document, data)? {
            // Vertices of primitives without colours are white.
            self.builder.mesh.colors.resize(first_vertex, [1.0; 4]);
            self.builder.mesh.colors.extend(colors);
        }
        self.classes.extend(self.known.of(document, placed.mesh, data, &stored)?);
        let first_normal = self.normals(data, &pose, count)?;
        self.parts.push(Part {
            mesh: placed.mesh,
            primitive,
            node: placed.node,
            first_vertex,
            vertices: count,
            first_triangle: 0,
            triangles: 0,
            flipped: pose.reflects,
            first_normal,
            placement,
        });
        Ok(())
    }

    /// Adds the normals of a primitive; the number of the first, if there are any.
    fn normals(&mut self, primitive: &Primitive, pose: &Pose, count: usize) -> Result<Option<usize>> {
        let Some(&accessor) = primitive.attributes.get("NORMAL") else { return Ok(None) };
        let stored = self.document.vectors(accessor, count)?;
        let first = self.builder.mesh.normals.len();
        self.builder.mesh.normals.extend(stored.iter().enumerate().map(|(v, &n)| pose.normal(v, n)));
        Ok(Some(first))
    }

    /// Adds the triangles of a part whose vertices are there.
    fn triangles(&mut self, part: usize, pool: &mut TexcoordPool) -> Result<()> {
        let document = self.document;
        let Part { mesh, primitive, first_vertex, vertices, flipped, first_normal, .. } = self.parts[part];
        let data = &document.root.meshes[mesh].primitives[primitive];
        let placement = &self.parts[part].placement;
        let texcoords = match data.attributes.get(&format!("TEXCOORD_{}", placement.set)) {
            Some(&accessor) => document.numbers(accessor, 2)?,
            None => Vec::new(),
        };
        let elements = triangle_elements(document, data, vertices)?;
        self.spend(3 * elements.len())?;
        let placement = &self.parts[part].placement;
        let mut corner = |i: u32| {
            let (i, v) = (i as usize, first_vertex + i as usize);
            let uv = texcoords.get(2 * i..2 * i + 2).map(|uv| placement.apply(DVec2::new(uv[0], uv[1])));
            let texcoords = &mut self.builder.mesh.texcoords;
            let texcoord = uv.map_or(NONE, |uv| pool.add(self.classes[v], uv, texcoords));
            let normal = first_normal.map(|n| n + i).filter(|&n| self.builder.mesh.normals[n] != DVec3::ZERO);
            Corner { vertex: v as u32, texcoord, normal: normal.map_or(NONE, |n| n as u32) }
        };
        let corners: Vec<[Corner; 3]> = elements
            .into_iter()
            .map(|t| {
                let [a, b, c] = t.map(&mut corner);
                // A reflection turns triangles inside out.
                if flipped { [a, c, b] } else { [a, b, c] }
            })
            .collect();
        let known = data.material.filter(|m| *m < document.root.materials.len());
        self.builder.material = known.map_or(NONE, |m| m as u32);
        // Every polygon is a triangle.
        self.parts[part].first_triangle = self.builder.mesh.polygon_count();
        self.parts[part].triangles = corners.len();
        corners.into_iter().for_each(|triangle| self.builder.polygon(triangle));
        Ok(())
    }
}

/// The triangles of a primitive of `count` vertices, strips and fans cut up, as the file turns
/// them.
pub(super) fn triangle_elements(document: &Document, primitive: &Primitive, count: usize) -> Result<Vec<[u32; 3]>> {
    let indices: Vec<u32> = match primitive.indices {
        Some(accessor) => {
            let read = document.numbers(accessor, 1)?;
            if let Some(bad) = read.iter().find(|i| !(**i >= 0.0 && **i < count as f64)) {
                return Err(document.damaged(format!("a triangle refers to vertex {bad} of {count}")));
            }
            read.into_iter().map(|i| i as u32).collect()
        }
        None => (0..count as u32).collect(),
    };
    let mode = primitive.mode.unwrap_or(4);
    let triangles = if mode == 4 { indices.len() / 3 } else { indices.len().saturating_sub(2) };
    let corners = |t: usize| match mode {
        4 => [3 * t, 3 * t + 1, 3 * t + 2],
        5 if t % 2 == 1 => [t + 1, t, t + 2],
        5 => [t, t + 1, t + 2],
        _ => [0, t + 1, t + 2],
    };
    Ok((0..triangles).map(|t| corners(t).map(|k| indices[k])).collect())
}

/// Classes of vertices: those of one class are of one mesh and have equal stored positions and
/// morph targets.
#[derive(Default)]
struct Classes {
    /// The class of a mesh or class, and a stored position or displacement by a morph target.
    known: HashMap<(u32, [u64; 3]), u32>,
}

impl Classes {
    /// The class of each vertex of a primitive of a mesh.
    fn of(&mut self, document: &Document, mesh: usize, primitive: &Primitive, stored: &[DVec3]) -> Result<Vec<u32>> {
        // Meshes count from the other end: their numbers are no classes.
        let before = NONE - mesh as u32;
        let mut class = |before: u32, p: DVec3| {
            let next = self.known.len() as u32;
            // Adding zero makes -0 equal to 0.
            *self.known.entry((before, (p + DVec3::ZERO).to_array().map(f64::to_bits))).or_insert(next)
        };
        let mut classes: Vec<u32> = stored.iter().map(|&p| class(before, p)).collect();
        for target in &primitive.targets {
            let Some(&accessor) = target.get("POSITION") else { continue };
            let moved = document.vectors(accessor, stored.len())?;
            classes.iter_mut().zip(moved).filter(|(_, d)| *d != DVec3::ZERO).for_each(|(k, d)| *k = class(*k, d));
        }
        Ok(classes)
    }
}

/// Which texture coordinates of the file the mesh has. How pictures lie on them is said by the
/// materials.
#[derive(Debug)]
pub(super) struct Placement {
    pub(super) set: usize,
}

impl Placement {
    /// From glTF's v, which runs down from the top of the picture, to OBJ's, which runs up from the
    /// bottom.
    pub(super) fn apply(&self, uv: DVec2) -> DVec2 {
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
        value["meshes"] = json!([value["meshes"][0], value["meshes"][0]]);
        value["nodes"][2]["mesh"] = 1.into();
        let mesh = read(&value).unwrap().mesh;
        assert_eq!((mesh.triangle_count(), mesh.vertex_count()), (2, 6));
        assert!(mesh.positions[1].distance(DVec3::new(0.0, 2.0, 5.0)) < 1e-6);
        assert!(mesh.positions[3].distance(DVec3::new(0.0, 7.0, 5.0)) < 1e-6);
        assert_eq!(mesh.triangle(1), [3, 5, 4]);
        assert!(mesh.triangle_area_normal(0).z > 0.0 && mesh.triangle_area_normal(1).z > 0.0);
    }

    #[test]
    fn a_mesh_of_several_nodes_is_taken_at_the_first_and_the_others_are_named() {
        let mut value = triangle();
        value["nodes"] = json!([
            {"name": "left", "mesh": 0, "translation": [1, 0, 0]}, {"name": "right", "mesh": 0}, {"mesh": 0}]);
        value["scenes"][0]["nodes"] = json!([1, 0, 2]);
        let loaded = read(&value).unwrap();
        assert_eq!((loaded.mesh.vertex_count(), loaded.mesh.positions[0]), (3, DVec3::ZERO));
        let said = &loaded.warnings[0];
        assert!(
            said.contains("3 nodes") && said.contains("at node 1 (\"right\"), not at node 0 (\"left\"), node 2"),
            "{said}"
        );
    }

    #[test]
    fn strips_fans_and_sparse_data() {
        let mut value = triangle();
        value["meshes"][0]["primitives"][0]["mode"] = 5.into();
        value["accessors"][0]["sparse"] = json!({"count": 1,
            "indices": {"bufferView": 0, "byteOffset": 37, "componentType": 5121}, "values": {"bufferView": 0, "byteOffset": 24}});
        let mesh = read(&value).unwrap().mesh;
        assert_eq!(mesh.triangles(), [[0, 1, 2]], "numbers are those of the file");
        assert_eq!(mesh.positions[1], mesh.positions[2], "vertex 1 is moved onto vertex 2");
    }

    #[test]
    fn faults_are_named() {
        for (pointer, new, expected) in [
            ("/extensionsRequired", json!(["KHR_texture_basisu"]), "ktxdecompress"),
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
        // Few bytes must not become many vertices.
        let mut many = triangle();
        many["meshes"] = json!([{"primitives": vec![triangle()["meshes"][0]["primitives"][0].clone(); 1000]}]);
        assert!(read(&many).is_ok());
        let mut zeros = triangle();
        zeros["meshes"] = json!([{"primitives": vec![json!({"attributes": {"POSITION": 2}, "indices": 1}); 10_000]}]);
        zeros["accessors"]
            .as_array_mut()
            .unwrap()
            .push(json!({"componentType": 5126, "count": 2000, "type": "VEC3", "sparse": {"count": 1,
            "indices": {"bufferView": 0, "byteOffset": 37, "componentType": 5121}, "values": {"bufferView": 0}}}));
        assert!(read(&zeros).unwrap_err().to_string().contains("expand"));
    }
}
