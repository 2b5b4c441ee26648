//! Gradients of the coordinates, for bounds that are sampled.

use glam::DVec2;

use super::Coordinates;
use crate::geometry::Polygon;

/// Gradients of all coordinates at a point off the boundary, in double precision. O(n).
pub(super) fn gradients(coordinates: Coordinates, polygon: &Polygon, p: DVec2) -> Vec<DVec2> {
    match coordinates {
        Coordinates::MeanValue => mean_value(polygon, p),
        Coordinates::Wachspress => wachspress(polygon, p),
    }
}

/// Gradients of all mean value coordinates at a point off the boundary (paper, equation 9, with the gradient of the tangents in
/// the form `(1 + t^2) / 2 (a' - a)`, `a` being the gradient of the polar angle).
fn mean_value(polygon: &Polygon, p: DVec2) -> Vec<DVec2> {
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

/// Gradients of all Wachspress coordinates: `b_i (R_i - sum b_j R_j)` with the logarithmic derivatives `R_i` of the weights.
fn wachspress(polygon: &Polygon, p: DVec2) -> Vec<DVec2> {
    let vertices: Vec<DVec2> = polygon.vertices().collect();
    let edge = |i: usize, j: usize| {
        let (a, b) = (vertices[i], vertices[j]);
        let area = (a - p).perp_dot(b - p);
        (area, DVec2::new(a.y - b.y, b.x - a.x) / area)
    };
    let (mut weights, mut rates) = (Vec::new(), Vec::new());
    for corner in polygon.corners() {
        let (before, after) = (edge(corner.before, corner.index), edge(corner.index, corner.after));
        let v = vertices[corner.index];
        let own = (v - vertices[corner.before]).perp_dot(vertices[corner.after] - v);
        weights.push(own / (before.0 * after.0));
        rates.push(-before.1 - after.1);
    }
    let sum: f64 = weights.iter().sum();
    let mean = weights.iter().zip(&rates).map(|(w, r)| *r * (w / sum)).sum::<DVec2>();
    weights.iter().zip(rates).map(|(w, r)| (r - mean) * (w / sum)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mapping::plane::coordinates;

    fn reproduces(coordinates: Coordinates, polygon: &Polygon, p: DVec2) {
        let (mut one, mut x, mut y) = (DVec2::ZERO, DVec2::ZERO, DVec2::ZERO);
        for (g, v) in gradients(coordinates, polygon, p).iter().zip(polygon.vertices()) {
            one += *g;
            x += *g * v.x;
            y += *g * v.y;
        }
        assert!(one.length() < 1e-11 && (x - DVec2::X).length() < 1e-11 && (y - DVec2::Y).length() < 1e-11);
    }

    #[test]
    fn gradients_reproduce_linear_functions_and_are_those_of_the_coordinates() {
        let star = crate::mapping::plane::testing::star(10, 1.0, 0.4, [0.0, 0.1]);
        let convex = crate::mapping::plane::testing::hexagons().0;
        for p in [DVec2::new(0.1, 0.2), DVec2::new(0.8, 0.01), DVec2::new(0.31, 0.1)] {
            for (kind, polygon) in
                [(Coordinates::MeanValue, &star), (Coordinates::MeanValue, &convex), (Coordinates::Wachspress, &convex)]
            {
                reproduces(kind, polygon, p);
                let h = 1e-6;
                let b = |p: DVec2| coordinates(kind, polygon, p).unwrap();
                let (right, left) = (b(p + DVec2::X * h), b(p - DVec2::X * h));
                for (i, g) in gradients(kind, polygon, p).iter().enumerate() {
                    assert!((g.x - (right[i] - left[i]) / (2.0 * h)).abs() < 1e-6, "{kind} {i}");
                }
            }
        }
    }
}
