//! Animation: a mesh set in motion by markers or joints (mean-value encoding, section 4.2).
//!
//! Clip → [`Binding`] (which point moves which vertex) → [`close_gaps`] → [`Binding::trajectories`]
//! → [`crate::tools::deform::Deformer::play`].

#[doc(hidden)]
pub mod binding;
mod bones;
mod facing;
pub mod frames;
#[doc(hidden)]
pub mod gaps;
pub mod guess;
mod settle;

use glam::{DQuat, DVec3, Vec3};

use crate::encoding::{HierarchyOptions, Quality, SequenceQuality, Similarity};
use crate::error::Result;
use crate::geometry::Mesh;
use crate::io::Cache;
use crate::io::motion::Motion;
use crate::progress::Progress;
use crate::tools::deform::{Deformer, Handles};

#[doc(hidden)]
pub use binding::Bond;
pub use binding::{Binding, Reference, fullest_frame};
pub use gaps::{GapOptions, Interpolation};
#[doc(hidden)]
pub use gaps::{GapReport, close_gaps};
pub use guess::guess;

/// How far the frames are minimised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FrameQuality {
    /// As a sequence: the shape in the large is followed, the rest is made afresh for each frame.
    /// Tens of frames a second.
    Sequence(SequenceQuality),
    /// Each frame by itself, begun from the one before: a few frames a second. The first of a part
    /// begins from the mesh at rest, so that a part is not that of the whole to the last bit.
    Single(Quality),
}

/// How a clip is played on a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AnimateOptions {
    /// How far each frame's minimisation goes.
    pub quality: FrameQuality,
    /// How gaps are closed.
    pub gaps: GapOptions,
    /// Every so manieth frame is made, at least 1. Gaps are closed in all.
    pub step: usize,
    /// The first of these that is made, and the one after the last: a part of the clip.
    pub part: [usize; 2],
}

impl Default for AnimateOptions {
    fn default() -> Self {
        Self {
            quality: FrameQuality::Sequence(SequenceQuality::DEFAULT),
            gaps: GapOptions::default(),
            step: 1,
            part: [0, usize::MAX],
        }
    }
}

/// What was done.
#[derive(Clone, Debug, Default)]
pub struct AnimateReport {
    /// Markers with gaps.
    pub gaps: Vec<GapReport>,
    /// Frames, counted from 0 among those made, to which the one before did not lead: the shape in
    /// the large was found anew, and the mesh may jump there.
    pub found_anew: Vec<usize>,
    /// What is odd but no error.
    pub warnings: Vec<String>,
}

/// Plays `motion`, a part of the clip `bound` that `binding` was made with, on `mesh`; `frame`
/// receives the frames of the part in order, numbered as in the whole, and may end the work with an
/// error.
///
/// The first frame begins from the mesh at rest. Markers that stay where they were give the shape
/// of the frame before, bit for bit.
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
    mut frame: impl FnMut(usize, Vec<DVec3>) -> Result<()>,
) -> Result<AnimateReport> {
    let (tracks, gaps) = close_gaps(motion, &binding.points(), &options.gaps)?;
    let targets = binding.trajectories(bound, motion, mesh, &tracks)?;
    let targets: Vec<Vec<DVec3>> = targets.into_iter().step_by(options.step.max(1)).collect();
    let handles = Handles { vertices: binding.bonds.iter().map(|b| b.vertex).collect(), region: None };
    let mut deformer = Deformer::new(mesh, handles, &HierarchyOptions::default(), cache)?;
    let warnings = binding.warnings.iter().chain(&deformer.warnings).cloned().collect();
    let mut report = AnimateReport { gaps, found_anew: Vec::new(), warnings };
    let [first, end] = options.part;
    let part = first.min(targets.len())..end.min(targets.len());
    progress.stage("frames", part.len() as u64);
    match &options.quality {
        FrameQuality::Sequence(quality) => deformer.play(&targets, part, quality, |f, played| {
            if played.anew {
                report.found_anew.push(f);
            }
            progress.advance(1);
            frame(f, played.positions)
        })?,
        FrameQuality::Single(quality) => {
            for f in part.clone() {
                frame(f, deformer.deform(&targets[f], quality, f > part.start)?.positions)?;
                progress.advance(1);
            }
        }
    }
    Ok(report)
}

/// Splits a frame into the rigid motion nearest to it, from the mesh at rest, and the shape that it
/// moves: `frame = rotation shape + shift`.
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
