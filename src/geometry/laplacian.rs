//! The cotangent Laplacian of a triangle mesh.

use glam::DVec3;

/// Largest cotangent taken as it is. Needles beyond it (angles under 1e-4) count as that sharp, so
/// that they cannot swamp their neighbours.
const MAX_COTANGENT: f64 = 1e4;

/// A sparse matrix by rows, columns ascending in each row.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct SparseRows {
    /// First entry of each row, and the number of entries at the end.
    pub(crate) start: Vec<usize>,
    /// Column of each entry.
    pub(crate) columns: Vec<u32>,
    /// Value of each entry.
    pub(crate) values: Vec<f64>,
}

impl SparseRows {
    /// The matrix with `rows` rows whose entries are `triplets` (row, column, value); equal places
    /// are summed in the order given.
    ///
    /// # Panics
    /// If a row is out of range.
    pub(crate) fn from_triplets(rows: usize, triplets: &[(u32, u32, f64)]) -> Self {
        let mut begin = vec![0usize; rows + 1];
        for t in triplets {
            begin[t.0 as usize + 1] += 1;
        }
        for r in 0..rows {
            begin[r + 1] += begin[r];
        }
        let mut fill = begin.clone();
        let mut sorted = vec![(0u32, 0.0); triplets.len()];
        for t in triplets {
            let slot = &mut fill[t.0 as usize];
            sorted[*slot] = (t.1, t.2);
            *slot += 1;
        }
        let mut matrix = Self { start: vec![0], ..Self::default() };
        for r in 0..rows {
            let row = &mut sorted[begin[r]..begin[r + 1]];
            // Stable, so that the order of summation is the caller's.
            row.sort_by_key(|e| e.0);
            for group in row.chunk_by(|a, b| a.0 == b.0) {
                matrix.columns.push(group[0].0);
                matrix.values.push(group.iter().map(|e| e.1).sum());
            }
            matrix.start.push(matrix.columns.len());
        }
        matrix
    }

    /// Number of rows.
    pub(crate) fn row_count(&self) -> usize {
        self.start.len().saturating_sub(1)
    }

    /// Columns and values of row `r`.
    pub(crate) fn row(&self, r: usize) -> (&[u32], &[f64]) {
        let range = self.start[r]..self.start[r + 1];
        (&self.columns[range.clone()], &self.values[range])
    }
}

/// Stiffness and mass of the linear finite elements on a mesh.
///
/// `stiffness` is symmetric and *positive semidefinite*: its off-diagonal entry of an edge is -(cot
/// a + cot b)/2 with the angles opposite to the edge, its rows sum to zero, and x' S x is the
/// Dirichlet energy (the integral of the squared gradient). It has no unit. The Laplace-Beltrami
/// operator is -M^-1 S. `mass` is the lumped barycentric one: a third of the area of the triangles
/// around a vertex, zero where there are none.
#[derive(Clone, Debug)]
pub(crate) struct Laplacian {
    /// Stiffness matrix S; entries of absent vertices have empty rows.
    pub(crate) stiffness: SparseRows,
    /// Lumped mass of each vertex, in squared units of the positions.
    pub(crate) mass: Vec<f64>,
}

/// Half the cotangents of the angles of a triangle, bounded.
pub(crate) fn half_cotangents(p: [DVec3; 3]) -> [f64; 3] {
    [0, 1, 2].map(|k| {
        let (a, b) = (p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]);
        let (dot, cross) = (a.dot(b), a.cross(b).length());
        let cot = if cross > 0.0 { dot / cross } else { MAX_COTANGENT.copysign(dot) };
        0.5 * if cot.is_finite() { cot.clamp(-MAX_COTANGENT, MAX_COTANGENT) } else { 0.0 }
    })
}

impl Laplacian {
    /// Stiffness and mass of `triangles`, which should be the usable ones of a mesh, over
    /// `positions`. O(V + F).
    ///
    /// # Panics
    /// If a triangle names a vertex that does not exist.
    pub(crate) fn new(positions: &[DVec3], triangles: &[[u32; 3]]) -> Self {
        let mut triplets = Vec::with_capacity(12 * triangles.len());
        let mut mass = vec![0.0; positions.len()];
        for t in triangles {
            let p = t.map(|v| positions[v as usize]);
            let third = (p[1] - p[0]).cross(p[2] - p[0]).length() / 6.0;
            for (k, w) in half_cotangents(p).into_iter().enumerate() {
                mass[t[k] as usize] += third;
                let (i, j) = (t[(k + 1) % 3], t[(k + 2) % 3]);
                triplets.extend([(i, j, -w), (j, i, -w), (i, i, w), (j, j, w)]);
            }
        }
        Self { stiffness: SparseRows::from_triplets(positions.len(), &triplets), mass }
    }

