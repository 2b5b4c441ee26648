//! Multidimensional scaling: points of R^D whose distances are close to given ones.
//!
//! The stress is the sum of (1 - d/Q)^2 over pairs (equation 14), that is weights 1/Q^2.
//! Majorisation (SMACOF) replaces X by the minimiser V^+ B(X) X of a quadratic that bounds the
//! stress from above and touches it at X, so that the stress cannot rise. Such steps are
//! preconditioned gradient steps; here they are combined by limited-memory quasi-Newton steps in
//! the inner product of V, and a combined step that would raise the stress is replaced by the plain
//! one.

use std::collections::VecDeque;

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt;
use faer::linalg::evd;
use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatRef, Par};
use rayon::prelude::*;

use crate::engine::lane::{Lane, Lanes, MAX_LANES, Sweep};
use crate::error::{Error, Result};

/// Rows are padded to a multiple of this, which is one of every number of lanes.
const LANES: usize = 8;
/// Rows of a block of work; fixed, so that results do not depend on the number of threads.
const ROWS: usize = 64;
/// Matrices of at most so many rows have all their eigenvectors computed, larger ones the leading
/// ones alone: 2,000 rows take 3 s of CPU time the first way, a tenth of a second the second.
const EXACT: usize = 256;
/// Columns of the subspace beyond those asked for. Distances on a surface are not those of points
/// in a flat space: of the eigenvalues that are large in size some are negative.
const SPARE: usize = 12;
/// Products with the matrix in the iteration.
const POWERS: usize = 24;
/// Pairs of steps the quasi-Newton directions are made of.
const HISTORY: usize = 6;

/// When to stop scaling.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stop {
    /// Largest number of sweeps.
    pub(crate) sweeps: usize,
    /// Stop when ten sweeps lower the stress by less than this part of it.
    pub(crate) tolerance: f64,
}

/// How a sweep steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Step {
    /// Quasi-Newton: to a minimum in the fewest sweeps.
    Combined,
    /// Majorisation alone: a path that turns nowhere, for those who do not go to its end.
    Plain,
}

/// Points, one column per dimension, with the stress after each sweep (mean over pairs; the first
/// entry is the start's).
#[derive(Clone, Debug)]
pub(crate) struct Scaled {
    pub(crate) points: Mat<f64>,
    pub(crate) stress: Vec<f64>,
}

/// The classical (Torgerson) solution: eigenvectors of the doubly centred squared distances; unused
/// dimensions are zero.
///
/// `distances` is a full symmetric n x n matrix. O(n^2) of large ones, where the solution is
/// approximate.
pub(crate) fn classical(distances: &[f64], n: usize, dimension: usize) -> Result<Mat<f64>> {
    let square = |i: usize, j: usize| distances[i * n + j] * distances[i * n + j];
    let means: Vec<f64> = (0..n).map(|i| (0..n).map(|j| square(i, j)).sum::<f64>() / n as f64).collect();
    let mean = means.iter().sum::<f64>() / n as f64;
    let gram = Mat::from_fn(n, n, |i, j| -0.5 * (square(i, j) - means[i] - means[j] + mean));
    let (values, vectors) = leading_eigenpairs(gram.as_ref(), dimension)?;
    Ok(Mat::from_fn(n, dimension, |i, k| {
        if k < values.len() && values[k] > 0.0 { vectors[(i, k)] * values[k].sqrt() } else { 0.0 }
    }))
}

