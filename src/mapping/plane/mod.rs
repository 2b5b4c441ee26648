//! Maps between polygons in the plane.

mod frame;

pub use frame::Frame;
