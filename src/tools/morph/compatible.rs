//! A mesh of one connectivity on the shape of another: the triangles of A with their vertices where
//! a map takes them on B (Panozzo et al. 2013, section 4.3, Fig. 14), mended where it folds.

use glam::DVec3;

use super::untangle::{Images, Mended};
use crate::error::{Error, Result};
use crate::geometry::{Frame, Mesh, NONE, SurfacePoint, Topology};
use crate::surface::quality::{distortion, vertex_normals};
use crate::surface::{PointMap, Status};
use crate::tools::attributes::harmonic;
use crate::tools::vertex_map::vertex_map;

/// The mesh A in the shape of B.
#[derive(Clone, Debug)]
pub struct Compatible {
    /// A with other positions, and without its normals, which would be wrong.
    pub mesh: Mesh,
    /// What is known of it.
    pub report: CompatibleReport,
}

/// What is known of a [`Compatible`] mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CompatibleReport {
    /// Vertices that the map vouches for.
    pub valid: usize,
    /// Vertices with an image that it does not vouch for.
    pub doubtful: usize,
    /// Vertices without an image, filled in between the others.
    pub filled: usize,
    /// Triangles that were turned over on B, or collapsed, before anything was mended.
    pub bad_before: usize,
    /// Those that are left, and triangles that oppose the ones around them.
    pub bad: usize,
    /// Their share of A's area.
    pub bad_area: f64,
    /// Vertices that were moved to mend them.
    pub moved: usize,
    /// Largest distance of a vertex from the surface of B, over the square root of its area.
    pub off: f64,
    /// Symmetrised L2 stretch efficiency of A on B ([`distortion`]).
    pub stretch_all: f64,
    /// The same over the best 95 % of the area.
    pub stretch_best95: f64,
    /// Edges that became more than [`LONG`] times longer than the meshes' sizes let expect.
    pub long_edges: usize,
}

/// How much longer than expected an edge may become before it is counted.
pub const LONG: f64 = 4.0;

/// Takes the vertices of `a` to `b` by `map`, which maps points of `a` (the target of a
/// correspondence) to points of `b` (its source), and mends what is folded or collapsed: patches
/// around it are relaxed on `b`, their borders and the vertices `held` kept. Vertices without an
/// image get the smoothest positions between the others.
///
/// O(V log V) and the map; patches are small.
///
/// # Errors
/// Those of the map; [`Error::Input`] if a part of `a` has no image at all.
pub fn compatible_mesh(
    a: (&Mesh, &Topology),
    b: (&Mesh, &Topology),
    map: &dyn PointMap,
    held: &[SurfacePoint],
) -> Result<Compatible> {
    let (mesh, topology) = a;
    let found = vertex_map(b, a, map)?;
    // In the frame of `b`, where places do not round.
    let frame = Frame::of_mesh(b.0);
    let surface = frame.mesh(b.0);
    let used = |v: usize| topology.vertex_component[v] != NONE;
    let known: Vec<bool> = found.positions.iter().map(Option::is_some).collect();
    let mut flat: Vec<f64> =
        found.images.iter().flat_map(|i| i.point().map_or(DVec3::ZERO, |p| frame.place(&p, b.0)).to_array()).collect();
    let filled = (0..known.len()).filter(|&v| used(v) && !known[v]).count();
    if filled > 0 {
        let mut reached = vec![false; topology.component_count as usize];
        for v in (0..known.len()).filter(|&v| used(v) && known[v]) {
            reached[topology.vertex_component[v] as usize] = true;
        }
        if let Some(c) = reached.iter().position(|r| !r) {
            return Err(Error::input(
                format!("component {c} of {} has no image on {}", mesh.name, b.0.name),
                "Give anchors on each part, or remove the part",
            ));
        }
        harmonic(a, &known, 3, &mut flat)?;
    }
    let positions: Vec<DVec3> = flat.chunks_exact(3).map(DVec3::from_slice).collect();
    let mut fixed = vec![false; positions.len()];
    for p in held {
        let corner = p.dominant_corner();
        if p.barycentric[corner] > 1.0 - 1e-6 {
            fixed[mesh.triangle(p.face as usize)[corner] as usize] = true;
        }
    }
    let begun = positions.clone();
    let own = Frame::of_mesh(mesh).mesh(mesh);
    let mut images = Images::new((&own, topology), (&surface, b.1), positions);
    let Mended { before, left, moved } = images.mend(&fixed);
    let off = images.farthest_off() / surface.area().sqrt();
    let mut made = super::without_normals(mesh);
    made.positions.clone_from(&images.at);
    let image_topology = Topology::new(&made);
    let all: Vec<Option<DVec3>> = made.positions.iter().map(|p| Some(*p)).collect();
    let d = distortion(mesh, topology, &all, &vertex_normals(&made, &image_topology), made.area());
    let long_edges = long_edges(mesh, topology, &made);
    made.positions = (0..mesh.vertex_count())
        .map(|v| match found.positions[v] {
            // What was not mended is the point of `b` as it is there.
            Some(p) if images.at[v] == begun[v] => p,
            _ if used(v) => frame.world(images.at[v]),
            _ => mesh.positions[v],
        })
        .collect();
    mesh.spread_positions(&mut made.positions, |_| false);
    made.name = format!("{} on {}", mesh.name, b.0.name);
    let count = |s: Status| {
        found
            .images
            .iter()
            .zip(&known)
            .enumerate()
            .filter(|(v, (i, known))| used(*v) && **known && i.status() == s)
            .count()
    };
    let valid = count(Status::Valid);
    let report = CompatibleReport {
        valid,
        doubtful: known.iter().enumerate().filter(|(v, k)| used(*v) && **k).count() - valid,
        filled,
        bad_before: before,
        bad: left.len(),
        bad_area: left.iter().map(|&t| mesh.triangle_area(t as usize)).sum::<f64>() / mesh.area() + 0.0,
        moved,
        off,
        stretch_all: d.stretch_all,
        stretch_best95: d.stretch_best95,
        long_edges,
    };
    Ok(Compatible { mesh: made, report })
}

/// Edges that grew more than [`LONG`] times as much as the square root of the area.
fn long_edges(rest: &Mesh, topology: &Topology, made: &Mesh) -> usize {
    let ratio = (made.area() / rest.area()).sqrt();
    let mut edges: Vec<[u32; 2]> = topology
        .triangles
        .iter()
        .zip(&topology.usable)
        .filter(|(_, usable)| **usable)
        .flat_map(|(t, _)| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]])
        .map(|[i, j]| [i.min(j), i.max(j)])
        .collect();
    edges.sort_unstable();
    edges.dedup();
    let length = |mesh: &Mesh, e: &[u32; 2]| mesh.positions[e[0] as usize].distance(mesh.positions[e[1] as usize]);
    edges.iter().filter(|e| length(made, e) > LONG * ratio * length(rest, e)).count()
}

#[cfg(test)]
#[path = "compatible_tests.rs"]
mod tests;
