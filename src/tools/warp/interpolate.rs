//! Filters of a fixed size at runs of pixels: what is done at once for all of a run, and what for
//! each.

use super::band::BLOCK;
use super::footprint::{FARTHEST, Seen};
use super::pyramid::Texel;
use crate::engine::Lane;
use crate::picture::lanczos::LanczosTable;

/// Texels in memory, row by row.
pub(super) trait Texels: Copy {
    /// Texel `at` and the one after it.
    fn pair<L: Lane<E = f32>>(self, cpu: L::Cpu, at: usize) -> [Texel; 2];
}

impl Texels for &[Texel] {
    #[inline(always)]
    fn pair<L: Lane<E = f32>>(self, _cpu: L::Cpu, at: usize) -> [Texel; 2] {
        let pair = &self[at..at + 2];
        [pair[0], pair[1]]
    }
}

/// Where texels lie, and pre-images in them: `seen + shift` is a place in rows of `stride` texels,
/// whose centres are at halves.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid<T> {
    pub(super) texels: T,
    pub(super) stride: usize,
    pub(super) shift: [f32; 2],
}

/// A filter that reads the same number of texels everywhere.
pub(super) trait Interpolation<T>: Sync {
    /// Texels read left of, and above, the texel that holds the point; as many to the other side.
    const REACH: i32;
    /// Texels of a window that are worth decoding for one pixel: about twice what is read.
    const WORTH: usize;

    /// The colour of pixel `k` of a run.
    fn color<L: Lane<E = f32>>(&self, cpu: L::Cpu, grid: &Grid<T>, places: &Places, k: usize) -> Texel;
}

/// Places of up to [`BLOCK`] pixels: the texel whose centre is the last to the left and above, and
/// the way from it.
pub(super) struct Places {
    whole: [[u32; BLOCK]; 2],
    part: [[f32; BLOCK]; 2],
}

/// Beyond it the numbers of single precision are the whole ones, in the order of their bits.
const WHOLE: f32 = 8_388_608.0;

impl Places {
    #[inline(always)]
    pub(super) fn new(seen: &Seen<'_>, shift: [f32; 2]) -> Self {
        let mut places = Self { whole: [[0; BLOCK]; 2], part: [[0.0; BLOCK]; 2] };
        for (axis, values) in [seen.x, seen.y].into_iter().enumerate() {
            let (whole, part) = (&mut places.whole[axis], &mut places.part[axis]);
            for ((v, whole), part) in values.iter().zip(whole).zip(part) {
                let p = (v.clamp(-FARTHEST, FARTHEST) + shift[axis]) - 0.5;
                // Nothing is negative where texels are. Rounding to the nearest, then down; no
                // conversion is needed.
                let near = (p + WHOLE) - WHOLE;
                let below = if near > p { near - 1.0 } else { near };
                *whole = (below + WHOLE).to_bits().wrapping_sub(WHOLE.to_bits());
                *part = p - below;
            }
        }
        places
    }

    /// Number of the texel of pixel `k`.
    #[inline(always)]
    fn texel(&self, k: usize, stride: usize) -> usize {
        self.whole[1][k] as usize * stride + self.whole[0][k] as usize
    }
}

/// The colours of a row of pixels that look somewhere; the others are left as they are.
#[inline(always)]
pub(super) fn interpolate<L: Lane<E = f32>, T: Copy, I: Interpolation<T>>(
    cpu: L::Cpu,
    filter: &I,
    grid: &Grid<T>,
    row: &Seen<'_>,
    out: &mut [Texel],
) {
    for (start, out) in (0..).step_by(BLOCK).zip(out.chunks_mut(BLOCK)) {
        let run = row.part(start..start + out.len());
        let places = Places::new(&run, grid.shift);
        for (k, out) in out.iter_mut().enumerate() {
            if run.looks(k) {
                *out = filter.color::<L>(cpu, grid, &places, k);
            }
        }
    }
}

