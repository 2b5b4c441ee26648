//! Polygons that the tests of this folder share.

use glam::{DVec2, dvec2};

use crate::geometry::Polygon;

/// One loop.
pub(super) fn ring(points: &[[f64; 2]]) -> Polygon {
    Polygon::from_loops(vec![points.iter().map(|p| dvec2(p[0], p[1])).collect()])
}

/// The unit square with its upper right corner at (1 - s, 1 - s).
pub(super) fn square(s: f64) -> Polygon {
    ring(&[[0.0, 0.0], [1.0, 0.0], [1.0 - s, 1.0 - s], [0.0, 1.0]])
}

/// A star: `n` vertices, the even ones at radius `even`, the odd ones at `odd`, turned.
pub(super) fn star(n: usize, even: f64, odd: f64, turned: [f64; 2]) -> Polygon {
    let at = |k: usize| {
        let angle = std::f64::consts::TAU * k as f64 / n as f64 + turned[k % 2];
        DVec2::from_angle(angle) * if k.is_multiple_of(2) { even } else { odd }
    };
    Polygon::from_loops(vec![(0..n).map(at).collect()])
}

/// Two squares, half sides 1 and 0.4, the inner one turned; linear path from 0 to 90 degrees at `t`.
pub(super) fn nested_squares(t: f64) -> Polygon {
    let outer = vec![dvec2(1.0, 1.0), dvec2(-1.0, 1.0), dvec2(-1.0, -1.0), dvec2(1.0, -1.0)];
    let inner = [3, 2, 1, 0].map(|k: usize| outer[k] * 0.4);
    let turned = |v: DVec2| v.lerp(v.perp(), t);
    Polygon::from_loops(vec![outer, inner.into_iter().map(turned).collect()])
}

/// Linear interpolation of two polygons with the same loops.
pub(super) fn between(a: &Polygon, b: &Polygon, t: f64) -> Polygon {
    let loops = a.loops().iter().zip(b.loops());
    Polygon::from_loops(loops.map(|(a, b)| a.iter().zip(b).map(|(v, w)| v.lerp(*w, t)).collect()).collect())
}

/// Pairs A, B and C: a star to the one with tips and notches exchanged, a star with its tips turned, a square with a corner moved in.
pub(super) fn pairs() -> [(&'static str, Polygon, Polygon); 3] {
    let plain = star(10, 1.0, 0.4, [0.0; 2]);
    [
        ("A", plain.clone(), star(10, 0.4, 1.0, [0.0; 2])),
        ("B", plain, star(10, 1.0, 0.4, [54f64.to_radians(), 0.0])),
        ("C", square(0.0), square(0.8)),
    ]
}

/// Two convex hexagons whose mean value map folds.
pub(super) fn hexagons() -> (Polygon, Polygon) {
    let source =
        [[-0.918, -0.202], [-0.56, -0.736], [-0.425, -0.875], [-0.322, -0.979], [0.867, 0.708], [0.775, 0.807]];
    let target = [[-0.346, 1.046], [-0.721, -0.058], [0.69, -0.668], [0.714, -0.678], [0.666, -0.596], [-0.285, 1.006]];
    (ring(&source), ring(&target))
}

/// A fixed stream of numbers in 0..1.
pub(super) struct Random(pub(super) u64);

impl Random {
    pub(super) fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
}
