//! The materials of a glTF file: factors, and textures by role.

use std::collections::hash_map::{Entry, HashMap};
use std::sync::Arc;

use super::gltf_document::{Document, MaterialData, TextureUse};
use super::source::Notes;
use crate::Result;
use crate::geometry::Material;
use crate::geometry::material::{AlphaMode, BASE_COLOR, Look, RoleTexture, TextureContent};

/// All materials, in file order. Textures of other sets of texture coordinates than the base colour's cannot be carried and are left out.
pub(super) fn read(document: &Document<'_>, notes: &mut Notes) -> Result<Vec<Material>> {
    let mut images = HashMap::new();
    let materials = document.root.materials.iter().enumerate();
    materials.map(|(k, data)| material(document, k, data, &mut images, notes)).collect()
}

fn material(
    document: &Document<'_>,
    k: usize,
    data: &MaterialData,
    images: &mut HashMap<usize, Option<Arc<[u8]>>>,
    notes: &mut Notes,
) -> Result<Material> {
    let name = data.name.clone().unwrap_or_else(|| format!("material{k}"));
    let mut material = Material { name, look: look(data), ..Material::default() };
    let pbr = data.pbr_metallic_roughness.as_ref();
    material.base_color = pbr.and_then(|p| p.base_color_factor).unwrap_or([1.0; 4]);
    let base = pbr.and_then(|p| p.base_color_texture.as_ref());
    let others = [
        (BASE_COLOR, base),
        ("metallic_roughness", pbr.and_then(|p| p.metallic_roughness_texture.as_ref())),
        ("normal", data.normal_texture.as_ref()),
        ("occlusion", data.occlusion_texture.as_ref()),
        ("emissive", data.emissive_texture.as_ref()),
    ];
    // What the mesh's one set of texture coordinates is made from: the base colour's, or the first without one.
    let placed = base.map_or((0, None), placement);
    for (role, used) in others.into_iter().filter_map(|(role, used)| used.map(|u| (role, u))) {
        if role != BASE_COLOR && placement(used) != placed {
            notes.say(format!(
                "material {:?}: its {role} texture has texture coordinates of its own and is left out",
                material.name
            ));
            continue;
        }
        let Some(image) = document.root.textures.get(used.index).and_then(|t| t.source) else {
            notes.say(format!("material {:?}: its {role} texture is stored in a way that is not read", material.name));
            continue;
        };
        let embedded = match images.entry(image) {
            Entry::Occupied(known) => known.get().clone(),
            Entry::Vacant(new) => new.insert(document.embedded_image(image)?).clone(),
        };
        let content = match (embedded, &document.root.images[image].uri) {
            (Some(bytes), _) => TextureContent::Embedded(bytes),
            (None, Some(uri)) => {
                let file = document.file(uri)?;
                if !file.is_file() {
                    notes.say(format!("the texture {} does not exist", file.display()));
                }
                TextureContent::File(file)
            }
            (None, None) => continue,
        };
        match content {
            TextureContent::Embedded(bytes) if role == BASE_COLOR => material.embedded_texture = Some(bytes),
            TextureContent::File(file) if role == BASE_COLOR => material.base_color_texture = Some(file),
            content => material.textures.push(RoleTexture { role: role.to_owned(), content }),
        }
    }
    Ok(material)
}

/// The set of texture coordinates a texture uses, and how they are moved.
fn placement(used: &TextureUse) -> (usize, Option<&serde_json::Value>) {
    (used.tex_coord, used.extensions.get("KHR_texture_transform"))
}

/// Factors; what is left out has the format's defaults.
fn look(data: &MaterialData) -> Look {
    let pbr = data.pbr_metallic_roughness.as_ref();
    Look {
        metallic: pbr.and_then(|p| p.metallic_factor).unwrap_or(1.0),
        roughness: pbr.and_then(|p| p.roughness_factor).unwrap_or(1.0),
        emissive: data.emissive_factor.unwrap_or_default(),
        normal_scale: data.normal_texture.as_ref().and_then(|t| t.scale).unwrap_or(1.0),
        occlusion_strength: data.occlusion_texture.as_ref().and_then(|t| t.strength).unwrap_or(1.0),
        alpha: match data.alpha_mode.as_deref() {
            Some("MASK") => AlphaMode::Mask(data.alpha_cutoff.unwrap_or(0.5)),
            Some("BLEND") => AlphaMode::Blend,
            _ => AlphaMode::Opaque,
        },
        double_sided: data.double_sided,
    }
}
