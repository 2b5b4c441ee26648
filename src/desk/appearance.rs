//! What materials show in a role: a picture with factors, or one colour.

use crate::Result;
use crate::geometry::material::{AlphaMode, BASE_COLOR, Material, Placement, TextureContent};
use crate::geometry::{Mesh, NONE};
use crate::io::TextureName;
use crate::picture::{Depth, Image, linear_to_srgb, srgb_to_linear};
use crate::tools::transfer::holds_normals;

/// The materials of a source that faces show, and the normal maps among their height maps.
pub(super) struct Appearance<'a> {
    source: &'a Mesh,
    used: Vec<bool>,
    /// Whether the height texture of a material holds normals.
    normals: Vec<bool>,
}

impl<'a> Appearance<'a> {
    pub(super) fn new(source: &'a Mesh) -> Self {
        let mut used = vec![false; source.materials.len()];
        for t in 0..source.triangle_count() {
            let m = source.triangle_material(t);
            if m != NONE {
                used[m as usize] = true;
            }
        }
        let normals = vec![false; used.len()];
        Self { source, used, normals }
    }

    /// Looks at the height textures of materials without a normal texture: `map_Bump` names both
    /// kinds. Names those that hold normals and are taken as such from now on. What cannot be read
    /// is told when it is read as a height.
    pub(super) fn recognise_normals(&mut self, told: impl Fn(&str)) {
        for (m, material) in self.source.materials.iter().enumerate() {
            let Some(height) = material.texture("height").filter(|_| self.used[m]) else { continue };
            if material.texture("normal").is_none() && read(&height, self.source).is_ok_and(|i| holds_normals(&i)) {
                self.normals[m] = true;
                told(&format!(
                    "material {:?}: its bump texture holds normals, not heights; it is taken as a normal map",
                    material.name
                ));
            }
        }
    }

    /// Numbers of the materials that faces show.
    pub(super) fn used(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.used.len()).filter(|&m| self.used[m])
    }

    /// The picture of a material in a role.
    pub(super) fn picture(&self, m: usize, role: &str) -> Option<(TextureContent, Placement)> {
        let material = &self.source.materials[m];
        let role = match role {
            "normal" if self.normals[m] => "height",
            "height" if self.normals[m] => return None,
            role => role,
        };
        Some((material.texture(role)?, material.placement(role)))
    }

    /// Whether faces show something in a role: a picture, or for the base colour a colour.
    pub(super) fn shows(&self, role: &str) -> bool {
        let colored = |m: usize| role == BASE_COLOR && self.source.materials[m].has_base_color;
        self.used().any(|m| self.picture(m, role).is_some() || colored(m))
    }

    /// Whether faces show pictures in a role.
    pub(super) fn has_pictures(&self, role: &str) -> bool {
        self.used().any(|m| self.picture(m, role).is_some())
    }

    /// A picture of one texel for a material without a picture in a role that others have: what a
    /// renderer takes then.
    pub(super) fn colour(&self, m: usize, role: &str) -> Result<Option<Image>> {
        let material = &self.source.materials[m];
        let described = material.has_base_color || !material.statements.is_empty() || material.roles().next().is_some();
        let [r, g, b, a] = shown_color(material);
        let look = &material.look;
        let texel: &[f32] = match role {
            BASE_COLOR if !material.has_base_color => return Ok(None),
            BASE_COLOR if a < 1.0 => &[r, g, b, a],
            BASE_COLOR => &[r, g, b],
            _ if !described => return Ok(None),
            "metallic_roughness" => &[1.0, look.roughness, look.metallic],
            "roughness" => &[look.roughness],
            "metallic" => &[look.metallic],
            "normal" => &[0.5, 0.5, 1.0],
            "occlusion" => &[1.0],
            "emissive" => &look.emissive.map(linear_to_srgb),
            "opacity" => &[material.base_color[3]],
            // There is no telling what a missing height or label is.
            _ => return Ok(None),
        };
        let mut image = Image::zeros(1, 1, texel.len() as u32, Depth::U8)?;
        texel.iter().enumerate().for_each(|(c, &value)| image.set(0, 0, c as u32, value));
        Ok(Some(image))
    }
}

