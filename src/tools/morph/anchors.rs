//! The few vertices that carry position, turn and size of an in-between.

use glam::{DQuat, DVec3};

use crate::encoding::{Connectivity, Similarity, V3};
use crate::error::{Error, Result};

/// Vertices taken per component.
const COUNT: usize = 4;

/// Anchors, ascending, and how they are blended.
#[derive(Debug)]
pub(super) struct Anchors {
    pub(super) held: Vec<u32>,
}

impl Anchors {
    /// The given vertices; or in every component four spread over the patch that moves least
    /// between the shapes. `away` is how far each shape stands from the first, which counts as
    /// movement.
    pub(super) fn new(
        connectivity: &Connectivity,
        shapes: &[Vec<V3<f64>>],
        away: &[DVec3],
        given: Option<&[u32]>,
    ) -> Result<Self> {
        if let Some(given) = given {
            let n = connectivity.rings.len();
            if let Some(v) = given.iter().find(|&&v| (v as usize) >= n) {
                return Err(Error::input(format!("anchor {v}: the mesh has {n} vertices"), "Indices count from 0"));
            }
            let mut held = given.to_vec();
            held.sort_unstable();
            held.dedup();
            if held.is_empty() {
                return Err(Error::input("there are no anchors", "Give at least four, or none to have them chosen"));
            }
            return Ok(Self { held });
        }
        let mut held = Vec::new();
        let moved = |v: usize| {
            let at = |s: &Vec<V3<f64>>| DVec3::from(s[v]);
            shapes.iter().zip(away).map(|(s, off)| (at(s) - at(&shapes[0]) + *off).length()).fold(0.0, f64::max)
        };
        // The vertex whose whole neighbourhood moves least, component by component.
        let mut best: Vec<Option<(f64, u32)>> = vec![None; connectivity.component_count as usize];
        for (v, ring) in connectivity.rings.iter().enumerate().filter(|(_, r)| !r.is_empty()) {
            let worst = ring.iter().map(|&u| moved(u as usize)).fold(moved(v), f64::max);
            let slot = &mut best[connectivity.component[v] as usize];
            if slot.is_none_or(|b| worst < b.0) {
                *slot = Some((worst, v as u32));
            }
        }
        for (_, seed) in best.into_iter().flatten() {
            held.extend(spread(connectivity, &shapes[0], seed));
        }
        held.sort_unstable();
        Ok(Self { held })
    }

    /// Where the anchors (the first `count` of every shape) are at `weights`: their shape averaged
    /// after alignment, under the mean of the alignments (rotations by spherical interpolation,
    /// logarithms of sizes). An input's own weight gives its positions exactly.
    pub(super) fn blended(&self, shapes: &[Vec<V3<f64>>], count: usize, weights: &[f64]) -> Vec<V3<f64>> {
        if let Some(only) = weights.iter().position(|&w| w == 1.0) {
            return shapes[only][..count].to_vec();
        }
        let points = |k: usize| shapes[k][..count].iter().map(|&p| DVec3::from(p));
        let mean = |k: usize| points(k).sum::<DVec3>() / count as f64;
        let (mut turn, mut total, mut log_size, mut centre) = (DQuat::IDENTITY, 0.0, 0.0, DVec3::ZERO);
        let mut shape = vec![DVec3::ZERO; count];
        for (k, &w) in weights.iter().enumerate().filter(|(_, w)| **w > 0.0) {
            let pairs: Vec<(DVec3, DVec3)> = points(0).zip(points(k)).collect();
            let fit = Similarity::fit(&pairs);
            let rotation = DQuat::from_mat3(&fit.rotation);
            total += w;
            turn = if total == w { rotation } else { turn.slerp(rotation, w / total) };
            log_size += w * fit.scale.ln();
            centre += mean(k) * w;
            let back = fit.rotation.transpose();
            for (out, p) in shape.iter_mut().zip(points(k)) {
                *out += back * (p - mean(k)) / fit.scale * w;
            }
        }
        shape.into_iter().map(|p| (turn * p * log_size.exp() + centre).to_array()).collect()
    }
}

/// Four vertices spread over the patch of about 2 % of the mesh around `seed`.
fn spread(connectivity: &Connectivity, rest: &[V3<f64>], seed: u32) -> Vec<u32> {
    // Vertices that a file repeats have no ring.
    let used = connectivity.rings.iter().filter(|r| !r.is_empty()).count();
    let wanted = (used / 50).clamp(12, 400);
    let mut patch = vec![seed];
    let mut seen = std::collections::BTreeSet::from([seed]);
    let mut next = 0;
    while next < patch.len() && patch.len() < wanted {
        for &u in &connectivity.rings[patch[next] as usize] {
            if seen.insert(u) {
                patch.push(u);
            }
        }
        next += 1;
    }
    let mut chosen = vec![seed];
    while chosen.len() < COUNT.min(patch.len()) {
        let distance = |v: u32| {
            let at = DVec3::from(rest[v as usize]);
            chosen.iter().map(|&c| at.distance(DVec3::from(rest[c as usize]))).fold(f64::INFINITY, f64::min)
        };
        let farthest =
            patch.iter().fold((f64::MIN, seed), |b, &v| if distance(v) > b.0 { (distance(v), v) } else { b });
        chosen.push(farthest.1);
    }
    chosen.sort_unstable();
    chosen.dedup();
    chosen
}
