//! The materials of a glTF file: factors, and textures by role with the way they lie on the
//! surface.

use std::collections::hash_map::{Entry, HashMap};
use std::sync::Arc;

use glam::DVec2;
use serde::Deserialize;
use serde_json::Value;

use super::gltf_document::{Document, MaterialData, TextureUse};
use super::source::Notes;
use crate::Result;
use crate::geometry::material::{AlphaMode, BASE_COLOR, Look, RoleTexture, TextureContent};
use crate::geometry::material::{Material, Placement, Wrap};

/// The set of texture coordinates that the base colour of a material uses; the first without a
/// picture of it.
pub(super) fn base_set(data: &MaterialData) -> usize {
    let pbr = || data.pbr_metallic_roughness.as_ref()?.base_color_texture.as_ref().map(TextureUse::set);
    match SpecularGlossiness::of(data) {
        Some(glossy) => glossy.diffuse_texture.as_ref().map(TextureUse::set),
        None => pbr(),
    }
    .unwrap_or(0)
}

/// All materials, in file order. Textures of other sets of texture coordinates than the base
/// colour's cannot be carried and are left out.
pub(super) fn read(document: &Document, notes: &mut Notes) -> Result<Vec<Material>> {
    let mut images = HashMap::new();
    let materials = document.root.materials.iter().enumerate();
    materials.map(|(k, data)| material(document, k, data, &mut images, notes)).collect()
}

fn material(
    document: &Document,
    k: usize,
    data: &MaterialData,
    images: &mut HashMap<usize, Option<Arc<[u8]>>>,
    notes: &mut Notes,
) -> Result<Material> {
    let name = data.name.clone().unwrap_or_else(|| format!("material{k}"));
    let mut material = Material { name, look: look(data), ..Material::default() };
    let pbr = data.pbr_metallic_roughness.as_ref();
    let glossy = SpecularGlossiness::of(data);
    if glossy.is_some() {
        notes.say(format!(
            "material {:?} is one of KHR_materials_pbrSpecularGlossiness: its diffuse colour is taken as base_color, its specular texture as \
             specular_glossiness, one minus its glossiness as roughness",
            material.name
        ));
    }
    let factor = glossy.as_ref().map_or_else(|| pbr.and_then(|p| p.base_color_factor), |g| g.diffuse_factor);
    (material.base_color, material.has_base_color) = (factor.unwrap_or([1.0; 4]), true);
    if let Some(glossy) = &glossy {
        (material.look.metallic, material.look.roughness) = (0.0, 1.0 - glossy.glossiness_factor.unwrap_or(1.0));
    }
    let base = match &glossy {
        Some(glossy) => glossy.diffuse_texture.as_ref(),
        None => pbr.and_then(|p| p.base_color_texture.as_ref()),
    };
    let metallic_roughness = pbr.and_then(|p| p.metallic_roughness_texture.as_ref()).filter(|_| glossy.is_none());
    let others = [
        (BASE_COLOR, base),
        ("metallic_roughness", metallic_roughness),
        ("specular_glossiness", glossy.as_ref().and_then(|g| g.specular_glossiness_texture.as_ref())),
        ("normal", data.normal_texture.as_ref()),
        ("occlusion", data.occlusion_texture.as_ref()),
        ("emissive", data.emissive_texture.as_ref()),
    ];
    // The mesh's one set of texture coordinates.
    let set = base_set(data);
    for (role, used) in others.into_iter().filter_map(|(role, used)| used.map(|u| (role, u))) {
        if used.set() != set {
            notes.say(format!(
                "material {:?}: its {role} texture lies on another set of texture coordinates ({}) than its base colour ({set}) and is \
                 not read",
                material.name,
                used.set()
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
                let found = document.file(uri)?;
                notes.texture(uri.as_bytes(), &found);
                TextureContent::File(found.into_path())
            }
            (None, None) => continue,
        };
        let placement = placement(document, used);
        if role == BASE_COLOR {
            material.base_color_placement = placement;
        }
        match content {
            TextureContent::Embedded(bytes) if role == BASE_COLOR => material.embedded_texture = Some(bytes),
            TextureContent::File(file) if role == BASE_COLOR => material.base_color_texture = Some(file),
            content => material.textures.push(RoleTexture { placement, ..RoleTexture::new(role, content) }),
        }
    }
    Ok(material)
}

/// How a texture lies on the surface: its sampler, and KHR_texture_transform.
fn placement(document: &Document, used: &TextureUse) -> Placement {
    let placement = match used.extensions.get("KHR_texture_transform") {
        Some(value) => {
            let number = |v: &Value| v.as_f64().filter(|x| x.is_finite());
            let pair = |key: &str| Some(DVec2::new(number(&value[key][0])?, number(&value[key][1])?));
            let rotation = number(&value["rotation"]).unwrap_or(0.0);
            Placement::of_gltf(pair("offset").unwrap_or(DVec2::ZERO), rotation, pair("scale").unwrap_or(DVec2::ONE))
        }
        None => Placement::default(),
    };
    let sampler = document.root.textures.get(used.index).and_then(|t| document.root.samplers.get(t.sampler?));
    let sampler = sampler.copied().unwrap_or_default();
    Placement { wrap: [sampler.wrap_s, sampler.wrap_t].map(wrap), ..placement }
}

/// Modes of samplers (glTF 2.0, section 5.26).
fn wrap(mode: Option<u32>) -> Wrap {
    match mode {
        Some(33071) => Wrap::Clamp,
        Some(33648) => Wrap::Mirror,
        _ => Wrap::Repeat,
    }
}

/// The extension KHR_materials_pbrSpecularGlossiness of a material.
#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct SpecularGlossiness {
    diffuse_factor: Option<[f32; 4]>,
    diffuse_texture: Option<TextureUse>,
    glossiness_factor: Option<f32>,
    specular_glossiness_texture: Option<TextureUse>,
}

impl SpecularGlossiness {
    /// Nothing where the material has no such extension, or one that cannot be read.
    fn of(data: &MaterialData) -> Option<Self> {
        let value = data.extensions.get("KHR_materials_pbrSpecularGlossiness")?;
        serde_json::from_value(value.clone()).ok()
    }
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