/// The `count` largest eigenvalues, falling, with their eigenvectors as columns; of large matrices
/// approximately ([`leading_subspace`]).
fn leading_eigenpairs(a: MatRef<'_, f64>, count: usize) -> Result<(Vec<f64>, Mat<f64>)> {
    let n = a.nrows();
    if n <= EXACT {
        let (values, vectors) = eigenpairs(a)?;
        let count = count.min(n);
        return Ok(((0..count).map(|k| values[k]).collect(), vectors.subcols(0, count).to_owned()));
    }
    let basis = leading_subspace(a, (count + SPARE).min(n));
    // Rayleigh and Ritz: the best that the subspace holds.
    let image = symmetric_product(a, &basis);
    let mut small = Mat::zeros(basis.ncols(), basis.ncols());
    matmul(&mut small, Accum::Replace, basis.transpose(), &image, 1.0, Par::Seq);
    let (values, vectors) = eigenpairs(small.as_ref())?;
    let mut found = Mat::zeros(n, count);
    matmul(&mut found, Accum::Replace, &basis, vectors.subcols(0, count), 1.0, Par::Seq);
    Ok((values[..count].to_vec(), found))
}

/// Orthonormal columns that nearly span the eigenvectors of largest absolute eigenvalues: subspace
/// iteration from fixed columns. The scaling begins there, and needs no digits of it.
fn leading_subspace(a: MatRef<'_, f64>, columns: usize) -> Mat<f64> {
    let n = a.nrows();
    // Fractional parts of multiples of irrational numbers: spread evenly, the same on every run.
    let spread = |i: usize, k: usize| ((i + 1) as f64 * (2.5 + k as f64).sqrt()).fract() - 0.5;
    let mut basis = Mat::from_fn(n, columns, spread);
    orthonormalise(&mut basis);
    for _ in 0..POWERS {
        basis = symmetric_product(a, &basis);
        orthonormalise(&mut basis);
    }
    basis
}

/// Makes the columns orthonormal, one after another (Gram and Schmidt, twice); zero where nothing
/// is left of one.
fn orthonormalise(x: &mut Mat<f64>) {
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    for k in 0..x.ncols() {
        let mut column = x.col_as_slice(k).to_vec();
        let before = product(&column, &column).sqrt();
        for j in (0..k).chain(0..k) {
            let done = x.col_as_slice(j);
            let along = product(&column, done);
            column.iter_mut().zip(done).for_each(|(c, d)| *c -= along * d);
        }
        let length = product(&column, &column).sqrt();
        let inverse = if length > 1e-12 * before { 1.0 / length } else { 0.0 };
        x.col_as_slice_mut(k).iter_mut().zip(&column).for_each(|(out, c)| *out = c * inverse);
    }
}

/// All eigenvalues, falling, with their eigenvectors as columns.
fn eigenpairs(a: MatRef<'_, f64>) -> Result<(Vec<f64>, Mat<f64>)> {
    let n = a.nrows();
    let (mut values, mut vectors) = (faer::diag::Diag::<f64>::zeros(n), Mat::<f64>::zeros(n, n));
    // Sequential: the number of threads must not change the result.
    let par = Par::Seq;
    let scratch = evd::self_adjoint_evd_scratch::<f64>(n, evd::ComputeEigenvectors::Yes, par, Default::default());
    evd::self_adjoint_evd(
        a,
        values.as_mut(),
        Some(vectors.as_mut()),
        par,
        MemStack::new(&mut MemBuffer::new(scratch)),
        Default::default(),
    )
    .map_err(|e| {
        Error::numeric(
            format!("the eigenvalues of the landmark distances were not found ({e:?})"),
            "Try another number of landmarks",
        )
    })?;
    let pick = |k: usize| n - 1 - k;
    Ok(((0..n).map(|k| values.column_vector()[pick(k)]).collect(), Mat::from_fn(n, n, |i, k| vectors[(i, pick(k))])))
}

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

    /// Mean stress over pairs, B(X) X, and V X.
    fn evaluate(&self, x: &Mat<f64>) -> (f64, Mat<f64>, Mat<f64>) {
        let (n, dimension) = (self.n, x.ncols());
        // Dimension by dimension, padded.
        let mut columns = vec![0.0; dimension * self.padded];
        for k in 0..dimension {
            columns[k * self.padded..][..n].copy_from_slice(x.col_as_slice(k));
        }
        let lanes = Lanes::detect();
        let blocks: Vec<(f64, Vec<f64>)> = (0..n.div_ceil(ROWS))
            .into_par_iter()
            .map(|block| {
                let rows = block * ROWS..n.min((block + 1) * ROWS);
                let mut products = vec![0.0; rows.len() * 2 * dimension];
                let mut stress = 0.0;
                for i in rows.clone() {
                    let out = &mut products[(i - rows.start) * 2 * dimension..][..2 * dimension];
                    let inverse = &self.inverse[i * self.padded..][..self.padded];
                    stress += match dimension {
                        4 => pair_row::<4>(lanes, i, inverse, &columns, out),
                        8 => pair_row::<8>(lanes, i, inverse, &columns, out),
                        12 => pair_row::<12>(lanes, i, inverse, &columns, out),
                        _ => pair_row::<16>(lanes, i, inverse, &columns, out),
                    };
                }
                (stress, products)
            })
            .collect();
        let pairs = (n * (n - 1)).max(1) as f64;
        let (mut b, mut v) = (Mat::zeros(n, dimension), Mat::zeros(n, dimension));
        for (block, (_, rows)) in blocks.iter().enumerate() {
            for (r, row) in rows.chunks_exact(2 * dimension).enumerate() {
                for k in 0..dimension {
                    b[(block * ROWS + r, k)] = row[k];
                    v[(block * ROWS + r, k)] = row[dimension + k];
                }
            }
        }
        (blocks.iter().map(|b| b.0).sum::<f64>() / pairs, b, v)
    }
}

