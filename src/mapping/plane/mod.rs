//! Maps between polygons in the plane.

mod frame;
mod lattice;
mod minimum;
mod preimage;

pub use frame::Frame;
pub use lattice::{Lattice, LatticeOptions};
pub use minimum::{Minimum, MinimumKind, SampleOptions};
pub use preimage::Preimages;
