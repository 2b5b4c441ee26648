//! The sweep against the scalar weights, on the scenes of [`super::tests`].

use super::tests::{CONDITION, Random, Scene, TERMS, cast, distance};
use super::*;
use crate::engine::{LaneScalar, Lanes, TILE};

/// What the sweep says about each query.
struct Swept<const D: usize> {
    mean: Vec<[f64; D]>,
    own: Vec<[f64; D]>,
}

/// Both images of every query, padded with zeros to whole tiles, and the first image alone, which
/// must be the same.
fn sweep<E: LaneScalar, const D: usize>(
    lanes: Lanes,
    table: &AnchorTable<f64, D>,
    queries: &[([f64; D], [[f64; D]; 2])],
) -> Swept<D> {
    let table = table.cast::<E>();
    let tiles = queries.len().div_ceil(TILE);
    let mut input = vec![E::ZERO; tiles * 3 * D * TILE];
    for (i, (y, [b0, b1])) in queries.iter().enumerate() {
        for (row, x) in y.iter().chain(b0).chain(b1).enumerate() {
            input[i / TILE * 3 * D * TILE + row * TILE + i % TILE] = E::of(*x);
        }
    }
    let mut both = vec![E::ZERO; tiles * 2 * D * TILE];
    let mut one = vec![E::ZERO; tiles * D * TILE];
    let images = [table.image.as_slice(), table.own.as_slice()];
    let anchors = SweepAnchors { own: &table.own, images: &images, transport: None };
    average_tiles(lanes, anchors, &input, &mut both);
    average_tiles(lanes, SweepAnchors { images: &images[..1], ..anchors }, &input, &mut one);
    assert!(both.iter().all(|x| x.finite()), "padding and queries give finite numbers");
    // Tiles of 2 D rows are pairs of tiles of D rows.
    let at = |tiles: &[E], i: usize| point_of::<E, D>(tiles, i).map(|x| x.to_f64());
    let pair = |i: usize, set: usize| (i / TILE * 2 + set) * TILE + i % TILE;
    let all = 0..queries.len();
    for i in all.clone() {
        assert_eq!(at(&both, pair(i, 0)), at(&one, i));
    }
    Swept { mean: all.clone().map(|i| at(&one, i)).collect(), own: all.map(|i| at(&both, pair(i, 1))).collect() }
}

/// Error of the sweep for images of size 1, in epsilons: as for the weights themselves.
const SWEEP_TOLERANCE: f64 = CONDITION * TERMS;

/// The first query for which the sweep differs from the weights in f64 by more than `tolerance`.
fn first_difference<const D: usize>(scene: &Scene<D>, swept: &Swept<D>, tolerance: f64) -> Option<String> {
    let table = &scene.table;
    for (i, (y, basis)) in scene.queries.iter().enumerate() {
        let mut w = vec![0.0; table.len()];
        weights(y, basis, &table.own, &mut w);
        let mass: f64 = w.iter().map(|w| w.abs()).sum();
        let mean = |image: &[[f64; D]]| -> [f64; D] {
            std::array::from_fn(|k| w.iter().zip(image).map(|(w, v)| w * v[k]).sum())
        };
        let errors =
            [distance(&mean(&table.image), &swept.mean[i]), distance(&mean(&table.own), &swept.own[i]) / scene.scale];
        if let Some(error) = errors.iter().find(|e| e.is_nan() || **e > tolerance * mass) {
            return Some(format!("query {i}: {error:e} with weights of mass {mass}"));
        }
    }
    None
}

fn check<E: LaneScalar, const D: usize>(scene: &Scene<D>) {
    for lanes in [Lanes::detect(), Lanes::scalar()] {
        let mut swept = sweep::<E, D>(lanes, &scene.table, &scene.queries);
        let tolerance = SWEEP_TOLERANCE * E::EPSILON.to_f64();
        if let Some(difference) = first_difference(scene, &swept, tolerance) {
            panic!("{} of {}, {} anchors: {difference}", lanes.name(), std::any::type_name::<E>(), scene.table.len());
        }
        // The comparator must see one component of one point of either average off.
        if let Some(last) = swept.mean.last_mut() {
            last[D - 1] += 0.1;
            assert!(first_difference(scene, &swept, tolerance).is_some());
            swept = sweep::<E, D>(lanes, &scene.table, &scene.queries);
            swept.own[0][0] -= 0.1 * scene.scale;
            assert!(first_difference(scene, &swept, tolerance).is_some());
        }
    }
}

#[test]
fn lanes_give_the_scalar_weights() {
    for queries in [0, 1, 63, 64, 65, 200] {
        check::<f64, 8>(&Scene::new(93, queries, 1.0, 50));
        check::<f32, 8>(&Scene::new(93, queries, 1.0, 51));
    }
    for n in [1, 2, 3, 9, 27, 300] {
        check::<f64, 8>(&Scene::new(n, 100, 1.0, 52));
    }
    check::<f64, 4>(&Scene::new(40, 70, 1.0, 53));
    check::<f64, 12>(&Scene::new(40, 70, 1.0, 54));
    check::<f32, 16>(&Scene::new(40, 70, 1.0, 55));
}

