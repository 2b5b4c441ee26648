//! The loops over rings and vertices, one frame a lane.

use super::WIDTH;
use super::ring::{self, Ring, Slope};
use super::vector::{Row, Row3, ZERO, add, add_scaled, choose, cross, dot, load, store, sub, zero};
use crate::encoding::Stencils;
use crate::engine::{Lane, Sweep};
use crate::geometry::NONE;

/// Rings of a stage with their coefficients in single precision.
#[derive(Clone, Copy)]
pub(super) struct Rings<'a> {
    pub(super) stencils: &'a Stencils,
    pub(super) w: &'a [f32],
    pub(super) b: &'a [f32],
}

impl<'a> Rings<'a> {
    #[inline(always)]
    fn ring(self, row: usize) -> Ring<'a> {
        let slots = self.stencils.slots(row);
        Ring { vertices: &self.stencils.neighbour[slots.clone()], w: &self.w[slots.clone()], b: &self.b[slots] }
    }
}

/// A derivative as it is kept: see [`Slope`].
#[derive(Clone, Copy)]
pub(super) struct SlopeRow {
    normal: Row3,
    inverse_length: Row,
    offset: Row,
    g: Row3,
    h: Row3,
}

impl SlopeRow {
    pub(super) const NONE: Self =
        Self { normal: ZERO, inverse_length: [0.0; WIDTH], offset: [0.0; WIDTH], g: ZERO, h: ZERO };

    #[inline(always)]
    fn load<L: Lane<E = f32>>(&self, cpu: L::Cpu, at: usize) -> Slope<L> {
        Slope {
            normal: load(cpu, &self.normal, at),
            inverse_length: L::load(cpu, &self.inverse_length[at..]),
            offset: L::load(cpu, &self.offset[at..]),
            g: load(cpu, &self.g, at),
            h: load(cpu, &self.h, at),
        }
    }

    #[inline(always)]
    fn store<L: Lane<E = f32>>(&mut self, slope: &Slope<L>, at: usize) {
        store(slope.normal, &mut self.normal, at);
        slope.inverse_length.store(&mut self.inverse_length[at..]);
        slope.offset.store(&mut self.offset[at..]);
        store(slope.g, &mut self.g, at);
        store(slope.h, &mut self.h, at);
    }
}

/// Rows whose squares are added in single precision before they join a sum in double precision.
const BLOCK: usize = 64;

/// A sum over rows, a lane each.
struct Total<'a> {
    part: Row,
    rows: usize,
    into: &'a mut [f64; WIDTH],
}

impl<'a> Total<'a> {
    #[inline(always)]
    fn new(into: &'a mut [f64; WIDTH]) -> Self {
        Self { part: [0.0; WIDTH], rows: 0, into }
    }

    #[inline(always)]
    fn add<L: Lane<E = f32>>(&mut self, cpu: L::Cpu, x: L, at: usize) {
        add_to(cpu, x, &mut self.part, at);
    }

    /// All lanes have their part of a row.
    #[inline(always)]
    fn end_row(&mut self) {
        self.rows += 1;
        if self.rows == BLOCK {
            self.flush();
        }
    }

    #[inline(always)]
    fn flush(&mut self) {
        for lane in 0..WIDTH {
            self.into[lane] += f64::from(self.part[lane]);
        }
        (self.part, self.rows) = ([0.0; WIDTH], 0);
    }
}

/// Sets the vertices of a level of splits from their rings.
pub(super) struct Split<'a> {
    pub(super) rings: Rings<'a>,
    pub(super) rows: std::ops::Range<usize>,
    pub(super) positions: &'a mut [Row3],
}

impl Sweep<f32> for Split<'_> {
    #[inline(always)]
    fn run<L: Lane<E = f32>>(self, cpu: L::Cpu) {
        for row in self.rows {
            for at in (0..WIDTH).step_by(L::N) {
                let f = ring::value::<L>(cpu, self.positions, self.rings.ring(row), at);
                store(f, &mut self.positions[self.rings.stencils.vertex[row] as usize], at);
            }
        }
    }
}

/// v_{k+1} - v_{k-1} around a ring.
#[inline(always)]
fn chord<L: Lane<E = f32>>(cpu: L::Cpu, positions: &[Row3], ring: &[u32], k: usize, at: usize) -> [L; 3] {
    let m = ring.len();
    let next = if k + 1 == m { 0 } else { k + 1 };
    let before = if k == 0 { m - 1 } else { k - 1 };
    sub(load(cpu, &positions[ring[next] as usize], at), load(cpu, &positions[ring[before] as usize], at))
}

