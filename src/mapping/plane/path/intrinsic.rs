//! Turning angles and edge lengths go linearly.

use std::f64::consts::{PI, TAU};

use glam::DVec2;

use crate::error::{Error, Result};
use crate::geometry::Polygon;
use crate::geometry::polygon::{barycentre, signed_area};
use crate::mapping::plane::Cage;

use super::{PathKind, VertexPath};

/// The least weight of an edge's correction, in the largest (Sederberg et al. 1993).
const LEAST_WEIGHT: f64 = 1e-4;
/// The part of an edge's length in its weight where the path is to depend continuously on the
/// polygons.
const STEADY: f64 = 0.25;

/// Which edges take the correction that closes a loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Closing {
    /// Those whose lengths change most. Where no length changes, this has no limit: which edge
    /// takes it depends on which of them changes by however little.
    Changing,
    /// Longer ones and those that change, by weights that are continuous in the lengths.
    Steady,
}

/// The intrinsic path of Sederberg, Gao, Wang and Mu 1993, every loop on its own, normalised as in
/// section 3.1 of the paper: area, barycentre and the angle of the first edge go linearly, the
/// angle the shorter way.
///
/// Convex polygons stay convex. A loop may come to intersect itself, and loops may collide: the
/// polygons are to be checked.
#[derive(Clone, Debug)]
pub struct Intrinsic {
    cage: Cage,
    rings: Vec<Ring>,
}

/// One loop at both ends, as edge lengths and turning angles.
#[derive(Clone, Debug)]
struct Ring {
    source: Shape,
    target: Shape,
    /// Squared weights of the corrections that close the loop.
    weights: Vec<f64>,
}

/// A loop up to its similarity, and that similarity.
#[derive(Clone, Debug)]
struct Shape {
    lengths: Vec<f64>,
    /// Signed angle from the edge before a vertex to the edge after it, in -pi..pi.
    turnings: Vec<f64>,
    /// Angle of the first edge.
    angle: f64,
    area: f64,
    centre: DVec2,
}

impl Shape {
    fn new(ring: &[DVec2]) -> Self {
        let n = ring.len();
        let edges: Vec<DVec2> = (0..n).map(|i| ring[(i + 1) % n] - ring[i]).collect();
        Self {
            lengths: edges.iter().map(|e| e.length()).collect(),
            turnings: (0..n)
                .map(|i| {
                    let (before, after) = (edges[(i + n - 1) % n], edges[i]);
                    before.perp_dot(after).atan2(before.dot(after))
                })
                .collect(),
            angle: edges[0].to_angle(),
            area: signed_area(ring),
            centre: barycentre(ring),
        }
    }
}

impl Ring {
    fn new(source: &[DVec2], target: &[DVec2], closing: Closing) -> Self {
        let (source, mut target) = (Shape::new(source), Shape::new(target));
        target.angle = source.angle + (target.angle - source.angle + PI).rem_euclid(TAU) - PI;
        let weights = match closing {
            Closing::Changing => Self::changing(&source.lengths, &target.lengths),
            Closing::Steady => {
                let weight = |(a, b): (&f64, &f64)| (a - b).powi(2) + (STEADY * (a + b) / 2.0).powi(2);
                source.lengths.iter().zip(&target.lengths).map(weight).collect()
            }
        };
        Self { source, target, weights }
    }

    fn changing(source: &[f64], target: &[f64]) -> Vec<f64> {
        let change: Vec<f64> = source.iter().zip(target).map(|(a, b)| (a - b).abs()).collect();
        let largest = change.iter().copied().fold(0.0, f64::max);
        // Congruent edges differ by rounding only: then longer edges take more of the correction.
        let longest = source.iter().copied().fold(0.0, f64::max);
        if largest <= 1e-12 * longest {
            source.iter().map(|l| l * l).collect()
        } else {
            change.iter().map(|&c| c.max(LEAST_WEIGHT * largest).powi(2)).collect()
        }
    }

    /// The loop at `t`, or what went wrong.
    fn at(&self, t: f64) -> std::result::Result<Vec<DVec2>, String> {
        let mix = |a: f64, b: f64| (1.0 - t) * a + t * b;
        let (a, b) = (&self.source, &self.target);
        let n = a.lengths.len();
        let mut angle = mix(a.angle, b.angle);
        let directions: Vec<DVec2> = (0..n)
            .map(|i| {
                if i > 0 {
                    angle += mix(a.turnings[i], b.turnings[i]);
                }
                DVec2::from_angle(angle)
            })
            .collect();
        let mut lengths: Vec<f64> = (0..n).map(|i| mix(a.lengths[i], b.lengths[i])).collect();
        // Least sum of (S_i / w_i)^2 subject to sum (L_i + S_i) d_i = 0: S_i = -w_i^2 d_i . l with
        // a 2 x 2 system for l.
        let (mut xx, mut xy, mut yy, mut gap) = (0.0, 0.0, 0.0, DVec2::ZERO);
        for i in 0..n {
            let (w, d) = (self.weights[i], directions[i]);
            xx += w * d.x * d.x;
            xy += w * d.x * d.y;
            yy += w * d.y * d.y;
            gap += lengths[i] * d;
        }
        let determinant = xx * yy - xy * xy;
        let l = DVec2::new(yy * gap.x - xy * gap.y, xx * gap.y - xy * gap.x) / determinant;
        if !(determinant > 1e-14 * (xx + yy).powi(2)) || !l.is_finite() {
            return Err("its edges are all parallel".to_owned());
        }
        for i in 0..n {
            lengths[i] -= self.weights[i] * directions[i].dot(l);
            if !(lengths[i] > 0.0) {
                return Err(format!("edge {i} shrinks to nothing"));
            }
        }
        let mut at = DVec2::ZERO;
        let mut ring: Vec<DVec2> = Vec::with_capacity(n);
        for i in 0..n {
            ring.push(at);
            at += lengths[i] * directions[i];
        }
        let scale = (mix(a.area, b.area) / signed_area(&ring)).sqrt();
        if !(scale.is_finite() && scale > 0.0) {
            return Err("it turns inside out".to_owned());
        }
        let (from, to) = (barycentre(&ring), a.centre * (1.0 - t) + b.centre * t);
        Ok(ring.into_iter().map(|v| to + (v - from) * scale).collect())
    }
}

