//! Where each vertex of the target may go: several predictions, the best of them chosen by what
//! they say of anchors left out.

use glam::DVec3;
use nalgebra::DMatrix;
use rayon::prelude::*;

use super::radial::Radial;
use super::rigid::{Turn, rigid, rigid_in_space};
use crate::surface::correspondence::drift::{Anchors, Place, global_fit, predict};
use crate::surface::vector::{Vector, add_scaled, distance_squared, dot, sub};

/// What is known of the anchors, all lengths at unit area.
#[derive(Clone, Debug)]
pub(super) struct Known<const D: usize> {
    /// On the target: point and tangent plane in the embedding.
    pub(super) places: Vec<Place<D>>,
    /// The points alone.
    pub(super) a: Vec<Vector<f64, D>>,
    /// On the source, in the embedding.
    pub(super) b: Vec<Vector<f64, D>>,
    /// On the target, in space.
    pub(super) s: Vec<DVec3>,
    /// On the source, in space.
    pub(super) t: Vec<DVec3>,
}

/// A point of the target in both spaces.
pub(super) type Point<const D: usize> = (Place<D>, DVec3);

/// A map from points of the target to R^M, and where that has a scale, affine in it.
type Prediction<'a, const D: usize, const M: usize> = Box<dyn Fn(&Point<D>, f64) -> [f64; M] + Sync + 'a>;

/// A prediction of points of R^M, with what it misses each anchor by when that is left out.
pub(super) struct Predictor<'a, const D: usize, const M: usize> {
    /// For the report: predictions and their weights in the mixture.
    pub(super) parts: Vec<(&'static str, f64)>,
    predict: Prediction<'a, D, M>,
    /// How much lengths grow; predictions with a scale differ in nothing else. `None` for those
    /// without.
    scale: Option<f64>,
    /// Predicted minus given, anchor by anchor.
    pub(super) left_out: Vec<[f64; M]>,
    /// The same among the anchors that judge ([`Known::judges`]); empty where those are all.
    judged: Vec<[f64; M]>,
    /// Whether it mirrors, where that is a matter of choice.
    mirrors: Option<bool>,
}

impl<'a, const D: usize, const M: usize> Predictor<'a, D, M> {
    pub(super) fn at(&self, point: &Point<D>) -> [f64; M] {
        (self.predict)(point, self.scale.unwrap_or(1.0))
    }

    fn new(name: &'static str, left_out: Vec<[f64; M]>, predict: Prediction<'a, D, M>) -> Self {
        Self { parts: vec![(name, 1.0)], predict, scale: None, left_out, judged: Vec::new(), mirrors: None }
    }

    /// What it is judged by.
    fn misses(&self) -> &[[f64; M]] {
        if self.judged.is_empty() { &self.left_out } else { &self.judged }
    }

    /// Root mean square of the errors of left out anchors, the worst tenth passed over. Infinite
    /// where one is no number:
    /// not even the worst tenth may be, because a mixture leaves out other anchors than this.
    pub(super) fn error(&self) -> f64 {
        let mut squares: Vec<f64> = self.misses().iter().map(|e| e.iter().map(|x| x * x).sum()).collect();
        if squares.iter().any(|s| !s.is_finite()) {
            return f64::INFINITY;
        }
        squares.sort_by(f64::total_cmp);
        let kept = squares.len() - squares.len() / 10;
        (squares[..kept].iter().sum::<f64>() / kept as f64).sqrt()
    }
}

