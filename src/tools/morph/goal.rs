//! What an in-between is a blend of.

use super::Morpher;
use crate::encoding::Coarse;

/// The weights of one step: one an input.
#[derive(Debug)]
pub(super) struct Goal {
    /// Those of position, turn and size.
    pub(super) mean: Vec<f64>,
    /// Those of every number of the hierarchy, then those of every vertex of the mesh; empty where
    /// all are `mean`.
    pub(super) each: Vec<f64>,
}

impl Goal {
    /// The weights of entry `k` of `each`.
    pub(super) fn at(&self, k: u32) -> &[f64] {
        let count = self.mean.len();
        if self.each.is_empty() { &self.mean } else { &self.each[k as usize * count..][..count] }
    }
}

/// An in-between whose coarse stage is known.
#[derive(Debug)]
pub(super) enum Reached {
    /// An input as it was given.
    Input(usize),
    /// A blend.
    Between(Box<(Goal, Coarse)>),
}

/// Weights of every vertex, and the way there from the shape that rules at the anchors.
pub(super) struct Mask {
    /// That shape.
    pub(super) corner: usize,
    mean: Vec<f64>,
    /// As in [`Goal`].
    each: Vec<f64>,
}

impl Mask {
    /// `weights` has one an input, vertex by vertex of the mesh.
    pub(super) fn new(morpher: &Morpher, weights: &[f64]) -> Self {
        let k = morpher.shapes.len();
        let of = |v: u32| &weights[v as usize * k..][..k];
        let mut each: Vec<f64> = morpher.marcher.hierarchy().order.iter().flat_map(|&v| of(v)).copied().collect();
        each.extend(weights);
        let mut mean = vec![0.0; k];
        for &v in &morpher.anchors.held {
            mean.iter_mut().zip(of(v)).for_each(|(m, w)| *m += w);
        }
        let total: f64 = mean.iter().sum();
        mean.iter_mut().for_each(|m| *m /= total);
        let corner = (0..k).fold(0, |b, i| if mean[i] > mean[b] { i } else { b });
        Self { corner, mean, each }
    }

    /// The share `s` of the mask, the rest being the first shape.
    pub(super) fn goal(&self, s: f64) -> Goal {
        let k = self.mean.len();
        let toward = |(i, &w): (usize, &f64)| {
            if s == 1.0 { w } else { s * w + if i % k == self.corner { 1.0 - s } else { 0.0 } }
        };
        Goal {
            mean: self.mean.iter().enumerate().map(toward).collect(),
            each: self.each.iter().enumerate().map(toward).collect(),
        }
    }
}
