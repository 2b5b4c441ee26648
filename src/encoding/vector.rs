//! Vectors of three numbers, generic over the scalar.

use crate::engine::Real;

/// Three coordinates.
pub type V3<R> = [R; 3];

#[inline(always)]
pub(crate) fn zero<R: Real>() -> V3<R> {
    [R::ZERO; 3]
}

#[inline(always)]
pub(crate) fn add<R: Real>(a: V3<R>, b: V3<R>) -> V3<R> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
pub(crate) fn sub<R: Real>(a: V3<R>, b: V3<R>) -> V3<R> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub(crate) fn scale<R: Real>(a: V3<R>, s: R) -> V3<R> {
    [a[0] * s, a[1] * s, a[2] * s]
}

/// a + s b.
#[inline(always)]
pub(crate) fn add_scaled<R: Real>(a: V3<R>, b: V3<R>, s: R) -> V3<R> {
    [a[0] + b[0] * s, a[1] + b[1] * s, a[2] + b[2] * s]
}

#[inline(always)]
pub(crate) fn dot<R: Real>(a: V3<R>, b: V3<R>) -> R {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(crate) fn cross<R: Real>(a: V3<R>, b: V3<R>) -> V3<R> {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline(always)]
pub(crate) fn length<R: Real>(a: V3<R>) -> R {
    dot(a, a).sqrt()
}
