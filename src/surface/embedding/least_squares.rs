//! Least-squares meshes: the smoothest mesh of R^D through given positions of some vertices
//! (equation 15).

use faer::Mat;
use glam::DVec3;
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::geometry::cholesky::{LONGEST, SparseCholesky};
use crate::geometry::{Laplacian, SparseRows};

/// Columns of the system assembled by one task.
const BLOCK: usize = 2048;
/// Weight of the Dirichlet energy beside the bending energy, for wave lengths of the spacing of the
/// landmarks. It decides where the bending energy alone leaves a vertex free (ears of the
/// boundary).
const MEMBRANE: f64 = 1e-8;
/// Smallest mass of a vertex in parts of the mean one.
const LEAST_MASS: f64 = 1e-4;

/// Positions in R^D of all vertices, row-major, that minimise the bending energy x' L' M^-1 L x
/// with the vertices `fixed` at `targets`.
///
/// `targets` has `dimension` columns and a row for each of `fixed`, which must be distinct and hit
/// every component of the mesh. L is the cotangent Laplacian without boundary flow, so that planes
/// (and all linear images of flat meshes) are reproduced, also with a boundary; M is the lumped
/// mass. One sparse Cholesky factorisation of the free vertices' system and `dimension` solves.
///
/// # Errors
/// [`Error::Numeric`] if the system cannot be factorised or the result is not finite.
pub(crate) fn least_squares_mesh(
    positions: &[DVec3],
    triangles: &[[u32; 3]],
    fixed: &[u32],
    targets: &[f64],
    dimension: usize,
) -> Result<Vec<f64>> {
    let n = positions.len();
    let mut place = vec![None; n];
    for (row, &v) in fixed.iter().enumerate() {
        place[v as usize] = Some(row);
    }
    let free: Vec<u32> = (0..n as u32).filter(|&v| place[v as usize].is_none()).collect();
    let mut result = vec![0.0; n * dimension];
    for (row, &v) in fixed.iter().enumerate() {
        result[v as usize * dimension..][..dimension].copy_from_slice(&targets[row * dimension..][..dimension]);
    }
    if free.is_empty() {
        return Ok(result);
    }
    let laplacian = Laplacian::new(positions, triangles);
    let mut membrane = MEMBRANE * fixed.len() as f64 / laplacian.mass.iter().sum::<f64>();
    // Grossly degenerate meshes may need more of it.
    for _ in 0..3 {
        let system =
            System::new(positions, triangles, &laplacian, membrane, &free, &place, targets, dimension, LONGEST);
        if let Some(solution) = system.solve()? {
            for (row, &v) in free.iter().enumerate() {
                for k in 0..dimension {
                    result[v as usize * dimension + k] = solution[(row, k)];
                }
            }
            return Ok(result);
        }
        membrane *= 1e4;
    }
    Err(Error::numeric(
        "the least-squares mesh of the embedding could not be solved for",
        "Clean the mesh of degenerate and extremely thin triangles",
    ))
}

/// The normal equations of the free vertices: lower half by columns, and right-hand sides. Long
/// rows of M^-1/2 L border them.
struct System {
    starts: Vec<usize>,
    rows: Vec<usize>,
    values: Vec<f64>,
    right: Mat<f64>,
    border: usize,
}

