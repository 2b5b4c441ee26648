//! A continuous partition moves no point far when the cage moves a little: along ten ways of cages,
//! where another path than before would be taken.

use std::f64::consts::PI;

use glam::{DVec2, dvec2};
use rayon::prelude::*;

use super::super::{Frame, Step};
use super::*;
use crate::progress::Quiet;

/// How many times the way of a vertex a point may move.
const MOST: f64 = 6.0;
/// Moves of a vertex.
const MOVES: [f64; 2] = [1e-3, 1e-4];

type Ring = Vec<DVec2>;

/// A way of cages, and where on it the path used to change: from the intrinsic to the linear one,
/// or from that to the compatible one.
struct Way {
    name: &'static str,
    switch: f64,
    cage: fn(f64) -> (Ring, Ring),
}

fn square() -> Ring {
    vec![dvec2(0.0, 0.0), dvec2(1.0, 0.0), dvec2(1.0, 1.0), dvec2(0.0, 1.0)]
}

/// The unit square with the middles of its sides.
fn octagon() -> Ring {
    let square = square();
    (0..4).flat_map(|i| [square[i], (square[i] + square[(i + 1) % 4]) / 2.0]).collect()
}

fn hexagon() -> Ring {
    (0..6).map(|i| DVec2::from_angle(f64::from(i) * PI / 3.0)).collect()
}

/// `ring`, and the same with vertex `i` at `to`.
fn moved(ring: Ring, i: usize, to: DVec2) -> (Ring, Ring) {
    let mut target = ring.clone();
    target[i] = to;
    (ring, target)
}

const WAYS: [Way; 10] = [
    Way { name: "corner", switch: 0.9657, cage: |s| moved(square(), 2, DVec2::splat(1.0 - s)) },
    Way { name: "corner, earlier", switch: 0.95255, cage: |s| moved(square(), 2, DVec2::splat(1.0 - s)) },
    Way {
        name: "corner beside the diagonal",
        switch: 0.57877,
        cage: |s| moved(square(), 2, dvec2(1.0 - s, 1.0 - 0.9 * s)),
    },
    Way { name: "corner far beside it", switch: 0.98243, cage: |s| moved(square(), 2, dvec2(1.0 - s, 1.0 - 0.9 * s)) },
    Way {
        name: "corner on a curve",
        switch: 0.62114,
        cage: |s| moved(square(), 2, dvec2(1.0 - s + 0.2 * (3.0 * s).sin(), 1.0 - s)),
    },
    Way {
        name: "corner at the end of the curve",
        switch: 0.97756,
        cage: |s| moved(square(), 2, dvec2(1.0 - s + 0.2 * (3.0 * s).sin(), 1.0 - s)),
    },
    Way { name: "tip of a hexagon", switch: 0.47856, cage: |s| moved(hexagon(), 0, dvec2(1.0 - 1.9 * s, 0.1 * s)) },
    Way { name: "tip pushed through", switch: 0.99412, cage: |s| moved(hexagon(), 0, dvec2(1.0 - 1.9 * s, 0.1 * s)) },
    Way {
        name: "corner of an octagon",
        switch: 0.83436,
        cage: |s| moved(octagon(), 4, dvec2(1.0 - 0.95 * s, 1.02 - 0.95 * s)),
    },
    Way {
        name: "corner almost through",
        switch: 0.9679,
        cage: |s| moved(octagon(), 4, dvec2(1.0 - 0.95 * s, 1.02 - 0.95 * s)),
    },
];

impl Way {
    fn cage(&self, s: f64) -> Cage {
        let (source, target) = (self.cage)(s);
        Cage::new(vec![source], vec![target]).unwrap()
    }

    /// How far a vertex moves while `s` grows by 1, at the switch.
    fn speed(&self) -> f64 {
        let ends = [-1e-6, 1e-6].map(|by| self.cage(self.switch + by).target);
        ends[0].vertices().zip(ends[1].vertices()).map(|(p, q)| p.distance(q)).fold(0.0, f64::max) / 2e-6
    }

    /// The largest move of a point over `steps` moves of a vertex by `by` around the switch, in
    /// `by`.
    fn largest(&self, options: &PartitionOptions, by: f64, steps: i32) -> f64 {
        let images = |k: i32| {
            let cage = self.cage(self.switch + (f64::from(k) - f64::from(steps) / 2.0) * by / self.speed());
            let found = partition(&Engine::reference(), &cage, options, &Quiet).unwrap();
            assert!(!found.folds, "{}: {:?}", self.name, found.notes);
            let scale = Frame::common_scale(&found.polygons);
            let inner: Vec<DVec2> = points(&cage.source);
            inner.into_iter().map(|p| forward(&found.polygons, scale, p)).collect::<Vec<_>>()
        };
        let all: Vec<Vec<DVec2>> = (0..=steps).map(images).collect();
        let pairs = all.windows(2).flat_map(|w| w[0].iter().zip(&w[1]));
        pairs.map(|(p, q)| p.distance(*q)).fold(0.0, f64::max) / by
    }
}

/// Points of a grid inside of a polygon.
fn points(polygon: &Polygon) -> Vec<DVec2> {
    let (low, high) = polygon.bounds();
    let at = |i: u32, k: u32| low + (high - low) * (dvec2(f64::from(i), f64::from(k)) + 0.5) / 12.0;
    let all = (0..144).map(|i| at(i / 12, i % 12));
    all.filter(|p| polygon.contains(*p) == crate::geometry::Side::Inside).collect()
}

/// The image of a point through the steps.
fn forward(polygons: &[Polygon], scale: f64, p: DVec2) -> DVec2 {
    polygons.windows(2).fold(p, |p, pair| {
        let step = Step::<f64>::new(Coordinates::MeanValue, &pair[0], &pair[1], scale);
        Frame::of(&pair[1], scale).world(step.map(Frame::of(&pair[0], scale).local::<f64>(p)))
    })
}

fn options(kind: PartitionKind) -> PartitionOptions {
    PartitionOptions { kind, samples: SampleOptions { resolution: 16 }, ..PartitionOptions::default() }
}

#[test]
fn no_point_moves_by_more_than_six_times_the_way_of_a_vertex() {
    let options = options(PartitionKind::Continuous);
    WAYS.par_iter().for_each(|way| {
        for by in MOVES {
            let largest = way.largest(&options, by, 8);
            assert!(largest <= MOST, "{} by {by}: {largest}", way.name);
        }
    });
}

#[test]
fn the_measure_sees_the_jump_of_a_path_that_changes() {
    // The binary partition takes another path at nearly the same places as continuous ones did.
    let seen = WAYS.par_iter().filter(|way| way.largest(&options(PartitionKind::Binary), 1e-3, 16) > MOST).count();
    assert!(seen >= 5, "{seen} of {}", WAYS.len());
}

#[test]
fn a_cage_that_does_not_change_stays() {
    let cage = WAYS[0].cage(0.9);
    let same = Cage { source: cage.target.clone(), target: cage.target };
    let found = partition(&Engine::reference(), &same, &options(PartitionKind::Continuous), &Quiet).unwrap();
    assert!(found.path == PathKind::Intrinsic && found.steps.len() == 1, "{:?}", found.knots);
}
