//! Multidimensional scaling: points of R^D whose distances are close to given ones.
//!
//! The stress is the sum of (1 - d/Q)^2 over pairs (equation 14), that is weights 1/Q^2.
//! Majorisation (SMACOF) replaces X by the minimiser V^+ B(X) X of a quadratic that bounds the
//! stress from above and touches it at X, so that the stress cannot rise. Such steps are
//! preconditioned gradient steps; here they are combined by limited-memory quasi-Newton steps in
//! the inner product of V, and a combined step that would raise the stress is replaced by the plain
//! one.

mod classical;
mod problem;

use std::collections::VecDeque;

use faer::Mat;

pub(crate) use classical::classical;
pub(crate) use problem::Problem;

use crate::control;
use crate::error::Result;

/// Pairs of steps the quasi-Newton directions are made of.
const HISTORY: usize = 6;

/// When to stop scaling.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stop {
    /// Largest number of sweeps.
    pub(crate) sweeps: usize,
    /// Stop when ten sweeps lower the stress by less than this part of it.
    pub(crate) tolerance: f64,
    /// Stop at this stress.
    pub(crate) enough: f64,
}

/// Stress with distances off by 1e-4 in the mean: those that are scaled, marched over triangles,
/// are off by more. Shapes that are flat, or nearly, would be swept for ever.
pub(crate) const ENOUGH: f64 = 1e-8;

/// How a sweep steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Step {
    /// Quasi-Newton: to a minimum in the fewest sweeps.
    Combined,
    /// Majorisation alone: a path that turns nowhere, for those who do not go to its end.
    Plain,
}

/// Points, one column per dimension, with the stress after each sweep (mean over pairs; the first
/// entry is the start's).
#[derive(Clone, Debug)]
pub(crate) struct Scaled {
    pub(crate) points: Mat<f64>,
    pub(crate) stress: Vec<f64>,
}

fn dot(a: &Mat<f64>, b: &Mat<f64>) -> f64 {
    (0..a.ncols()).map(|k| a.col_as_slice(k).iter().zip(b.col_as_slice(k)).map(|(x, y)| x * y).sum::<f64>()).sum()
}

/// a + t b.
fn plus(a: &Mat<f64>, t: f64, b: &Mat<f64>) -> Mat<f64> {
    Mat::from_fn(a.nrows(), a.ncols(), |i, k| a[(i, k)] + t * b[(i, k)])
}

/// A step taken and the change of the residual X - V^+ B(X) X over it, both with their products
/// with V.
struct Pair {
    step: Mat<f64>,
    v_step: Mat<f64>,
    change: Mat<f64>,
    v_change: Mat<f64>,
    curvature: f64,
}

/// A matrix of points and its product with V.
#[derive(Clone)]
struct WithV {
    x: Mat<f64>,
    v: Mat<f64>,
}

impl WithV {
    /// Adds t times another.
    fn add(&mut self, t: f64, x: &Mat<f64>, v: &Mat<f64>) {
        for (to, from) in [(&mut self.x, x), (&mut self.v, v)] {
            for k in 0..from.ncols() {
                to.col_as_slice_mut(k).iter_mut().zip(from.col_as_slice(k)).for_each(|(a, b)| *a += t * b);
            }
        }
    }

    fn scale(&mut self, t: f64) {
        for to in [&mut self.x, &mut self.v] {
            (0..to.ncols()).for_each(|k| to.col_as_slice_mut(k).iter_mut().for_each(|a| *a *= t));
        }
    }
}

/// The quasi-Newton direction for a residual (two-loop recursion in the inner product of V; without
/// history the SMACOF step, the residual downwards). Its product with V comes along: it is a
/// combination of matrices whose products are there.
fn direction(residual: WithV, history: &VecDeque<Pair>) -> WithV {
    let mut q = residual;
    let mut factors = Vec::new();
    for pair in history.iter().rev() {
        let factor = dot(&pair.v_step, &q.x) / pair.curvature;
        q.add(-factor, &pair.change, &pair.v_change);
        factors.push(factor);
    }
    if let Some(last) = history.back() {
        q.scale(last.curvature / dot(&last.change, &last.v_change));
    }
    for (pair, factor) in history.iter().zip(factors.into_iter().rev()) {
        let back = dot(&pair.v_change, &q.x) / pair.curvature;
        q.add(factor - back, &pair.step, &pair.v_step);
    }
    q.scale(-1.0);
    q
}

