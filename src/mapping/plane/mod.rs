//! Maps between polygons in the plane.

mod frame;
mod lattice;
mod preimage;

pub use frame::Frame;
pub use lattice::{Lattice, LatticeOptions};
pub use preimage::Preimages;
