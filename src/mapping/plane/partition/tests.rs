//! Partitions of the cases whose answers are known.

use glam::{DVec2, dvec2};

use super::super::bounds::LEMMA_2;
use super::super::path::{Linear, VertexPath};
use super::super::testing::{between, hexagons, nested_squares, pairs, square};
use super::super::{Frame, MinimumKind, Step};
use super::*;
use crate::progress::Quiet;

/// Minima at a given resolution, by the reference.
fn found(cage: &Cage, options: &PartitionOptions) -> Partition {
    let mut evaluate =
        |pairs: &[(Polygon, Polygon)]| jacobian_min(&Engine::reference(), options.coordinates, pairs, &options.samples);
    partition_with(&mut evaluate, cage, options, &Quiet).unwrap()
}

fn cage(source: &Polygon, target: &Polygon) -> Cage {
    Cage::new(source.loops().to_vec(), target.loops().to_vec()).unwrap()
}

fn binary(path: PathKind, resolution: u32) -> PartitionOptions {
    PartitionOptions { path, samples: SampleOptions { resolution }, ..PartitionOptions::default() }
}

/// Every step again on a finer grid.
fn does_not_fold(partition: &Partition, resolution: u32) {
    let pairs: Vec<(Polygon, Polygon)> = partition.polygons.windows(2).map(|w| (w[0].clone(), w[1].clone())).collect();
    let minima =
        jacobian_min(&Engine::reference(), Coordinates::MeanValue, &pairs, &SampleOptions { resolution }).unwrap();
    assert!(minima.iter().all(Minimum::positive), "{minima:?}");
}

#[test]
fn nested_squares_take_five_steps() {
    let cage = cage(&nested_squares(0.0), &nested_squares(1.0));
    for resolution in [64, 256] {
        let found = found(&cage, &binary(PathKind::Linear, resolution));
        assert_eq!(found.knots, [0.0, 0.25, 0.5, 0.75, 0.875, 1.0]);
        assert!(!found.folds && found.notes.is_empty() && found.path == PathKind::Linear);
        for (polygon, t) in found.polygons.iter().zip(&found.knots) {
            let expected = between(&cage.source, &cage.target, *t);
            assert!(polygon.vertices().zip(expected.vertices()).all(|(a, b)| (a - b).length() < 1e-15));
        }
        if resolution == 256 {
            does_not_fold(&found, 768);
        }
    }
}

#[test]
fn stored_pairs_take_few_steps_whatever_the_resolution() {
    let mut cases: Vec<(&str, Polygon, Polygon, usize)> =
        pairs().into_iter().zip([4, 4, 5]).map(|((name, a, b), most)| (name, a, b, most)).collect();
    let (a, b) = hexagons();
    cases.push(("hexagons", a, b, 2));
    for (name, a, b, most) in cases {
        for path in [PathKind::Intrinsic, PathKind::Linear] {
            let cage = cage(&a, &b);
            let coarse = found(&cage, &binary(path, 64));
            let fine = found(&cage, &binary(path, 1024));
            assert_eq!(coarse.knots, fine.knots, "{name} {path:?}");
            assert!(fine.steps.len() <= most && !fine.folds && fine.path == path, "{name} {path:?} {:?}", fine.knots);
            does_not_fold(&fine, 768);
        }
    }
}

#[test]
fn uniform_partitions_are_what_they_say() {
    let source = square(0.0);
    let cage = cage(&source, &square(0.8));
    let of = |kind| found(&cage, &PartitionOptions { kind, ..binary(PathKind::Linear, 64) });
    let direct = of(PartitionKind::Direct);
    assert!(direct.knots == [0.0, 1.0] && direct.folds && direct.notes.is_empty());
    assert!((direct.steps[0].minimum.value - (1.0 - (8f64.sqrt() - 1.0) * 0.8)).abs() < 1e-9);
    let three = of(PartitionKind::Uniform(3));
    assert_eq!(three.knots, [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0]);
    let auto = of(PartitionKind::UniformAuto);
    assert!(auto.steps.len() == 16 && !auto.folds, "{}", auto.steps.len());
    assert!(of(PartitionKind::Uniform(8)).folds, "half as many fold");
}