/// Adds (I - dF)ᵀ y of one row to `out`.
#[inline(always)]
#[expect(clippy::too_many_arguments, reason = "the parts of one row")]
fn scatter<L: Lane<E = f32>>(
    cpu: L::Cpu,
    positions: &[Row3],
    vertex: u32,
    ring: Ring<'_>,
    slope: &Slope<L>,
    z: &[Row3],
    y: [L; 3],
    out: &mut [Row3],
    at: usize,
) {
    let own = &mut out[vertex as usize];
    store(add(load(cpu, own, at), y), own, at);
    let (along, curl, mean) = slope.transpose(y);
    for k in 0..ring.vertices.len() {
        let a = chord::<L>(cpu, positions, ring.vertices, k, at);
        let part = add(add_scaled(cross(curl, a), mean, L::splat(cpu, ring.w[k])), scale_z(cpu, &z[k], along, at));
        let to = &mut out[ring.vertices[k] as usize];
        store(sub(load(cpu, to, at), part), to, at);
    }
}

#[inline(always)]
fn scale_z<L: Lane<E = f32>>(cpu: L::Cpu, z: &Row3, s: L, at: usize) -> [L; 3] {
    super::vector::scale(load(cpu, z, at), s)
}

/// The upper half of a symmetric block: xx, xy, xz, yy, yz, zz.
pub(super) type Block = [Row; 6];
/// No block.
pub(super) const NO_BLOCK: Block = [[0.0; WIDTH]; 6];

/// Residuals at `positions`: their energy, the derivative of all rows, the gradient
/// (I - dF)ᵀ(V - F), and the blocks on the diagonal of (I - dF)ᵀ(I - dF).
pub(super) struct Linearise<'a> {
    pub(super) rings: Rings<'a>,
    pub(super) positions: &'a [Row3],
    pub(super) slopes: &'a mut [SlopeRow],
    pub(super) z: &'a mut [Row3],
    pub(super) gradient: &'a mut [Row3],
    pub(super) diagonal: &'a mut [Block],
    pub(super) squares: &'a mut [f64; WIDTH],
}

impl Sweep<f32> for Linearise<'_> {
    #[inline(always)]
    fn run<L: Lane<E = f32>>(self, cpu: L::Cpu) {
        let Self { rings, positions, slopes, z, gradient, diagonal, squares } = self;
        let mut total = Total::new(squares);
        for (row, kept) in slopes.iter_mut().enumerate() {
            let (ring, vertex) = (rings.ring(row), rings.stencils.vertex[row]);
            let z = &mut z[rings.stencils.slots(row)];
            for at in (0..WIDTH).step_by(L::N) {
                let (f, slope) = ring::linearise::<L>(cpu, positions, ring, at, z);
                kept.store(&slope, at);
                let y = sub(load(cpu, &positions[vertex as usize], at), f);
                total.add(cpu, dot(y, y), at);
                scatter(cpu, positions, vertex, ring, &slope, z, y, gradient, at);
                for k in 0..ring.vertices.len() {
                    let columns = columns::<L>(cpu, positions, ring, &slope, &z[k], k, at);
                    let to = &mut diagonal[ring.vertices[k] as usize];
                    add_to(cpu, dot(columns[0], columns[0]), &mut to[0], at);
                    add_to(cpu, dot(columns[0], columns[1]), &mut to[1], at);
                    add_to(cpu, dot(columns[0], columns[2]), &mut to[2], at);
                    add_to(cpu, dot(columns[1], columns[1]), &mut to[3], at);
                    add_to(cpu, dot(columns[1], columns[2]), &mut to[4], at);
                    add_to(cpu, dot(columns[2], columns[2]), &mut to[5], at);
                }
            }
            total.end_row();
        }
        total.flush();
    }
}

#[inline(always)]
fn add_to<L: Lane<E = f32>>(cpu: L::Cpu, x: L, row: &mut Row, at: usize) {
    (L::load(cpu, &row[at..]) + x).store(&mut row[at..]);
}

/// The columns of dF/dv_k.
#[inline(always)]
fn columns<L: Lane<E = f32>>(
    cpu: L::Cpu,
    positions: &[Row3],
    ring: Ring<'_>,
    slope: &Slope<L>,
    z: &Row3,
    k: usize,
    at: usize,
) -> [[L; 3]; 3] {
    let (none, one) = (L::num(cpu, 0.0), L::num(cpu, 1.0));
    let a = chord::<L>(cpu, positions, ring.vertices, k, at);
    let (w, z) = (L::splat(cpu, ring.w[k]), load::<L>(cpu, z, at));
    [
        column(slope, a, [one, none, none], w, z[0]),
        column(slope, a, [none, one, none], w, z[1]),
        column(slope, a, [none, none, one], w, z[2]),
    ]
}

