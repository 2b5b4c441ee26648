//! Files: meshes, images, anchors, points, arrays, reports and the cache.
//!
//! Readers take what real files hold: they tell what they passed over in warnings, and what cannot be used in errors that name the file, the
//! line and the remedy. No header makes them allocate more than the file can fill. Writers go through [`output`], so that a file appears whole
//! or not at all.

pub mod anchors;
mod assemble;
mod gltf_document;
pub mod gltf_read;
pub mod gltf_write;
pub mod image_file;
mod material_library;
pub mod obj;
pub mod obj_write;
pub mod off;
pub mod output;
pub mod ply;
mod ply_header;
mod source;

use crate::geometry::Mesh;

/// A mesh read from a file, with what was passed over or mended on the way.
#[derive(Clone, Debug)]
pub struct LoadedMesh {
    /// The mesh.
    pub mesh: Mesh,
    /// One sentence each; empty for a clean file.
    pub warnings: Vec<String>,
}
