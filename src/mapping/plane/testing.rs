//! Polygons that the tests of this folder share.

use glam::DVec2;

use crate::geometry::Polygon;
use crate::models::polygons;

/// One loop.
pub(super) fn ring(points: &[[f64; 2]]) -> Polygon {
    Polygon::from_loops(vec![points.iter().map(|p| DVec2::from(*p)).collect()])
}

/// The unit square with its upper right corner at (1 - s, 1 - s).
pub(super) fn square(s: f64) -> Polygon {
    polygons::square_corner(s).target
}

/// A star: `n` vertices, the even ones at radius `even`, the odd ones at `odd`, turned.
pub(super) fn star(n: usize, even: f64, odd: f64, turned: [f64; 2]) -> Polygon {
    let plain = polygons::star(n, &[even, odd], 0.0, DVec2::ZERO);
    Polygon::from_loops(vec![
        plain.iter().enumerate().map(|(k, v)| DVec2::from_angle(turned[k % 2]).rotate(*v)).collect(),
    ])
}

/// Two squares, half sides 1 and 0.4, the inner one turned; linear path from 0 to 90 degrees at
/// `t`.
pub(super) fn nested_squares(t: f64) -> Polygon {
    let pair = polygons::nested_squares();
    between(&pair.source, &pair.target, t)
}

/// Linear interpolation of two polygons with the same loops.
pub(super) fn between(a: &Polygon, b: &Polygon, t: f64) -> Polygon {
    let loops = a.loops().iter().zip(b.loops());
    Polygon::from_loops(loops.map(|(a, b)| a.iter().zip(b).map(|(v, w)| v.lerp(*w, t)).collect()).collect())
}

/// Pairs A, B and C: a star to the one with tips and notches exchanged, a star with its tips
/// turned, a square with a corner moved in.
pub(super) fn pairs() -> [(&'static str, Polygon, Polygon); 3] {
    let named = |name, pair: polygons::PolygonPair| (name, pair.source, pair.target);
    [
        named("A", polygons::inverted_star()),
        named("B", polygons::twisted_star()),
        named("C", polygons::square_corner(0.8)),
    ]
}

/// Two convex hexagons whose mean value map folds.
pub(super) fn hexagons() -> (Polygon, Polygon) {
    let pair = polygons::convex_witness();
    (pair.source, pair.target)
}

/// A fixed stream of numbers in 0..1.
pub(super) struct Random(pub(super) u64);

impl Random {
    pub(super) fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
}
