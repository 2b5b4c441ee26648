//! Where the scaling begins: leading eigenvectors.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::evd;
use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatRef, Par};

use super::problem::symmetric_product;
use crate::error::{Error, Result};

/// Matrices of at most so many rows have all their eigenvectors computed, larger ones the leading
/// ones alone: 2,000 rows take 3 s of CPU time the first way, a tenth of a second the second.
const EXACT: usize = 256;
/// Columns of the subspace beyond those asked for. Distances on a surface are not those of points
/// in a flat space: of the eigenvalues that are large in size some are negative.
const SPARE: usize = 12;
/// Products with the matrix in the iteration.
const POWERS: usize = 24;

/// Entries of an eigenvector of at least this part of the largest count as equal to it.
const ALIKE: f64 = 1.0 - 1e-6;

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
    let (values, mut vectors) = leading_eigenpairs(gram.as_ref(), dimension)?;
    (0..vectors.ncols()).for_each(|k| orient(vectors.col_as_slice_mut(k)));
    Ok(Mat::from_fn(n, dimension, |i, k| {
        if k < values.len() && values[k] > 0.0 { vectors[(i, k)] * values[k].sqrt() } else { 0.0 }
    }))
}

/// Turns a vector so that its largest entry is positive: which way an eigenvector points depends on
/// roundings. Of entries as large but for roundings, as symmetric shapes have, the first counts.
fn orient(vector: &mut [f64]) {
    let largest = vector.iter().fold(0.0, |l: f64, x| l.max(x.abs()));
    if vector.iter().find(|x| x.abs() >= ALIKE * largest).is_some_and(|x| *x < 0.0) {
        vector.iter_mut().for_each(|x| *x = -*x);
    }
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

#[cfg(test)]
mod tests {
    use super::super::Problem;
    use super::*;

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
    fn directions_do_not_depend_on_roundings() {
        // Points of a box, two sides of which are alike but for a hundredth, for either way there
        // is.
        for n in [120, EXACT + 44] {
            let turn = |i: usize, by: f64| ((i + 1) as f64 * by).fract();
            let x = Mat::from_fn(n, 3, |i, k| [1.0, 0.99, 0.3][k] * turn(i, [0.618034, 0.414214, 0.732051][k]));
            let distances = |by: f64| -> Vec<f64> {
                let apart = |i: usize, j: usize| (0..3).map(|k| (x[(i, k)] - x[(j, k)]).powi(2)).sum::<f64>().sqrt();
                (0..n * n)
                    .map(|k| {
                        let (i, j) = (k / n, k % n);
                        // The same for (i, j) and (j, i).
                        apart(i, j) * (1.0 + by * turn(i + j, 0.317))
                    })
                    .collect()
            };
            let [a, b] = [0.0, 1e-14].map(|by| classical(&distances(by), n, 4).unwrap());
            for k in 0..4 {
                for i in 0..n {
                    // Rounding in the fourth, which is none, is as large as roots of it.
                    let off = (a[(i, k)] - b[(i, k)]).abs();
                    assert!(off < if k < 3 { 1e-10 } else { 1e-6 }, "{i} {k}: {off:e}");
                }
            }
        }
        let mut down = [0.3, -0.5, 0.5 - 1e-12];
        orient(&mut down);
        assert_eq!(down, [-0.3, 0.5, 1e-12 - 0.5]);
        orient(&mut down);
        assert_eq!(down, [-0.3, 0.5, 1e-12 - 0.5]);
    }
}
