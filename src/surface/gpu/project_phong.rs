//! Host half of the kernels `project_phong` and `search_phong`: the forward problem.

use bytemuck::{Pod, Zeroable};

use super::average_anchors::VECTORS;
use super::tables::SurfaceTables;
use crate::engine::{BindingKind, Capabilities, Kernel, Layout};
use crate::error::Result;
use crate::kernel_layout as layout;
use crate::surface::project::SearchLimits;
use crate::surface::psi::NEWTON_STEPS;

/// Parameters of both kernels; twin of the struct in `shaders/lib/projection.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct ProjectParams {
    stride: u32,
    point: u32,
    reference: u32,
    vertex_steps: u32,
    triangle_steps: u32,
    unused0: u32,
    unused1: u32,
    unused2: u32,
}

/// What is known of the projection of a point; twin of the struct in `shaders/lib/projection.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Projected {
    /// The triangle.
    pub face: u32,
    /// Barycentric coordinate of corner 0.
    pub b0: f32,
    /// Barycentric coordinate of corner 1.
    pub b1: f32,
    /// Squared distance of the projection from the reference point.
    pub distance_squared: f32,
    /// In the two lowest bits a [`Found`](crate::surface::project::Found) as a number, or [`Projected::LEFT`].
    pub found: u32,
}

impl Projected {
    /// Left to the next pass; the higher bits then say what it needs.
    pub const LEFT: u32 = 3;
    /// The bits of `found` that tell how.
    pub const HOW: u32 = 3;
    /// The word of an entry that holds `found`.
    pub(super) const FOUND_WORD: u32 = 4;
}

const LAYOUTS: &[Layout] = &[
    layout!(ProjectParams, {
        stride, point, reference, vertex_steps, triangle_steps, unused0, unused1, unused2
    }),
    layout!(Projected, { face, b0, b1, distance_squared, found }),
];
const PARAMS: BindingKind = BindingKind::Uniform(size_of::<ProjectParams>() as u64);

pub(super) static PROJECT_PHONG: Kernel = Kernel {
    name: "project_phong",
    source: include_str!("../../../shaders/project_phong.wgsl"),
    bindings: &[
        PARAMS,
        BindingKind::Read,
        BindingKind::Read,
        BindingKind::Write,
        BindingKind::Table,
        BindingKind::Table,
        BindingKind::Table,
        BindingKind::Table,
    ],
    layouts: LAYOUTS,
    items: 1,
    constants: &[],
};

pub(super) static SEARCH_PHONG: Kernel = Kernel {
    name: "search_phong",
    source: include_str!("../../../shaders/search_phong.wgsl"),
    bindings: &[
        PARAMS,
        BindingKind::Read,
        BindingKind::Read,
        BindingKind::Write,
        BindingKind::Table,
        BindingKind::Table,
        BindingKind::Table,
        BindingKind::Table,
    ],
    layouts: LAYOUTS,
    items: 1,
    constants: &[],
};

impl ProjectParams {
    /// The forward problem: the average onto the source, measured from the average.
    pub(super) fn forward(capabilities: &Capabilities, source: &SurfaceTables) -> Result<Self> {
        Self::new(capabilities, source, 0, 0)
    }

    /// The round trip: the average of the target's own anchors back onto the target, measured from the point itself.
    pub(super) fn back(capabilities: &Capabilities, target: &SurfaceTables) -> Result<Self> {
        Self::new(capabilities, target, 1, 2)
    }

    fn new(c: &Capabilities, surface: &SurfaceTables, point: u32, reference: u32) -> Result<Self> {
        let limits = SearchLimits::FIRST;
        // Two walks over triangles, and the choice among three start vertices.
        let newton = 2 * u64::from(limits.triangle_steps) * (NEWTON_STEPS as u64 + 1) + 5;
        // Half the budget for the walk over vertices; what it does not bring to an end goes through the reference.
        let most = u64::from(surface.most_stops) + 1;
        let vertex_steps = (u64::from(c.loop_budget) / 2 / most).min(u64::from(limits.vertex_steps));
        c.check_loops("project_phong", newton + vertex_steps * most)?;
        c.check_loops("search_phong", u64::from(surface.most_near) * (NEWTON_STEPS as u64 + 1))?;
        Ok(Self {
            stride: 2 * VECTORS as u32,
            point: 2 * point,
            reference: 2 * reference,
            vertex_steps: vertex_steps as u32,
            triangle_steps: limits.triangle_steps,
            unused0: 0,
            unused1: 0,
            unused2: 0,
        })
    }
}
