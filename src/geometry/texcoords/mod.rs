//! Texture coordinates of a mesh: its islands, where they overlap, and how they stretch the
//! surface.

pub mod findings;
pub mod islands;
pub mod measure;
pub mod overlap;

pub use findings::{Findings, findings};
pub use islands::{Island, Islands};
pub use measure::{Distortion, distortion, seam_length};
pub use overlap::{Overlap, OverlapOptions, Overlaps, overlaps};
