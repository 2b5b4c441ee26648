//! The Gauss-Newton matrix (I - dF)ᵀ(I - dF) of the free vertices, assembled and factorised.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::sparse::linalg::cholesky::{LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use faer::{Conj, MatMut, Par, Side};

use super::springs::{Stretch, outer};
use super::{Stencils, V3};
use crate::error::{Error, Result};

/// Pattern, ordering and memory of the matrix of one stage; made once, used for every iteration and frame.
pub(crate) struct DirectSolver {
    pattern: SymbolicSparseColMat<usize>,
    symbolic: SymbolicCholesky<usize>,
    /// End of each row's slots.
    row_end: Vec<u32>,
    /// For each row of the stencils its free members: number among the free, and slot or `OWN`.
    member_start: Vec<u32>,
    members: Vec<(u32, u32)>,
    /// For each pair (later, earlier or same) of a row's members, in order: the block of the lower half.
    pair_block: Vec<u32>,
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
        for row in 0..stencils.row_count() {
            let m = &members[row_members(row)];
            for (i, a) in m.iter().enumerate() {
                for b in &m[..=i] {
                    let (low, high) = (a.0.min(b.0), a.0.max(b.0));
                    pairs.push(u64::from(low) << 32 | u64::from(high));
                }
            }
        }
        let all = pairs.clone();
        // A free vertex in no row still gets its diagonal.
        pairs.extend((0..free as u64).map(|v| v << 32 | v));
        pairs.sort_unstable();
        pairs.dedup();
        let find = |pair: u64| pairs.partition_point(|&p| p < pair) as u32;
        let column_start: Vec<usize> = (0..=free as u64).map(|v| find(v << 32) as usize).collect();
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
        for v in 0..free {
            let blocks = column_start[v]..column_start[v + 1];
            for c in 0..3 {
                for block in blocks.clone() {
                    let high = (pairs[block] & 0xffff_ffff) as usize;
                    // The entry of scalar row 0 of the block, which the diagonal one has only in its first column.
                    let skip = if high == v { c } else { 0 };
                    block_at[block][c] = rows.len() as u32 - skip as u32;
                    rows.extend((skip..3).map(|r| 3 * high + r));
                }
                starts.push(rows.len());
            }
        }
        let diagonal = column_start[..free].iter().map(|&b| b as u32).collect();
        let pattern = SymbolicSparseColMat::new_checked(3 * free, 3 * free, starts, None, rows);
        let symbolic =
            factorize_symbolic_cholesky(pattern.as_ref(), Side::Lower, SymmetricOrdering::Amd, Default::default())
                .map_err(|e| failed(&format!("{e:?}")))?;
        let memory = |request| MemBuffer::try_new(request).map_err(|_| failed("out of memory"));
        let scratch = memory(symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default()))?;
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
            block_at,
            diagonal,
            values,
            factor,
            scratch,
            solve_scratch,
        })
    }

    /// Solves (H + damping diag H) x = gradient in place; `false` if the matrix is not numerically positive definite. `springs` has an
    /// entry a slot, or none.
    pub(crate) fn solve(&mut self, blocks: &[[f64; 9]], springs: &[Stretch], damping: f64, x: &mut [V3<f64>]) -> bool {
        if !self.factor(blocks, springs, damping) {
            return false;
        }
        self.apply(x);
        x.iter().flatten().all(|v| v.is_finite())
    }

    /// Factorises H + damping diag H; `false` if it is not numerically positive definite.
    pub(crate) fn factor(&mut self, blocks: &[[f64; 9]], springs: &[Stretch], damping: f64) -> bool {
        self.assemble(blocks, springs);
        for &block in &self.diagonal {
            for c in 0..3 {
                let value = &mut self.values[self.block_at[block as usize][c] as usize + c];
                // A vertex in no row stays where it is.
                *value = if *value > 0.0 { *value * (1.0 + damping) } else { 1.0 };
            }
        }
        let matrix = SparseColMatRef::new(self.pattern.as_ref(), &self.values);
        // Sequential: the number of threads must not change the result.
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
        let right = MatMut::from_column_major_slice_mut(x.as_flattened_mut(), 3 * n, 1);
        let llt = LltRef::<usize, f64>::new(&self.symbolic, &self.factor);
        llt.solve_in_place_with_conj(Conj::No, right, Par::Seq, MemStack::new(&mut self.solve_scratch));
    }

    fn assemble(&mut self, blocks: &[[f64; 9]], springs: &[Stretch]) {
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
            for (i, a) in m.iter().enumerate() {
                for b in &m[..=i] {
                    // The block of the later vertex's rows and the earlier one's columns: A_highᵀ A_low.
                    let (low, high) = if a.0 < b.0 { (a, b) } else { (b, a) };
                    let block = self.pair_block[pair] as usize;
                    pair += 1;
                    let at = self.block_at[block];
                    let diagonal = low.0 == high.0;
                    for c in 0..3 {
                        for r in if diagonal { c } else { 0 }..3 {
                            let value = match (high.1, low.1) {
                                (OWN, OWN) => f64::from(u8::from(r == c)),
                                (OWN, s) => -blocks[s as usize][3 * r + c] - outer(springs, s, r, c),
                                (s, OWN) => -blocks[s as usize][3 * c + r] - outer(springs, s, r, c),
                                (s, t) => {
                                    let (p, q) = (&blocks[s as usize], &blocks[t as usize]);
                                    let own = if s == t { outer(springs, s, r, c) } else { 0.0 };
                                    p[r] * q[c] + p[3 + r] * q[3 + c] + p[6 + r] * q[6 + c] + own
                                }
                            };
                            self.values[at[c] as usize + r] += value;
                        }
                    }
                }
            }
        }
    }
}
