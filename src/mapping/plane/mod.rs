//! Maps between polygons in the plane.

mod bounds;
mod cage;
mod frame;
mod gradients;
mod minimum;
pub mod partition;
pub mod path;

pub use bounds::{LEMMA_2, StepBound, SufficientBound, sufficient_bound};
pub use cage::{Cage, MAX_VERTICES};
pub use frame::Frame;
pub use minimum::{Minimum, MinimumKind, SampleOptions};
pub use partition::{Partition, PartitionKind, PartitionOptions, StepReport, partition_with};
pub use path::{PathKind, VertexPath};
