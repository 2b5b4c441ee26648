//! Relaxation of a predicted map towards the source, smooth over the target (biharmonic).

use faer::Mat;
use rayon::prelude::*;

use super::closest::{Closest, ClosestOnSurface};
use crate::error::Result;
use crate::geometry::NONE;
use crate::geometry::bending::Bending;
use crate::geometry::cholesky::SparseCholesky;
use crate::surface::vector::{Vector, combine, sub};

/// Stiffnesses, in parts of the first one, and how many steps are made with each.
const STAGES: [(f64, usize); 3] = [(1.0, 6), (0.1, 6), (0.01, 4)];
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

/// The first stiffness for so many anchors: what bends between anchors at unit area.
pub(super) fn stiffness(anchors: usize) -> f64 {
    (0.3 / (anchors.max(1) as f64).sqrt()).powi(4)
}

/// Moves the images `z` of the target's vertices towards the source, all by displacements that are smooth over the target:
/// `(M + eps L' M^-1 L + K) d = M (P - z) + K (to - z)`, P the closest points, K holding the pins, eps falling. `bending` is the target's at unit area.
///
/// Gives a vertex of the source near each image. 16 steps with three factorisations; three numbers (1.5, 0.3 and the steps of eps) come from the study the method is taken from. The closest points begin exactly and follow their
/// point from then on.
pub(super) fn relax<const K: usize>(
    bending: &Bending,
    source: &ClosestOnSurface<'_, K>,
    pins: &[Pin<K>],
    z: &mut [Vector<f64, K>],
) -> Result<Vec<u32>> {
    let n = z.len();
    let mut near = vec![NONE; n];
    if n == 0 || pins.is_empty() {
        return Ok(near);
    }
    let stiffest = stiffness(pins.len());
    let mean_mass = bending.mass.iter().sum::<f64>() / n as f64;
    let weight = ANCHOR * mean_mass;
    let ties: Vec<([u32; 3], [f64; 3])> = pins.iter().map(|p| (p.v, p.x)).collect();
    let factors: Vec<SparseCholesky> =
        STAGES.par_iter().map(|(part, _)| bending.factorise(stiffest * part, &ties, weight)).collect::<Result<_>>()?;
    for (factor, (_, steps)) in factors.iter().zip(STAGES) {
        for _ in 0..steps {
            let closest: Vec<Option<Closest>> =
                z.par_iter().zip(&near).map(|(z, &start)| source.near(z, start)).collect();
            let mut right = Mat::zeros(n, K);
            for (v, c) in closest.iter().enumerate() {
                let Some(c) = c else { continue };
                near[v] = source.vertex(c);
                let pull = sub(&source.point(c), &z[v]);
                for k in 0..K {
                    right[(v, k)] = bending.mass[v] * pull[k];
                }
            }
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
    }
    Ok(near)
}
