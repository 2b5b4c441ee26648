//! Warping pictures, points and outlines by composite mean value mappings.
//!
//! [`warp_picture`] goes over the canvas in bands of rows, each a module: how much of every pixel
//! the cage covers ([`cover`]), where it looks in the picture (the exact pre-images of the map),
//! what it sees there ([`gather`], with the filters of [`picture`](crate::picture) and [`ewa`] on
//! the [`pyramid`]), and what is written ([`store`]).
//!
//! Schneider, Hormann, Floater 2013, section 1 and equation (4), with filtering, pictures larger
//! than memory for their pre-images, and what lies outside the cage.

#[doc(hidden)]
pub mod band;
#[doc(hidden)]
pub mod cover;
#[doc(hidden)]
pub mod draw;
#[doc(hidden)]
pub mod ewa;
#[doc(hidden)]
pub mod feather;
pub mod footprint;
pub mod frames;
#[doc(hidden)]
pub mod gather;
#[doc(hidden)]
pub mod gpu;
pub mod outline;
pub mod pictures;
pub mod placement;
pub mod preview;
pub mod projective;
#[doc(hidden)]
pub mod pyramid;
#[doc(hidden)]
pub mod store;

mod device_preview;
mod direct;
mod driver;
mod interpolate;
mod sight;

pub use crate::picture::Filter;
pub use device_preview::DevicePreview;
#[doc(hidden)]
pub use driver::Evaluations;
pub use driver::{LARGEST_SIDE, WarpOptions, WarpOutput, WarpStats, warp_picture};
pub use placement::Placement;
pub use preview::Preview;
pub use store::Outside;
