//! Writing a mesh as the name of its file says, as GLB with all that the file it came from had.

use std::path::Path;

use barymap::geometry::Mesh;
use barymap::io::gltf_upright::turned_upright;
use barymap::io::gltf_write::{glb_bytes, own_materials};
use barymap::io::{GltfScene, KeepTextures, SceneEdit};
use barymap::{Result, io};

use crate::common::{Session, usage};

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

/// Writes a mesh in another shape than `scene` has, which it came from if there is one.
pub(crate) fn write_posed(
    session: &Session<'_>,
    mesh: &Mesh,
    scene: Option<&GltfScene>,
    format: ModelFormat,
    path: &Path,
) -> Result<()> {
    match (format, scene) {
        (ModelFormat::Obj, _) => io::write_obj(mesh, path),
        (ModelFormat::Ply, _) => io::write_ply(mesh, None, path),
        (ModelFormat::Glb, None) => write_glb(session, mesh, &glb_bytes(mesh, &own_materials(mesh)?)?, path),
        (ModelFormat::Glb, Some(scene)) => {
            let mut edit = scene.edit();
            edit.shape(mesh)?;
            io::output::write_bytes(path, &finish(session, edit, path)?)
        }
    }
}

/// Writes a mesh with other texture coordinates than `scene` has.
pub(crate) fn write_unwrapped(
    session: &Session<'_>,
    mesh: &Mesh,
    scene: Option<&GltfScene>,
    format: ModelFormat,
    path: &Path,
) -> Result<()> {
    match (format, scene) {
        (ModelFormat::Glb, Some(scene)) => {
            let mut edit = scene.edit();
            edit.texcoords(mesh, KeepTextures::No)?;
            io::output::write_bytes(path, &finish(session, edit, path)?)
        }
        (ModelFormat::Glb, None) => write_glb(session, mesh, &glb_bytes(mesh, &[])?, path),
        _ => io::write_obj(mesh, path),
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
    for note in &notes {
        session.warn(&format!("{}: {note}", path.display()));
    }
    Ok(turned_upright(&bytes, session.up())?.into_owned())
}