    /// The stiffness matrix with the boundary term taken out, so that it maps every linear function
    /// on a flat mesh to zero, also at the boundary. Its rows still sum to zero; it is no longer
    /// symmetric. Inner rows are those of the stiffness matrix.
    ///
    /// A boundary row of S holds, besides the Laplacian, the flow through the two boundary edges at
    /// the vertex. In a triangle with boundary edge (i, j) and opposite corner k that flow is,
    /// shared between i and j, minus row k of the triangle's own stiffness. Edges with three
    /// triangles or more are no boundary: there the flows cancel.
    pub(crate) fn without_boundary_flow(&self, positions: &[DVec3], triangles: &[[u32; 3]]) -> SparseRows {
        let mut edges: Vec<(u32, u32, u32, u8)> = Vec::with_capacity(3 * triangles.len());
        for (f, t) in triangles.iter().enumerate() {
            for k in 0..3 {
                let (i, j) = (t[(k + 1) % 3], t[(k + 2) % 3]);
                edges.push((i.min(j), i.max(j), f as u32, k as u8));
            }
        }
        edges.sort_unstable();
        let mut flow = Vec::new();
        for group in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)).filter(|g| g.len() == 1) {
            let (i, j, f, k) = group[0];
            let (t, k) = (triangles[f as usize], k as usize);
            let w = half_cotangents(t.map(|v| positions[v as usize]));
            let (next, last) = ((k + 1) % 3, (k + 2) % 3);
            for row in [i, j] {
                flow.extend([(row, t[k], w[next] + w[last]), (row, t[next], -w[last]), (row, t[last], -w[next])]);
            }
        }
        if flow.is_empty() {
            return self.stiffness.clone();
        }
        let mut triplets = Vec::with_capacity(self.stiffness.values.len() + flow.len());
        for r in 0..self.stiffness.row_count() {
            let (columns, values) = self.stiffness.row(r);
            triplets.extend(columns.iter().zip(values).map(|(&c, &v)| (r as u32, c, v)));
        }
        triplets.extend(flow);
        SparseRows::from_triplets(self.stiffness.row_count(), &triplets)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sheet() -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let n = 5;
        let p = (0..n * n)
            .map(|k| {
                let (i, j) = ((k / n) as f64, (k % n) as f64);
                DVec3::new(j + 0.2 * (3.0 * i).sin(), i + 0.2 * (5.0 * j).cos(), 1.0)
            })
            .collect();
        let at = |i: usize, j: usize| (i * n + j) as u32;
        let t = (0..n - 1)
            .flat_map(|i| (0..n - 1).map(move |j| (i, j)))
            .flat_map(|(i, j)| [[at(i, j), at(i, j + 1), at(i + 1, j)], [at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)]])
            .collect();
        (p, t)
    }

    impl SparseRows {
        /// The product of row `r` with a column vector.
        fn dot_row(&self, r: usize, x: &[f64]) -> f64 {
            let (columns, values) = self.row(r);
            columns.iter().zip(values).map(|(&c, v)| v * x[c as usize]).sum()
        }
    }

    #[test]
    fn linear_functions_are_harmonic() {
        let (p, t) = sheet();
        let l = Laplacian::new(&p, &t);
        let x: Vec<f64> = p.iter().map(|q| 2.0 * q.x - 3.0 * q.y + 1.0).collect();
        let corrected = l.without_boundary_flow(&p, &t);
        for v in 0..p.len() {
            let (i, j) = (v / 5, v % 5);
            let inner = (1..4).contains(&i) && (1..4).contains(&j);
            let plain = l.stiffness.dot_row(v, &x).abs();
            assert!(!inner || plain < 1e-12);
            assert!(corrected.dot_row(v, &x).abs() < 1e-12, "vertex {v}");
        }
        // The uncorrected matrix does see the boundary.
        assert!(l.stiffness.dot_row(0, &x).abs() > 0.1);
    }

    #[test]
    fn stiffness_is_symmetric_with_zero_row_sums_and_no_negative_energy() {
        let (p, t) = sheet();
        let l = Laplacian::new(&p, &t);
        let s = &l.stiffness;
        let entry = |i: usize, j: u32| {
            let (c, v) = s.row(i);
            c.iter().position(|&k| k == j).map_or(0.0, |k| v[k])
        };
        for i in 0..p.len() {
            let (columns, values) = s.row(i);
            assert!(values.iter().sum::<f64>().abs() < 1e-12);
            assert!(columns.iter().all(|&j| (entry(i, j) - entry(j as usize, i as u32)).abs() < 1e-14));
        }
        for seed in 1..20 {
            let x: Vec<f64> = (0..p.len()).map(|i| ((i * seed) as f64).sin()).collect();
            assert!((0..p.len()).map(|i| x[i] * s.dot_row(i, &x)).sum::<f64>() > 0.0);
        }
        // The Dirichlet energy of x on a sheet is its area.
        let area: f64 = l.mass.iter().sum();
        let energy: f64 = (0..p.len()).map(|i| p[i].x * s.dot_row(i, &p.iter().map(|q| q.x).collect::<Vec<_>>())).sum();
        assert!((energy / area - 1.0).abs() < 1e-12);
    }

    #[test]
    fn degenerate_triangles_stay_bounded() {
        let p = [DVec3::ZERO, DVec3::X, DVec3::X * 0.5, DVec3::X * 0.5 + DVec3::Y * 1e-300];
        for t in [[0, 1, 2], [0, 1, 3], [0, 0, 1]] {
            let l = Laplacian::new(&p, &[t]);
            assert!(l.stiffness.values.iter().all(|v| v.abs() <= 2.0 * MAX_COTANGENT));
        }
    }
}
