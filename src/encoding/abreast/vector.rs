//! Vectors of three numbers, each number one of every lane.
//!
//! Code that works on lanes has neither closures nor `map`: they are functions of their own, which
//! the compiler does not always inline, and what is not inlined loses the processor's instructions.

use super::WIDTH;
use crate::engine::Lane;

/// One number of each frame.
pub(super) type Row = [f32; WIDTH];
/// Three numbers of each frame.
pub(super) type Row3 = [Row; 3];

/// Zero.
pub(super) const ZERO: Row3 = [[0.0; WIDTH]; 3];

#[inline(always)]
pub(super) fn load<L: Lane<E = f32>>(cpu: L::Cpu, row: &Row3, at: usize) -> [L; 3] {
    [L::load(cpu, &row[0][at..]), L::load(cpu, &row[1][at..]), L::load(cpu, &row[2][at..])]
}

#[inline(always)]
pub(super) fn store<L: Lane<E = f32>>(v: [L; 3], row: &mut Row3, at: usize) {
    v[0].store(&mut row[0][at..]);
    v[1].store(&mut row[1][at..]);
    v[2].store(&mut row[2][at..]);
}

#[inline(always)]
pub(super) fn zero<L: Lane<E = f32>>(cpu: L::Cpu) -> [L; 3] {
    [L::num(cpu, 0.0); 3]
}

#[inline(always)]
pub(super) fn add<L: Lane>(a: [L; 3], b: [L; 3]) -> [L; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
pub(super) fn sub<L: Lane>(a: [L; 3], b: [L; 3]) -> [L; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub(super) fn scale<L: Lane>(a: [L; 3], s: L) -> [L; 3] {
    [a[0] * s, a[1] * s, a[2] * s]
}

/// a + s b.
#[inline(always)]
pub(super) fn add_scaled<L: Lane>(a: [L; 3], b: [L; 3], s: L) -> [L; 3] {
    [b[0].mul_add(s, a[0]), b[1].mul_add(s, a[1]), b[2].mul_add(s, a[2])]
}

#[inline(always)]
pub(super) fn dot<L: Lane>(a: [L; 3], b: [L; 3]) -> L {
    a[2].mul_add(b[2], a[1].mul_add(b[1], a[0] * b[0]))
}

#[inline(always)]
pub(super) fn cross<L: Lane>(a: [L; 3], b: [L; 3]) -> [L; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The part of `a` across the unit vector `n`.
#[inline(always)]
pub(super) fn across<L: Lane>(a: [L; 3], n: [L; 3]) -> [L; 3] {
    add_scaled(a, n, -dot(n, a))
}

/// `a` where `mask`, else `b`.
#[inline(always)]
pub(super) fn choose<L: Lane>(mask: L::Mask, a: [L; 3], b: [L; 3]) -> [L; 3] {
    [L::select(mask, a[0], b[0]), L::select(mask, a[1], b[1]), L::select(mask, a[2], b[2])]
}
