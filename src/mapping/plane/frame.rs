//! Where single precision keeps its digits: polygons about their own centre, at one scale.

use glam::DVec2;

use crate::engine::Real;
use crate::geometry::Polygon;

/// Local coordinates of one polygon: `(p - vertex - middle) * scale`.
///
/// Local coordinates are 0 at the centre of the polygon's bounding box. It is told by a vertex and
/// the way from there, so that it does not round where the polygon is far away
/// ([`crate::geometry::frame`]); the scale is common to all polygons of a composite map, so that a
/// step goes from one frame to the next with no conversion: its displacements are differences of
/// local coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    vertex: DVec2,
    middle: DVec2,
    /// Local units in one unit of the file.
    pub scale: f64,
}

impl Frame {
    /// The frame of `polygon` at `scale`.
    pub fn of(polygon: &Polygon, scale: f64) -> Self {
        let vertex =
            crate::geometry::Frame::of(polygon.loops().iter().flatten().map(|v| v.extend(0.0))).origin.truncate();
        let (low, high) = polygon
            .vertices()
            .map(|v| v - vertex)
            .fold((DVec2::ZERO, DVec2::ZERO), |(low, high), v| (low.min(v), high.max(v)));
        Self { vertex, middle: 0.5 * (low + high), scale }
    }

    /// The scale that brings the largest of the polygons to the size 1. A power of two: scaling is
    /// exact.
    pub fn common_scale<'a>(polygons: impl IntoIterator<Item = &'a Polygon>) -> f64 {
        let size = polygons.into_iter().map(Polygon::size).fold(0.0, f64::max);
        if size > 0.0 && size.is_finite() { (-size.log2().ceil()).exp2() } else { 1.0 }
    }

    /// Where local coordinates are 0.
    pub(crate) fn origin(&self) -> DVec2 {
        self.vertex + self.middle
    }

    /// Into local coordinates, rounded to `R` at the end.
    pub fn local<R: Real>(&self, p: DVec2) -> [R; 2] {
        let q = (p - self.vertex - self.middle) * self.scale;
        [R::of(q.x), R::of(q.y)]
    }

    /// Back from local coordinates.
    pub fn world<R: Real>(&self, q: [R; 2]) -> DVec2 {
        DVec2::new(q[0].to_f64(), q[1].to_f64()) / self.scale + self.middle + self.vertex
    }
}