/// One of them, for the unit vector `e`.
#[inline(always)]
fn column<L: Lane>(slope: &Slope<L>, chord: [L; 3], e: [L; 3], w: L, z: L) -> [L; 3] {
    slope.apply(super::vector::scale(e, w), cross(chord, e), z)
}

/// Turns the blocks on the diagonal into their inverses; that of a vertex with a row of its own has
/// one more on the diagonal. A block that has no inverse becomes the inverse of its own diagonal.
pub(super) struct Invert<'a> {
    pub(super) row_of: &'a [u32],
    pub(super) diagonal: &'a mut [Block],
}

impl Sweep<f32> for Invert<'_> {
    #[inline(always)]
    fn run<L: Lane<E = f32>>(self, cpu: L::Cpu) {
        let none = L::num(cpu, 0.0);
        for (block, &row) in self.diagonal.iter_mut().zip(self.row_of) {
            let own = L::num(cpu, if row == NONE { 0.0 } else { 1.0 });
            for at in (0..WIDTH).step_by(L::N) {
                let [xx, xy, xz, yy, yz, zz] = load_block::<L>(cpu, block, at);
                let (xx, yy, zz) = (xx + own, yy + own, zz + own);
                let (cxx, cxy, cxz) = (yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy);
                let (cyy, cyz, czz) = (xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy);
                let determinant = xx * cxx + xy * cxy + xz * cxz;
                // Rounding of the determinant is a few times this much of its largest term.
                let sound = (xx * yy * zz * L::num(cpu, 1e-5)).lt(determinant);
                let over = L::num(cpu, 1.0) / determinant;
                keep(sound, cxx * over, plain(cpu, xx), &mut block[0], at);
                keep(sound, cxy * over, none, &mut block[1], at);
                keep(sound, cxz * over, none, &mut block[2], at);
                keep(sound, cyy * over, plain(cpu, yy), &mut block[3], at);
                keep(sound, cyz * over, none, &mut block[4], at);
                keep(sound, czz * over, plain(cpu, zz), &mut block[5], at);
            }
        }
    }
}

/// One over a positive number, zero of others.
#[inline(always)]
fn plain<L: Lane<E = f32>>(cpu: L::Cpu, d: L) -> L {
    let none = L::num(cpu, 0.0);
    L::select(none.lt(d), L::num(cpu, 1.0) / d, none)
}

/// `a` where `mask`, else `b`, into a row.
#[inline(always)]
fn keep<L: Lane<E = f32>>(mask: L::Mask, a: L, b: L, row: &mut Row, at: usize) {
    L::select(mask, a, b).store(&mut row[at..]);
}

#[inline(always)]
fn load_block<L: Lane<E = f32>>(cpu: L::Cpu, b: &Block, at: usize) -> [L; 6] {
    [
        L::load(cpu, &b[0][at..]),
        L::load(cpu, &b[1][at..]),
        L::load(cpu, &b[2][at..]),
        L::load(cpu, &b[3][at..]),
        L::load(cpu, &b[4][at..]),
        L::load(cpu, &b[5][at..]),
    ]
}

/// (I - dF)ᵀ(I - dF) `direction`, and the squares of (I - dF) `direction`. `direction` is zero for
/// held vertices; what is added to the product for them has no meaning.
pub(super) struct Product<'a> {
    pub(super) rings: Rings<'a>,
    pub(super) positions: &'a [Row3],
    pub(super) slopes: &'a [SlopeRow],
    pub(super) z: &'a [Row3],
    pub(super) direction: &'a [Row3],
    pub(super) product: &'a mut [Row3],
    pub(super) squares: &'a mut [f64; WIDTH],
}

impl Sweep<f32> for Product<'_> {
    #[inline(always)]
    fn run<L: Lane<E = f32>>(self, cpu: L::Cpu) {
        let Self { rings, positions, slopes, z, direction, product, squares } = self;
        let mut total = Total::new(squares);
        for (row, kept) in slopes.iter().enumerate() {
            let (ring, vertex) = (rings.ring(row), rings.stencils.vertex[row]);
            let z = &z[rings.stencils.slots(row)];
            for at in (0..WIDTH).step_by(L::N) {
                let slope = kept.load::<L>(cpu, at);
                let (mut dq, mut dc, mut ds) = (zero(cpu), zero(cpu), L::num(cpu, 0.0));
                for k in 0..ring.vertices.len() {
                    let x = load::<L>(cpu, &direction[ring.vertices[k] as usize], at);
                    dq = add_scaled(dq, x, L::splat(cpu, ring.w[k]));
                    dc = add(dc, cross(chord(cpu, positions, ring.vertices, k, at), x));
                    ds = ds + dot(load(cpu, &z[k], at), x);
                }
                let y = sub(load(cpu, &direction[vertex as usize], at), slope.apply(dq, dc, ds));
                total.add(cpu, dot(y, y), at);
                scatter(cpu, positions, vertex, ring, &slope, z, y, product, at);
            }
            total.end_row();
        }
        total.flush();
    }
}

