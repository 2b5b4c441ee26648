//! Conjugate gradients on (I - dF)ᵀ(I - dF) with the blocks of dF, for stages too large to factorise.

use rayon::prelude::*;

use super::decode::BLOCK;
use super::vector::{add, add_scaled, dot, sub};
use super::{Stencils, V3};
use crate::geometry::NONE;

/// y = B x for a block by rows.
#[inline(always)]
fn times(b: &[f64; 9], x: V3<f64>) -> V3<f64> {
    [
        b[0] * x[0] + b[1] * x[1] + b[2] * x[2],
        b[3] * x[0] + b[4] * x[1] + b[5] * x[2],
        b[6] * x[0] + b[7] * x[1] + b[8] * x[2],
    ]
}

/// y = Bᵀ x.
#[inline(always)]
fn times_transposed(b: &[f64; 9], x: V3<f64>) -> V3<f64> {
    [
        b[0] * x[0] + b[3] * x[1] + b[6] * x[2],
        b[1] * x[0] + b[4] * x[1] + b[7] * x[2],
        b[2] * x[0] + b[5] * x[1] + b[8] * x[2],
    ]
}

/// (I - dF) x for every row; entries of `x` before `held` are zero.
pub(crate) fn apply(stencils: &Stencils, blocks: &[[f64; 9]], x: &[V3<f64>], y: &mut [V3<f64>]) {
    y.par_chunks_mut(BLOCK).enumerate().for_each(|(block, part)| {
        for (row, out) in (block * BLOCK..).zip(part) {
            let mut sum = x[stencils.vertex[row] as usize];
            for slot in stencils.slots(row) {
                sum = sub(sum, times(&blocks[slot], x[stencils.neighbour[slot] as usize]));
            }
            *out = sum;
        }
    });
}

/// (I - dF)ᵀ y for the vertices from `held` on; the entries before are left as they are.
pub(crate) fn apply_transpose(
    stencils: &Stencils,
    blocks: &[[f64; 9]],
    y: &[V3<f64>],
    held: usize,
    x: &mut [V3<f64>],
) {
    x[held..].par_chunks_mut(BLOCK).enumerate().for_each(|(block, part)| {
        for (v, out) in (held + block * BLOCK..).zip(part) {
            let own = stencils.row_of[v];
            let mut sum = if own == NONE { [0.0; 3] } else { y[own as usize] };
            for &slot in stencils.incoming(v) {
                sum = sub(sum, times_transposed(&blocks[slot as usize], y[stencils.slot_row[slot as usize] as usize]));
            }
            *out = sum;
        }
    });
}

/// The diagonal of (I - dF)ᵀ(I - dF), a vector a vertex.
fn diagonal(stencils: &Stencils, blocks: &[[f64; 9]], held: usize) -> Vec<V3<f64>> {
    let mut out = vec![[1.0; 3]; stencils.vertex_count()];
    out[held..].par_chunks_mut(BLOCK).enumerate().for_each(|(block, part)| {
        for (v, out) in (held + block * BLOCK..).zip(part) {
            let mut sum = [if stencils.row_of[v] == NONE { 0.0 } else { 1.0 }; 3];
            for &slot in stencils.incoming(v) {
                let b = &blocks[slot as usize];
                for c in 0..3 {
                    sum[c] += b[c] * b[c] + b[3 + c] * b[3 + c] + b[6 + c] * b[6 + c];
                }
            }
            *out = sum.map(|d| if d > 0.0 { d } else { 1.0 });
        }
    });
    out
}

/// Sum of products, in blocks: the same for any number of threads. CPU reference of the kernel `dot`.
pub fn dot_product(a: &[V3<f64>], b: &[V3<f64>]) -> f64 {
    let blocks: Vec<f64> = a
        .par_chunks(BLOCK)
        .zip(b.par_chunks(BLOCK))
        .map(|(a, b)| a.iter().zip(b).map(|(&a, &b)| dot(a, b)).sum())
        .collect();
    blocks.iter().sum()
}

/// A few vectors kept between solves.
#[derive(Debug, Default)]
pub(crate) struct Workspace {
    residual: Vec<V3<f64>>,
    direction: Vec<V3<f64>>,
    preconditioned: Vec<V3<f64>>,
    rows: Vec<V3<f64>>,
    product: Vec<V3<f64>>,
}

/// Minimises |(I - dF) x + r|² approximately: (I - dF)ᵀ(I - dF) x = right, Jacobi preconditioned, at most `steps` steps or until the
/// residual is `tolerance` times the right-hand side (in the preconditioner's norm). Returns the number of steps; `x` starts at zero.
#[expect(clippy::too_many_arguments, reason = "the parts of one equation")]
pub(crate) fn conjugate_gradients(
    stencils: &Stencils,
    blocks: &[[f64; 9]],
    held: usize,
    right: &[V3<f64>],
    steps: usize,
    tolerance: f64,
    workspace: &mut Workspace,
    x: &mut [V3<f64>],
) -> usize {
    let n = x.len();
    let inverse: Vec<V3<f64>> = diagonal(stencils, blocks, held).into_iter().map(|d| d.map(|d| 1.0 / d)).collect();
    let w = workspace;
    w.residual.clear();
    w.residual.extend_from_slice(right);
    w.residual[..held].iter_mut().for_each(|r| *r = [0.0; 3]);
    x.iter_mut().for_each(|x| *x = [0.0; 3]);
    let scaled = |r: &[V3<f64>], out: &mut Vec<V3<f64>>| {
        out.clear();
        out.extend(r.iter().zip(&inverse).map(|(r, d)| [r[0] * d[0], r[1] * d[1], r[2] * d[2]]));
    };
    scaled(&w.residual, &mut w.preconditioned);
    w.direction.clone_from(&w.preconditioned);
    w.rows.resize(stencils.row_count(), [0.0; 3]);
    w.product.clear();
    w.product.resize(n, [0.0; 3]);
    let mut rho = dot_product(&w.residual, &w.preconditioned);
    let stop = rho * tolerance * tolerance;
    for step in 0..steps {
        if !(rho > stop) || !(rho > 0.0) {
            return step;
        }
        apply(stencils, blocks, &w.direction, &mut w.rows);
        apply_transpose(stencils, blocks, &w.rows, held, &mut w.product);
        let curvature = dot_product(&w.rows, &w.rows);
        if !(curvature > 0.0) {
            return step;
        }
        let alpha = rho / curvature;
        x.iter_mut().zip(&w.direction).for_each(|(x, &d)| *x = add_scaled(*x, d, alpha));
        w.residual.iter_mut().zip(&w.product).for_each(|(r, &p)| *r = add_scaled(*r, p, -alpha));
        scaled(&w.residual, &mut w.preconditioned);
        let next = dot_product(&w.residual, &w.preconditioned);
        let beta = next / rho;
        rho = next;
        w.direction.iter_mut().zip(&w.preconditioned).for_each(|(d, &z)| *d = add(z, add_scaled([0.0; 3], *d, beta)));
    }
    steps
}
