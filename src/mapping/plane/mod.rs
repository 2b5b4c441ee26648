//! Maps between polygons in the plane.

mod frame;
mod jacobian_min;
#[cfg(test)]
mod jacobian_min_tests;
mod lattice;
mod map_points;
mod mean_value;
mod minimum;
mod outline;
mod preimage;
mod samples;
mod step;
#[cfg(test)]
mod step_tests;
mod sweep;
#[cfg(test)]
mod sweep_tests;
#[cfg(test)]
mod testing;
mod vertex_limit;
mod wachspress;

pub use frame::Frame;
pub use jacobian_min::{MOST_RESOLUTION, jacobian_min};
pub use lattice::{Lattice, LatticeOptions};
pub use map_points::{map_points, map_points_on_cpu, map_points_with_derivatives};
pub use minimum::{Minimum, MinimumKind, SampleOptions};
pub use preimage::Preimages;
pub use step::{Branch, Coordinates, Evaluation, Step, coordinates};
