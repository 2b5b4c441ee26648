//! Sparse Cholesky factors of symmetric positive definite matrices.
//!
//! The sum of squares `A + sum l l'` is dense where a row l is long, as that of a vertex with
//! thousands of neighbours is. It is then given as the *bordered* matrix `[A l; l' -1]`, which has
//! one unknown more for each long row and the same solution for the others, `l' x` being the value
//! of the new one. It is quasi-definite: L D L' exists for any order of the unknowns (Vanderbei
//! 1995), and the number of non-zeros stays linear in that of the vertices.

use std::sync::Arc;

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::ldlt::factor::LdltRegularization;
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::sparse::linalg::cholesky::{
    LdltRef, LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use faer::{Conj, Mat, Par, Side};
use rayon::prelude::*;

use crate::error::{Error, Result};

/// Columns solved for together: fewer read the factor too often, more leave threads idle where
/// there are few.
const COLUMNS: usize = 6;

/// Rows of more entries than this are long. Their squares have this many entries for each of
/// theirs, at most; vertices of real meshes have 4 to 20 neighbours.
pub(crate) const LONGEST: usize = 64;

/// The places of the entries of a symmetric matrix, analysed once for any number of factorisations.
#[derive(Clone, Debug)]
pub(crate) struct SparsePattern {
    matrix: SymbolicSparseColMat<usize>,
    factor: Arc<SymbolicCholesky<usize>>,
    /// How many of the unknowns, the last ones, stand for long rows.
    border: usize,
    /// Names the system in messages.
    what: &'static str,
}

impl SparsePattern {
    /// The lower half by columns: the entries of column c are those from `starts[c]` to `starts[c +
    /// 1]`, rows ascending. The last `border` columns are those of long rows.
    ///
    /// # Errors
    /// [`Error::Numeric`], naming the system by `what`, if there is not enough memory.
    pub(crate) fn new(what: &'static str, starts: Vec<usize>, rows: Vec<usize>, border: usize) -> Result<Self> {
        let n = starts.len() - 1;
        let matrix = SymbolicSparseColMat::new_checked(n, n, starts, None, rows);
        let factor =
            factorize_symbolic_cholesky(matrix.as_ref(), Side::Lower, SymmetricOrdering::Amd, Default::default())
                .map_err(|e| failed(what, &format!("{e:?}")))?;
        Ok(Self { matrix, factor: Arc::new(factor), border, what })
    }

    /// Factorises the matrix with these values, in the order of the entries. Sequential, so that
    /// the number of threads does not change the result. `None` if the matrix is not numerically
    /// positive definite.
    ///
    /// # Errors
    /// [`Error::Numeric`] if there is not enough memory.
    pub(crate) fn factorise(&self, values: &[f64]) -> Result<Option<SparseCholesky>> {
        let matrix = SparseColMatRef::new(self.matrix.as_ref(), values);
        let mut factor = Vec::new();
        factor.try_reserve_exact(self.factor.len_val()).map_err(|_| failed(self.what, "out of memory"))?;
        factor.resize(self.factor.len_val(), 0.0);
        let request = match self.border {
            0 => self.factor.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default()),
            _ => self.factor.factorize_numeric_ldlt_scratch::<f64>(Par::Seq, Default::default()),
        };
        let mut scratch = MemBuffer::try_new(request).map_err(|_| failed(self.what, "out of memory"))?;
        let stack = MemStack::new(&mut scratch);
        let (side, seq) = (Side::Lower, Par::Seq);
        let done = match self.border {
            0 => {
                let regular = LltRegularization::default();
                self.factor
                    .factorize_numeric_llt(&mut factor, matrix, side, regular, seq, stack, Default::default())
                    .is_ok()
            }
            _ => {
                let regular = LdltRegularization::default();
                let done = self
                    .factor
                    .factorize_numeric_ldlt(&mut factor, matrix, side, regular, seq, stack, Default::default())
                    .is_ok();
                done && factor.iter().all(|x| x.is_finite())
            }
        };
        let symbolic = Arc::clone(&self.factor);
        Ok(done.then_some(SparseCholesky { symbolic, values: factor, border: self.border, what: self.what }))
    }
}

/// A factorised matrix.
#[derive(Debug)]
pub(crate) struct SparseCholesky {
    symbolic: Arc<SymbolicCholesky<usize>>,
    values: Vec<f64>,
    border: usize,
    what: &'static str,
}

