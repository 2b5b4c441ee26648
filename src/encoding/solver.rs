//! Gauss-Newton with line search on G (section 3.2.2), Levenberg-Marquardt where it stalls.

use super::decode::{encoding_residual, energy};
use super::derivative::{Linearisation, blocks};
use super::direct::DirectSolver;
use super::gradients::{Gradients, apply_transpose};
use super::springs::{Springs, add_gradient};
use super::vector::add_scaled;
use super::{Encoding, Stencils, V3};
use crate::control;
use crate::error::Result;

/// How the linear systems are solved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Method {
    /// Sparse Cholesky.
    Direct,
    /// At most so many steps of conjugate gradients.
    Gradients(usize),
}

/// When to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Stop {
    /// Most Gauss-Newton iterations.
    pub(crate) iterations: usize,
    /// Relative decrease of G under which it is converged.
    pub(crate) decrease: f64,
}

/// What one solve did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Solved {
    pub(crate) iterations: usize,
    pub(crate) gradient_steps: usize,
    pub(crate) before: f64,
    pub(crate) after: f64,
    /// The last decrease was below the tolerance.
    pub(crate) converged: bool,
}

/// Factorisations and vectors of one stage, kept between frames.
#[derive(Debug, Default)]
pub(crate) struct StageSolver {
    direct: Option<DirectSolver>,
    single: Gradients<f32>,
    double: Gradients<f64>,
}

/// G per vertex (in squared lengths of a shape with diagonal one) that is rounding.
const NOISE: f64 = 1e-30;
/// Most steps of conjugate gradients that are done in single precision.
const SINGLE: usize = 300;
/// Smallest step of the line search.
const LEAST_STEP: f64 = 1.0 / 1024.0;

impl StageSolver {
    /// Minimises G, and the springs' energy if there are any, over the vertices from `held` on,
    /// starting from and ending in `positions`.
    #[expect(clippy::too_many_arguments, reason = "the parts of one problem")]
    pub(crate) fn minimise(
        &mut self,
        stencils: &Stencils,
        encoding: &Encoding<f64>,
        springs: Option<&Springs>,
        held: usize,
        method: Method,
        stop: Stop,
        positions: &mut [V3<f64>],
    ) -> Result<Solved> {
        let n = positions.len();
        let mut residual = vec![[0.0; 3]; stencils.row_count()];
        let value = |positions: &[V3<f64>], residual: &mut [V3<f64>]| {
            encoding_residual(stencils, encoding, positions, residual);
            energy(residual) + springs.map_or(0.0, |s| s.energy(stencils, positions))
        };
        let mut g = value(positions, &mut residual);
        let mut solved = Solved { before: g, after: g, ..Solved::default() };
        let noise = NOISE * stencils.row_count() as f64;
        if held == n || !g.is_finite() {
            return Ok(solved);
        }
        let mut gradient = vec![[0.0; 3]; n];
        let mut step = vec![[0.0; 3]; n];
        let mut trial = positions.to_vec();
        let mut damping = 0.0;
        while solved.iterations < stop.iterations && g > noise {
            control::check()?;
            let at = Linearisation::new(stencils, encoding, positions);
            let blocks = blocks(stencils, encoding, &at, positions);
            apply_transpose(stencils, &blocks, &residual, held, &mut gradient);
            let stretched = springs.map_or(Vec::new(), |s| s.linearise(stencils, positions));
            add_gradient(stencils, &stretched, held, &mut gradient);
            let mut improved = None;
            while improved.is_none() && damping < 1e6 {
                let solvable = match method {
                    Method::Direct => {
                        if self.direct.is_none() {
                            self.direct = Some(DirectSolver::new(stencils, held)?);
                        }
                        step[held..].copy_from_slice(&gradient[held..]);
                        self.direct.as_mut().is_some_and(|d| d.solve(&blocks, &stretched, damping, &mut step[held..]))
                    }
                    Method::Gradients(steps) => {
                        // A few steps need no more than single precision; many would stall in it.
                        solved.gradient_steps += if steps <= SINGLE {
                            self.single.solve(stencils, &blocks, &stretched, held, &gradient, steps, 1e-4, &mut step)
                        } else {
                            self.double.solve(stencils, &blocks, &stretched, held, &gradient, steps, 1e-6, &mut step)
                        };
                        true
                    }
                };
                let mut alpha = if solvable { 1.0 } else { 0.0 };
                while alpha >= LEAST_STEP {
                    for v in held..n {
                        trial[v] = add_scaled(positions[v], step[v], -alpha);
                    }
                    let new = value(&trial, &mut residual);
                    if new < g {
                        improved = Some(new);
                        break;
                    }
                    alpha *= 0.5;
                }
                if improved.is_some() {
                    damping = if damping < 1e-8 { 0.0 } else { damping * 0.1 };
                } else if method == Method::Direct {
                    damping = if damping == 0.0 { 1e-6 } else { damping * 100.0 };
                } else {
                    break;
                }
            }
            let Some(new) = improved else {
                // No direction goes down: this is the minimum as far as rounding lets one see.
                solved.converged = true;
                break;
            };
            solved.iterations += 1;
            positions[held..].copy_from_slice(&trial[held..]);
            let decrease = (g - new) / g;
            g = new;
            if decrease < stop.decrease {
                solved.converged = true;
                break;
            }
        }
        solved.converged |= g <= noise;
        solved.after = g;
        Ok(solved)
    }
}
