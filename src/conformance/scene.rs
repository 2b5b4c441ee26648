//! Two surfaces with anchors, made without files.

use crate::geometry::{Mesh, SurfacePoint, Topology};
use crate::models::shapes::{Random, lobed_sphere, uv_sphere};
use crate::surface::correspondence::Shape;
use crate::surface::{AnchorPairs, Embedding, PackedPoint};

/// A mesh with its adjacency and embedding.
pub type Surface = (Mesh, Topology, Embedding);

/// A source, a target and pairs of anchors.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The shape with what is carried.
    pub source: Surface,
    /// The shape it is carried to.
    pub target: Surface,
    /// Corresponding points.
    pub anchors: AnchorPairs,
}

/// A mesh of about unit size in eight dimensions: space, and quadratic bumps in the other five.
fn embedded(mut mesh: Mesh, scale: f64) -> Surface {
    for p in &mut mesh.positions {
        *p *= scale;
    }
    let points = mesh
        .positions
        .iter()
        .flat_map(|p| {
            let p = *p / scale;
            let bumps =
                [0.3 * p.x * p.y, 0.3 * p.y * p.z, 0.2 * p.z * p.x, 0.2 * (p.x * p.x - p.y * p.y), 0.1 * p.z * p.z];
            [p.x, p.y, p.z, bumps[0], bumps[1], bumps[2], bumps[3], bumps[4]].map(|x| x * scale)
        })
        .collect();
    let topology = Topology::new(&mesh);
    let embedding = Embedding {
        dimension: 8,
        points,
        landmarks: Vec::new(),
        stress: 0.0,
        sweeps: 0,
        seconds: Default::default(),
        warnings: Vec::new(),
    };
    (mesh, topology, embedding)
}

impl Scene {
    /// Two lobed spheres with so many pairs; the source is `scale` times as large as the target.
    pub fn new(anchors: usize, scale: f64) -> Self {
        Self::between(lobed_sphere(4, 0.25), lobed_sphere(4, 0.32), anchors, scale)
    }

    /// Two balls with texture coordinates and so many pairs.
    pub fn textured(anchors: usize) -> Self {
        let ball = |bumps: f64| {
            let mut mesh = uv_sphere(1.0, 96, 48);
            for p in &mut mesh.positions {
                *p *= 1.0 + bumps * (3.0 * p.x).sin() * (2.0 * p.y + 1.0).cos();
            }
            mesh
        };
        Self::between(ball(0.1), ball(0.2), anchors, 1.0)
    }

    /// Meshes of the same connectivity, and pairs at the same numbers.
    fn between(source: Mesh, target: Mesh, anchors: usize, scale: f64) -> Self {
        let (source, target) = (embedded(source, scale), embedded(target, 1.0));
        let count = target.0.triangle_count();
        let point = |i: usize| {
            let x = [0.5, 0.3, 0.2];
            SurfacePoint::new(
                ((i * 2_654_435_761) % count) as u32,
                if i.is_multiple_of(3) { [1.0, 0.0, 0.0] } else { x },
            )
        };
        let points: Vec<SurfacePoint> = (0..anchors).map(point).collect();
        Self { source, target, anchors: AnchorPairs { source: points.clone(), target: points } }
    }

    /// Source and target.
    pub fn shapes(&self) -> (Shape<'_>, Shape<'_>) {
        (shape(&self.source), shape(&self.target))
    }

    /// Random points of the target, its anchors first.
    pub fn points(&self, n: usize) -> Vec<PackedPoint> {
        let mut random = Random::new(7);
        let count = self.target.0.triangle_count() as f64;
        let mut points: Vec<PackedPoint> = (0..n)
            .map(|_| {
                let (a, b) = (random.unit(), random.unit());
                let (b0, b1) = if a + b > 1.0 { (1.0 - a, 1.0 - b) } else { (a, b) };
                PackedPoint { face: (random.unit() * count) as u32, b0: b0 as f32, b1: b1 as f32 }
            })
            .collect();
        for (point, anchor) in points.iter_mut().zip(&self.anchors.target) {
            *point = PackedPoint::from(*anchor);
        }
        points
    }
}

fn shape(surface: &Surface) -> Shape<'_> {
    Shape { mesh: &surface.0, topology: &surface.1, embedding: Some(&surface.2) }
}
