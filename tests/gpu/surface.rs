//! The kernels of the main job against their references.

use barymap::conformance::{MOST_APART, Scene, Surface};
use barymap::engine::Engine;
use barymap::geometry::sampling::farthest_points;
use barymap::geometry::{Geodesics, SurfacePoint, Topology};
use barymap::progress::Quiet;
use barymap::surface::anchors::vertex_point;
use barymap::surface::correspondence::{CorrespondenceOptions, Method, WeightedAverages};
use barymap::surface::gpu::{DeviceMap, HostMap, correspondence_on};
use barymap::surface::vector::distance_squared;
use barymap::surface::{
    AnchorPairs, Embedding, EmbeddingOptions, PackedImage, PackedPoint, PhongSurface, PointMap, Status,
};

use crate::{downlevel, engine};

/// The SMPL pair with 93 vertices far from one another as anchors.
pub(crate) fn real() -> Scene {
    pair("gt/smpl_same/man.obj", "gt/smpl_same/woman.obj", 93)
}

/// Two meshes of the same connectivity, with so many vertices far from one another as anchors.
pub(crate) fn pair(source: &str, target: &str, anchors: usize) -> Scene {
    let read = |file: &str| {
        let folder = std::env::var_os("BARYMAP_DATA").expect("BARYMAP_DATA names the folder of real models");
        let path = std::path::Path::new(&folder).join(file);
        let mesh = barymap::io::read_mesh(path).unwrap().mesh;
        let topology = Topology::new(&mesh);
        let options = EmbeddingOptions { landmarks: 1000, ..EmbeddingOptions::default() };
        let embedding = Embedding::compute(&mesh, &topology, &options, &Quiet).unwrap();
        (mesh, topology, embedding)
    };
    let (source, target) = (read(source), read(target));
    let vertices = farthest_points(&Geodesics::new(&target.0.positions, &target.0.triangles()).unwrap(), 0, anchors);
    let on = |side: &Surface| -> Vec<SurfacePoint> {
        vertices.iter().map(|&v| vertex_point(&side.0, &side.1, v, "anchor").unwrap()).collect()
    };
    let anchors = AnchorPairs { source: on(&source), target: on(&target) };
    Scene { source, target, anchors }
}

fn options(method: Method, confidence: bool) -> CorrespondenceOptions {
    CorrespondenceOptions { method, confidence, ..Default::default() }
}

fn on_device(scene: &Scene, engine: &Engine, options: &CorrespondenceOptions) -> DeviceMap<WeightedAverages<f32, 8>> {
    let (source, target) = scene.shapes();
    let map = WeightedAverages::new(source, target, &scene.anchors, options).unwrap();
    DeviceMap::<WeightedAverages<f32, 8>>::new(engine, map).unwrap()
}

/// How two maps of the same points differ, in mean edges of the source.
#[derive(Debug, Default)]
pub(crate) struct Comparison {
    distances: Vec<f64>,
    other_decisions: usize,
    pub(crate) other_statuses: usize,
}

/// Compares images with the double-precision truth. Images on different triangles count as one
/// decision if they are the same place: a root on an edge belongs to both.
pub(crate) fn compare<const D: usize>(
    (truth, surface): (&dyn Fn(PackedPoint) -> PackedImage, &PhongSurface<f64, D>),
    points: &[PackedPoint],
    images: &[PackedImage],
) -> Comparison {
    assert_eq!(points.len(), images.len());
    let mut c = Comparison::default();
    for (point, image) in points.iter().zip(images) {
        let expected = truth(*point);
        let place = |i: &PackedImage| i.point().map(|p| surface.embed(&p));
        match (place(image), place(&expected)) {
            (Some(a), Some(b)) => {
                let d = distance_squared(&a, &b).sqrt();
                if image.face == expected.face || d < 1e-3 { c.distances.push(d) } else { c.other_decisions += 1 }
            }
            (None, None) => {}
            _ => c.other_decisions += 1,
        }
        c.other_statuses += usize::from(image.status != expected.status);
    }
    c.distances.sort_by(f64::total_cmp);
    c
}

