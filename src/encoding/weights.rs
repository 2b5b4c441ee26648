//! Mean value weights of a point in the plane with respect to a polygon, safe on its edges and
//! vertices.

use crate::engine::Real;

/// Writes into `weights` the mean value coordinates of the origin with respect to the closed
/// polygon `points`, and returns sum |w| / |sum w|; `None` where they do not exist (a self-crossing
/// polygon whose weights cancel, or points that are not finite).
///
/// Half angles come as A / (r r' + D) or (r r' - D) / A, whichever does not cancel; the largest one
/// at an edge passing through the origin is factored out, so that on an edge the result is the
/// linear interpolation, at a vertex the vertex itself. Weights are negative outside the kernel and
/// sum to one. Equation 7; Hormann, Floater 2006 for general polygons.
pub(crate) fn mean_value_weights<R: Real>(points: &[[R; 2]], weights: &mut [R]) -> Option<R> {
    let n = points.len();
    let radius = |k: usize| (points[k][0] * points[k][0] + points[k][1] * points[k][1]).sqrt();
    let mut nearest = 0;
    let (mut least, mut largest) = (R::HUGE, R::ZERO);
    for k in 0..n {
        let r = radius(k);
        if r < least {
            (nearest, least) = (k, r);
        }
        largest = largest.maximum(r);
    }
    if !(largest > R::ZERO) || !largest.finite() {
        return None;
    }
    if least <= largest * R::EPSILON {
        weights.iter_mut().for_each(|w| *w = R::ZERO);
        weights[nearest] = R::ONE;
        return Some(R::ONE);
    }
    // A and the two ways to its half angle, for the edge from point k to the next.
    let edge = |k: usize| -> (R, R, R) {
        let (p, q) = (points[k], points[(k + 1) % n]);
        // From the nearer end, so that a short vector meets the edge.
        let e = [q[0] - p[0], q[1] - p[1]];
        let s = if radius(k) <= radius((k + 1) % n) { p } else { q };
        let a = s[0] * e[1] - s[1] * e[0];
        let d = p[0] * q[0] + p[1] * q[1];
        let rr = radius(k) * radius((k + 1) % n);
        (a, rr - d, rr + d)
    };
    // The edge seen under the angle nearest to 180 degrees.
    let mut through: Option<(usize, R)> = None;
    for k in 0..n {
        let (a, less, more) = edge(k);
        if more < less {
            let cotangent = a / less;
            if cotangent.abs() < through.map_or(R::ONE, |t| t.1.abs()) {
                through = Some((k, cotangent));
            }
        }
    }
    let factor = through.map_or(R::ONE, |t| t.1);
    let half = |k: usize| -> R {
        if through.is_some_and(|t| t.0 == k) {
            return R::ONE;
        }
        let (a, less, more) = edge(k);
        factor * if more >= less { a / more } else { less / a }
    };
    let (mut sum, mut size) = (R::ZERO, R::ZERO);
    let mut before = half(n - 1);
    for k in 0..n {
        let here = half(k);
        let w = if k == nearest { before + here } else { (before + here) * (least / radius(k)) };
        weights[k] = w;
        sum += w;
        size += w.abs();
        before = here;
    }
    if !(sum.abs() > R::ZERO) || !size.finite() {
        return None;
    }
    let inverse = R::ONE / sum;
    for w in weights.iter_mut() {
        *w *= inverse;
    }
    Some(size / sum.abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn weights(points: &[[f64; 2]]) -> (Vec<f64>, Option<f64>) {
        let mut w = vec![0.0; points.len()];
        let size = mean_value_weights(points, &mut w);
        (w, size)
    }

    fn reproduces(points: &[[f64; 2]]) -> bool {
        let (w, _) = weights(points);
        let at = |c: usize| points.iter().zip(&w).map(|(p, w)| p[c] * w).sum::<f64>();
        at(0).abs() < 1e-13 && at(1).abs() < 1e-13 && (w.iter().sum::<f64>() - 1.0).abs() < 1e-13
    }

    #[test]
    fn linear_functions_are_reproduced_everywhere() {
        // Inside, outside the kernel, outside, and clockwise.
        let l = [[0.0, 0.0], [4.0, 0.0], [4.0, 1.0], [1.0, 1.0], [1.0, 4.0], [0.0, 4.0]];
        for at in [[0.5, 0.5], [3.0, 0.5], [0.5, 3.9], [2.0, 2.0], [-3.0, 1.0], [1.0 + 1e-9, 1.0 + 1e-9]] {
            let mut points = l.map(|p| [p[0] - at[0], p[1] - at[1]]);
            assert!(reproduces(&points), "{at:?}: {:?}", weights(&points));
            points.reverse();
            assert!(reproduces(&points), "{at:?} reversed");
        }
    }

    #[test]
    fn edges_and_vertices_are_limits() {
        let square = [[-1.0, 0.0], [1.0, 0.0], [1.0, 2.0], [-1.0, 2.0]];
        assert_eq!(weights(&square).0, [0.5, 0.5, 0.0, 0.0]);
        let moved = square.map(|p| [p[0] + 1.0, p[1]]);
        assert_eq!(weights(&moved).0, [1.0, 0.0, 0.0, 0.0]);
        // Approaching an edge and a vertex changes nothing by more than the distance.
        for distance in [1e-3, 1e-6, 1e-9, 1e-12, 1e-15] {
            for (base, limit) in [(square, [0.5, 0.5, 0.0, 0.0]), (moved, [1.0, 0.0, 0.0, 0.0])] {
                for side in [-1.0, 1.0] {
                    let w = weights(&base.map(|p| [p[0] + 0.3 * distance, p[1] + side * distance])).0;
                    let change = w.iter().zip(limit).map(|(a, b): (&f64, f64)| (a - b).abs()).fold(0.0, f64::max);
                    assert!(change < 5.0 * distance + 1e-14, "{distance}: {w:?}");
                }
            }
        }
    }

    #[test]
    fn what_has_no_weights_says_so() {
        assert_eq!(weights(&[[0.0, 0.0]; 4]).1, None);
        assert_eq!(weights(&[[f64::NAN, 0.0], [1.0, 0.0], [0.0, 1.0]]).1, None);
        assert!(!reproduces(&[[0.0, 0.0], [1.0, 0.0]].map(|p: [f64; 2]| [p[0] + 0.3, p[1] + 0.3])), "two points");
        // A bow tie seen from its crossing: opposite angles cancel.
        assert!(weights(&[[-1.0, -1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, 1.0]]).1.is_none_or(|size| size > 1e9));
    }
}
