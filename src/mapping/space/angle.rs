//! Angles from their sine and cosine, by a polynomial: what the kernels can evaluate alike, and
//! lanes as well.
//!
//! The quotient of the smaller and the larger is brought below tan(pi / 8) by atan a = pi / 4 +
//! atan((a - 1) / (a + 1)), in one division. In single precision four coefficients of the Cephes
//! library (Moshier) follow, relative error 2e-7 with rounding; in double precision the power
//! series, whose 22nd term is below the rounding there.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use crate::engine::{Lane, Real};

/// tan(pi / 8).
const SPLIT: f64 = 0.414_213_562_373_095_03;

/// atan a = a + a^3 (c_0 + c_1 a^2 + ...) up to [`SPLIT`], in single precision.
const SINGLE: [f64; 4] = [-3.333_294_915_39e-1, 1.997_771_064_78e-1, -1.387_768_560_32e-1, 8.053_744_495_38e-2];

/// Terms of the power series in double precision.
const DOUBLE: usize = 22;

/// Denominators are at least this.
const LEAST: f64 = 1e-37;

/// The polynomial c_0 + c_1 s + ... of the scalar's precision.
#[inline(always)]
fn polynomial<L: Lane>(cpu: L::Cpu, s: L) -> L {
    let mut sum;
    if L::E::EPSILON.to_f64() > 1e-10 {
        sum = L::num(cpu, SINGLE[3]);
        for k in (0..3).rev() {
            sum = sum.mul_add(s, L::num(cpu, SINGLE[k]));
        }
    } else {
        let term = |k: usize| if k.is_multiple_of(2) { -1.0 } else { 1.0 } / (2 * k + 3) as f64;
        sum = L::num(cpu, term(DOUBLE));
        for k in (0..DOUBLE).rev() {
            sum = sum.mul_add(s, L::num(cpu, term(k)));
        }
    }
    sum
}

/// The angle in 0..=pi whose sine and cosine are in the ratio `y` to `x`, `y` not negative;
/// accurate relative to itself where it is small. Zero where both are zero.
#[inline(always)]
pub(super) fn angle<L: Lane>(cpu: L::Cpu, y: L, x: L) -> L {
    let (zero, across) = (L::num(cpu, 0.0), x.abs());
    let steep = across.lt(y);
    let (small, large) = (L::select(steep, across, y), L::select(steep, y, across));
    let wide = (large * L::num(cpu, SPLIT)).lt(small);
    let over = L::select(wide, small - large, small);
    let under = L::select(wide, small + large, large).maximum(L::num(cpu, LEAST));
    let a = over / under;
    let s = a * a;
    let mut r = (a * s).mul_add(polynomial(cpu, s), a) + L::select(wide, L::num(cpu, FRAC_PI_4), zero);
    r = L::select(steep, L::num(cpu, FRAC_PI_2) - r, r);
    L::select(x.lt(zero), L::num(cpu, PI) - r, r)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn worst<E: crate::engine::LaneScalar + Lane<Cpu = (), E = E>>() -> f64 {
        let mut worst: f64 = 0.0;
        for k in 0..4000 {
            let turn = PI * f64::from(k) / 4000.0;
            for size in [1e-6, 1.0, 1e5] {
                let (y, x) = (E::of(size * turn.sin()), E::of(size * turn.cos()));
                let exact = y.to_f64().atan2(x.to_f64());
                let off = (angle::<E>((), y, x).to_f64() - exact).abs();
                worst = worst.max(if exact == 0.0 { off } else { off / exact });
            }
        }
        worst
    }

    #[test]
    fn angles_are_those_of_the_arc_tangent() {
        assert!(worst::<f32>() < 2.5e-7, "{:e}", worst::<f32>());
        assert!(worst::<f64>() < 6e-16, "{:e}", worst::<f64>());
        assert_eq!(angle::<f64>((), 0.0, 0.0), 0.0);
        assert_eq!(angle::<f64>((), 0.0, -1.0), PI);
        let tiny = angle::<f32>((), 1e-24, 1.0);
        assert!((tiny / 1e-24 - 1.0).abs() < 1e-6, "small angles keep their digits");
    }
}
