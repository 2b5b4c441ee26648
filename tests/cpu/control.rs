//! Long work ends where its control says so, whatever it is, and leaves nothing behind.

use std::f64::consts::TAU;

use barymap::control::Control;
use barymap::encoding::{MarchQuality, Quality};
use barymap::engine::Engine;
use barymap::geometry::{Mesh, Topology};
use barymap::io::cache::Cache;
use barymap::mapping::plane::{
    self, CertifyOptions, CompositeMap, PartitionKind, PartitionOptions, PathKind, certify, partition,
};
use barymap::mapping::space;
use barymap::models::shapes::{icosphere, uv_sphere};
use barymap::picture::{Depth, Image};
use barymap::progress::Quiet;
use barymap::surface::anchors::vertex_point;
use barymap::surface::correspondence::{CorrespondenceOptions, Method, Shape, correspondence};
use barymap::surface::{AnchorPairs, Embedding, EmbeddingOptions};
use barymap::tools::anchors::{AnchorOptions, propose};
use barymap::tools::cage::{CageOptions, map_by_cage};
use barymap::tools::deform::{Deformer, Handles};
use barymap::tools::morph::Morpher;
use barymap::tools::remesh::{RemeshOptions, Remesher};
use barymap::tools::transfer::{Fill, Layer, TransferOptions, transfer};
use barymap::tools::warp::{WarpOptions, warp_picture};
use barymap::{Error, Result};
use glam::{DVec2, DVec3};

/// Runs `job` to its end, then ends it at its first check, at its last and at some in between.
///
/// # Panics
/// If it looks fewer than `least` times whether it is to end, goes on where it should not, or gives
/// another result afterwards.
fn ends_anywhere<T: PartialEq>(name: &str, least: u64, job: impl Fn() -> Result<T>) {
    let whole = Control::new();
    let expected = whole.run(&job).unwrap_or_else(|e| panic!("{name}: {e}"));
    let checks = whole.checks();
    assert!(checks >= least, "{name} looks {checks} times, less than {least}");
    for end in [1, 2, checks / 3, checks / 2, checks - checks / 8, checks] {
        let control = Control::new();
        control.cancel_at(end.clamp(1, checks));
        let result = control.run(&job);
        assert!(matches!(result, Err(Error::Cancelled)), "{name} goes on at check {end} of {checks}");
    }
    let again = Control::new().run(&job).unwrap_or_else(|e| panic!("{name}: {e}"));
    assert!(again == expected, "{name} gives another result after it was cancelled");
}

#[test]
#[should_panic(expected = "looks 1 times")]
fn work_that_does_not_look_is_noticed() {
    ends_anywhere("a sum", 2, || Ok((0..10).sum::<u32>()));
}

#[test]
#[should_panic(expected = "goes on at check 2")]
fn work_that_goes_on_is_noticed() {
    let sphere = sphere();
    ends_anywhere("a stubborn transfer", 2, || {
        let _ = transferred(&sphere, Fill::None);
        Ok(())
    });
}

/// A sphere with its embedding, and itself as the target.
struct Sphere {
    mesh: Mesh,
    topology: Topology,
    embedding: Embedding,
}

fn sphere() -> Sphere {
    let mesh = uv_sphere(1.0, 40, 24);
    let topology = Topology::new(&mesh);
    let options = EmbeddingOptions { landmarks: 200, ..EmbeddingOptions::default() };
    let embedding = Embedding::compute(&mesh, &topology, &options, &Quiet).unwrap();
    Sphere { mesh, topology, embedding }
}

impl Sphere {
    fn shape(&self) -> Shape<'_> {
        Shape { mesh: &self.mesh, topology: &self.topology, embedding: Some(&self.embedding) }
    }

    /// Every so many vertices with themselves.
    fn anchors(&self, step: usize) -> AnchorPairs {
        let point = |v: usize| vertex_point(&self.mesh, &self.topology, v as u32, "anchor").unwrap();
        let points: Vec<_> = (0..self.mesh.vertex_count()).step_by(step).map(point).collect();
        AnchorPairs { source: points.clone(), target: points }
    }
}

fn transferred(sphere: &Sphere, fill: Fill) -> Result<(Vec<Image>, Image)> {
    let options = CorrespondenceOptions::default();
    let map = correspondence(sphere.shape(), sphere.shape(), &sphere.anchors(60), &options)?;
    let picture = Image::zeros(64, 64, 3, Depth::U8)?;
    // Bands of few rows.
    let options = TransferOptions { width: 256, height: 256, fill, ..TransferOptions::default() };
    let layers = [Layer::single("colour", &picture)];
    let done = transfer(&sphere.mesh, &layers, &sphere.mesh, map.as_ref(), &options, &Quiet)?;
    Ok((done.layers, done.coverage))
}

