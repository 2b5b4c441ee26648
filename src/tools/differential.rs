//! The differential of a map between surfaces at a point, and what it does to normals, heights and
//! vectors.

use glam::{DMat2, DVec2, DVec3};

/// Slopes grow at most by this factor, so that a map gone wrong does not shade like a canyon.
const STEEPEST: f64 = 4.0;

/// A plane with unit axes at right angles; `x`, `y` and `normal` are right-handed.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Plane {
    x: DVec3,
    y: DVec3,
    normal: DVec3,
}

impl Plane {
    /// The plane across the unit vector `normal`.
    fn across(normal: DVec3) -> Self {
        let (x, y) = normal.any_orthonormal_pair();
        Self { x, y, normal }
    }

    fn coordinates(&self, v: DVec3) -> DVec2 {
        DVec2::new(self.x.dot(v), self.y.dot(v))
    }

    fn vector(&self, c: DVec2) -> DVec3 {
        self.x * c.x + self.y * c.y
    }
}

/// How a map takes the tangent plane of a target at a point to that of a source at its image.
#[derive(Clone, Copy, Debug, PartialEq)]
#[doc(hidden)]
pub struct Differential {
    target: Plane,
    source: Plane,
    /// From the target's plane to the source's; its determinant is negative where the map turns the
    /// surface over.
    matrix: DMat2,
}

impl Differential {
    /// The linear map that takes the first vector of each pair, a step on the target, to the
    /// second, the step of its image, as nearly as least squares can, all seen along the unit
    /// normals. `None` if the steps do not span the plane, or something is not finite.
    pub fn fit(
        target_normal: DVec3,
        source_normal: DVec3,
        steps: impl IntoIterator<Item = (DVec3, DVec3)>,
    ) -> Option<Self> {
        let (target, source) = (Plane::across(target_normal), Plane::across(source_normal));
        let (mut square, mut mixed) = (DMat2::ZERO, DMat2::ZERO);
        for (on_target, on_source) in steps {
            let (e, f) = (target.coordinates(on_target), source.coordinates(on_source));
            square += DMat2::from_cols(e * e.x, e * e.y);
            mixed += DMat2::from_cols(f * e.x, f * e.y);
        }
        let trace = square.x_axis.x + square.y_axis.y;
        // Steps closer to one line than a hundredth say nothing of the other direction.
        if !(square.determinant() > 1e-4 * trace * trace) {
            return None;
        }
        let matrix = mixed * square.inverse();
        let size = matrix.determinant().abs();
        (matrix.is_finite() && size > 0.0 && size.is_finite()).then_some(Self { target, source, matrix })
    }

    /// Turns about the axis across both normals; `None` if they are opposite.
    pub fn shortest_turn(target_normal: DVec3, source_normal: DVec3) -> Option<Self> {
        if !(target_normal.dot(source_normal) > -0.99) {
            return None;
        }
        let turn = glam::DQuat::from_rotation_arc(target_normal, source_normal);
        let target = Plane::across(target_normal);
        Self::fit(target_normal, source_normal, [target.x, target.y].map(|v| (v, turn * v)))
    }

    /// Length on the source per length on the target: the square root of the ratio of areas.
    pub fn size(&self) -> f64 {
        self.matrix.determinant().abs().sqrt()
    }

    /// 1, or -1 where the map turns the surface over.
    pub fn orientation(&self) -> f64 {
        self.matrix.determinant().signum()
    }

    /// The rotation, or reflection, of the plane closest to the differential (polar decomposition).
    fn closest_rotation(&self) -> DMat2 {
        let [a, c, b, d] = self.matrix.to_cols_array();
        if self.matrix.determinant() > 0.0 {
            let r = DVec2::new(a + d, c - b).normalize_or(DVec2::X);
            DMat2::from_cols(DVec2::new(r.x, r.y), DVec2::new(-r.y, r.x))
        } else {
            let r = DVec2::new(a - d, c + b).normalize_or(DVec2::X);
            DMat2::from_cols(DVec2::new(r.x, r.y), DVec2::new(r.y, -r.x))
        }
    }

    /// The gradient on the target of a height whose gradient on the source is `gradient`, heights
    /// being multiplied by `factor`: slopes are covectors, carried by the transpose of the
    /// differential.
    pub fn pull_gradient(&self, gradient: DVec3, factor: f64) -> DVec3 {
        let g = self.source.coordinates(gradient);
        let pulled = self.matrix.transpose() * g * factor;
        self.target.vector(pulled.clamp_length_max(STEEPEST * g.length()))
    }

