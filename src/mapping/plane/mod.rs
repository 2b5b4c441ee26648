//! Maps between polygons in the plane.

mod frame;
mod minimum;

pub use frame::Frame;
pub use minimum::{Minimum, MinimumKind, SampleOptions};
