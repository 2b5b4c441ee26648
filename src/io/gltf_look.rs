//! Materials as glTF describes them.

use std::collections::HashMap;
use std::sync::Arc;

use serde_json::{Value, json};

use super::gltf_edit::{list_of, picture_kind};
use super::gltf_parts::Parts;
use crate::Result;
use crate::geometry::Mesh;
use crate::geometry::material::{AlphaMode, BASE_COLOR, Look, Placement, TextureContent, Wrap};
use crate::picture::srgb_to_linear;

/// The look of a part of a model.
#[derive(Clone, Debug, Default)]
pub struct GlbMaterial {
    /// Its name.
    pub name: String,
    /// Base colour factor, RGBA, linear; multiplied with the texture.
    pub base_color: [f32; 4],
    /// Base colour texture.
    pub texture: Option<GlbTexture>,
    /// Textures in other roles: `metallic_roughness`, `normal`, `occlusion` or `emissive`. Those
    /// that several materials share are written once.
    pub textures: Vec<(String, GlbTexture)>,
    /// Factors, and how opacity is used.
    pub look: Look,
}

impl GlbMaterial {
    pub(super) fn has_pictures(&self) -> bool {
        self.texture.is_some() || !self.textures.is_empty()
    }
}

/// A picture on a model.
#[derive(Clone, Debug, PartialEq)]
pub struct GlbTexture {
    /// The bytes of a PNG or JPEG file.
    pub bytes: Arc<[u8]>,
    /// How it lies on the surface.
    pub placement: Placement,
}

impl From<Arc<[u8]>> for GlbTexture {
    /// A picture that lies on the texture coordinates as they are.
    fn from(bytes: Arc<[u8]>) -> Self {
        Self { bytes, placement: Placement::default() }
    }
}

impl From<Vec<u8>> for GlbTexture {
    /// A picture that lies on the texture coordinates as they are.
    fn from(bytes: Vec<u8>) -> Self {
        Self::from(Arc::<[u8]>::from(bytes))
    }
}

/// The roles beside the base colour that glTF has a place for.
const ROLES: [&str; 4] = ["metallic_roughness", "normal", "occlusion", "emissive"];

/// The materials that `mesh` itself names, with the textures that the format has a place for: PNG
/// and JPEG files as they are, others as PNG. What cannot be read is left out; a note names it.
///
/// Diffuse colours of MTL files are colours as viewers show them (sRGB) and become light; beside a
/// picture they are leftovers in most files, and white. Colours of vertices stand for those of
/// materials where no material has a picture.
pub fn own_materials(mesh: &Mesh) -> (Vec<GlbMaterial>, Vec<String>) {
    let vertices = !mesh.colors.is_empty() && !mesh.materials.iter().any(|m| m.texture(BASE_COLOR).is_some());
    let mut notes = Vec::new();
    let mut picture = |content: TextureContent, placement: Placement| match encoded(content, &mesh.name) {
        Ok(bytes) => Some(GlbTexture { bytes, placement }),
        Err(error) => {
            let note = format!("a picture is not in the file that is written: {error}");
            if !notes.contains(&note) {
                notes.push(note);
            }
            None
        }
    };
    let mut materials = Vec::with_capacity(mesh.materials.len());
    for m in &mesh.materials {
        let texture = m.texture(BASE_COLOR).and_then(|content| picture(content, m.base_color_placement));
        let mut textures = Vec::new();
        for t in m.textures.iter().filter(|t| ROLES.contains(&t.role.as_str())) {
            textures.extend(picture(t.content.clone(), t.placement).map(|picture| (t.role.clone(), picture)));
        }
        let mut look = Look { double_sided: true, ..m.look };
        let base_color = match (m.srgb_base_color, m.base_color) {
            _ if vertices => [1.0; 4],
            (true, _) if texture.is_some() => [1.0; 4],
            (true, [r, g, b, a]) => {
                look.alpha = if a < 1.0 { AlphaMode::Blend } else { look.alpha };
                let [r, g, b] = [r, g, b].map(|x| srgb_to_linear(x.clamp(0.0, 1.0)));
                [r, g, b, a]
            }
            (false, color) => color,
        };
        let glows = textures.iter().any(|t: &(String, GlbTexture)| t.0 == "emissive");
        if glows && look.emissive == [0.0; 3] && m.srgb_base_color {
            // Only glTF multiplies the picture by a factor that is black without being named.
            look.emissive = [1.0; 3];
        }
        materials.push(GlbMaterial { name: m.name.clone(), base_color, texture, textures, look });
    }
    (materials, notes)
}

/// The bytes of a picture as glTF may hold it; `name` stands for the mesh in messages.
fn encoded(content: TextureContent, name: &str) -> Result<Arc<[u8]>> {
    let (content, name): (Arc<[u8]>, _) = match content {
        TextureContent::Embedded(bytes) => (bytes, name.to_owned()),
        TextureContent::File(path) => (super::source::read_all(&path)?.into(), path.display().to_string()),
    };
    if content.starts_with(&[0xff, 0xd8]) || content.starts_with(b"\x89PNG") {
        return Ok(content);
    }
    Ok(super::image_file::encode_png(&super::image_file::decode_image(&content, &name)?)?.into())
}

