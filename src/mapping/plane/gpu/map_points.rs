//! Host half of the kernel `map_points`.

use super::SUBMISSION;
use super::tables::{PARAMS, PARAMS_LAYOUT, StepTables, VECTORS, size_class};
use crate::engine::{BindGroup, BindingKind, Buffer, Gpu, Kernel, Layout, Pipeline, ReadbackRing, Table};
use crate::error::Result;
use crate::mapping::plane::step::Step;

const LAYOUTS: &[Layout] = &[PARAMS_LAYOUT];

/// With derivatives, by [`size_class`].
pub(super) static MAP_POINTS: [Kernel; 3] = [
    variant(&[("DERIVATIVE", 1.0), ("MANY", 0.0), ("BLOCKED", 0.0)]),
    variant(&[("DERIVATIVE", 1.0), ("MANY", 0.0), ("BLOCKED", 1.0)]),
    variant(&[("DERIVATIVE", 1.0), ("MANY", 1.0), ("BLOCKED", 1.0)]),
];
pub(super) static MAP_POINTS_ALONE: [Kernel; 3] = [
    variant(&[("DERIVATIVE", 0.0), ("MANY", 0.0), ("BLOCKED", 0.0)]),
    variant(&[("DERIVATIVE", 0.0), ("MANY", 0.0), ("BLOCKED", 1.0)]),
    variant(&[("DERIVATIVE", 0.0), ("MANY", 1.0), ("BLOCKED", 1.0)]),
];

const fn variant(constants: &'static [(&'static str, f64)]) -> Kernel {
    Kernel {
        name: "map_points",
        source: include_str!("../../../../shaders/map_points.wgsl"),
        bindings: &[
            PARAMS,
            VECTORS,
            VECTORS,
            VECTORS,
            VECTORS,
            VECTORS,
            BindingKind::Table,
            BindingKind::Read,
            BindingKind::Write,
            BindingKind::Read,
            BindingKind::Write,
        ],
        layouts: LAYOUTS,
        items: 4,
        constants,
    }
}

/// Points of a tile at most: 12 MiB on the device.
const MOST_POINTS: usize = 1 << 18;
/// Points of a tile at least, below which a dispatch costs more than it does.
const LEAST_POINTS: usize = 1 << 12;

/// What the kernel reads about a vertex: its image, and the derivative along its bisector.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct VertexRecord {
    image: [f32; 2],
    unused: [f32; 2],
    derivative: [[f32; 2]; 2],
}

/// One step, bound to read one pair of buffers and write the other.
struct Stage {
    pipeline: std::sync::Arc<Pipeline>,
    group: BindGroup,
    work: u64,
    _tables: StepTables,
    _limits: Table,
}

/// Points and derivatives of a tile.
struct Tile {
    points: Buffer<[f32; 2]>,
    derivatives: Buffer<[[f32; 2]; 2]>,
}

/// Takes `points` through `steps`; with `derivatives`, of the same length, sets them to those of
/// the whole map.
///
/// # Errors
/// [`Error::Device`](crate::Error::Device), [`Error::Memory`](crate::Error::Memory).
pub(in crate::mapping::plane) fn map_on_device(
    gpu: &Gpu,
    steps: &[Step<f32>],
    points: &mut [[f32; 2]],
    mut derivatives: Option<&mut [[[f32; 2]; 2]]>,
) -> Result<()> {
    if points.is_empty() || steps.is_empty() {
        return Ok(());
    }
    let work: u64 = steps.iter().map(|s| s.outline.len() as u64).sum();
    let room = ((SUBMISSION / work.max(1)) as usize).clamp(LEAST_POINTS, MOST_POINTS);
    let size = room.min(points.len());
    let wanted = derivatives.is_some();
    let tile = || -> Result<Tile> {
        Ok(Tile {
            points: gpu.buffer("points", size)?,
            derivatives: gpu.buffer("derivatives", if wanted { size } else { 0 })?,
        })
    };
    let tiles = [tile()?, tile()?];
    let stages: Vec<Stage> = steps
        .iter()
        .enumerate()
        .map(|(k, step)| stage(gpu, step, &tiles[k % 2], &tiles[(k + 1) % 2], wanted, k > 0))
        .collect::<Result<_>>()?;
    let last = &tiles[steps.len() % 2];
    for first in (0..points.len()).step_by(size) {
        let here = first..points.len().min(first + size);
        gpu.write(&tiles[0].points, 0, &points[here.clone()])?;
        let mut batch = gpu.batch()?;
        let mut work = 0;
        for stage in &stages {
            // A submission holds all steps unless even the smallest tile makes that too long.
            if work > 0 && work + stage.work * here.len() as u64 > SUBMISSION {
                let submitted = std::mem::replace(&mut batch, gpu.batch()?).submit()?;
                gpu.wait(&submitted)?;
                work = 0;
            }
            batch.dispatch(&stage.pipeline, &stage.group, here.len())?;
            work += stage.work * here.len() as u64;
        }
        let mut ring = ReadbackRing::new(gpu, "images", 1, here.len())?;
        ring.push(batch, &last.points, 0..here.len())?;
        points[here.clone()].copy_from_slice(&ring.pop()?.unwrap_or_default());
        if let Some(derivatives) = derivatives.as_deref_mut() {
            derivatives[here.clone()].copy_from_slice(&gpu.read(&last.derivatives, 0..here.len())?);
        }
    }
    Ok(())
}

fn stage(gpu: &Gpu, step: &Step<f32>, from: &Tile, to: &Tile, wanted: bool, chained: bool) -> Result<Stage> {
    let n = step.outline.len();
    let kernels = if wanted { &MAP_POINTS } else { &MAP_POINTS_ALONE };
    let pipeline = gpu.pipeline(&kernels[size_class(n)])?;
    let derivatives = if wanted { step.vertex_derivatives() } else { &[] };
    let limits = gpu.table("vertex limits", &records(step, derivatives))?;
    let tables = StepTables::new(gpu, step, None, chained)?;
    let bindings: Vec<_> = tables
        .bindings()
        .into_iter()
        .chain([limits.bind(), from.points.bind(), to.points.bind(), from.derivatives.bind(), to.derivatives.bind()])
        .collect();
    let group = gpu.bind(&pipeline, &bindings)?;
    Ok(Stage { pipeline, group, work: n as u64, _tables: tables, _limits: limits })
}

/// The records of a step's vertices; derivatives that are not given are zero.
pub(super) fn records(step: &Step<f32>, derivatives: &[[[f32; 2]; 2]]) -> Vec<VertexRecord> {
    let record = |(k, image): (usize, &[f32; 2])| VertexRecord {
        image: *image,
        unused: [0.0; 2],
        derivative: derivatives.get(k).copied().unwrap_or_default(),
    };
    step.outline.images.iter().enumerate().map(record).collect()
}