impl Intrinsic {
    /// The intrinsic path between the polygons of `cage`.
    pub fn new(cage: &Cage) -> Self {
        Self::closed_by(cage, Closing::Changing)
    }

    /// The path that is continuous in both polygons, as long as none of their edges turns by half a
    /// turn on the way.
    pub(super) fn steady(cage: &Cage) -> Self {
        Self::closed_by(cage, Closing::Steady)
    }

    fn closed_by(cage: &Cage, closing: Closing) -> Self {
        let loops = cage.source.loops().iter().zip(cage.target.loops());
        Self { cage: cage.clone(), rings: loops.map(|(a, b)| Ring::new(a, b, closing)).collect() }
    }
}

impl VertexPath for Intrinsic {
    fn polygon(&self, t: f64) -> Result<Polygon> {
        if t == 0.0 || t == 1.0 {
            return Ok(if t == 0.0 { self.cage.source.clone() } else { self.cage.target.clone() });
        }
        let loops = self.rings.iter().enumerate().map(|(index, ring)| {
            ring.at(t).map_err(|what| {
                Error::numeric(
                    format!("the intrinsic path fails at t = {t}: loop {index}: {what}"),
                    "Take another path, or bring source and target closer together",
                )
            })
        });
        Ok(Polygon::from_loops(loops.collect::<Result<_>>()?))
    }

    fn kind(&self) -> PathKind {
        PathKind::Intrinsic
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn star(inner: f64, outer: f64, turn: f64, scale: f64) -> Vec<DVec2> {
        (0..10)
            .map(|i| DVec2::from_angle(turn + i as f64 * PI / 5.0) * scale * if i % 2 == 0 { outer } else { inner })
            .collect()
    }

    fn path(source: Vec<DVec2>, target: Vec<DVec2>) -> Intrinsic {
        Intrinsic::new(&Cage::new(vec![source], vec![target]).unwrap())
    }

    #[test]
    fn area_barycentre_and_first_angle_go_linearly() {
        let source = star(0.4, 1.0, 0.0, 1.0);
        let target: Vec<DVec2> = star(1.0, 0.5, 0.6, 2.0).into_iter().map(|v| v + DVec2::new(3.0, -1.0)).collect();
        let path = path(source, target);
        let [a, b] = [0.0, 1.0].map(|t| path.polygon(t).unwrap());
        let angle = |p: &Polygon| (p.loops()[0][1] - p.loops()[0][0]).to_angle();
        for t in [0.1, 0.25, 0.5, 0.9] {
            let p = path.polygon(t).unwrap();
            p.check().unwrap();
            assert!((p.area() - (1.0 - t) * a.area() - t * b.area()).abs() < 1e-12);
            assert!((p.barycentre() - a.barycentre() * (1.0 - t) - b.barycentre() * t).length() < 1e-12);
            assert!((angle(&p) - (1.0 - t) * angle(&a) - t * angle(&b)).abs() < 1e-12);
        }
        // Continuous at the ends, where the polygons are taken as they are.
        for (t, end) in [(1e-9, &a), (1.0 - 1e-9, &b)] {
            let near = path.polygon(t).unwrap();
            assert!(near.vertices().zip(end.vertices()).all(|(p, q)| (p - q).length() < 1e-7));
        }
    }

    #[test]
    fn similar_polygons_stay_similar() {
        let path = path(star(0.4, 1.0, 0.0, 1.0), star(0.4, 1.0, 0.9, 1.0));
        for t in [0.2, 0.5, 0.7] {
            let polygon = path.polygon(t).unwrap();
            for (p, q) in polygon.vertices().zip(star(0.4, 1.0, 0.9 * t, 1.0)) {
                assert!((p - q).length() < 1e-12, "a rotation all the way");
            }
        }
    }

    #[test]
    fn convex_polygons_stay_convex() {
        // The two hexagons of the mean value mapping that folds although both are convex.
        let ring = |points: [(f64, f64); 6]| points.map(|(x, y)| DVec2::new(x, y)).to_vec();
        let source = ring([
            (-0.918, -0.202),
            (-0.560, -0.736),
            (-0.425, -0.875),
            (-0.322, -0.979),
            (0.867, 0.708),
            (0.775, 0.807),
        ]);
        let target = ring([
            (-0.346, 1.046),
            (-0.721, -0.058),
            (0.690, -0.668),
            (0.714, -0.678),
            (0.666, -0.596),
            (-0.285, 1.006),
        ]);
        let path = path(source, target);
        for k in 0..=64 {
            let polygon = path.polygon(k as f64 / 64.0).unwrap();
            polygon.check().unwrap();
            assert!(Shape::new(&polygon.loops()[0]).turnings.iter().all(|&turning| turning > 0.0));
        }
    }
}