impl System {
    #[expect(clippy::too_many_arguments, reason = "one call; the arguments are the parts of the equation")]
    fn new(
        positions: &[DVec3],
        triangles: &[[u32; 3]],
        laplacian: &Laplacian,
        membrane: f64,
        free: &[u32],
        place: &[Option<usize>],
        targets: &[f64],
        dimension: usize,
        longest: usize,
    ) -> Self {
        let n = positions.len();
        let rows = laplacian.without_boundary_flow(positions, triangles);
        let columns = transpose(&rows);
        let least = LEAST_MASS * laplacian.mass.iter().sum::<f64>() / n as f64;
        let mut index = vec![usize::MAX; n];
        for (i, &v) in free.iter().enumerate() {
            index[v as usize] = i;
        }
        let long: Vec<u32> = (0..n as u32).filter(|&r| rows.row(r as usize).0.len() > longest).collect();
        let root = |r: u32| laplacian.mass[r as usize].max(least).sqrt();
        // Column by column: entry (j, i) is the sum over rows r of L_ri L_rj / m_r.
        let blocks: Vec<Block> = free
            .par_chunks(BLOCK)
            .map(|part| {
                let mut block = Block::default();
                let (mut sums, mut touched) = (vec![0.0; n], Vec::new());
                let mut seen = vec![false; n];
                for &v in part {
                    let mut add = |j: u32, value: f64| {
                        if !seen[j as usize] {
                            seen[j as usize] = true;
                            touched.push(j);
                        }
                        sums[j as usize] += value;
                    };
                    let (at, values) = columns.row(v as usize);
                    for (&r, &value) in at.iter().zip(values) {
                        if rows.row(r as usize).0.len() > longest {
                            continue;
                        }
                        let factor = value / laplacian.mass[r as usize].max(least);
                        let (others, entries) = rows.row(r as usize);
                        others.iter().zip(entries).for_each(|(&j, &x)| add(j, factor * x));
                    }
                    let (others, entries) = laplacian.stiffness.row(v as usize);
                    others.iter().zip(entries).for_each(|(&j, &x)| add(j, membrane * x));
                    touched.sort_unstable();
                    let base = block.right.len();
                    block.right.resize(base + dimension, 0.0);
                    let begin = block.rows.len();
                    for &j in &touched {
                        let value = std::mem::take(&mut sums[j as usize]);
                        seen[j as usize] = false;
                        if let Some(row) = place[j as usize] {
                            for k in 0..dimension {
                                block.right[base + k] -= value * targets[row * dimension + k];
                            }
                        } else if j >= v {
                            block.rows.push(index[j as usize]);
                            block.values.push(value);
                        }
                    }
                    for (&r, &value) in at.iter().zip(values) {
                        if let Ok(k) = long.binary_search(&r) {
                            block.rows.push(free.len() + k);
                            block.values.push(value / root(r));
                        }
                    }
                    block.counts.push(block.rows.len() - begin);
                    touched.clear();
                }
                block
            })
            .collect();
        let mut starts = vec![0];
        let (mut row_indices, mut values) = (Vec::new(), Vec::new());
        let mut right = Mat::zeros(free.len() + long.len(), dimension);
        let mut i = 0;
        for block in blocks {
            for (row, count) in block.right.chunks_exact(dimension).zip(&block.counts) {
                row.iter().enumerate().for_each(|(k, x)| right[(i, k)] = *x);
                starts.push(starts[i] + count);
                i += 1;
            }
            row_indices.extend(block.rows);
            values.extend(block.values);
        }
        for (k, &r) in long.iter().enumerate() {
            let (others, entries) = rows.row(r as usize);
            for (&j, &x) in others.iter().zip(entries) {
                if let Some(row) = place[j as usize] {
                    for d in 0..dimension {
                        right[(free.len() + k, d)] -= x / root(r) * targets[row * dimension + d];
                    }
                }
            }
            row_indices.push(free.len() + k);
            values.push(-1.0);
            starts.push(row_indices.len());
        }
        Self { starts, rows: row_indices, values, right, border: long.len() }
    }

    /// The solution, or `None` if the matrix is not numerically positive definite.
    fn solve(self) -> Result<Option<Mat<f64>>> {
        let what = "the least-squares mesh of the embedding";
        let factor = SparseCholesky::new(what, self.starts, self.rows, self.values, self.border)?;
        let Some(factor) = factor else { return Ok(None) };
        let mut x = self.right;
        factor.solve(&mut x)?;
        let finite = (0..x.ncols()).all(|k| x.col_as_slice(k).iter().all(|v| v.is_finite()));
        Ok(finite.then_some(x))
    }
}

/// What one task assembles.
#[derive(Default)]
struct Block {
    counts: Vec<usize>,
    rows: Vec<usize>,
    values: Vec<f64>,
    right: Vec<f64>,
}