/// Row `i` of B(X) X, then that of V X; and its part of the stress sum.
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
        let (mut sums, mut weighted, mut stress) = ([zero; D], [zero; D], zero);
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
            let weight = inverse * inverse;
            for k in 0..D {
                sums[k] = ratio.mul_add(apart[k], sums[k]);
                weighted[k] = weight.mul_add(apart[k], weighted[k]);
            }
        }
        let total = |x: L| -> f64 {
            let mut each = [0.0; MAX_LANES];
            x.store(&mut each);
            each[..L::N].iter().sum()
        };
        for k in 0..D {
            self.out[k] = total(sums[k]);
            self.out[D + k] = total(weighted[k]);
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
fn symmetric_product(a: MatRef<'_, f64>, x: &Mat<f64>) -> Mat<f64> {
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

fn dot(a: &Mat<f64>, b: &Mat<f64>) -> f64 {
    (0..a.ncols()).map(|k| a.col_as_slice(k).iter().zip(b.col_as_slice(k)).map(|(x, y)| x * y).sum::<f64>()).sum()
}

/// a + t b.
fn plus(a: &Mat<f64>, t: f64, b: &Mat<f64>) -> Mat<f64> {
    Mat::from_fn(a.nrows(), a.ncols(), |i, k| a[(i, k)] + t * b[(i, k)])
}

/// A step taken and the change of the residual X - V^+ B(X) X over it, both with their products
/// with V.
struct Pair {
    step: Mat<f64>,
    v_step: Mat<f64>,
    change: Mat<f64>,
    v_change: Mat<f64>,
    curvature: f64,
}

/// The quasi-Newton direction for the residual `r` (two-loop recursion in the inner product of V;
/// without history the SMACOF step -r).
fn direction(r: &Mat<f64>, history: &VecDeque<Pair>) -> Mat<f64> {
    let mut q = r.clone();
    let mut factors = Vec::new();
    for pair in history.iter().rev() {
        let factor = dot(&pair.v_step, &q) / pair.curvature;
        q = plus(&q, -factor, &pair.change);
        factors.push(factor);
    }
    if let Some(last) = history.back() {
        let scale = last.curvature / dot(&last.change, &last.v_change);
        q = plus(&q, scale - 1.0, &q.clone());
    }
    for (pair, factor) in history.iter().zip(factors.into_iter().rev()) {
        let back = dot(&pair.v_change, &q) / pair.curvature;
        q = plus(&q, factor - back, &pair.step);
    }
    plus(&q, -2.0, &q.clone())
}

/// Lowers the stress from `start` until `stop`; the stress never rises from one sweep to the next.
///
/// `distances` is a full symmetric n x n matrix, positive off the diagonal; `start` has n rows and
/// 4, 8, 12 or 16 columns. `swept` is called after each sweep. A sweep costs O(n^2 D), the set-up
/// O(n^3).
pub(crate) fn smacof(distances: &[f64], start: Mat<f64>, stop: Stop, swept: impl FnMut()) -> Result<Scaled> {
    Ok(descend(&Problem::new(distances, start.nrows())?, start, Step::Combined, stop, swept))
}

/// [`smacof`] for a problem that has been set up.
pub(crate) fn descend(problem: &Problem, start: Mat<f64>, steps: Step, stop: Stop, mut swept: impl FnMut()) -> Scaled {
    let mut x = start;
    let (mut stress, mut b, mut vx) = problem.evaluate(&x);
    let mut trace = vec![stress];
    let mut history: VecDeque<Pair> = VecDeque::new();
    // The residual r = X - V^+ B(X) X and V r = V X - B(X) X.
    let mut r = plus(&x, -1.0, &symmetric_product(problem.v_plus.as_ref(), &b));
    while trace.len() <= stop.sweeps {
        let mut step = direction(&r, &history);
        let mut next = plus(&x, 1.0, &step);
        let (mut next_stress, mut next_b, mut next_vx) = problem.evaluate(&next);
        let plain = history.is_empty();
        if !plain && (next_stress.is_nan() || next_stress > stress) {
            history.clear();
            step = direction(&r, &history);
            next = plus(&x, 1.0, &step);
            (next_stress, next_b, next_vx) = problem.evaluate(&next);
        }
        swept();
        // A plain step can only fail to lower the stress by rounding.
        if next_stress.is_nan() || next_stress > stress {
            break;
        }
        let next_r = plus(&next, -1.0, &symmetric_product(problem.v_plus.as_ref(), &next_b));
        let change = plus(&next_r, -1.0, &r);
        let v_change = plus(&plus(&next_vx, -1.0, &next_b), -1.0, &plus(&vx, -1.0, &b));
        let v_step = plus(&next_vx, -1.0, &vx);
        let curvature = dot(&step, &v_change);
        if steps == Step::Combined && curvature > 1e-12 * dot(&step, &v_step) && dot(&change, &v_change) > 0.0 {
            history.push_back(Pair { step, v_step, change, v_change, curvature });
            if history.len() > HISTORY {
                history.pop_front();
            }
        }
        (x, vx, r, b, stress) = (next, next_vx, next_r, next_b, next_stress);
        trace.push(stress);
        if stress < 1e-28 || trace.len() > 10 && trace[trace.len() - 11] - stress <= stop.tolerance * stress {
            break;
        }
    }
    Scaled { points: x, stress: trace }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(n: usize) -> f64 {
        ((n as f64 * 12.9898).sin() * 43758.5453).fract()
    }

    fn distances(x: &Mat<f64>) -> Vec<f64> {
        let n = x.nrows();
        (0..n * n)
            .map(|k| (0..x.ncols()).map(|c| (x[(k / n, c)] - x[(k % n, c)]).powi(2)).sum::<f64>().sqrt())
            .collect()
    }

    /// Distances on a circle: not Euclidean.
    fn circle(n: usize) -> Vec<f64> {
        (0..n * n)
            .map(|k| {
                let gap = (k / n).abs_diff(k % n);
                gap.min(n - gap) as f64 * 0.1
            })
            .collect()
    }

    #[test]
    fn recovers_a_euclidean_configuration() {
        let q = distances(&Mat::from_fn(50, 3, |i, k| noise(3 * i + k)));
        let start = classical(&q, 50, 4).unwrap();
        assert!(distances(&start).iter().zip(&q).all(|(a, b)| (a - b).abs() < 1e-9));
        // Also from a start that is off.
        let disturbed = Mat::from_fn(50, 4, |i, k| start[(i, k)] + 0.05 * noise(1000 + 4 * i + k));
        let scaled = smacof(&q, disturbed, Stop { sweeps: 500, tolerance: 0.0 }, || {}).unwrap();
        assert!(*scaled.stress.last().unwrap() < 1e-14, "{:?}", scaled.stress.last());
    }

    #[test]
    fn stress_never_rises_and_is_the_mean_over_pairs() {
        let q = circle(60);
        let scaled = smacof(&q, classical(&q, 60, 8).unwrap(), Stop { sweeps: 100, tolerance: 0.0 }, || {}).unwrap();
        assert!(scaled.stress.len() > 20 && scaled.stress.windows(2).all(|w| w[1] <= w[0]));
        assert!(scaled.stress.last().unwrap() < &(0.5 * scaled.stress[0]));
        let d = distances(&scaled.points);
        let direct: f64 = (0..3600).filter(|k| k / 60 != k % 60).map(|k| (1.0 - d[k] / q[k]).powi(2)).sum();
        assert!((direct / 3540.0 - scaled.stress.last().unwrap()).abs() < 1e-12);
    }

    #[test]
    fn quasi_newton_steps_beat_plain_ones() {
        let q = circle(60);
        let start = classical(&q, 60, 8).unwrap();
        let problem = Problem::new(&q, 60).unwrap();
        let mut x = start.clone();
        for _ in 0..40 {
            x = symmetric_product(problem.v_plus.as_ref(), &problem.evaluate(&x).1);
        }
        let plain = problem.evaluate(&x).0;
        let scaled = smacof(&q, start, Stop { sweeps: 40, tolerance: 0.0 }, || {}).unwrap();
        assert!(*scaled.stress.last().unwrap() <= plain * (1.0 + 1e-9));
    }

    #[test]
    fn the_leading_subspace_of_a_large_matrix_is_that_of_all_eigenvectors() {
        let n = EXACT + 44;
        // A torus in space measured along itself: not Euclidean, with negative eigenvalues.
        let q: Vec<f64> = (0..n * n)
            .map(|k| {
                let turn = |i: usize, by: f64| (i as f64 * by).fract();
                let gap = |by: f64, size: f64| {
                    let d = (turn(k / n, by) - turn(k % n, by)).abs();
                    size * d.min(1.0 - d)
                };
                gap(0.618034, 3.0).hypot(gap(0.414214, 1.0))
            })
            .collect();
        let start = classical(&q, n, 8).unwrap();
        let square = |i: usize, j: usize| q[i * n + j] * q[i * n + j];
        let mean = |i: usize| (0..n).map(|j| square(i, j)).sum::<f64>() / n as f64;
        let means: Vec<f64> = (0..n).map(mean).collect();
        let all = means.iter().sum::<f64>() / n as f64;
        let gram = Mat::from_fn(n, n, |i, j| -0.5 * (square(i, j) - means[i] - means[j] + all));
        let (values, vectors) = eigenpairs(gram.as_ref()).unwrap();
        assert!(values[n - 1] < -0.01 * values[0], "{}", values[n - 1]);
        let exact = Mat::from_fn(n, 8, |i, k| vectors[(i, k)] * values[k].max(0.0).sqrt());
        let stress = |x: &Mat<f64>| Problem::new(&q, n).unwrap().evaluate(x).0;
        assert!(stress(&start) < 1.02 * stress(&exact), "{} {}", stress(&start), stress(&exact));
        // A column alone has more.
        let one = Mat::from_fn(n, 8, |i, k| if k < 1 { exact[(i, k)] } else { 0.0 });
        assert!(stress(&one) > 1.02 * stress(&exact));
    }

    #[test]
    fn two_and_three_points() {
        for n in [2, 3] {
            let q = circle(n);
            let scaled = smacof(&q, classical(&q, n, 4).unwrap(), Stop { sweeps: 20, tolerance: 1e-6 }, || {}).unwrap();
            assert!(distances(&scaled.points).iter().zip(&q).all(|(a, b)| (a - b).abs() < 1e-9));
        }
    }
}
