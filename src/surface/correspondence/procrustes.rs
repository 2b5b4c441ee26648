//! Orthogonal maps between point sets.

use nalgebra::DMatrix;

use crate::surface::vector::{Vector, sub};

/// Part of another map that completes a covariance of low rank.
const COMPLETION: f64 = 1e-6;

/// The identity.
pub(crate) fn identity<const D: usize>() -> [Vector<f64, D>; D] {
    std::array::from_fn(|r| std::array::from_fn(|c| if r == c { 1.0 } else { 0.0 }))
}

/// The orthogonal matrix `Q` (row order, reflections allowed) that minimises `sum w_i |(b_i - b) - Q (a_i - a)|^2` about the weighted means: polar factor
/// of the cross-covariance by its singular value decomposition.
///
/// Directions the points do not span (fewer than `D + 1` of them, or none but a few with a weight that counts) are completed as near to `completion` as possible: a millionth of it is
/// added, so that with the identity equal point sets of any number give the identity.
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
    let mut covariance = DMatrix::<f64>::zeros(D, D);
    for ((p, q), w) in a.iter().zip(b).zip(weights) {
        let (p, q) = (sub(p, &am), sub(q, &bm));
        for c in 0..D {
            for r in 0..D {
                covariance[(r, c)] += w * q[r] * p[c];
            }
        }
    }
    let size = covariance.norm();
    for r in 0..D {
        for c in 0..D {
            covariance[(r, c)] += COMPLETION * size * completion[r][c];
        }
    }
    // Without weights there are no means; the decomposition does not end on what is not finite.
    if !covariance.iter().all(|x| x.is_finite()) {
        return *completion;
    }
    let svd = covariance.svd(true, true);
    let (Some(u), Some(vt)) = (svd.u, svd.v_t) else {
        return *completion;
    };
    let q = u * vt;
    std::array::from_fn(|r| std::array::from_fn(|c| q[(r, c)]))
}

#[cfg(test)]
mod tests {
    use super::*;

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