/// The mixture of all with the smallest error of left out anchors: nonnegative weights that sum to
/// one (stacking; Breiman, 1996). Predictions err in different directions, so that a mixture is
/// better than the best of them. `None` if there are none.
fn mixed<const D: usize, const M: usize>(all: Vec<Predictor<'_, D, M>>) -> Option<Predictor<'_, D, M>> {
    let usable: Vec<Predictor<'_, D, M>> = if all.iter().any(|p| p.error().is_finite()) {
        all.into_iter().filter(|p| p.error().is_finite()).collect()
    } else {
        return all.into_iter().next();
    };
    // The anchors that the best one predicts worst say more about themselves than about
    // predictions.
    let best = usable.iter().min_by(|x, y| x.error().total_cmp(&y.error()))?;
    let size = |e: &[f64; M]| e.iter().map(|x| x * x).sum::<f64>();
    let mut order: Vec<usize> = (0..best.misses().len()).collect();
    order.sort_by(|&i, &j| size(&best.misses()[i]).total_cmp(&size(&best.misses()[j])));
    order.truncate(order.len() - order.len() / 10);
    let product = |p: &Predictor<'_, D, M>, q: &Predictor<'_, D, M>| -> f64 {
        order.iter().map(|&i| (0..M).map(|m| p.misses()[i][m] * q.misses()[i][m]).sum::<f64>()).sum()
    };
    let gram: Vec<Vec<f64>> = usable.iter().map(|p| usable.iter().map(|q| product(p, q)).collect()).collect();
    let weights = mixture(&gram);
    let names = usable.iter().zip(&weights).filter(|(_, w)| **w > 0.0).map(|(p, &w)| (p.parts[0].0, w)).collect();
    let left_out = weighted(&weights, usable.iter().map(|p| &p.left_out));
    let judged = weighted(&weights, usable.iter().map(|p| &p.judged));
    let mut parts: Vec<_> = usable.into_iter().zip(weights).filter(|(_, w)| *w > 0.0).collect();
    join_scales(&mut parts);
    let predict = move |p: &Point<D>, _: f64| {
        let mut sum = [0.0; M];
        for (part, w) in &parts {
            let one = part.at(p);
            (0..M).for_each(|m| sum[m] += w * one[m]);
        }
        sum
    };
    Some(Predictor { parts: names, predict: Box::new(predict), scale: None, left_out, judged, mirrors: None })
}

/// The weighted sum of lists of errors.
fn weighted<'e, const M: usize>(weights: &[f64], errors: impl Iterator<Item = &'e Vec<[f64; M]>>) -> Vec<[f64; M]> {
    let mut sum = Vec::new();
    for (w, list) in weights.iter().zip(errors) {
        sum.resize(list.len(), [0.0; M]);
        sum.iter_mut().zip(list).for_each(|(s, e)| (0..M).for_each(|m| s[m] += w * e[m]));
    }
    sum
}

/// Makes one of the predictions that differ in their scale: being affine in it, their mixture is
/// the same prediction with the mean scale, at half the cost.
fn join_scales<const D: usize, const M: usize>(parts: &mut Vec<(Predictor<'_, D, M>, f64)>) {
    let scaled = || parts.iter().filter_map(|(p, w)| p.scale.map(|s| (s, *w)));
    let weight: f64 = scaled().map(|(_, w)| w).sum();
    let mean = scaled().map(|(s, w)| s * w).sum::<f64>() / weight;
    let mut first = true;
    parts.retain_mut(|(p, w)| {
        if p.scale.is_none() {
            return true;
        }
        (p.scale, *w) = (Some(mean), weight);
        std::mem::take(&mut first)
    });
}

/// The weights `w >= 0`, `sum w = 1`, that minimise `w' G w` for a positive semidefinite G: weight
/// is shifted between two at a time. Those below a fiftieth are dropped.
fn mixture(gram: &[Vec<f64>]) -> Vec<f64> {
    let n = gram.len();
    let mut w = vec![1.0 / n as f64; n];
    let mut alive: Vec<usize> = (0..n).collect();
    for _ in 0..2 {
        for _ in 0..100 {
            for x in 0..alive.len() {
                for y in 0..x {
                    let (i, j) = (alive[x], alive[y]);
                    // d/dt of w' G w when t goes from j to i.
                    let slope: f64 = (0..n).map(|k| w[k] * (gram[i][k] - gram[j][k])).sum();
                    let curvature = gram[i][i] - 2.0 * gram[i][j] + gram[j][j];
                    let t = if curvature > 0.0 { -slope / curvature } else { 0.0 };
                    let t = t.clamp(-w[i], w[j]);
                    w[i] += t;
                    w[j] -= t;
                }
            }
        }
        alive.retain(|&i| w[i] >= 0.02);
        let kept: f64 = alive.iter().map(|&i| w[i]).sum();
        w = (0..n).map(|i| if alive.contains(&i) { w[i] / kept } else { 0.0 }).collect();
    }
    w
}

/// Gives each prediction what the same one misses the anchors that judge by. What these are too few
/// for is dropped.
fn judged<'a, const D: usize, const M: usize>(
    all: Vec<Predictor<'a, D, M>>,
    judges: Option<Vec<Predictor<'_, D, M>>>,
) -> Vec<Predictor<'a, D, M>> {
    let Some(mut judges) = judges else { return all };
    let of = |mut p: Predictor<'a, D, M>| {
        let same = judges.iter_mut().find(|j| j.parts == p.parts)?;
        p.judged = std::mem::take(&mut same.left_out);
        Some(p)
    };
    all.into_iter().filter_map(of).collect()
}

