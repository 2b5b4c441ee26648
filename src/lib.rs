//! barymap maps one shape onto another from a handful of control points.
//!
//! The texture of one mesh on a different one, from pairs of corresponding points
//! ([`tools::transfer`]), goes one way: [`geometry::Mesh`] → [`surface::Embedding`] →
//! [`surface::correspondence`] → [`tools::transfer::transfer`].
//!
//! ```
//! use barymap::geometry::Topology;
//! use barymap::models::shapes::uv_sphere;
//! use barymap::progress::Quiet;
//! use barymap::picture::{Depth, Image};
//! use barymap::surface::anchors::vertex_point;
//! use barymap::surface::correspondence::{CorrespondenceOptions, Shape, correspondence};
//! use barymap::surface::{AnchorPairs, Embedding, EmbeddingOptions};
//! use barymap::tools::transfer::{Layer, TransferOptions, transfer};
//!
//! # fn main() -> barymap::Result<()> {
//! // Two meshes of different connectivity; files are read by `barymap::io::read_mesh`.
//! let (source, target) = (uv_sphere(1.0, 24, 16), uv_sphere(2.0, 20, 12));
//! let (around_source, around_target) = (Topology::new(&source), Topology::new(&target));
//!
//! // Corresponding points: the poles, and four meridians at three latitudes.
//! let net = |pole: u32, rows: [u32; 3], step: u32| -> Vec<u32> {
//!     [0, pole].into_iter().chain(rows.into_iter().flat_map(|r| (0..4).map(move |k| r + k *
//! step))).collect() };
//! let on_source = net(361, [73, 169, 265], 6).into_iter().map(|v| vertex_point(&source, &around_source, v, "anchor"));
//! let on_target = net(221, [41, 101, 161], 5).into_iter().map(|v| vertex_point(&target, &around_target, v, "anchor"));
//! let anchors = AnchorPairs {
//!     source: on_source.collect::<barymap::Result<_>>()?,
//!     target: on_target.collect::<barymap::Result<_>>()?,
//! };
//!
//! // Distances along the surface become distances in eight dimensions: made once per mesh.
//! let options = EmbeddingOptions { landmarks: 100, ..EmbeddingOptions::default() };
//! let in_source = Embedding::compute(&source, &around_source, &options, &Quiet)?;
//! let in_target = Embedding::compute(&target, &around_target, &options, &Quiet)?;
//!
//! // The map goes from the target, whose texels want colours, to the source, which has them.
//! let map = correspondence(
//!     Shape { mesh: &source, topology: &around_source, embedding: Some(&in_source) },
//!     Shape { mesh: &target, topology: &around_target, embedding: Some(&in_target) },
//!     &anchors,
//!     &CorrespondenceOptions::default(),
//! )?;
//! let texture = Image::zeros(64, 64, 3, Depth::U8)?;
//! let size = TransferOptions { width: 128, height: 128, ..TransferOptions::default() };
//! let result = transfer(&source, &[Layer::single("colour", &texture)], &target, map.as_ref(), &size, &Quiet)?;
//! assert!(result.stats.valid_fraction > 0.9);
//! # Ok(())
//! # }
//! ```
//!
//! The map tells of every point whether it can be trusted ([`surface::Status`]); a picture of the
//! coverage and the fraction of the area that is valid come with every transfer. Errors name the
//! file or value, what is wrong and what to do ([`Error`]). The same input gives the same bytes,
//! for any number of threads.
//!
//! - [`mod@geometry`], meshes, adjacency, diagnosis, geodesics, simplification
//! - [`mod@surface`], weighted averages on surfaces (Panozzo, Baran, Diamanti, Sorkine-Hornung
//!   2013)
//! - [`mod@mapping`], composite mean value mappings (Schneider, Hormann, Floater 2013)
//! - [`mod@encoding`], mean-value geometry encoding (Kraevoy, Sheffer 2006)
//! - [`mod@tools`], what users do: transfer, coverage, pictures
//! - [`mod@engine`], adapters and kernels
//! - [`mod@desk`], shapes from files with their embeddings, pairs found on them, the choice of a
//!   method
//! - [`mod@conformance`], every kernel on a device beside its reference
//! - [`mod@control`], work that is ended before its end
//! - [`mod@io`], files
//! - [`mod@cli`], the command line
//! - [`mod@models`], built-in shapes and characters with known correspondence

#[cfg(feature = "cli")]
pub mod cli;
#[cfg(feature = "gpu")]
pub mod conformance;
pub mod control;
#[cfg(feature = "files")]
pub mod desk;
pub mod encoding;
pub mod engine;
pub mod error;
pub mod geometry;
#[cfg(feature = "files")]
pub mod io;
#[cfg(not(feature = "files"))]
#[path = "io/bare.rs"]
pub mod io;
pub mod mapping;
mod memory;
pub mod models;
pub mod picture;
pub mod progress;
pub mod surface;
pub mod tools;
#[cfg(all(test, feature = "gpu"))]
mod twins;
mod words;

pub use error::{Error, Result};

// Types of both stand in public signatures.
pub use glam;
#[cfg(feature = "gpu")]
pub use wgpu;

/// The ten types that the main job needs, and [`Result`].
pub mod prelude {
    pub use crate::Result;
    pub use crate::engine::{Engine, EngineOptions};
    pub use crate::geometry::{Mesh, SurfacePoint, Topology};
    pub use crate::picture::Image;
    pub use crate::surface::correspondence::Shape;
    pub use crate::surface::{AnchorPairs, Embedding};
    pub use crate::tools::transfer::{Layer, TransferOptions};
}