#[test]
fn lanes_hold_near_anchors_and_at_any_scale() {
    for scale in [1e-3, 1.0, 1e3] {
        for near in [1e-3, 1e-2, 0.1] {
            check::<f64, 8>(&Scene::new(93, 186, scale, 60).near(near, 61));
            check::<f32, 8>(&Scene::new(93, 186, scale, 60).near(near, 62));
        }
    }
}

/// Errors of f32 lanes against f64, in units of the images' size: notes of the prototype's
/// measurements, doubled.
const F32_MEDIAN: f64 = 2e-7;
const F32_MOST: f64 = 1e-6;
const F32_WORST: f64 = 4e-6;

#[test]
fn single_precision_is_as_good_as_was_measured() {
    let scene = Scene::<8>::new(93, 4000, 1.0, 70);
    let swept = sweep::<f32, 8>(Lanes::detect(), &scene.table, &scene.queries);
    let truth = sweep::<f64, 8>(Lanes::scalar(), &scene.table, &scene.queries);
    let mut errors: Vec<f64> = swept.mean.iter().zip(&truth.mean).map(|(a, b)| distance(a, b)).collect();
    errors.sort_by(f64::total_cmp);
    let [median, most, worst] = [0.5, 0.99, 1.0].map(|f| errors[((errors.len() - 1) as f64 * f) as usize]);
    eprintln!("f32 lanes: median {median:.1e}, 99 % {most:.1e}, max {worst:.1e}");
    assert!(median <= F32_MEDIAN && most <= F32_MOST && worst <= F32_WORST, "{median:e} {most:e} {worst:e}");
}

fn check_anchors<E: LaneScalar>() {
    for scale in [1e-3, 1.0, 1e3] {
        let mut scene = Scene::<8>::new(40, 40, scale, 80).near(0.0, 1);
        // Two places with several anchors: the lowest index wins.
        scene.table.own[39] = scene.table.own[0];
        scene.table.own[38] = scene.table.own[0];
        scene.table.own[20] = scene.table.own[10];
        for lanes in [Lanes::detect(), Lanes::scalar()] {
            let table = &scene.table;
            let swept = sweep::<E, 8>(lanes, table, &scene.queries);
            for i in (0..38).filter(|&i| i != 20) {
                let expected = cast::<E, 8>(&table.image[i]).map(|x| x.to_f64());
                assert_eq!(swept.mean[i], expected, "anchor {i}");
                assert_eq!(swept.own[i], table.own[i]);
            }
        }
    }
}

#[test]
fn lanes_are_exact_on_anchors() {
    check_anchors::<f32>();
    check_anchors::<f64>();
}

#[test]
fn lanes_survive_degenerate_anchors() {
    let mut scene = Scene::<8>::new(12, 100, 1.0, 90);
    let line = |s: f64| -> [f64; 8] { std::array::from_fn(|k| 0.3 * s + 0.1 * k as f64) };
    let all = |table: &mut AnchorTable<f64, 8>, f: &dyn Fn(usize) -> [f64; 8]| {
        table.own = (0..12).map(f).map(|v| v.map(|x| f64::from(x as f32))).collect();
    };
    for case in 0..3 {
        all(&mut scene.table, &|i| match case {
            0 => line(i as f64 / 6.0 - 1.0),
            1 => line(0.0),
            _ => line((i % 2) as f64),
        });
        for lanes in [Lanes::detect(), Lanes::scalar()] {
            let swept = sweep::<f32, 8>(lanes, &scene.table, &scene.queries);
            assert!(swept.mean.iter().flatten().all(|x| x.abs() < 100.0), "case {case}");
        }
        // Decided alike by the scalar weights; in f64 the line is as straight as f32 made it.
        let swept = sweep::<f64, 8>(Lanes::detect(), &scene.table, &scene.queries);
        assert_eq!(first_difference(&scene, &swept, 1e-3), None, "case {case}");
    }
}

#[test]
fn a_point_gives_the_same_bytes_in_any_place_of_a_tile() {
    let scene = Scene::<8>::new(27, 1, 1.0, 95);
    let mut random = Random(3);
    let queries: Vec<_> = (0..TILE + 3)
        .map(|i| {
            let mut query = scene.queries[0];
            if i % 5 != 0 {
                query.0[2] += 0.1 * random.next();
            }
            query
        })
        .collect();
    let swept = sweep::<f32, 8>(Lanes::detect(), &scene.table, &queries);
    for i in (0..queries.len()).step_by(5) {
        assert_eq!(swept.mean[i], swept.mean[0]);
    }
}
