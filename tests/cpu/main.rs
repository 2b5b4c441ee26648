//! Tests that need no graphics adapter.

#[path = "../common/mod.rs"]
mod common;
mod embedding;