impl SparseCholesky {
    /// Factorises a matrix whose pattern is used once; see [`SparsePattern`].
    ///
    /// # Errors
    /// As there.
    pub(crate) fn new(
        what: &'static str,
        starts: Vec<usize>,
        rows: Vec<usize>,
        values: Vec<f64>,
        border: usize,
    ) -> Result<Option<Self>> {
        SparsePattern::new(what, starts, rows, border)?.factorise(&values)
    }

    /// Number of entries of the factor.
    #[cfg(test)]
    pub(crate) fn len(&self) -> usize {
        self.values.len()
    }

    /// Replaces the columns of `x` by the solutions, several columns at a time on every thread; the
    /// number of threads does not change the result. The unknowns of long rows may be left out;
    /// their right-hand sides are zero then.
    ///
    /// # Errors
    /// [`Error::Numeric`] if there is not enough memory.
    pub(crate) fn solve(&self, x: &mut Mat<f64>) -> Result<()> {
        let (n, given) = (self.symbolic.nrows(), x.nrows());
        if given < n {
            let mut whole = Mat::from_fn(n, x.ncols(), |i, k| if i < given { x[(i, k)] } else { 0.0 });
            self.solve(&mut whole)?;
            x.copy_from(whole.subrows(0, given));
            return Ok(());
        }
        if self.border > 0 {
            return self.solve_bordered(x);
        }
        let llt = LltRef::new(&self.symbolic, &self.values);
        x.as_mut().par_col_chunks_mut(COLUMNS).try_for_each(|columns| {
            let request = self.symbolic.solve_in_place_scratch::<f64>(columns.ncols(), Par::Seq);
            let mut scratch = MemBuffer::try_new(request).map_err(|_| failed(self.what, "out of memory"))?;
            llt.solve_in_place_with_conj(Conj::No, columns, Par::Seq, MemStack::new(&mut scratch));
            Ok(())
        })
    }

    fn solve_bordered(&self, x: &mut Mat<f64>) -> Result<()> {
        let ldlt = LdltRef::new(&self.symbolic, &self.values);
        x.as_mut().par_col_chunks_mut(COLUMNS).try_for_each(|columns| {
            let request = self.symbolic.solve_in_place_scratch::<f64>(columns.ncols(), Par::Seq);
            let mut scratch = MemBuffer::try_new(request).map_err(|_| failed(self.what, "out of memory"))?;
            ldlt.solve_in_place_with_conj(Conj::No, columns, Par::Seq, MemStack::new(&mut scratch));
            Ok(())
        })
    }
}

fn failed(what: &str, why: &str) -> Error {
    Error::numeric(format!("{what} could not be solved for: {why}"), "Use a smaller mesh or more memory")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_solves_and_knows_what_is_not_positive() {
        // [4 1 0; 1 3 1; 0 1 2]
        let lower = |d: f64| (vec![0, 2, 4, 5], vec![0, 1, 1, 2, 2], vec![d, 1.0, 3.0, 1.0, 2.0]);
        let (starts, rows, values) = lower(4.0);
        let factor = SparseCholesky::new("the test", starts, rows, values, 0).unwrap().unwrap();
        let mut x = Mat::from_fn(3, 2, |i, k| [[4.0 + 2.0, 1.0], [1.0 + 6.0 + 3.0, 3.0], [2.0 + 6.0, 1.0]][i][k]);
        factor.solve(&mut x).unwrap();
        for (i, wanted) in [[1.0, 0.0], [2.0, 1.0], [3.0, 0.0]].iter().enumerate() {
            assert!((x[(i, 0)] - wanted[0]).abs() < 1e-12 && (x[(i, 1)] - wanted[1]).abs() < 1e-12);
        }
        let (starts, rows, values) = lower(-4.0);
        assert!(SparseCholesky::new("the test", starts, rows, values, 0).unwrap().is_none());
    }

    #[test]
    fn a_border_is_the_square_of_its_row() {
        // [2 0; 0 3] + l l' with l = (1, 2), as [2 0 1; 0 3 2; 1 2 -1].
        let (starts, rows) = (vec![0, 2, 4, 5], vec![0, 2, 1, 2, 2]);
        let factor = SparseCholesky::new("the test", starts, rows, vec![2.0, 1.0, 3.0, 2.0, -1.0], 1).unwrap().unwrap();
        // [3 2; 2 7] (1, -1) = (1, -5).
        let mut x = Mat::from_fn(2, 1, |i, _| [1.0, -5.0][i]);
        factor.solve(&mut x).unwrap();
        assert!((x[(0, 0)] - 1.0).abs() < 1e-14 && (x[(1, 0)] + 1.0).abs() < 1e-14);
    }
}