fn transpose(a: &SparseRows) -> SparseRows {
    let n = a.row_count();
    let mut start = vec![0usize; n + 1];
    for &c in &a.columns {
        start[c as usize + 1] += 1;
    }
    for r in 0..n {
        start[r + 1] += start[r];
    }
    let mut fill = start.clone();
    let (mut columns, mut values) = (vec![0u32; a.columns.len()], vec![0.0; a.columns.len()]);
    for r in 0..n {
        let (c, v) = a.row(r);
        for (&c, &v) in c.iter().zip(v) {
            let slot = &mut fill[c as usize];
            (columns[*slot], values[*slot]) = (r as u32, v);
            *slot += 1;
        }
    }
    SparseRows { start, columns, values }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An uneven sheet of n x n vertices in a plane of space.
    fn sheet(n: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let p = (0..n * n)
            .map(|k| {
                let (i, j) = (f64::from(k / n), f64::from(k % n));
                DVec3::new(j + 0.2 * (3.0 * i).sin(), i + 0.2 * (5.0 * j).cos(), 1.0)
            })
            .collect();
        let t = (0..(n - 1) * (n - 1))
            .map(|k| k / (n - 1) * n + k % (n - 1))
            .flat_map(|v| [[v, v + 1, v + n], [v + n, v + 1, v + n + 1]])
            .collect();
        (p, t)
    }

    /// A flat disk with `n` vertices in each of three rings around one.
    fn star(n: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let mut p = vec![DVec3::ZERO];
        for r in [1.0, 2.0, 3.0] {
            let angle = |i: u32| f64::from(i) / f64::from(n) * std::f64::consts::TAU;
            p.extend((0..n).map(|i| DVec3::new(r * angle(i).cos(), r * angle(i).sin(), 0.0)));
        }
        let at = |r: u32, i: u32| 1 + r * n + i % n;
        let mut t: Vec<[u32; 3]> = (0..n).map(|i| [0, at(0, i), at(0, i + 1)]).collect();
        for r in 0..2 {
            let squares = |i| [[at(r, i), at(r + 1, i), at(r, i + 1)], [at(r, i + 1), at(r + 1, i), at(r + 1, i + 1)]];
            t.extend((0..n).flat_map(squares));
        }
        (p, t)
    }

    #[test]
    fn a_vertex_of_many_neighbours_is_solved_for_in_linear_room() {
        let system = |n: u32, fixed: &[u32], longest: usize| {
            let (p, t) = star(n);
            let laplacian = Laplacian::new(&p, &t);
            let mut place = vec![None; p.len()];
            fixed.iter().enumerate().for_each(|(row, &v)| place[v as usize] = Some(row));
            let free: Vec<u32> = (0..p.len() as u32).filter(|&v| place[v as usize].is_none()).collect();
            let targets: Vec<f64> = fixed.iter().map(|&v| f64::from(v).sin()).collect();
            System::new(&p, &t, &laplacian, 1e-8, &free, &place, &targets, 1, longest)
        };
        // The middle is free, or fixed itself.
        for fixed in [[2, 41, 94, 107], [0, 2, 42, 101]] {
            let solve = |longest: usize| {
                let system = system(40, &fixed, longest);
                (system.border, system.solve().unwrap().unwrap())
            };
            let (none, plain) = solve(usize::MAX);
            let (border, bordered) = solve(20);
            assert_eq!((none, border), (0, 1));
            for i in 0..plain.nrows() {
                let off = (plain[(i, 0)] - bordered[(i, 0)]).abs();
                assert!(off < 1e-6 * plain.norm_max(), "unknown {i} is {off:e} off");
            }
        }
        for n in [500, 4000] {
            let large = system(n, &[7], LONGEST);
            assert_eq!(large.border, 1);
            assert!(large.values.len() < 20 * 3 * n as usize, "{n}: {} entries", large.values.len());
        }
    }

    #[test]
    fn reproduces_a_plane_and_interpolates() {
        let (p, t) = sheet(12);
        let fixed: Vec<u32> = [0, 11, 132, 143, 65, 40, 100].into();
        // A linear image in four dimensions.
        let image = |q: DVec3| [q.x, 2.0 * q.y - q.x, 3.0, 0.5 * q.y];
        let targets: Vec<f64> = fixed.iter().flat_map(|&v| image(p[v as usize])).collect();
        let x = least_squares_mesh(&p, &t, &fixed, &targets, 4).unwrap();
        for (v, q) in p.iter().enumerate() {
            for (k, y) in image(*q).into_iter().enumerate() {
                assert!((x[4 * v + k] - y).abs() < 1e-5, "vertex {v}: {} for {y}", x[4 * v + k]);
            }
        }
        // Positions no linear function takes are still met exactly.
        let targets: Vec<f64> = (0..28).map(|k| (f64::from(k) * 1.7).sin()).collect();
        let x = least_squares_mesh(&p, &t, &fixed, &targets, 4).unwrap();
        for (row, &v) in fixed.iter().enumerate() {
            assert_eq!(x[4 * v as usize..][..4], targets[4 * row..][..4]);
        }
    }

    #[test]
    fn all_fixed_needs_no_solve() {
        let (p, t) = sheet(2);
        let targets: Vec<f64> = (0..16).map(f64::from).collect();
        assert_eq!(least_squares_mesh(&p, &t, &[0, 1, 2, 3], &targets, 4).unwrap(), targets);
    }
}
