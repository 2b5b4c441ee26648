//! Relaxation of a predicted map towards the source, smooth over the target (biharmonic).

use faer::Mat;
use rayon::prelude::*;

use super::closest::{Closest, ClosestOnSurface, FLAT};
use super::relief::Relief;
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
/// `(M + eps L' M^-1 L + K) d = M (P - z) + K (to - z)`, P the closest points, K holding the pins, eps falling. `bending` is the target's at unit area, `triangles` are its own and the
/// source's.
///
/// Gives a vertex of the source near each image. 16 steps with three factorisations; two numbers (0.3 and the steps of eps) come from the study the method is taken from. The closest points, with
/// normals ([`Relief`]), begin exactly and follow their point from then on; at each stiffness they are looked for once more.
pub(super) fn relax<const K: usize>(
    bending: &Bending,
    source: &ClosestOnSurface<'_, K>,
    mut relief: Relief,
    [target_triangles, source_triangles]: [&[[u32; 3]]; 2],
    pins: &[Pin<K>],
    z: &mut [Vector<f64, K>],
) -> Result<(Vec<u32>, Relief)> {
    let n = z.len();
    let mut near = vec![NONE; n];
    if n == 0 || pins.is_empty() {
        return Ok((near, relief));
    }
    let stiffest = stiffness(pins.len());
    let mean_mass = bending.mass.iter().sum::<f64>() / n as f64;
    let weight = ANCHOR * mean_mass;
    let ties: Vec<([u32; 3], [f64; 3])> = pins.iter().map(|p| (p.v, p.x)).collect();
    let factors: Vec<SparseCholesky> =
        STAGES.par_iter().map(|(part, _)| bending.factorise(stiffest * part, &ties, weight)).collect::<Result<_>>()?;
    let mut closest: Vec<Option<Closest>> = z.par_iter().map(|z| source.near((z, &FLAT), NONE)).collect();
    relief.orient(&relief.of(z, target_triangles), &closest, source_triangles);
    let source = source.with_normals(&relief.source);
    let facing = source.facing();
    for (factor, (_, steps)) in factors.iter().zip(STAGES) {
        for (v, c) in closest.iter().enumerate() {
            near[v] = c.map_or(NONE, |c| source.vertex(&c));
        }
        for step in 0..steps {
            let normals = relief.of(z, target_triangles);
            closest = (0..n)
                .into_par_iter()
                .map(|v| match closest[v] {
                    Some(c) if step > 0 => source.follow((&z[v], &normals[v]), c.face),
                    _ => source.near_or_facing((&z[v], &normals[v]), near[v], &facing),
                })
                .collect();
            let mut right = Mat::zeros(n, K);
            for (v, c) in closest.iter().enumerate() {
                let Some(c) = c else { continue };
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
    for (v, c) in closest.iter().enumerate() {
        near[v] = c.map_or(NONE, |c| source.vertex(&c));
    }
    Ok((near, relief))
}
