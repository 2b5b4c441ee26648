//! Where the next pairs made by hand would help most.

use crate::error::Result;
use crate::geometry::{Frame, Geodesics, March, SurfacePoint};
use crate::surface::AnchorPairs;
use crate::surface::correspondence::{CorrespondenceOptions, Method, Shape, Trust, correspondence};
use crate::tools::vertex_map::vertex_map;

/// A place where a pair would help.
#[derive(Clone, Debug, PartialEq)]
pub struct Suggestion {
    /// A vertex of the target.
    pub vertex: u32,
    /// Where the map sends it now.
    pub guess: Option<SurfacePoint>,
    /// The error expected there, over the square root of the source's area.
    pub expected_error: f64,
}

/// Error at which nothing is known.
const LARGEST: f64 = 1.0;

/// The `count` vertices of the target where another pair would help most, best first; fewer if
/// there are no more apart from the anchors.
///
/// A vertex counts with the larger of the drift that left out anchors foretell there (spread over
/// the surface, it grows with the distance of the nearest anchor) and of its distance from where
/// the maps there and back lead. A vertex chosen takes its surroundings along: what is nearer to it
/// than to any anchor counts in proportion.
///
/// # Errors
/// As [`correspondence`].
pub fn suggest(source: Shape<'_>, target: Shape<'_>, pairs: &AnchorPairs, count: usize) -> Result<Vec<Suggestion>> {
    let options = CorrespondenceOptions { method: Method::Field, ..CorrespondenceOptions::default() };
    let around = |s: Shape<'_>, t: Shape<'_>, pairs: &AnchorPairs| {
        let map = correspondence(s, t, pairs, &options)?;
        vertex_map((s.mesh, s.topology), (t.mesh, t.topology), map.as_ref())
    };
    let there = around(source, target, pairs)?;
    let back = around(target, source, &super::propose::swapped(pairs))?;
    let (mesh, topology) = (target.mesh, target.topology);
    let (length, frame) = (mesh.area().sqrt(), Frame::of_mesh(mesh));
    let half = Trust::default().drift;
    let n = mesh.vertex_count();
    let error: Vec<f64> = (0..n)
        .map(|v| {
            let image = &there.images[v];
            let Some(p) = image.point() else { return LARGEST };
            // No confidence at all says that a triangle is turned over, or that there are too few
            // anchors, not by how much the image is off.
            let confidence = f64::from(image.confidence);
            let drift = if confidence > 0.0 { half * (1.0 / confidence - 1.0).max(0.0).sqrt() } else { 0.0 };
            let corners = source.topology.triangles[p.face as usize];
            let cycle = (0..3)
                .map(|k| back.images[corners[k] as usize].point().map(|q| p.barycentric[k] * frame.place(&q, mesh)))
                .sum::<Option<glam::DVec3>>()
                .map_or(LARGEST, |q| q.distance(frame.local(mesh.positions[v])) / (length * frame.scale));
            drift.max(cycle).min(LARGEST)
        })
        .collect();
    let usable: Vec<[u32; 3]> =
        topology.triangles.iter().zip(&topology.usable).filter(|(_, u)| **u).map(|(t, _)| *t).collect();
    let geodesics = Geodesics::of(&mesh.positions, &usable);
    let mut anchored = March::default();
    geodesics.clear(&mut anchored);
    for p in &pairs.target {
        geodesics.add_source(topology.triangles[p.face as usize][p.dominant_corner()], &mut anchored);
    }
    let distance = anchored.distances.clone();
    let mut out: Vec<Suggestion> = Vec::new();
    while out.len() < count {
        // Anchors and earlier choices take the error away in proportion to their distance.
        let left = |v: usize| {
            let d = anchored.distances[v];
            if distance[v].is_finite() {
                error[v] * (d / distance[v].max(f64::MIN_POSITIVE)).min(1.0)
            } else if d.is_finite() {
                error[v] * (d / length).min(1.0)
            } else {
                LARGEST
            }
        };
        let next = (0..n)
            .filter(|&v| !topology.vertex_triangles(v as u32).is_empty() && anchored.distances[v] > 0.0)
            .max_by(|&a, &b| left(a).total_cmp(&left(b)).then(b.cmp(&a)));
        let Some(v) = next.filter(|&v| left(v) > 0.0) else { break };
        out.push(Suggestion { vertex: v as u32, guess: there.images[v].point(), expected_error: error[v] });
        geodesics.add_source(v as u32, &mut anchored);
    }
    Ok(out)
}
