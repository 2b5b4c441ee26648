//! Maps between closed polyhedra in space (paper, section 4.5).

mod angle;
mod cage;
mod composite;
#[cfg(test)]
mod composite_tests;
mod face;
mod frame;
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

pub use cage::{Cage, MAX_FACES, volume};
pub use composite::{CompositeMap, Mapped};
pub use frame::Frame;
pub use intersect::self_intersections;
pub use jacobian_min::{
    MOST_RESOLUTION, Minimum, MinimumKind, PIECE, PieceMinimum3d, RESOLUTION, Samples, jacobian_min_3d, piece_minima,
    piece_minima_on_cpu,
};
pub use map_points::map_points_3d;
pub use partition::{Intersection, Partition, PartitionKind, PartitionOptions, StepReport, partition};
pub use path::{Linear, VertexPath};
pub use step::{Evaluation, Step, coordinates};
