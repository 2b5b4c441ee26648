//! Averages of surface points on a device against the reference, and remeshing with them.

use barymap::engine::Engine;
use barymap::geometry::{Corner, Mesh, MeshBuilder, NONE, SurfacePoint, Topology};
use barymap::models::shapes::{Diagonal, Random, plane_grid, torus};
use barymap::progress::Quiet;
use barymap::surface::correspondence::Shape;
use barymap::surface::forward::Forward;
use barymap::surface::gpu::DeviceStencils;
use barymap::surface::stencils::Stencils;
use barymap::surface::{Embedding, EmbeddingOptions};
use barymap::tools::remesh::{Evenness, RemeshOptions, Remesher, Turned};

use crate::{downlevel, engine};

struct Model {
    mesh: Mesh,
    topology: Topology,
    embedding: Embedding,
}

impl Model {
    fn new() -> Self {
        Self::of(torus(1.0, 0.4, 48, 32, Diagonal::Alternating))
    }

    fn of(mesh: Mesh) -> Self {
        let topology = Topology::new(&mesh);
        let options = EmbeddingOptions { landmarks: 200, ..EmbeddingOptions::default() };
        let embedding = Embedding::compute(&mesh, &topology, &options, &Quiet).unwrap();
        Self { mesh, topology, embedding }
    }

    fn shape(&self) -> Shape<'_> {
        Shape { mesh: &self.mesh, topology: &self.topology, embedding: Some(&self.embedding) }
    }

    /// Random points, each with neighbours that lie around the same vertex.
    fn points(&self, count: usize) -> Vec<SurfacePoint> {
        let mut random = Random::new(11);
        (0..count)
            .map(|i| {
                let fan = self.topology.vertex_triangles((i / 6 * 37 % self.mesh.vertex_count()) as u32);
                let (a, b) = (random.unit(), random.unit());
                SurfacePoint::new(fan[i % fan.len()], [a * b, a * (1.0 - b), 1.0 - a])
            })
            .collect()
    }

    fn distance(&self, a: &SurfacePoint, b: &SurfacePoint) -> f64 {
        a.position(&self.mesh).distance(b.position(&self.mesh)) / self.mesh.mean_edge_length()
    }
}

fn rows(count: usize, own: f64) -> Stencils {
    let mut rows = Stencils::default();
    for r in 0..count as u32 {
        let first = r / 6 * 6;
        rows.push(r, (first..first + 6).filter(|&i| (i as usize) < count && i % 7 != r % 5), 1.0 - own);
    }
    rows
}

/// The share of rows whose averages are farther apart than single precision explains.
fn apart(model: &Model, forward: &Forward<8>, points: &[SurfacePoint], rows: &Stencils, found: &[SurfacePoint]) -> f64 {
    let truth = forward.averages(points, rows);
    let off = truth.iter().zip(found).filter(|(a, b)| model.distance(&a.point, b) > 1e-3).count();
    off as f64 / truth.len().max(1) as f64
}

#[test]
fn averages_agree_with_double_precision() {
    let model = Model::new();
    let forward = Forward::<8>::new(model.shape()).unwrap();
    let rest = |points: &[SurfacePoint], rows: &Stencils, r: usize| forward.average_row(points, rows, r).point;
    for engine in [engine(), downlevel()].into_iter().flatten() {
        let device = DeviceStencils::new(engine, &forward.surface().cast()).unwrap();
        // Awkward sizes; several steps only where rows and points are as many.
        for n in [0usize, 1, 63, 64, 65, 3001] {
            for own in if n > 100 { &[0.0, 0.4][..] } else { &[0.4] } {
                let (points, rows) = (model.points(n), rows(n, *own));
                let steps = device.steps(&points, &rows, &points, 3, &|p, r| rest(p, &rows, r)).unwrap();
                assert_eq!(steps.len(), 3);
                let mut before = points;
                for now in steps {
                    assert_eq!(now.len(), n);
                    assert!(apart(&model, &forward, &before, &rows, &now) <= 0.002, "{n} rows");
                    assert!(now.iter().all(|p| p.is_valid(&model.mesh, 0.0)));
                    before = now;
                }
            }
        }
        // The comparison rejects what is a hundredth of the weight off.
        let (points, mut wrong) = (model.points(600), rows(600, 0.4));
        let right = wrong.clone();
        wrong.scale(|_, _| 0.99);
        let found = device.steps(&points, &wrong, &points, 1, &|p, r| rest(p, &wrong, r)).unwrap();
        assert!(apart(&model, &forward, &points, &right, &found[0]) > 0.1);
    }
    assert!(DeviceStencils::obstacle(&Engine::cpu(), 8).is_some());
    assert!(DeviceStencils::new(&Engine::cpu(), &forward.surface().cast()).is_err());
}

