//! Sparse Cholesky factors of symmetric positive definite matrices.
//!
//! The sum of squares `A + sum l l'` is dense where a row l is long, as that of a vertex with
//! thousands of neighbours is. It is then given as the *bordered* matrix `[A l; l' -1]`, which has
//! one unknown more for each long row and the same solution for the others, `l' x` being the value
//! of the new one. It is quasi-definite: L D L' exists for any order of the unknowns (Vanderbei
//! 1995), and the number of non-zeros stays linear in that of the vertices.
//!
//! Unknowns that stand in no equation but their own, those of vertices that a file repeats or
//! leaves unused, are solved apart. The order in which the others are eliminated, and with it the
//! rounding of their solution, does not depend on them.

use std::sync::Arc;

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::ldlt::factor::LdltRegularization;
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::sparse::linalg::cholesky::{
    LdltRef, LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use faer::{Conj, Mat, MatMut, Par, Side};
use rayon::prelude::*;

use crate::control;
use crate::error::{Error, Result};

/// Columns solved for together: fewer read the factor too often, more leave threads idle where
/// there are few.
const COLUMNS: usize = 6;

/// Rows of more entries than this are long. Their squares have this many entries for each of
/// theirs, at most; vertices of real meshes have 4 to 20 neighbours.
pub(crate) const LONGEST: usize = 64;

/// Systems of more entries than this take tens of milliseconds, in which work cannot be cancelled:
/// they are done apart.
const APART: usize = 1 << 18;

/// The places of the entries of a symmetric matrix, analysed once for any number of factorisations.
#[derive(Clone, Debug)]
pub(crate) struct SparsePattern {
    matrix: SymbolicSparseColMat<usize>,
    factor: Arc<SymbolicCholesky<usize>>,
    /// None where every unknown is coupled with another one.
    parted: Option<Arc<Parted>>,
    /// How many of the unknowns, the last ones, stand for long rows.
    border: usize,
    /// Names the system in messages.
    what: &'static str,
}

/// The unknowns of a matrix, by whether they are coupled with others.
#[derive(Debug)]
struct Parted {
    /// Those of the factor, ascending, and the range of the entries of each one's column.
    coupled: Vec<(usize, std::ops::Range<usize>)>,
    /// The others, with the place of the diagonal entry.
    alone: Vec<(usize, usize)>,
}

impl Parted {
    /// None where none is alone, or all are.
    fn new(starts: &[usize], rows: &[usize]) -> Option<Self> {
        let n = starts.len() - 1;
        let entries = |c: usize| starts[c]..starts[c + 1];
        let mut is_coupled = vec![false; n];
        for (c, bounds) in starts.windows(2).enumerate() {
            for &r in rows[bounds[0]..bounds[1]].iter().filter(|r| **r != c) {
                (is_coupled[c], is_coupled[r]) = (true, true);
            }
        }
        let alone: Vec<(usize, usize)> = (0..n).filter(|&c| !is_coupled[c]).map(|c| (c, starts[c])).collect();
        let has_diagonal = |&(c, entry): &(usize, usize)| entry < starts[c + 1];
        let parted = !alone.is_empty() && alone.len() < n && alone.iter().all(has_diagonal);
        let coupled = || (0..n).filter(|&c| is_coupled[c]).map(|c| (c, entries(c))).collect();
        parted.then(|| Self { coupled: coupled(), alone })
    }

    /// The columns of the coupled unknowns, numbered among themselves.
    fn columns(&self, rows: &[usize]) -> (Vec<usize>, Vec<usize>) {
        let mut number = vec![0; self.coupled.len() + self.alone.len()];
        self.coupled.iter().enumerate().for_each(|(k, (c, _))| number[*c] = k);
        let (mut starts, mut kept) = (vec![0], Vec::new());
        for (_, entries) in &self.coupled {
            kept.extend(rows[entries.clone()].iter().map(|&r| number[r]));
            starts.push(kept.len());
        }
        (starts, kept)
    }
}

impl SparsePattern {
    /// The lower half by columns: the entries of column c are those from `starts[c]` to `starts[c +
    /// 1]`, rows ascending. The last `border` columns are those of long rows.
    ///
    /// # Errors
    /// [`Error::Numeric`], naming the system by `what`, if there is not enough memory.
    pub(crate) fn new(what: &'static str, starts: Vec<usize>, rows: Vec<usize>, border: usize) -> Result<Self> {
        let parted = Parted::new(&starts, &rows).map(Arc::new);
        let (starts, rows) = match &parted {
            Some(parted) => parted.columns(&rows),
            None => (starts, rows),
        };
        let n = starts.len() - 1;
        let matrix = SymbolicSparseColMat::new_checked(n, n, starts, None, rows);
        let ordered = |matrix: &SymbolicSparseColMat<usize>| {
            factorize_symbolic_cholesky(matrix.as_ref(), Side::Lower, SymmetricOrdering::Amd, Default::default())
        };
        let large = matrix.row_idx().len() >= APART;
        let both = move || {
            let factor = ordered(&matrix);
            (matrix, factor)
        };
        let (matrix, factor) = if large { control::apart(both)? } else { both() };
        let factor = factor.map_err(|e| failed(what, &format!("{e:?}")))?;
        Ok(Self { matrix, factor: Arc::new(factor), parted, border, what })
    }

    /// Factorises the matrix with these values, in the order of the entries. Sequential, so that
    /// the number of threads does not change the result. `None` if the matrix is not numerically
    /// positive definite.
    ///
    /// # Errors
    /// [`Error::Numeric`] if there is not enough memory.
    pub(crate) fn factorise(&self, values: &[f64]) -> Result<Option<SparseCholesky>> {
        if self.factor.len_val() < APART {
            return self.factorised(values);
        }
        let (own, values) = (self.clone(), values.to_vec());
        control::apart(move || own.factorised(&values))?
    }

    fn factorised(&self, values: &[f64]) -> Result<Option<SparseCholesky>> {
        let gathered: Vec<f64>;
        let (mut values, mut alone) = (values, Vec::new());
        if let Some(parted) = &self.parted {
            alone.extend(parted.alone.iter().map(|&(_, entry)| values[entry]));
            if alone.iter().any(|x| !(*x > 0.0)) {
                return Ok(None);
            }
            gathered = parted.coupled.iter().flat_map(|(_, entries)| &values[entries.clone()]).copied().collect();
            values = &gathered;
        }
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
        let (symbolic, parted) = (Arc::clone(&self.factor), self.parted.clone());
        let factor = SparseCholesky { symbolic, values: factor, parted, alone, border: self.border, what: self.what };
        Ok(done.then_some(factor))
    }
}

/// A factorised matrix.
#[derive(Debug)]
pub(crate) struct SparseCholesky {
    symbolic: Arc<SymbolicCholesky<usize>>,
    values: Vec<f64>,
    parted: Option<Arc<Parted>>,
    /// The diagonal entries of the unknowns that are alone.
    alone: Vec<f64>,
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
        let Some(parted) = &self.parted else { return self.solve_coupled(x) };
        let given = x.nrows();
        let right = |k: usize, column: usize| {
            let c = parted.coupled[k].0;
            if c < given { x[(c, column)] } else { 0.0 }
        };
        let mut coupled = Mat::from_fn(parted.coupled.len(), x.ncols(), right);
        self.solve_coupled(&mut coupled)?;
        for column in 0..x.ncols() {
            for (k, (c, _)) in parted.coupled.iter().enumerate().filter(|(_, (c, _))| *c < given) {
                x[(*c, column)] = coupled[(k, column)];
            }
            for ((c, _), diagonal) in parted.alone.iter().zip(&self.alone).filter(|((c, _), _)| *c < given) {
                x[(*c, column)] /= diagonal;
            }
        }
        Ok(())
    }

    fn solve_coupled(&self, x: &mut Mat<f64>) -> Result<()> {
        let (n, given) = (self.symbolic.nrows(), x.nrows());
        if given < n {
            let mut whole = Mat::from_fn(n, x.ncols(), |i, k| if i < given { x[(i, k)] } else { 0.0 });
            self.solve_coupled(&mut whole)?;
            x.copy_from(whole.subrows(0, given));
            return Ok(());
        }
        if self.border > 0 {
            return self.solve_bordered(x);
        }
        let llt = LltRef::new(&self.symbolic, &self.values);
        groups(x.as_mut()).into_par_iter().try_for_each(|columns| {
            let request = self.symbolic.solve_in_place_scratch::<f64>(columns.ncols(), Par::Seq);
            let mut scratch = MemBuffer::try_new(request).map_err(|_| failed(self.what, "out of memory"))?;
            llt.solve_in_place_with_conj(Conj::No, columns, Par::Seq, MemStack::new(&mut scratch));
            Ok(())
        })
    }

    fn solve_bordered(&self, x: &mut Mat<f64>) -> Result<()> {
        let ldlt = LdltRef::new(&self.symbolic, &self.values);
        groups(x.as_mut()).into_par_iter().try_for_each(|columns| {
            let request = self.symbolic.solve_in_place_scratch::<f64>(columns.ncols(), Par::Seq);
            let mut scratch = MemBuffer::try_new(request).map_err(|_| failed(self.what, "out of memory"))?;
            ldlt.solve_in_place_with_conj(Conj::No, columns, Par::Seq, MemStack::new(&mut scratch));
            Ok(())
        })
    }
}

