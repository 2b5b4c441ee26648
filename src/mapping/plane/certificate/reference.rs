//! The Jacobian in plain doubles, by the printed formulas: what the certificate's tests compare
//! with.

use std::f64::consts::TAU;

use glam::DVec2;

use crate::geometry::Polygon;

/// J at a point not too close to the boundary (paper, section 4.2).
pub(super) fn jacobian(from: &Polygon, to: &Polygon, p: DVec2) -> f64 {
    let (v, image): (Vec<DVec2>, Vec<DVec2>) = (from.vertices().collect(), to.vertices().collect());
    let corners: Vec<_> = from.corners().collect();
    let s: Vec<DVec2> = v.iter().map(|v| *v - p).collect();
    let turn: Vec<DVec2> = s.iter().map(|s| DVec2::new(s.y, -s.x) / s.length_squared()).collect();
    let tangent = |i: usize| {
        let j = corners[i].after;
        let (a, d, rr) = (s[i].perp_dot(v[j] - v[i]), s[i].dot(s[j]), s[i].length() * s[j].length());
        let t = if d < 0.0 { (rr - d) / a } else { a / (rr + d) };
        (t, (turn[j] - turn[i]) * (0.5 + 0.5 * t * t))
    };
    let t: Vec<(f64, DVec2)> = (0..v.len()).map(tangent).collect();
    let (mut sum, mut slope, mut moment, mut rows) = (0.0, DVec2::ZERO, DVec2::ZERO, [DVec2::ZERO; 2]);
    for i in 0..v.len() {
        let ((ta, ga), (tb, gb)) = (t[corners[i].before], t[i]);
        let r = s[i].length();
        let w = (ta + tb) / r;
        let g = (ga + gb) / r + s[i] * (w / (r * r));
        sum += w;
        slope += g;
        moment += image[i] * w;
        rows[0] += g * image[i].x;
        rows[1] += g * image[i].y;
    }
    let f = moment / sum;
    let [a, b] = [(rows[0] - slope * f.x) / sum, (rows[1] - slope * f.y) / sum];
    a.perp_dot(b)
}

/// Limit of J at vertex `k` as a function of the direction's angle from the outgoing edge, in
/// closed form, and the interior angle.
pub(super) fn limit(from: &Polygon, to: &Polygon, k: usize) -> (impl Fn(f64) -> f64 + use<>, f64) {
    let (v, image): (Vec<DVec2>, Vec<DVec2>) = (from.vertices().collect(), to.vertices().collect());
    let corners: Vec<_> = from.corners().collect();
    let (before, after) = (corners[k].before, corners[k].after);
    let (out, back) = (v[after] - v[k], v[before] - v[k]);
    let beta = out.perp_dot(back).atan2(out.dot(back)).rem_euclid(TAU);
    let [e_out, e_back] = [after, before].map(|j| (image[j] - image[k]) / v[j].distance(v[k]));
    let tangent = |i: usize| {
        let j = corners[i].after;
        let (a, b) = (v[i] - v[k], v[j] - v[k]);
        if i == k || j == k { 0.0 } else { (0.5 * a.perp_dot(b).atan2(a.dot(b))).tan() }
    };
    let weight = |j: usize| (tangent(corners[j].before) + tangent(j)) / v[j].distance(v[k]);
    let q: DVec2 = (0..v.len()).filter(|&j| j != k).map(|j| (image[j] - image[k]) * weight(j)).sum();
    let half = 0.5 * beta;
    let p0 = (e_out + e_back) * 0.5 - q * (0.5 / half.tan());
    let p1 = q / (2.0 * half.sin());
    let p2 = (e_back - e_out) / (2.0 * half.sin());
    let value = move |angle: f64| {
        let phi = angle - half;
        p1.perp_dot(p2) + p0.perp_dot(p2) * phi.cos() - p0.perp_dot(p1) * phi.sin()
    };
    (value, beta)
}

/// Distance of `p` to the boundary, and whether it is inside.
pub(super) fn place(polygon: &Polygon, p: DVec2) -> (f64, bool) {
    let v: Vec<DVec2> = polygon.vertices().collect();
    let (mut distance, mut inside) = (f64::INFINITY, false);
    for c in polygon.corners() {
        let (a, b) = (v[c.index], v[c.after]);
        let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
        distance = distance.min((a + (b - a) * t).distance(p));
        if (a.y <= p.y) != (b.y <= p.y) && a.x + (p.y - a.y) / (b.y - a.y) * (b.x - a.x) > p.x {
            inside = !inside;
        }
    }
    (distance, inside)
}

/// The smallest J on a grid of the interior and among the limits at the vertices.
pub(super) fn sampled_minimum(from: &Polygon, to: &Polygon, resolution: usize) -> f64 {
    let (low, high) = from.bounds();
    let mut least = f64::INFINITY;
    for i in 0..resolution {
        for j in 0..resolution {
            let share = (DVec2::new(i as f64, j as f64) + 0.5) / resolution as f64;
            let p = low + (high - low) * share;
            let (distance, inside) = place(from, p);
            if inside && distance > 1e-4 * from.size() {
                least = least.min(jacobian(from, to, p));
            }
        }
    }
    for k in 0..from.vertex_count() {
        let (value, beta) = limit(from, to, k);
        least = (0..=64).map(|i| value(beta * i as f64 / 64.0)).fold(least, f64::min);
    }
    least
}
