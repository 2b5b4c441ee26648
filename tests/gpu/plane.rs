//! The kernels of maps in the plane, against double precision and against the CPU.

use barymap::engine::{Backend, Engine, EngineOptions};
use barymap::geometry::Polygon;
use barymap::mapping::plane::gpu::MOST_VERTICES;
use barymap::mapping::plane::{
    Coordinates, Frame, Minimum, SampleOptions, Step, jacobian_min, map_points, map_points_with_derivatives,
};
use barymap::models::polygons;
use glam::DVec2;

use crate::plane_cases::{Case, check_accuracy, drift, fault, mapped, notched, path, points, to_regular};
use crate::{downlevel, engine};

fn engines() -> Vec<&'static Engine> {
    [engine(), downlevel()].into_iter().flatten().collect()
}

#[test]
fn the_kernel_keeps_the_bounds_of_single_precision() {
    engines().into_iter().for_each(check_accuracy);
}

#[test]
fn polygons_of_several_blocks_are_mapped() {
    let Some(engine) = engine() else { return };
    for n in [1023, 1024, 1025, 2049, MOST_VERTICES, MOST_VERTICES + 1] {
        // An odd number has two tips side by side: the deep notches are for the even ones.
        for depth in [0.001, 0.15].into_iter().take(if n % 2 == 0 { 2 } else { 1 }) {
            let case = Case::new(&format!("star {n}"), &notched(n, depth), 1.0, DVec2::ZERO);
            let points = points(&case, 6);
            let found = mapped(engine, &case.step, &points.inside);
            assert_eq!(fault(&case, &points, &found), None);
        }
    }
}

#[test]
fn every_count_of_points_is_mapped_and_nothing_is_left_over() {
    let case = Case::new("regular 8", &to_regular(8), 1.0, DVec2::ZERO);
    for engine in engines() {
        // Around the points of an invocation, of a group, and of a tile.
        for count in [0, 1, 3, 4, 5, 255, 256, 257, (1 << 18) + 1] {
            let points: Vec<[f32; 2]> = (0..count).map(|i| [(i % 701) as f32 / 1402.0 - 0.25, 0.1]).collect();
            let found = mapped(engine, &case.step, &points);
            let on_cpu = mapped(&Engine::cpu(), &case.step, &points);
            for i in 0..count {
                let off = (0..2).map(|k| (found.images[i][k] - on_cpu.images[i][k]).abs()).fold(0.0, f32::max);
                assert!(off <= 5e-7, "point {i} of {count} is off by {off}");
            }
            let again = mapped(engine, &case.step, &points);
            assert!(found.images == again.images && found.derivatives == again.derivatives, "not the same bytes");
        }
    }
}

#[test]
fn steps_are_composed_in_one_go() {
    let Some(engine) = engine() else { return };
    // One, an odd and an even number of steps end in different buffers.
    for steps in [1, 2, 5] {
        let polygons = path(8, steps);
        let scale = Frame::common_scale(&polygons);
        let chain: Vec<Step<f32>> =
            polygons.windows(2).map(|p| Step::new(Coordinates::MeanValue, &p[0], &p[1], scale)).collect();
        let start: Vec<[f32; 2]> = (0..100).map(|i| [i as f32 / 400.0 - 0.1, 0.05]).collect();
        let run = |engine: &Engine| {
            let (mut images, mut derivatives) = (start.clone(), vec![[[0.0; 2]; 2]; start.len()]);
            map_points_with_derivatives(engine, &chain, &mut images, &mut derivatives).unwrap();
            (images, derivatives)
        };
        let (images, derivatives) = run(engine);
        let (truth, slopes) = run(&Engine::reference());
        for i in 0..start.len() {
            for row in 0..2 {
                assert!((images[i][row] - truth[i][row]).abs() < 1e-6, "{steps} steps, point {i}");
                for axis in 0..2 {
                    assert!(
                        (derivatives[i][row][axis] - slopes[i][row][axis]).abs() < 1e-5,
                        "{steps} steps, point {i}"
                    );
                }
            }
        }
    }
    for (n, steps) in [(8, 512), (64, 64)] {
        let found = drift(engine, n, steps) * 4096.0;
        assert!(found <= 0.05 * steps as f64 / 512.0, "{n} vertices, {steps} steps: {found} pixels");
    }
}

