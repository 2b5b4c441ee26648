//! Reductions and compaction.

use super::{Check, Outcome, device, outcome, timed};
use crate::engine::reduce::{self, RUN};
use crate::engine::{Compaction, Engine, Matching};
use crate::error::Result;
use crate::models::shapes::Random;

pub(super) const CHECKS: &[Check] = &[
    Check {
        name: "sum",
        kernels: &["reduce_sum"],
        unit: "last places of single precision",
        tolerance: 0.0,
        measure: sum,
    },
    Check { name: "minimum", kernels: &["reduce_min"], unit: "other places", tolerance: 0.0, measure: minimum },
    Check {
        name: "compaction",
        kernels: &["compact_count", "compact_scan", "compact_scatter"],
        unit: "other items",
        tolerance: 0.0,
        measure: compaction,
    },
];

/// Not a multiple of anything.
const COUNT: usize = 1000 * RUN + 17;

fn numbers() -> Vec<f32> {
    let mut random = Random::new(3);
    (0..COUNT).map(|_| random.signed() as f32).collect()
}

fn sum(engine: &Engine) -> Result<Outcome> {
    let gpu = device(engine)?;
    let values = numbers();
    let buffer = gpu.upload("values", &values)?;
    let found = timed(|| gpu.sum(&buffer, values.len()))?;
    let expected = timed(|| Ok(reduce::sum(&values)))?;
    let apart = found.value.to_bits().abs_diff(expected.value.to_bits());
    Ok(outcome(&found, &expected, f64::from(apart)))
}

fn minimum(engine: &Engine) -> Result<Outcome> {
    let gpu = device(engine)?;
    let values = numbers();
    let buffer = gpu.upload("values", &values)?;
    let found = timed(|| gpu.min(&buffer, values.len()))?;
    let expected = timed(|| Ok(reduce::min(&values)))?;
    Ok(outcome(&found, &expected, f64::from(u8::from(found.value != expected.value))))
}

fn compaction(engine: &Engine) -> Result<Outcome> {
    let gpu = device(engine)?;
    let items: Vec<u32> = numbers().iter().map(|x| u32::from(*x > 0.8)).collect();
    let buffer = gpu.upload("items", &items)?;
    let compaction = Compaction::new(gpu, &buffer, COUNT, Matching { stride: 1, offset: 0, value: 1, mask: 1 })?;
    let found = timed(|| {
        let mut batch = gpu.batch()?;
        compaction.record(&mut batch, COUNT)?;
        batch.submit()?;
        compaction.read(gpu)
    })?;
    let expected = timed(|| Ok((0..COUNT as u32).filter(|i| items[*i as usize] == 1).collect::<Vec<u32>>()))?;
    Ok(outcome(&found, &expected, others(&found.value, &expected.value)))
}

/// How many places of two lists hold different items.
fn others(a: &[u32], b: &[u32]) -> f64 {
    (a.iter().zip(b).filter(|(a, b)| a != b).count() + a.len().abs_diff(b.len())) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_are_compared_item_by_item() {
        assert_eq!(others(&[1, 2, 3], &[1, 2, 3]), 0.0);
        assert_eq!(others(&[1, 2, 3], &[1, 3]), 2.0);
    }
}
