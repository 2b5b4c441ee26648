//! Filters that interpolate: what a picture is between its pixels.
//!
//! Flat functions in single precision that gather from a window of decoded texels, as the kernel `warp_image` does. Points are
//! in texels of the window, whose centres are at halves; the window holds all texels that a filter reads.

use std::sync::LazyLock;

use super::pyramid::Texel;
use crate::engine::Lane;

/// How colours are taken from the picture at a pre-image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Filter {
    /// Averages over the ellipse that the output pixel sees, as the map's Jacobian tells; Lanczos-3 where that is no larger
    /// than a pixel. No aliasing.
    #[default]
    Ewa,
    /// The four nearest pixels: fast; aliases where the picture is reduced.
    Bilinear,
    /// 6 x 6 pixels, windowed sinc with three lobes: sharp; aliases where the picture is reduced.
    Lanczos,
}

impl Filter {
    /// Name on the command line and in reports.
    pub fn word(self) -> &'static str {
        match self {
            Self::Ewa => "ewa",
            Self::Bilinear => "bilinear",
            Self::Lanczos => "lanczos",
        }
    }
}

/// Texels that [`bilinear`] reads left of, and above, the texel that holds the point; as many to the other side.
pub const BILINEAR_REACH: i32 = 1;
/// As [`BILINEAR_REACH`], for [`lanczos`].
pub const LANCZOS_REACH: i32 = 3;

/// The weighted mean of the four nearest texels. `p` is at least 1/2 from the window's left and upper sides.
#[inline(always)]
pub fn bilinear<L: Lane<E = f32>>(texels: &[Texel], stride: usize, p: [f32; 2]) -> Texel {
    // Processors with lanes have fused products; elsewhere they are a slow call.
    let mix = |a: f32, b: f32, f: f32| if L::N > 1 { f.mul_add(b - a, a) } else { a + f * (b - a) };
    let (x, y) = (p[0] - 0.5, p[1] - 0.5);
    // Nothing is negative in a window, so that cutting off is rounding down.
    let (i, j) = (x as i32, y as i32);
    let (fx, fy) = (x - i as f32, y - j as f32);
    let at = j as usize * stride + i as usize;
    let seen = &texels[at..at + stride + 2];
    let (upper, lower) = (&seen[..2], &seen[stride..stride + 2]);
    let mut out = [0.0; 4];
    for c in 0..4 {
        out[c] = mix(mix(upper[0][c], upper[1][c], fx), mix(lower[0][c], lower[1][c], fx), fy);
    }
    out
}

/// Lanczos-3: 6 x 6 texels, each direction normalised so that constants stay. `p` is at least 5/2 from the window's left and
/// upper sides.
#[inline(always)]
pub fn lanczos<L: Lane<E = f32>>(
    cpu: L::Cpu,
    texels: &[Texel],
    stride: usize,
    p: [f32; 2],
    table: &LanczosTable,
) -> Texel {
    let (x, y) = (p[0] - 0.5, p[1] - 0.5);
    let (i, j) = (x as i32, y as i32);
    let (wx, wy) = (table.weights(x - i as f32), table.weights(y - j as f32));
    let first = (j - 2) as usize * stride + (i - 2) as usize;
    let seen = &texels[first..first + 5 * stride + 6];
    // Down the columns first: that is one multiplication for each number read, of whole rows in step. Six texels are 24 numbers.
    let mut columns = [0.0_f32; 24];
    if L::N == 8 || L::N == 4 {
        let mut sums = [L::splat(cpu, 0.0); 6];
        for k in 0..6 {
            let row = seen[k * stride..k * stride + 6].as_flattened();
            let w = L::splat(cpu, wy[k]);
            for v in 0..24 / L::N {
                sums[v] = L::load(cpu, &row[v * L::N..]).mul_add(w, sums[v]);
            }
        }
        for v in 0..24 / L::N {
            sums[v].store(&mut columns[v * L::N..]);
        }
    } else {
        for k in 0..6 {
            let row = seen[k * stride..k * stride + 6].as_flattened();
            for c in 0..24 {
                columns[c] += wy[k] * row[c];
            }
        }
    }
    let mut out = [0.0; 4];
    for k in 0..6 {
        for c in 0..4 {
            out[c] += wx[k] * columns[4 * k + c];
        }
    }
    out
}

/// [`lanczos_weights`] at 512 places, between which they are interpolated: within 2e-6.
#[derive(Debug)]
pub struct LanczosTable([[f32; 8]; Self::PLACES + 1]);

impl LanczosTable {
    const PLACES: usize = 512;

    /// The only one there is.
    pub fn get() -> &'static Self {
        static TABLE: LazyLock<LanczosTable> = LazyLock::new(|| {
            LanczosTable(std::array::from_fn(|i| {
                let mut row = [0.0; 8];
                row[..6].copy_from_slice(&lanczos_weights(i as f32 / LanczosTable::PLACES as f32));
                row
            }))
        });
        &TABLE
    }

    /// Six weights and two zeros.
    #[inline(always)]
    fn weights(&self, f: f32) -> [f32; 8] {
        let at = f * Self::PLACES as f32;
        // Below 512 as f is below 1; said to the compiler by the minimum.
        let i = (at as i32 as usize).min(Self::PLACES - 1);
        let part = at - i as f32;
        let (a, b) = (&self.0[i], &self.0[i + 1]);
        std::array::from_fn(|k| a[k] + part * (b[k] - a[k]))
    }
}

