//! New materials for the meshes of a scene: those of the file with the textures that are new, and
//! what goes with them.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use super::gltf_edit::{Edit, drop_extension, forget_extension, list_of};
use super::gltf_edit_pictures::{Pictures, drop_pictures, texture_users};
use super::gltf_edit_uv::{Coordinates, set_indices};
use super::gltf_look::{GlbMaterial, declare_transform, look, transform};
use super::gltf_scene::GltfScene;

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
    let mut pictures = Pictures::new(before.keys().filter(|k| !after.contains_key(*k)).copied().collect());
    for (dress, &number) in dresses.iter().zip(&numbers) {
        let new = &materials[dress.entry];
        let fresh = look(new, &mut |picture| {
            let mut info = dress.place.clone();
            info["index"] = pictures.texture(edit, picture).into();
            if let Some(transform) = transform(&picture.placement) {
                info["extensions"] = transform;
                declare_transform(&mut edit.json);
            }
            info
        });
        let description = &mut edit.json["materials"][number];
        if description.is_null() { *description = fresh } else { merge(description, fresh, new) }
    }
    drop_pictures(edit, &before.into_keys().collect::<Vec<_>>());
    if !edit.json["materials"].to_string().contains(GLOSSINESS) {
        forget_extension(&mut edit.json, GLOSSINESS);
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
        drop_glossiness(old);
    }
}

/// The name of an older model of materials.
const GLOSSINESS: &str = "KHR_materials_pbrSpecularGlossiness";

/// Takes the older model of a material off it: the diffuse colour of that is no metal, and as rough
/// as it is not glossy.
fn drop_glossiness(old: &mut Value) {
    let Some(glossy) = old.get("extensions").and_then(|e| e.get(GLOSSINESS)) else { return };
    let roughness = 1.0 - glossy["glossinessFactor"].as_f64().unwrap_or(1.0);
    drop_extension(old, GLOSSINESS);
    old["pbrMetallicRoughness"]["metallicFactor"] = 0.0.into();
    old["pbrMetallicRoughness"]["roughnessFactor"] = roughness.into();
    if let Some(pbr) = old["pbrMetallicRoughness"].as_object_mut() {
        pbr.remove("metallicRoughnessTexture");
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
