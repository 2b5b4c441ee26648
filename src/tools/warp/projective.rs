//! A picture of a plane seen from elsewhere: four corners go to four others, and straight lines
//! stay straight.

use glam::{DMat2, DMat3, DVec2, DVec3};
use rayon::prelude::*;

use super::band::Place;
use super::cover::pixel_cover;
use super::driver::{WarpOptions, WarpOutput, WarpStats, bands, prepared};
use super::footprint::{Footprints, Setter};
use super::pyramid::Pyramid;
use super::sight::{Look, footprint};
use super::store::{Colors, Outside, gather_and_store};
use crate::control;
use crate::error::{Error, Result};
use crate::picture::Image;
use crate::progress::Progress;

/// The map `p -> (A p + b) / (c . p + d)` of the plane that takes four corners to four others.
#[doc(hidden)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projective {
    matrix: DMat3,
}

impl Projective {
    /// The map that takes `from` to `to`, corner by corner in their order around.
    ///
    /// By way of the unit square (Heckbert, Fundamentals of Texture Mapping and Image Warping,
    /// 1989, section 2.2.3).
    ///
    /// # Errors
    /// [`Error::Input`] unless both are convex: the map is one-to-one between convex quadrilaterals
    /// alone.
    pub fn between(from: [DVec2; 4], to: [DVec2; 4]) -> Result<Self> {
        for (name, corners) in [("source", from), ("target", to)] {
            if !is_convex(corners) {
                let what = format!("the four corners of the {name} are not those of a convex quadrilateral");
                return Err(Error::input(what, "Give them in their order around, none inside the others"));
            }
        }
        let matrix = of_square(to) * of_square(from).inverse();
        // The horizon lies on no side of what is mapped: with this sign, its denominator is
        // positive.
        let middle = matrix * (from.iter().sum::<DVec2>() / 4.0).extend(1.0);
        if !(middle.is_finite() && middle.z != 0.0) {
            return Err(Error::numeric("the four corners determine no map", "Move corners apart that nearly coincide"));
        }
        Ok(Self { matrix: matrix * middle.z.signum() })
    }

    /// The image of a point and the derivative there; `None` on the horizon and beyond.
    pub fn map(&self, p: DVec2) -> Option<(DVec2, DMat2)> {
        let h = self.matrix * p.extend(1.0);
        if !(h.z > 0.0) {
            return None;
        }
        let image = h.truncate() / h.z;
        let column = |k: usize| {
            let d = self.matrix.col(k);
            (d.truncate() - image * d.z) / h.z
        };
        Some((image, DMat2::from_cols(column(0), column(1))))
    }
}

/// Whether the corners turn the same way at each.
fn is_convex(corners: [DVec2; 4]) -> bool {
    let turn = |k: usize| {
        let [a, b, c] = [0, 1, 2].map(|i| corners[(k + i) % 4]);
        (b - a).perp_dot(c - b)
    };
    let turns = [0, 1, 2, 3].map(turn);
    turns.iter().all(|t| *t > 0.0) || turns.iter().all(|t| *t < 0.0)
}

/// The map of the square (0, 0), (1, 0), (1, 1), (0, 1) to these corners.
fn of_square(corners: [DVec2; 4]) -> DMat3 {
    let [p0, p1, p2, p3] = corners;
    let (s, d1, d2) = (p0 - p1 + p2 - p3, p1 - p2, p3 - p2);
    let area = d1.perp_dot(d2);
    let (g, h) = (s.perp_dot(d2) / area, d1.perp_dot(s) / area);
    let (x, y) = (p1 - p0 + g * p1, p3 - p0 + h * p3);
    DMat3::from_cols(x.extend(g), y.extend(h), DVec3::new(p0.x, p0.y, 1.0))
}

