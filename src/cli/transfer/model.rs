//! The target with its new textures as GLB.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use crate::Result;
use crate::cli::common::{Session, Surface};
use crate::cli::model_file::finish;
use crate::desk::{Part, Textures, part_of};
use crate::geometry::material::{AlphaMode, BASE_COLOR, Look};
use crate::geometry::{Material, Mesh, NONE};
use crate::io::gltf_upright::turned_upright;
use crate::io::gltf_write::glb_with_materials;
use crate::io::image_file::encode_png;
use crate::io::{GlbMaterial, GlbTexture};
use crate::picture::Image;

/// What the source's materials say beside textures.
#[derive(Clone, Debug)]
pub(super) struct SourceLook {
    base_color: [f32; 4],
    look: Look,
}

impl SourceLook {
    /// The factors that all textured materials of the source share; without textures' own factors
    /// where they differ, which a note tells.
    pub(super) fn new(source: &Mesh, layers: &[Textures], session: &Session<'_>) -> Self {
        // Only glTF multiplies textures by factors; diffuse colours beside a texture are leftovers
        // in most other files.
        let name = source.name.to_ascii_lowercase();
        let gltf = name.ends_with(".gltf") || name.ends_with(".glb");
        let used = |m: usize| layers.iter().any(|l| l.material_texture.get(m).is_some_and(|&t| t != NONE));
        let mut textured = source.materials.iter().enumerate().filter(|(m, _)| used(*m)).map(|(_, m)| m);
        let neutral = Self { base_color: [1.0; 4], look: Look { alpha: opacity(layers), ..Look::default() } };
        let Some(first) = textured.next().filter(|_| gltf) else { return neutral };
        let factors = |m: &Material| left_factors(m, layers);
        if let Some(other) = textured.find(|m| factors(m) != factors(first)) {
            session.warn(&format!(
                "the materials {:?} and {:?} of the source have different factors; the model gets neutral ones",
                first.name, other.name
            ));
            return neutral;
        }
        let (base_color, look) = factors(first);
        Self { base_color, look }
    }
}

/// The factors of a material that the pictures of the layers do not hold already.
fn left_factors(material: &Material, layers: &[Textures]) -> ([f32; 4], Look) {
    let held = |role: &str| layers.iter().any(|l| l.role == role && l.multiplied);
    let (mut color, mut look) = (material.base_color, material.look);
    if held(BASE_COLOR) {
        color = [1.0; 4];
    }
    if held("metallic_roughness") {
        (look.metallic, look.roughness) = (1.0, 1.0);
    }
    if held("normal") {
        look.normal_scale = 1.0;
    }
    if held("occlusion") {
        look.occlusion_strength = 1.0;
    }
    if held("emissive") {
        look.emissive = [1.0; 3];
    }
    (color, look)
}

/// Blending, if a base colour texture is transparent somewhere.
fn opacity(layers: &[Textures]) -> AlphaMode {
    let transparent = |image: &Image| {
        let n = image.channels as usize;
        image.has_alpha() && (0..image.pixels.len() / n).any(|i| image.sample(i * n + n - 1) < 1.0)
    };
    let images = layers.iter().filter(|l| l.role == BASE_COLOR).flat_map(|l| &l.images);
    if images.into_iter().any(transparent) { AlphaMode::Blend } else { AlphaMode::Opaque }
}

/// The textures of a part as files, by role.
#[derive(Debug)]
pub(super) struct Skin {
    base: Option<Arc<[u8]>>,
    others: Vec<(String, Arc<[u8]>)>,
}

