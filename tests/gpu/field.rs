//! Fields on a device against their reference.

use barymap::engine::Engine;
use barymap::surface::correspondence::{CorrespondenceOptions, Method};
use barymap::surface::field::{Field, FieldOptions};
use barymap::surface::gpu::{DeviceMap, correspondence_on};
use barymap::surface::vector::distance_squared;
use barymap::surface::{PackedPoint, PointMap};

use crate::surface::{P99, Scene, check};
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
    agree(engine, &Scene::real());
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
        // The relaxation holds anchors by a stiffness of 1e6 mean masses, so that they give way by that part of what pulls.
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
