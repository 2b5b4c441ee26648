//! Running kernels: adapters, buffers, dispatch, lanes. No paper is known here.
//!
//! [`Engine`] says where work is done: on a device ([`Gpu`]), on the CPU in single precision, or by
//! the references in double precision. A [`Kernel`] is the description of one compute shader; its
//! host half, beside the method it belongs to, binds typed [`Buffer`]s and dispatches it. Every
//! entry point returns an error, never a panic, when a device is missing, lost, or too small.

mod adapter;
mod capability;
mod compact;
#[cfg(feature = "gpu")]
mod device;
#[cfg(not(feature = "gpu"))]
#[path = "absent.rs"]
mod device;
mod kernel;
#[doc(hidden)]
pub mod lane;
mod options;
#[doc(hidden)]
pub mod real;
pub mod reduce;
#[cfg(feature = "gpu")]
pub mod reflect;
mod shader;
mod start;
mod traffic;

pub use adapter::AdapterSummary;
pub use capability::Capabilities;
pub use compact::{Compaction, Matching};
pub use device::{
    Batch, BindGroup, Binding, Buffer, Gpu, PingPong, Pipeline, ReadbackRing, Staging, Submission, Table, UniformBlocks,
};
#[doc(hidden)]
pub use device::{Canvas, CommandEncoder, Pyramid, TextureView, Word};
pub use kernel::{BindingKind, GROUP, Kernel, Layout, Span};
#[doc(hidden)]
pub use kernel::{SPAN_LAYOUT, UNIFORM_BLOCK};
#[doc(hidden)]
pub(crate) use lane::MAX_LANES;
pub use lane::{Lane, LaneScalar, Lanes, Sweep, TILE};
pub use options::{Backend, DeviceLimits, EngineOptions};
#[doc(hidden)]
pub use real::Real;
#[doc(hidden)]
pub use shader::{Composed, compose};
pub use start::{Description, Engine};
pub use traffic::Traffic;

/// The engine's own kernels.
#[cfg(feature = "gpu")]
#[doc(hidden)]
pub const KERNELS: &[&Kernel] = &[
    &device::CANARY,
    &compact::COMPACT_COUNT,
    &compact::COMPACT_SCAN,
    &compact::COMPACT_SCATTER,
    &reduce::REDUCE_MIN,
    &reduce::REDUCE_SUM,
];

/// The constants of the shaders that are these of Rust.
#[cfg(all(test, feature = "gpu"))]
pub(crate) fn twins() -> Vec<crate::twins::Twin> {
    use crate::twins::of;
    [
        of("compact_count", [("ITEMS", compact::ITEMS.into())]),
        of("compact_scatter", [("ITEMS", compact::ITEMS.into())]),
        of("reduce_min", [("ITEMS", reduce::ITEMS.into())]),
        of("reduce_sum", [("ITEMS", reduce::ITEMS.into())]),
        of("lib/table", [("TABLE_WIDTH", device::WIDTH.into())]),
    ]
    .concat()
}