#[test]
fn correspondences_and_transfers_end() {
    let sphere = sphere();
    for (method, least) in [(Method::Field, 20), (Method::Averages, 2), (Method::Rbf, 2)] {
        let options = CorrespondenceOptions { method, ..CorrespondenceOptions::default() };
        let points: Vec<_> = sphere.anchors(1).target.into_iter().map(barymap::surface::PackedPoint::from).collect();
        ends_anywhere(method.word(), least, || {
            // One pair is pulled: else there is nothing to do.
            let mut pairs = sphere.anchors(60);
            pairs.source[0] = pairs.source[1];
            let map = correspondence(sphere.shape(), sphere.shape(), &pairs, &options)?;
            let mut images = Vec::new();
            map.map(&points, &mut images)?;
            Ok(images)
        });
    }
    for fill in [Fill::None, Fill::Smooth] {
        ends_anywhere("a transfer", 20, || transferred(&sphere, fill));
    }
}

#[test]
fn embeddings_end() {
    let mesh = icosphere(1.0, 4);
    let topology = Topology::new(&mesh);
    let options = EmbeddingOptions { landmarks: 200, ..EmbeddingOptions::default() };
    ends_anywhere("an embedding", 200, || Ok(Embedding::compute(&mesh, &topology, &options, &Quiet)?.points));
}

#[test]
fn anchors_and_remeshing_end() {
    let sphere = sphere();
    let options = AnchorOptions { connectivity: false, ..AnchorOptions::default() };
    ends_anywhere("proposed anchors", 5, || {
        let seeds = sphere.anchors(250);
        let found = propose(sphere.shape(), sphere.shape(), &seeds, &options, &Quiet)?;
        Ok(found.pairs.iter().map(|p| (p.source, p.target)).collect::<Vec<_>>())
    });
    let base = icosphere(1.0, 1);
    ends_anywhere("a remesh", 5, || {
        let mut remesher = Remesher::new(sphere.shape(), &base, &RemeshOptions::default())?;
        Ok(remesher.frame()?.to_vec())
    });
}

/// A star whose tips turn by `turn`.
fn star(turn: f64) -> Vec<Vec<DVec2>> {
    let at = |k: usize| {
        let (r, turn) = if k.is_multiple_of(2) { (0.48, turn) } else { (0.36, 0.0) };
        DVec2::new(320.0, 200.0) * (DVec2::splat(0.5) + r * DVec2::from_angle(TAU * k as f64 / 16.0 + turn))
    };
    vec![(0..16).map(at).collect()]
}

#[test]
fn warps_and_their_proofs_end() {
    let cage = plane::Cage::new(star(0.0), star(0.3)).unwrap();
    let engine = Engine::cpu();
    let options = PartitionOptions { path: PathKind::Linear, ..PartitionOptions::default() };
    ends_anywhere("a partition", 3, || Ok(partition(&engine, &cage, &options, &Quiet)?.knots));
    let steps = PartitionOptions { kind: PartitionKind::Uniform(4), ..options };
    let found = partition(&engine, &cage, &steps, &Quiet).unwrap();
    ends_anywhere("a certificate", 10, || {
        let [from, to] = [&found.polygons[0], &found.polygons[1]];
        Ok(format!("{:?}", certify(from, to, &CertifyOptions { boxes: 3000, ..CertifyOptions::default() }, &Quiet)?))
    });
    let map = CompositeMap::new(steps.coordinates, found.polygons).unwrap();
    let picture = Image::zeros(320, 200, 3, Depth::U8).unwrap();
    ends_anywhere("a warp", 2, || Ok(warp_picture(&engine, &picture, &map, &WarpOptions::default(), &Quiet)?.image));
}

#[test]
fn cages_and_poses_end() {
    let (inner, outer) = (icosphere(0.5, 3), icosphere(1.0, 1));
    let mut moved = outer.clone();
    moved.positions.iter_mut().for_each(|p| *p += DVec3::new(0.2 * p.y, 0.0, 0.1 * p.x * p.x));
    let cage = space::Cage::new(&outer, &moved).unwrap();
    let options = CageOptions::default();
    ends_anywhere(
        "a cage",
        2,
        || Ok(map_by_cage(&Engine::cpu(), &inner.positions, &cage, &options, &Quiet)?.positions),
    );

    let handles = Handles { vertices: vec![0, 50, 100, 150], region: None };
    let goal: Vec<DVec3> = handles.vertices.iter().map(|&v| inner.positions[v as usize] * 1.3 + DVec3::X).collect();
    ends_anywhere("a pose", 3, || {
        let mut deformer = Deformer::new(&inner, handles.clone(), &Default::default(), &Cache::disabled())?;
        Ok(deformer.deform(&goal, &Quality::DEFAULT, false)?.positions)
    });
    let mut other = inner.clone();
    other.positions.iter_mut().for_each(|p| *p *= DVec3::new(1.0, 1.5, 0.8));
    ends_anywhere("a morph", 3, || {
        let mut morpher = Morpher::new(&[&inner, &other], None, &Default::default())?;
        Ok(morpher.shape(&[0.5, 0.5], &MarchQuality::CONVERGED)?.0)
    });
}
