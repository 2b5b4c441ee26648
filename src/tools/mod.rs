//! What users do: combinations of the methods.
pub mod animate;
pub mod cover;
pub mod deform;
pub mod morph;
pub mod render;
pub mod stopwatch;
pub mod transfer;
#[cfg(feature = "unwrap")]
pub mod unwrap;
pub mod vertex_map;
pub mod warp;
