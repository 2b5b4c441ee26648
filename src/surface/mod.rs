//! Weighted averages on surfaces (Panozzo et al. 2013).

#[doc(hidden)]
pub mod alignment;
pub mod anchors;
#[doc(hidden)]
pub mod average;
pub mod correspondence;
#[doc(hidden)]
pub mod embedding;
pub mod field;
#[doc(hidden)]
pub mod forward;
#[doc(hidden)]
pub mod gauge;
pub mod gpu;
mod identity;
mod long_fans;
mod nearest_vertex;
mod packed;
#[doc(hidden)]
pub mod phong_surface;
#[doc(hidden)]
pub mod project;
#[doc(hidden)]
pub mod psi;
#[doc(hidden)]
pub mod quality;
mod search;
#[doc(hidden)]
pub mod single;
#[doc(hidden)]
pub mod stencils;
#[doc(hidden)]
pub mod tangents;
#[cfg(test)]
mod theory;
#[doc(hidden)]
pub mod vector;

pub use alignment::{Alignment, AlignmentOptions, align};
pub use anchors::AnchorPairs;
pub use embedding::{Embedding, EmbeddingOptions, Sampling};
pub use identity::IdentityMap;
pub use nearest_vertex::NearestVertex;
#[doc(hidden)]
pub use packed::{Doubts, MapStage, ResidentMap};
pub use packed::{PackedImage, PackedPoint, PointMap, Status};
#[doc(hidden)]
pub use phong_surface::PhongSurface;
#[doc(hidden)]
pub use search::TriangleBound;
