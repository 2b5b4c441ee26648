//! Averages of the encodings of several shapes with the same rings (section 4.3).

use rayon::prelude::*;

use super::encode::encode_ring;
use super::hierarchy::Stage;
use super::springs::slot_lengths;
use super::{Encoding, Hierarchy, Stencils, V3};
use crate::error::{Error, Result};

/// The coefficients of several shapes on the rings of one hierarchy.
#[derive(Clone, Debug)]
pub struct Blend {
    /// Per shape: splits, then the stages.
    shapes: Vec<Vec<Encoding<f64>>>,
    /// Per shape and stage: the length of every slot's edge.
    lengths: Vec<Vec<Vec<f64>>>,
    /// Rings that could not be encoded in some other shape and take the first one's coefficients
    /// there.
    pub borrowed: usize,
}

impl Blend {
    /// Encodes `shapes` on the rings of `hierarchy`, which was made from the first one. Each shape
    /// has one position per number of the hierarchy.
    ///
    /// # Errors
    /// [`Error::Input`] if a shape has another number of positions.
    pub fn new(hierarchy: &Hierarchy, shapes: &[Vec<V3<f64>>]) -> Result<Self> {
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

    /// Number of shapes.
    pub fn len(&self) -> usize {
        self.shapes.len()
    }

    /// Whether there is no shape.
    pub fn is_empty(&self) -> bool {
        self.shapes.is_empty()
    }

    /// Writes the average with `weights(number)` (one a shape, summing to one) into `hierarchy`,
    /// the one this was made for, and returns the averages of the edges' lengths, stage by stage.
    ///
    /// The weights w are averaged, and the angles arctan b instead of b, whose size has no bound. A
    /// single shape's encoding comes back as it is.
    pub fn write<'w>(&self, hierarchy: &mut Hierarchy, weights: impl Fn(u32) -> &'w [f64] + Sync) -> Vec<Vec<f64>> {
        let mut targets: Vec<(&Stencils, &mut Encoding<f64>)> =
            vec![(&hierarchy.splits, &mut hierarchy.split_encoding)];
        targets.extend(hierarchy.stages.iter_mut().map(|s| (&s.stencils, &mut s.encoding)));
        for (part, (stencils, out)) in targets.into_iter().enumerate() {
            let slots = out.w.par_iter_mut().zip(out.b.par_iter_mut()).enumerate();
            slots.for_each(|(slot, (w, b))| {
                let weights = weights(stencils.vertex[stencils.slot_row[slot] as usize]);
                if let Some(only) = weights.iter().position(|&x| x == 1.0) {
                    let e = &self.shapes[only][part];
                    (*w, *b) = (e.w[slot], e.b[slot]);
                    return;
                }
                let mut angle = 0.0;
                *w = 0.0;
                for (x, shape) in weights.iter().zip(&self.shapes) {
                    *w += x * shape[part].w[slot];
                    angle += x * shape[part].b[slot].atan();
                }
                *b = angle.tan();
            });
        }
        let stage = |(k, stage): (usize, &Stage)| {
            let slot = |s: usize| {
                let row = stage.stencils.slot_row[s] as usize;
                let weights = weights(stage.stencils.vertex[row]);
                weights.iter().zip(&self.lengths).map(|(w, shape)| w * shape[k][s]).sum()
            };
            (0..stage.stencils.neighbour.len()).map(slot).collect()
        };
        hierarchy.stages.iter().enumerate().map(stage).collect()
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