/// The texel that holds the point.
pub(super) struct NearestTexel;

impl<T: Texels + Sync> Interpolation<T> for NearestTexel {
    const REACH: i32 = 1;
    const WORTH: usize = 12;

    #[inline(always)]
    fn color<L: Lane<E = f32>>(&self, cpu: L::Cpu, grid: &Grid<T>, places: &Places, k: usize) -> Texel {
        let [right, below] = [0, 1].map(|axis| usize::from(places.part[axis][k] >= 0.5));
        grid.texels.pair::<L>(cpu, places.texel(k, grid.stride) + below * grid.stride)[right]
    }
}

/// The weighted mean of the four nearest texels.
pub(super) struct Bilinear;

impl<T: Texels + Sync> Interpolation<T> for Bilinear {
    const REACH: i32 = 1;
    const WORTH: usize = 12;

    #[inline(always)]
    fn color<L: Lane<E = f32>>(&self, cpu: L::Cpu, grid: &Grid<T>, places: &Places, k: usize) -> Texel {
        // Processors with lanes have fused products; elsewhere they are a slow call.
        let mix = |a: f32, b: f32, f: f32| if L::N > 1 { f.mul_add(b - a, a) } else { a + f * (b - a) };
        let at = places.texel(k, grid.stride);
        let (upper, lower) = (grid.texels.pair::<L>(cpu, at), grid.texels.pair::<L>(cpu, at + grid.stride));
        let (fx, fy) = (places.part[0][k], places.part[1][k]);
        let mut out = [0.0; 4];
        for c in 0..4 {
            out[c] = mix(mix(upper[0][c], upper[1][c], fx), mix(lower[0][c], lower[1][c], fx), fy);
        }
        out
    }
}

/// The windowed sinc of `TAPS / 2` lobes: `TAPS` x `TAPS` texels, each direction normalised so that
/// constants stay.
pub(super) struct Lanczos<const TAPS: usize>(pub(super) &'static LanczosTable<TAPS>);

impl<const TAPS: usize> Interpolation<&[Texel]> for Lanczos<TAPS> {
    const REACH: i32 = TAPS as i32 / 2;
    const WORTH: usize = 2 * TAPS * TAPS;

    #[inline(always)]
    fn color<L: Lane<E = f32>>(&self, cpu: L::Cpu, grid: &Grid<&[Texel]>, places: &Places, k: usize) -> Texel {
        let wx = self.0.weights::<L>(cpu, places.part[0][k]);
        let wy = self.0.weights::<L>(cpu, places.part[1][k]);
        let (stride, before) = (grid.stride, TAPS / 2 - 1);
        let first = places.texel(k, stride) - (before * stride + before);
        let seen = &grid.texels[first..first + (TAPS - 1) * stride + TAPS];
        // Down the columns first: that is one multiplication for each number read, of whole rows in
        // step.
        let mut columns = [[0.0_f32; 4]; 8];
        let numbers = columns.as_flattened_mut();
        if L::N == 8 || L::N == 4 {
            let vectors = 4 * TAPS / L::N;
            let mut sums = [L::splat(cpu, 0.0); 8];
            for j in 0..TAPS {
                let row = seen[j * stride..j * stride + TAPS].as_flattened();
                let w = L::splat(cpu, wy[j]);
                for v in 0..vectors {
                    sums[v] = L::load(cpu, &row[v * L::N..]).mul_add(w, sums[v]);
                }
            }
            for v in 0..vectors {
                sums[v].store(&mut numbers[v * L::N..]);
            }
        } else {
            for j in 0..TAPS {
                let row = seen[j * stride..j * stride + TAPS].as_flattened();
                for (sum, v) in numbers.iter_mut().zip(row) {
                    *sum += wy[j] * v;
                }
            }
        }
        let mut out = [0.0; 4];
        for i in 0..TAPS {
            for c in 0..4 {
                out[c] += wx[i] * columns[i][c];
            }
        }
        out
    }
}