/// Lowers the stress from `start` until `stop`; the stress never rises from one sweep to the next.
///
/// `distances` is a full symmetric n x n matrix, positive off the diagonal; `start` has n rows and
/// 4, 8, 12 or 16 columns. `swept` is called after each sweep. A sweep costs O(n^2 D), the set-up
/// O(n^3).
pub(crate) fn smacof(distances: &[f64], start: Mat<f64>, stop: Stop, swept: impl FnMut()) -> Result<Scaled> {
    descend(&Problem::new(distances, start.nrows())?, start, Step::Combined, stop, swept)
}

/// [`smacof`] for a problem that has been set up.
pub(crate) fn descend(
    problem: &Problem,
    start: Mat<f64>,
    steps: Step,
    stop: Stop,
    mut swept: impl FnMut(),
) -> Result<Scaled> {
    let mut x = start;
    let (mut stress, b) = problem.evaluate(&x);
    let mut trace = vec![stress];
    let mut history: VecDeque<Pair> = VecDeque::new();
    let mut vx = problem.v_product(&x);
    // The residual r = X - V^+ B(X) X and V r = V X - B(X) X.
    let residual = |x: &Mat<f64>, vx: &Mat<f64>, b: &Mat<f64>| WithV {
        x: plus(x, -1.0, &problem.v_plus_product(b)),
        v: plus(vx, -1.0, b),
    };
    let mut r = residual(&x, &vx, &b);
    while trace.len() <= stop.sweeps {
        control::check()?;
        let mut step = direction(r.clone(), &history);
        let mut next = plus(&x, 1.0, &step.x);
        let (mut next_stress, mut next_b) = problem.evaluate(&next);
        let plain = history.is_empty();
        if !plain && (next_stress.is_nan() || next_stress > stress) {
            history.clear();
            step = direction(r.clone(), &history);
            next = plus(&x, 1.0, &step.x);
            (next_stress, next_b) = problem.evaluate(&next);
        }
        swept();
        // A plain step can only fail to lower the stress by rounding.
        if next_stress.is_nan() || next_stress > stress {
            break;
        }
        let next_vx = plus(&vx, 1.0, &step.v);
        let next_r = residual(&next, &next_vx, &next_b);
        let (change, v_change) = (plus(&next_r.x, -1.0, &r.x), plus(&next_r.v, -1.0, &r.v));
        let curvature = dot(&step.x, &v_change);
        if steps == Step::Combined && curvature > 1e-12 * dot(&step.x, &step.v) && dot(&change, &v_change) > 0.0 {
            history.push_back(Pair { step: step.x, v_step: step.v, change, v_change, curvature });
            if history.len() > HISTORY {
                history.pop_front();
            }
        }
        (x, vx, r, stress) = (next, next_vx, next_r, next_stress);
        trace.push(stress);
        if stress < stop.enough.max(1e-28)
            || trace.len() > 10 && trace[trace.len() - 11] - stress <= stop.tolerance * stress
        {
            break;
        }
    }
    Ok(Scaled { points: x, stress: trace })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(n: usize) -> f64 {
        ((n as f64 * 12.9898).sin() * 43758.5453).fract()
    }

    fn distances(x: &Mat<f64>) -> Vec<f64> {
        let n = x.nrows();
        (0..n * n)
            .map(|k| (0..x.ncols()).map(|c| (x[(k / n, c)] - x[(k % n, c)]).powi(2)).sum::<f64>().sqrt())
            .collect()
    }

    /// Distances on a circle: not Euclidean.
    fn circle(n: usize) -> Vec<f64> {
        (0..n * n)
            .map(|k| {
                let gap = (k / n).abs_diff(k % n);
                gap.min(n - gap) as f64 * 0.1
            })
            .collect()
    }

    #[test]
    fn recovers_a_euclidean_configuration() {
        let q = distances(&Mat::from_fn(50, 3, |i, k| noise(3 * i + k)));
        let start = classical(&q, 50, 4).unwrap();
        assert!(distances(&start).iter().zip(&q).all(|(a, b)| (a - b).abs() < 1e-9));
        // Also from a start that is off.
        let disturbed = Mat::from_fn(50, 4, |i, k| start[(i, k)] + 0.05 * noise(1000 + 4 * i + k));
        let scaled = smacof(&q, disturbed, Stop { sweeps: 500, tolerance: 0.0, enough: 0.0 }, || {}).unwrap();
        assert!(*scaled.stress.last().unwrap() < 1e-14, "{:?}", scaled.stress.last());
    }

    #[test]
    fn stress_never_rises_and_is_the_mean_over_pairs() {
        let q = circle(60);
        let scaled =
            smacof(&q, classical(&q, 60, 8).unwrap(), Stop { sweeps: 100, tolerance: 0.0, enough: 0.0 }, || {})
                .unwrap();
        assert!(scaled.stress.len() > 20 && scaled.stress.windows(2).all(|w| w[1] <= w[0]));
        assert!(scaled.stress.last().unwrap() < &(0.5 * scaled.stress[0]));
        let d = distances(&scaled.points);
        let direct: f64 = (0..3600).filter(|k| k / 60 != k % 60).map(|k| (1.0 - d[k] / q[k]).powi(2)).sum();
        assert!((direct / 3540.0 - scaled.stress.last().unwrap()).abs() < 1e-12);
    }

    #[test]
    fn quasi_newton_steps_beat_plain_ones() {
        let q = circle(60);
        let start = classical(&q, 60, 8).unwrap();
        let problem = Problem::new(&q, 60).unwrap();
        let mut x = start.clone();
        for _ in 0..40 {
            x = problem.v_plus_product(&problem.evaluate(&x).1);
        }
        let plain = problem.evaluate(&x).0;
        let scaled = smacof(&q, start, Stop { sweeps: 40, tolerance: 0.0, enough: 0.0 }, || {}).unwrap();
        assert!(*scaled.stress.last().unwrap() <= plain * (1.0 + 1e-9));
    }

    #[test]
    fn a_direction_brings_its_product_with_v() {
        let n = 40;
        let problem = Problem::new(&circle(n), n).unwrap();
        let with_v = |seed: usize| {
            let x = Mat::from_fn(n, 4, |i, k| noise(seed + 4 * i + k));
            WithV { v: problem.v_product(&x), x }
        };
        let pair = |seed: usize| {
            let (step, change) = (with_v(seed), with_v(seed + 500));
            let curvature = dot(&step.x, &change.v).abs() + 1.0;
            Pair { step: step.x, v_step: step.v, change: change.x, v_change: change.v, curvature }
        };
        for count in 0..3 {
            let history: VecDeque<Pair> = (0..count).map(|k| pair(3000 * k)).collect();
            let q = direction(with_v(9000), &history);
            let off = plus(&problem.v_product(&q.x), -1.0, &q.v);
            assert!(dot(&off, &off) < 1e-20 * dot(&q.v, &q.v));
        }
        // V + c 11' has the inverse V^+ + 11' / (c n^2): on centred columns V^+ undoes V.
        let x = with_v(77);
        let mean = |k: usize| x.x.col_as_slice(k).iter().sum::<f64>() / n as f64;
        let back = problem.v_plus_product(&x.v);
        let off = Mat::from_fn(n, 4, |i, k| back[(i, k)] - x.x[(i, k)] + mean(k));
        assert!(off.norm_max() < 1e-10);
    }

    #[test]
    fn two_and_three_points() {
        for n in [2, 3] {
            let q = circle(n);
            let scaled =
                smacof(&q, classical(&q, n, 4).unwrap(), Stop { sweeps: 20, tolerance: 1e-6, enough: 0.0 }, || {})
                    .unwrap();
            assert!(distances(&scaled.points).iter().zip(&q).all(|(a, b)| (a - b).abs() < 1e-9));
        }
    }
}
