//! Marks: places that stand out of the surface around them, or tips of limbs, found the same way on both surfaces.

use super::extremities::{Extremity, extremities, peaks};
use super::side::{SCALES, Side};
use crate::geometry::Geodesics;

/// Least height of a peak of the relief.
const LEAST: f64 = 0.1;
/// The same of pits.
const LEAST_PIT: f64 = 0.2;
/// What counts as hardly lower than a peak of the relief.
const LEVEL: f64 = 0.04;
/// Marks less certain of their place are left out.
const BLURRED: f64 = 0.02;

/// What a mark is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// A tip of a limb.
    Tip,
    /// Highest place of the relief at a scale.
    Peak(usize),
    /// Deepest place.
    Pit(usize),
}

/// A mark with what it is compared by.
#[derive(Clone, Debug)]
pub(super) struct Mark {
    pub(super) vertex: u32,
    pub(super) kind: Kind,
    /// How far it stands out; tips by three times their length over the root of the area, so that the thresholds of the relief serve.
    pub(super) height: f64,
    /// How far its place is uncertain.
    pub(super) extent: f64,
    /// Relief along the normal at all scales.
    signature: [f64; SCALES.len()],
}

impl Mark {
    /// Difference of two marks of one kind: the logarithm of their heights, and their relief.
    pub(super) fn difference(&self, other: &Self) -> f64 {
        let heights = (self.height / other.height).ln().abs();
        let relief: f64 = self.signature.iter().zip(other.signature).map(|(a, b)| (a - b) * (a - b)).sum();
        0.25 * heights + 0.5 * relief.sqrt()
    }
}

/// All marks of a surface.
pub(super) fn marks(side: &Side<'_>) -> Vec<Mark> {
    let relief = |k: usize, v: usize| side.relief[v][k].dot(side.normals[v]);
    let signature = |v: u32| std::array::from_fn(|k| relief(k, v as usize));
    let geodesics = Geodesics::new(&side.positions, &side.triangles);
    let mark = |e: &Extremity, kind: Kind, factor: f64| Mark {
        vertex: e.vertex,
        kind,
        height: factor * e.height,
        extent: e.extent,
        signature: signature(e.vertex),
    };
    let mut all: Vec<Mark> = extremities(side, &geodesics).iter().map(|e| mark(e, Kind::Tip, 10.0)).collect();
    for k in 1..SCALES.len() {
        for sign in [1.0, -1.0] {
            let f: Vec<f64> = (0..side.positions.len()).map(|v| sign * relief(k, v)).collect();
            let kind = if sign > 0.0 { Kind::Peak(k) } else { Kind::Pit(k) };
            all.extend(
                peaks(side, &f, LEVEL)
                    .iter()
                    .filter(|e| e.height >= if sign > 0.0 { LEAST } else { LEAST_PIT })
                    .map(|e| mark(e, kind, 1.0)),
            );
        }
    }
    all.retain(|m| m.extent <= BLURRED);
    all
}
