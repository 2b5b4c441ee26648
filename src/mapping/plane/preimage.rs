//! Where pixels come from: a lattice's images rasterised over a canvas.

use std::ops::Range;

use glam::{DVec2, UVec2};
use rayon::prelude::*;

use super::lattice::Lattice;

/// Rows that one task fills.
const BAND: usize = 16;

/// Pixels whose centre lies this far outside a triangle still belong to it, so that none is lost
/// between neighbours to rounding.
pub(super) const SLACK: f64 = 1e-6;

/// Approximate pre-images of the pixel centres of a window of the canvas, row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct Preimages {
    /// Columns and rows.
    pub size: UVec2,
    /// Points of the source.
    pub points: Vec<[f32; 2]>,
    /// Whether a triangle of the lattice covers the pixel; its point means nothing otherwise.
    pub covered: Vec<bool>,
}

impl Preimages {
    /// The pixels of the window with its top left corner at `origin`, in the units of the lattice,
    /// which are pixels; pixel (x, y) has its centre at `origin + (x + 1/2, y + 1/2)`.
    ///
    /// Linear in each triangle. Where triangles overlap, as they do where a map folds, the later
    /// one is taken. O(pixels + triangles), parallel over rows.
    pub fn of(lattice: &Lattice, origin: DVec2, size: UVec2) -> Self {
        let mut found = vec![None; size.x as usize * size.y as usize];
        fill_window(lattice, origin, size, &mut found, |run, start, step| {
            for (k, found) in run.iter_mut().enumerate() {
                *found = Some((start + step * k as f64).as_vec2().to_array());
            }
        });
        let covered = found.iter().map(Option::is_some).collect();
        Self { size, points: found.into_iter().map(Option::unwrap_or_default).collect(), covered }
    }
}

/// Sets each pixel of the window of [`Preimages::of`] that a triangle of the lattice covers; `out`
/// has `size.x * size.y` pixels. `set` takes pixels that follow one another in a row, the pre-image
/// of the first one, and the step from each pre-image to the next.
pub(crate) fn fill_window<T: Send>(
    lattice: &Lattice,
    origin: DVec2,
    size: UVec2,
    out: &mut [T],
    set: impl Fn(&mut [T], DVec2, DVec2) + Sync,
) {
    let (width, height) = (size.x as usize, size.y as usize);
    let mut bands = vec![Vec::new(); height.div_ceil(BAND)];
    for (i, t) in lattice.triangles.iter().enumerate() {
        let y = t.map(|v| lattice.images[v as usize].y - origin.y - 0.5);
        let (low, high) = (y[0].min(y[1]).min(y[2]) - SLACK, y[0].max(y[1]).max(y[2]) + SLACK);
        // Casts saturate, and turn NaN into 0; fill() looks again.
        let (first, last) = (ceil(low).max(0) as usize, floor(high));
        if last >= 0 && first < height {
            let last = (last as usize).min(height - 1);
            bands[first / BAND..=last / BAND].iter_mut().for_each(|b| b.push(i as u32));
        }
    }
    let rows = BAND * width.max(1);
    out.par_chunks_mut(rows).zip(bands).enumerate().for_each(|(band, (out, triangles))| {
        for i in triangles {
            let t = lattice.triangles[i as usize];
            let corner = DVec2::new(0.5, 0.5 + (band * BAND) as f64) + origin;
            let image = t.map(|v| lattice.images[v as usize] - corner);
            let source = t.map(|v| lattice.points[v as usize]);
            fill(image, source, width, out.len(), |run, start, step| set(&mut out[run], start, step));
        }
    });
}

/// The pixels of some rows inside one triangle, `count` in all; its images are relative to the
/// centre of the first of them. `set` takes the numbers of pixels that follow one another in a row,
/// the pre-image of the first one, and the step from each pre-image to the next.
pub(super) fn fill(
    q: [DVec2; 3],
    p: [DVec2; 3],
    width: usize,
    count: usize,
    mut set: impl FnMut(Range<usize>, DVec2, DVec2),
) {
    let twice = (q[1] - q[0]).perp_dot(q[2] - q[0]);
    if !(twice.abs() > f64::MIN_POSITIVE && twice.is_finite()) {
        return;
    }
    // The pre-image is affine in the pixel: p = p0 + a x + b y.
    let (e1, e2) = (q[1] - q[0], q[2] - q[0]);
    let (d1, d2) = (p[1] - p[0], p[2] - p[0]);
    let a = (d1 * e2.y - d2 * e1.y) / twice;
    let b = (d2 * e1.x - d1 * e2.x) / twice;
    let (rows, sides) = ((count / width.max(1)) as f64, Sides::new(q));
    let (first_row, last_row) = (ceil(sides.top.y - SLACK).max(0), floor((sides.bottom.y + SLACK).min(rows - 1.0)));
    for row in first_row..=last_row {
        let y = row as f64;
        let (left, right) = sides.chord(y);
        let first = ceil((left - SLACK).max(0.0));
        let end = floor((right + SLACK).min(width as f64 - 1.0));
        if first <= end {
            let start = p[0] + a * (first as f64 - q[0].x) + b * (y - q[0].y);
            let at = row as usize * width;
            set(at + first as usize..at + end as usize + 1, start, a);
        }
    }
}

/// The least whole number that is not below `x`. Calls of `f64::ceil` are calls of a function on
/// processors of the first 64 bits, and there are two a row of each triangle.
#[inline(always)]
fn ceil(x: f64) -> i64 {
    let whole = x as i64;
    whole + i64::from((whole as f64) < x)
}

