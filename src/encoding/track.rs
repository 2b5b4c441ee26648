//! One stage followed from frame to frame: a Gauss-Newton step that knows where the held vertices
//! go, and a check.

use glam::DVec3;

use super::decode::{encoding_residual, energy};
use super::derivative::{Linearisation, blocks};
use super::direct::DirectSolver;
use super::gradients::{apply, apply_transpose};
use super::hierarchy::Stage;
use super::springs::{Springs, Stretch, add_gradient, add_product};
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

    /// Moves the held vertices of `positions` to `held`, and the free ones to where the minimum of
    /// G goes with them.
    ///
    /// What a similarity explains moves everything. The rest is one linear system about the pose as
    /// it was, whose rings are smooth: a start with the held vertices moved alone has crushed rings
    /// around them, from which Gauss-Newton does not come back. A second step with the same factors
    /// takes what is left of second order.
    pub(super) fn step(
        &mut self,
        stage: &Stage,
        springs: Option<&Springs>,
        held: &[V3<f64>],
        positions: &mut [V3<f64>],
    ) -> Result<Tracked> {
        let (n, first) = (positions.len(), held.len());
        let pairs: Vec<(DVec3, DVec3)> =
            positions.iter().zip(held).map(|(a, b)| (DVec3::from(*a), DVec3::from(*b))).collect();
        let fit = Similarity::fit(&pairs);
        positions.iter_mut().for_each(|p| *p = fit.apply(DVec3::from(*p)).to_array());
        let mut moved = vec![[0.0; 3]; n];
        for ((m, to), from) in moved.iter_mut().zip(held).zip(&*positions) {
            *m = sub(*to, *from);
        }
        let system = System::new(stage, springs, positions);
        if !DAMPINGS.iter().any(|&damping| self.solver.factor(&system.blocks, &system.springs, damping)) {
            let what = "the system of a frame has no inverse";
            return Err(Error::numeric(what, "Bind more vertices, spread over the mesh"));
        }
        let mut change = vec![[0.0; 3]; system.residual.len()];
        apply(&stage.stencils, &system.blocks, &moved, &mut change);
        let residual: Vec<V3<f64>> =
            system.residual.iter().zip(&change).map(|(r, c)| add_scaled(*r, *c, 1.0)).collect();
        let mut gradient = system.gradient(stage, first, &residual);
        add_product(&stage.stencils, &system.springs, first, &moved, &mut gradient);
        self.solver.apply(&mut gradient[first..]);
        positions[..first].copy_from_slice(held);
        positions[first..].iter_mut().zip(&gradient[first..]).for_each(|(p, s)| *p = sub(*p, *s));

        let system = System::new(stage, springs, positions);
        let mut gradient = system.gradient(stage, first, &system.residual);
        self.solver.apply(&mut gradient[first..]);
        let trial: Vec<V3<f64>> =
            (0..n).map(|v| if v < first { held[v] } else { sub(positions[v], gradient[v]) }).collect();
        let (before, after) = (system.value, value(stage, springs, &trial).0);
        if !(after < before) {
            return Ok(Tracked { value: before, decrease: 0.0 });
        }
        positions.copy_from_slice(&trial);
        Ok(Tracked { value: after, decrease: 1.0 - after / before })
    }
}

/// G with that of the springs, and the residuals V - F.
fn value(stage: &Stage, springs: Option<&Springs>, positions: &[V3<f64>]) -> (f64, Vec<V3<f64>>) {
    let mut residual = vec![[0.0; 3]; stage.stencils.row_count()];
    encoding_residual(&stage.stencils, &stage.encoding, positions, &mut residual);
    (energy(&residual) + springs.map_or(0.0, |s| s.energy(&stage.stencils, positions)), residual)
}

/// Everything of first order about a pose.
struct System {
    value: f64,
    residual: Vec<V3<f64>>,
    blocks: Vec<[f64; 9]>,
    springs: Vec<Stretch>,
}

impl System {
    fn new(stage: &Stage, springs: Option<&Springs>, positions: &[V3<f64>]) -> Self {
        let (value, residual) = value(stage, springs, positions);
        let at = Linearisation::new(&stage.stencils, &stage.encoding, positions);
        let blocks = blocks(&stage.stencils, &stage.encoding, &at, positions);
        let springs = springs.map_or(Vec::new(), |s| s.linearise(&stage.stencils, positions));
        Self { value, residual, blocks, springs }
    }

    /// The gradient for the vertices from `held` on, with the residuals given.
    fn gradient(&self, stage: &Stage, held: usize, residual: &[V3<f64>]) -> Vec<V3<f64>> {
        let mut gradient = vec![[0.0; 3]; stage.vertices];
        apply_transpose(&stage.stencils, &self.blocks, residual, held, &mut gradient);
        add_gradient(&stage.stencils, &self.springs, held, &mut gradient);
        gradient
    }
}
