//! Where single precision keeps its digits: polyhedra about their own centre, at one scale.

use glam::DVec3;

use crate::engine::Real;

/// Local coordinates of one polyhedron: `(p - origin) * scale`, as [`super::super::plane::Frame`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// The centre of the bounding box, whose local coordinates are 0.
    pub origin: DVec3,
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
        let (low, high) = bounds(vertices);
        Self { origin: low * 0.5 + high * 0.5, scale }
    }

    /// The scale that brings the largest of the polyhedra to a diameter of about 1. A power of two: scaling is exact.
    pub fn common_scale<'a>(polyhedra: impl IntoIterator<Item = &'a [DVec3]>) -> f64 {
        let size = |p: &[DVec3]| {
            let (low, high) = bounds(p);
            (high - low).length()
        };
        let size = polyhedra.into_iter().map(size).fold(0.0, f64::max);
        if size > 0.0 && size.is_finite() { (-size.log2().ceil()).exp2() } else { 1.0 }
    }

    /// Into local coordinates, rounded to `R` at the end.
    pub fn local<R: Real>(&self, p: DVec3) -> [R; 3] {
        ((p - self.origin) * self.scale).to_array().map(|x| R::of(x))
    }

    /// Back from local coordinates.
    pub fn world<R: Real>(&self, q: [R; 3]) -> DVec3 {
        DVec3::from(q.map(|x| x.to_f64())) / self.scale + self.origin
    }
}
