//! A mesh with what the methods need of it.

use barymap::geometry::sampling::farthest_points;
use barymap::geometry::{Geodesics, Mesh, SurfacePoint, Topology};
use barymap::progress::Quiet;
use barymap::surface::anchors::vertex_point;
use barymap::surface::correspondence::Shape;
use barymap::surface::{Embedding, EmbeddingOptions};

pub(crate) struct Embedded {
    pub(crate) mesh: Mesh,
    pub(crate) topology: Topology,
    pub(crate) embedding: Embedding,
}

impl Embedded {
    pub(crate) fn new(mesh: Mesh, options: &EmbeddingOptions) -> Self {
        let topology = Topology::new(&mesh);
        let embedding = Embedding::compute(&mesh, &topology, options, &Quiet).unwrap();
        Self { mesh, topology, embedding }
    }

    pub(crate) fn shape(&self) -> Shape<'_> {
        Shape { mesh: &self.mesh, topology: &self.topology, embedding: Some(&self.embedding) }
    }

    pub(crate) fn point(&self, v: u32) -> SurfacePoint {
        vertex_point(&self.mesh, &self.topology, v, "anchor").unwrap()
    }

    /// `n` vertices far from one another along the surface.
    pub(crate) fn spread(&self, n: usize) -> Vec<u32> {
        farthest_points(&Geodesics::new(&self.mesh.positions, &self.mesh.triangles()).unwrap(), 0, n)
    }
}
