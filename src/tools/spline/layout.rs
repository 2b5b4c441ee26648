//! Which control points a span of a spline has, and de Boor's algorithm on them.
//!
//! A curve of `S` spans has the parameter `u` in `0..=S`; span `s` is `s..=s + 1`. Knots are whole
//! numbers, so that all of them are known without a table.

use crate::words::words;

/// Largest degree of a curve.
pub const MOST_DEGREE: usize = 15;

/// How control points make a curve.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SplineKind {
    /// A uniform B-spline. Open, its end knots are repeated, so that it begins and ends at a
    /// control point.
    #[default]
    BSpline,
    /// Bezier pieces, each beginning at the last control point of the one before.
    Bezier,
}

words! { SplineKind, "kind", "a kind of spline":
    BSpline => "bspline",
    Bezier => "bezier",
}

/// The knots and control points of a curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    pub(super) kind: SplineKind,
    pub(super) degree: usize,
    /// Number of control points.
    pub(super) count: usize,
    pub(super) closed: bool,
    /// Knot at which a closed B-spline begins, its basis functions being supported on `i..=i +
    /// degree + 1`: modulo `count`.
    pub(super) offset: usize,
}

impl Layout {
    /// The layout of `count` control points; `None` if there are too few, or not as many as Bezier
    /// pieces need.
    pub(super) fn new(kind: SplineKind, degree: usize, count: usize, closed: bool) -> Option<Self> {
        let fits = match (kind, closed) {
            (SplineKind::BSpline, false) => count > degree,
            (SplineKind::BSpline, true) => count >= 3,
            (SplineKind::Bezier, false) => count > degree && (count - 1).is_multiple_of(degree),
            (SplineKind::Bezier, true) => count >= 2 * degree && count.is_multiple_of(degree),
        };
        // A closed curve of odd degree begins where the first control point counts most.
        fits.then_some(Self { kind, degree, count, closed, offset: degree.div_ceil(2) })
    }

    pub(super) fn spans(&self) -> usize {
        match (self.kind, self.closed) {
            (SplineKind::BSpline, false) => self.count - self.degree,
            (SplineKind::BSpline, true) => self.count,
            (SplineKind::Bezier, _) => (self.count - usize::from(!self.closed)) / self.degree,
        }
    }

    /// Control point `i` (of `0..=degree`) of a span.
    pub(super) fn control(&self, span: usize, i: usize) -> usize {
        match (self.kind, self.closed) {
            (SplineKind::BSpline, false) => span + i,
            (SplineKind::BSpline, true) => {
                (self.offset + span + i + self.count * self.degree - self.degree) % self.count
            }
            (SplineKind::Bezier, _) => (span * self.degree + i) % self.count,
        }
    }

    /// Knot `j` of the `2 degree` around a span, of which it lies between the middle two.
    pub(super) fn knot(&self, span: usize, j: usize) -> f64 {
        let k = span as i64 + 1 + j as i64 - self.degree as i64;
        match (self.kind, self.closed) {
            (SplineKind::BSpline, true) => k as f64,
            (SplineKind::BSpline, false) => k.clamp(0, self.spans() as i64) as f64,
            (SplineKind::Bezier, _) => (span + usize::from(j >= self.degree)) as f64,
        }
    }

    /// The span and parameter of `t` in 0..=1; the later span at a knot.
    pub(super) fn locate(&self, t: f64) -> (usize, f64) {
        let spans = self.spans();
        let u = t.clamp(0.0, 1.0) * spans as f64;
        ((u as usize).min(spans - 1), u)
    }

    /// The layout after every span was halved.
    pub(super) fn halved(&self) -> Self {
        let count = match (self.kind, self.closed) {
            (SplineKind::BSpline, false) => 2 * self.spans() + self.degree,
            (SplineKind::Bezier, false) => 2 * self.spans() * self.degree + 1,
            (_, true) => 2 * self.count,
        };
        Self { count, offset: 2 * self.offset % count, ..*self }
    }
}

