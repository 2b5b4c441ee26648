//! Where a polygon is, how large and how turned.

use glam::DVec2;

use crate::geometry::polygon::{barycentre, signed_area};

/// Where a polygon is, how large and how turned, by its outermost loop.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placement {
    pub(super) centre: DVec2,
    /// Square root of the area.
    pub(super) scale: f64,
    pub(super) angle: f64,
}

impl Placement {
    pub(super) fn of(ring: &[DVec2]) -> Self {
        Self { centre: barycentre(ring), scale: signed_area(ring).abs().sqrt(), angle: 0.0 }
    }

    /// A point of the polygon as it is about the origin, with an area of 1 and not turned.
    pub(super) fn normal(&self, v: DVec2) -> DVec2 {
        DVec2::from_angle(-self.angle).rotate(v - self.centre) / self.scale
    }

    /// The inverse of [`Placement::normal`].
    pub(super) fn place(&self, v: DVec2) -> DVec2 {
        self.centre + DVec2::from_angle(self.angle).rotate(v) * self.scale
    }
}