/// The largest whole number that is not above `x`.
#[inline(always)]
fn floor(x: f64) -> i64 {
    let whole = x as i64;
    whole - i64::from((whole as f64) > x)
}

/// A triangle by its rising rows.
struct Sides {
    top: DVec2,
    middle: DVec2,
    bottom: DVec2,
    /// Step in x for one in y, from top to bottom, to the middle, and from there.
    long: f64,
    upper: Option<f64>,
    lower: Option<f64>,
    /// No two corners differ by more than the slack.
    flat: bool,
}

impl Sides {
    #[inline(always)]
    fn new(q: [DVec2; 3]) -> Self {
        let [mut top, mut middle, mut bottom] = q;
        if middle.y < top.y {
            (top, middle) = (middle, top);
        }
        if bottom.y < middle.y {
            (middle, bottom) = (bottom, middle);
        }
        if middle.y < top.y {
            (top, middle) = (middle, top);
        }
        let slope = |a: DVec2, b: DVec2| (b.y - a.y > SLACK).then(|| (b.x - a.x) / (b.y - a.y));
        let long = slope(top, bottom);
        let (upper, lower) = (slope(top, middle), slope(middle, bottom));
        Self { top, middle, bottom, long: long.unwrap_or(0.0), upper, lower, flat: long.is_none() }
    }

    /// Where a row crosses the triangle, from left to right; a row outside has the corner next to
    /// it.
    #[inline(always)]
    fn chord(&self, y: f64) -> (f64, f64) {
        let Self { top, middle, bottom, .. } = *self;
        if self.flat {
            return (top.x.min(middle.x).min(bottom.x), top.x.max(middle.x).max(bottom.x));
        }
        let y = y.clamp(top.y, bottom.y);
        let long = top.x + (y - top.y) * self.long;
        // A side along a row is crossed at its other end, the long side being at its first.
        let short = if y <= middle.y {
            self.upper.map_or(middle.x, |k| top.x + (y - top.y) * k)
        } else {
            self.lower.map_or(middle.x, |k| middle.x + (y - middle.y) * k)
        };
        (long.min(short), long.max(short))
    }
}

#[cfg(test)]
mod tests {
    use super::super::lattice::LatticeOptions;
    use super::*;

    fn lattice(map: impl Fn(DVec2) -> DVec2) -> Lattice {
        Lattice::new(DVec2::ZERO, DVec2::new(64.0, 48.0), &LatticeOptions::default(), |p| {
            Ok(p.iter().map(|p| map(*p)).collect())
        })
        .unwrap()
    }

    fn worst(found: &Preimages, origin: DVec2, truth: impl Fn(DVec2) -> DVec2) -> f64 {
        let mut most = 0.0;
        for (i, p) in found.points.iter().enumerate() {
            if found.covered[i] {
                let pixel =
                    DVec2::new((i % found.size.x as usize) as f64, (i / found.size.x as usize) as f64) + 0.5 + origin;
                most = f64::max(most, (truth(pixel) - DVec2::new(f64::from(p[0]), f64::from(p[1]))).length());
            }
        }
        most
    }

    #[test]
    fn affine_maps_are_inverted_and_every_pixel_is_covered() {
        // Turned and sheared, so that edges cross rows at all angles; the window lies within the
        // image.
        let map = |p: DVec2| DVec2::new(1.3 * p.x - 0.4 * p.y, 0.2 * p.x + 0.9 * p.y) + DVec2::new(20.0, 0.0);
        let back = |q: DVec2| {
            let d = q - DVec2::new(20.0, 0.0);
            DVec2::new(0.9 * d.x + 0.4 * d.y, -0.2 * d.x + 1.3 * d.y) / 1.25
        };
        let origin = DVec2::new(20.0, 12.0);
        let found = Preimages::of(&lattice(map), origin, UVec2::new(40, 30));
        assert!(found.covered.iter().all(|c| *c));
        assert!(worst(&found, origin, back) < 1e-5);
        assert!(worst(&found, origin + 1.0, back) > 0.5, "the measure sees a shift");
    }

    #[test]
    fn pixels_outside_stay_uncovered_and_reflections_are_filled() {
        let found =
            Preimages::of(&lattice(|p| DVec2::new(40.0 - p.x, p.y)), DVec2::new(-10.0, -5.0), UVec2::new(100, 80));
        for (i, c) in found.covered.iter().enumerate() {
            let q = DVec2::new((i % 100) as f64 - 9.5, (i / 100) as f64 - 4.5);
            assert_eq!(*c, q.x >= -24.0 && q.x <= 40.0 && q.y >= 0.0 && q.y <= 48.0, "{q}");
        }
        assert!(worst(&found, DVec2::new(-10.0, -5.0), |q| DVec2::new(40.0 - q.x, q.y)) < 1e-5);
    }

    #[test]
    fn images_that_are_not_numbers_cover_nothing() {
        let none = Preimages::of(&lattice(|_| DVec2::NAN), DVec2::ZERO, UVec2::new(8, 8));
        assert!(none.covered.iter().all(|c| !c));
        let far = Preimages::of(&lattice(|p| p * 1e300), DVec2::ZERO, UVec2::new(8, 8));
        assert_eq!(far.points.len(), 64);
        assert_eq!(Preimages::of(&lattice(|p| p), DVec2::ZERO, UVec2::ZERO).points.len(), 0);
    }
}
