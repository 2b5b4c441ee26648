//! What the kernels read about a step.

use crate::engine::{Binding, BindingKind, Gpu, Layout, UNIFORM_BLOCK, UniformBlocks};
use crate::error::Result;
use crate::kernel_layout as layout;
use crate::mapping::plane::samples::Raster;
use crate::mapping::plane::step::{Coordinates, Step};

/// Vertices that the kernels take: four uniform blocks.
pub const MOST_VERTICES: usize = BLOCKS * BLOCK;

/// Loops that the kernels take: one uniform block.
pub const MOST_LOOPS: usize = BLOCK;

/// Vectors of a block.
pub(super) const BLOCK: usize = UNIFORM_BLOCK as usize / 16;

const BLOCKS: usize = 4;

/// Vertices that are added up in one go: more need
/// [`mean_value::BLOCK`](crate::mapping::plane::mean_value::BLOCK) to keep their digits.
const ONE_GO: usize = 64;

/// Which of three variants a kernel needs: all vertices in one go, by blocks, or by blocks from
/// several uniform blocks.
pub(super) fn size_class(vertices: usize) -> usize {
    usize::from(vertices > ONE_GO) + usize::from(vertices > BLOCK)
}

/// Parameters of the kernels; twin of the struct in `shaders/lib/corners.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, bytemuck::Pod, bytemuck::Zeroable)]
pub struct PlaneParams {
    origin: [f32; 2],
    pixel: f32,
    loops: u32,
    chained: u32,
    far: f32,
    unused0: u32,
    unused1: u32,
}

/// Layout of [`PlaneParams`].
pub(super) const PARAMS_LAYOUT: Layout = layout!(PlaneParams, { origin, pixel, loops, chained, far, unused0, unused1 });

/// The binding of the parameters. Loops and [`BLOCKS`] blocks of corners follow it, each of them
/// [`VECTORS`].
pub(super) const PARAMS: BindingKind = BindingKind::Uniform(size_of::<PlaneParams>() as u64);

/// A block of four-vectors.
pub(super) const VECTORS: BindingKind = BindingKind::Uniform(UNIFORM_BLOCK);

/// Whether the kernels can do a step.
pub(in crate::mapping::plane) fn fits<R: crate::engine::Real>(step: &Step<R>) -> bool {
    let loops = &step.outline.loops;
    step.coordinates == Coordinates::MeanValue
        && (1..=MOST_VERTICES).contains(&step.outline.len())
        && loops.len() <= MOST_LOOPS
        && loops.iter().all(|ring| ring.len() > 1)
}

/// A step on a device.
#[derive(Debug)]
pub(super) struct StepTables {
    params: UniformBlocks<PlaneParams>,
    rings: UniformBlocks<[u32; 4]>,
    corners: UniformBlocks<[f32; 4]>,
}

impl StepTables {
    /// Uploads a step; `raster` for samples of it, `chained` if derivatives of earlier steps are to
    /// be multiplied.
    pub(super) fn new(gpu: &Gpu, step: &Step<f32>, raster: Option<&Raster>, chained: bool) -> Result<Self> {
        let (params, rings, corners) = contents(step, raster, chained);
        Ok(Self {
            params: gpu.uniform("plane parameters", &params)?,
            rings: gpu.uniform_blocks("loops", &rings)?,
            corners: gpu.uniform_blocks("corners", &corners)?,
        })
    }

    /// Overwrites the step by another with as many vertices and loops, for points alone.
    pub(super) fn write(&self, gpu: &Gpu, step: &Step<f32>) -> Result<()> {
        let (params, rings, corners) = contents(step, None, false);
        gpu.write_uniform(&self.params, &[params])?;
        gpu.write_uniform(&self.rings, &rings)?;
        gpu.write_uniform(&self.corners, &corners)
    }

    /// What both kernels bind first.
    pub(super) fn bindings(&self) -> Vec<Binding<'_>> {
        // Blocks past the last repeat it; what kernels read there they do not choose.
        let corners = (0..BLOCKS).map(|i| self.corners.bind(i));
        [self.params.bind(0), self.rings.bind(0)].into_iter().chain(corners).collect()
    }
}

/// Parameters, loops and corners of a step.
fn contents(step: &Step<f32>, raster: Option<&Raster>, chained: bool) -> (PlaneParams, Vec<[u32; 4]>, Vec<[f32; 4]>) {
    let outline = &step.outline;
    let params = PlaneParams {
        origin: raster.map_or([0.0; 2], |r| r.origin.map(|x| x as f32)),
        pixel: raster.map_or(0.0, |r| r.pixel as f32),
        loops: outline.loops.len() as u32,
        chained: u32::from(chained),
        far: outline.far,
        ..PlaneParams::default()
    };
    let rings = outline.loops.iter().map(|r| [r.start as u32, r.end as u32, 0, 0]).collect();
    let corners = outline.vertices.iter().zip(&outline.displacements).map(|(v, u)| [v[0], v[1], u[0], u[1]]).collect();
    (params, rings, corners)
}
