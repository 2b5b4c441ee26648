//! Host half of the kernel `jacobian_min_3d`.

use super::SUBMISSION;
use super::tables::{FACES, PARAMS, PARAMS_LAYOUT, StepTables};
use crate::engine::{BindingKind, Gpu, Kernel, Layout};
use crate::error::Result;
use crate::kernel_layout as layout;
use crate::mapping::space::jacobian_min::{PIECE, PieceMinimum3d};
use crate::mapping::space::step::Step;

const LAYOUTS: &[Layout] = &[PARAMS_LAYOUT, layout!(PieceMinimum3d, { value, index })];

pub(super) static JACOBIAN_MIN_3D: Kernel = Kernel {
    name: "jacobian_min_3d",
    source: include_str!("../../../../shaders/jacobian_min_3d.wgsl"),
    bindings: &[PARAMS, FACES, FACES, FACES, FACES, BindingKind::Read, BindingKind::Write],
    layouts: LAYOUTS,
    items: 1,
    constants: &[],
};

/// Points on the device at once: 16 MiB.
const MOST_POINTS: usize = 1 << 20;

/// The smallest Jacobian inside of every [`PIECE`] of `points`.
///
/// # Errors
/// [`Error::Device`](crate::Error::Device), [`Error::Memory`](crate::Error::Memory).
pub(in crate::mapping::space) fn piece_minima_on_device(
    gpu: &Gpu,
    step: &Step<f64>,
    points: &[[f32; 3]],
) -> Result<Vec<PieceMinimum3d>> {
    let pipeline = gpu.pipeline(&JACOBIAN_MIN_3D)?;
    let per_piece = (2 * step.faces.len() * PIECE) as u64;
    let room = ((SUBMISSION / per_piece).max(1) as usize).next_multiple_of(64);
    let mut all = Vec::with_capacity(points.len().div_ceil(PIECE));
    for part in points.chunks(MOST_POINTS) {
        let padded: Vec<[f32; 4]> = part.iter().map(|p| [p[0], p[1], p[2], 0.0]).collect();
        let pieces = part.len().div_ceil(PIECE);
        let input = gpu.upload("samples", &padded)?;
        let output = gpu.buffer::<PieceMinimum3d>("minima", pieces)?;
        let tables = StepTables::new(gpu, step, part.len())?;
        let bindings: Vec<_> = tables.bindings().into_iter().chain([input.bind(), output.bind()]).collect();
        let group = gpu.bind(&pipeline, &bindings)?;
        for first in (0..pieces).step_by(room) {
            let mut batch = gpu.batch()?;
            batch.dispatch_range(&pipeline, &group, first as u32, room.min(pieces - first) as u32)?;
            let submitted = batch.submit()?;
            gpu.wait(&submitted)?;
        }
        all.extend(gpu.read(&output, 0..pieces)?);
    }
    Ok(all)
}
