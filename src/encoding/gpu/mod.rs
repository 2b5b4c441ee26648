//! Decoding on a device: host halves of the kernels.
//!
//! | kernel | what it does | reference |
//! |---|---|---|
//! | `split_level` | the vertices of a level of splits, or of several narrow ones, of one shape or many | [`split_level`](super::decode::split_level) |
//! | `encoding_residual` | V - F of every row of one shape or several; the derivative of F | [`encoding_residual`](super::decode::encoding_residual), [`Linearisation`](super::derivative::Linearisation) |
//! | `encoding_apply` | (I - dF) x, and what the transposed product needs of it | [`encoding_apply`](super::derivative::encoding_apply) |
//! | `encoding_apply_transpose` | the transposed product, a gather | [`encoding_apply_transpose`](super::derivative::encoding_apply_transpose) |
//! | `encoding_diagonal` | Jacobi's preconditioner | [`encoding_diagonal`](super::gradients::encoding_diagonal) |
//! | `dot` | sums of products by a fixed tree | [`dot_product`](super::gradients::dot_product) |
//! | `gradient_step`, `gradient_direction` | the vectors of conjugate gradients | `gradients` |
//! | `line_search` | the shapes along a Gauss-Newton step | `solver` |
//!
//! Positions are four numbers each, the last one unused. The residuals of the line search are the
//! largest buffer: stages of up to 349,525 rows fit the bindings of the smallest devices, larger
//! ones are solved on the CPU. Sums are f32: the scalars of conjugate gradients and G itself carry
//! five to six digits, which a step needs; the reference sums in double precision.

mod decoder;
mod dot;
mod gradients;
mod split_level;
mod stage;
mod tables;

pub use decoder::DeviceStages;
pub use dot::{DotParams, dot_on_device};
pub use gradients::{GradientParams, SolveVertex, StageSolver};
pub use split_level::SplitLevels;
pub use stage::StageKernels;
pub use tables::{EncodingParams, RowDerivative, RowProduct, SlotDerivative};

use crate::engine::Kernel;
use crate::error::Error;

/// The kernels of this folder.
pub const KERNELS: &[&Kernel] = &[
    &dot::DOT,
    &gradients::GRADIENT_DIRECTION,
    &gradients::GRADIENT_STEP,
    &gradients::LINE_SEARCH,
    &split_level::SPLIT_LEVEL,
    &stage::ENCODING_APPLY,
    &stage::ENCODING_APPLY_TRANSPOSE,
    &stage::ENCODING_DIAGONAL,
    &stage::ENCODING_RESIDUAL,
];

/// Visits of slots that one submission holds, so that none is long: a fraction of a second on a
/// software device, milliseconds on another.
const WORK: u64 = 1 << 22;

fn fault(what: &str) -> Error {
    Error::Device { what: what.into(), remedy: "This is a fault of barymap: please report it".into() }
}

/// The constants of the shaders that are these of Rust.
#[cfg(test)]
pub(crate) fn twins() -> Vec<crate::twins::Twin> {
    use crate::encoding::decode::REGULARISATION;
    use crate::twins::of;
    [of("dot", [("ITEMS", dot::ITEMS.into())]), of("lib/encoding", [("REGULAR", REGULARISATION * REGULARISATION)])]
        .concat()
}
