//! Skin weights from and to GLB files, for `attributes`.

use std::path::Path;
use std::sync::Arc;

use crate::Result;
use crate::cli::common::{Session, Surface, usage};
use crate::cli::model_file::{finish, materials};
use crate::io::gltf_write::written_scene;
use crate::io::{GltfScene, SkinWeights};

/// Whether the name is that of a glTF file.
pub(crate) fn is_gltf(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("glb") || e.eq_ignore_ascii_case("gltf"))
}

/// A file with joints, and its nodes that the columns of a table are about.
pub(crate) struct Rig {
    scene: Arc<GltfScene>,
    joints: Vec<usize>,
}

/// Reads the skin weights of a glTF file: the names of its joints, the weights, and the joints.
pub(crate) fn read_weights(path: &Path) -> Result<(Vec<String>, Vec<f64>, Rig)> {
    let scene = crate::io::read_mesh(path)?.scene;
    let table = match &scene {
        Some(scene) => scene.skin_weights()?,
        None => None,
    };
    let (Some(scene), Some(table)) = (scene, table) else {
        let what = format!("{} has no skin", path.display());
        return Err(usage("--attributes", &what, "Name a glTF file with a rig, or a table"));
    };
    Ok((table.names, table.weights, Rig { scene, joints: table.joints }))
}

/// The joints that the columns of a table name, in the source's file or the target's.
pub(crate) fn rig_of(columns: &[String], source: &Surface, target: &Surface) -> Result<Rig> {
    let mut missing = None;
    for scene in [&source.scene, &target.scene].into_iter().flatten() {
        let Some(table) = scene.skin_weights()? else { continue };
        let place = |name: &String| table.names.iter().position(|n| n == name).map(|k| table.joints[k]);
        let joints: Vec<Option<usize>> = columns.iter().map(place).collect();
        match joints.iter().position(Option::is_none) {
            None => return Ok(Rig { scene: scene.clone(), joints: joints.into_iter().flatten().collect() }),
            Some(k) => missing = Some(columns[k].clone()),
        }
    }
    let what = match missing {
        Some(name) => format!("no joint is named {name:?}, as a column of the table is"),
        None => "a GLB file with weights needs joints, and neither the source nor the target has a skin".to_owned(),
    };
    Err(usage("--output", &what, "Give a source or target GLB with joints named as the columns, or write a table"))
}

/// Writes the target with the joints of `rig` and the weights.
pub(crate) fn write_weights(
    session: &Session<'_>,
    target: &Surface,
    rig: &Rig,
    weights: &[f64],
    top: Option<usize>,
    path: &Path,
) -> Result<()> {
    let mesh = &target.mesh;
    let (scene, sources): (Arc<GltfScene>, Vec<u32>) = match &target.scene {
        Some(scene) => (scene.clone(), (0..mesh.vertex_count() as u32).collect()),
        None => written_scene(mesh, &materials(session, mesh, path))?,
    };
    let row_of: Vec<u32> = sources.into_iter().map(|v| mesh.representative(v)).collect();
    let mut edit = scene.edit();
    edit.skin(&SkinWeights {
        rig: &rig.scene,
        joints: &rig.joints,
        row_of: &row_of,
        weights,
        sets: if top.is_some_and(|top| top > 4) { 2 } else { 1 },
    })?;
    crate::io::output::write_bytes(path, &finish(session, edit, path)?)
}
