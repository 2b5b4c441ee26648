//! Vectors of the embedding space.

use crate::engine::Real;

/// A vector of R^D. `D` is a multiple of four, so that sums run in four independent chains.
pub type Vector<S, const D: usize> = [S; D];

/// `a - b`.
#[inline(always)]
pub fn sub<S: Real, const D: usize>(a: &Vector<S, D>, b: &Vector<S, D>) -> Vector<S, D> {
    let mut r = [S::ZERO; D];
    for i in 0..D {
        r[i] = a[i] - b[i];
    }
    r
}

/// `a + s b`.
#[inline(always)]
pub fn add_scaled<S: Real, const D: usize>(a: &Vector<S, D>, s: S, b: &Vector<S, D>) -> Vector<S, D> {
    let mut r = *a;
    for i in 0..D {
        r[i] += s * b[i];
    }
    r
}

/// `s a`.
#[inline(always)]
pub fn scaled<S: Real, const D: usize>(s: S, a: &Vector<S, D>) -> Vector<S, D> {
    a.map(|x| s * x)
}

/// Scalar product, summed in four chains and then pairwise: the same order as the kernels' `vec4`
/// form allows, and one that vectorises without reassociation.
#[inline(always)]
pub fn dot<S: Real, const D: usize>(a: &Vector<S, D>, b: &Vector<S, D>) -> S {
    let mut acc = [S::ZERO; 4];
    let mut i = 0;
    while i + 4 <= D {
        for k in 0..4 {
            acc[k] += a[i + k] * b[i + k];
        }
        i += 4;
    }
    (acc[0] + acc[1]) + (acc[2] + acc[3])
}

/// Squared distance.
#[inline(always)]
pub fn distance_squared<S: Real, const D: usize>(a: &Vector<S, D>, b: &Vector<S, D>) -> S {
    let d = sub(a, b);
    dot(&d, &d)
}

/// `b[0] x[0] + b[1] x[1] + b[2] x[2]`.
#[inline(always)]
pub fn combine<S: Real, const D: usize>(b: &[S; 3], x: [&Vector<S, D>; 3]) -> Vector<S, D> {
    let mut r = [S::ZERO; D];
    for i in 0..D {
        r[i] = b[0] * x[0][i] + b[1] * x[1][i] + b[2] * x[2][i];
    }
    r
}

/// Converts the scalars.
pub fn cast<S: Real, T: Real, const D: usize>(a: &Vector<S, D>) -> Vector<T, D> {
    a.map(|x| T::of(x.to_f64()))
}
