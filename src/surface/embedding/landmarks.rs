//! Choosing landmarks and measuring the geodesic distances between them.

use std::collections::HashMap;

use glam::DVec3;
use web_time::Instant;

use super::parts::Part;
use super::{EmbeddingOptions, Sampling, Seconds, together};
use crate::control;
use crate::error::Result;
use crate::geometry::sampling::farthest_points;
use crate::geometry::{Geodesics, SimplifyOptions, simplify};
use crate::progress::Progress;

/// Distances closer to zero than this part of the largest are raised to it: their weights would
/// drown all others.
const LEAST_DISTANCE: f64 = 1e-6;
/// Edges between landmarks chosen by decimation are no longer than this many times their mean
/// spacing, so that flat parts keep some. Measured between 2 (like farthest points) and infinity
/// (as in the paper): 3 to 4 is best on bodies and not much worse than farthest points on tori.
const LANDMARK_EDGE: f64 = 3.0;
/// Edges of the mid-level mesh are no longer than this many times the spacing of its vertices.
const MID_EDGE: f64 = 3.0;

/// Landmarks of a part, in its own numbering, with the symmetric matrix of their distances.
pub(crate) struct Landmarks {
    pub(crate) vertices: Vec<u32>,
    pub(crate) distances: Vec<f64>,
}

/// The mesh that distances are measured on: the part, simplified to `options.mid_level` vertices if
/// it has more.
struct MidLevel {
    /// Vertices of the part, ascending.
    vertices: Vec<u32>,
    positions: Vec<DVec3>,
    /// In its own numbering.
    triangles: Vec<[u32; 3]>,
}

impl MidLevel {
    /// `count` is the number of landmarks asked for: there are four times as many vertices, if the
    /// part has them.
    fn new(part: &Part, count: usize, options: &EmbeddingOptions) -> Result<Self> {
        let n = part.vertices.len();
        let mid = options.mid_level.max(4 * count);
        let all: Vec<u32> = (0..n as u32).collect();
        let (mut vertices, mut triangles) = (all, part.triangles.clone());
        if n > mid + mid / 4 {
            let longest_edge = MID_EDGE * (part.area / mid as f64).sqrt();
            let simple = simplify(&part.positions, &triangles, &SimplifyOptions { vertices: mid, longest_edge })?;
            (vertices, triangles) = (simple.vertices, simple.triangles);
        }
        let own: HashMap<u32, u32> = vertices.iter().enumerate().map(|(i, &v)| (v, i as u32)).collect();
        let positions: Vec<DVec3> = vertices.iter().map(|&v| part.positions[v as usize]).collect();
        let triangles: Vec<[u32; 3]> = triangles.iter().map(|t| t.map(|v| own[&v])).collect();
        Ok(Self { vertices, positions, triangles })
    }

    fn geodesics(&self) -> Geodesics {
        Geodesics::of(&self.positions, &self.triangles)
    }
}

/// Chooses up to `count` landmarks. Distances are measured on a simplified mesh of
/// `options.mid_level` vertices if the part has more.
pub(crate) fn choose(
    part: &Part,
    count: usize,
    options: &EmbeddingOptions,
    seconds: &mut Seconds,
    progress: &dyn Progress,
) -> Result<Landmarks> {
    let clock = Instant::now();
    progress.stage("simplification", 1);
    let mid = MidLevel::new(part, count, options)?;
    seconds.simplification += clock.elapsed().as_secs_f64();
    let clock = Instant::now();
    progress.stage("landmarks", 1);
    let geodesics = mid.geodesics();
    let chosen: Vec<u32> = if count >= mid.vertices.len() {
        (0..mid.vertices.len() as u32).collect()
    } else {
        match options.sampling {
            Sampling::FarthestPoint => farthest_points(&geodesics, 0, count),
            Sampling::Decimation => decimated(part, &geodesics, &mid.positions, &mid.triangles, count)?,
        }
    };
    seconds.sampling += clock.elapsed().as_secs_f64();
    let clock = Instant::now();
    control::check()?;
    let distances = distances(&geodesics, &chosen, progress)?;
    seconds.geodesics += clock.elapsed().as_secs_f64();
    Ok(Landmarks { vertices: chosen.into_iter().map(|v| mid.vertices[v as usize]).collect(), distances })
}

/// The distances between landmarks that [`choose`] gave for the same part, `count` and options,
/// measured again; `None` if some are not among the vertices that distances are measured on.
pub(crate) fn measure(
    part: &Part,
    count: usize,
    landmarks: &[u32],
    options: &EmbeddingOptions,
    progress: &dyn Progress,
) -> Result<Option<Vec<f64>>> {
    let mid = MidLevel::new(part, count, options)?;
    let own: HashMap<u32, u32> = mid.vertices.iter().enumerate().map(|(i, &v)| (v, i as u32)).collect();
    let chosen: Option<Vec<u32>> = landmarks.iter().map(|v| own.get(v).copied()).collect();
    chosen.map(|chosen| distances(&mid.geodesics(), &chosen, progress)).transpose()
}

/// The symmetric matrix of the distances between vertices.
fn distances(geodesics: &Geodesics, chosen: &[u32], progress: &dyn Progress) -> Result<Vec<f64>> {
    progress.stage("geodesic distances", chosen.len() as u64);
    let here = control::current();
    let raw = together::matrix(geodesics, chosen, || {
        progress.advance(1);
        here.check()
    })?;
    let m = chosen.len();
    let largest = raw.iter().copied().fold(0.0, f64::max);
    Ok((0..m * m)
        .map(|k| {
            let (i, j) = (k / m, k % m);
            if i == j { 0.0 } else { (0.5 * (raw[k] + raw[j * m + i])).max(LEAST_DISTANCE * largest) }
        })
        .collect())
}

/// The vertices that simplification to `count` leaves over.
fn decimated(
    part: &Part,
    geodesics: &Geodesics,
    positions: &[DVec3],
    triangles: &[[u32; 3]],
    count: usize,
) -> Result<Vec<u32>> {
    let longest_edge = LANDMARK_EDGE * (part.area / count as f64).sqrt();
    let mut left = simplify(positions, triangles, &SimplifyOptions { vertices: count, longest_edge })?;
    if left.vertices.len() > count {
        left = simplify(positions, &left.triangles, &SimplifyOptions { vertices: count, longest_edge: f64::INFINITY })?;
    }
    // Topology and vertices without a fan can forbid going as low as asked for.
    let stuck = left.vertices.len() > count + count / 4;
    Ok(if stuck { farthest_points(geodesics, 0, count) } else { left.vertices })
}
