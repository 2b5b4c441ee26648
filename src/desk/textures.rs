//! The pictures of a layer, and which material shows which.

use crate::error::{Error, Result};
use crate::geometry::material::{BASE_COLOR, Placement};
use crate::geometry::{Mesh, NONE};
use crate::io::image_file::Metadata;
use crate::picture::Image;
use crate::tools::transfer::{Encoding, Layer, LayerKind};

/// The pictures of one layer and how the source uses them.
#[derive(Debug)]
pub struct Textures {
    /// What the layer is for: `base_color`, `roughness` ...
    pub role: String,
    /// The pictures.
    pub images: Vec<Image>,
    /// How each picture lies on the source.
    pub placements: Vec<Placement>,
    /// Whether the pictures are multiplied by their materials' factors already.
    pub multiplied: bool,
    /// Colours of the vertices, in place of pictures.
    pub vertices: Option<Vec<[f32; 4]>>,
    /// Picture of each material of the source, or [`NONE`].
    pub material_texture: Vec<u32>,
    /// Picture of triangles without a material, or [`NONE`].
    pub default_texture: u32,
    /// Picture of each triangle, where tiles decide it.
    pub face_texture: Option<Vec<u32>>,
    /// What the values mean.
    pub kind: LayerKind,
    /// What the files of the pictures say of their colours.
    pub metadata: Metadata,
}

impl Textures {
    pub(super) fn empty(role: &str, source: &Mesh) -> Self {
        Self {
            role: role.to_owned(),
            images: Vec::new(),
            placements: Vec::new(),
            multiplied: false,
            vertices: None,
            material_texture: vec![NONE; source.materials.len()],
            default_texture: NONE,
            face_texture: None,
            kind: LayerKind::Color,
            metadata: Metadata::default(),
        }
    }

    /// One picture for the whole source.
    pub fn single(image: Image) -> Self {
        Self {
            role: BASE_COLOR.to_owned(),
            images: vec![image],
            placements: Vec::new(),
            multiplied: false,
            vertices: None,
            material_texture: Vec::new(),
            default_texture: 0,
            face_texture: None,
            kind: LayerKind::Color,
            metadata: Metadata::default(),
        }
    }

    /// The colours of the source's vertices.
    pub(super) fn of_vertices(role: &str, source: &Mesh) -> Result<Self> {
        if source.colors.is_empty() {
            let what = format!("{} has no vertex colours", source.name);
            return Err(Error::option("texture", what, "Name a picture, or export the mesh with its colours"));
        }
        let material_texture = vec![0; source.materials.len()];
        let vertices = Some(source.colors.clone());
        Ok(Self { vertices, default_texture: 0, material_texture, ..Self::empty(role, source) })
    }

    /// As a layer of a transfer; with `linear_light` light is averaged instead of stored values.
    pub fn layer(&self, linear_light: bool) -> Layer<'_> {
        Layer {
            name: self.role.clone(),
            images: self.images.iter().collect(),
            material_texture: self.material_texture.clone(),
            default_texture: self.default_texture,
            placements: self.placements.clone(),
            face_texture: self.face_texture.clone(),
            vertices: self.vertices.as_deref(),
            kind: self.kind,
            encoding: Encoding { linear_light, ..Encoding::default() },
        }
    }

    /// Whether the source needs texture coordinates for it.
    pub fn needs_texcoords(&self) -> bool {
        self.images.iter().any(|i| (i.width, i.height) != (1, 1))
    }

    /// Picture of each triangle.
    pub(super) fn of_faces(&self, source: &Mesh) -> Vec<u32> {
        let of = |t| {
            let material = source.triangle_material(t) as usize;
            self.material_texture.get(material).copied().unwrap_or(self.default_texture)
        };
        (0..source.triangle_count()).map(of).collect()
    }
}
