//! The stress of points and the products that lower it.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt;
use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatRef, Par};
use rayon::prelude::*;

use crate::engine::lane::{Lane, Lanes, MAX_LANES, Sweep};
use crate::error::{Error, Result};

/// Rows are padded to a multiple of this, which is one of every number of lanes.
const LANES: usize = 8;
/// Rows of a block of work; fixed, so that results do not depend on the number of threads.
const ROWS: usize = 64;

/// The stress problem of one set of distances, for any number of starts.
#[derive(Debug)]
pub(crate) struct Problem {
    n: usize,
    /// Row length of `inverse`, a multiple of LANES.
    padded: usize,
    /// 1 / Q row by row, zero on the diagonal and in the padding.
    inverse: Vec<f64>,
    /// Pseudo-inverse of V, the Laplacian of the weights 1 / Q^2.
    v_plus: Mat<f64>,
}

impl Problem {
    /// Sets up the problem of a full symmetric n x n matrix, positive off the diagonal. O(n^3).
    pub(crate) fn new(distances: &[f64], n: usize) -> Result<Self> {
        let padded = n.next_multiple_of(LANES);
        let mut inverse = vec![0.0; n * padded];
        for i in 0..n {
            for j in (0..n).filter(|&j| j != i) {
                inverse[i * padded + j] = 1.0 / distances[i * n + j];
            }
        }
        let weight = |i: usize, j: usize| inverse[i * padded + j] * inverse[i * padded + j];
        let diagonal: Vec<f64> = (0..n).map(|i| (0..n).map(|j| weight(i, j)).sum()).collect();
        // V has the constants as its kernel: V^+ = (V + c 11')^-1 - 11' / (c n^2), with c of the
        // size of V's entries.
        let c = diagonal.iter().sum::<f64>() / (n * n) as f64;
        let shifted = Mat::from_fn(n, n, |i, j| c + if i == j { diagonal[i] } else { -weight(i, j) });
        let mut v_plus = inverse_positive(shifted)?;
        let shift = 1.0 / (c * (n * n) as f64);
        for j in 0..n {
            for i in 0..n {
                v_plus[(i, j)] -= shift;
            }
        }
        Ok(Self { n, padded, inverse, v_plus })
    }

    /// The columns of `x` one after another, each padded as the rows of `inverse` are.
    fn columns(&self, x: &Mat<f64>) -> Vec<f64> {
        let mut columns = vec![0.0; x.ncols() * self.padded];
        for k in 0..x.ncols() {
            columns[k * self.padded..][..self.n].copy_from_slice(x.col_as_slice(k));
        }
        columns
    }

    /// V^+ B.
    pub(super) fn v_plus_product(&self, b: &Mat<f64>) -> Mat<f64> {
        symmetric_product(self.v_plus.as_ref(), b)
    }

    /// V X.
    pub(super) fn v_product(&self, x: &Mat<f64>) -> Mat<f64> {
        let (columns, dimension) = (self.columns(x), x.ncols());
        let entry = |i: usize, k: usize| -> f64 {
            let column = &columns[k * self.padded..][..self.padded];
            let inverse = &self.inverse[i * self.padded..][..self.padded];
            let mut sums = [0.0; LANES];
            for (w, y) in inverse.chunks_exact(LANES).zip(column.chunks_exact(LANES)) {
                for l in 0..LANES {
                    sums[l] += w[l] * w[l] * (column[i] - y[l]);
                }
            }
            sums.iter().sum()
        };
        let rows: Vec<f64> =
            (0..self.n * dimension).into_par_iter().map(|k| entry(k / dimension, k % dimension)).collect();
        Mat::from_fn(self.n, dimension, |i, k| rows[i * dimension + k])
    }

    /// Mean stress over pairs, and B(X) X.
    pub(super) fn evaluate(&self, x: &Mat<f64>) -> (f64, Mat<f64>) {
        let (n, dimension) = (self.n, x.ncols());
        let columns = self.columns(x);
        let lanes = Lanes::detect();
        let blocks: Vec<(f64, Vec<f64>)> = (0..n.div_ceil(ROWS))
            .into_par_iter()
            .map(|block| {
                let rows = block * ROWS..n.min((block + 1) * ROWS);
                let mut product = vec![0.0; rows.len() * dimension];
                let mut stress = 0.0;
                for i in rows.clone() {
                    let out = &mut product[(i - rows.start) * dimension..][..dimension];
                    let inverse = &self.inverse[i * self.padded..][..self.padded];
                    stress += match dimension {
                        4 => pair_row::<4>(lanes, i, inverse, &columns, out),
                        8 => pair_row::<8>(lanes, i, inverse, &columns, out),
                        12 => pair_row::<12>(lanes, i, inverse, &columns, out),
                        _ => pair_row::<16>(lanes, i, inverse, &columns, out),
                    };
                }
                (stress, product)
            })
            .collect();
        let pairs = (n * (n - 1)).max(1) as f64;
        let mut product = Mat::zeros(n, dimension);
        for (block, (_, rows)) in blocks.iter().enumerate() {
            for (r, row) in rows.chunks_exact(dimension).enumerate() {
                for (k, value) in row.iter().enumerate() {
                    product[(block * ROWS + r, k)] = *value;
                }
            }
        }
        (blocks.iter().map(|b| b.0).sum::<f64>() / pairs, product)
    }
}

