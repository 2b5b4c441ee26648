//! Gradients of the coordinates, for bounds that are sampled.

use glam::DVec2;

use crate::geometry::Polygon;

/// Gradients of all mean value coordinates at a point off the boundary (paper, equation 9, with the gradient of the tangents in
/// the form `(1 + t^2) / 2 (a' - a)`, `a` being the gradient of the polar angle). Double precision, O(n).
pub(super) fn mean_value(polygon: &Polygon, p: DVec2) -> Vec<DVec2> {
    let n = polygon.vertex_count();
    let vertices: Vec<DVec2> = polygon.vertices().collect();
    let (mut weights, mut slopes) = (vec![0.0; n], vec![DVec2::ZERO; n]);
    for corner in polygon.corners() {
        let (i, j) = (corner.index, corner.after);
        let (s, next) = (vertices[i] - p, vertices[j] - p);
        let (r, r_next) = (s.length(), next.length());
        let (cross, dot) = (s.perp_dot(next), s.dot(next));
        let t = if dot >= 0.0 { cross / (r * r_next + dot) } else { (r * r_next - dot) / cross };
        let angle = |s: DVec2, r: f64| DVec2::new(s.y, -s.x) / (r * r);
        let slope = (angle(next, r_next) - angle(s, r)) * ((1.0 + t * t) / 2.0);
        for (k, s, r) in [(i, s, r), (j, next, r_next)] {
            weights[k] += t / r;
            slopes[k] += slope / r + s * (t / (r * r * r));
        }
    }
    let sum: f64 = weights.iter().sum();
    let slope = slopes.iter().sum::<DVec2>() / sum;
    weights.iter().zip(slopes).map(|(w, g)| g / sum - slope * (w / sum)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gradients_reproduce_linear_functions() {
        let ring: Vec<DVec2> =
            (0..10).map(|i| DVec2::from_angle(i as f64 * 0.6283) * if i % 2 == 0 { 1.0 } else { 0.4 }).collect();
        let polygon = Polygon::from_loops(vec![ring]);
        for p in [DVec2::new(0.1, 0.2), DVec2::new(0.8, 0.01), DVec2::new(2.0, 1.0)] {
            let gradients = mean_value(&polygon, p);
            let (mut one, mut x, mut y) = (DVec2::ZERO, DVec2::ZERO, DVec2::ZERO);
            for (g, v) in gradients.iter().zip(polygon.vertices()) {
                one += *g;
                x += *g * v.x;
                y += *g * v.y;
            }
            assert!(one.length() < 1e-11 && (x - DVec2::X).length() < 1e-11 && (y - DVec2::Y).length() < 1e-11);
        }
    }
}
