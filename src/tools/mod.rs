//! What users do: combinations of the methods.
pub mod transfer;
