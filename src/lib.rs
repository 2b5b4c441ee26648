//! barymap maps one shape onto another from a handful of control points.

pub mod engine;
pub mod error;
pub mod geometry;
pub mod io;
pub mod models;
pub mod progress;
pub mod raster;
pub mod surface;
pub mod tools;

pub use error::{Error, Result};
