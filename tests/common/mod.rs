//! What several test programs need: the folder of real models, flat meshes.
#![allow(dead_code, reason = "each test program uses a part of this")]

pub(crate) mod flat;

use std::path::PathBuf;

use barymap::geometry::Mesh;

/// A file of the folder that `BARYMAP_DATA` names; tests that need one are ignored unless asked
/// for.
///
/// # Panics
/// If `BARYMAP_DATA` is not set.
pub(crate) fn data(file: &str) -> PathBuf {
    let folder = std::env::var_os("BARYMAP_DATA").expect("BARYMAP_DATA names the folder of real models");
    PathBuf::from(folder).join(file)
}

/// A mesh of that folder.
///
/// # Panics
/// If it cannot be read.
pub(crate) fn load(file: &str) -> Mesh {
    barymap::io::read_mesh(data(file)).unwrap_or_else(|e| panic!("{e}")).mesh
}
