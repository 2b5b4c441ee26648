//! Host half of the kernel `split_level`: vertices from their rings, level after level, for one
//! shape or many at once.

use std::ops::Range;
use std::sync::Arc;

use super::WORK;
use super::tables::{EncodingParams, PARAMS, RingTables};
use crate::encoding::Hierarchy;
use crate::engine::{BindGroup, BindingKind, Buffer, GROUP, Gpu, Kernel, Pipeline, UniformBlocks};
use crate::error::{Error, Result};

pub(super) static SPLIT_LEVEL: Kernel = variant(&[("NARROW", 0.0)]);
static SPLIT_LEVEL_NARROW: Kernel = variant(&[("NARROW", 1.0)]);

const fn variant(constants: &'static [(&'static str, f64)]) -> Kernel {
    Kernel {
        name: "split_level",
        source: include_str!("../../../shaders/split_level.wgsl"),
        bindings: &[
            BindingKind::Uniform(size_of::<EncodingParams>() as u64),
            BindingKind::Table,
            BindingKind::Table,
            BindingKind::Read,
            BindingKind::Write,
        ],
        layouts: &[PARAMS],
        items: 1,
        constants,
    }
}

/// Vertices of a level, over all shapes, up to which one workgroup a shape takes it: below, a
/// dispatch costs more than what it does.
const NARROW: usize = 4 * GROUP as usize;

/// Dispatches of one submission: a bind group has room for so many different ones.
const DISPATCHES: usize = 14;

/// The splits of a hierarchy on a device, with room for `frames` shapes.
#[derive(Debug)]
pub struct SplitLevels {
    wide: (Arc<Pipeline>, BindGroup),
    narrow: (Arc<Pipeline>, BindGroup),
    positions: Buffer<[f32; 4]>,
    level_start: Vec<u32>,
    frames: usize,
    vertices: usize,
    base: usize,
    longest: usize,
    _tables: RingTables,
    _levels: Buffer<u32>,
    _params: UniformBlocks<EncodingParams>,
}

impl SplitLevels {
    /// Uploads the splits of `hierarchy`, for `frames` shapes at once.
    ///
    /// # Errors
    /// [`Error::Capability`] or [`Error::Memory`] if the device cannot hold them, [`Error::Device`]
    /// if it fails.
    pub fn new(gpu: &Gpu, hierarchy: &Hierarchy, frames: usize) -> Result<Self> {
        let vertices = hierarchy.order.len();
        let rows = hierarchy.splits.row_count();
        let tables = RingTables::new(gpu, &hierarchy.splits, &hierarchy.split_encoding)?;
        let items = rows.max(vertices) as u64 * frames as u64;
        if u32::try_from(items).is_err() || frames as u64 > u64::from(gpu.capabilities().max_groups) {
            let limit = "splits of all shapes together".into();
            return Err(Error::Capability { limit, required: items, actual: u64::from(u32::MAX) });
        }
        gpu.capabilities().check_loops(SPLIT_LEVEL.name, 2 * tables.longest as u64 + 1)?;
        let positions = gpu.buffer("positions", vertices * frames)?;
        let levels = gpu.upload("levels", &hierarchy.level_start)?;
        let params = gpu.uniform(
            "splits",
            &EncodingParams {
                frames: frames as u32,
                vertices: vertices as u32,
                rows: rows as u32,
                base: hierarchy.base as u32,
            },
        )?;
        let bound = |kernel| -> Result<(Arc<Pipeline>, BindGroup)> {
            let pipeline = gpu.pipeline(kernel)?;
            let bindings = [params.bind(0), tables.rows.bind(), tables.slots.bind(), levels.bind(), positions.bind()];
            let group = gpu.bind(&pipeline, &bindings)?;
            Ok((pipeline, group))
        };
        Ok(Self {
            wide: bound(&SPLIT_LEVEL)?,
            narrow: bound(&SPLIT_LEVEL_NARROW)?,
            level_start: hierarchy.level_start.clone(),
            longest: tables.longest,
            base: hierarchy.base,
            positions,
            frames,
            vertices,
            _tables: tables,
            _levels: levels,
            _params: params,
        })
    }

