//! The correspondence on a device: host halves of the kernels of the main job, in R^8.
//!
//! | kernel | what it does | reference |
//! |---|---|---|
//! | `average_anchors` | inverse problem and average | [`average_fused`](crate::surface::average::average_fused) |
//! | `project_phong` | projection by walks over vertices and triangles | [`PhongSurface::project`](crate::surface::PhongSurface::project) |
//! | `search_phong` | the first level of the search, for what the walks leave | the same |
//!
//! What all three leave, a few points in a thousand, goes through the references.

mod average_anchors;
mod map;
mod project_phong;
mod tables;

pub use average_anchors::{AverageParams, MOST_ANCHORS};
pub use map::DeviceMap;
pub use project_phong::{ProjectParams, Projected};
pub use tables::SurfaceTables;

use crate::engine::Kernel;

/// The kernels of this folder.
pub const KERNELS: &[&Kernel] =
    &[&average_anchors::AVERAGE_ANCHORS, &project_phong::PROJECT_PHONG, &project_phong::SEARCH_PHONG];
