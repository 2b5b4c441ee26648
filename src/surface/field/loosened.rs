//! Pairs that are off by a tolerance that is told: their points on the source are moved towards
//! where the others send them.
//!
//! Set by eye, twenty pairs are each off by some s, and a field that holds them exactly is off as
//! much around them. Where the others would send a pair, off by some p, is a second opinion: the
//! mean of both, weighted by what they are off by, is nearer than either. What s is must be told,
//! since residuals do not tell it from how much shapes differ (docs/anchors.md).

use rayon::prelude::*;

use super::contradicted::median;
use super::pair::FieldPair;
use super::{Field, FieldOptions};
use crate::error::Result;
use crate::geometry::{ClosestPoints, SurfacePoint};
use crate::surface::anchors::AnchorPairs;

/// Parts into which pairs are laid; each is asked of a field of the others.
const FOLDS: usize = 5;
/// The median square of an error in a plane is this part of its mean square: ln 2.
const MEDIAN: f64 = std::f64::consts::LN_2;
/// The others are not believed to be nearer than this part of the tolerance.
const OTHERS: f64 = 0.3;
/// A pair moves by no more than so many tolerances.
const FARTHEST: f64 = 1.5;

/// Pairs that were moved, and what they are off by now at the least, over the square root of the
/// source's area.
pub(super) struct Loosened {
    pub(super) anchors: AnchorPairs,
    pub(super) error: f64,
}

impl<const D: usize> FieldPair<'_, D> {
    /// Moves the source's points of pairs that are off by `error`, root mean square, over the
    /// square root of the area. Too few pairs stay where they are. Five fields.
    ///
    /// # Errors
    /// As [`FieldPair::field`].
    pub(super) fn loosened<const K: usize>(
        &self,
        anchors: &AnchorPairs,
        error: f64,
        options: &FieldOptions,
    ) -> Result<Loosened> {
        let n = anchors.len();
        if n < 2 * FOLDS {
            return Ok(Loosened { anchors: anchors.clone(), error });
        }
        let fold = |f: usize| -> Result<Vec<(usize, glam::DVec3)>> {
            let others: Vec<usize> = (0..n).filter(|i| i % FOLDS != f).collect();
            let field: Field<f64, K> = Field::of(self, &anchors.part(&others), options)?;
            Ok((f..n).step_by(FOLDS).map(|i| (i, self.miss(&field, anchors, i))).collect())
        };
        let folds: Vec<_> = (0..FOLDS).into_par_iter().map(fold).collect::<Result<_>>()?;
        let mut misses = vec![glam::DVec3::ZERO; n];
        folds.into_iter().flatten().for_each(|(i, miss)| misses[i] = miss);
        let squares: Vec<f64> = misses.iter().map(|m| m.length_squared()).collect();
        let s = error * error;
        let others = (median(&squares) / MEDIAN - s).max(OTHERS * OTHERS * s);
        let weight = s / (s + others);
        let source = self.shapes.source;
        let closest = ClosestPoints::new(source.mesh, source.topology);
        // Places at unit area are places of the mesh's frame over this.
        let length = source.mesh.area().sqrt() * closest.frame().scale;
        let moved = |i: usize| -> SurfacePoint {
            let way = (misses[i] * weight).clamp_length_max(FARTHEST * error);
            let there = (self.shapes.source_point(&anchors.source[i]) + way) * length;
            closest.nearest_local(there).map_or(anchors.source[i], |(p, _)| p)
        };
        let source = (0..n).map(moved).collect();
        Ok(Loosened {
            anchors: AnchorPairs { source, target: anchors.target.clone() },
            error: error * (1.0 - weight).sqrt(),
        })
    }

    /// From a pair's place on the source to where the field sends it, at unit area.
    fn miss<const K: usize>(&self, field: &Field<f64, K>, anchors: &AnchorPairs, i: usize) -> glam::DVec3 {
        let image = field.map_point(anchors.target[i].into()).point();
        let place = |p: &SurfacePoint| self.shapes.source_point(p);
        image.map_or(glam::DVec3::ZERO, |p| place(&p) - place(&anchors.source[i]))
    }
}
