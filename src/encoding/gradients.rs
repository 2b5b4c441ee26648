//! Conjugate gradients on (I - dF)ᵀ(I - dF) with the blocks of dF, for stages too large to
//! factorise.

use rayon::prelude::*;

use super::decode::BLOCK;
use super::derivative::{Linearisation, blocks};
use super::springs::Stretch;
use super::vector::dot;
use super::{Encoding, Stencils, V3};
use crate::engine::Real;
use crate::geometry::NONE;

/// (I - dF)ᵀ y for the vertices from `held` on; the entries before are left as they are.
pub(crate) fn apply_transpose(stencils: &Stencils, blocks: &[[f64; 9]], y: &[V3<f64>], held: usize, x: &mut [V3<f64>]) {
    x[held..].par_chunks_mut(BLOCK).enumerate().for_each(|(block, part)| {
        for (v, out) in (held + block * BLOCK..).zip(part) {
            let own = stencils.row_of[v];
            let mut sum = if own == NONE { [0.0; 3] } else { y[own as usize] };
            for &slot in stencils.incoming(v) {
                sum = minus_transposed(sum, &blocks[slot as usize], y[stencils.slot_row[slot as usize] as usize]);
            }
            *out = sum;
        }
    });
}

/// (I - dF) x for every row.
pub(crate) fn apply(stencils: &Stencils, blocks: &[[f64; 9]], x: &[V3<f64>], y: &mut [V3<f64>]) {
    y.par_chunks_mut(BLOCK).enumerate().for_each(|(block, part)| {
        for (row, out) in (block * BLOCK..).zip(part) {
            let slots = stencils.slots(row);
            let ring = &stencils.neighbour[slots.clone()];
            *out = blocks[slots]
                .iter()
                .zip(ring)
                .fold(x[stencils.vertex[row] as usize], |sum, (b, &v)| minus(sum, b, x[v as usize]));
        }
    });
}

/// a - B x for a block by rows.
#[inline(always)]
fn minus(a: V3<f64>, b: &[f64; 9], x: V3<f64>) -> V3<f64> {
    [
        a[0] - (b[0] * x[0] + b[1] * x[1] + b[2] * x[2]),
        a[1] - (b[3] * x[0] + b[4] * x[1] + b[5] * x[2]),
        a[2] - (b[6] * x[0] + b[7] * x[1] + b[8] * x[2]),
    ]
}

/// a - Bᵀ x.
#[inline(always)]
fn minus_transposed(a: V3<f64>, b: &[f64; 9], x: V3<f64>) -> V3<f64> {
    [
        a[0] - (b[0] * x[0] + b[3] * x[1] + b[6] * x[2]),
        a[1] - (b[1] * x[0] + b[4] * x[1] + b[7] * x[2]),
        a[2] - (b[2] * x[0] + b[5] * x[1] + b[8] * x[2]),
    ]
}

/// Sum of products, in blocks: the same for any number of threads. CPU reference of the kernel
/// `dot`.
pub fn dot_product<R: Real>(a: &[V3<R>], b: &[V3<R>]) -> f64 {
    let blocks: Vec<f64> = a
        .par_chunks(BLOCK)
        .zip(b.par_chunks(BLOCK))
        .map(|(a, b)| a.iter().zip(b).map(|(&a, &b)| dot(a, b).to_f64()).sum())
        .collect();
    blocks.iter().sum()
}

/// One over the diagonal of (I - dF)ᵀ(I - dF) and of the springs, if there are any; zero for held
/// vertices.
fn inverse_diagonal(stencils: &Stencils, blocks: &[[f64; 9]], springs: &[Stretch], held: usize) -> Vec<V3<f64>> {
    let mut inverse = vec![[0.0; 3]; stencils.vertex_count()];
    for (v, inverse) in inverse.iter_mut().enumerate().skip(held) {
        let mut sum = [if stencils.row_of[v] == NONE { 0.0 } else { 1.0 }; 3];
        let stiffen = |sum: V3<f64>, s: &Stretch| std::array::from_fn(|c| sum[c] + s.direction[c] * s.direction[c]);
        for &slot in stencils.incoming(v) {
            let b = &blocks[slot as usize];
            sum = std::array::from_fn(|c| sum[c] + b[c] * b[c] + b[3 + c] * b[3 + c] + b[6 + c] * b[6 + c]);
            sum = springs.get(slot as usize).map_or(sum, |s| stiffen(sum, s));
        }
        if stencils.row_of[v] != NONE {
            let own = springs.get(stencils.slots(stencils.row_of[v] as usize));
            sum = own.into_iter().flatten().fold(sum, stiffen);
        }
        *inverse = sum.map(|d| if d > 0.0 { 1.0 / d } else { 1.0 });
    }
    inverse
}

