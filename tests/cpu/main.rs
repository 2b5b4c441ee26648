//! Tests that need no adapter.

mod shaders;
