//! How each kind of partition chooses its knots.

use crate::mapping::plane::Minimum;

use super::steps::{Found, Steps};
use super::{Limits, PartitionKind, Stop};

/// Jacobians from here on need no extra knot in a continuous partition; 1 would be the identity's, 0.5 takes far fewer steps.
const CALM: f64 = 0.5;
/// Extra knots closer to their interval's start than this in t change no digit of the map that can be seen.
const LEAST_SHIFT: f64 = 1e-9;

/// `m` equal steps.
fn uniform(m: u64) -> Vec<f64> {
    (0..=m).map(|k| k as f64 / m as f64).collect()
}

/// How far an extra knot has moved from the start of its interval (0) to the middle (1).
fn ramp(minimum: &Minimum) -> f64 {
    let part = 1.0 - minimum.value / CALM;
    // NaN is a fold.
    if part.is_nan() { 1.0 } else { part.clamp(0.0, 1.0) }
}

/// A node of the dyadic tree in a continuous partition.
struct Node {
    /// The interval it stands for, whose minimum drives it.
    interval: (f64, f64),
    /// Where that interval's ends are now.
    moved: (f64, f64),
    /// Activation of its parent.
    active: f64,
}

impl Steps<'_, '_> {
    /// The partition of this kind along this path.
    pub(super) fn partition(&mut self, kind: PartitionKind, limits: &Limits) -> Result<Found, Stop> {
        match kind {
            PartitionKind::Direct => self.at_knots(uniform(1)),
            PartitionKind::Uniform(m) => self.at_knots(uniform(u64::from(m))),
            PartitionKind::UniformAuto => self.doubled(limits),
            PartitionKind::Binary => {
                let knots = self.halved(vec![0.0, 1.0], limits)?;
                self.at_knots(knots)
            }
            PartitionKind::Continuous => {
                let knots = self.continuous(limits)?;
                // Nothing proves that the moved knots' steps do not fold; where one does, Listing 1 goes on inside it.
                let knots = self.halved(knots, limits)?;
                self.at_knots(knots)
            }
        }
    }

    /// Section 3.1: twice as many equal steps until none folds or they are no longer than `eps`.
    fn doubled(&mut self, limits: &Limits) -> Result<Found, Stop> {
        let mut m = 1;
        loop {
            match self.at_knots(uniform(m)) {
                // A polygon that intersects itself may be one that a finer partition uses as well: knots stay knots.
                Err(stop) => return Err(stop),
                Ok(found) if !found.folds() || 1.0 / m as f64 <= limits.eps || m as usize >= limits.steps => {
                    return Ok(found);
                }
                Ok(_) => m *= 2,
            }
        }
    }

    /// Listing 1 within the intervals of `knots`, breadth first: a step that folds is halved unless it is no longer than
    /// `eps`.
    fn halved(&mut self, knots: Vec<f64>, limits: &Limits) -> Result<Vec<f64>, Stop> {
        let mut depth: Vec<(f64, f64)> = knots.windows(2).map(|w| (w[0], w[1])).collect();
        let mut knots = knots;
        while !depth.is_empty() {
            let minima = self.minima(&depth)?;
            let mut next = Vec::new();
            for (&(a, b), minimum) in depth.iter().zip(&minima) {
                let c = (a + b) / 2.0;
                let finer = b - a > limits.eps && knots.len() <= limits.steps && a < c && c < b;
                if !minimum.positive() && finer {
                    knots.push(c);
                    next.extend([(a, c), (c, b)]);
                }
            }
            depth = next;
        }
        knots.sort_by(f64::total_cmp);
        Ok(knots)
    }

    /// Section 4.4 by a rule that is continuous in every minimum: the knot of a node of the dyadic tree moves from the start of
    /// its interval to the middle as the minimum falls from [`CALM`] to 0, by no more than its parent has moved. Every node that
    /// Listing 1 splits has moved all the way: its partition is contained.
    fn continuous(&mut self, limits: &Limits) -> Result<Vec<f64>, Stop> {
        let mut knots = vec![0.0, 1.0];
        let mut depth = vec![Node { interval: (0.0, 1.0), moved: (0.0, 1.0), active: 1.0 }];
        while !depth.is_empty() {
            let intervals: Vec<(f64, f64)> = depth.iter().map(|node| node.interval).collect();
            let minima = self.minima(&intervals)?;
            let mut next = Vec::new();
            for (node, minimum) in depth.iter().zip(&minima) {
                let active = node.active * ramp(minimum);
                let ((a, b), (low, high)) = (node.interval, node.moved);
                let (c, moved) = ((a + b) / 2.0, low + active * (high - low) / 2.0);
                if b - a <= limits.eps || knots.len() > limits.steps || moved - low <= LEAST_SHIFT {
                    continue;
                }
                knots.push(moved);
                next.push(Node { interval: (a, c), moved: (low, moved), active });
                next.push(Node { interval: (c, b), moved: (moved, high), active });
            }
            depth = next;
        }
        knots.sort_by(f64::total_cmp);
        knots.dedup();
        Ok(knots)
    }
}
