//! The bending energy of functions on a mesh, and smoothing systems made of it.

use glam::DVec3;

use super::cholesky::{LONGEST, SparseCholesky, SparsePattern};
use super::laplacian::{Laplacian, SparseRows};
use crate::error::{Error, Result};

/// Smallest mass of a vertex in parts of the mean one.
const LEAST_MASS: f64 = 1e-4;

/// `L' M^-1 L` and `M`: L is the cotangent Laplacian without boundary flow, so that linear
/// functions on flat meshes have no energy, M the lumped mass.
#[derive(Clone, Debug)]
pub(crate) struct Bending {
    /// Lower half: row v holds column v of the matrix from the diagonal on, then its entries of
    /// long rows of M^-1/2 L, numbered after the vertices.
    energy: SparseRows,
    /// How many rows of L are long.
    long: usize,
    /// The same places, analysed.
    pattern: SparsePattern,
    /// Lumped mass of each vertex, positive.
    pub(crate) mass: Vec<f64>,
    /// The mean over the vertices of triangles: those that a file repeats or leaves unused have no
    /// part in it.
    pub(crate) mean_mass: f64,
}

impl Bending {
    /// The energy over `triangles`, the usable ones of a mesh. O(V + F), and the analysis for
    /// factorisations.
    ///
    /// # Errors
    /// [`Error::Numeric`] if there is not enough memory.
    pub(crate) fn new(positions: &[DVec3], triangles: &[[u32; 3]]) -> Result<Self> {
        Self::with_rows_to(LONGEST, positions, triangles)
    }