#[test]
fn what_the_kernels_leave_is_found_by_the_reference_in_every_step() {
    let Some(engine) = engine() else { return };
    let model = Model::of(plane_grid(16, 16, 1.0, 1.0, Diagonal::Alternating));
    let forward = Forward::<8>::new(model.shape()).unwrap();
    let device = DeviceStencils::new(engine, &forward.surface().cast()).unwrap();
    let points = model.points(300);
    // One row overshoots by a weight of forty, far beyond the boundary, where there is no
    // projection.
    let mut rows = rows(300, 0.0);
    rows.scale(|own, _| if own == 100 { -40.0 } else { 1.0 });
    let asked = std::sync::atomic::AtomicUsize::new(0);
    let rest = |p: &[SurfacePoint], r: usize| {
        asked.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        forward.average_row(p, &rows, r).point
    };
    let steps = device.steps(&points, &rows, &points, 3, &rest).unwrap();
    let mut before = points.clone();
    for now in &steps {
        assert!(apart(&model, &forward, &before, &rows, now) <= 0.01);
        before.clone_from(now);
    }
    assert!(asked.load(std::sync::atomic::Ordering::Relaxed) > 0, "nothing was left");
    // Nothing depends on whether steps go together.
    let mut one = points;
    for now in &steps {
        one = device.steps(&one, &rows, &one.clone(), 1, &rest).unwrap().remove(0);
        let far = one.iter().zip(now).filter(|(a, b)| model.distance(a, b) > 1e-3).count();
        assert!(far <= 3, "{far}");
    }
}

#[test]
fn remeshing_on_a_device_is_remeshing() {
    let Some(engine) = engine() else { return };
    let model = Model::new();
    let coarse = torus(1.0, 0.4, 12, 8, Diagonal::Forward);
    let mut builder = MeshBuilder::new("ring");
    builder.mesh.positions = coarse.positions;
    for (i, j) in (0..8u32).flat_map(|j| (0..12u32).map(move |i| (i, j))) {
        let v = |i: u32, j: u32| Corner { vertex: (j % 8) * 12 + i % 12, texcoord: NONE, normal: NONE };
        builder.polygon([v(i, j), v(i + 1, j), v(i + 1, j + 1), v(i, j + 1)]);
    }
    let base = builder.build().unwrap();
    for evenness in [Evenness::Fixed(0.0), Evenness::Auto] {
        let options = RemeshOptions { levels: 3, smooth: 3, evenness, ..RemeshOptions::default() };
        let mut remesher = Remesher::new(model.shape(), &base, &options).unwrap();
        let truth = remesher.frame().unwrap().to_vec();
        let steps = remesher.report().rest_lengths;
        assert_eq!(remesher.compute_on(engine).unwrap(), None);
        let found = remesher.frame().unwrap().to_vec();
        let report = remesher.report();
        assert_eq!((report.turned, report.rest_lengths), ([Turned::default(); 2], steps));
        assert!(report.distances.vertices < 1e-14);
        let far = truth.iter().zip(&found).map(|(a, b)| model.distance(a, b)).fold(0.0, f64::max);
        assert!(far > 0.0 && far < 1e-3, "{far}");
    }
}
