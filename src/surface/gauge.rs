//! The matrices `G_k` that bring the six bases of a triangle as close together as possible (paper,
//! eq. 10 and 12).

use super::psi::{Matrix2, Orthogonal2, times};
use super::vector::{Vector, add_scaled, dot, scaled};

/// Sweeps of the alternating minimisation; a dozen reach rounding on ordinary meshes.
const SWEEPS: usize = 200;
/// Change of the matrices below which the minimisation stops.
const TOLERANCE: f64 = 1e-13;

fn rotated<const D: usize>(r: Orthogonal2<f64>, t: &[Vector<f64, D>; 2]) -> [Vector<f64, D>; 2] {
    let m = r.matrix();
    [add_scaled(&scaled(m[0], &t[0]), m[1], &t[1]), add_scaled(&scaled(m[2], &t[0]), m[3], &t[1])]
}

/// `A B^T` of two bases.
fn cross<const D: usize>(a: &[Vector<f64, D>; 2], b: &[Vector<f64, D>; 2]) -> Matrix2<f64> {
    [dot(&a[0], &b[0]), dot(&a[0], &b[1]), dot(&a[1], &b[0]), dot(&a[1], &b[1])]
}

fn add(a: Matrix2<f64>, b: Matrix2<f64>) -> Matrix2<f64> {
    std::array::from_fn(|i| a[i] + b[i])
}

fn transpose(a: Matrix2<f64>) -> Matrix2<f64> {
    [a[0], a[2], a[1], a[3]]
}

/// `G_1..G_6` for the orthonormal tangent bases `T_1, T_2, T_3` of a triangle's vertices, with `E12
/// = I`.
///
/// With `X12 = R12 T1 + T2` and its cyclic relatives the objective of eq. 12 is, up to constants,
/// `-<E12 X12, E23 X23> - <E23 X23, E31 X31> - <E31 X31, E12 X12>`, because `|A_k|` is constant and
/// `E_ij` does not change the distance of its own pair. Fixing two matrices, the third is `Ort` of
/// a sum of products of the 2x2 matrices `X_a X_b^T`. The start is independent of the bases chosen
/// for the planes, and so is the result as a set of planes.
pub fn gauge<const D: usize>(t: [&[Vector<f64, D>; 2]; 3]) -> [Orthogonal2<f64>; 6] {
    let [t1, t2, t3] = t;
    let r12 = Orthogonal2::nearest(cross(t2, t1));
    let r23 = Orthogonal2::nearest(cross(t3, t2));
    let r31 = Orthogonal2::nearest(cross(t1, t3));
    let sum = |r, a: &[Vector<f64, D>; 2], b: &[Vector<f64, D>; 2]| {
        let ra = rotated(r, a);
        [add_scaled(&ra[0], 1.0, &b[0]), add_scaled(&ra[1], 1.0, &b[1])]
    };
    let (x12, x23, x31) = (sum(r12, t1, t2), sum(r23, t2, t3), sum(r31, t3, t1));
    let (m12_23, m12_31, m23_31) = (cross(&x12, &x23), cross(&x12, &x31), cross(&x23, &x31));
    let mut e12 = Orthogonal2::IDENTITY;
    let mut e23 = Orthogonal2::nearest(m12_23);
    let mut e31 = Orthogonal2::nearest(add(m12_31, times(e23.matrix(), m23_31)));
    for _ in 0..SWEEPS {
        let before = [e12, e23, e31];
        e12 = Orthogonal2::nearest(add(times(e23.matrix(), transpose(m12_23)), times(e31.matrix(), transpose(m12_31))));
        e23 = Orthogonal2::nearest(add(times(e31.matrix(), transpose(m23_31)), times(e12.matrix(), m12_23)));
        e31 = Orthogonal2::nearest(add(times(e12.matrix(), m12_31), times(e23.matrix(), m23_31)));
        let change = [e12, e23, e31]
            .iter()
            .zip(before)
            .map(|(a, b)| (a.c - b.c).abs() + (a.s - b.s).abs() + (a.f - b.f).abs())
            .fold(0.0, f64::max);
        if change < TOLERANCE {
            break;
        }
    }
    let left = e12.transpose();
    let (e23, e31) = (left.times(e23), left.times(e31));
    [r12, Orthogonal2::IDENTITY, e23.times(r23), e23, e31.times(r31), e31]
}
