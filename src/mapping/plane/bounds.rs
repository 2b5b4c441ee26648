//! Sufficient conditions for no fold: Lemma 1, Lemma 2 and condition (7) of the paper.
//!
//! They ask for the largest gradient of the coordinates over a polygon. Here it is sampled, from
//! below: the figures say how close the conditions are, they are no proof. Proofs are the
//! certificate's business.

use glam::DVec2;
use rayon::prelude::*;

use crate::geometry::{Polygon, Side};

use super::{Coordinates, Frame, Step};

/// `M d < (sqrt 5 - 1) / 2` makes a step injective (Lemma 2).
pub const LEMMA_2: f64 = 0.618_033_988_749_894_8;
/// Samples along the longer side of a polygon, at most.
const RASTER: usize = 24;
/// How far from a vertex samples lie, in lengths of its shorter edge: gradients are largest there
/// and direction dependent.
const NEAR: f64 = 1e-3;
/// Sampled products of points and vertices in all polygons of a partition, at most.
const BUDGET: usize = 200_000_000;

/// The sufficient conditions on one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepBound {
    /// Largest distance a vertex moves, `d_k`.
    pub displacement: f64,
    /// `M d_k`, sampled; Lemma 2 asks for less than [`LEMMA_2`].
    pub lemma_2: f64,
    /// `M_i |u_i|`, sampled, where only vertex `i` moves; Lemma 1 asks for less than 1.
    pub lemma_1: Option<f64>,
}

/// The sufficient conditions on a partition. Sampled: no proof.
#[derive(Clone, Debug, PartialEq)]
pub struct SufficientBound {
    /// Largest gradient of a coordinate over all polygons, `M*` of (6), sampled.
    pub gradient: f64,
    /// Largest distance a vertex moves in a step, `d_tau`.
    pub displacement: f64,
    /// `(sqrt 5 - 1) / (2 n M*)`, which (7) asks `d_tau` to stay below.
    pub limit: f64,
    /// By step.
    pub steps: Vec<StepBound>,
}

impl SufficientBound {
    /// Whether condition (7) holds as far as was sampled.
    pub fn holds(&self) -> bool {
        self.displacement < self.limit
    }
}

/// Points of the open domain to sample gradients at: a raster of `side`, and three directions close
/// to (at most `corners`) vertices.
fn samples(polygon: &Polygon, side: usize, corners: usize) -> Vec<DVec2> {
    let (low, high) = polygon.bounds();
    let cell = (high - low).max_element() / side as f64;
    let raster = (0..side * side)
        .map(|k| low + DVec2::new((k % side) as f64 + 0.5, (k / side) as f64 + 0.5) * cell)
        .filter(|&p| polygon.contains(p) == Side::Inside);
    let vertices: Vec<DVec2> = polygon.vertices().collect();
    let stride = vertices.len().div_ceil(corners.max(1));
    let near = polygon.corners().step_by(stride).flat_map(|corner| {
        let at = vertices[corner.index];
        let (after, before) = (vertices[corner.after] - at, vertices[corner.before] - at);
        // The domain lies between the edge after and the edge before, anticlockwise.
        let opening = after.angle_to(before).rem_euclid(std::f64::consts::TAU);
        let reach = NEAR * after.length().min(before.length());
        [0.1, 0.5, 0.9].map(|part| at + DVec2::from_angle(part * opening).rotate(after.normalize()) * reach)
    });
    raster.chain(near.collect::<Vec<_>>()).collect()
}

/// Largest gradient of every coordinate over samples of `polygon`.
fn largest_gradients(coordinates: Coordinates, polygon: &Polygon, side: usize, corners: usize) -> Vec<f64> {
    let n = polygon.vertex_count();
    let none = || vec![0.0_f64; n];
    let scale = Frame::common_scale([polygon]);
    let (frame, step) = (Frame::of(polygon, scale), Step::<f64>::new(coordinates, polygon, polygon, scale));
    // The maximum does not depend on the order it is taken in.
    samples(polygon, side, corners)
        .into_par_iter()
        .fold(none, |mut largest, p| {
            for (m, g) in largest.iter_mut().zip(step.gradients_of(frame.local(p))) {
                *m = m.max(DVec2::from(g).length() * scale);
            }
            largest
        })
        .reduce(none, |a, b| a.into_iter().zip(b).map(|(a, b)| a.max(b)).collect())
}

/// The sufficient conditions on the steps between successive `polygons`, sampled.
pub fn sufficient_bound(coordinates: Coordinates, polygons: &[Polygon]) -> SufficientBound {
    let n = polygons.first().map_or(0, Polygon::vertex_count);
    let points = BUDGET / (n * polygons.len()).max(1);
    let (side, corners) = (((points as f64 / 2.0).sqrt() as usize).clamp(4, RASTER), (points / 6).clamp(1, n.max(1)));
    let largest: Vec<Vec<f64>> =
        polygons.iter().map(|polygon| largest_gradients(coordinates, polygon, side, corners)).collect();
    let steps: Vec<StepBound> = polygons
        .windows(2)
        .zip(&largest)
        .map(|(pair, largest)| {
            let moves: Vec<f64> = pair[0].vertices().zip(pair[1].vertices()).map(|(a, b)| (b - a).length()).collect();
            let displacement = moves.iter().copied().fold(0.0, f64::max);
            let mut moving = (0..n).filter(|&i| moves[i] > 0.0);
            let lemma_1 = match (moving.next(), moving.next()) {
                (Some(only), None) => Some(largest[only] * moves[only]),
                _ => None,
            };
            StepBound { displacement, lemma_2: largest.iter().sum::<f64>() * displacement, lemma_1 }
        })
        .collect();
    let gradient = largest.iter().flatten().copied().fold(0.0, f64::max);
    SufficientBound {
        gradient,
        displacement: steps.iter().map(|step| step.displacement).fold(0.0, f64::max),
        limit: LEMMA_2 / (n as f64 * gradient),
        steps,
    }
}
