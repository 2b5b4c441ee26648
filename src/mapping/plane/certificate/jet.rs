//! Taylor coefficients of functions of two variables, with intervals for numbers.

use std::ops::{Add, Sub};

use super::interval::Interval;

/// The Taylor coefficients `f_(i,j) = 1/(i! j!) d^(i+j) f / dx^i dy^j` of a function, up to a total
/// degree: `N` = 6 for degree 2, 10 for degree 3.
///
/// Coefficients are ordered 1; x, y; xx, xy, yy; xxx, xxy, xyy, yyy ([`index`]). A jet *encloses* a
/// function over a set of points if at each of the points the function's coefficients lie in the
/// jet's intervals. Leibniz' rule makes the coefficients of a product the truncated product of the
/// factors' coefficients; quotient and root solve that product for a factor, lowest degree first.
/// Interval arithmetic carries enclosure through these formulas.
#[derive(Clone, Copy, Debug)]
pub(super) struct Jet<const N: usize>(pub(super) [Interval; N]);

/// Number of the coefficient of `x^(degree-j) y^j`.
#[inline(always)]
pub(super) const fn index(degree: usize, j: usize) -> usize {
    degree * (degree + 1) / 2 + j
}

impl<const N: usize> Jet<N> {
    pub(super) const ZERO: Self = Self([Interval::ZERO; N]);

    /// Highest degree kept.
    pub(super) const DEGREE: usize = match N {
        6 => 2,
        10 => 3,
        _ => panic!("jets have 6 or 10 coefficients"),
    };

    pub(super) fn constant(value: Interval) -> Self {
        let mut c = [Interval::ZERO; N];
        c[0] = value;
        Self(c)
    }

    /// Sum of the products `self_a other_b` over `pairs` (a, b).
    #[inline(always)]
    fn convolve(&self, other: &Self, pairs: &[(usize, usize)]) -> Interval {
        pairs.iter().fold(Interval::ZERO, |sum, &(a, b)| sum + self.0[a] * other.0[b])
    }

    pub(super) fn times(&self, other: &Self) -> Self {
        let mut product = Self::ZERO;
        for k in 0..N {
            product.0[k] = self.convolve(other, FACTORS[k]);
        }
        product
    }

    /// `self / other`, unknown where the divisor may vanish: from `self = other * quotient`.
    pub(super) fn over(&self, other: &Self) -> Self {
        let inverse = other.0[0].recip();
        let mut quotient = Self::constant(self.0[0] * inverse);
        for k in 1..N {
            // Without the first pair, the one of the divisor's value and the coefficient sought.
            quotient.0[k] = (self.0[k] - other.convolve(&quotient, &FACTORS[k][1..])) * inverse;
        }
        quotient
    }

    /// The positive root, unknown where the argument may vanish: from `self = root * root`.
    pub(super) fn sqrt(&self) -> Self {
        let mut root = Self::constant(self.0[0].sqrt());
        let half_inverse = root.0[0].scaled(2.0).recip();
        for k in 1..N {
            // Without the first and the last pair, which are twice the product of the value and the
            // coefficient sought.
            let pairs = &FACTORS[k][1..FACTORS[k].len() - 1];
            root.0[k] = (self.0[k] - root.convolve(&root, pairs)) * half_inverse;
        }
        root
    }

    pub(super) fn scale(&self, factor: Interval) -> Self {
        Self(self.0.map(|c| c * factor))
    }

    /// Adds `factor * other`.
    #[inline(always)]
    pub(super) fn accumulate(&mut self, factor: Interval, other: &Self) {
        for (c, o) in self.0.iter_mut().zip(&other.0) {
            *c = *c + factor * *o;
        }
    }

    /// Sharpens coefficients over a box by the ones at its centre.
    ///
    /// `self` encloses a function over the box, `centre` the same function at its centre, `step`
    /// holds all differences of points to the centre. A coefficient of the function is itself a
    /// smooth function (with coefficients binomial(b, a) f_b at a, for b >= a), so Taylor's theorem
    /// with Lagrange's remainder of degree `DEGREE - |a|` gives f_a(c + s) = sum over |b| < DEGREE
    /// of binomial(b, a) f_b(c) s^(b-a) + sum over |b| = DEGREE of binomial(b, a) f_b(z) s^(b-a)
    /// with z in the box, which is convex.
    pub(super) fn sharpen<const M: usize>(&mut self, centre: &Jet<M>, step: [Interval; 2]) {
        let powers = [
            [Interval::ONE, step[0], step[0].square(), step[0].square() * step[0]],
            [Interval::ONE, step[1], step[1].square(), step[1].square() * step[1]],
        ];
        for degree in 0..Self::DEGREE {
            for j in 0..=degree {
                let i = degree - j;
                let mut sum = Interval::ZERO;
                for total in degree..=Self::DEGREE {
                    for l in j..=total - i {
                        let k = total - l;
                        let source =
                            if total < Self::DEGREE { centre.0[index(total, l)] } else { self.0[index(total, l)] };
                        let factor = Interval::point(BINOMIAL[k][i] * BINOMIAL[l][j]);
                        sum = sum + source * factor * powers[0][k - i] * powers[1][l - j];
                    }
                }
                let own = &mut self.0[index(degree, j)];
                *own = own.meet(sum);
            }
        }
    }
}

