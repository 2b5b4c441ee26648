//! Relaxation of a predicted map towards the source, smooth over the target (biharmonic).

use faer::Mat;
use rayon::prelude::*;

use super::closest::{Closest, ClosestOnSurface, FLAT};
use super::relief::Relief;
use crate::control;
use crate::error::Result;
use crate::geometry::NONE;
use crate::geometry::bending::Bending;
use crate::geometry::cholesky::SparseCholesky;
use crate::surface::vector::{Vector, add_scaled, combine, sub};

/// Stiffnesses, in parts of the first one, and how many steps are made with each.
const STAGES: [(f64, usize); 3] = [(1.0, 4), (0.1, 6), (0.003, 8)];
/// The first stiffness is this over the square root of the number of anchors, to the fourth power:
/// a part of the distance between anchors at unit area.
const BEND: f64 = 0.25;
/// The stiffness that keeps anchors, in mean masses of a vertex.
const ANCHOR: f64 = 1e6;

/// How images are drawn onto the source.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Relaxation {
    /// Not at all.
    Off,
    /// Towards the tangent planes at the closest points: along the surface smoothness alone decides.
    /// Closest are points whose normals agree. Best where both shapes are one kind of body.
    Planes,
    /// The same without a look at normals.
    PlanesAlone,
    /// Towards the closest points themselves, whose normals agree: images stay where they were
    /// predicted. Best where one shape has pieces that the other one lacks.
    Points,
    /// The same without a look at normals.
    PointsAlone,
    /// As `Points`, onto a source that is only a part of what the target shows: planes would draw
    /// what lies beyond its rim, and what is near with it. Predictions are as good as between whole
    /// shapes of one kind.
    Part,
}

impl Relaxation {
    /// Whether images are drawn at all.
    pub fn draws(self) -> bool {
        self != Self::Off
    }

    /// Whether normals are compared.
    pub(super) fn compares_normals(self) -> bool {
        matches!(self, Self::Planes | Self::Points | Self::Part)
    }

    /// How many times what pairs left out miss is to be expected: where shapes are of different
    /// kinds, predictions are smooth and clothes are not. Chosen on clothes over one body, judged
    /// on others (`cargo bench --bench packs`).
    pub(super) fn surprise(self) -> f64 {
        if self == Self::Points { 2.0 } else { 1.0 }
    }

    /// Whether images may slide along the source.
    fn slides(self) -> bool {
        matches!(self, Self::Planes | Self::PlanesAlone)
    }
}

/// A point of the target: its triangle's vertices and barycentric coordinates.
pub(super) type Tie = ([u32; 3], [f64; 3]);

/// What holds a relaxation.
pub(super) struct Pins<'a, const K: usize> {
    /// Points of the target.
    pub(super) ties: &'a [Tie],
    /// Their images.
    pub(super) to: &'a [Vector<f64, K>],
    /// The systems of all stages with these points held: [`factors`].
    pub(super) factors: &'a [SparseCholesky],
    /// How images are drawn.
    pub(super) relaxation: Relaxation,
}

/// The first stiffness for so many anchors: what bends between anchors at unit area.
pub(super) fn stiffness(anchors: usize) -> f64 {
    (BEND / (anchors.max(1) as f64).sqrt()).powi(4)
}

/// The smoothing systems of all stages, of which `apart` anchors lie apart: sequential
/// factorisations, side by side.
pub(super) fn factors(bending: &Bending, ties: &[Tie], apart: usize) -> Result<Vec<SparseCholesky>> {
    let (stiffest, weight) = (stiffness(apart), pin_weight(bending));
    STAGES.par_iter().map(|(part, _)| bending.factorise(stiffest * part, ties, weight)).collect()
}

/// The weight of a pin.
fn pin_weight(bending: &Bending) -> f64 {
    ANCHOR * bending.mean_mass
}

