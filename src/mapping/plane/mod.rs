//! Maps between polygons in the plane.

mod cage;
mod frame;
mod minimum;

pub use cage::{Cage, MAX_VERTICES};
pub use frame::Frame;
pub use minimum::{Minimum, MinimumKind, SampleOptions};
