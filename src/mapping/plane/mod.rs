//! Maps between polygons in the plane.

mod bounds;
mod cage;
pub mod certificate;
mod composite;
#[cfg(test)]
mod composite_tests;
mod frame;
pub mod gpu;
mod inverse;
mod inverse_points;
mod jacobian_min;
#[cfg(test)]
mod jacobian_min_tests;
mod lattice;
mod map_points;
mod mean_value;
mod minimum;
mod outline;
pub mod partition;
mod passes;
pub mod path;
mod preimage;
#[cfg(test)]
mod random_polygons;
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

pub use bounds::{LEMMA_2, StepBound, SufficientBound, sufficient_bound};
pub use cage::{Cage, MAX_VERTICES};
pub use certificate::{CertifyOptions, Verdict, certify};
pub use composite::{CompositeMap, Mapped};
pub use frame::Frame;
pub use jacobian_min::{MOST_RESOLUTION, jacobian_min};
pub use lattice::{Lattice, LatticeOptions};
pub use map_points::{map_points, map_points_on_cpu, map_points_with_derivatives};
pub use minimum::{Minimum, MinimumKind, SampleOptions};
pub use partition::{Partition, PartitionKind, PartitionOptions, StepReport, partition, partition_with};
pub use path::{PathKind, VertexPath, vertex_path};
pub use preimage::Preimages;
pub use step::{Branch, Coordinates, Evaluation, Step, coordinates};
