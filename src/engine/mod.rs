//! Running kernels: adapters, buffers, dispatch, lanes. No paper is known here.

pub mod lane;
pub mod real;

pub use lane::{Lane, LaneScalar, Lanes, Sweep, TILE};
pub use real::Real;
