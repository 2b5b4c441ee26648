//! Running kernels: adapters, buffers, dispatch, lanes. No paper is known here.

pub mod real;

pub use real::Real;