/// Jacobi's preconditioner: one over the diagonal of (I - dF)ᵀ(I - dF) at given positions; zero for
/// held vertices. CPU reference of the kernel `encoding_diagonal`.
pub fn encoding_diagonal(
    stencils: &Stencils,
    encoding: &Encoding<f64>,
    at: &Linearisation<f64>,
    positions: &[V3<f64>],
    held: usize,
) -> Vec<V3<f64>> {
    inverse_diagonal(stencils, &blocks(stencils, encoding, at, positions), &[], held)
}

/// A vector with a fourth number, zero: compilers work on four in step.
type Padded<R> = [R; 4];
/// The columns of a block.
type Columns<R> = [Padded<R>; 3];

/// a - B x.
#[inline(always)]
fn minus_columns<R: Real>(a: Padded<R>, b: &Columns<R>, x: Padded<R>) -> Padded<R> {
    std::array::from_fn(|c| a[c] - (b[0][c] * x[0] + b[1][c] * x[1] + b[2][c] * x[2]))
}

/// a + s b.
#[inline(always)]
fn add_padded<R: Real>(a: Padded<R>, b: Padded<R>, s: R) -> Padded<R> {
    std::array::from_fn(|c| a[c] + b[c] * s)
}

#[inline(always)]
fn dot_padded<R: Real>(a: Padded<R>, b: Padded<R>) -> R {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn padded<R: Real>(x: &V3<f64>) -> Padded<R> {
    [R::of(x[0]), R::of(x[1]), R::of(x[2]), R::ZERO]
}

/// Sum of products in blocks, as [`dot_product`].
fn sum_of_products<R: Real>(a: &[Padded<R>], b: &[Padded<R>]) -> f64 {
    let part = |(a, b): (&[Padded<R>], &[Padded<R>])| -> f64 {
        a.iter().zip(b).map(|(&a, &b)| dot_padded(a, b).to_f64()).sum()
    };
    let blocks: Vec<f64> = a.par_chunks(BLOCK).zip(b.par_chunks(BLOCK)).map(part).collect();
    blocks.iter().sum()
}

/// The matrix I - dF twice, by rows and by columns, so that both products stream through it; and
/// vectors kept between solves.
#[derive(Debug, Default)]
pub(crate) struct Gradients<R> {
    by_row: Vec<Columns<R>>,
    by_column: Vec<Columns<R>>,
    column_row: Vec<u32>,
    inverse_diagonal: Vec<Padded<R>>,
    /// Directions of the springs, a slot each, or none.
    springs: Vec<Padded<R>>,
    pulls: Vec<R>,
    x: Vec<Padded<R>>,
    residual: Vec<Padded<R>>,
    direction: Vec<Padded<R>>,
    rows: Vec<Padded<R>>,
    product: Vec<Padded<R>>,
}

impl<R: Real> Gradients<R> {
    /// Solves (I - dF)ᵀ(I - dF) x = `right` approximately for the vertices from `held` on:
    /// conjugate gradients with Jacobi's preconditioner from zero, at most `steps` steps or until
    /// the residual (in the preconditioner's norm) is `tolerance` times its first value. Returns
    /// the number of steps.
    ///
    /// Scalars are summed in double precision, in blocks: the same for any number of threads.
    #[expect(clippy::too_many_arguments, reason = "the parts of one equation")]
    pub(crate) fn solve(
        &mut self,
        stencils: &Stencils,
        blocks: &[[f64; 9]],
        springs: &[Stretch],
        held: usize,
        right: &[V3<f64>],
        steps: usize,
        tolerance: f64,
        x: &mut [V3<f64>],
    ) -> usize {
        self.load(stencils, blocks, springs, held, right);
        let inverse = &self.inverse_diagonal;
        let precondition = |r: Padded<R>, d: Padded<R>| -> Padded<R> { std::array::from_fn(|c| r[c] * d[c]) };
        self.direction.clear();
        self.direction.extend(self.residual.iter().zip(inverse).map(|(&r, &d)| precondition(r, d)));
        let mut rho = sum_of_products(&self.residual, &self.direction);
        let stop = rho * tolerance * tolerance;
        let mut done = 0;
        while done < steps && rho > stop && rho > 0.0 {
            self.apply(stencils);
            let pulled: f64 = self.pulls.iter().map(|p| p.to_f64() * p.to_f64()).sum();
            let curvature = sum_of_products(&self.rows, &self.rows) + pulled;
            if !(curvature > 0.0) || !curvature.is_finite() {
                break;
            }
            self.apply_transpose(stencils, held);
            let alpha = R::of(rho / curvature);
            let next: Vec<f64> = self
                .residual
                .par_chunks_mut(BLOCK)
                .zip(self.x.par_chunks_mut(BLOCK))
                .zip(self.product.par_chunks(BLOCK).zip(self.direction.par_chunks(BLOCK)))
                .zip(self.inverse_diagonal.par_chunks(BLOCK))
                .map(|(((r, x), (p, d)), inverse)| {
                    let mut sum = 0.0;
                    for k in 0..r.len() {
                        x[k] = add_padded(x[k], d[k], alpha);
                        r[k] = add_padded(r[k], p[k], R::ZERO - alpha);
                        sum += dot_padded(r[k], precondition(r[k], inverse[k])).to_f64();
                    }
                    sum
                })
                .collect();
            let next: f64 = next.iter().sum();
            let beta = R::of(next / rho);
            rho = next;
            self.direction
                .par_chunks_mut(BLOCK)
                .zip(self.residual.par_chunks(BLOCK))
                .zip(self.inverse_diagonal.par_chunks(BLOCK))
                .for_each(|((d, r), inverse)| {
                    for k in 0..d.len() {
                        d[k] = add_padded(precondition(r[k], inverse[k]), d[k], beta);
                    }
                });
            done += 1;
        }
        x.iter_mut().zip(&self.x).for_each(|(x, y)| *x = [y[0].to_f64(), y[1].to_f64(), y[2].to_f64()]);
        done
    }

    fn load(&mut self, stencils: &Stencils, blocks: &[[f64; 9]], springs: &[Stretch], held: usize, right: &[V3<f64>]) {
        let column = |b: &[f64; 9], at: [usize; 3]| padded(&at.map(|k| b[k]));
        let columns = |b: &[f64; 9]| [column(b, [0, 3, 6]), column(b, [1, 4, 7]), column(b, [2, 5, 8])];
        let rows = |b: &[f64; 9]| [column(b, [0, 1, 2]), column(b, [3, 4, 5]), column(b, [6, 7, 8])];
        let n = stencils.vertex_count();
        self.by_row.clear();
        self.by_row.extend(blocks.iter().map(columns));
        self.by_column.clear();
        // The rows of a block are the columns of its transpose.
        self.by_column.extend(stencils.incoming.iter().map(|&slot| rows(&blocks[slot as usize])));
        self.column_row.clear();
        self.column_row.extend(stencils.incoming.iter().map(|&slot| stencils.slot_row[slot as usize]));
        self.springs.clear();
        self.springs.extend(springs.iter().map(|s| padded(&s.direction)));
        self.pulls.clear();
        self.pulls.resize(springs.len(), R::ZERO);
        self.inverse_diagonal.clear();
        self.inverse_diagonal.extend(inverse_diagonal(stencils, blocks, springs, held).iter().map(padded));
        self.residual.clear();
        self.residual.extend(right.iter().map(padded));
        self.residual[..held].iter_mut().for_each(|r| *r = [R::ZERO; 4]);
        for (list, length) in [(&mut self.x, n), (&mut self.product, n), (&mut self.rows, stencils.row_count())] {
            list.clear();
            list.resize(length, [R::ZERO; 4]);
        }
    }

    fn apply(&mut self, stencils: &Stencils) {
        let (blocks, x) = (&self.by_row, &self.direction);
        self.rows.par_chunks_mut(BLOCK).enumerate().for_each(|(block, part)| {
            for (row, out) in (block * BLOCK..).zip(part) {
                let mut sum = x[stencils.vertex[row] as usize];
                for slot in stencils.slots(row) {
                    sum = minus_columns(sum, &blocks[slot], x[stencils.neighbour[slot] as usize]);
                }
                *out = sum;
            }
        });
        let springs = &self.springs;
        self.pulls.par_chunks_mut(8 * BLOCK).enumerate().for_each(|(block, part)| {
            for (slot, out) in (block * 8 * BLOCK..).zip(part) {
                let v = stencils.vertex[stencils.slot_row[slot] as usize];
                let (x, y) = (x[v as usize], x[stencils.neighbour[slot] as usize]);
                *out = dot_padded(springs[slot], add_padded(x, y, R::ZERO - R::ONE));
            }
        });
    }

    fn apply_transpose(&mut self, stencils: &Stencils, held: usize) {
        let (blocks, from, y) = (&self.by_column, &self.column_row, &self.rows);
        let (springs, pulls) = (&self.springs, &self.pulls);
        self.product[held..].par_chunks_mut(BLOCK).enumerate().for_each(|(block, part)| {
            for (v, out) in (held + block * BLOCK..).zip(part) {
                let own = stencils.row_of[v];
                let mut sum = if own == NONE { [R::ZERO; 4] } else { y[own as usize] };
                for k in stencils.incoming_start[v] as usize..stencils.incoming_start[v + 1] as usize {
                    sum = minus_columns(sum, &blocks[k], y[from[k] as usize]);
                }
                if !springs.is_empty() {
                    for &slot in stencils.incoming(v) {
                        sum = add_padded(sum, springs[slot as usize], R::ZERO - pulls[slot as usize]);
                    }
                    if own != NONE {
                        for slot in stencils.slots(own as usize) {
                            sum = add_padded(sum, springs[slot], pulls[slot]);
                        }
                    }
                }
                *out = sum;
            }
        });
    }
}
