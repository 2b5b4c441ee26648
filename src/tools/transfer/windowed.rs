//! Filters of `sample_texture` that read texels one by one: the nearest, windowed sincs, ellipses.
//!
//! The weights are those of a warp ([`crate::picture`]); here a picture goes on beyond its borders
//! as its wrap mode says, and levels of the chain have whole numbers of texels, so that an ellipse
//! is stretched a little where a side is odd.

use super::color::Sample;
use super::sample::Texture;
use crate::picture::ellipse::Ellipse;
use crate::picture::lanczos::LanczosTable;
use crate::picture::taps::floor;

impl<T: Sample, const C: usize> Texture<'_, T, C> {
    /// The texel that holds `p`, in texels of level 0.
    pub(super) fn nearest(&self, p: [f32; 2]) -> [f32; C] {
        self.texel(0, floor(p[0]), floor(p[1]))
    }

    /// The weighted mean of `TAPS` x `TAPS` texels about `p`.
    pub(super) fn windowed<const TAPS: usize>(&self, table: &LanczosTable<TAPS>, p: [f32; 2]) -> [f32; C] {
        let q = p.map(|v| v - 0.5);
        let at = q.map(floor);
        let [wx, wy] = [0, 1].map(|a| table.weights::<f32>((), (q[a] - at[a] as f32).clamp(0.0, 1.0)));
        let first = at.map(|v| v.saturating_sub(TAPS as i32 / 2 - 1));
        let mut sum = [0.0; C];
        for (y, wy) in (first[1]..).zip(&wy[..TAPS]) {
            let mut row = [0.0; C];
            for (x, wx) in (first[0]..).zip(&wx[..TAPS]) {
                let texel = self.texel(0, x, y);
                for c in 0..C {
                    row[c] += wx * texel[c];
                }
            }
            for c in 0..C {
                sum[c] += wy * row[c];
            }
        }
        sum
    }

    /// The mean over the ellipse in the footprint about `p` with sides `dx` and `dy`; interpolated
    /// where that is no larger than a texel.
    pub(super) fn elliptical(&self, p: [f32; 2], dx: [f32; 2], dy: [f32; 2]) -> [f32; C] {
        // What is no number or far too large is clamped there.
        let finite = |v: [f32; 2]| v.map(|v| if v.is_nan() { f32::INFINITY } else { v });
        let ellipse = Ellipse::new(finite(dx), finite(dy), self.levels.len() as u32 + 1);
        let mut color = [0.0; C];
        let mut add = |share: f32, part: [f32; C]| (0..C).for_each(|c| color[c] += share * part[c]);
        if ellipse.share < 1.0 {
            add(1.0 - ellipse.share, self.windowed::<6>(LanczosTable::<6>::get(), p));
        }
        if ellipse.share > 0.0 {
            add(ellipse.share, self.average(p, &ellipse));
        }
        color
    }

    /// The mean over an ellipse about `p`.
    fn average(&self, p: [f32; 2], ellipse: &Ellipse) -> [f32; C] {
        let level = ellipse.level as usize;
        let sides = self.level_size(level);
        // Texels of the level along an axis for one of 2^-level, and for one of level 0.
        let ratio = [0, 1].map(|a| sides[a] as f32 / self.size[a] as f32);
        // One texel stands for all along its axis, at any distance.
        let stretch = [0, 1].map(|a| if sides[a] == 1 { 1.0 } else { ratio[a] * (1u64 << ellipse.level) as f32 });
        let (x, y) = (p[0] * ratio[0] - 0.5, p[1] * ratio[1] - 0.5);
        let a = ellipse.form[0] / (stretch[0] * stretch[0]);
        let b = ellipse.form[1] / (stretch[0] * stretch[1]);
        let c = ellipse.form[2] / (stretch[1] * stretch[1]);
        let reach = ellipse.reach[1] * stretch[1];
        let (inverse, determinant) = (0.5 / a, b * b - 4.0 * a * c);
        let (mut sum, mut weights) = ([0.0; C], 0.0);
        for j in floor(y - reach)..=floor(y + reach) {
            let dy = j as f32 - y;
            // The row's part of the ellipse: a dx^2 + b dx dy + c dy^2 <= 1.
            let discriminant = determinant * dy * dy + 4.0 * a;
            if !(discriminant > 0.0) {
                continue;
            }
            let (middle, half) = (x - b * dy * inverse, discriminant.sqrt() * inverse);
            for i in floor(middle - half)..=floor(middle + half) {
                let dx = i as f32 - x;
                let rest = (1.0 - (a * dx + b * dy) * dx - c * dy * dy).max(0.0);
                let weight = rest * rest * rest;
                let texel: [f32; C] = self.texel(level, i, j);
                for c in 0..C {
                    sum[c] += weight * texel[c];
                }
                weights += weight;
            }
        }
        // The ellipse is about a texel wide at least and the kernel has a radius of 1.5: no weights
        // are missing.
        let share = 1.0 / weights;
        sum.map(|s| s * share)
    }
}
