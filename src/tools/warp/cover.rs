//! How much of each pixel a polygon covers.

use glam::DVec2;
use rayon::prelude::*;

/// Exact share of each pixel's square inside the loops, for rows `first .. first + rows` of a
/// picture of `width` pixels.
///
/// Loops are in pixels of the picture and run one way around the domain and the other way around
/// its holes; either sense will do. An edge adds to each pixel that it crosses the signed area
/// between it and the pixel's right side; the running sum along a row is the winding number where
/// no edge is near. Time O(pixels + edges x pixels that they cross).
pub fn pixel_cover(loops: &[Vec<DVec2>], width: usize, first: usize, rows: usize) -> Vec<f32> {
    let mut cover = vec![0.0_f32; width * rows];
    if width == 0 {
        return cover;
    }
    cover.par_chunks_mut(width).enumerate().for_each(|(j, row)| {
        let top = (first + j) as f64;
        // One entry more takes what lies right of the picture.
        let mut sums = vec![0.0_f64; width + 1];
        for ring in loops {
            for (i, &a) in ring.iter().enumerate() {
                add_edge(&mut sums, a, ring[(i + 1) % ring.len()], top);
            }
        }
        let mut total = 0.0;
        for (out, sum) in row.iter_mut().zip(&sums) {
            total += sum;
            *out = total.abs().min(1.0) as f32;
            // Rounding leaves no veil over what is outside, nor a hole in what is inside.
            if *out < 1e-6 {
                *out = 0.0;
            } else if *out > 1.0 - 1e-6 {
                *out = 1.0;
            }
        }
    });
    cover
}

/// Adds one edge to the row of pixels below `top`.
fn add_edge(sums: &mut [f64], a: DVec2, b: DVec2, top: f64) {
    let (upper, lower, sign) = if a.y < b.y { (a, b, 1.0) } else { (b, a, -1.0) };
    let (y0, y1) = (upper.y.max(top), lower.y.min(top + 1.0));
    if !(y0 < y1) {
        return;
    }
    let at = |y: f64| {
        let t = (y - upper.y) / (lower.y - upper.y);
        upper.x + t * (lower.x - upper.x)
    };
    let width = (sums.len() - 1) as f64;
    // Left of the picture everything counts as at its side, right of it as beyond.
    let (mut x0, mut x1) = (at(y0), at(y1));
    let (mut h, slope) = (y1 - y0, (y1 - y0) / (x1 - x0));
    if x0 > x1 {
        (x0, x1) = (x1, x0);
    }
    let clip = |x: f64, h: &mut f64, share: f64| {
        *h -= share;
        sums_at(x, share)
    };
    let mut parts = [(0usize, 0.0_f64); 2];
    let mut count = 0;
    if x0 < 0.0 {
        let share = if x1 <= 0.0 { h } else { (-x0 * slope.abs()).min(h) };
        parts[count] = clip(0.0, &mut h, share);
        count += 1;
        x0 = 0.0;
    }
    if x1 > width {
        let share = if x0 >= width { h } else { ((x1 - width) * slope.abs()).min(h) };
        parts[count] = clip(width, &mut h, share);
        count += 1;
        x1 = width;
    }
    for &(i, share) in &parts[..count] {
        sums[i] += sign * share;
    }
    if h <= 0.0 || x0 > x1 {
        return;
    }
    let (first, last) = (x0 as usize, (x1 as usize).min(sums.len() - 1));
    let mut left = x0;
    for i in first..=last {
        let right = x1.min((i + 1) as f64);
        let part = if last == first { h } else { h * (right - left) / (x1 - x0) };
        // The mean distance from the right side of the pixel is what the pixel itself gets.
        let own = if i + 1 < sums.len() { ((i + 1) as f64 - 0.5 * (left + right)).clamp(0.0, 1.0) } else { 1.0 };
        sums[i] += sign * part * own;
        if i + 1 < sums.len() {
            sums[i + 1] += sign * part * (1.0 - own);
        }
        left = right;
    }
}

fn sums_at(x: f64, share: f64) -> (usize, f64) {
    (x as usize, share)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn v(points: &[(f64, f64)]) -> Vec<DVec2> {
        points.iter().map(|&(x, y)| DVec2::new(x, y)).collect()
    }

    #[test]
    fn areas_are_exact() {
        let square = v(&[(1.25, 0.5), (3.5, 0.5), (3.5, 2.75), (1.25, 2.75)]);
        let cover = pixel_cover(std::slice::from_ref(&square), 5, 0, 4);
        let span = |i: usize, a: f64, b: f64| (b.min(i as f64 + 1.0) - a.max(i as f64)).max(0.0);
        for (k, c) in cover.iter().enumerate() {
            let expected = span(k % 5, 1.25, 3.5) * span(k / 5, 0.5, 2.75);
            assert!((f64::from(*c) - expected).abs() < 1e-6, "{k}: {c} {expected}");
        }
        // With a hole, cut by the picture's sides, in slices of rows.
        let hole: Vec<DVec2> = v(&[(2.0, 1.0), (3.0, 1.0), (3.0, 2.0), (2.0, 2.0)]).into_iter().rev().collect();
        let with = pixel_cover(&[square, hole], 5, 1, 1);
        assert_eq!(with, [0.0, 0.75, 0.0, 0.5, 0.0]);
        let beyond = pixel_cover(&[v(&[(-7.0, -3.0), (2.5, -3.0), (2.5, 9.0), (-7.0, 9.0)])], 4, 1, 2);
        assert_eq!(beyond, [1.0, 1.0, 0.5, 0.0].repeat(2));
    }

    #[test]
    fn slanted_edges_sum_to_the_area() {
        for (n, turn) in [(3, 0.1), (4, 0.7), (7, 1.9), (64, 0.0)] {
            let at = |i: usize| {
                let (s, c) = f64::sin_cos(turn + std::f64::consts::TAU * i as f64 / n as f64);
                DVec2::new(20.3 + 13.7 * c, 17.1 + 11.9 * s)
            };
            let ring: Vec<DVec2> = (0..n).map(at).collect();
            let area: f64 = (0..n).map(|i| at(i).perp_dot(at(i + 1))).sum::<f64>() / 2.0;
            let cover = pixel_cover(std::slice::from_ref(&ring), 41, 0, 37);
            let sum: f64 = cover.iter().map(|c| f64::from(*c)).sum();
            assert!((sum - area.abs()).abs() < 1e-3, "{n}: {sum} {area}");
            let reversed: Vec<DVec2> = ring.into_iter().rev().collect();
            let other = pixel_cover(&[reversed], 41, 0, 37);
            assert!(cover.iter().zip(&other).all(|(a, b)| (a - b).abs() < 1e-6));
        }
        // Clipped at the right: the part within the picture.
        let ring = v(&[(-2.0, 1.0), (12.0, 1.0), (12.0, 5.0), (-2.0, 9.0)]);
        let sum: f64 = pixel_cover(&[ring], 8, 0, 12).iter().map(|c| f64::from(*c)).sum();
        let height = |x: f64| 8.0 - (x + 2.0) * 4.0 / 14.0;
        assert!((sum - 8.0 * height(4.0)).abs() < 1e-4, "{sum}");
    }
}
