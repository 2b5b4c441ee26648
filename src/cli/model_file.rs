//! Writing a mesh as the name of its file says, as GLB with all that the file it came from had.

use std::path::Path;

use crate::cli::common::{Session, usage};
use crate::geometry::Mesh;
use crate::io::gltf_animation::{animated_glb_bytes, animated_scene_bytes};
use crate::io::gltf_upright::turned_upright;
use crate::io::gltf_write::{glb_bytes, own_materials};
use crate::io::{GlbAnimation, GlbAnimationReport, GlbMaterial, GltfScene, KeepTextures, SceneEdit};
use crate::{Result, io};

/// The formats that a mesh is written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ModelFormat {
    Obj,
    Ply,
    Glb,
}

impl ModelFormat {
    /// The format that the ending of a name says, among `allowed`.
    pub(crate) fn of(path: &Path, allowed: &[Self]) -> Result<Self> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
        let named = match extension.as_deref() {
            Some("obj") => Some(Self::Obj),
            Some("ply") => Some(Self::Ply),
            Some("glb") => Some(Self::Glb),
            _ => None,
        };
        named.filter(|format| allowed.contains(format)).ok_or_else(|| {
            let endings: Vec<&str> = allowed.iter().map(|f| f.ending()).collect();
            let what = format!("{} names no format that holds this", path.display());
            usage("--output", &what, &format!("End the name in {}", endings.join(" or ")))
        })
    }

    fn ending(self) -> &'static str {
        match self {
            Self::Obj => ".obj",
            Self::Ply => ".ply",
            Self::Glb => ".glb",
        }
    }
}

/// What of a mesh is new.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum New {
    /// Positions and normals.
    Shape,
    /// Texture coordinates.
    Texcoords,
}

/// Writes a mesh; as GLB with all that `scene` has, which it came from if there is one.
pub(crate) fn write_model(
    session: &Session<'_>,
    mesh: &Mesh,
    scene: Option<&GltfScene>,
    new: New,
    format: ModelFormat,
    path: &Path,
) -> Result<()> {
    if let (New::Texcoords, false) = (new, format == ModelFormat::Glb && scene.is_some()) {
        warn_of_pictures(session, mesh);
    }
    if format != ModelFormat::Glb {
        warn_of_loss(session, scene, path);
    }
    match (format, scene) {
        (ModelFormat::Obj, _) => session.write_obj(mesh, path),
        (ModelFormat::Ply, _) => {
            let byte = |c: f32| (c.clamp(0.0, 1.0) * 255.0 + 0.5) as u8;
            let colors: Vec<[u8; 3]> = mesh.colors.iter().map(|c| [c[0], c[1], c[2]].map(byte)).collect();
            io::write_ply(mesh, (!colors.is_empty()).then_some(&colors[..]), path)
        }
        (ModelFormat::Glb, None) => {
            let materials = materials(session, mesh, path);
            write_glb(session, mesh, &glb_bytes(mesh, &materials)?, path)
        }
        (ModelFormat::Glb, Some(scene)) => {
            let mut edit = scene.edit();
            match new {
                New::Shape => edit.shape(mesh)?,
                New::Texcoords => edit.texcoords(mesh, KeepTextures::No)?,
            }
            io::output::write_bytes(path, &finish(session, edit, path)?)
        }
    }
}

/// The materials of the mesh; what of them cannot be written to `path` is told.
pub(crate) fn materials(session: &Session<'_>, mesh: &Mesh, path: &Path) -> Vec<GlbMaterial> {
    let (materials, notes) = own_materials(mesh);
    tell(session, &notes, path);
    materials
}

fn tell(session: &Session<'_>, notes: &[String], path: &Path) {
    for note in notes {
        session.warn(&format!("{}: {note}", path.display()));
    }
}

/// Tells what a file of a plain mesh has no place for.
pub(crate) fn warn_of_loss(session: &Session<'_>, scene: Option<&GltfScene>, path: &Path) {
    if let Some(what) = scene.and_then(GltfScene::beside_the_mesh) {
        session.warn(&format!(
            "{} has no place for what the input has beside its mesh ({what}); an output that ends in .glb keeps it",
            path.display()
        ));
    }
}

/// Tells of pictures that lie on coordinates that are replaced.
fn warn_of_pictures(session: &Session<'_>, mesh: &Mesh) {
    for material in mesh.materials.iter().filter(|m| m.roles().next().is_some()) {
        let roles: Vec<&str> = material.roles().collect();
        session.warn(&format!(
            "the textures of {:?} ({}) were made for the texture coordinates that are replaced",
            material.name,
            roles.join(", ")
        ));
    }
}

/// Writes the bytes of a GLB of `mesh`, turned to y up.
pub(crate) fn write_glb(session: &Session<'_>, mesh: &Mesh, bytes: &[u8], path: &Path) -> Result<()> {
    session.warn_of_up(mesh);
    io::output::write_bytes(path, &turned_upright(bytes, session.up())?)
}

/// The bytes of a changed scene, turned to y up; what the user should know of it is told.
pub(crate) fn finish(session: &Session<'_>, edit: SceneEdit<'_>, path: &Path) -> Result<Vec<u8>> {
    let (bytes, notes) = edit.finish()?;
    upright(session, &bytes, &notes, path)
}

/// Writes `mesh` with an animation; with all that `scene` has, which it came from if there is one.
pub(crate) fn write_animation(
    session: &Session<'_>,
    mesh: &Mesh,
    scene: Option<&GltfScene>,
    animation: &GlbAnimation<'_>,
    path: &Path,
) -> Result<GlbAnimationReport> {
    let Some(scene) = scene else {
        let (bytes, report) = animated_glb_bytes(mesh, &materials(session, mesh, path), animation)?;
        write_glb(session, mesh, &bytes, path)?;
        return Ok(report);
    };
    let (bytes, notes, report) = animated_scene_bytes(scene, mesh, animation)?;
    io::output::write_bytes(path, &upright(session, &bytes, &notes, path)?)?;
    Ok(report)
}

fn upright(session: &Session<'_>, bytes: &[u8], notes: &[String], path: &Path) -> Result<Vec<u8>> {
    tell(session, notes, path);
    Ok(turned_upright(bytes, session.up())?.into_owned())
}