/// The sampler of a picture, with mip-maps.
pub(super) fn sampler(wrap: [Wrap; 2]) -> Value {
    let [s, t] = wrap.map(|wrap| match wrap {
        Wrap::Repeat => 10497,
        Wrap::Clamp => 33071,
        Wrap::Mirror => 33648,
    });
    json!({"magFilter": 9729, "minFilter": 9987, "wrapS": s, "wrapT": t})
}

/// The name of the extension that moves pictures.
const TRANSFORM: &str = "KHR_texture_transform";

/// What a reference to a texture has beside its number.
pub(super) fn transform(placement: &Placement) -> Option<Value> {
    if placement.keeps_coordinates() {
        return None;
    }
    let (offset, rotation, scale) = placement.to_gltf();
    Some(json!({TRANSFORM: {"offset": offset.to_array(), "rotation": rotation, "scale": scale.to_array()}}))
}

/// Puts [`TRANSFORM`] on the list of extensions in use.
pub(super) fn declare_transform(root: &mut Value) {
    let used = list_of(root, "extensionsUsed");
    if !used.iter().any(|name| name == TRANSFORM) {
        used.push(TRANSFORM.into());
    }
}

/// The pictures written so far.
#[derive(Default)]
pub(super) struct Pictures {
    images: Vec<Value>,
    samplers: Vec<Value>,
    textures: Vec<Value>,
    known: HashMap<Arc<[u8]>, usize>,
    transformed: bool,
}

impl Pictures {
    /// The reference to a picture, written once.
    pub(super) fn reference(&mut self, texture: &GlbTexture, out: &mut Parts) -> Value {
        let source = *self.known.entry(texture.bytes.clone()).or_insert_with(|| {
            let view = out.view(&texture.bytes, None);
            self.images.push(json!({"bufferView": view, "mimeType": picture_kind(&texture.bytes)}));
            self.images.len() - 1
        });
        let sampler = number_of(&mut self.samplers, sampler(texture.placement.wrap));
        let index = number_of(&mut self.textures, json!({"source": source, "sampler": sampler}));
        let mut info = json!({"index": index});
        if let Some(transform) = transform(&texture.placement) {
            self.transformed = true;
            info["extensions"] = transform;
        }
        info
    }

    /// Puts the lists into the document.
    pub(super) fn write(self, root: &mut Value) {
        // The format forbids empty lists.
        if self.images.is_empty() {
            return;
        }
        root["textures"] = self.textures.into();
        root["images"] = self.images.into();
        root["samplers"] = self.samplers.into();
        if self.transformed {
            declare_transform(root);
        }
    }
}

/// The number of a value in a list, to which it is added if it is new.
pub(super) fn number_of(list: &mut Vec<Value>, value: Value) -> usize {
    list.iter().position(|v| *v == value).unwrap_or_else(|| {
        list.push(value);
        list.len() - 1
    })
}

/// The description of a material; `texture` gives the reference to a picture.
pub(super) fn look(material: &GlbMaterial, texture: &mut dyn FnMut(&GlbTexture) -> Value) -> Value {
    let l = &material.look;
    let unit = |x: f32| if x.is_finite() { x.clamp(0.0, 1.0) } else { 1.0 };
    let mut pbr = json!({
        "baseColorFactor": material.base_color.map(unit),
        "metallicFactor": unit(l.metallic),
        "roughnessFactor": unit(l.roughness),
    });
    let mut value = json!({"name": material.name, "doubleSided": l.double_sided});
    if let Some(picture) = &material.texture {
        pbr["baseColorTexture"] = texture(picture);
    }
    for (role, picture) in &material.textures {
        match role.as_str() {
            "metallic_roughness" => pbr["metallicRoughnessTexture"] = texture(picture),
            "normal" => {
                value["normalTexture"] = texture(picture);
                value["normalTexture"]["scale"] = json!(l.normal_scale);
            }
            "occlusion" => {
                value["occlusionTexture"] = texture(picture);
                value["occlusionTexture"]["strength"] = json!(unit(l.occlusion_strength));
            }
            "emissive" => value["emissiveTexture"] = texture(picture),
            // The format has no place for others.
            _ => {}
        }
    }
    value["pbrMetallicRoughness"] = pbr;
    if l.emissive != [0.0; 3] {
        value["emissiveFactor"] = json!(l.emissive.map(unit));
    }
    match l.alpha {
        AlphaMode::Opaque => {}
        AlphaMode::Mask(cutoff) => {
            value["alphaMode"] = "MASK".into();
            value["alphaCutoff"] = json!(cutoff.max(0.0));
        }
        AlphaMode::Blend => value["alphaMode"] = "BLEND".into(),
    }
    value
}