/// Row `i` of B(X) X, and its part of the stress sum.
fn pair_row<const D: usize>(lanes: Lanes, i: usize, inverse: &[f64], columns: &[f64], out: &mut [f64]) -> f64 {
    let mut stress = 0.0;
    lanes.run(PairRow::<D> { i, inverse, columns, out, stress: &mut stress });
    stress
}

/// The loop of [`pair_row`] over the other points.
struct PairRow<'a, const D: usize> {
    i: usize,
    inverse: &'a [f64],
    columns: &'a [f64],
    out: &'a mut [f64],
    stress: &'a mut f64,
}

impl<const D: usize> Sweep<f64> for PairRow<'_, D> {
    #[inline(always)]
    fn run<L: Lane<E = f64>>(self, cpu: L::Cpu) {
        let padded = self.inverse.len();
        let (zero, one) = (L::num(cpu, 0.0), L::num(cpu, 1.0));
        let columns: [&[f64]; D] = std::array::from_fn(|k| &self.columns[k * padded..][..padded]);
        let mut here = [zero; D];
        for k in 0..D {
            here[k] = L::splat(cpu, columns[k][self.i]);
        }
        let (mut sums, mut stress) = ([zero; D], zero);
        for start in (0..padded).step_by(L::N) {
            let (mut apart, mut square) = ([zero; D], zero);
            for k in 0..D {
                apart[k] = here[k] - L::load(cpu, &columns[k][start..]);
                square = apart[k].mul_add(apart[k], square);
            }
            let inverse = L::load(cpu, &self.inverse[start..]);
            let d = square.sqrt();
            let error = L::select(zero.lt(inverse), one, zero) - d * inverse;
            stress = error.mul_add(error, stress);
            // Coincident points have no direction to be pushed apart in.
            let ratio = L::select(zero.lt(d), inverse / d, zero);
            for k in 0..D {
                sums[k] = ratio.mul_add(apart[k], sums[k]);
            }
        }
        let total = |x: L| -> f64 {
            let mut each = [0.0; MAX_LANES];
            x.store(&mut each);
            each[..L::N].iter().sum()
        };
        for k in 0..D {
            self.out[k] = total(sums[k]);
        }
        *self.stress = total(stress);
    }
}

/// Inverse of a symmetric positive definite matrix. Sequential, so that the number of threads does
/// not change the result.
fn inverse_positive(mut a: Mat<f64>) -> Result<Mat<f64>> {
    let n = a.nrows();
    let scratch = llt::factor::cholesky_in_place_scratch::<f64>(n, Par::Seq, Default::default())
        .or(llt::inverse::inverse_scratch::<f64>(n, Par::Seq));
    let mut memory = MemBuffer::new(scratch);
    llt::factor::cholesky_in_place(
        a.as_mut(),
        Default::default(),
        Par::Seq,
        MemStack::new(&mut memory),
        Default::default(),
    )
    .map_err(|_| {
        Error::numeric(
            "the distances between the landmarks of a mesh differ too much in size to be embedded",
            "Use fewer landmarks, or clean the mesh of tiny triangles",
        )
    })?;
    let mut inverse = Mat::zeros(n, n);
    llt::inverse::inverse(inverse.as_mut(), a.as_ref(), Par::Seq, MemStack::new(&mut memory));
    // Only the lower half is filled in.
    for j in 0..n {
        for i in 0..j {
            inverse[(i, j)] = inverse[(j, i)];
        }
    }
    Ok(inverse)
}

/// The product with a symmetric matrix, in blocks of rows.
pub(super) fn symmetric_product(a: MatRef<'_, f64>, x: &Mat<f64>) -> Mat<f64> {
    let (n, dimension) = (a.nrows(), x.ncols());
    let blocks: Vec<Mat<f64>> = (0..n.div_ceil(ROWS))
        .into_par_iter()
        .map(|block| {
            let rows = ROWS.min(n - block * ROWS);
            let mut out = Mat::zeros(rows, dimension);
            // Columns instead of rows: they lie together in memory.
            let part = a.subcols(block * ROWS, rows).transpose();
            matmul(&mut out, Accum::Replace, part, x, 1.0, Par::Seq);
            out
        })
        .collect();
    let mut product = Mat::zeros(n, dimension);
    for (block, out) in blocks.iter().enumerate() {
        for k in 0..dimension {
            product.col_as_slice_mut(k)[block * ROWS..][..out.nrows()].copy_from_slice(out.col_as_slice(k));
        }
    }
    product
}
