//! A glTF file kept beside the mesh that was read from it, so that what is written has all that the
//! file had.

use glam::DVec3;

use super::gltf_animation::GlbAnimation;
use super::gltf_components::Components;
use super::gltf_document::Document;
use super::gltf_edit::Edit;
use super::gltf_edit_frames::set_frames;
use super::gltf_edit_looks::set_materials;
use super::gltf_edit_shape::set_shape;
use super::gltf_edit_skin::set_skin;
use super::gltf_edit_uv::set_texcoords;
use super::gltf_look::GlbMaterial;
use super::gltf_read::Placement;
use crate::geometry::Mesh;
use crate::geometry::material::BASE_COLOR;
use crate::{Error, Result};

pub use super::gltf_edit_skin::SkinWeights;
pub use super::gltf_edit_uv::KeepTextures;

/// The scene of a glTF file, and which of its vertices and triangles those of the mesh are.
///
/// The triangles of a part are those of its primitive in file order, its vertices the elements of
/// the primitive's accessors.
#[derive(Debug)]
pub struct GltfScene {
    pub(super) document: Document,
    pub(super) parts: Vec<Part>,
}

/// A primitive of triangles in the mesh.
#[derive(Debug)]
pub(super) struct Part {
    /// Which mesh of the file.
    pub(super) mesh: usize,
    /// Which primitive of it.
    pub(super) primitive: usize,
    /// The node at which it is taken.
    pub(super) node: usize,
    /// Its vertices in the mesh.
    pub(super) first_vertex: usize,
    pub(super) vertices: usize,
    /// Its triangles in the mesh.
    pub(super) first_triangle: usize,
    pub(super) triangles: usize,
    /// Whether the mesh has its triangles turned over.
    pub(super) flipped: bool,
    /// The number of its first normal in the mesh.
    pub(super) first_normal: Option<usize>,
    /// Where the mesh's texture coordinates come from.
    pub(super) placement: Placement,
}

impl GltfScene {
    pub(super) fn new(document: Document, parts: Vec<Part>) -> Self {
        Self { document, parts }
    }
}

/// Writes a scene with a part of it changed.
#[derive(Debug)]
pub struct SceneEdit<'a> {
    scene: &'a GltfScene,
    edit: Edit<'a>,
}

impl GltfScene {
    /// Begins a change.
    pub fn edit(&self) -> SceneEdit<'_> {
        SceneEdit { scene: self, edit: Edit::new(&self.document) }
    }

    /// What the file has beside its meshes and materials that formats of plain meshes have no place
    /// for, as words; nothing where there is none of it.
    pub fn beside_the_mesh(&self) -> Option<String> {
        let some = |list: &str| self.document.json[list].as_array().is_some_and(|l| !l.is_empty());
        let meshes = &self.document.root.meshes;
        let morphs = self.parts.iter().any(|p| !meshes[p.mesh].primitives[p.primitive].targets.is_empty());
        let what = [("skins", some("skins")), ("morph targets", morphs), ("animations", some("animations"))];
        let names: Vec<&str> = what.into_iter().filter(|w| w.1).map(|w| w.0).collect();
        (!names.is_empty()).then(|| names.join(", "))
    }

    /// The largest extent of the stored positions of a primitive, in the units of the scene,
    /// roughly.
    pub(super) fn size(&self) -> Result<f64> {
        let globals = super::gltf_nodes::global_transforms(&self.document)?;
        let mut size = 0.0_f64;
        for part in &self.parts {
            let primitive = &self.document.root.meshes[part.mesh].primitives[part.primitive];
            let Some(&accessor) = primitive.attributes.get("POSITION") else { continue };
            let positions = self.document.vectors(accessor, part.vertices)?;
            let low = positions.iter().copied().reduce(DVec3::min).unwrap_or_default();
            let high = positions.iter().copied().reduce(DVec3::max).unwrap_or_default();
            size = size.max(globals[part.node].transform_vector3(high - low).length());
        }
        Ok(size)
    }

    /// Fails unless `mesh` has the vertices and triangles of the scene.
    fn check(&self, mesh: &Mesh) -> Result<()> {
        self.check_vertices(mesh)?;
        let normals = self.parts.iter().filter_map(|p| Some(p.first_normal? + p.vertices)).max().unwrap_or(0);
        if mesh.normals.len() >= normals {
            return Ok(());
        }
        let what = format!("{} normals are not the {normals} of the file", mesh.normals.len());
        Err(Error::mesh(&mesh.name, what, "Give the mesh that was read from the file"))
    }

    /// As [`GltfScene::check`], whatever normals there are.
    fn check_vertices(&self, mesh: &Mesh) -> Result<()> {
        let (vertices, triangles) =
            self.parts.last().map_or((0, 0), |p| (p.first_vertex + p.vertices, p.first_triangle + p.triangles));
        if mesh.vertex_count() == vertices && mesh.file_triangle_count() == triangles {
            return Ok(());
        }
        let what = format!(
            "{} vertices and {} triangles are not the {vertices} and {triangles} of the file",
            mesh.vertex_count(),
            mesh.file_triangle_count()
        );
        Err(Error::mesh(&mesh.name, what, "Give the mesh that was read from the file"))
    }
}