/// Moves the images `z` of the target's vertices onto the source, all by displacements `d` that are
/// smooth over the target: `(M N + eps L' M^-1 L + K) d = M (P - z) + K (to - z)`, P the closest
/// points, N the projector across the surface there, K holding the pins, eps falling. `bending` is
/// the target's at unit area, `triangles` are its own and the source's.
///
/// Only what leads *across* the surface is asked of a displacement (registration by tangent planes;
/// Chen and Medioni, 1992); along it smoothness, anchors and normals alone decide. N couples all
/// coordinates, so the system is not solved but iterated with the steps: `M d` stands on the left
/// for `M N d`, and what the last step did along the surface, `M (1 - N) d`, on the right. One
/// solve a step, and where steps no longer change they are those of the whole system. What it gains
/// over pulling to the points themselves stands in docs/methods.md; with [`Relaxation::Points`] it
/// pulls to them, and N is the identity. Vertices that are not `used`
/// stay.
///
/// Gives the triangle of the source each image is nearest to. 18 steps. The closest points, with
/// normals ([`Relief`]), begin exactly and follow their point from then on; at each stiffness they
/// are looked for once more.
pub(super) fn relax<const K: usize>(
    bending: &Bending,
    source: &ClosestOnSurface<'_, K>,
    mut relief: Relief,
    [target_triangles, source_triangles]: [&[[u32; 3]]; 2],
    pins: &Pins<'_, K>,
    used: &[bool],
    z: &mut [Vector<f64, K>],
) -> Result<(Vec<u32>, Relief)> {
    let n = z.len();
    if n == 0 || pins.ties.is_empty() {
        return Ok((vec![NONE; n], relief));
    }
    let weight = pin_weight(bending);
    let first = |v: usize| if used[v] { source.near((&z[v], &FLAT), NONE) } else { None };
    let mut closest: Vec<Option<Closest>> = (0..n).into_par_iter().map(first).collect();
    relief.orient(&relief.of(z, target_triangles), &closest, source_triangles);
    let source = source.with_normals(&relief.source);
    let facing = source.facing();
    for (factor, (_, steps)) in pins.factors.iter().zip(STAGES) {
        let mut last = vec![[0.0; K]; n];
        for step in 0..steps {
            control::check()?;
            let normals = relief.of(z, target_triangles);
            let pulled: Vec<(Option<Closest>, Vector<f64, K>)> = (0..n)
                .into_par_iter()
                .map(|v| {
                    let place = (&z[v], &normals[v]);
                    let found = match closest[v] {
                        _ if !used[v] => None,
                        Some(c) if step > 0 => source.follow(place, c.face),
                        c => source.near_or_facing(place, c.as_ref(), &facing),
                    };
                    let slides = pins.relaxation.slides();
                    let pull = |c: &Closest| {
                        let to = sub(&source.point(c), &z[v]);
                        if slides { add_scaled(&to, 1.0, &source.along(c, &last[v])) } else { to }
                    };
                    (found, found.as_ref().map_or([0.0; K], pull))
                })
                .collect();
            let mut right = Mat::from_fn(n, K, |v, k| bending.mass[v] * pulled[v].1[k]);
            closest = pulled.into_iter().map(|(c, _)| c).collect();
            for ((v, x), to) in pins.ties.iter().zip(pins.to) {
                let missing = sub(to, &combine(x, v.map(|v| &z[v as usize])));
                for (v, x) in v.iter().zip(x) {
                    for k in 0..K {
                        right[(*v as usize, k)] += weight * x * missing[k];
                    }
                }
            }
            factor.solve(&mut right)?;
            for (v, (z, last)) in z.iter_mut().zip(&mut last).enumerate() {
                *last = std::array::from_fn(|k| right[(v, k)]);
                *z = add_scaled(z, 1.0, last);
            }
        }
    }
    Ok((closest.iter().map(|c| c.map_or(NONE, |c| c.face)).collect(), relief))
}
