//! Fields on a device against their reference.

use barymap::conformance::Scene;
use barymap::engine::Engine;
use barymap::geometry::{Mesh, SurfacePoint};
use barymap::surface::correspondence::{CorrespondenceOptions, Method, Shape};
use barymap::surface::field::{Field, FieldOptions};
use barymap::surface::gpu::{DeviceMap, correspondence_on};
use barymap::surface::vector::distance_squared;
use barymap::surface::{PackedImage, PackedPoint, PointMap, Status};

use crate::surface::{P99, check, pair, real};
use crate::{downlevel, engine};

fn field<S: barymap::engine::Real>(scene: &Scene, confidence: bool) -> Field<S, 12> {
    let (source, target) = scene.shapes();
    let options = FieldOptions { confidence, ..FieldOptions::default() };
    Field::new::<8>(source, target, &scene.anchors, &options).unwrap()
}

fn agree(engine: &Engine, scene: &Scene) {
    let made = field::<f32>(scene, true);
    let truth = made.in_double();
    let device = DeviceMap::<Field<f32, 12>>::new(engine, made).unwrap();
    let surface = truth.source();
    check(&device, (&|p| truth.map_point(p), surface), &scene.points(4000), P99);
}

#[test]
fn the_kernels_agree_with_double_precision() {
    for engine in [engine(), downlevel()].into_iter().flatten() {
        for (anchors, scale) in [(27, 1e-3), (93, 1e3)] {
            agree(engine, &Scene::new(anchors, scale));
        }
    }
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn the_kernels_agree_with_double_precision_on_real_embeddings() {
    let Some(engine) = engine() else { return };
    agree(engine, &real());
}

/// Images of one vertex on two back ends may lie this far apart, in mean edges of the source: both
/// are within the slack of a border (psi::slack, twice that part of an edge), and what lies off the
/// surface by half an edge magnifies the rounding of 100 edges in single precision, 1e-5, at most
/// tenfold before a projection is no longer the closest.
const SAME: f64 = 1e-3;

/// How far apart two images are, in mean edges.
fn apart(mesh: &Mesh, a: &PackedImage, b: &PackedImage) -> f64 {
    let place = |i: &PackedImage| i.point().map(|p| p.position(mesh));
    match (place(a), place(b)) {
        (Some(p), Some(q)) => p.distance(q) / mesh.mean_edge_length(),
        (p, q) => {
            if p.is_some() == q.is_some() {
                0.0
            } else {
                f64::INFINITY
            }
        }
    }
}

/// The vertices of which one map is sure and that the other sends elsewhere; and how many neither
/// is sure of.
fn disputed(mesh: &Mesh, a: &[PackedImage], b: &[PackedImage]) -> (Vec<usize>, usize) {
    let valid = |i: &PackedImage| i.status() == Status::Valid;
    let apart = |v: &usize| apart(mesh, &a[*v], &b[*v]) > SAME;
    let disputed = (0..a.len()).filter(apart).filter(|&v| valid(&a[v]) || valid(&b[v])).collect();
    (disputed, (0..a.len()).filter(|&v| !valid(&a[v]) && !valid(&b[v])).count())
}

/// Places at most a thousandth of a triangle away from a vertex, in every triangle around it.
fn places_beside(shape: Shape<'_>, v: u32) -> impl Iterator<Item = SurfacePoint> {
    let faces = (0..shape.mesh.triangle_count() as u32)
        .filter_map(move |t| Some((t, shape.mesh.triangle(t as usize).iter().position(|w| *w == v)?)));
    faces.flat_map(|(t, k)| {
        [1e-6, 1e-5, 1e-4, 1e-3].into_iter().flat_map(move |e| {
            (1..3).map(move |other| {
                let mut x = [0.0; 3];
                (x[k], x[(k + other) % 3]) = (1.0 - e, e);
                SurfacePoint::new(t, x)
            })
        })
    })
}

/// Fields made for themselves in double precision, in single precision and on the device send every
/// vertex to the same place, or to one side of a jump of the map, or none of them vouches for it.
fn back_ends_agree(engine: &Engine, scene: &Scene) {
    let (source, target) = scene.shapes();
    let points: Vec<PackedPoint> = (0..target.mesh.vertex_count() as u32)
        .filter_map(|v| target.topology.vertex_point(v))
        .map(PackedPoint::from)
        .collect();
    let images = |map: &dyn PointMap| {
        let mut images = Vec::new();
        map.map(&points, &mut images).unwrap();
        images
    };
    let exact = field::<f64>(scene, true);
    let reference = images(&exact);
    let cpu = images(&field::<f32>(scene, true));
    let device = images(&DeviceMap::<Field<f32, 12>>::new(engine, field::<f32>(scene, true)).unwrap());
    // Where the predicted place of a vertex has two closest points, equally near, the map jumps:
    // then either side is right. The reference itself is on the other's side at a place nearby.
    let jumps = |v: usize, other: &PackedImage| {
        let beside: Vec<PackedPoint> = places_beside(target, v as u32).map(PackedPoint::from).collect();
        let mut images = Vec::new();
        exact.map(&beside, &mut images).unwrap();
        images.iter().any(|i| apart(source.mesh, i, other) <= SAME)
    };
    for (name, other) in [("cpu", &cpu), ("gpu", &device)] {
        let (mut disputed, unsure) = disputed(source.mesh, &reference, other);
        disputed.retain(|&v| !jumps(v, &other[v]));
        eprintln!("{name}: {} vertices, {unsure} that nothing vouches for", points.len());
        assert!(
            disputed.is_empty(),
            "{name}: {:?}",
            disputed
                .iter()
                .map(|&v| (v, apart(source.mesh, &reference[v], &other[v]), reference[v], other[v]))
                .collect::<Vec<_>>()
        );
    }
    // The comparison sees one vertex that goes elsewhere, and passes over it if neither is sure.
    let sure = (0..points.len()).find(|&v| reference[v].status() == Status::Valid).unwrap();
    let mut moved = reference.clone();
    moved[sure].face = (moved[sure].face + 100) % source.mesh.triangle_count() as u32;
    assert_eq!(disputed(source.mesh, &reference, &moved).0, [sure]);
    assert!(!jumps(sure, &moved[sure]));
    moved[sure].status = Status::Doubtful as u32;
    let mut doubted = reference.clone();
    doubted[sure].status = Status::Doubtful as u32;
    assert!(disputed(source.mesh, &doubted, &moved).0.is_empty());
}

#[test]
fn fields_made_on_any_back_end_agree_at_every_vertex() {
    for engine in [engine(), downlevel()].into_iter().flatten() {
        for anchors in [27, 93] {
            back_ends_agree(engine, &Scene::new(anchors, 1.0));
        }
    }
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn fields_made_on_any_back_end_agree_at_every_vertex_of_real_pairs() {
    let Some(engine) = engine() else { return };
    for (source, target) in [
        ("gt/smpl_same/man.obj", "gt/smpl_same/woman.obj"),
        ("gt/fox_same/fox_run.obj", "gt/fox_same/fox_rest.obj"),
        ("textured/human_female/human_female.obj", "textured/human_male/human_male.obj"),
    ] {
        back_ends_agree(engine, &pair(source, target, 27));
    }
}

#[test]
fn anchors_go_to_their_partners() {
    let Some(engine) = engine() else { return };
    let scene = Scene::new(60, 1.0);
    let device = DeviceMap::<Field<f32, 12>>::new(engine, field(&scene, false)).unwrap();
    let points: Vec<PackedPoint> = scene.anchors.target.iter().map(|p| PackedPoint::from(*p)).collect();
    let mut images = Vec::new();
    device.map(&points, &mut images).unwrap();
    let surface = device.reference().source();
    for (image, anchor) in images.iter().zip(&scene.anchors.source) {
        let d = distance_squared(&surface.embed(&image.point().unwrap()), &surface.embed(anchor)).sqrt();
        // The relaxation holds anchors by a stiffness of 1e6 mean masses, so that they give way by
        // that part of what pulls.
        assert!(d <= 1e-4, "{image:?} {anchor:?}: {d}");
    }
}

#[test]
fn awkward_counts_and_several_tiles_give_the_same_bytes() {
    let Some(engine) = engine() else { return };
    let scene = Scene::new(27, 1.0);
    let (source, target) = scene.shapes();
    let options = CorrespondenceOptions { method: Method::Field, ..Default::default() };
    let (map, note) = correspondence_on(engine, source, target, &scene.anchors, &options).unwrap();
    assert_eq!(note, None);
    assert!(map.field().is_some());
    let points = scene.points(20_001);
    let mut whole = Vec::new();
    map.map(&points, &mut whole).unwrap();
    for n in [0usize, 1, 63, 64, 65, 4097] {
        let mut part = Vec::new();
        map.map(&points[..n], &mut part).unwrap();
        assert!(part == whole[..n], "{n} points");
    }
    assert!(map.map(&[PackedPoint { face: 1 << 30, b0: 0.0, b1: 0.0 }], &mut whole).is_err());
    assert!(DeviceMap::<Field<f32, 12>>::obstacle(&Engine::cpu(), 8).is_some());
    assert!(DeviceMap::<Field<f32, 12>>::new(&Engine::cpu(), field(&scene, false)).is_err());
}
