//! The Gauss-Newton matrix (I - dF)ᵀ(I - dF) of the free vertices, assembled and factorised.
//!
//! The square of a row of thousands of neighbours would be dense. Such a row borders the matrix
//! instead, with three unknowns of its own (see `geometry::cholesky`).

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::ldlt::factor::LdltRegularization;
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::sparse::linalg::cholesky::{
    LdltRef, LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use faer::{Conj, MatMut, Par, Side};

use super::springs::{Stretch, outer};
use super::{Stencils, V3};
use crate::error::{Error, Result};
use crate::geometry::cholesky::LONGEST;

/// Pattern, ordering and memory of the matrix of one stage; made once, used for every iteration and
/// frame.
pub(crate) struct DirectSolver {
    pattern: SymbolicSparseColMat<usize>,
    symbolic: SymbolicCholesky<usize>,
    /// End of each row's slots.
    row_end: Vec<u32>,
    /// For each row of the stencils its free members: number among the free, and slot or `OWN`.
    member_start: Vec<u32>,
    members: Vec<(u32, u32)>,
    /// For each pair of [`row_pairs`], row after row: the block of the lower half.
    pair_block: Vec<u32>,
    /// How many rows border the matrix.
    border: usize,
    /// Rows of more members than this do.
    longest: usize,
    /// Free vertices in no row.
    loose: Vec<bool>,
    /// Where a block's columns begin in the values: three offsets.
    block_at: Vec<[u32; 3]>,
    /// Blocks on the diagonal.
    diagonal: Vec<u32>,
    values: Vec<f64>,
    factor: Vec<f64>,
    scratch: MemBuffer,
    solve_scratch: MemBuffer,
}

const OWN: u32 = u32::MAX;
/// Least damping of a bordered matrix. Without its long rows the matrix may be singular, and is
/// factorised without pivots: the damping bounds their growth by its inverse, so that ten digits
/// are left. It bends a step by a millionth; the minimum stays where it is.
const LEAST_DAMPING: f64 = 1e-6;
/// In the place of a slot: the unknowns of a row that borders the matrix.
const BORDER: u32 = u32::MAX - 1;

/// The pairs of a row's members whose blocks it adds to, the members of a square in order; of a row
/// that borders, whose unknowns have number `border`, each with itself and with the row's own
/// vertex (for springs), and each with the border.
fn row_pairs(m: &[(u32, u32)], border: Option<u32>, mut visit: impl FnMut((u32, u32), (u32, u32))) {
    let Some(border) = border.map(|number| (number, BORDER)) else {
        m.iter().enumerate().for_each(|(i, a)| m[..=i].iter().for_each(|b| visit(*a, *b)));
        return;
    };
    let own = m.first().copied().filter(|a| a.1 == OWN);
    for &a in m {
        visit(a, a);
        if let Some(own) = own.filter(|_| a.1 != OWN) {
            visit(a, own);
        }
        visit(border, a);
    }
    visit(border, border);
}

impl std::fmt::Debug for DirectSolver {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("DirectSolver").field("unknowns", &(3 * self.diagonal.len())).finish_non_exhaustive()
    }
}

fn failed(what: &str) -> Error {
    Error::numeric(
        format!("the system of the encoding could not be solved: {what}"),
        "Use a smaller mesh or more memory",
    )
}

impl DirectSolver {
    /// The solver for the free vertices (those from `held` on) of `stencils`.
    pub(crate) fn new(stencils: &Stencils, held: usize) -> Result<Self> {
        Self::with_rows_to(LONGEST, stencils, held)
    }