/// For each coefficient of a product the pairs of coefficients it is the sum of.
const FACTORS: [&[(usize, usize)]; 10] = [
    &[(0, 0)],
    &[(0, 1), (1, 0)],
    &[(0, 2), (2, 0)],
    &[(0, 3), (1, 1), (3, 0)],
    &[(0, 4), (1, 2), (2, 1), (4, 0)],
    &[(0, 5), (2, 2), (5, 0)],
    &[(0, 6), (1, 3), (3, 1), (6, 0)],
    &[(0, 7), (1, 4), (2, 3), (3, 2), (4, 1), (7, 0)],
    &[(0, 8), (1, 5), (2, 4), (4, 2), (5, 1), (8, 0)],
    &[(0, 9), (2, 5), (5, 2), (9, 0)],
];

const BINOMIAL: [[f64; 4]; 4] =
    [[1.0, 0.0, 0.0, 0.0], [1.0, 1.0, 0.0, 0.0], [1.0, 2.0, 1.0, 0.0], [1.0, 3.0, 3.0, 1.0]];

impl<const N: usize> Add for Jet<N> {
    type Output = Self;
    fn add(mut self, other: Self) -> Self {
        for (a, b) in self.0.iter_mut().zip(other.0) {
            *a = *a + b;
        }
        self
    }
}

impl<const N: usize> Sub for Jet<N> {
    type Output = Self;
    fn sub(mut self, other: Self) -> Self {
        for (a, b) in self.0.iter_mut().zip(other.0) {
            *a = *a - b;
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// x and y at a point or over a box.
    fn variables<const N: usize>(x: Interval, y: Interval) -> [Jet<N>; 2] {
        let (mut a, mut b) = (Jet::constant(x), Jet::constant(y));
        a.0[1] = Interval::ONE;
        b.0[2] = Interval::ONE;
        [a, b]
    }

    /// sqrt((1 + x y) / (2 + x)).
    fn example<const N: usize>(x: Interval, y: Interval) -> Jet<N> {
        let [x, y] = variables::<N>(x, y);
        let one = Jet::constant(Interval::ONE);
        (one + x.times(&y)).over(&(one + one + x)).sqrt()
    }

    fn value(x: f64, y: f64) -> f64 {
        ((1.0 + x * y) / (2.0 + x)).sqrt()
    }

    #[test]
    fn coefficients_predict_values() {
        let (x, y) = (0.3, 0.7);
        let jet = example::<10>(Interval::point(x), Interval::point(y));
        for (dx, dy) in [(0.01f64, 0.0f64), (0.0, 0.01), (0.01, -0.02), (-0.02, -0.01)] {
            let mut sum = 0.0;
            for degree in 0..=3 {
                for j in 0..=degree {
                    let c = jet.0[index(degree, j)];
                    assert!(c.hi - c.lo < 1e-13);
                    sum += c.mid() * dx.powi((degree - j) as i32) * dy.powi(j as i32);
                }
            }
            let error = (sum - value(x + dx, y + dy)).abs();
            assert!(error < 1e-6 && error < 0.3 * (dx.hypot(dy) / 0.9).powi(4), "{error}");
        }
    }

    #[test]
    fn boxes_enclose_their_points_and_sharpen() {
        let (c, r) = ([0.3, 0.7], 0.1);
        let over = |r: f64| [0, 1].map(|i| Interval::new(c[i] - r, c[i] + r));
        let [x, y] = over(r);
        let wide = example::<10>(x, y);
        let mut sharp = wide;
        let step = Interval::around_zero(r * 1.0000001);
        sharp.sharpen(&example::<6>(Interval::point(c[0]), Interval::point(c[1])), [step; 2]);
        assert!(sharp.0[0].hi - sharp.0[0].lo < 0.6 * (wide.0[0].hi - wide.0[0].lo));
        for i in 0..=10 {
            for j in 0..=10 {
                let p = [c[0] + r * (i as f64 / 5.0 - 1.0), c[1] + r * (j as f64 / 5.0 - 1.0)];
                let thin = example::<10>(Interval::point(p[0]), Interval::point(p[1]));
                for k in 0..10 {
                    let m = thin.0[k].mid();
                    assert!(wide.0[k].contains(m) && sharp.0[k].contains(m), "{k}");
                }
            }
        }
        // Without the terms of highest degree the sharpened value would be too small a set.
        let mut broken = wide;
        for k in 6..10 {
            broken.0[k] = Interval::ZERO;
        }
        let mut zero = broken;
        zero.sharpen(&Jet::<6>::ZERO, [step; 2]);
        assert!(!zero.0[0].contains(value(c[0], c[1])));
    }

    #[test]
    fn factors_have_the_exponents_of_their_product() {
        let exponents: Vec<(usize, usize)> = (0..4).flat_map(|d| (0..=d).map(move |j| (d - j, j))).collect();
        for (k, pairs) in FACTORS.iter().enumerate() {
            let wanted = (0..10).flat_map(|a| (0..10).map(move |b| (a, b))).filter(|&(a, b)| {
                let (p, q) = (exponents[a], exponents[b]);
                (p.0 + q.0, p.1 + q.1) == exponents[k]
            });
            assert_eq!(pairs.to_vec(), wanted.collect::<Vec<_>>());
            assert!(pairs[0].0 == 0 && pairs[pairs.len() - 1].1 == 0);
        }
    }

    #[test]
    fn a_divisor_that_may_vanish_leaves_nothing_known() {
        let [x, _] = variables::<6>(Interval::new(-1.0, 1.0), Interval::ZERO);
        assert!(Jet::constant(Interval::ONE).over(&x).0.iter().all(|c| !c.is_known()));
        assert!(x.sqrt().0.iter().all(|c| !c.is_known()));
    }
}