impl SceneEdit<'_> {
    /// Positions and normals are those of `mesh`, the one that was read from the file in another
    /// shape. They go back to the pose in which the file stores them; what did not move keeps its
    /// bytes. Joined vertices need positions of their own ([`Mesh::spread`]).
    ///
    /// # Errors
    /// [`Error::Mesh`] for another mesh, or a position that does not fit single precision.
    pub fn shape(&mut self, mesh: &Mesh) -> Result<()> {
        self.scene.check(mesh)?;
        set_shape(&mut self.edit, self.scene, mesh)
    }

    /// Morph targets behind those that the meshes have, and an animation that plays them.
    pub(super) fn frames(&mut self, mesh: &Mesh, animation: &GlbAnimation<'_>, targets: &Components) -> Result<()> {
        self.scene.check_vertices(mesh)?;
        set_frames(&mut self.edit, self.scene, mesh, animation, targets)
    }

    /// Texture coordinates are those of `mesh`, the one that was read from the file with other
    /// coordinates.
    ///
    /// # Errors
    /// [`Error::Mesh`] for another mesh.
    pub fn texcoords(&mut self, mesh: &Mesh, keep: KeepTextures<'_>) -> Result<()> {
        self.scene.check(mesh)?;
        set_texcoords(&mut self.edit, self.scene, mesh, keep).map(|_| ())
    }

    /// Materials are those of the file with the textures of `materials`, and the factors that go
    /// with them; `of` names the entry for each triangle of `mesh`, whose texture coordinates they
    /// use. Triangles whose entry is beyond the list keep what they have.
    ///
    /// # Errors
    /// As [`SceneEdit::texcoords`].
    pub fn materials(&mut self, mesh: &Mesh, materials: &[GlbMaterial], of: &[u32]) -> Result<()> {
        let mut roles: Vec<&str> = Vec::new();
        for material in materials {
            roles.extend(material.texture.as_ref().map(|_| BASE_COLOR));
            roles.extend(material.textures.iter().map(|t| t.0.as_str()));
        }
        self.scene.check(mesh)?;
        let coordinates = set_texcoords(&mut self.edit, self.scene, mesh, KeepTextures::But(&roles))?;
        set_materials(&mut self.edit, self.scene, &coordinates, materials, of);
        Ok(())
    }

    /// Vertices follow joints: the shape stays as it is shown, and moves with the joints from
    /// there. A skin that the file has is replaced.
    ///
    /// # Errors
    /// [`Error::Format`] for damage, or a joint that flattens space; [`Error::Input`] for other
    /// numbers of vertices or weights.
    pub fn skin(&mut self, skin: &SkinWeights<'_>) -> Result<()> {
        let vertices = self.scene.parts.last().map_or(0, |p| p.first_vertex + p.vertices);
        let rows = skin.weights.len() / skin.joints.len().max(1);
        let fits = skin.row_of.len() == vertices && skin.row_of.iter().all(|r| (*r as usize) < rows);
        if !fits || skin.joints.is_empty() || skin.joints.len() > usize::from(u16::MAX) || !(1..=2).contains(&skin.sets)
        {
            let what = format!("{rows} rows of weights of {} joints for {vertices} vertices", skin.joints.len());
            return Err(Error::input(what, "Give a row for each vertex, and at least one joint"));
        }
        set_skin(&mut self.edit, self.scene, skin)
    }

    /// The bytes of the file as GLB, and what the user should know of it.
    ///
    /// # Errors
    /// [`Error::Format`] for damage in parts that were not read before; [`Error::Mesh`] beyond the
    /// format's 4 GiB.
    pub fn finish(self) -> Result<(Vec<u8>, Vec<String>)> {
        self.edit.finish()
    }
}

#[cfg(test)]
#[path = "gltf_scene_tests/mod.rs"]
mod tests;
