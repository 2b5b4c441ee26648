//! Host half of the kernels `project_phong` and `search_phong`: the forward problem.

use bytemuck::{Pod, Zeroable};

use super::tables::SurfaceTables;
use crate::engine::{BindingKind, Capabilities, Kernel, Layout};
use crate::error::Result;
use crate::kernel_layout as layout;
use crate::surface::project::{Found, Projection, SearchLimits};
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
    /// In the two lowest bits a [`Found`](crate::surface::project::Found) as a number, or
    /// [`Projected::LEFT`].
    pub found: u32,
}

impl Projected {
    /// Left to the next pass; the higher bits then say what it needs.
    pub const LEFT: u32 = 3;
    /// The bits of `found` that tell how.
    pub const HOW: u32 = 3;
    /// A point that was found otherwise.
    pub(super) fn of(point: crate::surface::PackedPoint) -> Self {
        Self { face: point.face, b0: point.b0, b1: point.b1, distance_squared: 0.0, found: Found::Search as u32 }
    }

    /// As the references give it; `None` if it was left to them.
    pub(super) fn projection(&self) -> Option<Projection<f32>> {
        let found = match self.found & Self::HOW {
            1 => Found::Walk,
            2 => Found::Search,
            _ => return None,
        };
        let x = [self.b0, self.b1, 1.0 - self.b0 - self.b1];
        Some(Projection { face: self.face, x, distance_squared: self.distance_squared, found })
    }

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

const PROJECT_8: &str = concat!(include_str!("../../../shaders/project_phong.wgsl"), "//#import lib/vector8\n");
const PROJECT_12: &str = concat!(include_str!("../../../shaders/project_phong.wgsl"), "//#import lib/vector12\n");
const SEARCH_8: &str = concat!(include_str!("../../../shaders/search_phong.wgsl"), "//#import lib/vector8\n");
const SEARCH_12: &str = concat!(include_str!("../../../shaders/search_phong.wgsl"), "//#import lib/vector12\n");

pub(super) static PROJECT_PHONG: Kernel = project(PROJECT_8, &OWN_POINTS);
/// The same in R^12.
pub(super) static PROJECT_PHONG_12: Kernel = project(PROJECT_12, &OWN_POINTS);
/// The same of records.
static PROJECT_RECORDS: Kernel = project(PROJECT_8, &RECORDS);
static PROJECT_RECORDS_12: Kernel = project(PROJECT_12, &RECORDS);
pub(super) static SEARCH_PHONG: Kernel = search(SEARCH_8);
/// The same in R^12.
pub(super) static SEARCH_PHONG_12: Kernel = search(SEARCH_12);

/// Points of three words.
const OWN_POINTS: [(&str, f64); 1] = [("RECORDS", 0.0)];
/// Points with places: four words.
const RECORDS: [(&str, f64); 1] = [("RECORDS", 1.0)];

/// The two kernels for surfaces in R^D and the points of an array, or of `records`.
pub(super) fn kernels<const D: usize>(records: bool) -> [&'static Kernel; 2] {
    const { assert!(D == 8 || D == 12) };
    match (D == 8, records) {
        (true, false) => [&PROJECT_PHONG, &SEARCH_PHONG],
        (true, true) => [&PROJECT_RECORDS, &SEARCH_PHONG],
        (false, false) => [&PROJECT_PHONG_12, &SEARCH_PHONG_12],
        (false, true) => [&PROJECT_RECORDS_12, &SEARCH_PHONG_12],
    }
}

const fn project(source: &'static str, constants: &'static [(&'static str, f64)]) -> Kernel {
    Kernel { name: "project_phong", source, bindings: BINDINGS, layouts: LAYOUTS, items: 1, constants }
}

const fn search(source: &'static str) -> Kernel {
    Kernel { name: "search_phong", source, bindings: BINDINGS, layouts: LAYOUTS, items: 1, constants: &[] }
}

const BINDINGS: &[BindingKind] = &[
    PARAMS,
    BindingKind::Read,
    BindingKind::Read,
    BindingKind::Write,
    BindingKind::Table,
    BindingKind::Table,
    BindingKind::Table,
    BindingKind::Table,
];

impl ProjectParams {
    /// The projection of vector `point` of the `vectors` of each entry, in R^D, its distance
    /// measured from vector `reference`.
    pub(super) fn new<const D: usize>(
        c: &Capabilities,
        surface: &SurfaceTables,
        vectors: usize,
        [point, reference]: [u32; 2],
    ) -> Result<Self> {
        let limits = SearchLimits::FIRST;
        // Two walks over triangles, and the choice among three start vertices.
        let newton = 2 * u64::from(limits.triangle_steps) * (NEWTON_STEPS as u64 + 1) + 5;
        // Half the budget for the walk over vertices; what it does not bring to an end goes through
        // the reference.
        let most = u64::from(surface.most_stops) + 1;
        let vertex_steps = (u64::from(c.loop_budget) / 2 / most).min(u64::from(limits.vertex_steps));
        c.check_loops("project_phong", newton + vertex_steps * most)?;
        c.check_loops("search_phong", u64::from(surface.most_near) * (NEWTON_STEPS as u64 + 1))?;
        let texels = (D / 4) as u32;
        Ok(Self {
            stride: texels * vectors as u32,
            point: texels * point,
            reference: texels * reference,
            vertex_steps: vertex_steps as u32,
            triangle_steps: limits.triangle_steps,
            unused0: 0,
            unused1: 0,
            unused2: 0,
        })
    }
}
