//! How each kind of partition chooses its knots.

use crate::mapping::knots::continuous_knots;

use super::steps::{Found, Steps};
use super::{Limits, PartitionKind, Stop};

/// `m` equal steps.
fn uniform(m: u64) -> Vec<f64> {
    (0..=m).map(|k| k as f64 / m as f64).collect()
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
                // Nothing proves that the moved knots' steps do not fold; where one does, Listing 1
                // goes on inside it.
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
                // A polygon that intersects itself may be one that a finer partition uses as well:
                // knots stay knots.
                Err(stop) => return Err(stop),
                Ok(found) if !found.folds() || 1.0 / m as f64 <= limits.eps || m as usize >= limits.steps => {
                    return Ok(found);
                }
                Ok(_) => m *= 2,
            }
        }
    }

    /// Listing 1 within the intervals of `knots`, breadth first: a step that folds is halved unless
    /// it is no longer than `eps`.
    pub(super) fn halved(&mut self, knots: Vec<f64>, limits: &Limits) -> Result<Vec<f64>, Stop> {
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

    /// Section 4.4.
    fn continuous(&mut self, limits: &Limits) -> Result<Vec<f64>, Stop> {
        continuous_knots(limits.eps, limits.steps, |intervals: &[(f64, f64)]| {
            Ok(self.minima(intervals)?.iter().map(|minimum| minimum.value).collect())
        })
    }
}
