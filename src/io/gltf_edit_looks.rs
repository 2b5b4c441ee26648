//! New materials for the meshes of a scene: those of the file with the textures that are new, and
//! what goes with them.

use std::collections::{BTreeMap, HashMap, VecDeque};
use std::sync::Arc;

use serde_json::{Value, json};

use super::gltf_edit::{Edit, drop_extension, list_of, picture_kind};
use super::gltf_edit_uv::{Coordinates, set_indices, textures};
use super::gltf_scene::GltfScene;
use super::gltf_write::{GlbMaterial, look, repeating};

/// A new material: which entry of the list, on which of the file, and where its textures lie.
#[derive(Clone, PartialEq)]
struct Dress {
    entry: usize,
    material: Option<usize>,
    /// What references to textures have beside the texture.
    place: Value,
}

/// The triangles of a part that get the same new material, or keep theirs.
struct Group {
    dress: Option<usize>,
    triangles: Vec<[u32; 3]>,
}

/// Dresses the triangles `t` of the mesh in `materials[of[t]]`; those whose entry is beyond the
/// list keep what they have.
///
/// A material of the file keeps what is not replaced: textures in other roles, factors that go with
/// them, extensions.
/// Where all that use it change alike, it is changed in its place; so are textures that nothing
/// uses any more.
pub(super) fn set_materials(
    edit: &mut Edit<'_>,
    scene: &GltfScene,
    coordinates: &[Coordinates],
    materials: &[GlbMaterial],
    of: &[u32],
) {
    let mut dresses: Vec<Dress> = Vec::new();
    let mut plan: Vec<Vec<Group>> = Vec::new();
    for (part, coordinates) in scene.parts.iter().zip(coordinates) {
        let material = scene.document.root.meshes[part.mesh].primitives[part.primitive].material;
        let place = place(coordinates);
        let mut groups: Vec<Group> = Vec::new();
        for (triangle, t) in coordinates.elements.iter().zip(part.first_triangle..) {
            let entry = of.get(t).map(|&e| e as usize).filter(|&e| e < materials.len());
            let dress = entry.map(|entry| {
                let dress = Dress { entry, material, place: place.clone() };
                dresses.iter().position(|d| *d == dress).unwrap_or_else(|| {
                    dresses.push(dress);
                    dresses.len() - 1
                })
            });
            match groups.iter_mut().find(|g| g.dress == dress) {
                Some(group) => group.triangles.push(*triangle),
                None => groups.push(Group { dress, triangles: vec![*triangle] }),
            }
        }
        plan.push(groups);
    }
    let numbers = install(edit, &dresses, &plan, materials);
    for (part, groups) in scene.parts.iter().zip(&plan) {
        let split = groups.len() > 1;
        let original = edit.primitive(part.mesh, part.primitive).clone();
        let old = original["indices"].as_u64().map(|k| k as usize);
        for (g, group) in groups.iter().enumerate() {
            let mut place = part.primitive;
            if g > 0 {
                let primitives = list_of(&mut edit.json["meshes"][part.mesh], "primitives");
                primitives.push(original.clone());
                place = primitives.len() - 1;
            }
            if split {
                set_indices(edit, part.mesh, place, if g == 0 { old } else { None }, &group.triangles);
                edit.drop_draco(part.mesh, place);
            }
            if let Some(dress) = group.dress {
                edit.primitive(part.mesh, place)["material"] = numbers[dress].into();
            }
        }
    }
}

/// What a reference to a new texture has beside it: the set of coordinates.
fn place(coordinates: &Coordinates) -> Value {
    if coordinates.set > 0 { json!({"texCoord": coordinates.set}) } else { json!({}) }
}

