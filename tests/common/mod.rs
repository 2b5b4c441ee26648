//! What several test binaries need.

use std::path::PathBuf;

use barymap::geometry::Mesh;
use glam::DVec3;

/// The folder of real models, if `BARYMAP_DATA` names it.
pub(crate) fn data(file: &str) -> Option<PathBuf> {
    std::env::var_os("BARYMAP_DATA").map(|folder| PathBuf::from(folder).join(file))
}

/// Positions and faces of an OBJ file of the data folder; `None` (said aloud) without that folder.
///
/// # Panics
/// If the file is missing or is not what is expected.
pub(crate) fn load(file: &str) -> Option<Mesh> {
    let Some(path) = data(file) else {
        eprintln!("ignored: {file} is needed, BARYMAP_DATA is not set");
        return None;
    };
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for line in text.lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let p: Vec<f64> = words.take(3).map(|w| w.parse().unwrap()).collect();
                positions.push(DVec3::from_slice(&p));
            }
            Some("f") => {
                let corner = |w: &str| w.split('/').next().unwrap().parse::<u32>().unwrap() - 1;
                let c: Vec<u32> = words.map(corner).collect();
                triangles.extend((2..c.len()).map(|k| [c[0], c[k - 1], c[k]]));
            }
            _ => {}
        }
    }
    Some(Mesh::from_triangles(file, positions, &triangles))
}