/// Warps `image` so that the corners `source`, in the units of `options.source`, come to lie on
/// `target`. On the CPU; O(pixels).
///
/// # Errors
/// As [`Projective::between`] and [`super::warp_picture`].
pub fn warp_projective(
    image: &Image,
    [source, target]: [[DVec2; 4]; 2],
    options: &WarpOptions,
    progress: &dyn Progress,
) -> Result<WarpOutput> {
    let backward = Projective::between(target, source)?;
    let ([width, height], memory) = prepared(image, options)?;
    let pyramid = Pyramid::new(image, options.encoding)?;
    let alpha = options.outside == Outside::Transparent && !image.has_alpha();
    let mut out = Image::zeros(width, height, image.channels + u32::from(alpha), image.depth())?;
    let mut jacobian = options.jacobian.then(|| Vec::with_capacity(width as usize * height as usize));
    let pixels = u64::from(width) * u64::from(height);
    let mut stats = WarpStats { pixels, memory, ..WarpStats::default() };
    let corners = vec![target.map(|p| options.target.to_pixels(p)).to_vec()];
    let picture = [image.width, image.height];
    let look = |x: usize, y: usize| {
        let p = options.target.to_units(DVec2::new(x as f64 + 0.5, y as f64 + 0.5));
        let (at, derivative) = backward.map(p)?;
        let d = options.target.derivative(&options.source, derivative);
        Some(Look { at: options.source.to_pixels(at), dx: d.x_axis, dy: d.y_axis })
    };
    progress.stage("pixels", pixels);
    let mut seen = Footprints::default();
    for band in bands(width, height) {
        control::check()?;
        let cover = match options.outside {
            Outside::Map => Vec::new(),
            _ => pixel_cover(&corners, band.width, band.first, band.rows),
        };
        seen.reset(band.len(), options.filter.averages());
        let places = band.places();
        let setters = seen.parts(places.iter().map(|p| p.width * p.height));
        let block = |place: &Place, mut setter: Setter<'_>| {
            let middle = look(place.x + place.width / 2, band.first + place.y + place.height / 2);
            let base = middle.map_or(DVec2::ZERO, |l| l.at).clamp(DVec2::splat(-1e9), DVec2::splat(1e9)).floor();
            let all = (0..place.height).flat_map(|y| (0..place.width).map(move |x| (place.x + x, place.y + y)));
            let (mut mapped, mut empty) = (0, 0);
            for (k, (x, y)) in all.enumerate() {
                let share = cover.get(y * band.width + x).copied().unwrap_or(1.0);
                if let Some(look) = look(x, band.first + y).filter(|_| share > 0.0) {
                    mapped += 1;
                    setter.set(k, footprint(picture, &look, base, share));
                }
                empty += u64::from(setter.cover[k] == 0.0 && share > 0.0);
            }
            ([base.x as i32, base.y as i32], mapped, empty)
        };
        let blocks: Vec<([i32; 2], u64, u64)> = places.par_iter().zip(setters).map(|(p, s)| block(p, s)).collect();
        let bases: Vec<[i32; 2]> = blocks.iter().map(|b| b.0).collect();
        stats.mapped += blocks.iter().map(|b| b.1).sum::<u64>();
        stats.empty += blocks.iter().map(|b| b.2).sum::<u64>();
        if let Some(jacobian) = &mut jacobian {
            let all = (0..band.rows).flat_map(|y| (0..band.width).map(move |x| (x, band.first + y)));
            jacobian.extend(all.map(|(x, y)| look(x, y).map_or(f32::NAN, |l| (1.0 / l.dx.perp_dot(l.dy)) as f32)));
        }
        let keep = (options.outside == Outside::Keep).then_some(cover.as_slice());
        gather_and_store(&pyramid, options.filter, &bases, &Colors { band, seen: seen.seen(), keep }, &mut out);
        progress.advance(band.len() as u64);
    }
    Ok(WarpOutput { image: out, jacobian, stats })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::Filter;
    use crate::picture::Pixels;
    use crate::progress::Quiet;

    const SQUARE: [DVec2; 4] = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y];

    fn tilted() -> [DVec2; 4] {
        [DVec2::new(10.0, 20.0), DVec2::new(90.0, 5.0), DVec2::new(70.0, 80.0), DVec2::new(25.0, 60.0)]
    }

    #[test]
    fn corners_go_to_corners_and_lines_to_lines() {
        for (from, to) in [(SQUARE, tilted()), (tilted(), SQUARE), (tilted(), [3, 2, 1, 0].map(|k| tilted()[k]))] {
            let map = Projective::between(from, to).unwrap();
            for (p, q) in from.into_iter().zip(to) {
                assert!(map.map(p).unwrap().0.distance(q) < 1e-9);
            }
            let (a, b) = (from[0].lerp(from[1], 0.3), from[2].lerp(from[3], 0.8));
            let [p, q, r] = [0.0, 0.4, 1.0].map(|t| map.map(a.lerp(b, t)).unwrap().0);
            assert!((q - p).perp_dot(r - p).abs() < 1e-9 * (r - p).length_squared());
            // The derivative is that of the map.
            let (at, step) = (a.lerp(b, 0.5), 1e-6);
            let (image, d) = map.map(at).unwrap();
            for (k, axis) in [DVec2::X, DVec2::Y].into_iter().enumerate() {
                let difference = (map.map(at + axis * step).unwrap().0 - image) / step;
                assert!(difference.distance(d.col(k)) < 1e-4 * (1.0 + d.col(k).length()), "{difference} {d}");
            }
        }
        // The horizon of this one is the line x = 2.
        let map = Projective::between(SQUARE, [DVec2::ZERO, DVec2::new(1.0, 0.0), DVec2::new(1.0, 2.0), DVec2::Y]);
        assert!(map.unwrap().map(DVec2::new(2.5, 0.0)).is_none());
        for corners in [[SQUARE[0], SQUARE[2], SQUARE[1], SQUARE[3]], [DVec2::ZERO; 4]] {
            assert!(Projective::between(corners, SQUARE).is_err() && Projective::between(SQUARE, corners).is_err());
        }
    }

    #[test]
    fn a_picture_turned_by_its_corners_is_the_turned_picture() {
        let samples = (0..64 * 48 * 3).map(|i| (i * 7 % 251) as u8).collect();
        let image = Image::new(64, 48, 3, Pixels::U8(samples)).unwrap();
        let [w, h] = [64.0, 48.0];
        let corners = [DVec2::ZERO, DVec2::new(w, 0.0), DVec2::new(w, h), DVec2::new(0.0, h)];
        let half_turn = [corners[2], corners[3], corners[0], corners[1]];
        let options = WarpOptions { filter: Filter::Bilinear, ..WarpOptions::default() };
        let turned = warp_projective(&image, [corners, half_turn], &options, &Quiet).unwrap().image;
        for (x, y) in [(0, 0), (5, 40), (63, 47), (31, 3)] {
            for c in 0..3 {
                assert_eq!(turned.get(x, y, c), image.get(63 - x, 47 - y, c), "{x} {y}");
            }
        }
        assert_ne!(turned, image, "the comparison can fail");
    }
}
