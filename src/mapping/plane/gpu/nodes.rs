//! Fixed points and their images under a map that changes, in buffers of a device: what a frame of
//! dragging needs.

use std::sync::Arc;

use glam::DVec2;

use super::map_points::{MAP_POINTS_ALONE, VertexRecord, records};
use super::tables::{StepTables, fits, size_class};
use crate::engine::{Batch, BindGroup, Buffer, Engine, Gpu, Pipeline, Table};
use crate::error::Result;
use crate::mapping::plane::step::Step;
use crate::mapping::plane::{CompositeMap, Frame};

/// Points and their images. A new map goes up as the tables of its steps, some tens of bytes a
/// vertex and step; the kernel `map_points` takes the points through it. Maps that the kernel does
/// not do are evaluated on the host, and images go up.
#[derive(Debug)]
pub(crate) struct MappedNodes {
    points: Vec<DVec2>,
    /// The frame that `local` is in.
    frame: Frame,
    local: Buffer<[f32; 2]>,
    /// Each step writes the one that the step before has not written.
    turns: [Buffer<[f32; 2]>; 2],
    /// Bound where derivatives would be.
    none: [Buffer<[[f32; 2]; 2]>; 2],
    stages: Vec<Stage>,
}

/// One step, bound to read one buffer and write the other.
#[derive(Debug)]
struct Stage {
    pipeline: Arc<Pipeline>,
    group: BindGroup,
    tables: StepTables,
    limits: Table,
    vertices: usize,
    loops: usize,
}

/// Where the images of a map are: in [`MappedNodes::images`] `turn`, in the local coordinates of
/// `frame`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Mapping {
    /// Which of the two buffers.
    pub(crate) turn: usize,
    /// The frame of the images.
    pub(crate) frame: Frame,
}

impl MappedNodes {
    /// Places for `points`, whose images [`MappedNodes::record`] makes; `map` gives the first
    /// frame.
    ///
    /// # Errors
    /// [`Error::Device`](crate::Error::Device), [`Error::Memory`](crate::Error::Memory),
    /// [`Error::Capability`](crate::Error::Capability).
    pub(crate) fn new(gpu: &Gpu, points: Vec<DVec2>, map: &CompositeMap) -> Result<Self> {
        let frame = map.frame(0);
        let buffer = || gpu.buffer("images of nodes", points.len());
        Ok(Self {
            local: gpu.upload("nodes", &local(&points, &frame))?,
            turns: [buffer()?, buffer()?],
            none: [gpu.buffer("no derivatives", 0)?, gpu.buffer("no derivatives", 0)?],
            stages: Vec::new(),
            frame,
            points,
        })
    }

    /// The images of the last map, of which [`Mapping::turn`] says where they are.
    pub(crate) fn images(&self, turn: usize) -> &Buffer<[f32; 2]> {
        &self.turns[turn & 1]
    }

    /// Adds the dispatches that take the points through `map`, and writes what they read. Nothing
    /// is allocated while maps have no more steps than one before, and as many vertices and loops.
    ///
    /// # Errors
    /// [`Error::Device`](crate::Error::Device) if the device fails.
    pub(crate) fn record(
        &mut self,
        engine: &Engine,
        gpu: &Gpu,
        batch: &mut Batch<'_>,
        map: &CompositeMap,
    ) -> Result<Mapping> {
        let (steps, last) = (map.single_steps(), map.frame(map.step_count()));
        if engine.gpu_for(MAP_POINTS_ALONE[0].name).is_none() || !steps.iter().all(fits) {
            let host = Engine::cpu();
            let images = map.images_of_points(&host, &self.points)?;
            gpu.write(&self.turns[0], 0, &local(&images, &last))?;
            return Ok(Mapping { turn: 0, frame: last });
        }
        let first = map.frame(0);
        if first != self.frame {
            gpu.write(&self.local, 0, &local(&self.points, &first))?;
            self.frame = first;
        }
        for (k, step) in steps.iter().enumerate() {
            match self.stages.get(k).filter(|s| s.takes(step)) {
                Some(stage) => stage.write(gpu, step)?,
                None => {
                    let from = if k == 0 { &self.local } else { &self.turns[(k - 1) % 2] };
                    let stage = Stage::new(gpu, step, [from, &self.turns[k % 2]], &self.none)?;
                    self.stages.truncate(k);
                    self.stages.push(stage);
                }
            }
            let stage = &self.stages[k];
            batch.dispatch(&stage.pipeline, &stage.group, self.points.len())?;
        }
        Ok(Mapping { turn: (steps.len() + 1) % 2, frame: last })
    }
}

impl Stage {
    fn new(
        gpu: &Gpu,
        step: &Step<f32>,
        [from, to]: [&Buffer<[f32; 2]>; 2],
        none: &[Buffer<[[f32; 2]; 2]>; 2],
    ) -> Result<Self> {
        let pipeline = gpu.pipeline(&MAP_POINTS_ALONE[size_class(step.outline.len())])?;
        let limits = gpu.table::<VertexRecord>("vertex limits", &records(step, &[]))?;
        let tables = StepTables::new(gpu, step, None, false)?;
        let bindings: Vec<_> = tables
            .bindings()
            .into_iter()
            .chain([limits.bind(), from.bind(), to.bind(), none[0].bind(), none[1].bind()])
            .collect();
        let group = gpu.bind(&pipeline, &bindings)?;
        let (vertices, loops) = (step.outline.len(), step.outline.loops.len());
        Ok(Self { pipeline, group, tables, limits, vertices, loops })
    }

    /// Whether the tables have the right size for a step.
    fn takes(&self, step: &Step<f32>) -> bool {
        (self.vertices, self.loops) == (step.outline.len(), step.outline.loops.len())
    }

    fn write(&self, gpu: &Gpu, step: &Step<f32>) -> Result<()> {
        self.tables.write(gpu, step)?;
        gpu.write_table(&self.limits, 0, &records(step, &[]))
    }
}

fn local(points: &[DVec2], frame: &Frame) -> Vec<[f32; 2]> {
    points.iter().map(|p| frame.local(*p)).collect()
}
