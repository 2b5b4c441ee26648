//! What a half-edge collapse costs and whether its triangles are fit to carry an encoding.

use super::V3;
use super::vector::{cross, dot, length, sub};

/// What a collapse may make.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rules {
    /// Least angle of a new triangle, as its sine.
    pub(crate) least_sine: f64,
    /// Most neighbours of a vertex after it.
    pub(crate) most_neighbours: usize,
    /// A new triangle's normal must not turn away from the old one's by more than this cosine.
    pub(crate) least_cosine: f64,
    /// Largest sum |w| of the removed vertex in its ring.
    pub(crate) largest_weights: f64,
    /// A removed vertex may be encoded in a substitute triangle.
    pub(crate) substitute: bool,
}

/// From what is good to what is possible: the next rules count where the ones before leave too many
/// vertices.
pub(crate) const RULES: [Rules; 3] = [
    // 12 degrees, 78 degrees.
    Rules { least_sine: 0.208, most_neighbours: 12, least_cosine: 0.2, largest_weights: 5.0, substitute: false },
    Rules { least_sine: 0.05, most_neighbours: 24, least_cosine: 0.0, largest_weights: 10.0, substitute: true },
    Rules { least_sine: 1e-4, most_neighbours: 64, least_cosine: -1.0, largest_weights: 20.0, substitute: true },
];

/// The cost of replacing the fan of `v` over `ring` by the fan of `to` = `ring[0]`; `None` if that
/// breaks the rules.
///
/// (sum of squared tetrahedron volumes) / l⁶ + 1/100 (1 - least angle / 60°) + 1/1000 L² / l², L
/// the collapsed edge and l the mean one; along a boundary the squared area between its old and new
/// course over l⁴ is added. The ring may run either way. Volume preservation after Lindstrom and
/// Turk 1998; the mixture is named in section 3.1, its weights are ours.
pub(crate) fn collapse_cost(
    positions: &[V3<f64>],
    v: u32,
    ring: &[u32],
    boundary: Option<u32>,
    mean_edge: f64,
    rules: &Rules,
) -> Option<f64> {
    let at = positions[v as usize];
    let to = positions[ring[0] as usize];
    let edge = sub(to, at);
    let unit = 1.0 / (mean_edge * mean_edge);
    let mut volume = 0.0;
    let mut least = 1.0_f64;
    for k in 1..ring.len().saturating_sub(1) {
        let (p, q) = (positions[ring[k] as usize], positions[ring[k + 1] as usize]);
        let (vp, vq) = (sub(p, at), sub(q, at));
        let old = cross(vp, vq);
        let (tp, tq) = (sub(p, to), sub(q, to));
        let new = cross(tp, tq);
        let (old_length, new_length) = (length(old), length(new));
        if rules.least_cosine > -1.0 && !(dot(old, new) >= rules.least_cosine * old_length * new_length) {
            return None;
        }
        let six = dot(edge, old);
        volume += six * six;
        let pq = sub(q, p);
        let mut squares = [dot(tp, tp), dot(tq, tq), dot(pq, pq)];
        squares.sort_by(f64::total_cmp);
        let sine = new_length / (squares[1] * squares[2]).sqrt();
        if !(sine > rules.least_sine) {
            return None;
        }
        least = least.min(sine);
    }
    let mut cost = volume / 36.0 * unit * unit * unit
        + 1e-2 * (1.0 - least.min(1.0).asin() / std::f64::consts::FRAC_PI_3).max(0.0)
        + 1e-3 * dot(edge, edge) * unit;
    if let Some(other) = boundary {
        let area = cross(sub(positions[other as usize], at), edge);
        cost += 0.25 * dot(area, area) * unit * unit;
    }
    cost.is_finite().then_some(cost)
}
