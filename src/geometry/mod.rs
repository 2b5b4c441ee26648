//! Shapes in double precision: no graphics device and no paper is known here.

pub(crate) mod bending;
pub(crate) mod cholesky;
#[doc(hidden)]
pub mod closest;
#[doc(hidden)]
pub mod diagnosis;
pub mod frame;
#[doc(hidden)]
pub mod geodesics;
pub(crate) mod isomorphism;
pub(crate) mod laplacian;
pub mod material;
pub mod mesh;
pub(crate) mod off_mesh;
mod pieces;
pub(crate) mod placement;
pub mod polygon;
pub mod sampling;
pub(crate) mod simplify;
pub mod surface_point;
#[doc(hidden)]
pub mod tangent_frames;
pub mod texcoords;
#[doc(hidden)]
pub mod topology;
mod triangulate;
pub(crate) mod union_find;
pub mod up_axis;
pub mod weld;

/// Sizes and coordinates whose squared products neither overflow nor vanish, nor lose the exactness
/// of predicates.
#[doc(hidden)]
pub const RANGE: std::ops::RangeInclusive<f64> = 1e-100..=1e100;

pub use closest::ClosestPoints;
pub use diagnosis::Diagnosis;
pub use frame::Frame;
pub use geodesics::Geodesics;
#[doc(hidden)]
pub use geodesics::March;
pub(crate) use laplacian::{Laplacian, SparseRows};
pub use material::Material;
pub use mesh::{Corner, Mesh, MeshBuilder, NONE, Texcoords};
pub use placement::Placement;
#[doc(hidden)]
pub use placement::Wrap;
pub use polygon::{Defect, Polygon, Side};
pub(crate) use simplify::{SimplifyOptions, simplify};
pub use surface_point::SurfacePoint;
pub use topology::Topology;
pub use up_axis::UpAxis;
pub use weld::{Weld, Welded};
