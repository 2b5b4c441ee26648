//! Maps between polygons in the plane.

pub mod certificate;
mod frame;
mod lattice;
mod preimage;

pub use certificate::{CertifyOptions, Verdict, certify};
pub use frame::Frame;
pub use lattice::{Lattice, LatticeOptions};
pub use preimage::Preimages;
