//! Pictures about a warp: the Jacobian, a lattice carried along, both polygons.

use glam::DVec2;

use super::draw::Canvas;
use super::placement::Placement;
use crate::engine::Engine;
use crate::error::Result;
use crate::mapping::plane::CompositeMap;
use crate::picture::Image;

/// Width of the scale beside a picture of the Jacobian, in pixels.
pub const SCALE_WIDTH: u32 = 72;
/// Colours from the smallest Jacobian to the largest on a logarithmic scale; white is 1, where
/// areas stay.
const COLORS: [[f64; 3]; 5] =
    [[15.0, 45.0, 120.0], [75.0, 145.0, 205.0], [255.0, 255.0, 255.0], [240.0, 150.0, 70.0], [140.0, 20.0, 20.0]];
/// Where the map folds.
const FOLD: [u8; 3] = [255, 0, 255];
/// Lines of a lattice.
const LINE: [u8; 3] = [60, 60, 60];
/// Where there is no Jacobian.
const NOTHING: [u8; 3] = [205, 205, 205];
/// The source polygon of an overlay.
#[doc(hidden)]
pub const SOURCE_COLOR: [u8; 3] = [30, 110, 230];
/// The target polygon.
#[doc(hidden)]
pub const TARGET_COLOR: [u8; 3] = [225, 40, 40];

/// A picture of Jacobians, `width` to a row: logarithmic, from blue (shrunk) through white (1) to
/// red (stretched); folds are magenta, places without a value grey. The scale on the right covers
/// the powers of two that 99.5 % of the pixels need.
///
/// # Errors
/// If there are no pixels.
pub fn heat_map(jacobian: &[f32], width: u32) -> Result<Image> {
    let height = jacobian.len() as u32 / width.max(1);
    let mut powers: Vec<f32> = jacobian.iter().filter(|j| **j > 0.0 && j.is_finite()).map(|j| j.log2().abs()).collect();
    // A few extreme pixels, at vertices, must not turn all others white.
    let rank = powers.len() * 199 / 200;
    let most = if powers.is_empty() { 1.0 } else { *powers.select_nth_unstable_by(rank, f32::total_cmp).1 };
    let most = f64::from(most).ceil().clamp(1.0, 6.0);
    let mut canvas = Canvas::new(width + SCALE_WIDTH, height, [255; 3]);
    for (k, &j) in jacobian.iter().enumerate() {
        let color = if j.is_nan() {
            NOTHING
        } else if j <= 0.0 {
            FOLD
        } else {
            heat(f64::from(j).log2() / most)
        };
        canvas.mix((k % width as usize) as i64, (k / width as usize) as i64, color, 1.0);
    }
    let (left, h) = (i64::from(width), i64::from(height));
    let (top, bottom) = (8.min(h / 4), h - 8.min(h / 4) - 1);
    for y in top..=bottom {
        let value = 1.0 - 2.0 * (y - top) as f64 / (bottom - top).max(1) as f64;
        canvas.rectangle(left + 8, y, 16, 1, heat(value));
    }
    // As many figures as there is room for.
    let step =
        (1..=most as i32).find(|s| (most as i64 * 2 / i64::from(*s)) * 16 <= bottom - top).unwrap_or(most as i32);
    for power in (-(most as i32)..=most as i32).filter(|p| p % step == 0) {
        let y = top + ((1.0 - f64::from(power) / most) * 0.5 * (bottom - top) as f64).round() as i64;
        canvas.rectangle(left + 24, y, 4, 1, [0; 3]);
        let text = if power < 0 { format!("1/{}", 1 << -power) } else { format!("{}", 1 << power) };
        canvas.figures(&text, left + 31, (y - 5).clamp(0, (h - 10).max(0)), 2, [0; 3]);
    }
    canvas.into_image()
}

/// The colour of a value from -1 to 1.
fn heat(value: f64) -> [u8; 3] {
    let at = (value.clamp(-1.0, 1.0) + 1.0) * 2.0;
    let i = (at as usize).min(3);
    let f = at - i as f64;
    std::array::from_fn(|c| (COLORS[i][c] + f * (COLORS[i + 1][c] - COLORS[i][c])).round() as u8)
}