fn quantile(sorted: &[f64], q: f64) -> f64 {
    sorted[((sorted.len() - 1) as f64 * q) as usize]
}

/// 99 of 100 points are nearer to the truth than this, in mean edges.
pub(crate) const P99: f64 = MOST_APART;

/// `statuses`: how many single precision itself judges differently, on the CPU.
pub(crate) fn judge(c: &Comparison, points: usize, statuses: usize, p99: f64) -> Result<(), String> {
    let ok = c.other_decisions * 1000 <= points
        && c.other_statuses * 1000 <= points + 1000 * statuses
        && !c.distances.is_empty()
        && quantile(&c.distances, 0.5) <= 5e-6
        && quantile(&c.distances, 0.99) <= p99
        && quantile(&c.distances, 1.0) <= 1e-3;
    let summary = format!(
        "median {:.1e}, 99 % {:.1e}, largest {:.1e} mean edges; {} of {points} decided differently, {} judged differently",
        quantile(&c.distances, 0.5),
        quantile(&c.distances, 0.99),
        quantile(&c.distances, 1.0),
        c.other_decisions,
        c.other_statuses
    );
    eprintln!("{summary}");
    if ok { Ok(()) } else { Err(summary) }
}

#[test]
fn the_kernels_agree_with_double_precision() {
    for engine in [engine(), downlevel()].into_iter().flatten() {
        for (method, anchors, scale) in
            [(Method::Averages, 27, 1e-3), (Method::Averages, 93, 1.0), (Method::Transport, 93, 1e3)]
        {
            agree(engine, &Scene::new(anchors, scale), method, P99);
        }
    }
}

