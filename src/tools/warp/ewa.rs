//! Means over ellipses of windows of decoded texels; see [`crate::picture::ellipse`].

use super::pyramid::Texel;
use crate::picture::ellipse::Ellipse;

/// The mean over an ellipse about `p`, in texels of a window that holds `reach` and a texel more to
/// every side.
#[inline(always)]
pub fn average(texels: &[Texel], stride: usize, p: [f32; 2], ellipse: &Ellipse) -> Texel {
    let [a, b, c] = ellipse.form;
    let (x, y) = (p[0] - 0.5, p[1] - 0.5);
    // Rounding up from above -1.
    let first = (y - ellipse.reach[1]).max(0.0) as i32;
    let last = (y + ellipse.reach[1]) as i32;
    let (inverse, determinant) = (0.5 / a, b * b - 4.0 * a * c);
    let mut sum = [0.0; 4];
    let mut weights = 0.0;
    for j in first..=last {
        let dy = j as f32 - y;
        // The row's part of the ellipse: a dx^2 + b dx dy + c dy^2 <= 1.
        let discriminant = determinant * dy * dy + 4.0 * a;
        if !(discriminant > 0.0) {
            continue;
        }
        let (middle, half) = (x - b * dy * inverse, discriminant.sqrt() * inverse);
        let from = (middle - half).max(0.0) as i32;
        let to = (middle + half) as i32;
        let start = j as usize * stride;
        let row = &texels[start + from as usize..=start + to as usize];
        for (i, texel) in (from..).zip(row) {
            let dx = i as f32 - x;
            let rest = (1.0 - (a * dx + b * dy) * dx - c * dy * dy).max(0.0);
            let w = rest * rest * rest;
            for k in 0..4 {
                sum[k] += w * texel[k];
            }
            weights += w;
        }
    }
    // The ellipse is at least a pixel wide and the kernel has a radius of 1.5: no weights are
    // missing.
    let share = 1.0 / weights;
    sum.map(|s| s * share)
}