/// The lines of a square lattice in the source polygon, `cells` along the longer side, as the map
/// carries them, magenta where it folds; on white.
///
/// # Errors
/// As the map's.
pub fn lattice_picture(
    engine: &Engine,
    map: &CompositeMap,
    target: &Placement,
    size: [u32; 2],
    cells: u32,
) -> Result<Image> {
    let (low, high) = map.source().bounds();
    let cell = (high - low).max_element() / f64::from(cells.max(1));
    let mut canvas = Canvas::new(size[0], size[1], [255; 3]);
    // Along each line finer than the distance of lines: the images are drawn as they bend.
    let fine = (512 / cells.max(1)).clamp(2, 16) as usize;
    let count = ((high - low) / cell).ceil();
    let mut lines: Vec<Vec<DVec2>> = Vec::new();
    for (along, across, n, m) in [(DVec2::X, DVec2::Y, count.x, count.y), (DVec2::Y, DVec2::X, count.y, count.x)] {
        for k in 0..=m as usize {
            let start = low + across * cell * k as f64;
            lines.push((0..=n as usize * fine).map(|i| start + along * cell * (i as f64 / fine as f64)).collect());
        }
    }
    for line in lines {
        let images = map.forward_points(engine, &line)?;
        let inside: Vec<bool> =
            line.iter().map(|p| map.source().contains(*p) != crate::geometry::Side::Outside).collect();
        for i in 1..line.len() {
            if inside[i - 1] && inside[i] {
                let ends = [i - 1, i].map(|k| target.to_pixels(images[k].point));
                let folds = images[i - 1].jacobian() <= 0.0 || images[i].jacobian() <= 0.0;
                canvas.line(ends[0], ends[1], 1.2, if folds { FOLD } else { LINE });
            }
        }
    }
    for ring in target.loops(map.target()) {
        canvas.polyline(&ring, true, 2.0, TARGET_COLOR);
    }
    canvas.into_image()
}

/// Source (blue) and target (red) polygon on a picture.
///
/// # Errors
/// If the picture's samples do not fit its size.
pub fn overlay(image: &Image, map: &CompositeMap, source: &Placement, target: &Placement) -> Result<Image> {
    let mut canvas = Canvas::of(image)?;
    let width = (f64::from(image.width.min(image.height)) / 250.0).clamp(1.5, 12.0);
    for (loops, color) in [(source.loops(map.source()), SOURCE_COLOR), (target.loops(map.target()), TARGET_COLOR)] {
        for ring in &loops {
            canvas.polyline(ring, true, width, color);
        }
        for p in loops.iter().flatten() {
            canvas.disc(*p, 1.6 * width, color);
        }
    }
    canvas.into_image()
}

/// 8-bit RGB pictures in a row on white, `gap` pixels apart.
///
/// # Errors
/// If there is no picture, or one whose samples do not fit its size.
pub fn in_a_row(pictures: &[Image], gap: u32) -> Result<Image> {
    let width = pictures.iter().map(|p| p.width + gap).sum::<u32>().saturating_sub(gap);
    let mut canvas = Canvas::new(width, pictures.iter().map(|p| p.height).max().unwrap_or(0), [255; 3]);
    let mut left = 0;
    for picture in pictures {
        canvas.paste(&Canvas::of(picture)?, left, 0);
        left += i64::from(picture.width + gap);
    }
    canvas.into_image()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_tell_shrinking_from_stretching_and_folding() {
        let values = [0.25, 1.0, 4.0, -1.0, f32::NAN, 0.0];
        let image = heat_map(&values.repeat(40), 6).unwrap();
        assert_eq!((image.width, image.height), (6 + SCALE_WIDTH, 40));
        let at = |x: u32| [0, 1, 2].map(|c| (image.get(x, 20, c) * 255.0).round() as u8);
        assert_eq!((at(1), at(3), at(4), at(5)), ([255; 3], FOLD, NOTHING, FOLD));
        assert!(at(0)[2] > at(0)[0] && at(2)[0] > at(2)[2]);
        // A scale fits any height.
        for height in [1, 2, 7, 30] {
            heat_map(&vec![1.0; 3 * height], 3).unwrap();
        }
    }
}
