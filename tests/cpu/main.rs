//! Tests that need no adapter.

mod io;
mod shaders;
//! Tests of the CPU side through the public interface; no graphics device is touched.

mod transfer;
