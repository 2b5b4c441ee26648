//! Host half of the kernel `jacobian_min`.

use std::ops::Range;

use super::SUBMISSION;
use super::tables::{PARAMS, PARAMS_LAYOUT, StepTables, VECTORS, size_class};
use crate::engine::{BindGroup, BindingKind, Gpu, Kernel, Layout, Pipeline};
use crate::error::Result;
use crate::kernel_layout as layout;
use crate::mapping::plane::jacobian_min::{PIECE, Sample};
use crate::mapping::plane::samples::{Raster, Run};
use crate::mapping::plane::step::Step;

/// The smallest Jacobian of a piece and the pixel it stands at; twin of the struct in
/// `shaders/jacobian_min.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct PieceMinimum {
    value: f32,
    pixel: u32,
}

const LAYOUTS: &[Layout] = &[PARAMS_LAYOUT, layout!(PieceMinimum, { value, pixel })];

/// By [`size_class`].
pub(super) static JACOBIAN_MIN: [Kernel; 3] = [
    variant(&[("MANY", 0.0), ("BLOCKED", 0.0)]),
    variant(&[("MANY", 0.0), ("BLOCKED", 1.0)]),
    variant(&[("MANY", 1.0), ("BLOCKED", 1.0)]),
];

const fn variant(constants: &'static [(&'static str, f64)]) -> Kernel {
    Kernel {
        name: "jacobian_min",
        source: include_str!("../../../../shaders/jacobian_min.wgsl"),
        bindings: &[PARAMS, VECTORS, VECTORS, VECTORS, VECTORS, VECTORS, BindingKind::Read, BindingKind::Write],
        layouts: LAYOUTS,
        items: 1,
        constants,
    }
}

/// Pieces on the device at once: 48 MiB of pieces and minima.
const MOST_PIECES: usize = 1 << 22;

/// A piece as the kernel reads it.
fn packed(run: &Run) -> u32 {
    debug_assert!(run.row < 1 << 14 && run.first + run.count <= 1 << 14 && (1..=PIECE).contains(&run.count));
    run.first | run.row << 14 | (run.count - 1) << 28
}

/// One of the steps of a depth: what it is bound to, and where its pieces are.
struct Job {
    pipeline: std::sync::Arc<Pipeline>,
    group: BindGroup,
    _tables: StepTables,
    pieces: Range<usize>,
    vertices: u64,
}

/// The smallest samples of all pieces of each raster, in order. The steps share submissions as long
/// as they are short.
///
/// # Errors
/// [`Error::Device`](crate::Error::Device), [`Error::Memory`](crate::Error::Memory).
pub(in crate::mapping::plane) fn piece_minima(gpu: &Gpu, steps: &[(Step<f32>, Raster)]) -> Result<Vec<Vec<Sample>>> {
    let cut: Vec<Vec<Run>> = steps.iter().map(|(_, raster)| raster.pieces(PIECE)).collect();
    let mut found = Vec::with_capacity(steps.len());
    let mut first = 0;
    while first < steps.len() {
        // As many steps as fit, at least one.
        let mut total = 0;
        let mut end = first;
        while end < steps.len() && (end == first || total + cut[end].len() <= MOST_PIECES) {
            total += cut[end].len();
            end += 1;
        }
        together(gpu, &steps[first..end], &cut[first..end], &mut found)?;
        first = end;
    }
    Ok(found)
}

fn together(gpu: &Gpu, steps: &[(Step<f32>, Raster)], cut: &[Vec<Run>], found: &mut Vec<Vec<Sample>>) -> Result<()> {
    let pieces: Vec<u32> = cut.iter().flatten().map(packed).collect();
    let input = gpu.upload("pieces", &pieces)?;
    let output = gpu.buffer::<PieceMinimum>("minima", pieces.len())?;
    let mut jobs = Vec::with_capacity(steps.len());
    let mut at = 0;
    for ((step, raster), cut) in steps.iter().zip(cut) {
        let vertices = step.outline.len();
        let pipeline = gpu.pipeline(&JACOBIAN_MIN[size_class(vertices)])?;
        let tables = StepTables::new(gpu, step, Some(raster), false)?;
        let bindings = tables.bindings().into_iter().chain([input.bind(), output.bind()]).collect::<Vec<_>>();
        let group = gpu.bind(&pipeline, &bindings)?;
        let end = at + cut.len();
        jobs.push(Job { pipeline, group, _tables: tables, pieces: at..end, vertices: vertices as u64 });
        at = end;
    }
    submit(gpu, &jobs)?;
    let minima = gpu.read(&output, 0..pieces.len())?;
    for ((_, raster), (cut, job)) in steps.iter().zip(cut.iter().zip(&jobs)) {
        let sample = |(run, m): (&Run, &PieceMinimum)| Sample {
            value: f64::from(m.value),
            at: raster.centre(run.row, run.first + m.pixel.min(run.count - 1)),
        };
        found.push(cut.iter().zip(&minima[job.pieces.clone()]).map(sample).collect());
    }
    Ok(())
}

/// Dispatches all jobs, in submissions of limited work.
fn submit(gpu: &Gpu, jobs: &[Job]) -> Result<()> {
    let mut batch = gpu.batch()?;
    let (mut work, mut dispatches) = (0, 0);
    let mut pending = None;
    for job in jobs {
        let per_piece = job.vertices * u64::from(PIECE);
        let mut first = job.pieces.start;
        while first < job.pieces.end {
            let room = ((SUBMISSION - work) / per_piece).max(1) as usize;
            let count = room.min(job.pieces.end - first);
            batch.dispatch_range(&job.pipeline, &job.group, first as u32, count as u32)?;
            first += count;
            work += count as u64 * per_piece;
            dispatches += 1;
            if work + per_piece > SUBMISSION {
                let submitted = std::mem::replace(&mut batch, gpu.batch()?).submit()?;
                // Two are under way at a time, so that the device does not idle and none waits for
                // long.
                if let Some(before) = pending.replace(submitted) {
                    gpu.wait(&before)?;
                }
                (work, dispatches) = (0, 0);
            }
        }
    }
    if dispatches > 0 {
        batch.submit()?;
    }
    Ok(())
}
