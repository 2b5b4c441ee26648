//! Polygons and minima along one path, each made once.

use std::collections::{BTreeMap, HashMap};

use rayon::prelude::*;

use crate::control;
use crate::error::{Error, Result};
use crate::geometry::Polygon;
use crate::geometry::polygon::Nesting;

use crate::mapping::plane::path::{PathKind, VertexPath, polygon_at};
use crate::mapping::plane::{Coordinates, Minimum};
use crate::progress::Progress;

use super::{StepReport, Stop};

/// Smallest Jacobians of the maps between pairs of polygons, in the order of the pairs.
pub type Evaluate<'a> = dyn FnMut(&[(Polygon, Polygon)]) -> Result<Vec<Minimum>> + 'a;

/// A partition along one path.
pub(super) struct Found {
    pub(super) polygons: Vec<Polygon>,
    pub(super) knots: Vec<f64>,
    pub(super) steps: Vec<StepReport>,
    pub(super) path: PathKind,
}

impl Found {
    /// Whether a step folds.
    pub(super) fn folds(&self) -> bool {
        self.steps.iter().any(|step| !step.minimum.positive())
    }
}

/// What was found along a path so far. Times are not negative: their bits are ordered as they are.
pub(super) struct Steps<'a, 'e> {
    pub(super) path: &'a dyn VertexPath,
    nesting: &'a Nesting,
    coordinates: Coordinates,
    evaluate: &'a mut Evaluate<'e>,
    progress: &'a dyn Progress,
    polygons: BTreeMap<u64, Polygon>,
    minima: HashMap<(u64, u64), Minimum>,
}

impl<'a, 'e> Steps<'a, 'e> {
    pub(super) fn new(
        path: &'a dyn VertexPath,
        nesting: &'a Nesting,
        coordinates: Coordinates,
        evaluate: &'a mut Evaluate<'e>,
        progress: &'a dyn Progress,
    ) -> Self {
        Self { path, nesting, coordinates, evaluate, progress, polygons: BTreeMap::new(), minima: HashMap::new() }
    }

    /// Makes and checks the polygons of `times` that are not there yet; the first time without one
    /// stops.
    fn prepare(&mut self, times: impl IntoIterator<Item = f64>) -> std::result::Result<(), Stop> {
        let mut wanted: Vec<u64> =
            times.into_iter().map(f64::to_bits).filter(|bits| !self.polygons.contains_key(bits)).collect();
        wanted.sort_unstable();
        wanted.dedup();
        // By themselves: the evaluator beside them is not shared between threads.
        let (path, nesting, coordinates) = (self.path, self.nesting, self.coordinates);
        let made: Vec<Result<Polygon>> = wanted
            .par_iter()
            .map(|&bits| {
                let polygon = polygon_at(path, f64::from_bits(bits), nesting)?;
                coordinates.check(&polygon)?;
                Ok(polygon)
            })
            .collect();
        for (bits, polygon) in wanted.into_iter().zip(made) {
            self.polygons.insert(bits, polygon.map_err(Stop::Path)?);
        }
        Ok(())
    }

    /// Smallest Jacobians of the steps over `intervals`, those not known yet in one call.
    pub(super) fn minima(&mut self, intervals: &[(f64, f64)]) -> std::result::Result<Vec<Minimum>, Stop> {
        let key = |&(a, b): &(f64, f64)| (a.to_bits(), b.to_bits());
        self.prepare(intervals.iter().flat_map(|&(a, b)| [a, b]))?;
        let mut wanted: Vec<(u64, u64)> = intervals.iter().map(key).filter(|k| !self.minima.contains_key(k)).collect();
        wanted.sort_unstable();
        wanted.dedup();
        if !wanted.is_empty() {
            control::check().map_err(Stop::Fault)?;
            let pairs: Vec<(Polygon, Polygon)> =
                wanted.iter().map(|(a, b)| (self.polygons[a].clone(), self.polygons[b].clone())).collect();
            let found = (self.evaluate)(&pairs).map_err(Stop::Fault)?;
            if found.len() != pairs.len() {
                let what = format!("{} minima for {} pairs of polygons", found.len(), pairs.len());
                return Err(Stop::Fault(Error::numeric(what, "Report this as a fault")));
            }
            self.minima.extend(wanted.into_iter().zip(found));
            self.progress.advance(pairs.len() as u64);
        }
        Ok(intervals.iter().map(|interval| self.minima[&key(interval)]).collect())
    }

    /// The partition with the given rising knots, all of its steps evaluated.
    pub(super) fn at_knots(&mut self, knots: Vec<f64>) -> std::result::Result<Found, Stop> {
        let intervals: Vec<(f64, f64)> = knots.windows(2).map(|w| (w[0], w[1])).collect();
        let minima = self.minima(&intervals)?;
        let steps: Vec<StepReport> =
            intervals.iter().zip(minima).map(|(&(from, to), minimum)| StepReport { from, to, minimum }).collect();
        Ok(Found {
            polygons: knots.iter().map(|t| self.polygons[&t.to_bits()].clone()).collect(),
            knots,
            steps,
            path: self.path.kind(),
        })
    }
}
