//! What the kernels read about a step.

use crate::engine::{Binding, BindingKind, Gpu, Layout, UNIFORM_BLOCK, UniformBlocks};
use crate::error::Result;
use crate::kernel_layout as layout;
use crate::mapping::space::face::Face;
use crate::mapping::space::step::Step;

/// Blocks of faces that the kernels bind.
const BLOCKS: usize = 4;

/// Faces of a block.
pub(super) const PER_BLOCK: usize = UNIFORM_BLOCK as usize / size_of::<FaceRecord>();

/// Triangles that the kernels take.
pub const MOST_FACES: usize = BLOCKS * PER_BLOCK;

/// Parameters of the kernels; twin of the struct in `shaders/lib/faces.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, bytemuck::Pod, bytemuck::Zeroable)]
pub struct SpaceParams {
    faces: u32,
    points: u32,
    unused0: u32,
    unused1: u32,
}

/// Layout of [`SpaceParams`].
pub(super) const PARAMS_LAYOUT: Layout = layout!(SpaceParams, { faces, points, unused0, unused1 });

/// The binding of the parameters. [`BLOCKS`] blocks of faces follow it, each of them [`FACES`].
pub(super) const PARAMS: BindingKind = BindingKind::Uniform(size_of::<SpaceParams>() as u64);

/// A block of faces.
pub(super) const FACES: BindingKind = BindingKind::Uniform(UNIFORM_BLOCK);

/// A face: corners, normal, directions of the edges with their lengths, displacement of corner 0,
/// rows of its gradient.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
struct FaceRecord {
    corners: [[f32; 4]; 3],
    normal: [f32; 4],
    edges: [[f32; 4]; 3],
    displacement: [f32; 4],
    gradient: [[f32; 4]; 3],
}

fn record(face: &Face<f64>) -> FaceRecord {
    let wide = |v: [f64; 3], w: f64| [v[0] as f32, v[1] as f32, v[2] as f32, w as f32];
    FaceRecord {
        corners: face.corners.map(|v| wide(v, 0.0)),
        normal: wide(face.normal, 0.0),
        edges: std::array::from_fn(|j| wide(face.edges[j], face.lengths[j])),
        displacement: wide(face.displacement, 0.0),
        gradient: face.gradient.map(|v| wide(v, 0.0)),
    }
}

/// Whether the kernels can do a step.
pub(in crate::mapping::space) fn fits(step: &Step<f64>) -> bool {
    (1..=MOST_FACES).contains(&step.faces.len())
}

/// A step on a device.
#[derive(Debug)]
pub(super) struct StepTables {
    params: UniformBlocks<SpaceParams>,
    faces: UniformBlocks<FaceRecord>,
}

impl StepTables {
    /// Uploads a step for so many points.
    pub(super) fn new(gpu: &Gpu, step: &Step<f64>, points: usize) -> Result<Self> {
        let params = SpaceParams { faces: step.faces.len() as u32, points: points as u32, ..SpaceParams::default() };
        let faces: Vec<FaceRecord> = step.faces.iter().map(record).collect();
        Ok(Self { params: gpu.uniform("space parameters", &params)?, faces: gpu.uniform_blocks("faces", &faces)? })
    }

    /// What both kernels bind first.
    pub(super) fn bindings(&self) -> Vec<Binding<'_>> {
        // Blocks past the last repeat it; what kernels read there they do not choose.
        std::iter::once(self.params.bind(0)).chain((0..BLOCKS).map(|i| self.faces.bind(i))).collect()
    }
}
