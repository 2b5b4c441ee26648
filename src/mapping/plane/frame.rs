//! Where single precision keeps its digits: polygons about their own centre, at one scale.

use glam::DVec2;

use crate::engine::Real;
use crate::geometry::Polygon;

/// Local coordinates of one polygon: `(p - origin) * scale`.
///
/// The origin is the centre of the polygon's bounding box; the scale is common to all polygons of a composite map, so that a
/// step goes from one frame to the next with no conversion: its displacements are differences of local coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// The point with local coordinates 0.
    pub origin: DVec2,
    /// Local units in one unit of the file.
    pub scale: f64,
}

impl Frame {
    /// The frame of `polygon` at `scale`.
    pub fn of(polygon: &Polygon, scale: f64) -> Self {
        Self { origin: polygon.centre(), scale }
    }

    /// The scale that brings the largest of the polygons to the size 1. A power of two: scaling is exact.
    pub fn common_scale<'a>(polygons: impl IntoIterator<Item = &'a Polygon>) -> f64 {
        let size = polygons.into_iter().map(Polygon::size).fold(0.0, f64::max);
        if size > 0.0 && size.is_finite() { (-size.log2().ceil()).exp2() } else { 1.0 }
    }

    /// Into local coordinates, rounded to `R` at the end.
    pub fn local<R: Real>(&self, p: DVec2) -> [R; 2] {
        let q = (p - self.origin) * self.scale;
        [R::of(q.x), R::of(q.y)]
    }

    /// Back from local coordinates.
    pub fn world<R: Real>(&self, q: [R; 2]) -> DVec2 {
        DVec2::new(q[0].to_f64(), q[1].to_f64()) / self.scale + self.origin
    }
}
