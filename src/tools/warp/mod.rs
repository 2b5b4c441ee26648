//! Warping pictures, points and outlines through maps of the plane.

pub mod band;
pub mod cover;
pub mod ewa;
pub mod filter;
pub mod gather;
pub mod preview;
pub mod pyramid;
pub mod store;

pub use filter::Filter;
pub use preview::Preview;