impl Skin {
    /// Encodes the layers of a part. Roughness and metallic become one picture, as the format asks.
    pub(super) fn new(layers: &[Textures], images: &[Image]) -> Result<Self> {
        let named = |role: &str| layers.iter().position(|l| l.role == role).map(|i| &images[i]);
        let base = named(BASE_COLOR).or_else(|| images.first().filter(|_| layers[0].role.starts_with("layer")));
        let base = base.map(|i| encode_png(i).map(Arc::from)).transpose()?;
        let mut others: Vec<(String, Arc<[u8]>)> = Vec::new();
        for role in ["metallic_roughness", "normal", "occlusion", "emissive"] {
            if let Some(image) = named(role) {
                others.push((role.to_owned(), encode_png(&image.converted(3, image.depth())?)?.into()));
            }
        }
        if named("metallic_roughness").is_none()
            && let Some(packed) = packed(named("roughness"), named("metallic"))?
        {
            others.push(("metallic_roughness".to_owned(), encode_png(&packed)?.into()));
        }
        Ok(Self { base, others })
    }

    fn has(&self, role: &str) -> bool {
        self.others.iter().any(|o| o.0 == role)
    }
}

/// Roughness in green and metallic in blue (glTF 2.0, section 3.9.2); what is missing is rough, or
/// not metallic.
fn packed(roughness: Option<&Image>, metallic: Option<&Image>) -> Result<Option<Image>> {
    let Some(size) = roughness.or(metallic) else { return Ok(None) };
    let mut out = Image::zeros(size.width, size.height, 3, size.depth())?;
    for y in 0..out.height {
        for x in 0..out.width {
            out.set(x, y, 0, 1.0);
            out.set(x, y, 1, roughness.map_or(1.0, |i| i.get(x, y, 0)));
            out.set(x, y, 2, metallic.map_or(0.0, |i| i.get(x, y, 0)));
        }
    }
    Ok(Some(out))
}

/// The bytes of the model: a material for each part and material of the target, with the target's
/// names.
///
/// A target that came from glTF keeps its scene, and its materials what is not transferred.
pub(super) fn glb(
    session: &Session<'_>,
    surface: &Surface,
    parts: &[Part],
    skins: &[Skin],
    source: &SourceLook,
    path: &Path,
) -> Result<Vec<u8>> {
    let target = &surface.mesh;
    let part_of = part_of(parts, target);
    let mut materials = Vec::new();
    let mut known: HashMap<(u32, u32), u32> = HashMap::new();
    let mut of = Vec::with_capacity(part_of.len());
    for (t, &part) in part_of.iter().enumerate() {
        if surface.scene.is_some() && part as usize >= skins.len() {
            of.push(NONE);
            continue;
        }
        let material = target.triangle_material(t);
        let entry = *known.entry((part, material)).or_insert_with(|| {
            let name = target.materials.get(material as usize).map_or("transferred", |m| &m.name);
            let tile = parts.get(part as usize).and_then(|p| p.tile?.udim()).filter(|_| parts.len() > 1);
            let name = tile.map_or(name.to_owned(), |n| format!("{name}.{n}"));
            materials.push(dressed(name, skins.get(part as usize), source));
            materials.len() as u32 - 1
        });
        of.push(entry);
    }
    match &surface.scene {
        Some(scene) => {
            let mut edit = scene.edit();
            edit.materials(target, &materials, &of)?;
            finish(session, edit, path)
        }
        None => {
            session.warn_of_up(target);
            Ok(turned_upright(&glb_with_materials(target, &materials, &of)?, session.up())?.into_owned())
        }
    }
}

fn dressed(name: String, skin: Option<&Skin>, source: &SourceLook) -> GlbMaterial {
    let mut look = Look { double_sided: true, ..source.look };
    let Some(skin) = skin else { return GlbMaterial { name, base_color: [1.0; 4], ..GlbMaterial::default() } };
    if skin.has("metallic_roughness") && source.look.metallic == 0.0 {
        // The texture says it.
        look.metallic = 1.0;
    } else if !skin.has("metallic_roughness") && source.look.metallic == 1.0 {
        // The format's default stands for a texture that did not come along.
        look.metallic = 0.0;
    }
    if skin.has("emissive") && look.emissive == [0.0; 3] {
        look.emissive = [1.0; 3];
    }
    let texture = skin.base.clone().map(GlbTexture::from);
    let textures = skin.others.iter().map(|(role, bytes)| (role.clone(), bytes.clone().into())).collect();
    GlbMaterial { name, base_color: source.base_color, texture, textures, look }
}
