//! Pictures: what they are in memory, and what a footprint sees of one.
//!
//! One type ([`Image`]) is what textures, masks and results are before and after a file format. One
//! list of filters ([`Filter`]) serves every job that takes colours from a picture. A footprint
//! is the parallelogram that one pixel of the result covers on the picture; `taps` and
//! [`ellipse`] turn it into weights.

#[doc(hidden)]
pub mod ellipse;
mod filter;
mod image;
#[doc(hidden)]
pub mod lanczos;
mod srgb;
pub(crate) mod taps;

pub use filter::Filter;
pub use image::{Depth, Image, Pixels};
#[doc(hidden)]
pub use srgb::{linear_to_srgb, srgb_to_linear};
