//! Maps between surfaces.

use super::{Check, Outcome, Scene, Timed, outcome, quantile, timed};
use crate::engine::Engine;
use crate::error::Result;
use crate::geometry::SurfacePoint;
use crate::models::shapes::Random;
use crate::surface::correspondence::{CorrespondenceOptions, Method, WeightedAverages};
use crate::surface::field::{Field, FieldOptions};
use crate::surface::forward::Forward;
use crate::surface::gpu::{DeviceMap, DeviceStencils, HostMap};
use crate::surface::stencils::Stencils;
use crate::surface::vector::distance_squared;
use crate::surface::{PackedImage, PackedPoint, PhongSurface, PointMap};

/// 99 of 100 points are nearer to the truth than this, in mean edges: an image of a point is a root
/// that single precision finds within some hundred roundings of the size of a mesh, which has a
/// hundred edges.
pub const MOST_APART: f64 = 5e-5;

const UNIT: &str = "mean edges, 99 of 100 points";

pub(super) const CHECKS: &[Check] = &[
    Check {
        name: "map by field",
        kernels: &["interpolate_field", "project_phong", "search_phong"],
        unit: UNIT,
        tolerance: MOST_APART,
        measure: field,
    },
    Check {
        name: "map by averages",
        kernels: &["average_anchors", "project_phong", "search_phong"],
        unit: UNIT,
        tolerance: MOST_APART,
        measure: averages,
    },
    Check {
        name: "map by transport",
        kernels: &["average_anchors", "project_phong", "search_phong"],
        unit: UNIT,
        tolerance: MOST_APART,
        measure: transport,
    },
    Check {
        name: "averages of points",
        kernels: &["average_stencils", "project_phong", "search_phong"],
        unit: UNIT,
        tolerance: MOST_APART,
        measure: stencils,
    },
];

const POINTS: usize = 40_000;

fn field(engine: &Engine) -> Result<Outcome> {
    let scene = Scene::new(93, 1.0);
    let (source, target) = scene.shapes();
    let made = Field::<f32, 12>::new::<8>(source, target, &scene.anchors, &FieldOptions::default())?;
    let truth = made.in_double();
    let map = DeviceMap::<Field<f32, 12>>::new(engine, made)?;
    compare(&map, |p| truth.map_point(p), truth.source(), &scene)
}

fn averages(engine: &Engine) -> Result<Outcome> {
    weighted(engine, Method::Averages)
}

fn transport(engine: &Engine) -> Result<Outcome> {
    weighted(engine, Method::Transport)
}

fn weighted(engine: &Engine, method: Method) -> Result<Outcome> {
    let scene = Scene::new(93, 1.0);
    let (source, target) = scene.shapes();
    let options = CorrespondenceOptions { method, ..CorrespondenceOptions::default() };
    let made = WeightedAverages::<f32, 8>::new(source, target, &scene.anchors, &options)?;
    let truth = WeightedAverages::<f64, 8>::new(source, target, &scene.anchors, &options)?;
    let map = DeviceMap::<WeightedAverages<f32, 8>>::new(engine, made)?;
    compare(&map, |p| truth.map_point(p), &truth.source, &scene)
}

/// Each point moves into the middle of five others near it.
fn stencils(engine: &Engine) -> Result<Outcome> {
    let scene = Scene::new(0, 1.0);
    let (shape, _) = scene.shapes();
    let forward = Forward::<8>::new(shape)?;
    let surface = forward.surface();
    let device = DeviceStencils::new(engine, &surface.cast())?;
    let count = shape.mesh.vertex_count() * 6;
    let mut random = Random::new(11);
    let points: Vec<SurfacePoint> = (0..count)
        .map(|i| {
            let fan = shape.topology.vertex_triangles((i / 6) as u32);
            let (a, b) = (random.unit(), random.unit());
            SurfacePoint::new(fan[i % fan.len()], [a * b, a * (1.0 - b), 1.0 - a])
        })
        .collect();
    let mut rows = Stencils::default();
    for r in 0..count as u32 {
        let first = r / 6 * 6;
        rows.push(r, (first..first + 6).filter(|&i| i != r), 1.0);
    }
    let rest = |points: &[SurfacePoint], r: usize| forward.average_row(points, &rows, r).point;
    let found = timed(|| device.steps(&points, &rows, &points, 1, &rest))?;
    let expected = timed(|| Ok(forward.averages(&points, &rows).iter().map(|a| a.point).collect::<Vec<_>>()))?;
    let pairs = found.value.iter().flatten().zip(&expected.value);
    let apart = pairs.map(|(a, b)| distance_squared(&surface.embed(a), &surface.embed(b)).sqrt()).collect();
    Ok(outcome(&found, &expected, quantile(apart, 0.99)))
}

/// A map on a device and on the CPU against the truth at random points and at anchors.
fn compare<M: HostMap, const D: usize>(
    map: &DeviceMap<M>,
    truth: impl Fn(PackedPoint) -> PackedImage,
    surface: &PhongSurface<f64, D>,
    scene: &Scene,
) -> Result<Outcome> {
    let points = scene.points(POINTS);
    let run = |map: &dyn PointMap| -> Result<Timed<Vec<PackedImage>>> {
        timed(|| {
            let mut images = Vec::new();
            map.map(&points, &mut images)?;
            Ok(images)
        })
    };
    let (found, on_cpu) = (run(map)?, run(map.reference())?);
    // The truth is slow: one point in ten.
    let some = || points.iter().zip(&found.value).step_by(10);
    let apart = some().map(|(p, image)| apart(surface, image, &truth(*p))).collect();
    Ok(outcome(&found, &on_cpu, quantile(apart, 0.99)))
}

/// The distance of two images in the embedding; infinite where only one of them is there.
fn apart<const D: usize>(surface: &PhongSurface<f64, D>, a: &PackedImage, b: &PackedImage) -> f64 {
    let place = |i: &PackedImage| i.point().map(|p| surface.embed(&p));
    match (place(a), place(b)) {
        (Some(a), Some(b)) => distance_squared(&a, &b).sqrt(),
        (None, None) => 0.0,
        _ => f64::INFINITY,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::Status;

    #[test]
    fn images_beside_the_truth_and_lost_ones_are_seen() {
        let scene = Scene::new(20, 1.0);
        let (source, target) = scene.shapes();
        let map = Field::<f64, 12>::new::<8>(source, target, &scene.anchors, &FieldOptions::default()).unwrap();
        let image = map.map_point(scene.points(30)[25]);
        let surface = map.source();
        assert_eq!(apart(surface, &image, &image), 0.0);
        let mut moved = image;
        moved.b0 += 0.01 * if moved.b0 > 0.5 { -1.0 } else { 1.0 };
        assert!(apart(surface, &moved, &image) > MOST_APART);
        let lost = PackedImage { face: crate::geometry::NONE, status: Status::Failed as u32, ..image };
        assert_eq!(apart(surface, &lost, &image), f64::INFINITY);
    }
}
