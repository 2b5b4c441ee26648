//! Maps in space on a device: host halves of the kernels.
//!
//! | kernel | what it does | reference |
//! |---|---|---|
//! | `map_points_3d` | points through one step | [`Step`](super::Step) |
//! | `jacobian_min_3d` | the smallest Jacobian inside of some points | [`piece_minima_on_cpu`](super::piece_minima_on_cpu) |
//!
//! Cages of up to [`MOST_FACES`] triangles fit the uniform blocks; the CPU does larger ones.

mod jacobian_min;
mod map_points;
mod tables;

pub(super) use jacobian_min::piece_minima_on_device;
pub(super) use map_points::map_on_device;
pub(super) use tables::fits;
pub use tables::{MOST_FACES, SpaceParams};

use crate::engine::Kernel;

/// The kernels of this folder.
pub const KERNELS: &[&Kernel] = &[&jacobian_min::JACOBIAN_MIN_3D, &map_points::MAP_POINTS_3D];

/// Products of points and faces that one submission holds, so that none is long: a second on a
/// software device, milliseconds on another.
const SUBMISSION: u64 = 1 << 24;

/// The constants of the shaders that are these of Rust.
#[cfg(test)]
pub(crate) fn twins() -> Vec<crate::twins::Twin> {
    use crate::mapping::space::jacobian_min::PIECE;
    use crate::mapping::space::mean_value::{AT_VERTEX, ON_FACE, OVER_CORNER};
    use crate::twins::of;
    [
        of("jacobian_min_3d", [("PIECE", PIECE as f64)]),
        of("lib/faces", [("PER_BLOCK", tables::PER_BLOCK as f64)]),
        of(
            "lib/mean_value_3d",
            [
                ("ON_FACE", ON_FACE * f64::from(f32::EPSILON)),
                ("OVER_CORNER", OVER_CORNER),
                ("AT_VERTEX_3D", AT_VERTEX * AT_VERTEX),
                ("BEYOND", f64::from(f32::EPSILON).sqrt().sqrt()),
            ],
        ),
    ]
    .concat()
}
