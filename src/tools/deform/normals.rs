//! Normals of the file, turned as the surface around their vertices turns.

use glam::DVec3;
use rayon::prelude::*;

use crate::encoding::{Connectivity, Similarity};
use crate::geometry::{Mesh, NONE};

/// Turns the normals of `mesh`, whose positions are already the new ones, from the rest positions
/// `rest`: each by the rotation that fits its vertex's ring best; one that several corners share by
/// the mean of their rotations. Normals that no corner names stay.
pub(in crate::tools) fn turn_normals(mesh: &mut Mesh, connectivity: &Connectivity, rest: &[DVec3]) {
    if mesh.normals.is_empty() {
        return;
    }
    let positions = &mesh.positions;
    let turns: Vec<glam::DMat3> = (0..rest.len())
        .into_par_iter()
        .map(|v| {
            let ring = &connectivity.rings[v];
            let around = ring.iter().map(|&u| u as usize).chain(std::iter::once(v));
            // About the vertex: far from the origin means of positions round.
            let pairs: Vec<(DVec3, DVec3)> = around.map(|u| (rest[u] - rest[v], positions[u] - positions[v])).collect();
            if ring.is_empty() { glam::DMat3::IDENTITY } else { Similarity::fit(&pairs).rotation }
        })
        .collect();
    let mut turned = vec![DVec3::ZERO; mesh.normals.len()];
    for p in 0..mesh.polygon_count() {
        for corner in mesh.polygon(p).iter().filter(|c| c.normal != NONE) {
            turned[corner.normal as usize] += turns[corner.vertex as usize] * mesh.normals[corner.normal as usize];
        }
    }
    for (normal, turned) in mesh.normals.iter_mut().zip(turned) {
        // Lengths stay as they were in the file.
        let length = normal.length();
        *normal = turned.try_normalize().map_or(*normal, |n| n * length);
    }
}