/// The base colour as viewers show it; opacity only where it is used.
fn shown_color(material: &Material) -> [f32; 4] {
    let [r, g, b, a] = material.base_color;
    if material.srgb_base_color {
        return [r, g, b, a];
    }
    let [r, g, b] = [r, g, b].map(linear_to_srgb);
    [r, g, b, if material.look.alpha == AlphaMode::Opaque { 1.0 } else { a }]
}

/// Reads a picture.
pub(super) fn read(content: &TextureContent, source: &Mesh) -> Result<Image> {
    match content {
        TextureContent::Embedded(bytes) => crate::io::image_file::decode_image(bytes, &source.name),
        TextureContent::File(path) => Ok(crate::io::read_texture(path)?.image),
    }
}

/// Whether a file stands for the tiles of a picture.
pub(super) fn tiles(content: &TextureContent) -> Option<TextureName> {
    match content {
        TextureContent::File(path) => Some(TextureName::new(path.to_string_lossy())).filter(TextureName::has_tile),
        TextureContent::Embedded(_) => None,
    }
}

/// The factors of a material that multiply its picture in a role, as glTF says (2.0, sections 3.9.2
/// and 5.19); `None` where all are 1. Diffuse colours beside a picture are leftovers in most MTL
/// files, and are passed over.
pub(super) fn factors(role: &str, material: &Material) -> Option<[f32; 4]> {
    let look = &material.look;
    let gltf = material.has_base_color && !material.srgb_base_color;
    let [r, g, b, a] = material.base_color;
    let factors: [f32; 4] = match role {
        BASE_COLOR if gltf => [r, g, b, if look.alpha == AlphaMode::Opaque { 1.0 } else { a }],
        "emissive" if gltf => [look.emissive[0], look.emissive[1], look.emissive[2], 1.0],
        "metallic_roughness" if gltf => [1.0, look.roughness, look.metallic, 1.0],
        "occlusion" if gltf => [look.occlusion_strength; 4],
        "normal" => [look.normal_scale, look.normal_scale, 1.0, 1.0],
        _ => return None,
    };
    Some(factors).filter(|f| *f != [1.0; 4])
}

/// Multiplies a picture by its [`factors`]: colours as light, normals and occlusion by their own
/// rules.
pub(super) fn multiply(image: &mut Image, role: &str, factors: [f32; 4]) -> Result<()> {
    if image.channels < 3 && role != "occlusion" {
        *image = image.converted(image.channels + 2, image.depth())?;
    }
    if factors[3] != 1.0 && role == BASE_COLOR && !image.has_alpha() {
        *image = image.converted(4, image.depth())?;
    }
    // Floats hold light already.
    let light = matches!(role, BASE_COLOR | "emissive") && image.depth() != Depth::F32;
    let channels = image.channels;
    for y in 0..image.height {
        for x in 0..image.width {
            let old = [0, 1, 2, 3].map(|c| if c < channels { image.get(x, y, c) } else { 1.0 });
            let new: [f32; 4] = match role {
                "normal" => scaled_normal(old, factors[0]),
                "occlusion" => old.map(|v| 1.0 + factors[0] * (v - 1.0)),
                _ => [0, 1, 2, 3].map(|c| match (c < 3 && light, factors[c]) {
                    (_, 1.0) => old[c],
                    (true, f) => linear_to_srgb(f * srgb_to_linear(old[c])),
                    (false, f) => f * old[c],
                }),
            };
            let stored = if role == "normal" || role == "occlusion" { channels.min(3) } else { channels };
            for c in 0..stored {
                image.set(x, y, c, new[c as usize]);
            }
        }
    }
    Ok(())
}

/// A stored normal with its first two components scaled (glTF 2.0, section 5.20).
fn scaled_normal([r, g, b, a]: [f32; 4], scale: f32) -> [f32; 4] {
    let [x, y, z] = [scale * (2.0 * r - 1.0), scale * (2.0 * g - 1.0), 2.0 * b - 1.0];
    let length = (x * x + y * y + z * z).sqrt();
    if length == 0.0 {
        return [r, g, b, a];
    }
    let [x, y, z] = [x, y, z].map(|c| (0.5 + 0.5 * c / length).clamp(0.0, 1.0));
    [x, y, z, a]
}
