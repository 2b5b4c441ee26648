//! The library in a page: a kernel by the awaited form of the engine, and every check of
//! `conformance` by the form that waits. `page.js` calls both.
#![cfg(target_arch = "wasm32")]

mod awaited;
mod waited;