    /// As [`Bending::new`], with rows of more than `longest` entries as borders.
    fn with_rows_to(longest: usize, positions: &[DVec3], triangles: &[[u32; 3]]) -> Result<Self> {
        let laplacian = Laplacian::new(positions, triangles);
        let rows = laplacian.without_boundary_flow(positions, triangles);
        let n = positions.len();
        let massive = laplacian.mass.iter().filter(|m| **m > 0.0).count();
        let mean_mass = laplacian.mass.iter().sum::<f64>() / massive.max(1) as f64;
        let least = LEAST_MASS * mean_mass;
        let mass: Vec<f64> = laplacian.mass.iter().map(|m| m.max(least)).collect();
        let mut triplets = Vec::new();
        let mut long = 0;
        for r in 0..n {
            let (columns, values) = rows.row(r);
            if columns.len() > longest {
                let border = (n + long) as u32;
                triplets.extend(columns.iter().zip(values).map(|(&i, &x)| (i, border, x / mass[r].sqrt())));
                long += 1;
                continue;
            }
            for (&i, &x) in columns.iter().zip(values) {
                for (&j, &y) in columns.iter().zip(values).filter(|(j, _)| **j >= i) {
                    triplets.push((i, j, x * y / mass[r]));
                }
            }
        }
        // Vertices of no triangle get their diagonal too.
        triplets.extend((0..n as u32).map(|v| (v, v, 0.0)));
        if long > 0 {
            // Ties join the corners of a triangle, whatever its rows.
            let sides = triangles.iter().flat_map(|t| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])]);
            triplets.extend(sides.map(|(a, b)| (a.min(b), a.max(b), 0.0)));
        }
        let energy = SparseRows::from_triplets(n, &triplets);
        let (mut starts, mut rows) = (vec![0], Vec::new());
        for v in 0..n {
            rows.extend(energy.row(v).0.iter().map(|&j| j as usize));
            starts.push(rows.len());
        }
        for border in n..n + long {
            rows.push(border);
            starts.push(rows.len());
        }
        let pattern = SparsePattern::new("the relaxation of the map", starts, rows, long)?;
        Ok(Self { energy, long, pattern, mass, mean_mass })
    }

    /// Factorises `M + eps L' M^-1 L + weight sum x x'`, `x` being the barycentric coordinates of
    /// `ties` to points of triangles.
    ///
    /// # Errors
    /// [`Error::Numeric`] if that breaks down.
    pub(crate) fn factorise(&self, eps: f64, ties: &[([u32; 3], [f64; 3])], weight: f64) -> Result<SparseCholesky> {
        let n = self.mass.len();
        let mut extra = Vec::new();
        for (v, x) in ties {
            for a in 0..3 {
                for b in 0..3 {
                    if v[b] >= v[a] && (a == b || v[a] != v[b]) {
                        extra.push((v[a], v[b], weight * x[a] * x[b]));
                    }
                }
            }
        }
        let extra = SparseRows::from_triplets(n, &extra);
        let mut values = Vec::new();
        for v in 0..n {
            let (columns, entries) = self.energy.row(v);
            let (tied, weights) = extra.row(v);
            for (&j, &e) in columns.iter().zip(entries) {
                if j as usize >= n {
                    values.push(eps.sqrt() * e);
                    continue;
                }
                let own = if j as usize == v { self.mass[v] } else { 0.0 };
                // The corners of a triangle are in each other's rows.
                let tie = tied.iter().position(|&t| t == j).map_or(0.0, |k| weights[k]);
                values.push(eps * e + own + tie);
            }
        }
        values.extend(std::iter::repeat_n(-1.0, self.long));
        self.pattern.factorise(&values)?.ok_or_else(|| {
            Error::numeric(
                "the relaxation of the map breaks down",
                "Clean the target of degenerate and extremely thin triangles",
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::shapes::{Diagonal, irregular_plane};
    use faer::Mat;

    /// A disk, bent a little: one vertex with `n` neighbours, and a second ring.
    fn star(n: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let mut positions = vec![DVec3::new(0.0, 0.0, 0.1)];
        for r in [1.0, 2.0] {
            positions.extend((0..n).map(|i| {
                let a = f64::from(i) / f64::from(n) * std::f64::consts::TAU;
                DVec3::new(r * a.cos(), r * a.sin(), 0.2 * (3.0 * a).sin())
            }));
        }
        let next = |i: u32| (i + 1) % n;
        let triangles = (0..n)
            .flat_map(|i| {
                [[0, 1 + i, 1 + next(i)], [1 + i, 1 + n + i, 1 + next(i)], [1 + next(i), 1 + n + i, 1 + n + next(i)]]
            })
            .collect();
        (positions, triangles)
    }

    #[test]
    fn long_rows_change_the_form_and_not_the_solution() {
        let (positions, triangles) = star(40);
        let ties = [(triangles[3], [0.2, 0.3, 0.5]), (triangles[50], [0.1, 0.8, 0.1])];
        let solution = |longest: usize| {
            let bending = Bending::with_rows_to(longest, &positions, &triangles).unwrap();
            let factor = bending.factorise(0.3, &ties, 7.0).unwrap();
            let mut x = Mat::from_fn(positions.len(), 2, |i, k| ((i + 3 * k) as f64).sin());
            factor.solve(&mut x).unwrap();
            (bending.long, x)
        };
        let (none, plain) = solution(usize::MAX);
        assert_eq!(none, 0);
        for (longest, expected) in [(LONGEST.min(30), 1), (5, 41), (2, positions.len())] {
            let (long, x) = solution(longest);
            assert_eq!(long, expected);
            for (i, k) in (0..positions.len()).flat_map(|i| [(i, 0), (i, 1)]) {
                assert!((x[(i, k)] - plain[(i, k)]).abs() < 1e-9 * plain.norm_max(), "{longest}: {i} {k}");
            }
        }
    }

    #[test]
    fn entries_grow_with_the_vertices_whatever_the_valence() {
        for n in [500, 2000, 8000] {
            let (positions, triangles) = star(n);
            let bending = Bending::new(&positions, &triangles).unwrap();
            assert_eq!(bending.long, 1);
            // Rows of 6 or 7 entries have squares of 19, half of them stored; the star adds two
            // columns and two rows of the border.
            assert!(bending.energy.values.len() < 20 * positions.len(), "{n}");
            let factor = bending.factorise(1.0, &[], 0.0).unwrap();
            assert!(factor.len() < 200 * positions.len(), "{n}: {} entries", factor.len());
        }
    }

    #[test]
    fn linear_functions_cost_nothing_and_ties_hold() {
        let mesh = irregular_plane(7, 6, 2.0, 1.5, Diagonal::Alternating, 0.3, 3);
        let triangles = mesh.triangles().to_vec();
        let bending = Bending::new(&mesh.positions, &triangles).unwrap();
        let n = mesh.vertex_count();
        // Three points tied to a linear function that the mass pulls to zero: a plate of stiffness
        // 1e6 under a load of at most 5 bends by about 5 L^4 / 8e6 = 1e-5 over its length L of 2,
        // and ties of weight 1e6 give way by as much.
        let f = |p: DVec3| 2.0 + p.x - 3.0 * p.y;
        let x = [0.2, 0.3, 0.5];
        let tied: Vec<usize> = vec![0, triangles.len() / 2, triangles.len() - 1];
        let ties: Vec<_> = tied.iter().map(|&t| (triangles[t], x)).collect();
        let weight = 1e6;
        let factor = bending.factorise(1e6, &ties, weight).unwrap();
        let mut right = Mat::zeros(n, 1);
        for (v, x) in &ties {
            let value: f64 = v.iter().zip(x).map(|(&v, x)| x * f(mesh.positions[v as usize])).sum();
            for (&v, x) in v.iter().zip(x) {
                right[(v as usize, 0)] += weight * x * value;
            }
        }
        factor.solve(&mut right).unwrap();
        for (v, p) in mesh.positions.iter().enumerate() {
            assert!((right[(v, 0)] - f(*p)).abs() < 1e-3, "{v}: {} for {}", right[(v, 0)], f(*p));
        }
    }
}
