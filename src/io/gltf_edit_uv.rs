//! New texture coordinates for the meshes of a scene. A vertex with several becomes several
//! vertices, each with all that the one had: normals, tangents, colours, joints, weights and morph
//! targets.

use std::collections::HashMap;

use glam::DVec2;
use serde_json::{Value, json};

use super::gltf_document::Primitive;
use super::gltf_edit::{Edit, Elements};
use super::gltf_parts::{ARRAY, ELEMENTS, UNSIGNED_INT};
use super::gltf_read::triangle_elements;
use super::gltf_scene::{GltfScene, Part};
use crate::Result;
use crate::geometry::{Mesh, NONE};

/// What becomes of the textures that a primitive has.
#[derive(Clone, Copy, Debug)]
pub enum KeepTextures<'r> {
    /// New coordinates replace the old ones, whether pictures fit them or not.
    No,
    /// Pictures in other roles than these stay, with the coordinates they have.
    But(&'r [&'r str]),
}

/// The texture coordinates of a part as they are written.
#[derive(Debug)]
pub(super) struct Coordinates {
    /// The set.
    pub(super) set: usize,
    /// The triangles, as the file turns them.
    pub(super) elements: Vec<[u32; 3]>,
}

/// Gives the scene the texture coordinates of `mesh`, where they differ from those that were read.
pub(super) fn set_texcoords(
    edit: &mut Edit<'_>,
    scene: &GltfScene,
    mesh: &Mesh,
    keep: KeepTextures<'_>,
) -> Result<Vec<Coordinates>> {
    let mut all = Vec::new();
    for part in &scene.parts {
        let document = &scene.document;
        let primitive = &document.root.meshes[part.mesh].primitives[part.primitive];
        let elements = triangle_elements(document, primitive, part.vertices)?;
        let wanted = wanted(mesh, part);
        let set = part.placement.set;
        let old = match primitive.attributes.get(&format!("TEXCOORD_{set}")) {
            Some(&accessor) => document.numbers(accessor, 2)?,
            None => Vec::new(),
        };
        let read = |element: u32| {
            let uv = old.get(2 * element as usize..2 * element as usize + 2)?;
            let uv = part.placement.apply(DVec2::new(uv[0], uv[1]));
            uv.is_finite().then_some(uv)
        };
        let same = elements.iter().zip(&wanted).all(|(e, w)| (0..3).all(|k| read(e[k]) == w[k]));
        if same || wanted.iter().flatten().all(Option::is_none) {
            all.push(Coordinates { set, elements });
            continue;
        }
        let set = free_set(edit, part, primitive, keep);
        let split = Split::new(part.vertices, &elements, &wanted);
        split.write(edit, part, primitive, set)?;
        all.push(Coordinates { set, elements: split.elements });
    }
    Ok(all)
}

/// The texture coordinates of the mesh at the corners of a part's triangles, in the order of the
/// file.
fn wanted(mesh: &Mesh, part: &Part) -> Vec<[Option<DVec2>; 3]> {
    let triangles = part.first_triangle..part.first_triangle + part.triangles;
    let corners = |t: usize| {
        let [a, b, c] =
            mesh.file_triangle(t).map(|c| (c.texcoord != NONE).then(|| mesh.texcoords[c.texcoord as usize]));
        if part.flipped { [a, c, b] } else { [a, b, c] }
    };
    triangles.map(corners).collect()
}