/// Writes the new materials; the number of each.
fn install(edit: &mut Edit<'_>, dresses: &[Dress], plan: &[Vec<Group>], materials: &[GlbMaterial]) -> Vec<usize> {
    let before = texture_users(&edit.json);
    let users = material_users(&edit.json);
    let redirected = |m: usize| {
        let all = plan.iter().filter(|groups| {
            groups.iter().any(|g| g.dress.is_some_and(|d| dresses[d].material == Some(m)))
                && groups.iter().all(|g| g.dress.is_some())
        });
        all.count()
    };
    let mut numbers = Vec::new();
    for dress in dresses {
        let new = &materials[dress.entry];
        let old = dress.material.and_then(|m| edit.json["materials"].get(m)).cloned();
        let alone = dresses.iter().filter(|d| d.material == dress.material).count() == 1;
        let own = dress.material.filter(|&m| alone && users.get(&m) == Some(&redirected(m)));
        let stripped = match old {
            Some(mut old) => {
                strip(&mut old, new);
                if own.is_none() {
                    old["name"] = new.name.clone().into();
                }
                old
            }
            None => Value::Null,
        };
        let list = list_of(&mut edit.json, "materials");
        match own.filter(|&m| m < list.len()) {
            Some(m) => {
                list[m] = stripped;
                numbers.push(m);
            }
            None => {
                list.push(stripped);
                numbers.push(list.len() - 1);
            }
        }
    }
    let after = texture_users(&edit.json);
    let mut pictures = Pictures {
        free: before.keys().filter(|k| !after.contains_key(*k)).copied().collect(),
        known: HashMap::new(),
        reused: Vec::new(),
    };
    for (dress, &number) in dresses.iter().zip(&numbers) {
        let new = &materials[dress.entry];
        let fresh = look(new, &mut |bytes| {
            let mut info = dress.place.clone();
            info["index"] = pictures.texture(edit, bytes).into();
            info
        });
        let description = &mut edit.json["materials"][number];
        if description.is_null() { *description = fresh } else { merge(description, fresh, new) }
    }
    numbers
}

/// References to each material, by primitives and their variants.
fn material_users(json: &Value) -> BTreeMap<usize, usize> {
    fn count(value: &Value, users: &mut BTreeMap<usize, usize>) {
        match value {
            Value::Array(list) => list.iter().for_each(|v| count(v, users)),
            Value::Object(entries) => {
                for (key, v) in entries.iter().filter(|(key, _)| *key != "extras") {
                    match v.as_u64().filter(|_| key == "material") {
                        Some(m) => *users.entry(m as usize).or_default() += 1,
                        None => count(v, users),
                    }
                }
            }
            _ => {}
        }
    }
    let mut users = BTreeMap::new();
    count(&json["meshes"], &mut users);
    users
}

/// References to each texture by materials.
fn texture_users(json: &Value) -> BTreeMap<usize, usize> {
    let mut users = BTreeMap::new();
    for material in json["materials"].as_array().into_iter().flatten() {
        textures(material, "", &mut |_, info| {
            if let Some(k) = info["index"].as_u64() {
                *users.entry(k as usize).or_default() += 1;
            }
        });
    }
    users
}

/// Where the textures of roles are in a material.
const PLACES: [(&str, &str); 4] = [
    ("metallic_roughness", "metallicRoughnessTexture"),
    ("normal", "normalTexture"),
    ("occlusion", "occlusionTexture"),
    ("emissive", "emissiveTexture"),
];

/// Takes away what `new` replaces.
fn strip(old: &mut Value, new: &GlbMaterial) {
    let mut remove = |path: &str, key: &str| {
        if let Some(object) = old.pointer_mut(path).and_then(Value::as_object_mut) {
            object.remove(key);
        }
    };
    if new.texture.is_some() {
        remove("/pbrMetallicRoughness", "baseColorTexture");
        remove("/pbrMetallicRoughness", "baseColorFactor");
        remove("", "alphaMode");
        remove("", "alphaCutoff");
    }
    for (role, _) in &new.textures {
        for (_, key) in PLACES.iter().filter(|(name, _)| name == role) {
            remove(if *role == "metallic_roughness" { "/pbrMetallicRoughness" } else { "" }, key);
        }
    }
    if new.texture.is_some() {
        drop_extension(old, "KHR_materials_pbrSpecularGlossiness");
    }
}

