//! Materials: what a mesh file says about the look of its parts.

use std::path::PathBuf;
use std::sync::Arc;

/// A material by name, with the textures it refers to.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name in the file.
    pub name: String,
    /// The base colour texture, as a path that can be opened (already joined with the material file's folder).
    pub base_color_texture: Option<PathBuf>,
    /// The base colour texture as the bytes of an image file, where the mesh file holds it itself (GLB).
    pub embedded_texture: Option<Arc<[u8]>>,
    /// Base colour factor, RGBA, linear as stored.
    pub base_color: [f32; 4],
    /// Textures in other roles, each role at most once.
    pub textures: Vec<RoleTexture>,
    /// Everything else about its look.
    pub look: Look,
}

impl Default for Material {
    /// White, opaque, rough, not metallic, without a name or texture.
    fn default() -> Self {
        Self {
            name: String::new(),
            base_color_texture: None,
            embedded_texture: None,
            base_color: [1.0; 4],
            textures: Vec::new(),
            look: Look::default(),
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

    /// The roles in which it has textures, the base colour first.
    pub fn roles(&self) -> impl Iterator<Item = &str> {
        let base = (self.embedded_texture.is_some() || self.base_color_texture.is_some()).then_some(BASE_COLOR);
        base.into_iter().chain(self.textures.iter().map(|t| t.role.as_str()))
    }
}

/// Name of the role of colour.
pub const BASE_COLOR: &str = "base_color";
/// Names of the roles that are known: glTF's, and those that others keep apart.
pub const ROLES: [&str; 12] = [
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
    "label",
];

/// A texture of a material.
#[derive(Clone, Debug, PartialEq)]
pub struct RoleTexture {
    /// What it is for: `metallic_roughness` (roughness in green, metallic in blue, as glTF packs them), `roughness`, `metallic`, `normal`,
    /// `occlusion`, `emissive`, `height`, `opacity` ...
    pub role: String,
    /// Where it is.
    pub content: TextureContent,
}

/// Where a texture is.
#[derive(Clone, Debug, PartialEq)]
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

/// Factors of a material in the metallic-roughness model (glTF 2.0, section 3.9); its textures are multiplied with them.
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
