//! `pad_seams`: colours beyond the charts' borders, so that filtering a texture does not mix in its
//! background.
//!
//! An exact Euclidean distance in two gathers: first the nearest covered texel in each column, then
//! the nearest of those along the row (Saito and Toriwaki 1994). Jump flooding needs more passes
//! and misses some texels.

use rayon::prelude::*;

use crate::geometry::NONE;

/// Coverage from this value on is covered and may be copied from.
pub const COVERED: u8 = 128;

/// More than the diagonal of the largest texture: larger margins are no different.
pub(super) const LARGEST_MARGIN: u32 = 23_171;

/// For each texel of rows `rows` the index (row times width plus column) of the nearest covered
/// texel of the picture at a distance of at most `margin` texels, the lowest index on ties, or
/// [`NONE`]. A covered texel is its own.
///
/// `coverage` is the whole picture; texels from [`COVERED`] on are covered. The texture does not
/// wrap here. Time O(margin) per uncovered texel; 4 bytes per texel of the rows and of `margin`
/// more on either side.
pub fn pad_seams(coverage: &[u8], width: usize, rows: std::ops::Range<usize>, margin: u32, nearest: &mut Vec<u32>) {
    let height = coverage.len().checked_div(width).unwrap_or(0);
    let margin = margin.min(LARGEST_MARGIN);
    let columns = nearest_in_columns(coverage, width, height, &rows, margin);
    nearest.clear();
    nearest.resize(rows.len() * width, NONE);
    nearest.par_chunks_mut(width.max(1)).enumerate().for_each(|(r, out)| {
        let y = rows.start + r;
        let column = &columns[r * width..(r + 1) * width];
        for (x, out) in out.iter_mut().enumerate() {
            *out = nearest_in_row(column, x, y, width, margin);
        }
    });
}

/// Row distance to the nearest covered texel of the same column, negative upwards (taken on ties);
/// [`FAR`] beyond the margin.
fn nearest_in_columns(
    coverage: &[u8],
    width: usize,
    height: usize,
    rows: &std::ops::Range<usize>,
    margin: u32,
) -> Vec<i32> {
    let mut out = vec![FAR; rows.len() * width];
    let margin = (margin as usize).min(height);
    // Strips of columns are independent.
    const STRIP: usize = 256;
    let strips: Vec<(usize, Vec<i32>)> = (0..width.div_ceil(STRIP))
        .into_par_iter()
        .map(|s| {
            let (x0, x1) = (s * STRIP, ((s + 1) * STRIP).min(width));
            let w = x1 - x0;
            let mut strip = vec![FAR; rows.len() * w];
            let mut last = vec![FAR; w];
            for y in rows.start.saturating_sub(margin)..rows.end {
                for (last, &c) in last.iter_mut().zip(&coverage[y * width + x0..y * width + x1]) {
                    *last = if c >= COVERED { 0 } else { (*last + 1).min(FAR) };
                }
                if y >= rows.start {
                    let row = &mut strip[(y - rows.start) * w..(y - rows.start + 1) * w];
                    for (out, &d) in row.iter_mut().zip(&last) {
                        *out = if d as usize <= margin { -d } else { FAR };
                    }
                }
            }
            last.fill(FAR);
            for y in (rows.start..(rows.end + margin).min(height)).rev() {
                for (last, &c) in last.iter_mut().zip(&coverage[y * width + x0..y * width + x1]) {
                    *last = if c >= COVERED { 0 } else { (*last + 1).min(FAR) };
                }
                if y < rows.end {
                    let row = &mut strip[(y - rows.start) * w..(y - rows.start + 1) * w];
                    for (out, &d) in row.iter_mut().zip(&last) {
                        if d as usize <= margin && d < out.abs() {
                            *out = d;
                        }
                    }
                }
            }
            (x0, strip)
        })
        .collect();
    for (x0, strip) in strips {
        let w = strip.len() / rows.len().max(1);
        for (out, row) in out.chunks_exact_mut(width).zip(strip.chunks_exact(w.max(1))) {
            out[x0..x0 + w].copy_from_slice(row);
        }
    }
    out
}

/// No covered texel near; larger than any distance in a picture.
const FAR: i32 = 1 << 20;

/// The nearest covered texel from the nearest ones of the columns around `x`.
fn nearest_in_row(column: &[i32], x: usize, y: usize, width: usize, margin: u32) -> u32 {
    if column[x] == 0 {
        return (y * width + x) as u32;
    }
    let reach = i64::from(margin) * i64::from(margin);
    let mut best = (reach + 1, usize::MAX);
    let mut consider = |cx: usize, dx: i64| {
        let dy = column[cx];
        if dy != FAR {
            let distance = dx * dx + i64::from(dy) * i64::from(dy);
            best = best.min((distance, (y as i64 + i64::from(dy)) as usize * width + cx));
        }
        best.0
    };
    let mut limit = consider(x, 0);
    for dx in 1..=margin as usize {
        if (dx * dx) as i64 > limit.min(reach) || (dx > x && x + dx >= width) {
            break;
        }
        if dx <= x {
            limit = consider(x - dx, dx as i64);
        }
        if x + dx < width {
            limit = consider(x + dx, dx as i64);
        }
    }
    if best.0 <= reach { best.1 as u32 } else { NONE }
}
