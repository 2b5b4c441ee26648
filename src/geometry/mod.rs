//! Shapes in double precision: no graphics device and no paper is known here.

pub(crate) mod bending;
pub(crate) mod cholesky;
pub mod closest;
pub mod diagnosis;
pub mod frame;
pub mod geodesics;
pub(crate) mod isomorphism;
pub mod laplacian;
pub mod material;
pub mod mesh;
mod pieces;
pub(crate) mod placement;
pub mod polygon;
pub mod sampling;
pub mod simplify;
pub mod surface_point;
pub mod tangent_frames;
pub mod texcoords;
pub mod topology;
mod triangulate;
pub(crate) mod union_find;
pub mod up_axis;
pub mod weld;

/// Sizes and coordinates whose squared products neither overflow nor vanish, nor lose the exactness
/// of predicates.
pub const RANGE: std::ops::RangeInclusive<f64> = 1e-100..=1e100;

pub use closest::ClosestPoints;
pub use diagnosis::Diagnosis;
pub use frame::Frame;
pub use geodesics::{Geodesics, March};
pub use laplacian::{Laplacian, SparseRows};
pub use material::Material;
pub use mesh::{Corner, Mesh, MeshBuilder, NONE};
pub use placement::{Placement, Wrap};
pub use polygon::{Defect, Polygon, Side};
pub use simplify::{Simplified, SimplifyOptions, simplify};
pub use surface_point::SurfacePoint;
pub use topology::Topology;
pub use up_axis::UpAxis;
pub use weld::{Weld, Welded};
