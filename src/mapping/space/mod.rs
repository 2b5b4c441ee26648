//! Maps between closed polyhedra in space (paper, section 4.5).

mod angle;
mod cage;
mod composite;
#[cfg(test)]
mod composite_tests;
mod face;
mod frame;
#[doc(hidden)]
pub mod gpu;
mod intersect;
mod inverse;
mod jacobian_min;
mod map_points;
mod mean_value;
pub mod partition;
pub mod path;
mod step;
#[cfg(test)]
mod step_tests;
#[cfg(test)]
mod testing;

#[doc(hidden)]
pub use cage::MAX_FACES;
pub use cage::{Cage, volume};
pub use composite::{CompositeMap, Mapped};
pub use frame::Frame;
pub use intersect::self_intersections;
#[doc(hidden)]
pub use jacobian_min::{MOST_RESOLUTION, PIECE, PieceMinimum3d, piece_minima, piece_minima_on_cpu};
pub use jacobian_min::{Minimum, MinimumKind, RESOLUTION, Samples, jacobian_min_3d};
pub use map_points::map_points_3d;
#[doc(hidden)]
pub use partition::Intersection;
pub use partition::{Partition, PartitionKind, PartitionOptions, StepReport, partition};
pub use path::{Linear, VertexPath};
pub use step::{Evaluation, Step, coordinates};
