//! Host half of the kernel `map_points_3d`.

use super::SUBMISSION;
use super::tables::{FACES, PARAMS, PARAMS_LAYOUT, StepTables};
use crate::engine::{BindGroup, BindingKind, Buffer, Gpu, Kernel, Layout};
use crate::error::Result;
use crate::mapping::space::step::Step;

const LAYOUTS: &[Layout] = &[PARAMS_LAYOUT];

pub(super) static MAP_POINTS_3D: Kernel = Kernel {
    name: "map_points_3d",
    source: include_str!("../../../../shaders/map_points_3d.wgsl"),
    bindings: &[PARAMS, FACES, FACES, FACES, FACES, BindingKind::Read, BindingKind::Write],
    layouts: LAYOUTS,
    items: 1,
    constants: &[],
};

/// Points of a tile at most: 4 MiB a buffer.
const MOST_POINTS: usize = 1 << 18;

/// One step, bound to read one buffer and write the other.
struct Stage {
    group: BindGroup,
    faces: u64,
    _tables: StepTables,
}

/// Takes `points` through `steps`, which ping-pong between two buffers.
///
/// # Errors
/// [`Error::Device`](crate::Error::Device), [`Error::Memory`](crate::Error::Memory).
pub(in crate::mapping::space) fn map_on_device(gpu: &Gpu, steps: &[Step<f64>], points: &mut [[f32; 3]]) -> Result<()> {
    if points.is_empty() || steps.is_empty() {
        return Ok(());
    }
    let size = points.len().min(MOST_POINTS);
    let buffers: [Buffer<[f32; 4]>; 2] = [gpu.buffer("points", size)?, gpu.buffer("images", size)?];
    let pipeline = gpu.pipeline(&MAP_POINTS_3D)?;
    let stage = |(k, step): (usize, &Step<f64>)| -> Result<Stage> {
        let tables = StepTables::new(gpu, step, size)?;
        let ends = [buffers[k % 2].bind(), buffers[(k + 1) % 2].bind()];
        let bindings: Vec<_> = tables.bindings().into_iter().chain(ends).collect();
        let group = gpu.bind(&pipeline, &bindings)?;
        Ok(Stage { group, faces: step.faces.len() as u64, _tables: tables })
    };
    let stages: Vec<Stage> = steps.iter().enumerate().map(stage).collect::<Result<_>>()?;
    for tile in points.chunks_mut(size) {
        let padded: Vec<[f32; 4]> = tile.iter().map(|p| [p[0], p[1], p[2], 0.0]).collect();
        gpu.write(&buffers[0], 0, &padded)?;
        let mut batch = gpu.batch()?;
        let mut work = 0;
        for stage in &stages {
            let room = ((SUBMISSION / stage.faces).max(1) as usize).next_multiple_of(64);
            for first in (0..tile.len()).step_by(room) {
                let count = room.min(tile.len() - first);
                batch.dispatch_range(&pipeline, &stage.group, first as u32, count as u32)?;
                work += count as u64 * stage.faces;
                if work >= SUBMISSION {
                    let submitted = std::mem::replace(&mut batch, gpu.batch()?).submit()?;
                    gpu.wait(&submitted)?;
                    work = 0;
                }
            }
        }
        if work > 0 {
            batch.submit()?;
        }
        let images = gpu.read(&buffers[steps.len() % 2], 0..tile.len())?;
        tile.iter_mut().zip(images).for_each(|(p, q)| *p = [q[0], q[1], q[2]]);
    }
    Ok(())
}