    /// Sets the vertices of `levels` of every shape from those before them. Vertex v of shape f
    /// stands at `f * vertices + v`.
    ///
    /// # Errors
    /// [`Error::Device`] if the device fails or the number of positions is not that of the shapes.
    pub fn place(&self, gpu: &Gpu, levels: Range<usize>, positions: &mut [[f32; 4]]) -> Result<()> {
        if positions.len() != self.positions.len() || levels.end >= self.level_start.len().max(1) {
            return Err(super::fault("splits of another hierarchy"));
        }
        if levels.is_empty() || positions.is_empty() {
            return Ok(());
        }
        let known = self.base + self.level_start[levels.start] as usize;
        let end = self.base + self.level_start[levels.end] as usize;
        for frame in 0..self.frames {
            let at = frame * self.vertices;
            gpu.write(&self.positions, at, &positions[at..at + known])?;
        }
        self.submit(gpu, levels)?;
        if self.frames == 1 {
            positions[known..end].copy_from_slice(&gpu.read(&self.positions, known..end)?);
        } else {
            // Held positions come back as they went.
            positions.copy_from_slice(&gpu.read(&self.positions, 0..positions.len())?);
        }
        Ok(())
    }

    fn submit(&self, gpu: &Gpu, levels: Range<usize>) -> Result<()> {
        let mut batch = gpu.batch()?;
        let (mut work, mut dispatches) = (0, 0);
        let mut pending = None;
        for step in self.steps(gpu, levels) {
            if dispatches == DISPATCHES || (dispatches > 0 && work + step.work > WORK) {
                let submitted = std::mem::replace(&mut batch, gpu.batch()?).submit()?;
                // Two are under way at a time, so that the device does not idle and none waits for
                // long.
                if let Some(before) = pending.replace(submitted) {
                    gpu.wait(&before)?;
                }
                (work, dispatches) = (0, 0);
            }
            let Range { start, end } = step.items;
            if step.narrow {
                batch.dispatch_each_group(&self.narrow.0, &self.narrow.1, start, end, self.frames as u32)?;
            } else {
                batch.dispatch_range(&self.wide.0, &self.wide.1, start, end - start)?;
            }
            work += step.work;
            dispatches += 1;
        }
        batch.submit()?;
        Ok(())
    }

    /// The dispatches of some levels.
    fn steps(&self, gpu: &Gpu, levels: Range<usize>) -> Vec<Dispatch> {
        let visits = 2 * self.longest as u64 + 1;
        let mut steps: Vec<Dispatch> = Vec::new();
        let mut loops = 0;
        for level in levels {
            let rows = self.level_start[level] as usize..self.level_start[level + 1] as usize;
            if rows.len() * self.frames <= NARROW {
                let own = 1 + rows.len().div_ceil(GROUP as usize) as u64 * visits;
                let work = rows.len() as u64 * self.frames as u64 * visits;
                match steps.last_mut() {
                    Some(last) if last.narrow && loops + own <= u64::from(gpu.capabilities().loop_budget) => {
                        last.items.end += 1;
                        last.work += work;
                        loops += own;
                    }
                    _ => {
                        steps.push(Dispatch { narrow: true, items: level as u32..level as u32 + 1, work });
                        loops = own;
                    }
                }
                continue;
            }
            let most = (WORK / visits).max(1) as usize;
            let all = rows.start * self.frames..rows.end * self.frames;
            for first in all.clone().step_by(most) {
                let items = first as u32..all.end.min(first + most) as u32;
                let work = items.len() as u64 * visits;
                steps.push(Dispatch { narrow: false, items, work });
            }
        }
        steps
    }
}

/// One dispatch: levels for one workgroup a shape, or rows times shapes.
#[derive(Debug)]
struct Dispatch {
    narrow: bool,
    items: Range<u32>,
    work: u64,
}