#[test]
fn a_leaf_that_folds_is_not_passed_over() {
    // Along every path, and however often it is halved.
    let cage = cage(&square(0.0), &square(0.5));
    for kind in [PartitionKind::Binary, PartitionKind::UniformAuto, PartitionKind::Continuous] {
        let mut largest = 0;
        let mut evaluate = |pairs: &[(Polygon, Polygon)]| {
            largest = largest.max(pairs.len());
            let folds = |(from, _): &(Polygon, Polygon)| Minimum {
                value: if from == &cage.source { -1.0 } else { 1.0 },
                at: dvec2(0.5, 0.25),
                kind: MinimumKind::Vertex,
            };
            Ok(pairs.iter().map(folds).collect())
        };
        let options = PartitionOptions { kind, eps: 0.25, ..binary(PathKind::Intrinsic, 32) };
        let found = partition_with(&mut evaluate, &cage, &options, &Quiet).unwrap();
        assert!(found.folds && found.path == PathKind::Intrinsic, "{kind:?}");
        assert!(!found.steps[0].minimum.positive() && found.steps[0].to <= 0.25);
        // A continuous partition keeps to its path but for the compatible one.
        let tried = if kind == PartitionKind::Continuous { 2 } else { 3 };
        assert_eq!(found.notes.len(), tried + 1, "one for each path, and what became of them: {:?}", found.notes);
        assert!(found.notes[0].contains("intrinsic path 1 of") && found.notes[0].contains("at (0.500000, 0.250000)"));
        assert!(found.notes[tried].contains("no path avoids folds at eps = 0.25"));
        assert!(largest <= 1024, "{largest} at once");
    }
}

#[test]
fn a_minimum_that_is_nan_or_zero_is_a_fold_and_none_is_asked_for_twice() {
    let cage = cage(&square(0.0), &square(0.3));
    for value in [f64::NAN, 0.0, f64::NEG_INFINITY] {
        let (mut calls, mut asked) = (0, 0);
        let mut evaluate = |pairs: &[(Polygon, Polygon)]| {
            calls += 1;
            asked += pairs.len();
            Ok(vec![Minimum { value, at: DVec2::ZERO, kind: MinimumKind::Interior }; pairs.len()])
        };
        let nesting = cage.source.nesting().unwrap();
        let path = Linear::new(&cage);
        let mut steps = Steps::new(&path, &nesting, Coordinates::MeanValue, &mut evaluate, &Quiet);
        let limits = Limits { eps: 0.25, steps: 100 };
        let found = steps.partition(PartitionKind::Binary, &limits).unwrap_or_else(|_| panic!("the path is simple"));
        assert!(found.folds() && found.steps.len() == 4);
        assert_eq!((calls, asked), (3, 1 + 2 + 4), "a depth is one call");
    }
}

/// Smallest Jacobian and a map of points through a partition, in double precision.
fn forward(partition: &Partition, p: DVec2) -> DVec2 {
    let scale = Frame::common_scale(&partition.polygons);
    partition.polygons.windows(2).fold(p, |p, pair| {
        let step = Step::<f64>::new(Coordinates::MeanValue, &pair[0], &pair[1], scale);
        Frame::of(&pair[1], scale).world(step.map(Frame::of(&pair[0], scale).local::<f64>(p)))
    })
}

#[test]
fn a_continuous_partition_moves_no_point_by_more_than_twice_what_its_vertex_moves() {
    let points = [dvec2(0.5, 0.5), dvec2(0.7, 0.3), dvec2(0.9, 0.9), dvec2(0.2, 0.8), dvec2(0.95, 0.5)];
    let at = |kind, corner: f64| {
        let cage = cage(&square(0.0), &square(corner));
        let partition = found(&cage, &PartitionOptions { kind, ..binary(PathKind::Linear, 32) });
        assert!(!partition.folds);
        points.map(|p| forward(&partition, p))
    };
    let largest = |kind| {
        let mut jump = 0.0_f64;
        let mut before = at(kind, 0.5);
        // The corner moves by 0.004 along the diagonal each time, past the place where the binary
        // partition changes.
        for k in 1..50 {
            let now = at(kind, 0.5 + 0.004 / 2f64.sqrt() * k as f64);
            for (a, b) in before.iter().zip(&now) {
                jump = jump.max((*b - *a).length());
            }
            before = now;
        }
        jump
    };
    let continuous = largest(PartitionKind::Continuous);
    assert!(continuous <= 0.008, "{continuous}");
    // The comparison sees a jump where there is one.
    let binary = largest(PartitionKind::Binary);
    assert!(binary > 0.01, "{binary}");
}

