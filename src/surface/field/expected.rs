//! What a map is worth in three numbers: the error to be expected of its points, and where a pair
//! would help most.

use super::Field;
use super::pair::Shapes;
use crate::engine::Real;

/// An error that shows: the share of the area beyond it is told.
const SHOWS: f64 = 0.02;

/// The error to be expected of a map, foretold from pairs left out, over the square root of the
/// source's area.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Expected {
    /// Half of the target's area is expected to be off by no more; none where half of it is not
    /// vouched for at all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub median: Option<f64>,
    /// 95 % of it are expected to be off by no more; none where more than 5 % are not vouched for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub p95: Option<f64>,
    /// Share of the area that is expected to be off by more than 0.02, or not vouched for.
    pub beyond: f64,
    /// Vertex of the target where another pair would help most: that of the largest error.
    #[serde(skip)]
    pub next: u32,
    /// Where that is.
    pub place: [f64; 3],
}

impl Expected {
    /// The same with pairs that are off by `error` themselves.
    pub(super) fn with(self, error: f64) -> Self {
        let with = |e: Option<f64>| e.map(|e| e.hypot(error));
        Self { median: with(self.median), p95: with(self.p95), ..self }
    }
}

impl<S: Real, const K: usize> Field<S, K> {
    /// Sums up what is expected at the vertices; none without evidence. O(V log V).
    pub(super) fn expected(&self, shapes: &Shapes<'_>) -> Option<Expected> {
        let mut all: Vec<(f64, u32)> =
            self.drift.iter().zip(0..).filter(|(_, v)| shapes.used[*v as usize]).map(|(d, v)| (*d, v)).collect();
        // By places where errors are equal: numbers differ between files of one surface.
        let place = |v: u32| shapes.target.mesh.positions[v as usize].to_array();
        let by_place = |a: u32, b: u32| {
            place(a).iter().zip(place(b)).map(|(a, b)| a.total_cmp(&b)).find(|o| o.is_ne()).unwrap_or(a.cmp(&b))
        };
        all.sort_by(|a, b| a.0.total_cmp(&b.0).then_with(|| by_place(a.1, b.1)));
        let mass = |v: u32| shapes.bending.mass[v as usize];
        let area: f64 = all.iter().map(|(_, v)| mass(*v)).sum();
        let quantile = |part: f64| {
            let mut sum = 0.0;
            let at = all.iter().find(|(_, v)| {
                sum += mass(*v);
                sum >= part * area
            });
            at.map(|(d, _)| *d).filter(|d| d.is_finite())
        };
        // What is not vouched for at all comes last: there the largest number that is one counts.
        let next = all.iter().rev().find(|(d, _)| d.is_finite()).or(all.last())?.1;
        let beyond = all.iter().filter(|(d, _)| !(*d <= SHOWS)).map(|(_, v)| mass(*v)).sum::<f64>();
        let beyond = (beyond / area).max(0.0);
        Some(Expected { median: quantile(0.5), p95: quantile(0.95), beyond, next, place: place(next) })
    }
}
