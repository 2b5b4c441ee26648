//! F of a ring and its derivative, one frame a lane. The formulas are those of `decode` and
//! `derivative`, which the tests hold these against.

use super::vector::{Row3, across, add, add_scaled, cross, dot, load, scale, sub, zero};
use crate::encoding::decode::REGULARISATION;
use crate::engine::Lane;

/// A ring: its vertices and their coefficients.
#[derive(Clone, Copy)]
pub(super) struct Ring<'a> {
    pub(super) vertices: &'a [u32],
    pub(super) w: &'a [f32],
    pub(super) b: &'a [f32],
}

/// What all terms of F share, relative to the ring's first vertex; see `decode::Frame`.
pub(super) struct Shape<L> {
    pub(super) origin: [L; 3],
    pub(super) normal: [L; 3],
    pub(super) inverse_length: L,
    pub(super) centre: [L; 3],
    pub(super) mean: [L; 3],
    regular: L,
}

impl<L: Lane<E = f32>> Shape<L> {
    #[inline(always)]
    pub(super) fn new(cpu: L::Cpu, positions: &[Row3], ring: Ring<'_>, at: usize) -> Self {
        let m = ring.vertices.len();
        let origin = load::<L>(cpu, &positions[ring.vertices[0] as usize], at);
        let (mut c, mut centre, mut mean) = (zero(cpu), zero(cpu), zero(cpu));
        let mut square = L::num(cpu, 0.0);
        let mut before = sub(load(cpu, &positions[ring.vertices[m - 1] as usize], at), origin);
        for k in 0..m {
            let p = sub(load(cpu, &positions[ring.vertices[k] as usize], at), origin);
            c = add(c, cross(p, before));
            centre = add_scaled(centre, p, L::splat(cpu, ring.w[k]));
            mean = add(mean, p);
            square = square + dot(p, p);
            before = p;
        }
        let inverse = L::num(cpu, 1.0 / m as f64);
        let mean = scale(mean, inverse);
        let none = L::num(cpu, 0.0);
        let spread = (square * inverse - dot(mean, mean)).maximum(none);
        let area = dot(c, c).sqrt();
        // Comparisons with what is not a number are false: such a ring has no direction.
        let plain = none.lt(area);
        let inverse_length = L::select(plain, L::num(cpu, 1.0) / area, none);
        Self {
            origin,
            normal: scale(c, inverse_length),
            inverse_length,
            centre,
            mean,
            regular: spread * L::num(cpu, REGULARISATION * REGULARISATION),
        }
    }

    /// Offset of the weighted mean from `p`: its part along the normal, its part in the plane, and
    /// the regularised length of that.
    #[inline(always)]
    fn offset(&self, p: [L; 3]) -> (L, [L; 3], L) {
        let r = sub(self.centre, p);
        let along = dot(self.normal, r);
        let plane = add_scaled(r, self.normal, -along);
        (along, plane, (dot(plane, plane) + self.regular).sqrt())
    }
}

/// F of a ring (equation 13).
#[inline(always)]
pub(super) fn value<L: Lane<E = f32>>(cpu: L::Cpu, positions: &[Row3], ring: Ring<'_>, at: usize) -> [L; 3] {
    let shape = Shape::<L>::new(cpu, positions, ring, at);
    let mut s = L::num(cpu, 0.0);
    for k in 0..ring.vertices.len() {
        let p = sub(load(cpu, &positions[ring.vertices[k] as usize], at), shape.origin);
        let (_, _, d) = shape.offset(p);
        s = d.mul_add(L::splat(cpu, ring.w[k] * ring.b[k]), s);
    }
    add(shape.origin, add_scaled(shape.centre, shape.normal, s))
}

/// The derivative of F of one ring; see `derivative::RowDerivative`.
#[derive(Clone, Copy)]
pub(super) struct Slope<L> {
    pub(super) normal: [L; 3],
    pub(super) inverse_length: L,
    pub(super) offset: L,
    pub(super) g: [L; 3],
    pub(super) h: [L; 3],
}

/// F of a ring, and its derivative; z_k goes into `z`.
#[inline(always)]
pub(super) fn linearise<L: Lane<E = f32>>(
    cpu: L::Cpu,
    positions: &[Row3],
    ring: Ring<'_>,
    at: usize,
    z: &mut [Row3],
) -> ([L; 3], Slope<L>) {
    let shape = Shape::<L>::new(cpu, positions, ring, at);
    let none = L::num(cpu, 0.0);
    let (mut offset, mut kappa) = (none, none);
    let (mut g, mut h) = (zero(cpu), zero(cpu));
    for k in 0..ring.vertices.len() {
        let p = sub(load(cpu, &positions[ring.vertices[k] as usize], at), shape.origin);
        let (along, plane, d) = shape.offset(p);
        let wb = L::splat(cpu, ring.w[k] * ring.b[k]);
        // All neighbours at one place: no direction.
        let over = wb * L::select(none.lt(d), L::num(cpu, 1.0) / d, none);
        let u = scale(plane, over);
        offset = d.mul_add(wb, offset);
        g = add(g, u);
        h = add_scaled(h, u, along);
        super::vector::store(scale(u, -L::num(cpu, 1.0)), &mut z[k], at);
        kappa = kappa + over;
    }
    kappa = kappa * L::num(cpu, REGULARISATION * REGULARISATION / ring.vertices.len() as f64);
    for k in 0..ring.vertices.len() {
        let p = sub(load(cpu, &positions[ring.vertices[k] as usize], at), shape.origin);
        let all = add_scaled(load(cpu, &z[k], at), sub(p, shape.mean), kappa);
        super::vector::store(all, &mut z[k], at);
    }
    let f = add(shape.origin, add_scaled(shape.centre, shape.normal, offset));
    (f, Slope { normal: shape.normal, inverse_length: shape.inverse_length, offset, g, h })
}

impl<L: Lane> Slope<L> {
    /// What a row passes on to its neighbours in the transposed product of `y`; see
    /// `derivative::RowTranspose`.
    #[inline(always)]
    pub(super) fn transpose(&self, y: [L; 3]) -> (L, [L; 3], [L; 3]) {
        let along = dot(self.normal, y);
        let c = add_scaled(scale(y, self.offset), self.h, -along);
        let curl = scale(across(c, self.normal), self.inverse_length);
        (along, curl, add_scaled(y, self.g, along))
    }

    /// dF of sums over the ring: dq = sum w x, dc = sum chord x x, ds = sum z.x.
    #[inline(always)]
    pub(super) fn apply(&self, dq: [L; 3], dc: [L; 3], ds: L) -> [L; 3] {
        let dn = scale(across(dc, self.normal), self.inverse_length);
        let ds = ds + dot(self.g, dq) - dot(self.h, dn);
        add_scaled(add_scaled(dq, dn, self.offset), self.normal, ds)
    }
}
