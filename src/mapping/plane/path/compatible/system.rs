//! The convex combinations of both drawings, and their solution in between.

use std::collections::BTreeMap;

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::lu::{LuRef, NumericLu, SymbolicLu, factorize_symbolic_lu};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use faer::{Conj, Mat, Par};
use glam::DVec2;

/// Rows of both drawings, one for each vertex off the frame: it is a convex combination of its
/// neighbours.
#[derive(Clone, Debug)]
pub(super) struct System {
    /// Positions of the vertices of the frame, which come first.
    frame: Vec<DVec2>,
    /// Pattern of the unknowns by columns, with the diagonal.
    pattern: SymbolicSparseColMat<usize>,
    symbolic: SymbolicLu<usize>,
    /// Entries of `I - M` in the order of the pattern, of both drawings.
    entries: [Vec<f64>; 2],
    /// What the frame contributes to the right-hand sides.
    right: [Vec<DVec2>; 2],
}

/// Mean value weights of a drawing's triangles, by row and neighbour, each row with the sum 1;
/// `None` if a triangle is not positive.
fn weights(points: &[DVec2], triangles: &[[usize; 3]]) -> Option<BTreeMap<(usize, usize), f64>> {
    let mut weights: BTreeMap<(usize, usize), f64> = BTreeMap::new();
    for &[a, b, c] in triangles {
        for (a, b, c) in [(a, b, c), (b, c, a), (c, a, b)] {
            let (u, v) = (points[b] - points[a], points[c] - points[a]);
            let (r, s, cross, dot) = (u.length(), v.length(), u.perp_dot(v), u.dot(v));
            let tangent = if dot >= 0.0 { cross / (r * s + dot) } else { (r * s - dot) / cross };
            if !(tangent > 0.0 && tangent.is_finite()) {
                return None;
            }
            *weights.entry((a, b)).or_default() += tangent / r;
            *weights.entry((a, c)).or_default() += tangent / s;
        }
    }
    let mut sums: BTreeMap<usize, f64> = BTreeMap::new();
    for (&(row, _), weight) in &weights {
        *sums.entry(row).or_default() += weight;
    }
    for ((row, _), weight) in &mut weights {
        *weight /= sums[row];
    }
    Some(weights)
}

impl System {
    /// The system of a triangulation in two drawings, whose first `frame` vertices are the same in
    /// both.
    pub(super) fn new(drawings: &[Vec<DVec2>; 2], triangles: &[[usize; 3]], frame: usize) -> Option<Self> {
        let unknowns = drawings[0].len() - frame;
        let rows = [weights(&drawings[0], triangles)?, weights(&drawings[1], triangles)?];
        // Both drawings have the same edges: one pattern, by columns.
        let mut columns: Vec<Vec<usize>> = (0..unknowns).map(|column| vec![column]).collect();
        let mut right = [vec![DVec2::ZERO; unknowns], vec![DVec2::ZERO; unknowns]];
        for &(row, column) in rows[0].keys().filter(|(row, _)| *row >= frame) {
            if column >= frame {
                columns[column - frame].push(row - frame);
            } else {
                for (right, rows) in right.iter_mut().zip(&rows) {
                    right[row - frame] += drawings[0][column] * rows[&(row, column)];
                }
            }
        }
        let mut starts = vec![0];
        let mut indices = Vec::new();
        let mut entries = [Vec::new(), Vec::new()];
        for (column, mut rows_of) in columns.into_iter().enumerate() {
            rows_of.sort_unstable();
            for row in rows_of {
                indices.push(row);
                for (entries, rows) in entries.iter_mut().zip(&rows) {
                    entries.push(if row == column { 1.0 } else { -rows[&(row + frame, column + frame)] });
                }
            }
            starts.push(indices.len());
        }
        let pattern = SymbolicSparseColMat::new_checked(unknowns, unknowns, starts, None, indices);
        let symbolic = factorize_symbolic_lu(pattern.as_ref(), Default::default()).ok()?;
        Some(Self { frame: drawings[0][..frame].to_vec(), pattern, symbolic, entries, right })
    }

    /// Number of vertices of the frame.
    pub(super) fn frame(&self) -> usize {
        self.frame.len()
    }

    /// Positions of all vertices at `t`: the rows of both drawings mixed and solved.
    pub(super) fn solve(&self, t: f64) -> Option<Vec<DVec2>> {
        let mix = |a: f64, b: f64| (1.0 - t) * a + t * b;
        let entries: Vec<f64> = self.entries[0].iter().zip(&self.entries[1]).map(|(&a, &b)| mix(a, b)).collect();
        let matrix = SparseColMatRef::new(self.pattern.as_ref(), &entries);
        let unknowns = self.right[0].len();
        let mut solution =
            Mat::from_fn(unknowns, 2, |row, axis| mix(self.right[0][row][axis], self.right[1][row][axis]));
        let scratch = self
            .symbolic
            .factorize_numeric_lu_scratch::<f64>(Par::Seq, Default::default())
            .or(self.symbolic.solve_in_place_scratch::<f64>(2, Par::Seq));
        let mut memory = MemBuffer::try_new(scratch).ok()?;
        let stack = MemStack::new(&mut memory);
        let mut numeric = NumericLu::new();
        self.symbolic.factorize_numeric_lu(&mut numeric, matrix, Par::Seq, stack, Default::default()).ok()?;
        LuRef::new_unchecked(&self.symbolic, &numeric).solve_in_place_with_conj(
            Conj::No,
            solution.as_mut(),
            Par::Seq,
            stack,
        );
        let found = (0..unknowns).map(|row| DVec2::new(solution[(row, 0)], solution[(row, 1)]));
        let points: Vec<DVec2> = self.frame.iter().copied().chain(found).collect();
        points.iter().all(|p| p.is_finite()).then_some(points)
    }
}
