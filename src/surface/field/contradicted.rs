//! Pairs that the others contradict: they are left out of the map, and named.
//!
//! Each pair is asked where the others would have sent it. Predictions answer that for nothing
//! ([`FieldReport::left_out`](super::FieldReport::left_out)), but only roughly: they name suspects.
//! A suspect is then left out of a whole field, relaxed onto the source, which comes several times
//! nearer to the truth. Being far off is not enough to be wrong: where a tip is left out, a tail,
//! the others cannot tell where it goes. But without a wrong pair the map is strained less, and
//! without a right one it is strained as much or more; that tells them apart. Pairs are taken out
//! one after the other, first the one that strains most, since a wrong one accuses its neighbours.

use super::pair::{FieldPair, Shapes};
use super::{Field, FieldOptions};
use crate::error::Result;
use crate::geometry::SurfacePoint;
use crate::surface::anchors::AnchorPairs;

/// A pair that was left out because the others contradict it.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Contradicted {
    /// Number of the pair, from 0.
    pub index: usize,
    /// How far from its place on the source the others send it, over the square root of the
    /// source's area.
    pub off: f64,
    /// Another contradicted pair, with whose place on the source this one would agree: the two were
    /// exchanged, a left hand for a right one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub exchanged_with: Option<usize>,
}

/// A field, the pairs that it has, and those that they contradict.
pub(super) struct Judged<const K: usize> {
    pub(super) field: Field<f64, K>,
    pub(super) kept: Vec<usize>,
    wrong: Vec<Contradicted>,
}

/// Fewer pairs say nothing about one another.
const FEWEST: usize = 8;
/// Error of a wrong pair, at least, over the square root of the area.
const LEAST: f64 = 0.04;
/// A suspect's prediction misses by more than so many times the median.
const SUSPECT: f64 = 3.0;
/// Suspects that are left out of a whole field in one round.
const AT_ONCE: usize = 4;
/// A wrong pair is off by more than so many times what predictions usually miss by.
const OF_USUAL: f64 = 1.5;
/// Without a wrong pair the strain of the map falls below this part of what it was.
const RELIEF: f64 = 0.8;
/// Below this part where the pair is off by more than [`FAR`] times what is usual: strain says less
/// where shapes differ much, and errors less where they differ little.
const SOME_RELIEF: f64 = 0.9;
const FAR: f64 = 4.0;
/// And by more than so many times the error that pairs may have.
const OF_TOLERANCE: f64 = 3.0;
/// Part of the pairs that may be left out.
const MOST: usize = 4;

impl<const D: usize> FieldPair<'_, D> {
    /// The field of the pairs that the others do not contradict; the report names those left out.
    /// In double precision, so that every back end leaves out the same.
    ///
    /// # Errors
    /// As [`FieldPair::field`].
    pub(super) fn judged<const K: usize>(&self, anchors: &AnchorPairs, options: &FieldOptions) -> Result<Judged<K>> {
        let mut field: Field<f64, K> = Field::of(self, anchors, options)?;
        let least = LEAST.max(OF_TOLERANCE * options.anchor_error);
        let mut kept: Vec<usize> = (0..anchors.len()).collect();
        let mut out: Vec<usize> = Vec::new();
        while kept.len() > FEWEST && MOST * (out.len() + 1) <= anchors.len() {
            let left_out = &field.report.left_out;
            let usual = median(left_out);
            let bound = least.max(OF_USUAL * usual);
            // One after the other: a field at a time is in memory beside the two best.
            let mut worst: Option<(f64, usize, Field<f64, K>)> = None;
            let mut strain = None;
            for k in suspects(left_out, usual) {
                let others: Vec<usize> = kept.iter().copied().filter(|&i| i != kept[k]).collect();
                let without: Field<f64, K> = Field::of(self, &anchors.part(&others), options)?;
                let off = self.off(&without, anchors, kept[k]);
                if !(off > bound) {
                    continue;
                }
                let left = self.strain(&without) / *strain.get_or_insert_with(|| self.strain(&field));
                let wrong = left < RELIEF || (left < SOME_RELIEF && off > FAR * usual);
                if wrong && worst.as_ref().is_none_or(|w| left < w.0) {
                    worst = Some((left, k, without));
                }
            }
            let Some((_, k, without)) = worst else { break };
            out.push(kept.remove(k));
            field = without;
        }
        if out.is_empty() {
            return Ok(Judged { field, kept, wrong: Vec::new() });
        }
        // What was taken out while a wrong pair accused it comes back.
        let bound = least.max(OF_USUAL * median(&field.report.left_out));
        let found = |index: usize| Contradicted { index, off: self.off(&field, anchors, index), exchanged_with: None };
        let (wrong, right): (Vec<_>, Vec<_>) = out.into_iter().map(found).partition(|o| o.off > bound);
        if !right.is_empty() {
            kept.extend(right.iter().map(|o| o.index));
            kept.sort_unstable();
            field = Field::of(self, &anchors.part(&kept), options)?;
        }
        Ok(Judged { field, kept, wrong })
    }

    /// How far from its place the field sends the pair of this number, at unit area.
    pub(super) fn off<const K: usize>(&self, field: &Field<f64, K>, anchors: &AnchorPairs, i: usize) -> f64 {
        self.between(field, &anchors.target[i], &anchors.source[i])
    }

    fn between<const K: usize>(&self, field: &Field<f64, K>, from: &SurfacePoint, to: &SurfacePoint) -> f64 {
        let shapes: &Shapes<'_> = &self.shapes;
        let place = |p: &SurfacePoint| shapes.source_point(p);
        field.map_point((*from).into()).point().map_or(1.0, |p| place(&p).distance(place(to)))
    }

    /// Writes what was left out into the report, whose errors are those of all pairs again.
    pub(super) fn name<const K: usize>(&self, judged: Judged<K>, anchors: &AnchorPairs) -> Field<f64, K> {
        let Judged { mut field, kept, mut wrong } = judged;
        if wrong.is_empty() {
            return field;
        }
        wrong.iter_mut().for_each(|o| o.off = self.off(&field, anchors, o.index));
        let mut errors = vec![0.0; anchors.len()];
        kept.iter().zip(&field.report.left_out).for_each(|(&i, e)| errors[i] = *e);
        wrong.iter().for_each(|o| errors[o.index] = o.off);
        let exchanged = |o: &Contradicted, other: &Contradicted| {
            let near = 0.3 * o.off.min(other.off);
            o.index != other.index
                && self.between(&field, &anchors.target[o.index], &anchors.source[other.index]) < near
                && self.between(&field, &anchors.target[other.index], &anchors.source[o.index]) < near
        };
        let with: Vec<Option<usize>> =
            wrong.iter().map(|o| wrong.iter().find(|w| exchanged(o, w)).map(|w| w.index)).collect();
        wrong.iter_mut().zip(with).for_each(|(o, with)| o.exchanged_with = with);
        wrong.sort_by_key(|o| o.index);
        field.report.left_out = errors;
        field.report.contradicted = wrong;
        field
    }
}

pub(super) fn median(x: &[f64]) -> f64 {
    let mut sorted = x.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}

/// Those whose prediction misses by far the most, at most [`AT_ONCE`], the worst first.
fn suspects(left_out: &[f64], usual: f64) -> Vec<usize> {
    let bound = LEAST.max(SUSPECT * usual);
    let mut all: Vec<usize> = (0..left_out.len()).filter(|&k| left_out[k] > bound).collect();
    all.sort_by(|&a, &b| left_out[b].total_cmp(&left_out[a]).then(a.cmp(&b)));
    all.truncate(AT_ONCE);
    all
}
