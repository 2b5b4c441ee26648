//! Averages of the encodings of several shapes with the same rings (section 4.3).

use std::ops::Range;

use rayon::prelude::*;

use super::encode::encode_ring;
use super::springs::slot_lengths;
use super::{Encoding, Hierarchy, Stencils, V3};
use crate::error::{Error, Result};

/// The coefficients of several shapes on the rings of one hierarchy.
#[derive(Clone, Debug)]
pub(crate) struct Blend {
    /// Per shape: splits, then the stages.
    shapes: Vec<Vec<Encoding<f64>>>,
    /// Per shape and stage: the length of every slot's edge.
    lengths: Vec<Vec<Vec<f64>>>,
    /// Rings that could not be encoded in some other shape and take the first one's coefficients
    /// there.
    pub(crate) borrowed: usize,
}

impl Blend {
    /// Encodes `shapes` on the rings of `hierarchy`, which was made from the first one. Each shape
    /// has one position per number of the hierarchy.
    ///
    /// # Errors
    /// [`Error::Input`] if a shape has another number of positions.
    pub(crate) fn new(hierarchy: &Hierarchy, shapes: &[Vec<V3<f64>>]) -> Result<Self> {
        let n = hierarchy.order.len();
        if let Some(k) = shapes.iter().position(|s| s.len() != n) {
            let what = format!("shape {k} has {} vertices, the first one {n}", shapes[k].len());
            return Err(Error::input(what, "Give shapes of the same connectivity"));
        }
        let mut own = vec![(&hierarchy.splits, &hierarchy.split_encoding)];
        own.extend(hierarchy.stages.iter().map(|s| (&s.stencils, &s.encoding)));
        let mut borrowed = 0;
        let mut result = Vec::with_capacity(shapes.len());
        for shape in shapes {
            let mut parts = Vec::with_capacity(own.len());
            for (stencils, encoding) in &own {
                let (part, missing) = encode_on(stencils, encoding, shape);
                borrowed += missing;
                parts.push(part);
            }
            result.push(parts);
        }
        let lengths = shapes
            .iter()
            .map(|x| hierarchy.stages.iter().map(|s| slot_lengths(&s.stencils, x, 1.0)).collect())
            .collect();
        Ok(Self { shapes: result, lengths, borrowed })
    }

    /// The average with `weights(number)` (one a shape, summing to one) on `stages` of `hierarchy`,
    /// the one this was made for, and on the splits that lead from the first of them to the last.
    ///
    /// The weights w are averaged, and the angles arctan b instead of b, whose size has no bound. A
    /// single shape's encoding comes back as it is.
    ///
    /// # Panics
    /// If `stages` is empty or out of range.
    pub(crate) fn mix<'w>(
        &self,
        hierarchy: &Hierarchy,
        stages: Range<usize>,
        weights: impl Fn(u32) -> &'w [f64] + Sync,
    ) -> Mix {
        let levels = hierarchy.stages[stages.start].levels.end..hierarchy.stages[stages.end - 1].levels.end;
        let row = |level: usize| hierarchy.level_start[level] as usize;
        let rows = row(levels.start)..row(levels.end);
        let splits = self.average(0, &hierarchy.splits, rows, &weights);
        let stage = |k: usize| {
            let stencils = &hierarchy.stages[k].stencils;
            let slot = |s: usize| -> f64 {
                let weights = weights(stencils.vertex[stencils.slot_row[s] as usize]);
                weights.iter().zip(&self.lengths).map(|(w, shape)| w * shape[k][s]).sum()
            };
            let encoding = self.average(k + 1, stencils, 0..stencils.row_count(), &weights);
            (encoding, (0..stencils.neighbour.len()).map(slot).collect())
        };
        Mix { splits, first: stages.start, stages: stages.map(stage).collect() }
    }

    /// The average of one part (0 the splits, then the stages) on `rows`; zero on others.
    fn average<'w>(
        &self,
        part: usize,
        stencils: &Stencils,
        rows: Range<usize>,
        weights: &(impl Fn(u32) -> &'w [f64] + Sync),
    ) -> Encoding<f64> {
        let count = stencils.neighbour.len();
        let mut out = Encoding { w: vec![0.0; count], b: vec![0.0; count] };
        let slots = stencils.start[rows.start] as usize..stencils.start[rows.end] as usize;
        let targets = out.w[slots.clone()].par_iter_mut().zip(&mut out.b[slots.clone()]).enumerate();
        targets.with_min_len(1024).for_each(|(k, (w, b))| {
            let slot = slots.start + k;
            let weights = weights(stencils.vertex[stencils.slot_row[slot] as usize]);
            if let Some(only) = weights.iter().position(|&x| x == 1.0) {
                let e = &self.shapes[only][part];
                (*w, *b) = (e.w[slot], e.b[slot]);
                return;
            }
            let mut angle = 0.0;
            for (x, shape) in weights.iter().zip(&self.shapes) {
                *w += x * shape[part].w[slot];
                angle += x * shape[part].b[slot].atan();
            }
            *b = angle.tan();
        });
        out
    }
}

/// An average of the shapes of a [`Blend`] on some stages.
#[derive(Clone, Debug)]
pub(crate) struct Mix {
    /// Coefficients of the splits between the stages; zero on other rows.
    pub(super) splits: Encoding<f64>,
    first: usize,
    /// Coefficients, and the length of every slot's edge.
    stages: Vec<(Encoding<f64>, Vec<f64>)>,
}

impl Mix {
    /// Coefficients and lengths of stage `k` of the hierarchy.
    pub(super) fn stage(&self, k: usize) -> (&Encoding<f64>, &[f64]) {
        let (encoding, lengths) = &self.stages[k - self.first];
        (encoding, lengths)
    }
}

/// `shape` on the rings of `stencils`; rows that cannot be encoded there take `own` coefficients
/// and are counted.
fn encode_on(stencils: &Stencils, own: &Encoding<f64>, shape: &[V3<f64>]) -> (Encoding<f64>, usize) {
    let mut out = own.clone();
    let mut missing = 0;
    let (mut w, mut b) = (Vec::new(), Vec::new());
    for row in 0..stencils.row_count() {
        let slots = stencils.slots(row);
        w.clear();
        w.resize(slots.len(), 0.0);
        b.clone_from(&w);
        if encode_ring(shape, stencils.vertex[row], stencils.ring(row), &mut w, &mut b).is_some() {
            out.w[slots.clone()].copy_from_slice(&w);
            out.b[slots].copy_from_slice(&b);
        } else {
            missing += 1;
        }
    }
    (out, missing)
}
