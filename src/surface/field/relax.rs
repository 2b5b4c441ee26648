//! Relaxation of a predicted map towards the source, smooth over the target (biharmonic).

use faer::Mat;
use rayon::prelude::*;

use super::closest::ClosestOnSurface;
use crate::error::Result;
use crate::geometry::bending::Bending;
use crate::surface::vector::{Vector, combine, sub};

/// Stiffness of each step, in parts of the first one.
const SCHEDULE: [f64; 16] = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.01, 0.01, 0.01, 0.01];
/// The stiffness that keeps anchors, in mean masses of a vertex.
const ANCHOR: f64 = 1e6;

/// A point of the target that is to go to `to`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pin<const K: usize> {
    /// Vertices of the target.
    pub(super) v: [u32; 3],
    /// Its barycentric coordinates.
    pub(super) x: [f64; 3],
    /// The image.
    pub(super) to: Vector<f64, K>,
}

/// Moves the images `z` of the target's vertices towards the source, all by displacements that are smooth over the target:
/// `(M + eps L' M^-1 L + K) d = M (P - z) + K (to - z)`, P the closest points, K holding the pins, eps falling. `bending` is the target's at unit area.
///
/// 16 steps with three factorisations; three numbers (1.5, 0.3 and the steps of eps) come from the study the method is taken from.
pub(super) fn relax<const K: usize>(
    bending: &Bending,
    source: &ClosestOnSurface<'_, K>,
    pins: &[Pin<K>],
    z: &mut [Vector<f64, K>],
) -> Result<()> {
    let n = z.len();
    if n == 0 || pins.is_empty() {
        return Ok(());
    }
    let stiffest = (0.3 / (pins.len() as f64).sqrt()).powi(4);
    let mean_mass = bending.mass.iter().sum::<f64>() / n as f64;
    let weight = ANCHOR * mean_mass;
    let ties: Vec<([u32; 3], [f64; 3])> = pins.iter().map(|p| (p.v, p.x)).collect();
    let mut factor = None;
    for (step, part) in SCHEDULE.iter().enumerate() {
        if step == 0 || SCHEDULE[step - 1] != *part {
            factor = Some(bending.factorise(stiffest * part, &ties, weight)?);
        }
        let Some(factor) = &factor else { break };
        let pulls: Vec<Vector<f64, K>> =
            z.par_iter().map(|z| source.find(z).map_or([0.0; K], |c| sub(&source.point(&c), z))).collect();
        let mut right = Mat::from_fn(n, K, |v, k| bending.mass[v] * pulls[v][k]);
        for pin in pins {
            let here = combine(&pin.x, pin.v.map(|v| &z[v as usize]));
            for (v, x) in pin.v.iter().zip(pin.x) {
                for k in 0..K {
                    right[(*v as usize, k)] += weight * x * (pin.to[k] - here[k]);
                }
            }
        }
        factor.solve(&mut right)?;
        for (v, z) in z.iter_mut().enumerate() {
            for k in 0..K {
                z[k] += right[(v, k)];
            }
        }
    }
    Ok(())
}
