//! Patches of the target looked for on the source around where the map sends them: a search, where sliding downhill would end at the nearest bump.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::register::{Evidence, Gradient, gradient_at, relief_at};
use super::side::{CHANNELS, Side};
use crate::error::Result;
use crate::geometry::SurfacePoint;

/// Radius of a patch at unit area.
const PATCH: f64 = 0.05;
/// Vertices of a patch that are looked at.
const SAMPLES: usize = 40;
/// How much better the best place must be than every other one farther than [`APART`] from it.
const DISTINCT: f64 = 1.25;
const APART: f64 = 0.02;
/// Largest mean disagreement of a patch, in parts of the usual one.
const AGREES: f64 = 0.6;
/// Steps between vertices.
const STEPS: usize = 4;

/// A patch that was found.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    /// Middle of the patch on the target.
    pub(super) vertex: u32,
    /// Its place on the source.
    pub(super) place: SurfacePoint,
    /// Disagreement over that of the next best place.
    pub(super) ratio: f64,
}

/// Looks for the patches around the vertices `sites` within `reach` of their images.
pub(super) fn find(
    source: &Side<'_>,
    target: &Side<'_>,
    images: &[Option<SurfacePoint>],
    sites: &[u32],
    reach: f64,
    handedness: f64,
) -> Result<Vec<Found>> {
    let evidence = Evidence::new(source, target, images, handedness)?;
    let (usual, gradients) = (evidence.usual, source.gradients());
    let found = sites
        .par_iter()
        .map(|&site| one(source, target, images, &evidence, &gradients, site, (reach, usual)))
        .collect::<Vec<_>>();
    Ok(found.into_iter().flatten().collect())
}

fn one(
    source: &Side<'_>,
    target: &Side<'_>,
    images: &[Option<SurfacePoint>],
    evidence: &Evidence,
    gradients: &[Gradient],
    site: u32,
    (reach, usual): (f64, f64),
) -> Option<Found> {
    let here = images[site as usize]?;
    let at = source.position(&here);
    let patch = around(target, site, PATCH);
    let step = patch.len().div_ceil(SAMPLES).max(1);
    let patch: Vec<u32> = patch.into_iter().step_by(step).collect();
    if patch.len() < 8 {
        return None;
    }
    // Where the map sends the patch, relative to its middle.
    let offsets: Vec<(u32, DVec3)> =
        patch.iter().filter_map(|&w| Some((w, source.position(&images[w as usize]?) - at))).collect();
    let corner = source.topology.triangles[here.face as usize][here.dominant_corner()];
    let normal = source.normals[corner as usize];
    let cost = |p: &SurfacePoint| -> f64 {
        let (middle, turn) = (source.position(p), turn(normal, source.normal(p)));
        let mut sum = 0.0;
        for (w, offset) in &offsets {
            let found = relief_at(source, &source.closest_near(middle + turn * *offset, *p));
            for c in 0..CHANNELS {
                sum += evidence.weight[c] * (turn * evidence.wanted[*w as usize][c] - found[c]).length_squared();
            }
        }
        sum / offsets.len() as f64
    };
    let candidates: Vec<(f64, u32)> = around(source, corner, reach)
        .into_iter()
        .filter_map(|u| Some((cost(&source.topology.vertex_point(u)?), u)))
        .collect();
    let best = candidates.iter().copied().min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))?;
    let place = source.positions[best.1 as usize];
    let rival = candidates
        .iter()
        .filter(|c| source.positions[c.1 as usize].distance(place) > APART)
        .map(|c| c.0)
        .fold(f64::INFINITY, f64::min);
    let edge = place.distance(source.positions[corner as usize]) > 0.85 * reach;
    if edge || !rival.is_finite() || best.0 * DISTINCT > rival || best.0 > AGREES * usual {
        return None;
    }
    // Between the vertices: Gauss-Newton steps of the patch as a whole.
    let mut place = source.topology.vertex_point(best.1)?;
    let mut least = best.0;
    let stayed = cost(&here);
    if stayed <= least {
        (place, least) = (here, stayed);
    }
    for _ in 0..STEPS {
        let (middle, turn) = (source.position(&place), turn(normal, source.normal(&place)));
        let (mut a, mut b) = (DMat3::ZERO, DVec3::ZERO);
        for (w, offset) in &offsets {
            let p = source.closest_near(middle + turn * *offset, place);
            let (found, slope) = (relief_at(source, &p), gradient_at(source, gradients, &p));
            for c in 0..CHANNELS {
                let off = turn * evidence.wanted[*w as usize][c] - found[c];
                for i in 0..3 {
                    let g = slope[c][i];
                    a += DMat3::from_cols(g * g.x, g * g.y, g * g.z) * evidence.weight[c];
                    b += g * (evidence.weight[c] * off[i]);
                }
            }
        }
        let size = a.x_axis.x + a.y_axis.y + a.z_axis.z;
        if !(size > 0.0) {
            break;
        }
        let step = (a + DMat3::from_diagonal(DVec3::splat(1e-3 * size))).inverse() * b;
        let moved = source.closest_near(middle + step.clamp_length_max(0.01), place);
        let now = cost(&moved);
        if !(now < least) {
            break;
        }
        (place, least) = (moved, now);
    }
    Some(Found { vertex: site, place, ratio: least / rival })
}

/// Vertices connected to `seed` within `radius` in space, `seed` first.
fn around(side: &Side<'_>, seed: u32, radius: f64) -> Vec<u32> {
    let mut seen = std::collections::BTreeSet::from([seed]);
    let mut out = vec![seed];
    let mut next = 0;
    while next < out.len() {
        let v = out[next];
        next += 1;
        for &t in side.topology.vertex_triangles(v) {
            for w in side.topology.triangles[t as usize] {
                let near = side.positions[w as usize].distance(side.positions[seed as usize]) <= radius;
                if near && seen.insert(w) {
                    out.push(w);
                }
            }
        }
    }
    out
}

/// The least rotation that takes one direction to another.
fn turn(from: DVec3, to: DVec3) -> DMat3 {
    if from.dot(to) < -0.99 { DMat3::IDENTITY } else { DMat3::from_quat(glam::DQuat::from_rotation_arc(from, to)) }
}
