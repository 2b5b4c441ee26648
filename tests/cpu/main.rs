//! Tests that need no adapter.

mod io;
mod shaders;