fn near(a: &Minimum, b: &Minimum) -> bool {
    (a.value - b.value).abs() <= 1e-7 * b.value.abs().max(1.0) && a.kind == b.kind
}

#[test]
fn minima_are_those_of_double_precision_at_every_resolution() {
    let wide = |pair: polygons::PolygonPair| (pair.source, pair.target);
    let mut pairs: Vec<(Polygon, Polygon)> = [
        polygons::inverted_star(),
        polygons::twisted_star(),
        polygons::nested_squares(),
        polygons::convex_witness(),
        to_regular(64),
    ]
    .map(wide)
    .to_vec();
    pairs.extend([0.1, 0.5469, 0.547, 0.995].map(|s| wide(polygons::square_corner(s))));
    for engine in engines() {
        for resolution in [32, 64, 200] {
            let options = SampleOptions { resolution };
            let found = jacobian_min(engine, Coordinates::MeanValue, &pairs, &options).unwrap();
            let truth = jacobian_min(&Engine::reference(), Coordinates::MeanValue, &pairs, &options).unwrap();
            assert_eq!(found.len(), pairs.len());
            for (k, (a, b)) in found.iter().zip(&truth).enumerate() {
                assert!(near(a, b), "pair {k} at {resolution}: {a:?} for {b:?}");
            }
            for (s, a) in [0.1, 0.5469, 0.547, 0.995].iter().zip(&found[5..]) {
                assert!((a.value - (1.0 - (8f64.sqrt() - 1.0) * s)).abs() < 1e-6, "s = {s}: {a:?}");
            }
            let again = jacobian_min(engine, Coordinates::MeanValue, &pairs, &options).unwrap();
            assert_eq!(found, again);
        }
    }
    // More vertices than one block holds.
    if let Some(engine) = engine() {
        let pairs = [wide(to_regular(1100))];
        let options = SampleOptions { resolution: 40 };
        let found = jacobian_min(engine, Coordinates::MeanValue, &pairs, &options).unwrap();
        let truth = jacobian_min(&Engine::reference(), Coordinates::MeanValue, &pairs, &options).unwrap();
        assert!(near(&found[0], &truth[0]), "{found:?} for {truth:?}");
    }
    let spoilt = Minimum { value: 0.5, at: DVec2::ZERO, kind: barymap::mapping::plane::MinimumKind::Vertex };
    assert!(!near(&spoilt, &Minimum { value: 0.500001, ..spoilt }), "a wrong minimum passes");
}

#[test]
fn what_the_kernels_do_not_do_the_cpu_does() {
    let Some(engine) = engine() else { return };
    let pair = polygons::convex_witness();
    let pairs = [(pair.source.clone(), pair.target.clone())];
    let options = SampleOptions::default();
    let found = jacobian_min(engine, Coordinates::Wachspress, &pairs, &options).unwrap();
    let truth = jacobian_min(&Engine::reference(), Coordinates::Wachspress, &pairs, &options).unwrap();
    assert!(near(&found[0], &truth[0]) && found[0].value > 0.0, "{found:?} {truth:?}");
    let kept = EngineOptions {
        backend: Backend::Gpu,
        cpu_stages: vec!["map_points".into(), "jacobian_min".into()],
        ..EngineOptions::default()
    };
    let on_cpu = Engine::new(kept).unwrap();
    let step = Step::<f32>::new(Coordinates::MeanValue, &pair.source, &pair.target, 0.5);
    let (mut a, mut b) = ([[0.1, 0.2]], [[0.1, 0.2]]);
    map_points(&on_cpu, std::slice::from_ref(&step), &mut a).unwrap();
    map_points(&Engine::cpu(), std::slice::from_ref(&step), &mut b).unwrap();
    assert_eq!(a, b);
}
