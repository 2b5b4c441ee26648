//! Reductions of a fixed shape: the same tree, hence the same bits, on every device and on the CPU.
//!
//! One level turns each run of [`RUN`] values into one: lane `l` of 64 takes the values `l`, `l +
//! 64`, ... of the run in turn, then the lanes are taken in order. One barrier a run, because a
//! barrier costs a software device more than the values do. The device does the first level; what
//! is left is a thousandth, read back and finished here.

use super::device::{Buffer, Gpu};
use super::kernel::{BindingKind, GROUP, Kernel, Layout, layout};
use crate::error::Result;

/// Values that one workgroup turns into one.
#[doc(hidden)]
pub const RUN: usize = (GROUP * ITEMS) as usize;
pub(super) const ITEMS: u32 = 16;

/// A value and where it stood.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[doc(hidden)]
pub struct Candidate {
    /// The value.
    pub value: f32,
    /// Its index.
    pub index: u32,
}

impl Candidate {
    /// What loses against everything finite: the neutral element.
    pub const NONE: Self = Self { value: f32::MAX, index: u32::MAX };

    /// The smaller value; the lower index where they are equal.
    fn least(self, other: Self) -> Self {
        let wins = other.value < self.value || (other.value == self.value && other.index < self.index);
        if wins { other } else { self }
    }
}

const LAYOUTS: &[Layout] = &[layout!(Candidate, { value, index })];

pub(super) static REDUCE_SUM: Kernel = Kernel {
    name: "reduce_sum",
    source: include_str!("../../shaders/reduce_sum.wgsl"),
    bindings: &[BindingKind::Read, BindingKind::Write],
    layouts: &[],
    items: ITEMS,
    constants: &[],
};

pub(super) static REDUCE_MIN: Kernel = Kernel {
    name: "reduce_min",
    source: include_str!("../../shaders/reduce_min.wgsl"),
    bindings: &[BindingKind::Read, BindingKind::Write],
    layouts: LAYOUTS,
    items: ITEMS,
    constants: &[],
};

/// One level of the tree.
fn level<T: Copy>(values: &[T], neutral: T, join: impl Fn(T, T) -> T) -> Vec<T> {
    let lanes = GROUP as usize;
    values
        .chunks(RUN)
        .map(|run| {
            let mut lane = vec![neutral; lanes];
            for (i, v) in run.iter().enumerate() {
                lane[i % lanes] = join(lane[i % lanes], *v);
            }
            lane[1..].iter().fold(lane[0], |a, b| join(a, *b))
        })
        .collect()
}

fn tree<T: Copy>(mut values: Vec<T>, neutral: T, join: impl Fn(T, T) -> T) -> Option<T> {
    while values.len() > 1 {
        values = level(&values, neutral, &join);
    }
    values.first().copied()
}

/// The sum of `values` by the fixed tree; zero for none.
pub fn sum(values: &[f32]) -> f32 {
    match values {
        // A single value still passes one level, as it does on the device.
        [v] => 0.0 + v,
        _ => tree(values.to_vec(), 0.0, |a, b| a + b).unwrap_or(0.0),
    }
}

/// The smallest of `values`, all finite, and the lowest index it stands at; `None` for none.
pub fn min(values: &[f32]) -> Option<Candidate> {
    let candidates = values.iter().zip(0..).map(|(&value, index)| Candidate { value, index }).collect();
    tree(candidates, Candidate::NONE, Candidate::least)
}

impl Gpu {
    /// The sum of the first `len` values of a buffer; bit for bit that of [`sum`].
    ///
    /// # Errors
    /// [`Error::Device`](crate::Error::Device).
    pub fn sum(&self, values: &Buffer<f32>, len: usize) -> Result<f32> {
        let partial = self.first_level(&REDUCE_SUM, values, len)?;
        Ok(tree(partial, 0.0, |a: f32, b| a + b).unwrap_or(0.0))
    }

    /// The smallest of the first `len` values of a buffer, all finite, and the lowest index it
    /// stands at; that of [`min`].
    ///
    /// # Errors
    /// [`Error::Device`](crate::Error::Device).
    pub fn min(&self, values: &Buffer<f32>, len: usize) -> Result<Option<Candidate>> {
        let partial = self.first_level(&REDUCE_MIN, values, len)?;
        Ok(tree(partial, Candidate::NONE, Candidate::least))
    }

    fn first_level<T: bytemuck::Pod>(
        &self,
        kernel: &'static Kernel,
        values: &Buffer<f32>,
        len: usize,
    ) -> Result<Vec<T>> {
        values.bytes(&(0..len))?;
        if len == 0 {
            self.check()?;
            return Ok(Vec::new());
        }
        let runs = len.div_ceil(RUN);
        let partial = self.buffer::<T>(kernel.name, runs)?;
        let pipeline = self.pipeline(kernel)?;
        let group = self.bind(&pipeline, &[values.bind(), partial.bind()])?;
        let mut batch = self.batch()?;
        batch.dispatch(&pipeline, &group, len)?;
        batch.submit()?;
        self.read(&partial, 0..runs)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tree_sums_and_finds_the_lowest_index() {
        assert_eq!(sum(&[]), 0.0);
        assert_eq!(sum(&[2.5]), 2.5);
        let ones = vec![1.0; 3 * RUN * RUN + 5];
        assert_eq!(sum(&ones), ones.len() as f32, "whole numbers below 2^24 add exactly in any order");
        assert!(min(&[]).is_none());
        let mut v = vec![1.0; 2 * RUN + 7];
        v[RUN + 3] = -4.0;
        v[2 * RUN + 1] = -4.0;
        assert_eq!(min(&v), Some(Candidate { value: -4.0, index: RUN as u32 + 3 }));
    }
}
