//! The bending energy of functions on a mesh, and smoothing systems made of it.

use glam::DVec3;

use super::cholesky::{SparseCholesky, SparsePattern};
use super::laplacian::{Laplacian, SparseRows};
use crate::error::{Error, Result};

/// Smallest mass of a vertex in parts of the mean one.
const LEAST_MASS: f64 = 1e-4;

/// `L' M^-1 L` and `M`: L is the cotangent Laplacian without boundary flow, so that linear functions on flat meshes have no energy, M the lumped mass.
#[derive(Clone, Debug)]
pub(crate) struct Bending {
    /// Lower half: row v holds column v of the matrix from the diagonal on.
    energy: SparseRows,
    /// The same places, analysed.
    pattern: SparsePattern,
    /// Lumped mass of each vertex, positive.
    pub(crate) mass: Vec<f64>,
}

impl Bending {
    /// The energy over `triangles`, the usable ones of a mesh. O(V + F), and the analysis for factorisations.
    ///
    /// # Errors
    /// [`Error::Numeric`] if there is not enough memory.
    pub(crate) fn new(positions: &[DVec3], triangles: &[[u32; 3]]) -> Result<Self> {
        let laplacian = Laplacian::new(positions, triangles);
        let rows = laplacian.without_boundary_flow(positions, triangles);
        let n = positions.len();
        let least = LEAST_MASS * laplacian.mass.iter().sum::<f64>() / n.max(1) as f64;
        let mass: Vec<f64> = laplacian.mass.iter().map(|m| m.max(least)).collect();
        let mut triplets = Vec::new();
        for r in 0..n {
            let (columns, values) = rows.row(r);
            for (&i, &x) in columns.iter().zip(values) {
                for (&j, &y) in columns.iter().zip(values).filter(|(j, _)| **j >= i) {
                    triplets.push((i, j, x * y / mass[r]));
                }
            }
        }
        // Vertices of no triangle get their diagonal too.
        triplets.extend((0..n as u32).map(|v| (v, v, 0.0)));
        let energy = SparseRows::from_triplets(n, &triplets);
        let (mut starts, mut rows) = (vec![0], Vec::new());
        for v in 0..n {
            rows.extend(energy.row(v).0.iter().map(|&j| j as usize));
            starts.push(rows.len());
        }
        let pattern = SparsePattern::new("the relaxation of the map", starts, rows)?;
        Ok(Self { energy, pattern, mass })
    }

    /// Factorises `M + eps L' M^-1 L + weight sum x x'`, `x` being the barycentric coordinates of `ties` to points of triangles.
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
                let own = if j as usize == v { self.mass[v] } else { 0.0 };
                // The corners of a triangle are in each other's rows.
                let tie = tied.iter().position(|&t| t == j).map_or(0.0, |k| weights[k]);
                values.push(eps * e + own + tie);
            }
        }
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

    #[test]
    fn linear_functions_cost_nothing_and_ties_hold() {
        let mesh = irregular_plane(7, 6, 2.0, 1.5, Diagonal::Alternating, 0.3, 3);
        let triangles = mesh.triangles().to_vec();
        let bending = Bending::new(&mesh.positions, &triangles).unwrap();
        let n = mesh.vertex_count();
        // Three points tied to a linear function that the mass pulls to zero: a plate of stiffness 1e6 under a load of at most 5 bends by about
        // 5 L^4 / 8e6 = 1e-5 over its length L of 2, and ties of weight 1e6 give way by as much.
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
