//! One stage followed from frame to frame: a Gauss-Newton step that knows where the held vertices go, and a check.

use glam::DVec3;

use super::decode::{encoding_residual, energy};
use super::derivative::{Linearisation, blocks};
use super::direct::DirectSolver;
use super::gradients::{apply, apply_transpose};
use super::hierarchy::Stage;
use super::springs::{Springs, add_gradient, add_product};
use super::vector::{add_scaled, sub};
use super::{Similarity, V3};
use crate::error::{Error, Result};

/// Dampings tried in turn where a system has no inverse.
const DAMPINGS: [f64; 4] = [0.0, 1e-8, 1e-4, 1e-1];

/// The factorised system of a stage, made anew for each frame on the same pattern.
#[derive(Debug)]
pub(super) struct Tracker {
    solver: DirectSolver,
}

/// How a frame went.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tracked {
    /// G afterwards.
    pub(super) value: f64,
    /// Relative decrease of G that a second step found; small where the first one had arrived.
    pub(super) decrease: f64,
}

impl Tracker {
    pub(super) fn new(stage: &Stage, held: usize) -> Result<Self> {
        Ok(Self { solver: DirectSolver::new(&stage.stencils, held)? })
    }

    /// Moves the held vertices of `positions` to `held`, and the free ones to where the minimum of G goes with them.
    ///
    /// What a similarity explains moves everything. The rest is one linear system about the pose as it was, whose rings are smooth: a start with
    /// the held vertices moved alone has crushed rings around them, from which Gauss-Newton does not come back. A second step with the same
    /// factors takes what is left of second order.
    pub(super) fn step(
        &mut self,
        stage: &Stage,
        springs: Option<&Springs>,
        held: &[V3<f64>],
        positions: &mut [V3<f64>],
    ) -> Result<Tracked> {
        let (stencils, encoding) = (&stage.stencils, &stage.encoding);
        let (n, first) = (positions.len(), held.len());
        let pairs: Vec<(DVec3, DVec3)> =
            positions.iter().zip(held).map(|(a, b)| (DVec3::from(*a), DVec3::from(*b))).collect();
        let fit = Similarity::fit(&pairs);
        positions.iter_mut().for_each(|p| *p = fit.apply(DVec3::from(*p)).to_array());
        let mut moved = vec![[0.0; 3]; n];
        for ((m, to), from) in moved.iter_mut().zip(held).zip(&*positions) {
            *m = sub(*to, *from);
        }
        let mut residual = vec![[0.0; 3]; stencils.row_count()];
        let mut gradient = vec![[0.0; 3]; n];
        for second in [false, true] {
            let value = |positions: &[V3<f64>], residual: &mut [V3<f64>]| {
                encoding_residual(stencils, encoding, positions, residual);
                energy(residual) + springs.map_or(0.0, |s| s.energy(stencils, positions))
            };
            let before = value(positions, &mut residual);
            let at = Linearisation::new(stencils, encoding, positions);
            let matrix = blocks(stencils, encoding, &at, positions);
            let stretched = springs.map_or(Vec::new(), |s| s.linearise(stencils, positions));
            if !second {
                if !DAMPINGS.iter().any(|&damping| self.solver.factor(&matrix, &stretched, damping)) {
                    let what = "the system of a frame has no inverse";
                    return Err(Error::numeric(what, "Bind more vertices, spread over the mesh"));
                }
                let mut change = vec![[0.0; 3]; residual.len()];
                apply(stencils, &matrix, &moved, &mut change);
                residual.iter_mut().zip(&change).for_each(|(r, c)| *r = add_scaled(*r, *c, 1.0));
            }
            apply_transpose(stencils, &matrix, &residual, first, &mut gradient);
            add_gradient(stencils, &stretched, first, &mut gradient);
            if !second {
                add_product(stencils, &stretched, first, &moved, &mut gradient);
            }
            self.solver.apply(&mut gradient[first..]);
            let mut trial = positions.to_vec();
            trial[..first].copy_from_slice(held);
            for v in first..n {
                trial[v] = sub(positions[v], gradient[v]);
            }
            if !second {
                positions.copy_from_slice(&trial);
                continue;
            }
            let after = value(&trial, &mut residual);
            if after < before {
                positions.copy_from_slice(&trial);
                return Ok(Tracked { value: after, decrease: 1.0 - after / before });
            }
            return Ok(Tracked { value: before, decrease: 0.0 });
        }
        unreachable!("the second step returns")
    }
}