/// Puts in what `new` has, from its description.
fn merge(old: &mut Value, mut fresh: Value, new: &GlbMaterial) {
    let mut take = |old: &mut Value, group: Option<&str>, keys: &[&str]| {
        for key in keys {
            let value = match group {
                Some(group) => fresh[group].get_mut(*key),
                None => fresh.get_mut(*key),
            };
            let Some(value) = value.map(Value::take) else { continue };
            match group {
                Some(group) => old[group][*key] = value,
                None => old[*key] = value,
            }
        }
    };
    let pbr = Some("pbrMetallicRoughness");
    if new.texture.is_some() {
        take(old, pbr, &["baseColorTexture", "baseColorFactor"]);
        take(old, None, &["alphaMode", "alphaCutoff"]);
    }
    for (role, _) in &new.textures {
        match role.as_str() {
            "metallic_roughness" => take(old, pbr, &["metallicRoughnessTexture", "metallicFactor", "roughnessFactor"]),
            "normal" => take(old, None, &["normalTexture"]),
            "occlusion" => take(old, None, &["occlusionTexture"]),
            "emissive" => take(old, None, &["emissiveTexture", "emissiveFactor"]),
            _ => {}
        }
    }
}

/// The pictures that are written.
struct Pictures {
    /// Textures that nothing uses any more.
    free: VecDeque<usize>,
    /// The texture of each picture.
    known: HashMap<Arc<[u8]>, usize>,
    /// Images whose place was taken.
    reused: Vec<usize>,
}

impl Pictures {
    /// The number of the texture with this picture, written once.
    fn texture(&mut self, edit: &mut Edit<'_>, bytes: &Arc<[u8]>) -> usize {
        if let Some(&k) = self.known.get(bytes) {
            return k;
        }
        let view = edit.view(bytes.to_vec(), None, None);
        let image = json!({"bufferView": view, "mimeType": picture_kind(bytes)});
        let free = self.free.pop_front();
        let place = free.and_then(|t| self.free_image(edit, t));
        let images = list_of(&mut edit.json, "images");
        let source = match place {
            Some(k) => {
                images[k] = image;
                self.reused.push(k);
                k
            }
            None => {
                images.push(image);
                images.len() - 1
            }
        };
        let samplers = list_of(&mut edit.json, "samplers");
        let sampler = samplers.iter().position(|s| *s == repeating()).unwrap_or_else(|| {
            samplers.push(repeating());
            samplers.len() - 1
        });
        let texture = json!({"sampler": sampler, "source": source});
        let list = list_of(&mut edit.json, "textures");
        let k = match free.filter(|&k| k < list.len()) {
            Some(k) => {
                list[k] = texture;
                k
            }
            None => {
                list.push(texture);
                list.len() - 1
            }
        };
        self.known.insert(bytes.clone(), k);
        k
    }

    /// The image of a texture that nothing uses, if no other texture has it.
    fn free_image(&self, edit: &Edit<'_>, texture: usize) -> Option<usize> {
        let textures = edit.json["textures"].as_array()?;
        let source = textures.get(texture)?["source"].as_u64()?;
        let image = source as usize;
        let users = textures.iter().filter(|t| uses_image(t, source)).count();
        let there = image < edit.json["images"].as_array()?.len();
        (users == 1 && there && !self.reused.contains(&image)).then_some(image)
    }
}

/// Whether a texture shows an image, in whatever encoding.
fn uses_image(texture: &Value, image: u64) -> bool {
    let mut encoded = texture["extensions"].as_object().into_iter().flatten();
    texture["source"].as_u64() == Some(image) || encoded.any(|(_, e)| e["source"].as_u64() == Some(image))
}
