//! The pictures of a scene whose materials change: new ones take the places of those that nothing
//! shows any more, and what is left of these goes.

use std::collections::{BTreeMap, HashMap, VecDeque};
use std::sync::Arc;

use serde_json::{Value, json};

use super::gltf_edit::{Edit, list_of, picture_kind};
use super::gltf_edit_uv::textures;
use super::gltf_look::{GlbTexture, number_of, sampler};

/// References to each texture by materials.
pub(super) fn texture_users(json: &Value) -> BTreeMap<usize, usize> {
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

/// The pictures that are written.
pub(super) struct Pictures {
    /// Textures that nothing uses any more.
    free: VecDeque<usize>,
    /// The image of each picture.
    known: HashMap<Arc<[u8]>, usize>,
    /// The texture of each image and sampler.
    textures: HashMap<[usize; 2], usize>,
    /// Images whose place was taken.
    reused: Vec<usize>,
}

impl Pictures {
    /// None yet; the places of `free` textures may be taken.
    pub(super) fn new(free: VecDeque<usize>) -> Self {
        Self { free, known: HashMap::new(), textures: HashMap::new(), reused: Vec::new() }
    }

    /// The number of the texture with this picture, written once.
    pub(super) fn texture(&mut self, edit: &mut Edit<'_>, picture: &GlbTexture) -> usize {
        let sampler = number_of(list_of(&mut edit.json, "samplers"), sampler(picture.placement.wrap));
        let known = self.known.get(&picture.bytes).copied();
        if let Some(&k) = known.and_then(|image| self.textures.get(&[image, sampler])) {
            return k;
        }
        let free = self.free.pop_front();
        let image = known.unwrap_or_else(|| self.image(edit, &picture.bytes, free));
        let texture = json!({"sampler": sampler, "source": image});
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
        self.textures.insert([image, sampler], k);
        k
    }

    /// Writes an image, in the place of that of a texture that is free, if it can be; its number.
    fn image(&mut self, edit: &mut Edit<'_>, bytes: &Arc<[u8]>, free: Option<usize>) -> usize {
        let view = edit.view(bytes.to_vec(), None, None);
        let image = json!({"bufferView": view, "mimeType": picture_kind(bytes)});
        let place = free.and_then(|t| self.free_image(edit, t));
        let images = list_of(&mut edit.json, "images");
        let k = match place {
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

/// Extensions of a whole document that refer to no textures.
const WITHOUT_TEXTURES: [&str; 4] =
    ["KHR_lights_punctual", "KHR_materials_variants", "KHR_xmp_json_ld", "EXT_structural_metadata"];

/// Removes those of the `textures` that no material uses any more, with the images that only they
/// show. Extensions that may refer to textures in ways of their own keep all in their places.
pub(super) fn drop_pictures(edit: &mut Edit<'_>, textures: &[usize]) {
    let mut extensions = edit.json["extensions"].as_object().into_iter().flatten();
    if extensions.any(|(name, _)| !WITHOUT_TEXTURES.contains(&name.as_str())) {
        return;
    }
    let used = texture_users(&edit.json);
    let gone: Vec<usize> = textures.iter().copied().filter(|k| !used.contains_key(k)).collect();
    if gone.is_empty() {
        return;
    }
    let shown = |edit: &Edit<'_>, image: usize| {
        edit.json["textures"].as_array().into_iter().flatten().any(|t| uses_image(t, image as u64))
    };
    let images = edit.json["images"].as_array().map_or(0, Vec::len);
    let before: Vec<bool> = (0..images).map(|k| shown(edit, k)).collect();
    let numbers = remove(list_of(&mut edit.json, "textures"), |k| gone.contains(&k));
    for material in list_of(&mut edit.json, "materials") {
        renumber_textures(material, "", &numbers);
    }
    let after: Vec<bool> = (0..images).map(|k| shown(edit, k)).collect();
    let numbers = remove(list_of(&mut edit.json, "images"), |k| before[k] && !after[k]);
    for texture in list_of(&mut edit.json, "textures") {
        renumber(texture, "source", &numbers);
        for (_, encoded) in texture.get_mut("extensions").and_then(Value::as_object_mut).into_iter().flatten() {
            renumber(encoded, "source", &numbers);
        }
    }
    for list in ["textures", "images"] {
        // The format forbids empty lists.
        if edit.json[list].as_array().is_some_and(Vec::is_empty)
            && let Some(root) = edit.json.as_object_mut()
        {
            root.remove(list);
        }
    }
}

/// Removes entries of a list; the new number of each.
fn remove(list: &mut Vec<Value>, gone: impl Fn(usize) -> bool) -> Vec<Option<usize>> {
    let mut kept = 0;
    let number = |k: usize| {
        let number = (!gone(k)).then_some(kept);
        kept += usize::from(number.is_some());
        number
    };
    let numbers: Vec<Option<usize>> = (0..list.len()).map(number).collect();
    let mut k = 0;
    list.retain(|_| {
        k += 1;
        numbers[k - 1].is_some()
    });
    numbers
}

fn renumber(value: &mut Value, key: &str, numbers: &[Option<usize>]) {
    let old = value[key].as_u64().and_then(|k| *numbers.get(k as usize)?);
    if let Some(new) = old {
        value[key] = new.into();
    }
}

/// The references that [`textures`] visits.
fn renumber_textures(value: &mut Value, key: &str, numbers: &[Option<usize>]) {
    if key.ends_with("Texture") && value["index"].is_u64() {
        return renumber(value, "index", numbers);
    }
    for (key, v) in value.as_object_mut().into_iter().flatten().filter(|(key, _)| *key != "extras") {
        renumber_textures(v, key, numbers);
    }
}