#[test]
fn a_continuous_partition_contains_the_binary_one() {
    let cage = cage(&nested_squares(0.0), &nested_squares(1.0));
    let found = found(&cage, &PartitionOptions { kind: PartitionKind::Continuous, ..binary(PathKind::Linear, 64) });
    assert!(!found.folds);
    for knot in [0.0, 0.25, 0.5, 0.75, 0.875, 1.0] {
        assert!(found.knots.contains(&knot), "{knot} of {:?}", found.knots);
    }
}

#[test]
fn sufficient_bounds_follow_the_lemmas() {
    // One vertex moves: Lemma 1. J_min = 1 - 1.828 s is not far from what it promises.
    let cage = cage(&square(0.0), &square(0.05));
    let direct = found(&cage, &PartitionOptions { kind: PartitionKind::Direct, ..binary(PathKind::Linear, 64) });
    let bound = &direct.sufficient_bound();
    let step = bound.steps[0];
    let lemma_1 = step.lemma_1.unwrap();
    assert!(direct.steps[0].minimum.value >= 1.0 - lemma_1 * 1.01, "J >= 1 - M_i |u|");
    assert!(lemma_1 < step.lemma_2 && (bound.displacement - 0.05 * 2f64.sqrt()).abs() < 1e-12);
    assert!((bound.limit - LEMMA_2 / (4.0 * bound.gradient)).abs() < 1e-12);
    assert!(!found(&cage, &PartitionOptions { kind: PartitionKind::Direct, ..binary(PathKind::Linear, 64) }).folds);
    // Nested squares: 1000 steps satisfy (7), as the paper found; the notes have 8.0e-4 against
    // 1.02e-2.
    let nested = self::cage(&nested_squares(0.0), &nested_squares(1.0));
    let path = Linear::new(&nested);
    let polygons: Vec<Polygon> = (0..=1000).map(|k| path.polygon(f64::from(k) / 1000.0).unwrap()).collect();
    let bound = sufficient_bound(Coordinates::MeanValue, &polygons);
    assert!(bound.holds() && (bound.displacement - 8e-4).abs() < 1e-6, "{bound:.0?}");
    assert!((bound.limit - 1.02e-2).abs() < 1e-3, "{}", bound.limit);
}

#[test]
fn options_out_of_range_are_refused() {
    let cage = cage(&square(0.0), &square(0.1));
    let refused = |options: PartitionOptions| {
        let mut evaluate = |_: &[(Polygon, Polygon)]| panic!("nothing to evaluate");
        partition_with(&mut evaluate, &cage, &options, &Quiet).unwrap_err().to_string()
    };
    let with = |kind, eps| PartitionOptions { kind, eps, ..PartitionOptions::default() };
    for eps in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-9] {
        assert!(refused(with(PartitionKind::Binary, eps)).contains("eps"));
    }
    assert!(refused(with(PartitionKind::Uniform(0), 0.01)).contains("no steps"));
    assert!(refused(with(PartitionKind::Uniform(u32::MAX), 0.01)).contains("Give at most 10000"));
    let wachspress = PartitionOptions { coordinates: Coordinates::Wachspress, ..PartitionOptions::default() };
    let star = super::super::testing::star(10, 1.0, 0.4, [0.0; 2]);
    let mut evaluate = |_: &[(Polygon, Polygon)]| panic!("nothing to evaluate");
    assert!(partition_with(&mut evaluate, &self::cage(&star, &star), &wachspress, &Quiet).is_err());
}
