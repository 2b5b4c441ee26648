//! Interval arithmetic in double precision, rounded outwards.

use std::ops::{Add, Mul, Neg, Sub};

/// All real numbers between two bounds.
///
/// Every operation returns an interval that holds the exact results for all real arguments from its
/// operands. Where no such interval exists (a division by an interval that holds zero, the root of
/// one that holds negative numbers, an overflow) a bound is NaN: *unknown*. NaN is handed on by
/// every operation, so no comparison with the result of unknown operands can succeed.
///
/// # Rounding
///
/// Basic operations of IEEE 754 round to nearest: the exact result lies between the neighbours of
/// the rounded one. [`down`] and [`up`] step to such a neighbour or past it with two roundings of
/// their own and no branch; their comments hold the proof.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Interval {
    pub(super) lo: f64,
    pub(super) hi: f64,
}

/// A number not above the neighbour of `x` below it.
///
/// Let u be the distance from `x` to the next larger magnitude. For a normal `x`, `|x| EPSILON >=
/// u` (and exact, a power of two apart), so `x` less the pad is at most `x - u`; that is a double
/// at or below the neighbour, and rounding is monotone. For a subnormal `x` the smallest normal
/// number is at least as much as any spacing there. An infinity becomes infinite or NaN.
#[inline(always)]
fn down(x: f64) -> f64 {
    x - (x.abs() * f64::EPSILON + f64::MIN_POSITIVE)
}

/// A number not below the neighbour of `x` above it; the mirror image of [`down`].
#[inline(always)]
fn up(x: f64) -> f64 {
    x + (x.abs() * f64::EPSILON + f64::MIN_POSITIVE)
}

#[inline(always)]
fn least(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

#[inline(always)]
fn most(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

impl Interval {
    pub(super) const ZERO: Self = Self { lo: 0.0, hi: 0.0 };
    pub(super) const ONE: Self = Self { lo: 1.0, hi: 1.0 };
    /// Nothing is known.
    pub(super) const UNKNOWN: Self = Self { lo: f64::NAN, hi: f64::NAN };

    pub(super) fn new(lo: f64, hi: f64) -> Self {
        Self { lo, hi }
    }

    /// One double, exactly.
    pub(super) fn point(x: f64) -> Self {
        Self { lo: x, hi: x }
    }

    /// `[-r, r]`.
    #[cfg(test)]
    pub(super) fn around_zero(r: f64) -> Self {
        Self { lo: -r, hi: r }
    }

    /// A double inside, about halfway.
    pub(super) fn mid(self) -> f64 {
        0.5 * self.lo + 0.5 * self.hi
    }

    #[cfg(test)]
    pub(super) fn contains(self, x: f64) -> bool {
        self.lo <= x && x <= self.hi
    }

    /// Both bounds are numbers.
    pub(super) fn is_known(self) -> bool {
        self.lo.is_finite() && self.hi.is_finite()
    }

    /// Whether zero may be inside; true for the unknown.
    pub(super) fn may_vanish(self) -> bool {
        !(self.lo > 0.0 || self.hi < 0.0) || !self.is_known()
    }

    /// All squares: tighter than the product with itself around zero.
    pub(super) fn square(self) -> Self {
        let (a, b) = (self.lo * self.lo, self.hi * self.hi);
        // A NaN bound makes both products suspect: `a + b` tells.
        let poison = 0.0 * (a + b);
        let low = if self.lo <= 0.0 && self.hi >= 0.0 { 0.0 } else { most(down(least(a, b)), 0.0) };
        Self { lo: low + poison, hi: up(most(a, b)) + poison }
    }

    /// The positive roots; unknown unless all are positive.
    pub(super) fn sqrt(self) -> Self {
        if !(self.lo > 0.0) {
            return Self::UNKNOWN;
        }
        Self { lo: down(self.lo.sqrt()), hi: up(self.hi.sqrt()) }
    }

    /// All reciprocals; unknown if zero may be inside.
    pub(super) fn recip(self) -> Self {
        if self.may_vanish() {
            return Self::UNKNOWN;
        }
        Self { lo: down(1.0 / self.hi), hi: up(1.0 / self.lo) }
    }

    /// Numbers in both; both hold the true value, so the unknown yields to the known.
    pub(super) fn meet(self, other: Self) -> Self {
        Self { lo: self.lo.max(other.lo), hi: self.hi.min(other.hi) }
    }

    /// Product with a power of two that neither overflows nor underflows, exact.
    pub(super) fn scaled(self, power: f64) -> Self {
        Self { lo: self.lo * power, hi: self.hi * power }
    }
}

impl Add for Interval {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { lo: down(self.lo + other.lo), hi: up(self.hi + other.hi) }
    }
}

impl Sub for Interval {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { lo: down(self.lo - other.hi), hi: up(self.hi - other.lo) }
    }
}

impl Neg for Interval {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self { lo: -self.hi, hi: -self.lo }
    }
}

