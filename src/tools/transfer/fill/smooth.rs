//! The harmonic function on the texels of holes.

use super::graph::Graph;
use super::pyramid::Pyramid;
use crate::control;
use crate::error::Result;
use crate::geometry::NONE;

/// The residual over the one of the start, or over the boundary values, that ends the iteration: a
/// fraction of a 16-bit step.
const TOLERANCE: f64 = 1e-7;
/// Iterations at most; the preconditioner needs a few dozen.
const MOST_ITERATIONS: usize = 500;
/// Coarse cells count as having this many neighbours: the Galerkin diagonal of bilinear functions
/// on a grid, about.
const COARSE_DEGREE: f64 = 4.0;

/// Solves the graph's Laplace equation, each node the mean of its neighbours, for nodes that
/// `filled` names, from `values` on; neighbours without a value do not count. Returns the
/// iterations.
///
/// Conjugate gradients in double precision, preconditioned by the sum of the pyramid's levels
/// (Bramble, Pasciak and Xu 1990, "Parallel multilevel preconditioners"): O(n) a step, and the
/// number of steps hardly grows with n. One thread, so always the same bits.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub(super) fn solve(
    graph: &Graph,
    pyramid: &Pyramid,
    known: &[f64],
    filled: &[bool],
    values: &mut [f64],
) -> Result<usize> {
    let n = values.len();
    let system = System::new(graph, pyramid, filled);
    let mut b = vec![0.0; n];
    for &(u, k) in &graph.border {
        b[u as usize] += known[k as usize];
    }
    let mut residual = vec![0.0; n];
    system.apply(values, &mut residual);
    for u in 0..n {
        residual[u] = if filled[u] { b[u] - residual[u] } else { 0.0 };
    }
    let enough = TOLERANCE * norm(&b);
    let mut z = vec![0.0; n];
    let mut along = vec![0.0; n];
    let mut product = vec![0.0; n];
    let mut before = 0.0;
    for iteration in 0..MOST_ITERATIONS {
        if norm(&residual) <= enough {
            return Ok(iteration);
        }
        control::check()?;
        system.precondition(&residual, &mut z);
        let now = dot(&residual, &z);
        let beta = if iteration == 0 { 0.0 } else { now / before };
        for u in 0..n {
            along[u] = z[u] + beta * along[u];
        }
        system.apply(&along, &mut product);
        let curvature = dot(&along, &product);
        // Also where it is not a number: colours of float pictures may be infinite. The start stays
        // then.
        if !(curvature > 0.0) {
            return Ok(iteration);
        }
        let step = now / curvature;
        for u in 0..n {
            values[u] += step * along[u];
            residual[u] -= step * product[u];
        }
        before = now;
    }
    Ok(MOST_ITERATIONS)
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

struct System<'a> {
    graph: &'a Graph,
    pyramid: &'a Pyramid,
    filled: &'a [bool],
    /// Number of neighbours of each node.
    degree: Vec<f64>,
    /// One over the diagonal of each level.
    inverse: Vec<Vec<f64>>,
}

impl<'a> System<'a> {
    fn new(graph: &'a Graph, pyramid: &'a Pyramid, filled: &'a [bool]) -> Self {
        let n = graph.unknown.len();
        // Edges that do not end in the same part: they hold a coarse function down that lies over
        // the part's border.
        let mut held = vec![0.0; n];
        for &(u, _) in &graph.border {
            held[u as usize] += 1.0;
        }
        for &(u, v) in &graph.across {
            held[u as usize] += f64::from(u8::from(filled[v as usize]));
        }
        let degree: Vec<f64> = (0..n)
            .map(|u| held[u] + graph.beside[u].iter().filter(|&&v| v != NONE && filled[v as usize]).count() as f64)
            .collect();
        let one_over = |d: &f64| if *d > 0.0 { 1.0 / d } else { 0.0 };
        let mut inverse = vec![degree.iter().map(one_over).collect::<Vec<f64>>()];
        for level in &pyramid.levels {
            let mut above = vec![0.0; level.count];
            for (h, parents) in held.iter().zip(&level.parents) {
                for &(p, w) in parents {
                    above[p as usize] += h * f64::from(w);
                }
            }
            inverse.push(above.iter().map(|h| 1.0 / (COARSE_DEGREE + h)).collect());
            held = above;
        }
        Self { graph, pyramid, filled, degree, inverse }
    }

    fn apply(&self, x: &[f64], out: &mut [f64]) {
        for (u, out) in out.iter_mut().enumerate() {
            *out = 0.0;
            if self.filled[u] {
                let beside = self.graph.beside[u].iter().filter(|&&v| v != NONE && self.filled[v as usize]);
                *out = self.degree[u] * x[u] - beside.map(|&v| x[v as usize]).sum::<f64>();
            }
        }
        for &(u, v) in &self.graph.across {
            if self.filled[u as usize] && self.filled[v as usize] {
                out[u as usize] -= x[v as usize];
            }
        }
    }

    fn precondition(&self, residual: &[f64], z: &mut [f64]) {
        let mut restricted = vec![residual.to_vec()];
        for level in &self.pyramid.levels {
            let mut above = vec![0.0; level.count];
            for (r, parents) in restricted[restricted.len() - 1].iter().zip(&level.parents) {
                for &(p, w) in parents {
                    above[p as usize] += r * f64::from(w);
                }
            }
            restricted.push(above);
        }
        let mut sum: Vec<f64> = Vec::new();
        for (l, r) in restricted.iter().enumerate().rev() {
            let mut here: Vec<f64> = r.iter().zip(&self.inverse[l]).map(|(r, d)| r * d).collect();
            if let Some(level) = self.pyramid.levels.get(l) {
                for (h, parents) in here.iter_mut().zip(&level.parents) {
                    *h += parents.iter().map(|&(p, w)| f64::from(w) * sum[p as usize]).sum::<f64>();
                }
            }
            sum = here;
        }
        for ((z, s), filled) in z.iter_mut().zip(sum).zip(self.filled) {
            *z = if *filled { s } else { 0.0 };
        }
    }
}