/// The columns in groups of [`COLUMNS`], the last one smaller.
fn groups(mut left: MatMut<'_, f64>) -> Vec<MatMut<'_, f64>> {
    let mut groups = Vec::with_capacity(left.ncols().div_ceil(COLUMNS));
    while left.ncols() > 0 {
        let columns = left.ncols().min(COLUMNS);
        let (group, rest) = left.split_at_col_mut(columns);
        groups.push(group);
        left = rest;
    }
    groups
}

fn failed(what: &str, why: &str) -> Error {
    Error::numeric(format!("{what} could not be solved for: {why}"), "Use a smaller mesh or more memory")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A chain of `n` unknowns, those of `alone` uncoupled, and how many entries the factor has.
    fn chain(n: usize, alone: &[usize], right: impl Fn(usize) -> f64) -> (Vec<f64>, usize) {
        let (mut starts, mut rows, mut values) = (vec![0], Vec::new(), Vec::new());
        let coupled: Vec<usize> = (0..n).filter(|c| !alone.contains(c)).collect();
        for c in 0..n {
            rows.push(c);
            values.push(3.0 + 0.1 * (c as f64).sin());
            if let Some(k) = coupled.iter().position(|d| *d == c).filter(|k| k + 1 < coupled.len()) {
                rows.push(coupled[k + 1]);
                values.push(-1.0 - 0.1 * (k as f64).cos());
                // A longer tie now and then, so that the order matters.
                if k % 5 == 0 && k + 7 < coupled.len() {
                    rows.push(coupled[k + 7]);
                    values.push(0.3);
                }
            }
            starts.push(rows.len());
        }
        let factor = SparseCholesky::new("the chain", starts, rows, values, 0).unwrap().unwrap();
        let mut x = Mat::from_fn(n, 2, |i, _| right(i));
        factor.solve(&mut x).unwrap();
        ((0..n).map(|i| x[(i, 1)]).collect(), factor.len())
    }

    #[test]
    fn unknowns_that_stand_alone_change_no_bit_of_the_others() {
        let alone: Vec<usize> = (0..90).filter(|c| c % 3 != 1).collect();
        let (x, entries) = chain(90, &alone, |i| i as f64);
        // The same system without them; the diagonal goes by the number of the column.
        let (mut starts, mut rows, mut values) = (vec![0], Vec::new(), Vec::new());
        for k in 0..30 {
            rows.push(k);
            values.push(3.0 + 0.1 * ((3 * k + 1) as f64).sin());
            for (far, value) in [(1, -1.0 - 0.1 * (k as f64).cos()), (7, 0.3)] {
                if k + far < 30 && (far == 1 || k % 5 == 0) {
                    rows.push(k + far);
                    values.push(value);
                }
            }
            starts.push(rows.len());
        }
        let compact = SparseCholesky::new("the chain", starts, rows, values, 0).unwrap().unwrap();
        let mut y = Mat::from_fn(30, 1, |k, _| (3 * k + 1) as f64);
        compact.solve(&mut y).unwrap();
        assert_eq!(entries, compact.len());
        for k in 0..30 {
            assert_eq!(x[3 * k + 1].to_bits(), y[(k, 0)].to_bits(), "unknown {k}");
        }
        for c in alone {
            assert_eq!(x[c], c as f64 / (3.0 + 0.1 * (c as f64).sin()));
        }
        // One that is alone makes a matrix indefinite as well.
        assert!(
            SparseCholesky::new("it", vec![0, 2, 3, 4], vec![0, 1, 1, 2], vec![2.0, 1.0, 2.0, 0.0], 0)
                .unwrap()
                .is_none()
        );
    }

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
