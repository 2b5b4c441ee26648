//! What a quad mesh on a surface is like.

use glam::DVec3;
use rayon::prelude::*;

use super::quads::Polygons;
use crate::geometry::{ClosestPoints, Mesh, SurfacePoint, Topology};
use crate::surface::quality::{normal_at, vertex_normals};

/// Lengths of edges.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct EdgeLengths {
    /// The shortest.
    pub least: f64,
    /// The longest.
    pub most: f64,
    /// The mean.
    pub mean: f64,
    /// The variance.
    pub variance: f64,
}

/// Angles of corners, in degrees.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Angles {
    /// The smallest.
    pub least: f64,
    /// The largest.
    pub most: f64,
    /// Mean distance from a right angle.
    pub off_right: f64,
}

/// Distances between a quad mesh and the surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Distances {
    /// Of the vertices from the surface, the largest, found by a search that knows nothing of how
    /// they were made.
    pub vertices: f64,
    /// Of the middles of faces from the surface, the largest.
    pub middles: f64,
    /// The same, their mean.
    pub middles_mean: f64,
    /// Of the vertices of the surface from the quads cut into triangles, the largest.
    pub surface: f64,
    /// The same, their mean.
    pub surface_mean: f64,
}

/// Faces that lie the wrong way on the surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Turned {
    /// Faces whose area vector points into the surface, against most others.
    pub inverted: usize,
    /// Faces with a corner that turns the wrong way, inverted ones included.
    pub folded: usize,
}

pub(super) fn edge_lengths(edges: &[[u32; 2]], positions: &[DVec3]) -> EdgeLengths {
    let lengths: Vec<f64> =
        edges.iter().map(|[a, b]| positions[*a as usize].distance(positions[*b as usize])).collect();
    let n = lengths.len().max(1) as f64;
    let mean = lengths.iter().sum::<f64>() / n;
    EdgeLengths {
        least: lengths.iter().copied().fold(f64::INFINITY, f64::min),
        most: lengths.iter().copied().fold(0.0, f64::max),
        mean,
        variance: lengths.iter().map(|l| (l - mean) * (l - mean)).sum::<f64>() / n,
    }
}

pub(super) fn angles(polygons: &Polygons, positions: &[DVec3]) -> Angles {
    let mut found = Angles { least: 180.0, ..Angles::default() };
    let mut count = 0usize;
    for p in 0..polygons.len() {
        let c = polygons.polygon(p);
        let at = |k: usize| positions[c[k % c.len()] as usize];
        for k in 0..c.len() {
            let (e, f) = (at(k + 1) - at(k), at(k + c.len() - 1) - at(k));
            let angle = e.cross(f).length().atan2(e.dot(f)).to_degrees();
            found.least = found.least.min(angle);
            found.most = found.most.max(angle);
            found.off_right += (angle - 90.0).abs();
            count += 1;
        }
    }
    found.off_right /= count.max(1) as f64;
    found
}

pub(super) fn turned(
    polygons: &Polygons,
    positions: &[DVec3],
    points: &[SurfacePoint],
    (mesh, topology): (&Mesh, &Topology),
) -> Turned {
    let normals = vertex_normals(mesh, topology);
    let up: Vec<DVec3> = points.iter().map(|p| normal_at(mesh, &normals, p)).collect();
    // Of each face how its area vector stands to the surface, and whether each corner does so too.
    let sides: Vec<(f64, f64, f64)> = (0..polygons.len())
        .map(|p| {
            let c = polygons.polygon(p);
            let n = c.len();
            let at = |k: usize| positions[c[k % n] as usize];
            let middle = c.iter().fold(DVec3::ZERO, |sum, &v| sum + up[v as usize]);
            let area = (1..n - 1).fold(DVec3::ZERO, |sum, k| sum + (at(k) - at(0)).cross(at(k + 1) - at(0)));
            let corner = |k: usize| (at(k + 1) - at(k)).cross(at(k + n - 1) - at(k)).dot(up[c[k] as usize]);
            let corners = (0..n).map(corner);
            (area.dot(middle), corners.clone().fold(f64::INFINITY, f64::min), corners.fold(f64::NEG_INFINITY, f64::max))
        })
        .collect();
    // A base mesh may be oriented against the surface as a whole.
    let along = sides.iter().map(|s| s.0).sum::<f64>() >= 0.0;
    let wrong = |x: f64| if along { x <= 0.0 } else { x >= 0.0 };
    Turned {
        inverted: sides.iter().filter(|s| wrong(s.0)).count(),
        folded: sides.iter().filter(|s| wrong(s.0) || wrong(if along { s.1 } else { s.2 })).count(),
    }
}

pub(super) fn distances(polygons: &Polygons, quads: &Mesh, (mesh, closest): (&Mesh, &ClosestPoints)) -> Distances {
    let from = |points: &[DVec3], to: &ClosestPoints| -> (f64, f64) {
        let d: Vec<f64> = points.par_iter().map(|p| to.nearest(*p).map_or(0.0, |n| n.1)).collect();
        (d.iter().copied().fold(0.0, f64::max), d.iter().sum::<f64>() / d.len().max(1) as f64)
    };
    let positions = &quads.positions;
    let middles: Vec<DVec3> = (0..polygons.len())
        .map(|p| {
            let c = polygons.polygon(p);
            c.iter().fold(DVec3::ZERO, |sum, &v| sum + positions[v as usize]) / c.len() as f64
        })
        .collect();
    let back = ClosestPoints::new(quads, &Topology::new(quads));
    let used: Vec<DVec3> = {
        let mut seen = vec![false; mesh.vertex_count()];
        mesh.triangles().iter().flatten().for_each(|&v| seen[v as usize] = true);
        mesh.positions.iter().zip(seen).filter(|(_, s)| *s).map(|(p, _)| *p).collect()
    };
    let (vertices, _) = from(positions, closest);
    let (middles, middles_mean) = from(&middles, closest);
    let (surface, surface_mean) = from(&used, &back);
    Distances { vertices, middles, middles_mean, surface, surface_mean }
}