/// Weights of the texels -2 to 3 for a point `f` right of texel 0, `0 <= f < 1`; their sum is 1.
///
/// `L(x) = 3 sin(pi x) sin(pi x / 3) / (pi x)^2`, whose constant normalisation removes. The sines of all six taps follow from
/// those of pi f and pi f / 3; f is brought below 1/2 so that no sine is a difference of larger numbers next to its zero.
#[inline(always)]
pub fn lanczos_weights(f: f32) -> [f32; 6] {
    const HALF_ROOT_3: f32 = 0.866_025_4;
    let mirrored = f > 0.5;
    let f = if mirrored { 1.0 - f } else { f };
    if f < 1e-9 {
        let mut w = [0.0; 6];
        w[if mirrored { 3 } else { 2 }] = 1.0;
        return w;
    }
    let (s1, s, c) = (sine_pi(f), sine_pi(f * (1.0 / 3.0)), cosine_pi(f * (1.0 / 3.0)));
    // sin(pi x / 3) times the sign of sin(pi x) / sin(pi f) for the six distances.
    let (a, b) = (0.5 * s, HALF_ROOT_3 * c);
    let sines = [b - a, -(a + b), s, b - a, -(a + b), s];
    let x = [f + 2.0, f + 1.0, f, f - 1.0, f - 2.0, f - 3.0];
    let mut w: [f32; 6] = std::array::from_fn(|k| s1 * sines[k] / (x[k] * x[k]));
    let share = 1.0 / (w[0] + w[1] + w[2] + w[3] + w[4] + w[5]);
    w = w.map(|w| w * share);
    if mirrored { [w[5], w[4], w[3], w[2], w[1], w[0]] } else { w }
}

/// sin(pi x) for 0 <= x <= 1/2, within 1e-7 of its value (Taylor's series): built-in sines of kernels have no such bound.
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
mod tests {
    use super::*;

    /// The definition, in double precision.
    fn exact_weights(f: f64) -> [f64; 6] {
        let sinc = |x: f64| if x == 0.0 { 1.0 } else { (std::f64::consts::PI * x).sin() / (std::f64::consts::PI * x) };
        let w: [f64; 6] = std::array::from_fn(|k| {
            let x = f + 2.0 - k as f64;
            if x.abs() < 3.0 { sinc(x) * sinc(x / 3.0) } else { 0.0 }
        });
        let sum: f64 = w.iter().sum();
        w.map(|w| w / sum)
    }

    #[test]
    fn weights_are_lanczos() {
        let near = [1e-12, 1e-9, 1e-8, 1e-6, 1e-4, 0.5, 0.999_9, 0.999_999_94];
        for f in (0..=4096).map(|n| n as f32 / 4097.0).chain(near) {
            let (w, exact) = (lanczos_weights(f), exact_weights(f64::from(f)));
            for k in 0..6 {
                assert!((f64::from(w[k]) - exact[k]).abs() < 4e-7, "{f} {k}: {} {}", w[k], exact[k]);
            }
            assert!((w.iter().sum::<f32>() - 1.0).abs() < 1e-6);
            let near = LanczosTable::get().weights(f);
            assert!((0..6).all(|k| (f64::from(near[k]) - exact[k]).abs() < 2e-6) && near[6..] == [0.0; 2]);
        }
        assert_eq!(lanczos_weights(0.0), [0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn texels_are_kept_and_lines_are_straight() {
        let stride = 12;
        let texels: Vec<Texel> =
            (0..stride * stride).map(|i| [(i % stride) as f32, (i / stride) as f32, 1.0, 0.0]).collect();
        for (x, y) in [(5.5, 5.5), (4.5, 6.5)] {
            let texel = texels[y as usize * stride + x as usize];
            assert_eq!(bilinear::<f32>(&texels, stride, [x, y]), texel);
            assert_eq!(lanczos::<f32>((), &texels, stride, [x, y], LanczosTable::get()), texel);
        }
        for n in 0..50 {
            let p = [5.0 + n as f32 * 0.037, 6.9 - n as f32 * 0.029];
            let expected = [p[0] - 0.5, p[1] - 0.5, 1.0, 0.0];
            for c in 0..4 {
                assert!((bilinear::<f32>(&texels, stride, p)[c] - expected[c]).abs() < 1e-5);
                // Not exact on lines, a known property of the windowed sinc: within 0.02 of a texel.
                assert!(
                    (lanczos::<f32>((), &texels, stride, p, LanczosTable::get())[c] - expected[c]).abs()
                        < if c < 2 { 0.02 } else { 2e-6 }
                );
            }
        }
    }
}
