//! Curves by repeated averaging: every span halved, with nothing but averages of two points that
//! are neighbours.
//!
//! - Closed uniform B-splines, and open ones away from their ends: Lane and Riesenfeld 1980, every
//!   point doubled and then `degree` rounds of midpoints.
//! - The ends of open ones: Boehm's insertion of the middles of spans, knot by knot from the end,
//!   which are weighted averages of two neighbours.
//! - Bezier pieces: de Casteljau's algorithm at the middle, midpoints of neighbours.
//!
//! In a plane all of these give the control points of the same curve. On a surface they make curves
//! of their own, which stay smooth where the control points are far apart.

use super::layout::{Layout, SplineKind};

/// The average of two neighbours, `(1 - a)` of the first and `a` of the second.
type Average<'a, P> = &'a (dyn Fn(&P, &P, f64) -> P + Sync);

/// The control points of the same curve with every span halved.
pub(super) fn halve<P: Copy + Send + Sync>(layout: &Layout, points: &[P], average: Average<'_, P>) -> Vec<P> {
    match (layout.kind, layout.closed) {
        (SplineKind::BSpline, true) => rounds(&doubled(points), layout.degree, true, average),
        (SplineKind::BSpline, false) => open(layout, points, average),
        (SplineKind::Bezier, _) => pieces(layout, points, average),
    }
}

fn doubled<P: Copy>(points: &[P]) -> Vec<P> {
    points.iter().flat_map(|p| [*p, *p]).collect()
}

/// Rounds of midpoints: point `j` becomes the average of points `j - 1` and `j`. Open, the first
/// point is dropped in each round.
fn rounds<P: Copy + Send + Sync>(points: &[P], count: usize, closed: bool, average: Average<'_, P>) -> Vec<P> {
    use rayon::prelude::*;
    let mut now = points.to_vec();
    for _ in 0..count {
        let n = now.len();
        let first = usize::from(!closed);
        now = (first..n).into_par_iter().map(|j| average(&now[(j + n - 1) % n], &now[j], 0.5)).collect();
    }
    now
}

fn open<P: Copy + Send + Sync>(layout: &Layout, points: &[P], average: Average<'_, P>) -> Vec<P> {
    let (p, n, after) = (layout.degree, points.len(), layout.halved().count);
    // New point j is j + degree of the points that the rounds make of the doubled ones, where all
    // old ones it depends on are uniform: those from degree to n - 1 - degree.
    let depends = |j: usize| ((j.saturating_sub(1)).div_ceil(2), (j + p) / 2);
    let uniform = |j: usize| j >= 1 && depends(j).0 >= p && depends(j).1 + p < n;
    let middle: Vec<usize> = (0..after).filter(|&j| uniform(j)).collect();
    let left = inserted(layout, points, average);
    let mut reversed: Vec<P> = points.to_vec();
    reversed.reverse();
    let right = inserted(layout, &reversed, &|a, b, w| average(b, a, 1.0 - w));
    let mut out: Vec<P> = (0..after)
        .map(|j| if 2 * j < after { left[j.min(left.len() - 1)] } else { right[(after - 1 - j).min(right.len() - 1)] })
        .collect();
    if let (Some(&low), Some(&high)) = (middle.first(), middle.last()) {
        let from = depends(low).0;
        let some = rounds(&doubled(&points[from..=depends(high).1]), p, false, average);
        // The rounds drop `degree` points, so that number k of what is left was number k + degree
        // of the doubled ones.
        for (j, slot) in out.iter_mut().enumerate().take(high + 1).skip(low) {
            *slot = some[j - 2 * from];
        }
    }
    out
}

/// The control points after the middles of the first `degree + 1` spans were inserted, from the
/// beginning on.
fn inserted<P: Copy>(layout: &Layout, points: &[P], average: Average<'_, P>) -> Vec<P> {
    let (p, spans) = (layout.degree, layout.spans());
    let mut knots: Vec<f64> = (0..=points.len() + p).map(|i| (i as f64 - p as f64).clamp(0.0, spans as f64)).collect();
    let mut now = points.to_vec();
    for s in 0..spans.min(p + 1) {
        let u = s as f64 + 0.5;
        // Two knots for each span before, and `degree` ahead of them.
        let k = p + 2 * s;
        let mut next = Vec::with_capacity(now.len() + 1);
        next.extend_from_slice(&now[..=k - p]);
        for i in k - p + 1..=k {
            next.push(average(&now[i - 1], &now[i], (u - knots[i]) / (knots[i + p] - knots[i])));
        }
        next.extend_from_slice(&now[k..]);
        knots.insert(k + 1, u);
        now = next;
    }
    now
}