fn rows<const M: usize>(x: &DMatrix<f64>) -> Vec<[f64; M]> {
    (0..x.nrows()).map(|i| std::array::from_fn(|m| -x[(i, m)])).collect()
}

fn array(p: DVec3) -> [f64; 3] {
    p.to_array()
}

impl<const D: usize> Known<D> {
    fn count(&self) -> usize {
        self.a.len()
    }

    fn kernel(&self, phi: impl Fn(f64) -> f64) -> DMatrix<f64> {
        DMatrix::from_fn(self.count(), self.count(), |i, j| phi(distance_squared(&self.a[i], &self.a[j]).sqrt()))
    }

    fn phi(&self, y: &Vector<f64, D>, phi: impl Fn(f64) -> f64) -> Vec<f64> {
        self.a.iter().map(|a| phi(distance_squared(a, y).sqrt())).collect()
    }

    /// How much wider the anchors stand on the source than on the target. At unit area this is 1,
    /// unless one surface is part of the other or has a part the other lacks.
    fn scale<const M: usize>(&self, from: &[Vector<f64, M>], to: &[Vector<f64, M>]) -> f64 {
        let spread = |x: &[Vector<f64, M>]| {
            let mean = x.iter().fold([0.0; M], |sum, p| add_scaled(&sum, 1.0 / x.len() as f64, p));
            x.iter().map(|p| distance_squared(p, &mean)).sum::<f64>()
        };
        let ratio = (spread(to) / spread(from)).sqrt();
        if ratio.is_finite() && ratio > 0.0 { ratio } else { 1.0 }
    }

