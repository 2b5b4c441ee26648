//! Mean-value geometry encoding (Kraevoy, Sheffer 2006): every vertex told by its ring, independent
//! of position, rotation and size.
//!
//! Data in: positions, rings, and the vertices that are held. Data out: positions of all vertices
//! for any positions of the held ones. One direction:
//!
//! rings ([`Connectivity`]) → [`Hierarchy`] (half-edge collapses, stored rings, cascade levels;
//! made once per mesh and held set) → [`Decoder`] (owns the hierarchy, the coefficients and the
//! factorisations; one [`Decoder::decode`] a frame) → positions and a report.
//!
//! - `weights`, `encode`: section 2.1, mean value weights w and offsets b of one ring, and of all
//!   rings of [`Stencils`]
//! - [`decode`]: section 2.2, equation 13: F of one ring, of a level of vertex splits, and V - F of
//!   all rings
//! - [`derivative`]: the analytic derivative of F; products with I - dF and its transpose as
//!   gathers
//! - `collapse`, `cost`, [`hierarchy`]: section 3.1
//! - `solver`, `direct`, [`gradients`], `sweeps`: section 3.2.2, Gauss-Newton with line search;
//!   `springs`, ours: lengths of edges
//! - [`cascade`]: section 3.2, coarse to fine
//! - [`gpu`]: the kernels
//! - [`sequence`], `track`, `abreast`: many frames, smooth in time and several at once
//! - `blend`, `march`: section 4.3, averages of the encodings of several shapes, and the way to
//!   the shapes they describe
//! - [`measures`]: how far a shape is from another one, in neutral terms
//!
//! All arrays are flat and indexed by rows (encoded vertices) and slots (a neighbour of a row), as
//! the kernels read them. Formulas hold ring-local coordinates throughout and are generic over
//! [`crate::engine::Real`]; double precision is the truth.

mod abreast;
mod blend;
#[doc(hidden)]
pub mod cascade;
mod collapse;
mod connectivity;
mod cost;
#[doc(hidden)]
pub mod decode;
#[doc(hidden)]
pub mod derivative;
mod direct;
mod encode;
#[doc(hidden)]
pub mod gpu;
#[doc(hidden)]
pub mod gradients;
#[doc(hidden)]
pub mod hierarchy;
mod march;
#[doc(hidden)]
pub mod measures;
mod rings;
#[doc(hidden)]
pub mod sequence;
pub mod similarity;
mod solver;
mod springs;
mod stencil;
mod store;
mod sweeps;
mod track;
mod vector;
mod weights;

pub(crate) use blend::{Blend, Mix};
pub use cascade::{DecodeReport, Quality};
#[doc(hidden)]
pub use cascade::{Decoder, LevelReport};
#[doc(hidden)]
pub use connectivity::Connectivity;
pub use encode::Encoding;
#[doc(hidden)]
pub use hierarchy::Hierarchy;
pub use hierarchy::HierarchyOptions;
pub use march::MarchQuality;
pub(crate) use march::{Coarse, Marcher};
#[doc(hidden)]
pub use sequence::Played;
pub use sequence::{Frame, SequenceQuality};
pub use similarity::Similarity;
#[doc(hidden)]
pub use stencil::Stencils;
#[doc(hidden)]
pub use store::cache_key;
#[doc(hidden)]
pub use vector::V3;
