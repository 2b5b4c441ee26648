//! Maps between polygons in the plane.

mod bounds;
mod cage;
pub mod certificate;
mod composite;
#[cfg(test)]
mod composite_tests;
mod descent;
mod frame;
#[doc(hidden)]
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
mod patches;
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

pub use bounds::sufficient_bound;
#[doc(hidden)]
pub use bounds::{LEMMA_2, StepBound, SufficientBound};
pub use cage::Cage;
#[doc(hidden)]
pub use cage::MAX_VERTICES;
pub use certificate::{CertifyOptions, Verdict, certify};
pub use composite::{CompositeMap, Mapped};
pub use frame::Frame;
pub(crate) use gpu::{MappedNodes, Mapping};
#[doc(hidden)]
pub use jacobian_min::MOST_RESOLUTION;
pub use jacobian_min::jacobian_min;
#[doc(hidden)]
pub use lattice::{Lattice, LatticeOptions};
#[doc(hidden)]
pub use map_points::map_points_on_cpu;
pub use map_points::{map_points, map_points_with_derivatives};
pub use minimum::{Minimum, MinimumKind, SampleOptions};
#[doc(hidden)]
pub use partition::partition_with;
pub use partition::{LivePartition, Partition, PartitionKind, PartitionOptions, StepReport, partition};
#[cfg(test)]
pub(crate) use patches::twins as patch_twins;
#[doc(hidden)]
pub use patches::{
    Evaluated, Found, Leaf, Maps, NOWHERE, Open, PackedPatches, Patch, PatchOptions, PatchRecord, Patches, Solved,
    TILE_SIDE,
};
#[doc(hidden)]
pub use path::vertex_path;
pub use path::{PathKind, VertexPath};
#[doc(hidden)]
pub use preimage::Preimages;
pub(crate) use preimage::fill_window;
#[doc(hidden)]
pub use step::Branch;
pub use step::{Coordinates, Evaluation, Step, coordinates};
