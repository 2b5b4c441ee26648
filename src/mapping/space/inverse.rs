//! Exact pre-images under composite maps in space, by Newton's method with the analytic derivative.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::composite::{CompositeMap, Mapped, matrix};
use super::{Evaluation, Step};
use crate::engine::Lanes;

/// Iterations of Newton's method that all points of a step take together; those that need more go
/// on alone.
const TOGETHER: usize = 6;

/// Iterations of a point alone.
const ALONE: usize = 60;

/// Halvings of an iteration that does not bring the image closer.
const HALVINGS: usize = 24;

/// A residual is zero when it is below this many roundings of local coordinates, whose size is 1.
const ROUNDINGS: f64 = 256.0;

impl CompositeMap {
    /// The points that are mapped to `points`, in double precision, with the forward derivatives
    /// there.
    ///
    /// Step by step from the last: the step between the same polyhedra backwards gives a start
    /// whose error is quadratic in the displacement, damped Newton iterations with the analytic
    /// derivative finish. Inside the target of a map that does not fold there is exactly one
    /// pre-image. `None` where none is found, as can happen outside it or where the map folds.
    pub fn inverse(&self, points: &[DVec3]) -> Vec<Option<Mapped>> {
        let last = self.frame(self.step_count());
        let mut at: Vec<Option<[f64; 3]>> = points.iter().map(|&q| q.is_finite().then(|| last.local(q))).collect();
        let mut derivatives = vec![DMat3::IDENTITY; points.len()];
        for k in (0..self.step_count()).rev() {
            let kept: Vec<usize> = (0..at.len()).filter(|&i| at[i].is_some()).collect();
            let goals: Vec<[f64; 3]> = kept.iter().filter_map(|&i| at[i]).collect();
            let found = invert(&self.step(k), &self.step_back(k), &goals);
            for (&i, found) in kept.iter().zip(found) {
                at[i] = found.map(|(x, derivative)| {
                    derivatives[i] *= derivative;
                    x
                });
            }
        }
        let first = self.frame(0);
        let one = |(x, derivative): (Option<[f64; 3]>, DMat3)| x.map(|x| Mapped { point: first.world(x), derivative });
        at.into_iter().zip(derivatives).map(one).collect()
    }
}

/// Solves `step(x) = y` for each of `goals`.
fn invert(step: &Step<f64>, back: &Step<f64>, goals: &[[f64; 3]]) -> Vec<Option<([f64; 3], DMat3)>> {
    let lanes = Lanes::detect();
    let mut starts = goals.to_vec();
    back.map_all(lanes, &mut starts);
    let mut found: Vec<Option<([f64; 3], DMat3)>> = vec![None; goals.len()];
    let mut left: Vec<usize> = (0..goals.len()).collect();
    let mut at = starts.clone();
    for _ in 0..TOGETHER {
        let points: Vec<[f64; 3]> = left.iter().map(|&i| at[i]).collect();
        let images = step.evaluate_all(lanes, &points);
        let mut rest = Vec::new();
        for (&i, e) in left.iter().zip(&images) {
            match newton(at[i], e, goals[i]) {
                Next::Done => found[i] = Some((at[i], matrix(e.derivative))),
                Next::Go(x) => {
                    at[i] = x;
                    rest.push(i);
                }
                Next::Stop => rest.push(i),
            }
        }
        left = rest;
        if left.is_empty() {
            return found;
        }
    }
    let alone: Vec<_> = left.par_iter().map(|&i| damped(step, goals[i], starts[i])).collect();
    left.into_iter().zip(alone).for_each(|(i, x)| found[i] = x);
    found
}

enum Next {
    /// The residual is rounding.
    Done,
    Go([f64; 3]),
    /// No step can be taken.
    Stop,
}

fn small(off: DVec3, x: [f64; 3], y: [f64; 3]) -> bool {
    off.length() <= ROUNDINGS * f64::EPSILON * (1.0 + DVec3::from(x).length() + DVec3::from(y).length())
}

fn newton(x: [f64; 3], e: &Evaluation<f64>, y: [f64; 3]) -> Next {
    let off = DVec3::from(e.point) - DVec3::from(y);
    if small(off, x, y) {
        return Next::Done;
    }
    let next = DVec3::from(x) - matrix(e.derivative).inverse() * off;
    if next.is_finite() { Next::Go(next.to_array()) } else { Next::Stop }
}

/// Newton's method with halving, for what the plain one does not settle.
fn damped(step: &Step<f64>, y: [f64; 3], start: [f64; 3]) -> Option<([f64; 3], DMat3)> {
    let mut x = start;
    let mut e = step.evaluate(x);
    for _ in 0..ALONE {
        let off = DVec3::from(e.point) - DVec3::from(y);
        let Next::Go(full) = newton(x, &e, y) else {
            return small(off, x, y).then(|| (x, matrix(e.derivative)));
        };
        let by = DVec3::from(full) - DVec3::from(x);
        let mut factor = 1.0;
        let mut halved = 0;
        loop {
            let next = (DVec3::from(x) + by * factor).to_array();
            let there = step.evaluate(next);
            if (DVec3::from(there.point) - DVec3::from(y)).length() < off.length() {
                (x, e) = (next, there);
                break;
            }
            halved += 1;
            if halved > HALVINGS {
                // At the rounding of the map, or at an edge, where its derivative jumps.
                let close = 1e-9;
                return (off.length() <= close).then(|| (x, matrix(e.derivative)));
            }
            factor *= 0.5;
        }
    }
    None
}