/// A symmetric block times a vector.
#[inline(always)]
fn times<L: Lane<E = f32>>(cpu: L::Cpu, block: &Block, r: [L; 3], at: usize) -> [L; 3] {
    let [xx, xy, xz, yy, yz, zz] = load_block::<L>(cpu, block, at);
    [dot([xx, xy, xz], r), dot([xy, yy, yz], r), dot([xz, yz, zz], r)]
}

/// A step of conjugate gradients along `direction` where `alpha` is above zero, and the products of
/// the residual with the preconditioned one.
pub(super) struct Advance<'a> {
    pub(super) alpha: &'a Row,
    pub(super) direction: &'a [Row3],
    pub(super) product: &'a [Row3],
    pub(super) inverse: &'a [Block],
    pub(super) x: &'a mut [Row3],
    pub(super) residual: &'a mut [Row3],
    pub(super) products: &'a mut [f64; WIDTH],
}

impl Sweep<f32> for Advance<'_> {
    #[inline(always)]
    fn run<L: Lane<E = f32>>(self, cpu: L::Cpu) {
        let none = L::num(cpu, 0.0);
        let mut total = Total::new(self.products);
        for v in 0..self.x.len() {
            for at in (0..WIDTH).step_by(L::N) {
                let alpha = L::load(cpu, &self.alpha[at..]);
                let (x, r) = (load::<L>(cpu, &self.x[v], at), load::<L>(cpu, &self.residual[v], at));
                let next = add_scaled(x, load(cpu, &self.direction[v], at), alpha);
                let r = add_scaled(r, load(cpu, &self.product[v], at), -alpha);
                store(choose(none.lt(alpha), next, x), &mut self.x[v], at);
                store(r, &mut self.residual[v], at);
                total.add(cpu, dot(r, times(cpu, &self.inverse[v], r, at)), at);
            }
            total.end_row();
        }
        total.flush();
    }
}

/// The next direction: the preconditioned residual plus `beta` times the last direction.
pub(super) struct Turn<'a> {
    pub(super) beta: &'a Row,
    pub(super) residual: &'a [Row3],
    pub(super) inverse: &'a [Block],
    pub(super) direction: &'a mut [Row3],
}

impl Sweep<f32> for Turn<'_> {
    #[inline(always)]
    fn run<L: Lane<E = f32>>(self, cpu: L::Cpu) {
        for ((d, r), inverse) in self.direction.iter_mut().zip(self.residual).zip(self.inverse) {
            for at in (0..WIDTH).step_by(L::N) {
                let z = times(cpu, inverse, load(cpu, r, at), at);
                store(add_scaled(z, load(cpu, d, at), L::load(cpu, &self.beta[at..])), d, at);
            }
        }
    }
}

/// `positions` minus `alpha` times `x`, where `alpha` is above zero.
pub(super) struct Move<'a> {
    pub(super) alpha: &'a Row,
    pub(super) positions: &'a [Row3],
    pub(super) x: &'a [Row3],
    pub(super) trial: &'a mut [Row3],
}

impl Sweep<f32> for Move<'_> {
    #[inline(always)]
    fn run<L: Lane<E = f32>>(self, cpu: L::Cpu) {
        let none = L::num(cpu, 0.0);
        for ((p, x), to) in self.positions.iter().zip(self.x).zip(self.trial) {
            for at in (0..WIDTH).step_by(L::N) {
                let alpha = L::load(cpu, &self.alpha[at..]);
                let p = load::<L>(cpu, p, at);
                let moved = add_scaled(p, load(cpu, x, at), -alpha);
                store(choose(none.lt(alpha), moved, p), to, at);
            }
        }
    }
}

/// Squares of the residuals V - F.
pub(super) struct Squares<'a> {
    pub(super) rings: Rings<'a>,
    pub(super) positions: &'a [Row3],
    pub(super) squares: &'a mut [f64; WIDTH],
}

impl Sweep<f32> for Squares<'_> {
    #[inline(always)]
    fn run<L: Lane<E = f32>>(self, cpu: L::Cpu) {
        let mut total = Total::new(self.squares);
        for row in 0..self.rings.stencils.row_count() {
            let ring = self.rings.ring(row);
            let own = &self.positions[self.rings.stencils.vertex[row] as usize];
            for at in (0..WIDTH).step_by(L::N) {
                let y = sub(load(cpu, own, at), ring::value::<L>(cpu, self.positions, ring, at));
                total.add(cpu, dot(y, y), at);
            }
            total.end_row();
        }
        total.flush();
    }
}
