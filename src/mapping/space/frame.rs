//! Where single precision keeps its digits: polyhedra about their own centre, at one scale.

use glam::DVec3;

use crate::engine::Real;

/// Local coordinates of one polyhedron: `(p - vertex - middle) * scale`, as
/// [`super::super::plane::Frame`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// A vertex, and the way from it to the centre of the bounding box, whose local coordinates are
    /// 0 ([`crate::geometry::frame`]).
    vertex: DVec3,
    middle: DVec3,
    /// Local units in one unit of the file, common to all polyhedra of a composite map.
    pub scale: f64,
}

/// The bounding box of `points`; that of the origin where there are none.
pub(super) fn bounds(points: &[DVec3]) -> (DVec3, DVec3) {
    let start = points.first().copied().unwrap_or(DVec3::ZERO);
    points.iter().fold((start, start), |(low, high), &p| (low.min(p), high.max(p)))
}

impl Frame {
    /// The frame of a polyhedron at `scale`.
    pub fn of(vertices: &[DVec3], scale: f64) -> Self {
        let vertex = crate::geometry::Frame::of(vertices.iter().copied()).origin;
        let (low, high) = vertices
            .iter()
            .map(|v| *v - vertex)
            .fold((DVec3::ZERO, DVec3::ZERO), |(low, high), v| (low.min(v), high.max(v)));
        Self { vertex, middle: 0.5 * (low + high), scale }
    }

    /// The scale that brings the largest of the polyhedra to a diameter of about 1. A power of two:
    /// scaling is exact.
    pub fn common_scale<'a>(polyhedra: impl IntoIterator<Item = &'a [DVec3]>) -> f64 {
        let size = |p: &[DVec3]| {
            let (low, high) = bounds(p);
            (high - low).length()
        };
        let size = polyhedra.into_iter().map(size).fold(0.0, f64::max);
        if size > 0.0 && size.is_finite() { (-size.log2().ceil()).exp2() } else { 1.0 }
    }

    /// The point whose local coordinates are 0.
    pub fn origin(&self) -> DVec3 {
        self.vertex + self.middle
    }

    /// Into local coordinates, rounded to `R` at the end.
    pub fn local<R: Real>(&self, p: DVec3) -> [R; 3] {
        ((p - self.vertex - self.middle) * self.scale).to_array().map(|x| R::of(x))
    }

    /// Back from local coordinates.
    pub fn world<R: Real>(&self, q: [R; 3]) -> DVec3 {
        DVec3::from(q.map(|x| x.to_f64())) / self.scale + self.middle + self.vertex
    }
}
