//! Pixels of a picture and the units of a cage.

use glam::{DMat2, DVec2};

use crate::geometry::Polygon;

/// How the pixels of a picture lie in the units of a cage: `units = pixels * scale + offset`, by
/// component. The centres of pixels are at halves, row 0 is the top.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    scale: DVec2,
    offset: DVec2,
}

impl Placement {
    /// The cage counts pixels: x to the right, y down, from the upper left corner.
    pub fn pixels() -> Self {
        Self { scale: DVec2::ONE, offset: DVec2::ZERO }
    }

    /// The cage counts `unit` pixels as one: x to the right, y up, from the lower left corner of a
    /// picture of `height` rows.
    pub fn upward(unit: u32, height: u32) -> Self {
        let unit = f64::from(unit.max(1));
        Self { scale: DVec2::new(1.0, -1.0) / unit, offset: DVec2::new(0.0, f64::from(height) / unit) }
    }

    /// The rectangle from `low` to `high` fills a picture of `size` pixels as well as it fits,
    /// `margin` pixels apart from its sides; y up.
    pub fn fitting(low: DVec2, high: DVec2, size: [u32; 2], margin: f64) -> Self {
        let size = DVec2::new(f64::from(size[0]), f64::from(size[1]));
        let room = (size - 2.0 * margin).max(DVec2::ONE);
        let unit = ((high - low) / room).max_element().max(f64::MIN_POSITIVE);
        let middle = (low + high) * 0.5;
        let scale = DVec2::new(unit, -unit);
        Self { scale, offset: middle - size * 0.5 * scale }
    }

    /// The same place for a picture of a part of this one: that from its pixel `corner` on, at
    /// `factor` times the resolution.
    #[must_use]
    pub fn part(self, corner: DVec2, factor: f64) -> Self {
        Self { scale: self.scale / factor, offset: self.offset + corner * self.scale }
    }

    /// From pixels.
    pub fn to_units(&self, p: DVec2) -> DVec2 {
        p * self.scale + self.offset
    }

    /// Into pixels.
    pub fn to_pixels(&self, p: DVec2) -> DVec2 {
        (p - self.offset) / self.scale
    }

    /// The derivative of a map in pixels, from this placement's picture to one placed by `image`,
    /// given it in units.
    pub fn derivative(&self, image: &Self, units: DMat2) -> DMat2 {
        DMat2::from_diagonal(image.scale.recip()) * units * DMat2::from_diagonal(self.scale)
    }

    /// The loops of a polygon in pixels.
    pub fn loops(&self, polygon: &Polygon) -> Vec<Vec<DVec2>> {
        polygon.loops().iter().map(|ring| ring.iter().map(|p| self.to_pixels(*p)).collect()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_are_where_they_are_said_to_be() {
        let unit = Placement::upward(200, 200);
        assert_eq!(unit.to_units(DVec2::new(0.0, 200.0)), DVec2::ZERO);
        assert_eq!(unit.to_units(DVec2::new(300.0, 0.0)), DVec2::new(1.5, 1.0));
        let fitting = Placement::fitting(DVec2::new(-1.0, 0.0), DVec2::new(1.0, 1.0), [220, 400], 10.0);
        assert!(fitting.to_pixels(DVec2::new(-1.0, 0.5)).distance(DVec2::new(10.0, 200.0)) < 1e-9);
        assert!(fitting.to_pixels(DVec2::new(1.0, 1.0)).distance(DVec2::new(210.0, 150.0)) < 1e-9);
        for p in [DVec2::new(12.5, 70.25), DVec2::new(-3.0, 900.0)] {
            for placement in [unit, Placement::pixels(), Placement::upward(50, 120)] {
                assert!(placement.to_pixels(placement.to_units(p)).distance(p) < 1e-9);
            }
        }
    }

    #[test]
    fn a_part_shows_what_is_there() {
        let (whole, corner) = (Placement::upward(50, 120), DVec2::new(20.0, 30.0));
        let part = whole.part(corner, 0.25);
        for p in [DVec2::ZERO, DVec2::new(3.5, 7.0)] {
            assert!(part.to_units(p).distance(whole.to_units(corner + p * 4.0)) < 1e-12);
        }
    }

    #[test]
    fn derivatives_follow_the_chain_rule() {
        let (a, b) = (Placement::upward(200, 200), Placement::upward(100, 400));
        let m = DMat2::from_cols(DVec2::new(1.0, 0.5), DVec2::new(-0.25, 2.0));
        let map = |p: DVec2| b.to_pixels(m * a.to_units(p));
        let d = a.derivative(&b, m);
        let p = DVec2::new(40.0, 60.0);
        assert!((map(p + DVec2::X) - map(p)).distance(d.x_axis) < 1e-9);
        assert!((map(p + DVec2::Y) - map(p)).distance(d.y_axis) < 1e-9);
    }
}
