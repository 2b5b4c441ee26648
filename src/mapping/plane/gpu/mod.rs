//! Maps in the plane on a device: host halves of the kernels, for mean value coordinates.
//!
//! | kernel | what it does | reference |
//! |---|---|---|
//! | `map_points` | points, and derivatives, through one step | [`Step`](super::Step) |
//! | `jacobian_min` | the smallest Jacobian over pieces of a raster | [`jacobian_min`](super::jacobian_min()) |
//!
//! Polygons of up to [`MOST_VERTICES`] vertices and [`MOST_LOOPS`] loops fit their uniform blocks;
//! the CPU does larger ones, and Wachspress coordinates.

mod jacobian_min;
mod map_points;
mod nodes;
mod tables;

pub(super) use jacobian_min::piece_minima;
pub(super) use map_points::map_on_device;
pub(crate) use nodes::{MappedNodes, Mapping};
pub(super) use tables::fits;
pub use tables::{MOST_LOOPS, MOST_VERTICES, PlaneParams};

pub use jacobian_min::PieceMinimum;

use crate::engine::Kernel;

/// The kernels of this folder, one variant of each: the others differ in their constants.
pub const KERNELS: &[&Kernel] = &[&jacobian_min::JACOBIAN_MIN[0], &map_points::MAP_POINTS[0]];

/// Products of samples and vertices that one submission holds, so that none is long: a fraction of
/// a second on a software device, milliseconds on another.
const SUBMISSION: u64 = 1 << 28;

/// The constants of the shaders that are these of Rust.
#[cfg(test)]
pub(crate) fn twins() -> Vec<crate::twins::Twin> {
    use crate::mapping::plane::mean_value::{AT_VERTEX, BLOCK};
    crate::twins::of("lib/mean_value", [("AT_VERTEX", AT_VERTEX * AT_VERTEX), ("BLOCK", BLOCK as f64)])
}