fn pieces<P: Copy + Send + Sync>(layout: &Layout, points: &[P], average: Average<'_, P>) -> Vec<P> {
    let p = layout.degree;
    let mut out = vec![points[layout.control(0, 0)]];
    for s in 0..layout.spans() {
        let mut now: Vec<P> = (0..=p).map(|i| points[layout.control(s, i)]).collect();
        let (mut first, mut second) = (Vec::new(), vec![now[p]]);
        for _ in 0..p {
            now = now.windows(2).map(|w| average(&w[0], &w[1], 0.5)).collect();
            first.push(now[0]);
            second.push(now[now.len() - 1]);
        }
        second.pop();
        out.extend(first);
        out.extend(second.into_iter().rev());
    }
    if layout.closed {
        out.pop();
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::layout::de_boor;
    use super::*;

    fn at(layout: &Layout, controls: &[[f64; 2]], t: f64) -> [f64; 2] {
        let (s, u) = layout.locate(t);
        let knots: Vec<f64> = (0..2 * layout.degree).map(|j| layout.knot(s, j)).collect();
        let points: Vec<[f64; 2]> = (0..=layout.degree).map(|i| controls[layout.control(s, i)]).collect();
        de_boor(&knots, &points, u)
    }

    /// In a plane a halved curve is the same curve, with weights of 0..=1 all the way: for all
    /// kinds, degrees and small numbers of points.
    #[test]
    fn halved_curves_are_the_same_in_the_plane() {
        let average = |a: &[f64; 2], b: &[f64; 2], w: f64| {
            assert!((-1e-12..=1.0 + 1e-12).contains(&w), "{w}");
            [a[0] + w * (b[0] - a[0]), a[1] + w * (b[1] - a[1])]
        };
        for kind in [SplineKind::BSpline, SplineKind::Bezier] {
            for (degree, count, closed) in
                (1..=5).flat_map(|d| (2..20).flat_map(move |n| [(d, n, false), (d, n, true)]))
            {
                let Some(mut layout) = Layout::new(kind, degree, count, closed) else { continue };
                let first = layout;
                let controls: Vec<[f64; 2]> =
                    (0..count).map(|i| [(i as f64 * 1.7).sin(), (i as f64 * 2.9).cos()]).collect();
                let mut now = controls.clone();
                for _ in 0..3 {
                    now = halve(&layout, &now, &average);
                    layout = layout.halved();
                    assert_eq!(now.len(), layout.count);
                }
                for k in 0..=50 {
                    let t = f64::from(k) / 50.0;
                    let (a, b) = (at(&first, &controls, t), at(&layout, &now, t));
                    assert!((0..2).all(|e| (a[e] - b[e]).abs() < 1e-12), "{first:?} at {t}: {a:?} {b:?}");
                }
            }
        }
    }

    /// A curve read backwards is the same curve, so the ends are treated alike.
    #[test]
    fn halving_commutes_with_reversal() {
        // An average that is not associative, as on a surface.
        let average = |a: &f64, b: &f64, w: f64| {
            let x = a + w * (b - a);
            x + 0.01 * (3.0 * x).sin() * w * (1.0 - w) * (b - a).powi(2)
        };
        for (degree, count) in [(1, 5), (2, 6), (3, 4), (3, 9), (4, 7), (5, 14)] {
            let layout = Layout::new(SplineKind::BSpline, degree, count, false).unwrap();
            let points: Vec<f64> = (0..count).map(|i| (i as f64 * 1.3).sin()).collect();
            let forward = halve(&layout, &points, &average);
            let mut backward = halve(&layout, &points.iter().rev().copied().collect::<Vec<_>>(), &average);
            backward.reverse();
            // The middle of an odd number of points that are all near an end belongs to one of
            // them.
            let n = forward.len();
            for j in (0..n).filter(|&j| 2 * j + 1 != n) {
                assert!((forward[j] - backward[j]).abs() < 1e-12, "{degree} {count} at {j}");
            }
        }
    }
}
