//! Weighted averages on surfaces (Panozzo et al. 2013).

pub mod embedding;
mod packed;

pub use embedding::{Embedding, EmbeddingOptions, Sampling};
pub use packed::{PackedImage, PackedPoint, PointMap, Status};
