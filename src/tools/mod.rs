//! What users do: combinations of the methods.
pub mod anchors;
pub mod animate;
pub mod attributes;
pub mod cage;
pub mod cover;
pub mod deform;
pub mod differential;
pub mod inverse_map;
pub mod morph;
pub mod render;
pub mod stopwatch;
pub mod transfer;
#[cfg(feature = "unwrap")]
pub mod unwrap;
pub mod vertex_map;
pub mod warp;
