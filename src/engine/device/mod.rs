//! A device of wgpu: everything in the engine that speaks to one.
//!
//! Without the feature `gpu` this module is `absent.rs`, which has the same items and no values of
//! them, so that host halves of kernels need not be told apart.

mod adapters;
mod arrival;
mod buffer;
mod canary;
mod canvas;
mod counters;
mod dispatch;
mod gpu;
mod learned;
mod pyramid;
mod readback;
mod scopes;
mod start;
mod table;
mod waiting;

pub(super) use adapters::list as adapters;
pub use buffer::{BindGroup, Binding, Buffer, PingPong, UniformBlocks};
pub(super) use canary::CANARY;
pub use canvas::Canvas;
pub use dispatch::{Batch, Submission};
pub use gpu::{Gpu, Pipeline};
pub use pyramid::{Pyramid, Word};
pub use readback::{ReadbackRing, Staging};
pub use table::Table;
#[cfg(test)]
pub(super) use table::WIDTH;
pub use wgpu::{CommandEncoder, TextureView};
