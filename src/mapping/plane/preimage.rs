//! Where pixels come from: a lattice's images rasterised over a canvas.

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
        fill_window(lattice, origin, size, &mut found, |p| Some(p.as_vec2().to_array()));
        let covered = found.iter().map(Option::is_some).collect();
        Self { size, points: found.into_iter().map(Option::unwrap_or_default).collect(), covered }
    }
}

/// Sets each pixel of the window of [`Preimages::of`] that a triangle of the lattice covers to the
/// value of its pre-image; `out` has `size.x * size.y` pixels.
pub(crate) fn fill_window<T: Send>(
    lattice: &Lattice,
    origin: DVec2,
    size: UVec2,
    out: &mut [T],
    value: impl Fn(DVec2) -> T + Sync,
) {
    let (width, height) = (size.x as usize, size.y as usize);
    let mut bands = vec![Vec::new(); height.div_ceil(BAND)];
    for (i, t) in lattice.triangles.iter().enumerate() {
        let y = t.map(|v| lattice.images[v as usize].y - origin.y - 0.5);
        let (low, high) = (y[0].min(y[1]).min(y[2]) - SLACK, y[0].max(y[1]).max(y[2]) + SLACK);
        // Casts saturate, and turn NaN into 0; fill() looks again.
        let (first, last) = (low.ceil().max(0.0) as usize, high.floor());
        if last >= 0.0 && first < height {
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
            fill(image, source, width, out.len(), |i, here| out[i] = value(here));
        }
    });
}

/// The pixels of some rows inside one triangle, `count` in all; its images are relative to the
/// centre of the first of them. `set` takes the number of a pixel and its pre-image.
pub(super) fn fill(q: [DVec2; 3], p: [DVec2; 3], width: usize, count: usize, mut set: impl FnMut(usize, DVec2)) {
    let twice = (q[1] - q[0]).perp_dot(q[2] - q[0]);
    if !(twice.abs() > f64::MIN_POSITIVE && twice.is_finite()) {
        return;
    }
    // The pre-image is affine in the pixel: p = p0 + a x + b y.
    let (e1, e2) = (q[1] - q[0], q[2] - q[0]);
    let (d1, d2) = (p[1] - p[0], p[2] - p[0]);
    let a = (d1 * e2.y - d2 * e1.y) / twice;
    let b = (d2 * e1.x - d1 * e2.x) / twice;
    let rows = count / width.max(1);
    let (low, high) = (q[0].y.min(q[1].y).min(q[2].y) - SLACK, q[0].y.max(q[1].y).max(q[2].y) + SLACK);
    let last = high.floor().min(rows as f64 - 1.0);
    let mut y = low.ceil().max(0.0);
    while y <= last {
        // The chord of the triangle at this row: where its edges cross it.
        let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
        for (s, t) in [(q[0], q[1]), (q[1], q[2]), (q[2], q[0])] {
            let (s, t) = if s.y <= t.y { (s, t) } else { (t, s) };
            if y < s.y - SLACK || y > t.y + SLACK {
                continue;
            }
            let rise = t.y - s.y;
            if rise > SLACK {
                let x = s.x + (t.x - s.x) * ((y - s.y) / rise).clamp(0.0, 1.0);
                (left, right) = (left.min(x), right.max(x));
            } else {
                (left, right) = (left.min(s.x.min(t.x)), right.max(s.x.max(t.x)));
            }
        }
        let first = (left - SLACK).ceil().max(0.0);
        let end = (right + SLACK).floor().min(width as f64 - 1.0);
        if first <= end {
            let (first, end) = (first as usize, end as usize);
            let start = p[0] + a * (first as f64 - q[0].x) + b * (y - q[0].y);
            let at = y as usize * width;
            for (k, i) in (at + first..=at + end).enumerate() {
                set(i, start + a * k as f64);
            }
        }
        y += 1.0;
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