    /// The gradient turned by the inverse of the closest rotation, as steep as it was.
    pub fn turn_gradient(&self, gradient: DVec3) -> DVec3 {
        self.target.vector(self.closest_rotation().transpose() * self.source.coordinates(gradient))
    }

    /// A vector of the source turned to the target: its part in the tangent plane by the inverse of
    /// the closest rotation, its part along the normal along the target's. Lengths and, where the
    /// map does not turn the surface over, angles stay.
    pub fn turn(&self, v: DVec3) -> DVec3 {
        self.turn_gradient(v) + self.target.normal * self.source.normal.dot(v)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat3;

    fn steps(map: DMat3, normal: DVec3) -> Vec<(DVec3, DVec3)> {
        let plane = Plane::across(normal);
        [plane.x, plane.y, -plane.x, plane.x + plane.y].map(|e| (0.1 * e, map * (0.1 * e))).to_vec()
    }

    #[test]
    fn a_rotation_turns_back() {
        let r = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 1.1);
        let n = DVec3::new(0.2, -0.3, 0.9).normalize();
        let d = Differential::fit(n, r * n, steps(r, n)).unwrap();
        for v in [DVec3::X, DVec3::new(0.3, -1.0, 2.0)] {
            assert!((r * d.turn(v)).distance(v) < 1e-12);
        }
        assert!((d.size() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_gradient_of_a_linear_height_is_pulled_back() {
        // The map p -> A p between planes z = 0, and the height h(q) = g . q on the source.
        let a = DMat3::from_cols(DVec3::new(1.2, 0.4, 0.0), DVec3::new(-0.3, 0.7, 0.0), DVec3::Z);
        let g = DVec3::new(0.5, -0.2, 0.0);
        let d = Differential::fit(DVec3::Z, DVec3::Z, steps(a, DVec3::Z)).unwrap();
        let pulled = d.pull_gradient(g, 3.0);
        for p in [DVec3::X, DVec3::Y, DVec3::new(2.0, -1.0, 0.0)] {
            assert!((pulled.dot(p) - 3.0 * g.dot(a * p)).abs() < 1e-12);
        }
        // A vector is no covector: carrying the gradient like one fails.
        assert!((a * g * 3.0).distance(pulled) > 0.1);
    }

    #[test]
    fn a_reflection_is_no_rotation() {
        let m = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
        let d = Differential::fit(DVec3::Z, DVec3::Z, steps(m, DVec3::Z)).unwrap();
        assert!(d.turn_gradient(DVec3::X).distance(DVec3::NEG_X) < 1e-12);
        assert!(d.turn_gradient(DVec3::Y).distance(DVec3::Y) < 1e-12);
    }

    #[test]
    fn uniform_scale_keeps_what_is_local() {
        let d =
            Differential::fit(DVec3::Z, DVec3::Z, steps(DMat3::from_diagonal(DVec3::splat(0.25)), DVec3::Z)).unwrap();
        let g = DVec3::new(0.6, 0.1, 0.0);
        assert!(d.pull_gradient(g, 1.0 / d.size()).distance(g) < 1e-12);
        assert!(d.turn_gradient(g).distance(g) < 1e-12);
    }

    #[test]
    fn steps_along_one_line_or_not_finite_say_nothing() {
        assert!(Differential::fit(DVec3::Z, DVec3::Z, [(DVec3::X, DVec3::X), (2.0 * DVec3::X, DVec3::Y)]).is_none());
        assert!(Differential::fit(DVec3::Z, DVec3::Z, []).is_none());
        assert!(Differential::fit(DVec3::Z, DVec3::Z, [(DVec3::X, DVec3::NAN), (DVec3::Y, DVec3::Y)]).is_none());
        assert!(Differential::fit(DVec3::Z, DVec3::Z, [(DVec3::X, DVec3::ZERO), (DVec3::Y, DVec3::ZERO)]).is_none());
        assert!(Differential::shortest_turn(DVec3::Z, DVec3::NEG_Z).is_none());
        let turned = Differential::shortest_turn(DVec3::Z, DVec3::X).unwrap();
        assert!(turned.turn(DVec3::X).distance(DVec3::Z) < 1e-12);
    }
}
