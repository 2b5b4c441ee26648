//! Shapes in double precision: no graphics device and no paper is known here.

pub mod closest;
pub mod mesh;
pub mod surface_point;
pub mod topology;

pub use mesh::{Corner, Material, Mesh, MeshBuilder, NONE};
pub use surface_point::SurfacePoint;
pub use topology::Topology;