    /// As [`DirectSolver::new`], with rows of more than `longest` members as borders.
    fn with_rows_to(longest: usize, stencils: &Stencils, held: usize) -> Result<Self> {
        let free = stencils.vertex_count() - held;
        let (mut member_start, mut members) = (vec![0u32], Vec::new());
        for row in 0..stencils.row_count() {
            let own = stencils.vertex[row] as usize;
            if own >= held {
                members.push(((own - held) as u32, OWN));
            }
            for slot in stencils.slots(row) {
                let v = stencils.neighbour[slot] as usize;
                if v >= held {
                    members.push(((v - held) as u32, slot as u32));
                }
            }
            member_start.push(members.len() as u32);
        }
        // Pairs of free vertices in a common row: the blocks of the lower half, column by column.
        let mut pairs: Vec<u64> = Vec::new();
        let row_members = |row: usize| member_start[row] as usize..member_start[row + 1] as usize;
        let mut border = 0;
        for row in 0..stencils.row_count() {
            let m = &members[row_members(row)];
            let number = (m.len() > longest).then_some((free + border) as u32);
            border += usize::from(number.is_some());
            row_pairs(m, number, |a, b| pairs.push(u64::from(a.0.min(b.0)) << 32 | u64::from(a.0.max(b.0))));
        }
        let mut loose = vec![true; free];
        members.iter().for_each(|m| loose[m.0 as usize] = false);
        let unknowns = free + border;
        let all = pairs.clone();
        // A free vertex in no row still gets its diagonal.
        pairs.extend((0..free as u64).map(|v| v << 32 | v));
        pairs.sort_unstable();
        pairs.dedup();
        let find = |pair: u64| pairs.partition_point(|&p| p < pair) as u32;
        let column_start: Vec<usize> = (0..=unknowns as u64).map(|v| find(v << 32) as usize).collect();
        // Finding each pair within its column only.
        let pair_block = all
            .iter()
            .map(|&pair| {
                let c = (pair >> 32) as usize;
                let begin = column_start[c];
                (begin + pairs[begin..column_start[c + 1]].partition_point(|&p| p < pair)) as u32
            })
            .collect();
        // Three scalar columns a block column; the diagonal block has its lower half only.
        let mut block_at = vec![[0u32; 3]; pairs.len()];
        let (mut starts, mut rows) = (vec![0usize], Vec::new());
        for v in 0..unknowns {
            let blocks = column_start[v]..column_start[v + 1];
            for c in 0..3 {
                for block in blocks.clone() {
                    let high = (pairs[block] & 0xffff_ffff) as usize;
                    // The entry of scalar row 0 of the block, which the diagonal one has only in
                    // its first column.
                    let skip = if high == v { c } else { 0 };
                    block_at[block][c] = rows.len() as u32 - skip as u32;
                    rows.extend((skip..3).map(|r| 3 * high + r));
                }
                starts.push(rows.len());
            }
        }
        let diagonal = column_start[..free].iter().map(|&b| b as u32).collect();
        let pattern = SymbolicSparseColMat::new_checked(3 * unknowns, 3 * unknowns, starts, None, rows);
        let symbolic =
            factorize_symbolic_cholesky(pattern.as_ref(), Side::Lower, SymmetricOrdering::Amd, Default::default())
                .map_err(|e| failed(&format!("{e:?}")))?;
        let memory = |request| MemBuffer::try_new(request).map_err(|_| failed("out of memory"));
        let scratch = memory(match border {
            0 => symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default()),
            _ => symbolic.factorize_numeric_ldlt_scratch::<f64>(Par::Seq, Default::default()),
        })?;
        let solve_scratch = memory(symbolic.solve_in_place_scratch::<f64>(1, Par::Seq))?;
        let mut factor = Vec::new();
        factor.try_reserve_exact(symbolic.len_val()).map_err(|_| failed("out of memory"))?;
        factor.resize(symbolic.len_val(), 0.0);
        let values = vec![0.0; pattern.compute_nnz()];
        Ok(Self {
            pattern,
            symbolic,
            row_end: stencils.start[1..].to_vec(),
            member_start,
            members,
            pair_block,
            border,
            longest,
            loose,
            block_at,
            diagonal,
            values,
            factor,
            scratch,
            solve_scratch,
        })
    }

    /// Solves (H + damping diag H) x = gradient in place; `false` if the matrix is not numerically
    /// positive definite. `springs` has an entry a slot, or none.
    pub(crate) fn solve(&mut self, blocks: &[[f64; 9]], springs: &[Stretch], damping: f64, x: &mut [V3<f64>]) -> bool {
        if !self.factor(blocks, springs, damping) {
            return false;
        }
        self.apply(x);
        x.iter().flatten().all(|v| v.is_finite())
    }

    /// Factorises H + damping diag H; `false` if it is not numerically positive definite.
    pub(crate) fn factor(&mut self, blocks: &[[f64; 9]], springs: &[Stretch], damping: f64) -> bool {
        let damping = if self.border > 0 { damping.max(LEAST_DAMPING) } else { damping };
        self.assemble(blocks, springs, damping);
        for (v, &block) in self.diagonal.iter().enumerate() {
            for c in 0..3 {
                let value = &mut self.values[self.block_at[block as usize][c] as usize + c];
                // A vertex in no row stays where it is; so does one whose rows are zero.
                let still = self.loose[v] || (self.border == 0 && !(*value > 0.0));
                *value = if still { 1.0 } else { *value * (1.0 + damping) };
            }
        }
        let matrix = SparseColMatRef::new(self.pattern.as_ref(), &self.values);
        // Sequential: the number of threads must not change the result.
        if self.border > 0 {
            let done = self.symbolic.factorize_numeric_ldlt(
                &mut self.factor,
                matrix,
                Side::Lower,
                LdltRegularization::default(),
                Par::Seq,
                MemStack::new(&mut self.scratch),
                Default::default(),
            );
            return done.is_ok() && self.factor.iter().all(|x| x.is_finite());
        }
        let done = self.symbolic.factorize_numeric_llt(
            &mut self.factor,
            matrix,
            Side::Lower,
            LltRegularization::default(),
            Par::Seq,
            MemStack::new(&mut self.scratch),
            Default::default(),
        );
        done.is_ok()
    }

    /// Solves with the last factorisation, in place.
    pub(crate) fn apply(&mut self, x: &mut [V3<f64>]) {
        let n = x.len();
        if self.border > 0 {
            let mut whole = vec![[0.0; 3]; n + self.border];
            whole[..n].copy_from_slice(x);
            let right = MatMut::from_column_major_slice_mut(whole.as_flattened_mut(), 3 * (n + self.border), 1);
            let ldlt = LdltRef::<usize, f64>::new(&self.symbolic, &self.factor);
            ldlt.solve_in_place_with_conj(Conj::No, right, Par::Seq, MemStack::new(&mut self.solve_scratch));
            x.copy_from_slice(&whole[..n]);
            return;
        }
        let right = MatMut::from_column_major_slice_mut(x.as_flattened_mut(), 3 * n, 1);
        let llt = LltRef::<usize, f64>::new(&self.symbolic, &self.factor);
        llt.solve_in_place_with_conj(Conj::No, right, Par::Seq, MemStack::new(&mut self.solve_scratch));
    }

    /// The damping of what rows that border add to the diagonal is added here, as the diagonal
    /// lacks it.
    fn assemble(&mut self, blocks: &[[f64; 9]], springs: &[Stretch], damping: f64) {
        let free = self.loose.len();
        let mut border = 0;
        self.values.iter_mut().for_each(|v| *v = 0.0);
        let mut pair = 0;
        let mut slot = 0;
        for row in 0..self.member_start.len() - 1 {
            let m = &self.members[self.member_start[row] as usize..self.member_start[row + 1] as usize];
            let slots = slot..self.row_end[row] as usize;
            slot = slots.end;
            if let Some((v, OWN)) = m.first() {
                // The row's own vertex is pulled by all its springs, also those to held neighbours.
                let at = self.block_at[self.diagonal[*v as usize] as usize];
                for s in springs.get(slots).into_iter().flatten() {
                    for c in 0..3 {
                        for r in c..3 {
                            self.values[at[c] as usize + r] += s.direction[r] * s.direction[c];
                        }
                    }
                }
            }
            let number = (m.len() > self.longest).then_some((free + border) as u32);
            border += usize::from(number.is_some());
            let (values, pair_block, block_at) = (&mut self.values, &self.pair_block, &self.block_at);
            row_pairs(m, number, |a, b| {
                // The block of the later vertex's rows and the earlier one's columns: A_highᵀ
                // A_low.
                let (low, high) = if a.0 < b.0 { (a, b) } else { (b, a) };
                let at = block_at[pair_block[pair] as usize];
                pair += 1;
                let diagonal = low.0 == high.0;
                let squared = number.is_none();
                for c in 0..3 {
                    for r in if diagonal { c } else { 0 }..3 {
                        let unit = f64::from(u8::from(r == c));
                        let value = match (high.1, low.1) {
                            (BORDER, BORDER) => -unit,
                            (BORDER, OWN) => unit,
                            (BORDER, s) => -blocks[s as usize][3 * r + c],
                            (OWN, OWN) if squared => unit,
                            (OWN, s) | (s, OWN) if !squared && s != OWN => -outer(springs, s, r, c),
                            (s, _) if !squared => {
                                let (own, block) = match s {
                                    OWN => (0.0, unit),
                                    s => {
                                        let p = &blocks[s as usize];
                                        (
                                            outer(springs, s, r, c),
                                            p[c] * p[c] + p[3 + c] * p[3 + c] + p[6 + c] * p[6 + c],
                                        )
                                    }
                                };
                                own + if r == c { block * damping / (1.0 + damping) } else { 0.0 }
                            }
                            (OWN, s) => -blocks[s as usize][3 * r + c] - outer(springs, s, r, c),
                            (s, OWN) => -blocks[s as usize][3 * c + r] - outer(springs, s, r, c),
                            (s, t) => {
                                let (p, q) = (&blocks[s as usize], &blocks[t as usize]);
                                let own = if s == t { outer(springs, s, r, c) } else { 0.0 };
                                p[r] * q[c] + p[3 + r] * q[3 + c] + p[6 + r] * q[6 + c] + own
                            }
                        };
                        values[at[c] as usize + r] += value;
                    }
                }
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A star of `n` vertices around vertex 0, each with a ring of its neighbours on the rim and
    /// the middle.
    fn star(n: u32) -> Stencils {
        let mut rings: Vec<Vec<u32>> = vec![(1..=n).collect()];
        rings.extend((0..n).map(|i| vec![0, 1 + (i + 1) % n, 1 + (i + n - 1) % n]));
        Stencils::new(n as usize + 1, rings.iter().enumerate().map(|(v, ring)| (v as u32, &ring[..])))
    }

    #[test]
    fn borders_change_the_form_and_not_the_solution() {
        let stencils = star(30);
        let slots = stencils.neighbour.len();
        let wave = |i: usize, k: usize| ((7 * i + 3 * k) as f64).sin();
        let blocks: Vec<[f64; 9]> = (0..slots).map(|s| std::array::from_fn(|k| 0.4 * wave(s, k))).collect();
        let springs: Vec<Stretch> =
            (0..slots).map(|s| Stretch { direction: [0, 1, 2].map(|k| 0.3 * wave(s, k + 5)), value: 0.1 }).collect();
        for held in [0, 1, 4] {
            for (springs, damping) in [(&[][..], 1e-3), (&springs[..], LEAST_DAMPING), (&springs[..], 0.5)] {
                let right: Vec<V3<f64>> = (held..31).map(|i| [wave(i, 1), wave(i, 2), wave(i, 9)]).collect();
                let solve = |longest: usize| {
                    let mut solver = DirectSolver::with_rows_to(longest, &stencils, held).unwrap();
                    let mut x = right.clone();
                    assert!(solver.solve(&blocks, springs, damping, &mut x));
                    (solver.border, x)
                };
                let (none, plain) = solve(usize::MAX);
                let size = plain.iter().flatten().fold(0.0, |m: f64, x| m.max(x.abs()));
                assert_eq!(none, 0);
                // The apex alone, and all rows that have two free members or more.
                for (longest, least, most) in [(10, 1, 1), (1, 27, 31)] {
                    let (border, x) = solve(longest);
                    assert!((least..=most).contains(&border), "{border}");
                    let off =
                        x.iter().flatten().zip(plain.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                    // Rounding times the largest growth of pivots, and some.
                    assert!(
                        off < 1e-16 / LEAST_DAMPING * 100.0 * size,
                        "{held} held, rows to {longest}: {off:e} of {size}"
                    );
                }
            }
        }
    }

    #[test]
    fn entries_grow_with_the_vertices_whatever_the_valence() {
        for n in [500u32, 4000] {
            let solver = DirectSolver::new(&star(n), 1).unwrap();
            assert_eq!(solver.border, 1);
            // Rim: blocks to four others, half of them stored, and one of the border.
            assert!(solver.values.len() < 9 * 5 * n as usize && solver.factor.len() < 9 * 20 * n as usize);
        }
    }
}
