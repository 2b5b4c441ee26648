//! Materials: what a mesh file says about the look of its parts.

use std::path::PathBuf;
use std::sync::Arc;

pub use super::placement::Placement;
#[doc(hidden)]
pub use super::placement::Wrap;

/// A material by name, with the textures it refers to.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name in the file.
    pub name: String,
    /// The base colour texture, as a path that can be opened (already joined with the material
    /// file's folder).
    pub base_color_texture: Option<PathBuf>,
    /// The base colour texture as the bytes of an image file, where the mesh file holds it itself
    /// (GLB).
    pub embedded_texture: Option<Arc<[u8]>>,
    /// How the base colour texture lies on the surface.
    pub base_color_placement: Placement,
    /// Base colour, RGBA, as stored.
    pub base_color: [f32; 4],
    /// Whether the file states a base colour; the one above is the default otherwise.
    pub has_base_color: bool,
    /// Whether the base colour is written as viewers show it (sRGB, as in MTL files), and not as
    /// light (glTF).
    pub srgb_base_color: bool,
    /// Textures in other roles, each role at most once.
    pub textures: Vec<RoleTexture>,
    /// Everything else about its look.
    pub look: Look,
    /// What its MTL file says beside that.
    pub statements: Vec<Statement>,
    /// Options of its textures, by role, that are not followed, as its MTL file has them: each with
    /// a blank before it.
    #[doc(hidden)]
    pub texture_options: Vec<(String, Vec<u8>)>,
}

impl Default for Material {
    /// White, opaque, rough, not metallic, without a name or texture.
    fn default() -> Self {
        Self {
            name: String::new(),
            base_color_texture: None,
            embedded_texture: None,
            base_color_placement: Placement::default(),
            base_color: [1.0; 4],
            has_base_color: false,
            srgb_base_color: false,
            textures: Vec::new(),
            look: Look::default(),
            statements: Vec::new(),
            texture_options: Vec::new(),
        }
    }
}

impl Material {
    /// The texture in a role, the base colour's (`base_color`) included.
    pub fn texture(&self, role: &str) -> Option<TextureContent> {
        if role == BASE_COLOR {
            let embedded = self.embedded_texture.clone().map(TextureContent::Embedded);
            return embedded.or_else(|| self.base_color_texture.clone().map(TextureContent::File));
        }
        self.textures.iter().find(|t| t.role == role).map(|t| t.content.clone())
    }

    /// How the texture in a role lies on the surface.
    pub fn placement(&self, role: &str) -> Placement {
        if role == BASE_COLOR {
            return self.base_color_placement;
        }
        self.textures.iter().find(|t| t.role == role).map_or_else(Placement::default, |t| t.placement)
    }

    /// The roles in which it has textures, the base colour first.
    pub fn roles(&self) -> impl Iterator<Item = &str> {
        let base = (self.embedded_texture.is_some() || self.base_color_texture.is_some()).then_some(BASE_COLOR);
        base.into_iter().chain(self.textures.iter().map(|t| t.role.as_str()))
    }
}

/// Name of the role of colour.
pub const BASE_COLOR: &str = "base_color";
/// Names of the roles that are known: glTF's, and those that others keep apart.
#[doc(hidden)]
pub const ROLES: [&str; 13] = [
    BASE_COLOR,
    "metallic_roughness",
    "roughness",
    "metallic",
    "normal",
    "occlusion",
    "emissive",
    "height",
    "displacement",
    "opacity",
    "specular",
    "specular_glossiness",
    "label",
];

/// A texture of a material.
#[derive(Clone, Debug, PartialEq)]
#[doc(hidden)]
pub struct RoleTexture {
    /// What it is for: `metallic_roughness` (roughness in green, metallic in blue, as glTF packs
    /// them), `roughness`, `metallic`, `normal`, `occlusion`, `emissive`, `height`, `opacity` ...
    pub role: String,
    /// Where it is.
    pub content: TextureContent,
    /// How it lies on the surface.
    pub placement: Placement,
    /// Factor of its values (`-bm` of MTL files), where [`Look`] has none for the role.
    pub strength: f32,
}

impl RoleTexture {
    /// A texture that lies on the texture coordinates as they are.
    pub fn new(role: impl Into<String>, content: TextureContent) -> Self {
        Self { role: role.into(), content, placement: Placement::default(), strength: 1.0 }
    }
}

/// A statement of an MTL file that no other field of a [`Material`] holds, as bytes, kept to be
/// written again.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[doc(hidden)]
pub struct Statement {
    /// All of it, or what stands before the file.
    pub text: Vec<u8>,
    /// The file it refers to, as a path that can be opened.
    pub file: Option<PathBuf>,
}

/// Where a texture is.
#[derive(Clone, Debug, PartialEq)]
#[doc(hidden)]
pub enum TextureContent {
    /// A file that can be opened.
    File(PathBuf),
    /// The bytes of an image file.
    Embedded(Arc<[u8]>),
}

/// How opacity is used (glTF 2.0, section 3.9.4).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AlphaMode {
    /// Not at all.
    #[default]
    Opaque,
    /// What is below the cut-off is not there, the rest is opaque.
    Mask(f32),
    /// What is behind shines through.
    Blend,
}

/// Factors of a material in the metallic-roughness model (glTF 2.0, section 3.9); its textures are
/// multiplied with them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Metallic factor, 0..1.
    pub metallic: f32,
    /// Roughness factor, 0..1.
    pub roughness: f32,
    /// Light that it gives off, RGB, linear.
    pub emissive: [f32; 3],
    /// Factor of the first two components of tangent-space normals.
    pub normal_scale: f32,
    /// Strength of ambient occlusion, 0..1.
    pub occlusion_strength: f32,
    /// How opacity is used.
    pub alpha: AlphaMode,
    /// Whether its back is seen, too.
    pub double_sided: bool,
}

impl Default for Look {
    /// Rough and opaque; seen from both sides.
    fn default() -> Self {
        Self {
            metallic: 0.0,
            roughness: 1.0,
            emissive: [0.0; 3],
            normal_scale: 1.0,
            occlusion_strength: 1.0,
            alpha: AlphaMode::Opaque,
            double_sided: true,
        }
    }
}
