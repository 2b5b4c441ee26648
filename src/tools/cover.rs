//! Which part of a surface its anchors cover, and where one is missing (paper, section 4.4).

use crate::error::Result;
use crate::geometry::{Frame, Geodesics, March};
use crate::surface::AnchorPairs;
use crate::surface::correspondence::{CorrespondenceOptions, Method, Shape, correspondence};

use super::vertex_map::vertex_map;

/// How well a set of anchors covers a surface.
#[derive(Clone, Debug)]
#[doc(hidden)]
pub struct Cover {
    /// For each vertex the distance, in mean edges, between it and where inverse and forward
    /// problem lead back to; infinite where nothing was found.
    pub round_trip: Vec<f64>,
    /// Share of the area whose vertices all return within one mean edge.
    pub covered_fraction: f64,
    /// Vertices where another anchor would help most, best first.
    pub proposals: Vec<u32>,
}

/// Solves inverse and forward problem for every vertex with the anchors of one surface.
///
/// A vertex counts as covered if it returns within one mean edge. Proposals are uncovered vertices,
/// each as far as possible along the surface from all anchors and earlier proposals; at most
/// `proposals` of them. O(n) problems and one fast march per anchor.
///
/// # Errors
/// As [`correspondence`].
pub fn cover(
    shape: Shape<'_>,
    anchors: &[crate::geometry::SurfacePoint],
    proposals: usize,
    options: &CorrespondenceOptions,
) -> Result<Cover> {
    let pairs = AnchorPairs { source: anchors.to_vec(), target: anchors.to_vec() };
    let options = CorrespondenceOptions { method: Method::Averages, confidence: false, ..*options };
    let map = correspondence(shape, shape, &pairs, &options)?;
    let (mesh, topology) = (shape.mesh, shape.topology);
    let found = vertex_map((mesh, topology), (mesh, topology), map.as_ref())?;
    let edge = mesh.mean_edge_length();
    let frame = Frame::of_mesh(mesh).in_units();
    let round_trip: Vec<f64> = found
        .images
        .iter()
        .zip(&mesh.positions)
        .map(|(image, p)| {
            image.point().map_or(f64::INFINITY, |q| frame.place(&q, mesh).distance(frame.local(*p)) / edge)
        })
        .collect();
    let covered = |v: u32| round_trip[v as usize] <= 1.0;
    let (mut all, mut good) = (0.0, 0.0);
    for t in (0..mesh.triangle_count()).filter(|&t| topology.usable[t]) {
        let area = mesh.triangle_area(t);
        all += area;
        if mesh.triangle(t).into_iter().all(covered) {
            good += area;
        }
    }
    let usable: Vec<[u32; 3]> =
        (0..mesh.triangle_count()).filter(|&t| topology.usable[t]).map(|t| mesh.triangle(t)).collect();
    let geodesics = Geodesics::of(&mesh.positions, &usable);
    let mut march = March::default();
    geodesics.clear(&mut march);
    for anchor in anchors {
        let corner = anchor.dominant_corner();
        geodesics.add_source(mesh.triangle(anchor.face as usize)[corner], &mut march);
    }
    let mut chosen = Vec::new();
    while chosen.len() < proposals {
        let distance = &march.distances;
        let candidate = (0..mesh.vertex_count() as u32)
            .filter(|&v| !topology.vertex_triangles(v).is_empty() && !covered(v) && distance[v as usize] > 0.0)
            .max_by(|&a, &b| distance[a as usize].total_cmp(&distance[b as usize]).then(b.cmp(&a)));
        let Some(v) = candidate else { break };
        chosen.push(v);
        geodesics.add_source(v, &mut march);
    }
    Ok(Cover { round_trip, covered_fraction: if all > 0.0 { good / all } else { 0.0 }, proposals: chosen })
}