impl Mul for Interval {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        let (a, b) = (self.lo * other.lo, self.lo * other.hi);
        let (c, d) = (self.hi * other.lo, self.hi * other.hi);
        // Comparisons may drop a NaN; the sum of all products times zero keeps it (and turns an
        // overflow into one).
        let poison = ((a + b) + (c + d)) * 0.0;
        Self { lo: down(least(least(a, b), least(c, d))) + poison, hi: up(most(most(a, b), most(c, d))) + poison }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Exact product as an unevaluated sum of two doubles, for moderate exponents.
    fn two_product(a: f64, b: f64) -> (f64, f64) {
        let p = a * b;
        (p, a.mul_add(b, -p))
    }

    /// Exact sum as an unevaluated sum of two doubles.
    fn two_sum(a: f64, b: f64) -> (f64, f64) {
        let s = a + b;
        let t = s - a;
        (s, (a - (s - t)) + (b - t))
    }

    /// `lo <= x + e <= hi` in exact arithmetic, where `x` is the double nearest to `x + e`.
    fn holds(i: Interval, (x, e): (f64, f64)) -> bool {
        let above = i.lo < x || (i.lo == x && e >= 0.0);
        let below = i.hi > x || (i.hi == x && e <= 0.0);
        above && below
    }

    fn number() -> impl Strategy<Value = f64> {
        (-1.0..1.0f64, -40..40i32).prop_map(|(m, e)| m * f64::from(e).exp2())
    }

    fn interval() -> impl Strategy<Value = (Interval, f64)> {
        (number(), number(), 0.0..=1.0f64).prop_map(|(a, b, s)| {
            let (lo, hi) = (a.min(b), a.max(b));
            (Interval::new(lo, hi), (lo + (hi - lo) * s).clamp(lo, hi))
        })
    }

    proptest! {
        #[test]
        fn outward_steps_pass_the_neighbours(bits in any::<u64>()) {
            let x = f64::from_bits(bits);
            prop_assume!(x.is_finite() && x.abs() < 1e300);
            prop_assert!(down(x) <= x.next_down() && up(x) >= x.next_up());
        }

        #[test]
        fn operations_hold_exact_results((a, x) in interval(), (b, y) in interval()) {
            prop_assert!(holds(a + b, two_sum(x, y)));
            prop_assert!(holds(a - b, two_sum(x, -y)));
            prop_assert!(holds(-a, (-x, 0.0)));
            prop_assert!(holds(a * b, two_product(x, y)));
            prop_assert!(holds(a.square(), two_product(x, x)));
            if !b.may_vanish() {
                // y r <= 1 <= y R with the bounds of 1/y, decided exactly.
                let r = b.recip();
                let sign = y.signum();
                let below = two_product(y.abs(), if sign > 0.0 { r.lo } else { -r.hi });
                let above = two_product(y.abs(), if sign > 0.0 { r.hi } else { -r.lo });
                prop_assert!(below.0 < 1.0 || (below.0 == 1.0 && below.1 <= 0.0));
                prop_assert!(above.0 > 1.0 || (above.0 == 1.0 && above.1 >= 0.0));
            }
            if a.lo > 0.0 {
                let r = a.sqrt();
                let (l, h) = (two_product(r.lo, r.lo), two_product(r.hi, r.hi));
                prop_assert!(l.0 < x || (l.0 == x && l.1 <= 0.0));
                prop_assert!(h.0 > x || (h.0 == x && h.1 >= 0.0));
            }
        }

        #[test]
        fn operations_are_tight(x in number(), y in number()) {
            let (a, b) = (Interval::point(x), Interval::point(y));
            for (i, v) in [(a + b, x + y), (a * b, x * y), (a.square(), x * x)] {
                prop_assert!(i.hi - i.lo <= 5.0 * f64::EPSILON * v.abs() + 1e-300);
            }
        }
    }

    #[test]
    fn plain_rounding_would_be_noticed() {
        // The check itself: the rounded sum of 1 and 1e-20 alone does not hold the exact one.
        assert!(!holds(Interval::point(1.0 + 1e-20), two_sum(1.0, 1e-20)));
        assert!(holds(Interval::point(1.0) + Interval::point(1e-20), two_sum(1.0, 1e-20)));
    }

    #[test]
    fn the_unknown_is_handed_on() {
        let u = Interval::UNKNOWN;
        let a = Interval::new(-1.0, 2.0);
        let zero = Interval::ZERO;
        for i in [
            u + a,
            a + u,
            u - a,
            a - u,
            u * a,
            a * u,
            u * zero,
            -u,
            u.square(),
            u.sqrt(),
            u.recip(),
            a.recip(),
            a.sqrt(),
        ] {
            assert!(!i.is_known() && i.may_vanish() && !i.contains(0.0), "{i:?}");
        }
        // Half unknown and overflowing operands too.
        let half = Interval::new(0.5, f64::NAN);
        assert!(!(half * a).is_known() && !half.square().is_known() && !half.recip().is_known());
        let huge = Interval::new(1e300, f64::MAX);
        assert!(!(huge * huge).is_known() && !huge.square().is_known() && !(huge + huge).is_known());
        assert_eq!(u.meet(a), a);
    }
}
