//! What users do: combinations of the methods.
pub mod cover;
pub mod stopwatch;
pub mod transfer;
pub mod vertex_map;
