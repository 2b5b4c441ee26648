//! Texture coordinates of a mesh: its islands, where they overlap, and how they stretch the
//! surface.

pub mod findings;
#[doc(hidden)]
pub mod islands;
#[doc(hidden)]
pub mod measure;
#[doc(hidden)]
pub mod overlap;

pub use findings::{Findings, findings};
#[doc(hidden)]
pub use islands::Island;
pub use islands::Islands;
#[doc(hidden)]
pub use measure::Distortion;
pub use measure::{distortion, seam_length};
pub use overlap::overlaps;
#[doc(hidden)]
pub use overlap::{Overlap, OverlapOptions, Overlaps};
