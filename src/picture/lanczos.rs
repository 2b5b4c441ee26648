//! Weights of windowed sincs: what a picture is between its pixels.

use std::sync::LazyLock;

use crate::engine::Lane;

/// [`lanczos_weights`] at 512 places, between which they are interpolated: within 2e-6.
#[derive(Debug)]
pub struct LanczosTable<const TAPS: usize>([[f32; 8]; PLACES + 1]);

const PLACES: usize = 512;

impl LanczosTable<6> {
    /// That of three lobes.
    pub fn get() -> &'static Self {
        static TABLE: LazyLock<LanczosTable<6>> = LazyLock::new(LanczosTable::new);
        &TABLE
    }
}

impl LanczosTable<8> {
    /// That of four lobes.
    pub fn get() -> &'static Self {
        static TABLE: LazyLock<LanczosTable<8>> = LazyLock::new(LanczosTable::new);
        &TABLE
    }
}

impl<const TAPS: usize> LanczosTable<TAPS> {
    fn new() -> Self {
        Self(std::array::from_fn(|i| {
            let mut row = [0.0; 8];
            row[..TAPS].copy_from_slice(&lanczos_weights::<TAPS>(i as f32 / PLACES as f32));
            row
        }))
    }

    /// `TAPS` weights, and zeros.
    #[inline(always)]
    pub(crate) fn weights<L: Lane<E = f32>>(&self, cpu: L::Cpu, f: f32) -> [f32; 8] {
        let at = f * PLACES as f32;
        // Below 512 as f is below 1; said to the compiler by the minimum.
        let i = (at as i32 as usize).min(PLACES - 1);
        let part = at - i as f32;
        let (a, b) = (&self.0[i], &self.0[i + 1]);
        let mut weights = [0.0; 8];
        if 8 % L::N == 0 {
            let part = L::splat(cpu, part);
            for k in (0..8).step_by(L::N) {
                let (a, b) = (L::load(cpu, &a[k..]), L::load(cpu, &b[k..]));
                part.mul_add(b - a, a).store(&mut weights[k..]);
            }
        } else {
            for k in 0..8 {
                weights[k] = a[k] + part * (b[k] - a[k]);
            }
        }
        weights
    }
}

/// Weights of `TAPS` texels, of which as many are to either side of a point `f` right of the last
/// one before it, `0 <= f < 1`; their sum is 1.
///
/// With n = `TAPS / 2` lobes, `L(x) = n sin(pi x) sin(pi x / n) / (pi x)^2`, whose constant
/// normalisation removes. The sines of all taps follow from those of pi f and pi f / n; f is
/// brought below 1/2 so that no sine is a difference of larger numbers next to its zero.
pub fn lanczos_weights<const TAPS: usize>(f: f32) -> [f32; TAPS] {
    let lobes = TAPS / 2;
    let mirrored = f > 0.5;
    let f = if mirrored { 1.0 - f } else { f };
    let mut w = [0.0; TAPS];
    if f < 1e-9 {
        w[if mirrored { lobes } else { lobes - 1 }] = 1.0;
        return w;
    }
    let share = 1.0 / lobes as f32;
    let (s1, s, c) = (sine_pi(f), sine_pi(f * share), cosine_pi(f * share));
    for (k, w) in w.iter_mut().enumerate() {
        // The texel lies m to the left of the point and f more.
        let m = lobes as i32 - 1 - k as i32;
        let (sine, cosine) = f64::sin_cos(f64::from(m) * std::f64::consts::PI / lobes as f64);
        let sine = s * cosine as f32 + c * sine as f32;
        let x = f + m as f32;
        *w = if m % 2 == 0 { s1 } else { -s1 } * sine / (x * x);
    }
    let share = 1.0 / w.iter().sum::<f32>();
    w = w.map(|w| w * share);
    if mirrored {
        w.reverse();
    }
    w
}

/// sin(pi x) for 0 <= x <= 1/2, within 1e-7 of its value (Taylor's series): built-in sines of
/// kernels have no such bound.
#[inline(always)]
fn sine_pi(x: f32) -> f32 {
    let q = x * x;
    x * (std::f32::consts::PI
        + q * (-5.167_713 + q * (2.550_164 + q * (-0.599_264_5 + q * (0.082_145_89 - q * 0.007_370_431)))))
}

/// cos(pi x) for 0 <= x <= 1/6, as [`sine_pi`].
#[inline(always)]
fn cosine_pi(x: f32) -> f32 {
    let q = x * x;
    1.0 + q * (-4.934_802 + q * (4.058_712 + q * (-1.335_262_8 + q * 0.235_330_63)))
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// The definition, in double precision.
    pub(crate) fn exact_weights<const TAPS: usize>(f: f64) -> [f64; TAPS] {
        let lobes = (TAPS / 2) as f64;
        let sinc = |x: f64| if x == 0.0 { 1.0 } else { (std::f64::consts::PI * x).sin() / (std::f64::consts::PI * x) };
        let w: [f64; TAPS] = std::array::from_fn(|k| {
            let x = f + lobes - 1.0 - k as f64;
            if x.abs() < lobes { sinc(x) * sinc(x / lobes) } else { 0.0 }
        });
        let sum: f64 = w.iter().sum();
        w.map(|w| w / sum)
    }

    fn check<const TAPS: usize>(table: &LanczosTable<TAPS>) {
        let near = [1e-12, 1e-9, 1e-8, 1e-6, 1e-4, 0.5, 0.999_9, 0.999_999_94];
        for f in (0..=4096).map(|n| n as f32 / 4097.0).chain(near) {
            let (w, exact) = (lanczos_weights::<TAPS>(f), exact_weights::<TAPS>(f64::from(f)));
            for k in 0..TAPS {
                assert!((f64::from(w[k]) - exact[k]).abs() < 4e-7, "{TAPS} {f} {k}: {} {}", w[k], exact[k]);
            }
            assert!((w.iter().sum::<f32>() - 1.0).abs() < 1e-6);
            let near = table.weights::<f32>((), f);
            assert!((0..TAPS).all(|k| (f64::from(near[k]) - exact[k]).abs() < 2e-6), "{TAPS} {f}");
            assert!(near[TAPS..].iter().all(|w| *w == 0.0));
        }
        let mut one = [0.0; TAPS];
        one[TAPS / 2 - 1] = 1.0;
        assert_eq!(lanczos_weights::<TAPS>(0.0), one);
    }

    #[test]
    fn weights_are_lanczos() {
        check(LanczosTable::<6>::get());
        check(LanczosTable::<8>::get());
    }
}
