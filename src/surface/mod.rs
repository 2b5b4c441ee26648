//! Weighted averages on surfaces (Panozzo et al. 2013).

pub mod alignment;
pub mod anchors;
pub mod average;
pub mod correspondence;
pub mod embedding;
pub mod field;
pub mod forward;
pub mod gauge;
pub mod gpu;
mod identity;
mod long_fans;
mod nearest_vertex;
mod packed;
pub mod phong_surface;
pub mod project;
pub mod psi;
pub mod quality;
mod search;
pub mod single;
pub mod stencils;
pub mod tangents;
#[cfg(test)]
mod theory;
pub mod vector;

pub use alignment::{Alignment, AlignmentOptions, align};
pub use anchors::AnchorPairs;
pub use embedding::{Embedding, EmbeddingOptions, Sampling};
pub use identity::IdentityMap;
pub use nearest_vertex::NearestVertex;
pub use packed::{PackedImage, PackedPoint, PointMap, Status};
pub use phong_surface::PhongSurface;
pub use search::TriangleBound;
