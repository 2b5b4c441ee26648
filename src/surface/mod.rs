//! Weighted averages on surfaces (Panozzo et al. 2013).

pub mod average;
mod packed;

pub use packed::{PackedImage, PackedPoint, PointMap, Status};