#[test]
fn anchors_of_several_blocks_agree_with_double_precision() {
    let Some(engine) = engine() else { return };
    // One block is 256 anchors: the last of one, the first of two, and four.
    for (method, anchors) in
        [(Method::Averages, 256), (Method::Averages, 257), (Method::Transport, 300), (Method::Transport, 1000)]
    {
        agree(engine, &Scene::new(anchors, 1.0), method, P99);
    }
    let Some(engine) = downlevel() else { return };
    agree(engine, &Scene::new(300, 1.0), Method::Averages, P99);
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn the_kernels_agree_with_double_precision_on_real_embeddings() {
    let Some(engine) = engine() else { return };
    let scene = real();
    agree(engine, &scene, Method::Transport, P99);
    agree(engine, &scene, Method::Averages, P99);
}

/// The kernels' map of 4,000 points against the truth.
fn agree(engine: &Engine, scene: &Scene, method: Method, p99: f64) {
    let options = self::options(method, true);
    let device = on_device(scene, engine, &options);
    let (source, target) = scene.shapes();
    let truth = WeightedAverages::<f64, 8>::new(source, target, &scene.anchors, &options).unwrap();
    let truth: (&dyn Fn(PackedPoint) -> PackedImage, _) = (&|p| truth.map_point(p), &truth.source);
    check(&device, truth, &scene.points(4000), p99);
}

/// A map on a device against the truth, and corrupted maps that must be refused.
pub(crate) fn check<M: HostMap, const D: usize>(
    device: &DeviceMap<M>,
    truth: (&dyn Fn(PackedPoint) -> PackedImage, &PhongSurface<f64, D>),
    points: &[PackedPoint],
    p99: f64,
) {
    let mut images = Vec::new();
    device.map(points, &mut images).unwrap();
    let c = compare(truth, points, &images);
    let mut single = Vec::new();
    device.reference().map(points, &mut single).unwrap();
    let statuses = compare(truth, points, &single).other_statuses;
    judge(&c, points.len(), statuses, p99).unwrap();
    eprintln!("left to the reference: {}", device.left_to_reference());
    // On real embeddings the published averages leave more of them: where the anchors do not cover,
    // nothing is near.
    assert!(device.left_to_reference() * 8 <= points.len() as u64, "the kernels do the work");

    // The comparator must see one image in fifty moved by a hundredth of an edge, and statuses
    // changed.
    let mut moved = images.clone();
    for image in moved.iter_mut().step_by(50) {
        image.b0 += 0.01 * if image.b0 > 0.5 { -1.0 } else { 1.0 };
    }
    assert!(judge(&compare(truth, points, &moved), points.len(), statuses, p99).is_err());
    for image in images.iter_mut().step_by(100) {
        image.status = Status::Failed as u32;
    }
    assert!(judge(&compare(truth, points, &images), points.len(), statuses, p99).is_err());
}

#[test]
fn anchors_go_to_their_partners() {
    let Some(engine) = engine() else { return };
    for (method, anchors) in [(Method::Averages, 60), (Method::Transport, 60), (Method::Transport, 600)] {
        let scene = Scene::new(anchors, 1.0);
        let device = on_device(&scene, engine, &options(method, false));
        let points: Vec<PackedPoint> = scene.anchors.target.iter().map(|p| PackedPoint::from(*p)).collect();
        let mut images = Vec::new();
        device.map(&points, &mut images).unwrap();
        let surface = &device.reference().source;
        for (image, anchor) in images.iter().zip(&scene.anchors.source) {
            let d = distance_squared(&surface.embed(&image.point().unwrap()), &surface.embed(anchor)).sqrt();
            assert!(d <= 2e-5, "{image:?} {anchor:?}: {d}");
        }
    }
}

#[test]
fn four_dimensions_work_on_the_device_too() {
    let Some(engine) = engine() else { return };
    let mut scene = Scene::new(40, 1.0);
    for side in [&mut scene.source, &mut scene.target] {
        side.2.dimension = 4;
        side.2.points = side.2.points.chunks_exact(8).flat_map(|p| [p[0], p[1], p[2], p[6]]).collect();
    }
    let (source, target) = scene.shapes();
    let options = self::options(Method::Transport, true);
    let (map, note) = correspondence_on(engine, source, target, &scene.anchors, &options).unwrap();
    assert_eq!(note, None);
    let truth = WeightedAverages::<f64, 4>::new(source, target, &scene.anchors, &options).unwrap();
    let points = scene.points(1000);
    let mut images = Vec::new();
    map.map(&points, &mut images).unwrap();
    let c = compare((&|p| truth.map_point(p), &truth.source), &points, &images);
    judge(&c, points.len(), 0, P99).unwrap();
}

#[test]
fn awkward_counts_and_several_tiles_give_the_same_bytes() {
    for engine in [engine(), downlevel()].into_iter().flatten() {
        let scene = Scene::new(27, 1.0);
        let device = on_device(&scene, engine, &options(Method::Averages, true));
        // More than the first tile of 4096 and the ones after it.
        let points = scene.points(20_001);
        let mut whole = Vec::new();
        device.map(&points, &mut whole).unwrap();
        for n in [0usize, 1, 2, 63, 64, 65, 127, 128, 129, 4097] {
            let mut part = Vec::new();
            device.map(&points[..n], &mut part).unwrap();
            assert!(part == whole[..n], "{n} points");
        }
    }
}

#[test]
fn points_off_the_target_are_an_error() {
    let Some(engine) = engine() else { return };
    let scene = Scene::new(10, 1.0);
    let device = on_device(&scene, engine, &options(Method::Averages, false));
    let mut images = Vec::new();
    assert!(device.map(&[PackedPoint { face: 1 << 30, b0: 0.0, b1: 0.0 }], &mut images).is_err());
    assert!(DeviceMap::<WeightedAverages<f32, 8>>::obstacle(engine, 12).is_some_and(|why| why.contains("12")));
    assert!(DeviceMap::<WeightedAverages<f32, 8>>::obstacle(&Engine::cpu(), 8).is_some());
    let (source, target) = scene.shapes();
    let options = self::options(Method::Averages, false);
    let map = WeightedAverages::<f32, 8>::new(source, target, &scene.anchors, &options).unwrap();
    assert!(DeviceMap::<WeightedAverages<f32, 8>>::new(&Engine::cpu(), map).is_err());
}
