//! Orthogonal maps between point sets.

use nalgebra::DMatrix;

use crate::surface::vector::Vector;

/// The orthogonal matrix `Q` (row order, reflections allowed) that minimises `sum |(b_i - b) - Q (a_i - a)|^2` about the means: polar factor
/// of the cross-covariance by its singular value decomposition.
///
/// Directions the anchors do not span (fewer than `D + 1` of them) are completed by the decomposition's own singular vectors, which is
/// arbitrary but deterministic and orthogonal.
pub(super) fn orthogonal<const D: usize>(a: &[Vector<f64, D>], b: &[Vector<f64, D>]) -> [[f64; D]; D] {
    let mean = |x: &[Vector<f64, D>]| -> Vector<f64, D> {
        std::array::from_fn(|i| x.iter().map(|p| p[i]).sum::<f64>() / x.len() as f64)
    };
    let (am, bm) = (mean(a), mean(b));
    let covariance =
        DMatrix::from_fn(D, D, |r, c| a.iter().zip(b).map(|(p, q)| (q[r] - bm[r]) * (p[c] - am[c])).sum::<f64>());
    let svd = covariance.svd(true, true);
    let (Some(u), Some(vt)) = (svd.u, svd.v_t) else {
        return std::array::from_fn(|r| std::array::from_fn(|c| if r == c { 1.0 } else { 0.0 }));
    };
    let q = u * vt;
    std::array::from_fn(|r| std::array::from_fn(|c| q[(r, c)]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recovers_a_reflection() {
        let a: Vec<[f64; 4]> =
            (0..9).map(|i| std::array::from_fn(|k| f64::from((i * i * (k as i32 + 3) + 7 * i) % 11))).collect();
        let b: Vec<[f64; 4]> = a.iter().map(|p| [p[1] + 5.0, -p[0], p[2], p[3]]).collect();
        let q = orthogonal(&a, &b);
        let want = [[0.0, 1.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
        for (row, expected) in q.iter().zip(want) {
            for (x, y) in row.iter().zip(expected) {
                assert!((x - y).abs() < 1e-12, "{q:?}");
            }
        }
    }
}
