//! The last steps of every reader: joining equal values, checking indices and positions.

use std::collections::HashMap;
use std::path::Path;

use glam::DVec2;

use super::LoadedMesh;
use super::source::Notes;
use crate::geometry::{MeshBuilder, NONE};
use crate::{Error, Result};

/// Numbers texture coordinates so that corners of one vertex with equal values share an index,
/// which keeps charts connected in files that store one per corner.
#[derive(Debug, Default)]
pub(crate) struct TexcoordPool {
    index: HashMap<(u32, u64, u64), u32>,
}

impl TexcoordPool {
    /// The index of `uv` at `vertex`, appended to `texcoords` where it is new; [`NONE`] where it is
    /// not finite.
    pub(crate) fn add(&mut self, vertex: u32, uv: DVec2, texcoords: &mut Vec<DVec2>) -> u32 {
        if !uv.is_finite() {
            return NONE;
        }
        // Adding zero makes -0 equal to 0.
        let key = (vertex, (uv.x + 0.0).to_bits(), (uv.y + 0.0).to_bits());
        *self.index.entry(key).or_insert_with(|| {
            texcoords.push(uv);
            texcoords.len() as u32 - 1
        })
    }
}

/// Checks what a reader has collected and builds the mesh.
///
/// # Errors
/// A vertex index out of range, a position that is not finite and used by a polygon, no triangle at
/// all.
pub(crate) fn finish(builder: MeshBuilder, notes: Notes, path: &Path) -> Result<LoadedMesh> {
    finish_as(builder, notes, path, Faces::Needed)
}

/// Whether a mesh must have faces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Faces {
    Needed,
    /// Points alone will do.
    Optional,
}

/// As [`finish`]; without a triangle only where faces are needed.
pub(crate) fn finish_as(mut builder: MeshBuilder, mut notes: Notes, path: &Path, faces: Faces) -> Result<LoadedMesh> {
    let mesh = &builder.mesh;
    let count = mesh.positions.len();
    for p in 0..mesh.polygon_count() {
        for c in mesh.polygon(p) {
            let Some(position) = mesh.positions.get(c.vertex as usize) else {
                let what = format!("face {p} refers to vertex {} (counted from 0), the file has {count}", c.vertex);
                return Err(Error::format(path, None, what, "The file is damaged or cut short: export the mesh again"));
            };
            if !position.is_finite() {
                let what = format!("the position of vertex {} is not finite, and face {p} uses it", c.vertex);
                return Err(Error::format(path, None, what, "Correct the vertex or remove the face"));
            }
        }
    }
    if faces == Faces::Needed && !builder.has_faces() {
        let what = format!("there is no face with three or more corners ({count} vertices)");
        return Err(Error::format(path, None, what, "Export a surface mesh, with faces"));
    }
    let bad = mesh.positions.iter().filter(|p| !p.is_finite()).count();
    if bad > 0 {
        notes.say(format!("positions that are not finite, used by no face: {bad}"));
    }
    let bad: Vec<bool> = mesh.texcoords.iter().map(|t| !t.is_finite()).collect();
    let normals = mesh.normals.len();
    for c in builder.corners_mut() {
        if bad.get(c.texcoord as usize).is_none_or(|bad| *bad) && c.texcoord != NONE {
            c.texcoord = NONE;
            notes.count("face corners whose texture coordinates are not finite or missing", None);
        }
        if c.normal as usize >= normals {
            c.normal = NONE;
        }
    }
    Ok(LoadedMesh { mesh: builder.build()?, warnings: notes.into_warnings(), scene: None })
}
