//! Orthogonal maps between point sets.

use nalgebra::DMatrix;

use crate::surface::vector::{Vector, add_scaled, dot, sub};

/// Part of another map that completes a covariance of low rank.
const COMPLETION: f64 = 1e-6;
/// Newton steps: nine reach the polar factor of a matrix of condition 1e6.
const STEPS: usize = 20;
/// A step smaller than this was the last but rounding.
const STILL: f64 = 1e-8;
/// A pivot below this part of the norm is none.
const SINGULAR: f64 = 1e-13;

/// The identity.
pub(crate) fn identity<const D: usize>() -> [Vector<f64, D>; D] {
    std::array::from_fn(|r| std::array::from_fn(|c| if r == c { 1.0 } else { 0.0 }))
}

/// The orthogonal matrix `Q` (row order, reflections allowed) that minimises `sum w_i |(b_i - b) -
/// Q (a_i - a)|^2` about the weighted means: polar factor of the cross-covariance by its singular
/// value decomposition.
///
/// Directions the points do not span (fewer than `D + 1` of them, or none but a few with a weight
/// that counts) are completed as near to `completion` as possible: a millionth of it is added, so
/// that with the identity equal point sets of any number give the identity.
pub(crate) fn orthogonal<const D: usize>(
    a: &[Vector<f64, D>],
    b: &[Vector<f64, D>],
    weights: &[f64],
    completion: &[Vector<f64, D>; D],
) -> [Vector<f64, D>; D] {
    let total: f64 = weights.iter().sum();
    let mean = |x: &[Vector<f64, D>]| -> Vector<f64, D> {
        std::array::from_fn(|i| x.iter().zip(weights).map(|(p, w)| w * p[i]).sum::<f64>() / total)
    };
    let (am, bm) = (mean(a), mean(b));
    let mut covariance = [[0.0; D]; D];
    for ((p, q), w) in a.iter().zip(b).zip(weights) {
        let (p, q) = (sub(p, &am), sub(q, &bm));
        for r in 0..D {
            covariance[r] = add_scaled(&covariance[r], w * q[r], &p);
        }
    }
    let size = norm(&covariance);
    for r in 0..D {
        covariance[r] = add_scaled(&covariance[r], COMPLETION * size, &completion[r]);
    }
    // Without weights there are no means; neither iteration nor decomposition end on what is not
    // finite.
    if !size.is_finite() {
        return *completion;
    }
    newton(&covariance).or_else(|| decomposed(&covariance)).unwrap_or(*completion)
}

/// The Frobenius norm.
fn norm<const D: usize>(x: &[Vector<f64, D>; D]) -> f64 {
    x.iter().map(|r| dot(r, r)).sum::<f64>().sqrt()
}

/// The orthogonal polar factor by Newton's iteration `X <- (g X + X^-T / g) / 2` with scaling by
/// norms (Higham, SIAM J. Sci. Stat. Comput. 7, 1986): no allocation, and exact to rounding where a
/// decomposition loses small singular values. `None` where a matrix is numerically singular.
fn newton<const D: usize>(x: &[Vector<f64, D>; D]) -> Option<[Vector<f64, D>; D]> {
    let mut x = *x;
    for _ in 0..STEPS {
        let inverse = inverse(&x)?;
        let scale = (norm(&inverse) / norm(&x)).sqrt();
        let next: [Vector<f64, D>; D] =
            std::array::from_fn(|r| std::array::from_fn(|c| 0.5 * (scale * x[r][c] + inverse[c][r] / scale)));
        let moved: [Vector<f64, D>; D] = std::array::from_fn(|r| sub(&next[r], &x[r]));
        x = next;
        // The last step was quadratic.
        if norm(&moved) < STILL {
            return Some(x);
        }
    }
    None
}

/// By Gauss and Jordan with pivots from the column.
fn inverse<const D: usize>(x: &[Vector<f64, D>; D]) -> Option<[Vector<f64, D>; D]> {
    let (mut x, mut y) = (*x, identity::<D>());
    let least = SINGULAR * norm(&x);
    for k in 0..D {
        let pivot = (k..D).max_by(|&i, &j| x[i][k].abs().total_cmp(&x[j][k].abs()))?;
        x.swap(k, pivot);
        y.swap(k, pivot);
        if !(x[k][k].abs() > least) {
            return None;
        }
        let by = 1.0 / x[k][k];
        (x[k], y[k]) = (x[k].map(|e| e * by), y[k].map(|e| e * by));
        let (row, other) = (x[k], y[k]);
        for i in (0..D).filter(|&i| i != k) {
            let by = -x[i][k];
            (x[i], y[i]) = (add_scaled(&x[i], by, &row), add_scaled(&y[i], by, &other));
        }
    }
    Some(y)
}