/// The set for new coordinates: that of the old ones, or one more where textures that stay need
/// those.
fn free_set(edit: &mut Edit<'_>, part: &Part, primitive: &Primitive, keep: KeepTextures<'_>) -> usize {
    let set = part.placement.set;
    let Some(material) = primitive.material else { return set };
    let Some(description) = edit.document.json["materials"].get(material) else { return set };
    let mut others = Vec::new();
    textures(description, "", &mut |role, info| {
        let replaced = matches!(keep, KeepTextures::But(roles) if roles.contains(&role));
        if !replaced && texture_set(info) == set {
            others.push(role.to_owned());
        }
    });
    if others.is_empty() {
        return set;
    }
    if matches!(keep, KeepTextures::No) {
        let name = description["name"].as_str().map_or_else(|| format!("material {material}"), |n| format!("{n:?}"));
        let note = format!(
            "the textures of {} ({}) were made for the texture coordinates that are replaced",
            super::obj::shortened(&name),
            others.join(", ")
        );
        if !edit.notes.contains(&note) {
            edit.notes.push(note);
        }
        return set;
    }
    let meshes = edit.document.root.meshes.iter().flat_map(|m| &m.primitives);
    let sets = meshes.filter(|p| p.material == Some(material)).flat_map(|p| p.attributes.keys());
    let last = sets.filter_map(|name| name.strip_prefix("TEXCOORD_")?.parse::<usize>().ok()).max();
    last.map_or(0, |last| last + 1)
}

/// Visits the references to textures in a material, with their roles.
pub(super) fn textures(value: &Value, key: &str, visit: &mut dyn FnMut(&str, &Value)) {
    let Some(entries) = value.as_object() else { return };
    if key.ends_with("Texture") && value["index"].is_u64() {
        visit(role(key), value);
        return;
    }
    entries.iter().filter(|(key, _)| *key != "extras").for_each(|(key, v)| textures(v, key, visit));
}

/// The role of a texture by its place in a material; the place itself where it is none of the
/// known.
fn role(key: &str) -> &str {
    match key {
        "baseColorTexture" => "base_color",
        "metallicRoughnessTexture" => "metallic_roughness",
        "normalTexture" => "normal",
        "occlusionTexture" => "occlusion",
        "emissiveTexture" => "emissive",
        other => other,
    }
}

/// The set of texture coordinates that a reference to a texture uses.
fn texture_set(info: &Value) -> usize {
    let by_transform = info["extensions"]["KHR_texture_transform"]["texCoord"].as_u64();
    by_transform.or_else(|| info["texCoord"].as_u64()).unwrap_or(0) as usize
}

/// The vertices of a part with one texture coordinate each.
struct Split {
    /// For each vertex the one of the file that it comes from; those of the file come first, in
    /// their order.
    sources: Vec<u32>,
    texcoords: Vec<[f32; 2]>,
    elements: Vec<[u32; 3]>,
}

impl Split {
    fn new(count: usize, elements: &[[u32; 3]], wanted: &[[Option<DVec2>; 3]]) -> Self {
        let mut sources: Vec<u32> = (0..count as u32).collect();
        let mut texcoords: Vec<Option<[f32; 2]>> = vec![None; count];
        let mut copies: HashMap<(u32, [u32; 2]), u32> = HashMap::new();
        let mut new = Vec::with_capacity(elements.len());
        for (element, uv) in elements.iter().zip(wanted) {
            new.push([0, 1, 2].map(|k| {
                // The format's v runs down from the top of the picture.
                let uv = uv[k].map_or([0.0; 2], |uv| [uv.x as f32, (1.0 - uv.y) as f32]);
                let v = element[k];
                if *texcoords[v as usize].get_or_insert(uv) == uv {
                    return v;
                }
                *copies.entry((v, uv.map(f32::to_bits))).or_insert_with(|| {
                    sources.push(v);
                    texcoords.push(Some(uv));
                    sources.len() as u32 - 1
                })
            }));
        }
        let texcoords = texcoords.into_iter().map(Option::unwrap_or_default).collect();
        Self { sources, texcoords, elements: new }
    }