    /// Predictions in the embedding, mixed as suits the anchors that judge.
    pub(super) fn embedded(&self, judges: Option<&Self>) -> Option<Predictor<'_, D, D>> {
        mixed(judged(self.in_embedding(), judges.map(Self::in_embedding)))
    }

    /// Predictions in space, mixed likewise.
    pub(super) fn spatial(&self, judges: Option<&Self>) -> Option<Predictor<'_, D, 3>> {
        let mut all = judged(self.in_space(), judges.map(Self::in_space));
        // A shape is mirrored or not: a mixture of both would be flat.
        let least = |mirror: bool| {
            let these = all.iter().filter(|p| p.mirrors == Some(mirror));
            these.map(Predictor::error).fold(f64::INFINITY, f64::min)
        };
        let mirrored = least(true) < least(false);
        all.retain(|p| p.mirrors.is_none_or(|m| m == mirrored));
        mixed(all)
    }

    fn in_embedding(&self) -> Vec<Predictor<'_, D, D>> {
        let n = self.count();
        let known = Anchors { a: &self.a, b: &self.b };
        let global = global_fit(known);
        let turned = move |y: &Vector<f64, D>| -> Vector<f64, D> { std::array::from_fn(|k| dot(&global[k], y)) };
        let sides = (self.a.as_slice(), self.b.as_slice());
        let mut all: Vec<Predictor<'_, D, D>> =
            [("rigid moving least squares", 1.0), ("similar moving least squares", self.scale(&self.a, &self.b))]
                .into_iter()
                .map(|(name, scale)| {
                    let miss = |i| sub(&rigid(&self.a[i], sides, &global, scale, Some(i)), &self.b[i]);
                    let left_out = (0..n).into_par_iter().map(miss).collect();
                    let predict = move |p: &Point<D>, scale| rigid(&p.0.0, sides, &global, scale, None);
                    Predictor { scale: Some(scale), ..Predictor::new(name, left_out, Box::new(predict)) }
                })
                .collect();
        if n > 3 {
            let miss = |i: usize| {
                let without = |x: &[Vector<f64, D>]| [&x[..i], &x[i + 1..]].concat();
                let (a, b) = (without(&self.a), without(&self.b));
                let others = Anchors { a: &a, b: &b };
                sub(&predict(&self.places[i], others, Some(&(global_fit(others), 1.0))), &self.b[i])
            };
            let left_out = (0..n).into_par_iter().map(miss).collect();
            let at = move |p: &Point<D>, _| predict(&p.0, known, Some(&(global, 1.0)));
            all.push(Predictor::new("residual transport", left_out, Box::new(at)));
        }
        let ones = DMatrix::from_element(n, 1, 1.0);
        let rest = DMatrix::from_fn(n, D, |i, k| self.b[i][k] - turned(&self.a[i])[k]);
        if let Some(fit) = Radial::fit(&self.kernel(|r| r), &ones, &rest) {
            let left_out = rows(&fit.left_out);
            let at = move |p: &Point<D>, _| {
                let (y, r) = (turned(&p.0.0), fit.at::<D>(&self.phi(&p.0.0, |r| r), &[1.0]));
                std::array::from_fn(|k| y[k] + r[k])
            };
            all.push(Predictor::new("linear radial functions", left_out, Box::new(at)));
        }
        if n >= 2 * (D + 1) {
            let affine = DMatrix::from_fn(n, D + 1, |i, k| if k == 0 { 1.0 } else { self.a[i][k - 1] });
            let values = DMatrix::from_fn(n, D, |i, k| self.b[i][k]);
            if let Some(fit) = Radial::fit(&self.kernel(|r| -r * r * r), &affine, &values) {
                let left_out = rows(&fit.left_out);
                let at = move |p: &Point<D>, _| {
                    let mut row = vec![1.0];
                    row.extend(p.0.0);
                    fit.at(&self.phi(&p.0.0, |r| -r * r * r), &row)
                };
                all.push(Predictor::new("cubic radial functions", left_out, Box::new(at)));
            }
        }
        all
    }

    /// With mirrored motions beside proper ones: [`Known::spatial`] chooses.
    fn in_space(&self) -> Vec<Predictor<'_, D, 3>> {
        let n = self.count();
        let sides = (self.s.as_slice(), self.t.as_slice());
        let scale = {
            let rows = |p: &[DVec3]| p.iter().map(|p| [p.x, p.y, p.z, 0.0]).collect::<Vec<[f64; 4]>>();
            self.scale(&rows(&self.s), &rows(&self.t))
        };
        let names = [
            ("rigid motions along the surface", 1.0, false),
            ("similarities along the surface", scale, false),
            ("reflections along the surface", 1.0, true),
            ("reflected similarities along the surface", scale, true),
        ];
        let along_surface = |(name, scale, mirror)| {
            let turn = Turn { mirror, scale };
            let miss = |i: usize| {
                let at = (&self.a[i], self.s[i]);
                array(rigid_in_space(at, &self.a, sides, turn, Some(i)) - self.t[i])
            };
            let left_out = (0..n).into_par_iter().map(miss).collect();
            let at = move |p: &Point<D>, scale| {
                array(rigid_in_space((&p.0.0, p.1), &self.a, sides, Turn { mirror, scale }, None))
            };
            let one = Predictor::new(name, left_out, Box::new(at));
            Predictor { scale: Some(scale), mirrors: Some(mirror), ..one }
        };
        let mut all: Vec<Predictor<'_, D, 3>> = names.into_iter().map(along_surface).collect();
        if n >= 5 {
            let affine = DMatrix::from_fn(n, 4, |i, k| if k == 0 { 1.0 } else { self.s[i][k - 1] });
            let values = DMatrix::from_fn(n, 3, |i, k| self.t[i][k]);
            let row = |x: DVec3| [1.0, x.x, x.y, x.z];
            let apart = DMatrix::from_fn(n, n, |i, j| self.s[i].distance(self.s[j]));
            if let Some(fit) = Radial::fit(&apart, &affine, &values) {
                let left_out = rows(&fit.left_out);
                let at = move |p: &Point<D>, _| {
                    let phi: Vec<f64> = self.s.iter().map(|s| s.distance(p.1)).collect();
                    fit.at(&phi, &row(p.1))
                };
                all.push(Predictor::new("radial functions in space", left_out, Box::new(at)));
            }
            if let Some(fit) = Radial::fit(&self.kernel(|r| r), &affine, &values) {
                let left_out = rows(&fit.left_out);
                let at = move |p: &Point<D>, _| fit.at(&self.phi(&p.0.0, |r| r), &row(p.1));
                all.push(Predictor::new("radial functions along the surface", left_out, Box::new(at)));
            }
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn predictions_that_differ_in_scale_are_joined() {
        let scaled = |scale: Option<f64>| Predictor::<4, 2> {
            parts: vec![("test", 1.0)],
            predict: Box::new(move |p: &Point<4>, s| if scale.is_some() { [1.0 + s * p.1.x, s] } else { [p.1.y, 7.0] }),
            scale,
            left_out: Vec::new(),
            judged: Vec::new(),
            mirrors: None,
        };
        let mixture = || vec![(scaled(Some(1.0)), 0.2), (scaled(None), 0.5), (scaled(Some(3.0)), 0.3)];
        let at = |parts: &[(Predictor<'_, 4, 2>, f64)]| {
            let point = (([0.0; 4], [[0.0; 4]; 2]), DVec3::new(0.7, -0.4, 0.0));
            parts.iter().fold([0.0; 2], |sum, (p, w)| {
                let y = p.at(&point);
                [sum[0] + w * y[0], sum[1] + w * y[1]]
            })
        };
        let mut joined = mixture();
        join_scales(&mut joined);
        assert_eq!(joined.len(), 2);
        let (a, b) = (at(&mixture()), at(&joined));
        assert!((0..2).all(|k| (a[k] - b[k]).abs() < 1e-12), "{a:?} {b:?}");
        joined[0].1 *= 1.01;
        assert!(at(&joined) != b);
    }

    #[test]
    fn a_prediction_that_is_no_number_somewhere_is_not_mixed() {
        // Of twenty anchors the worst two are passed over, each prediction's own.
        let misses = |f: &dyn Fn(usize) -> f64| (0..20).map(|i| [f(i), 0.1]).collect::<Vec<_>>();
        let named = |name, left_out| Predictor::<4, 2>::new(name, left_out, Box::new(|_, _| [0.0; 2]));
        let good = || named("good", misses(&|i| 0.1 + 0.01 * i as f64));
        let other = || named("other", misses(&|i| -0.2 - 0.01 * (i % 7) as f64));
        for wrong in [f64::NAN, f64::INFINITY, 1e200] {
            let bad = named("bad", misses(&|i| if i == 3 { wrong } else { 0.0 }));
            assert_eq!(bad.error(), f64::INFINITY);
            let mixture = mixed(vec![good(), bad, other()]).unwrap();
            assert!(mixture.parts.iter().all(|(name, w)| *name != "bad" && w.is_finite()), "{:?}", mixture.parts);
            assert_eq!(mixture.parts, mixed(vec![good(), other()]).unwrap().parts);
        }
    }

    #[test]
    fn the_mixture_is_the_least_in_the_simplex() {
        // Two equal errors in opposite directions cancel; a third, larger one is not needed.
        let w = mixture(&[vec![1.0, -1.0, 0.5], vec![-1.0, 1.0, -0.5], vec![0.5, -0.5, 9.0]]);
        assert!((w[0] - 0.5).abs() < 1e-9 && (w[1] - 0.5).abs() < 1e-9 && w[2] == 0.0, "{w:?}");
        // Independent errors are weighted by the inverse of their squares; one that only repeats a
        // better one is dropped.
        let w = mixture(&[vec![1.0, 0.0], vec![0.0, 4.0]]);
        assert!((w[0] - 0.8).abs() < 1e-9 && (w[1] - 0.2).abs() < 1e-9, "{w:?}");
        assert_eq!(mixture(&[vec![1.0, 2.0], vec![2.0, 4.0]]), [1.0, 0.0]);
        // Exact predictions, and a single one.
        assert!((mixture(&[vec![0.0, 0.0], vec![0.0, 0.0]]).iter().sum::<f64>() - 1.0).abs() < 1e-12);
        assert_eq!(mixture(&[vec![3.0]]), [1.0]);
    }
}