/// The same by singular values, which any finite matrix has.
fn decomposed<const D: usize>(x: &[Vector<f64, D>; D]) -> Option<[Vector<f64, D>; D]> {
    let svd = DMatrix::from_fn(D, D, |r, c| x[r][c]).svd(true, true);
    let q = svd.u? * svd.v_t?;
    Some(std::array::from_fn(|r| std::array::from_fn(|c| q[(r, c)])))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::shapes::Random;

    #[test]
    fn few_equal_points_give_the_identity() {
        let a = [[1.0, 2.0, 3.0, 4.0], [0.0, 1.0, 0.0, 2.0], [5.0, 5.0, 1.0, 0.0]];
        let q = orthogonal(&a, &a, &[1.0; 3], &identity());
        for (i, row) in q.iter().enumerate() {
            for (j, x) in row.iter().enumerate() {
                assert!((x - f64::from(u8::from(i == j))).abs() < 1e-9, "{q:?}");
            }
        }
    }

    #[test]
    fn the_iteration_ends_at_the_polar_factor() {
        let mut random = Random::new(11);
        for condition in [1.0, 1e3, 1e6] {
            for _ in 0..50 {
                let x: [Vector<f64, 8>; 8] = std::array::from_fn(|r| {
                    let size = f64::powf(condition, -(r as f64) / 7.0);
                    std::array::from_fn(|_| size * random.signed())
                });
                let q = newton(&x).unwrap();
                // Q' Q = 1, and Q' X is symmetric; products of eight numbers of size 1.
                let product = |a: &[Vector<f64, 8>; 8], b: &[Vector<f64, 8>; 8], i: usize, j: usize| -> f64 {
                    (0..8).map(|k| a[k][i] * b[k][j]).sum()
                };
                for i in 0..8 {
                    for j in 0..8 {
                        assert!((product(&q, &q, i, j) - f64::from(u8::from(i == j))).abs() < 1e-14);
                        assert!((product(&q, &x, i, j) - product(&q, &x, j, i)).abs() < 1e-14);
                    }
                }
                // The decomposition loses small singular values: 1e-9 of the largest is not enough
                // at condition 1e6.
                let other = decomposed(&x).unwrap();
                let apart: [Vector<f64, 8>; 8] = std::array::from_fn(|r| sub(&q[r], &other[r]));
                assert!(condition > 1e4 || norm(&apart) < 1e-12 * condition, "{condition} {}", norm(&apart));
            }
        }
        // Rank one is left to the decomposition.
        let flat: [Vector<f64, 4>; 4] = std::array::from_fn(|r| [r as f64, 2.0 * r as f64, 0.0, 1.0 * r as f64]);
        assert!(newton(&flat).is_none() && decomposed(&flat).is_some());
    }

    #[test]
    fn no_weights_give_the_completion() {
        let a = [[1.0, 2.0, 3.0, 4.0], [0.0, 1.0, 0.0, 2.0]];
        assert_eq!(orthogonal(&a, &a, &[0.0; 2], &identity()), identity());
        assert_eq!(orthogonal(&[[f64::NAN; 4]; 2], &a, &[1.0; 2], &identity()), identity());
    }

    #[test]
    fn recovers_a_reflection() {
        let a: Vec<[f64; 4]> =
            (0..9).map(|i| std::array::from_fn(|k| f64::from((i * i * (k as i32 + 3) + 7 * i) % 11))).collect();
        let b: Vec<[f64; 4]> = a.iter().map(|p| [p[1] + 5.0, -p[0], p[2], p[3]]).collect();
        let q = orthogonal(&a, &b, &[1.0; 9], &identity());
        let want = [[0.0, 1.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
        for (row, expected) in q.iter().zip(want) {
            for (x, y) in row.iter().zip(expected) {
                assert!((x - y).abs() < 1e-5, "{q:?}");
            }
        }
    }
}