    fn write(&self, edit: &mut Edit<'_>, part: &Part, primitive: &Primitive, set: usize) -> Result<()> {
        let name = format!("TEXCOORD_{set}");
        if self.sources.len() > part.vertices {
            let mut names: Vec<&String> = primitive.attributes.keys().filter(|n| **n != name).collect();
            names.sort();
            for other in names {
                let k = self.gather(edit, primitive.attributes[other])?;
                edit.primitive(part.mesh, part.primitive)["attributes"][other] = k.into();
            }
            for (t, target) in primitive.targets.iter().enumerate() {
                let mut names: Vec<&String> = target.keys().collect();
                names.sort();
                for other in names {
                    let k = self.gather(edit, target[other])?;
                    edit.primitive(part.mesh, part.primitive)["targets"][t][other] = k.into();
                }
            }
            set_indices(edit, part.mesh, part.primitive, primitive.indices, &self.elements);
        }
        let k = edit.floats(primitive.attributes.get(&name).copied(), self.texcoords.as_flattened(), "VEC2", false)?;
        edit.primitive(part.mesh, part.primitive)["attributes"][&name] = k.into();
        Ok(())
    }

    /// The accessor `k` with the elements of the copies behind its own.
    fn gather(&self, edit: &mut Edit<'_>, k: usize) -> Result<usize> {
        let (bytes, width) = edit.document.raw(k)?;
        let accessor = edit.document.accessor(k)?;
        let mut all = Vec::with_capacity(width * self.sources.len());
        for &v in &self.sources {
            let element = bytes.get(width * v as usize..width * (v as usize + 1));
            all.extend_from_slice(element.ok_or_else(|| {
                edit.document.damaged(format!("accessor {k} has {} elements, not one a vertex", accessor.count))
            })?);
        }
        let kept = ["min", "max"].map(|key| (key, edit.document.json["accessors"][k].get(key).cloned()));
        let count = self.sources.len();
        let new = if accessor.sparse.is_some() && accessor.buffer_view.is_none() {
            let (component, shape) = (accessor.component_type, accessor.shape.as_str());
            let mut value = json!({"componentType": component, "count": count, "type": shape});
            let moved: Vec<u32> =
                (0..count as u32).filter(|&v| all[width * v as usize..][..width].iter().any(|b| *b != 0)).collect();
            if !moved.is_empty() {
                let indices = edit.view(moved.iter().flat_map(|v| v.to_le_bytes()).collect(), None, None);
                let picked = moved.iter().flat_map(|&v| all[width * v as usize..][..width].to_vec()).collect();
                let values = edit.view(picked, None, None);
                value["sparse"] = json!({
                    "count": moved.len(),
                    "indices": {"bufferView": indices, "componentType": UNSIGNED_INT},
                    "values": {"bufferView": values},
                });
            }
            edit.put(Some(k), value)
        } else {
            let new = Elements {
                bytes: &all,
                count,
                component: accessor.component_type,
                shape: &accessor.shape,
                normalized: accessor.normalized,
                target: Some(ARRAY),
            };
            edit.replace(Some(k), &new)
        };
        for (key, value) in kept {
            if let Some(value) = value {
                edit.json["accessors"][new][key] = value;
            }
        }
        Ok(new)
    }
}

/// Gives a primitive these triangles.
pub(super) fn set_indices(
    edit: &mut Edit<'_>,
    mesh: usize,
    primitive: usize,
    old: Option<usize>,
    elements: &[[u32; 3]],
) {
    let flat = elements.as_flattened();
    let short = flat.iter().all(|&i| i < 0xffff);
    let bytes: Vec<u8> = if short {
        flat.iter().flat_map(|&i| (i as u16).to_le_bytes()).collect()
    } else {
        flat.iter().flat_map(|i| i.to_le_bytes()).collect()
    };
    let component = if short { 5123 } else { UNSIGNED_INT };
    let new = Elements {
        bytes: &bytes,
        count: flat.len(),
        component,
        shape: "SCALAR",
        normalized: false,
        target: Some(ELEMENTS),
    };
    let k = edit.replace(old, &new);
    let description = edit.primitive(mesh, primitive);
    description["indices"] = k.into();
    if let Some(description) = description.as_object_mut() {
        // Strips and fans are cut up.
        description.remove("mode");
    }
}
