//! Animation: a mesh set in motion by markers or joints (mean-value encoding, section 4.2).
//!
//! Clip → [`Binding`] (which point moves which vertex) → [`close_gaps`] → [`Binding::trajectories`] → [`crate::tools::deform::Deformer`], frame by frame,
//! each begun from the one before.

pub mod binding;
pub mod frames;
pub mod gaps;
pub mod guess;

use glam::{DQuat, DVec3, Vec3};

use crate::encoding::{HierarchyOptions, Quality, Similarity};
use crate::error::Result;
use crate::geometry::Mesh;
use crate::io::Cache;
use crate::io::motion::Motion;
use crate::progress::Progress;
use crate::tools::deform::{Deformation, Deformer, Handles};

pub use binding::{Binding, Bond, Reference, fullest_frame};
pub use gaps::{GapOptions, GapReport, Interpolation, close_gaps};
pub use guess::guess;

/// How a clip is played on a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AnimateOptions {
    /// How far each frame's minimisation goes.
    pub quality: Quality,
    /// How gaps are closed.
    pub gaps: GapOptions,
    /// Every so manieth frame is made, at least 1. Gaps are closed in all.
    pub step: usize,
}

impl Default for AnimateOptions {
    fn default() -> Self {
        Self { quality: Quality::DEFAULT, gaps: GapOptions::default(), step: 1 }
    }
}

/// What was done.
#[derive(Clone, Debug, Default)]
pub struct AnimateReport {
    /// Markers with gaps.
    pub gaps: Vec<GapReport>,
    /// Gauss-Newton iterations of each frame.
    pub iterations: Vec<usize>,
    /// What is odd but no error.
    pub warnings: Vec<String>,
}

/// Plays `motion`, a part of the clip `bound` that `binding` was made with, on `mesh`; `frame` receives the frames in order and may end the work with an error.
///
/// The first frame begins from the mesh at rest, each later one from the one before; equal positions of the markers give equal shapes, bit for bit.
///
/// # Errors
/// As [`close_gaps`], [`Binding::trajectories`] and [`Deformer`]; what `frame` returns.
#[expect(clippy::too_many_arguments, reason = "a clip and its part, a mesh, how they are bound, and where results go")]
pub fn animate(
    mesh: &Mesh,
    bound: &Motion,
    motion: &Motion,
    binding: &Binding,
    options: &AnimateOptions,
    cache: &Cache,
    progress: &dyn Progress,
    mut frame: impl FnMut(usize, Deformation) -> Result<()>,
) -> Result<AnimateReport> {
    let (tracks, gaps) = close_gaps(motion, &binding.points(), &options.gaps)?;
    let targets = binding.trajectories(bound, motion, mesh, &tracks)?;
    let targets: Vec<Vec<DVec3>> = targets.into_iter().step_by(options.step.max(1)).collect();
    let handles = Handles { vertices: binding.bonds.iter().map(|b| b.vertex).collect(), region: None };
    let mut deformer = Deformer::new(mesh, handles, &HierarchyOptions::default(), cache)?;
    let warnings = binding.warnings.iter().chain(&deformer.warnings).cloned().collect();
    let mut report = AnimateReport { gaps, iterations: Vec::with_capacity(targets.len()), warnings };
    progress.stage("frames", targets.len() as u64);
    for (f, positions) in targets.iter().enumerate() {
        let shape = deformer.deform(positions, &options.quality, f > 0)?;
        report.iterations.push(shape.report.iterations());
        frame(f, shape)?;
        progress.advance(1);
    }
    Ok(report)
}

/// Splits a frame into the rigid motion nearest to it, from the mesh at rest, and the shape that it moves: `frame = rotation shape + shift`.
///
/// For files that store the two apart: what a rigid motion explains need not be told by shapes.
pub fn without_rigid_motion(mesh: &Mesh, frame: &[DVec3]) -> (Vec<Vec3>, (DQuat, DVec3)) {
    let pairs: Vec<(DVec3, DVec3)> = mesh.positions.iter().zip(frame).map(|(a, b)| (*a, *b)).collect();
    let rotation = DQuat::from_mat3(&Similarity::fit(&pairs).rotation).normalize();
    let n = pairs.len().max(1) as f64;
    let (a, b) = pairs.iter().fold((DVec3::ZERO, DVec3::ZERO), |m, p| (m.0 + p.0 / n, m.1 + p.1 / n));
    let shift = b - rotation * a;
    let back = rotation.inverse();
    (frame.iter().map(|p| (back * (*p - shift)).as_vec3()).collect(), (rotation, shift))
}

#[cfg(test)]
mod tests;
