//! barymap in a window: pairs of points are set by looking, and the result follows while they are
//! dragged.
//!
//! Three parts, of which each one needs only those above it:
//!
//! - [`model`], without a window and without threads: cameras, picking, pairs, documents with undo,
//!   projects as files, the command line that does the same as the window.
//! - [`worker`], a thread that owns meshes, textures and maps. Sessions of the library borrow their
//!   meshes, so the thread's stack holds them in a loop ([`worker::live`]). The window sends what it
//!   *wants* (these files, these pairs, this method); the worker compares that with what it has and
//!   does the most urgent part of the difference: first what a drag needs, at a coarse size; then,
//!   when nothing else is asked, the whole field, the full size, the errors of left out pairs. Work
//!   of the second kind is cancelled the moment the window asks for something.
//! - [`draw`] and [`view`]: meshes drawn into textures of our own, and the widgets. A frame of the
//!   window never waits for the worker or for the device.
//!
//! Exports are done by a child process, the same executable as a command line ([`export`]): what is
//! exported is what the command line writes, byte for byte; it is cancelled by ending the process,
//! and whatever happens to it, the window stays.

pub mod draw;
pub mod export;
pub mod model;
pub mod start;
pub mod view;
pub mod worker;
