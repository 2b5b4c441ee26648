//! Weighted averages on surfaces (Panozzo et al. 2013).

pub mod gauge;
pub mod average;
mod packed;
pub mod phong_surface;
pub mod project;
pub mod psi;
pub mod tangents;
pub mod vector;

pub use packed::{PackedImage, PackedPoint, PointMap, Status};
pub use phong_surface::PhongSurface;
