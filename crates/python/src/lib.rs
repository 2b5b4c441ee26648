//! The compiled half of the package `barymap` for Python: classes and functions on arrays whose
//! types and shapes the Python half (`python/barymap`) has checked.
//!
//! Work runs on a thread of its own without the interpreter's lock ([`work`]); errors become
//! exceptions with fields ([`failure`]). Pictures that come back are handed over without a copy;
//! those that go in are copied once.

mod anchors;
mod arrays;
mod cage;
mod curves;
mod failure;
mod pairs;
mod point_map;
mod poses;
mod program;
mod settings;
mod shape;
mod transfer;
mod work;

use pyo3::prelude::*;

#[pymodule]
mod _barymap {
    #[pymodule_export]
    use super::cage::Cage;
    #[pymodule_export]
    use super::curves::{decal, spline, unwrap};
    #[pymodule_export]
    use super::pairs::{anchors, compatible};
    #[pymodule_export]
    use super::point_map::PointMap;
    #[pymodule_export]
    use super::poses::{Poser, morph};
    #[pymodule_export]
    use super::program::{program, read_picture, write_picture};
    #[pymodule_export]
    use super::shape::Shape;
    #[pymodule_export]
    use super::transfer::{attributes, transfer};
    use super::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