/// De Boor's algorithm: the point at `u` of a span with these `2 degree` knots and `degree + 1`
/// control points.
pub(super) fn de_boor<const N: usize>(knots: &[f64], controls: &[[f64; N]], u: f64) -> [f64; N] {
    let p = controls.len() - 1;
    let mut d = [[0.0; N]; MOST_DEGREE + 1];
    d[..=p].copy_from_slice(controls);
    for r in 1..=p {
        for i in (r..=p).rev() {
            let (low, high) = (knots[i - 1], knots[p + i - r]);
            let a = (u - low) / (high - low);
            for e in 0..N {
                d[i][e] = (1.0 - a) * d[i - 1][e] + a * d[i][e];
            }
        }
    }
    d[p]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(layout: &Layout, controls: &[[f64; 2]], t: f64) -> [f64; 2] {
        let (s, u) = layout.locate(t);
        let knots: Vec<f64> = (0..2 * layout.degree).map(|j| layout.knot(s, j)).collect();
        let points: Vec<[f64; 2]> = (0..=layout.degree).map(|i| controls[layout.control(s, i)]).collect();
        de_boor(&knots, &points, u)
    }

    fn layouts() -> Vec<Layout> {
        let mut all = Vec::new();
        for degree in 1..=5 {
            for count in 2..14 {
                for closed in [false, true] {
                    all.extend(Layout::new(SplineKind::BSpline, degree, count, closed));
                    all.extend(Layout::new(SplineKind::Bezier, degree, count, closed));
                }
            }
        }
        all
    }

    #[test]
    fn curves_are_continuous_and_meet_their_ends() {
        for l in layouts() {
            let controls: Vec<[f64; 2]> =
                (0..l.count).map(|i| [(i as f64 * 1.7).sin(), (i as f64 * 2.9).cos()]).collect();
            let spans = l.spans();
            let (first, last) = (at(&l, &controls, 0.0), at(&l, &controls, 1.0));
            let expected = if l.closed { first } else { controls[l.count - 1] };
            assert!((0..2).all(|e| (last[e] - expected[e]).abs() < 1e-12), "{l:?}");
            if !l.closed {
                assert!((0..2).all(|e| (first[e] - controls[0][e]).abs() < 1e-12), "{l:?}");
            }
            for s in 1..spans {
                let t = s as f64 / spans as f64;
                let (a, b) = (at(&l, &controls, t - 1e-9), at(&l, &controls, t + 1e-9));
                assert!((0..2).all(|e| (a[e] - b[e]).abs() < 1e-6), "{l:?} at {t}");
            }
            // Constant controls give a constant curve: a partition of unity.
            let ones = vec![[1.0, -3.0]; l.count];
            assert!((0..=20).all(|k| {
                at(&l, &ones, f64::from(k) / 20.0).iter().zip([1.0, -3.0]).all(|(a, b)| (a - b).abs() < 1e-12)
            }));
        }
    }

    #[test]
    fn known_values() {
        // The uniform cubic at a knot: 1/6, 4/6, 1/6, about the first control point where it is
        // closed.
        let l = Layout::new(SplineKind::BSpline, 3, 5, true).unwrap();
        let mut controls = vec![[0.0; 2]; 5];
        controls[0] = [1.0, 0.0];
        controls[1] = [0.0, 1.0];
        let p = at(&l, &controls, 0.0);
        assert!((p[0] - 4.0 / 6.0).abs() < 1e-14 && (p[1] - 1.0 / 6.0).abs() < 1e-14, "{p:?}");
        // Four clamped cubic control points are a Bezier curve.
        let controls = [[0.0, 0.0], [1.0, 2.0], [3.0, 2.0], [4.0, 0.0]];
        for kind in [SplineKind::BSpline, SplineKind::Bezier] {
            let l = Layout::new(kind, 3, 4, false).unwrap();
            let p = at(&l, &controls, 0.5);
            assert!((p[0] - 2.0).abs() < 1e-14 && (p[1] - 1.5).abs() < 1e-14, "{p:?}");
        }
        assert!(Layout::new(SplineKind::BSpline, 3, 3, false).is_none());
        assert!(Layout::new(SplineKind::BSpline, 3, 2, true).is_none());
        assert!(Layout::new(SplineKind::Bezier, 3, 6, false).is_none());
    }
}
