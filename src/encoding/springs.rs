//! An optional term that keeps the lengths of edges.
//!
//! The encoding does not feel a change of size that spreads slowly over a surface: a twisted waist
//! may shrink, a posed animal grow. With a stiffness k, 1/2 k sum L² (|e| - s L)² over the edges is
//! added to G, with L an edge's rest length and s the scale of the start. The factor L² makes it
//! fade against G on finer meshes as G itself does, so that a stiffness means the same at every
//! stage.

use rayon::prelude::*;

use super::decode::BLOCK;
use super::vector::{add_scaled, dot, length, scale, sub};
use super::{Stencils, V3};

/// The term of one stage: a spring a slot, so that an edge with both ends in a ring has two halves.
#[derive(Debug)]
pub(crate) struct Springs {
    /// Square root of the weight, and the length to keep.
    slots: Vec<[f64; 2]>,
}

/// The distance between the ends of every slot, times `size`.
pub(crate) fn slot_lengths(stencils: &Stencils, positions: &[V3<f64>], size: f64) -> Vec<f64> {
    let ends = |s: usize| (stencils.vertex[stencils.slot_row[s] as usize] as usize, stencils.neighbour[s] as usize);
    (0..stencils.neighbour.len())
        .map(|s| {
            let (v, u) = ends(s);
            size * length(sub(positions[v], positions[u]))
        })
        .collect()
}

/// A slot's spring at given positions: its residual is `value` and `direction` the derivative by
/// the row's vertex (minus that by the neighbour).
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Stretch {
    pub(crate) direction: V3<f64>,
    pub(crate) value: f64,
}

impl Springs {
    /// Springs for the slots of `stencils` with given lengths to keep; none for a stiffness of
    /// zero. `size` is the scale at which these lengths are.
    pub(crate) fn new(lengths: &[f64], stiffness: f64, size: f64) -> Option<Self> {
        let root = (0.5 * stiffness).sqrt() / size;
        let usable = stiffness > 0.0 && root.is_finite();
        usable.then(|| Self { slots: lengths.iter().map(|&l| [root * l, l]).collect() })
    }

    /// The term's value.
    pub(crate) fn energy(&self, stencils: &Stencils, positions: &[V3<f64>]) -> f64 {
        let blocks: Vec<f64> = self
            .slots
            .par_chunks(8 * BLOCK)
            .enumerate()
            .map(|(block, part)| {
                let slots = (block * 8 * BLOCK..).zip(part);
                slots.map(|(s, spring)| stretch(stencils, positions, s, *spring).value.powi(2)).sum()
            })
            .collect();
        0.5 * blocks.iter().sum::<f64>()
    }

    /// All springs at `positions`.
    pub(crate) fn linearise(&self, stencils: &Stencils, positions: &[V3<f64>]) -> Vec<Stretch> {
        self.slots.par_iter().enumerate().map(|(s, spring)| stretch(stencils, positions, s, *spring)).collect()
    }
}

fn stretch(stencils: &Stencils, positions: &[V3<f64>], slot: usize, [root, rest]: [f64; 2]) -> Stretch {
    let row = stencils.slot_row[slot] as usize;
    let e = sub(positions[stencils.vertex[row] as usize], positions[stencils.neighbour[slot] as usize]);
    let l = length(e);
    let direction = if l > 0.0 { scale(e, root / l) } else { [0.0; 3] };
    Stretch { direction, value: root * (l - rest) }
}

/// Adds the term's gradient for the vertices from `held` on.
pub(crate) fn add_gradient(stencils: &Stencils, springs: &[Stretch], held: usize, gradient: &mut [V3<f64>]) {
    for (slot, spring) in springs.iter().enumerate() {
        let row = stencils.slot_row[slot] as usize;
        let (v, u) = (stencils.vertex[row] as usize, stencils.neighbour[slot] as usize);
        if v >= held {
            gradient[v] = add_scaled(gradient[v], spring.direction, spring.value);
        }
        if u >= held {
            gradient[u] = add_scaled(gradient[u], spring.direction, -spring.value);
        }
    }
}

/// Adds the term's matrix times `x` for the vertices from `held` on.
pub(crate) fn add_product(
    stencils: &Stencils,
    springs: &[Stretch],
    held: usize,
    x: &[V3<f64>],
    product: &mut [V3<f64>],
) {
    for (slot, spring) in springs.iter().enumerate() {
        let row = stencils.slot_row[slot] as usize;
        let (v, u) = (stencils.vertex[row] as usize, stencils.neighbour[slot] as usize);
        let pull = dot(spring.direction, sub(x[v], x[u]));
        if v >= held {
            product[v] = add_scaled(product[v], spring.direction, pull);
        }
        if u >= held {
            product[u] = add_scaled(product[u], spring.direction, -pull);
        }
    }
}

/// Entry (r, c) of the spring's part of the matrix.
#[inline(always)]
pub(crate) fn outer(springs: &[Stretch], slot: u32, r: usize, c: usize) -> f64 {
    springs.get(slot as usize).map_or(0.0, |s| s.direction[r] * s.direction[c])
}
