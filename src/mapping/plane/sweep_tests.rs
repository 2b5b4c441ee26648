//! Sweeps against the reference.

use super::step::{Coordinates, Step};
use super::testing::{Random, nested_squares, pairs, star};
use super::{Frame, map_points_on_cpu};
use crate::engine::{LaneScalar, Lanes};
use crate::geometry::Polygon;

/// Points around the polygon, on its edges, at its vertices and next to both.
fn points<E: LaneScalar>(step: &Step<f64>, count: usize) -> Vec<[E; 2]> {
    let mut random = Random(3);
    let mut points: Vec<[f64; 2]> = (0..count).map(|_| [random.unit() - 0.5, random.unit() - 0.5]).collect();
    for (i, k) in step.outline.edges() {
        let (a, b) = (step.outline.vertices[i], step.outline.vertices[k]);
        for (along, aside) in [(0.0, 0.0), (0.5, 0.0), (0.3, 1e-7), (0.3, -1e-7), (1e-6, 1e-7), (0.999, 1e-3)] {
            let (x, y) = (b[0] - a[0], b[1] - a[1]);
            points.push([a[0] + along * x - aside * y, a[1] + along * y + aside * x]);
        }
    }
    points.into_iter().map(|p| p.map(E::of)).collect()
}

fn cases() -> Vec<(Polygon, Polygon)> {
    let mut cases: Vec<_> = pairs().into_iter().map(|(_, a, b)| (a, b)).collect();
    cases.push((nested_squares(0.0), nested_squares(0.3)));
    cases.push((star(3, 1.0, 1.0, [0.0; 2]), star(3, 1.0, 0.7, [0.0; 2])));
    cases.push((star(64, 1.0, 0.8, [0.0; 2]), star(64, 0.8, 1.0, [0.0; 2])));
    cases
}

/// The largest difference of images and derivatives between lanes and the reference in double
/// precision on the same input, relative to max(1, size of the derivative).
fn worst<E: LaneScalar>(lanes: Lanes) -> (f64, f64) {
    let (mut of_points, mut of_derivatives) = (0f64, 0f64);
    for (from, to) in cases() {
        let scale = Frame::common_scale([&from, &to]);
        let step = Step::<E>::new(Coordinates::MeanValue, &from, &to, scale);
        let truth = step.cast::<f64>();
        for count in [0, 1, 7, 8, 9, 300] {
            let points = points::<E>(&truth, count);
            let mut mapped = points.clone();
            let mut derivatives = vec![[[E::ONE, E::ZERO], [E::ZERO, E::ONE]]; points.len()];
            map_points_on_cpu(lanes, std::slice::from_ref(&step), &mut mapped, Some(&mut derivatives));
            let mut alone = points.clone();
            map_points_on_cpu(lanes, std::slice::from_ref(&step), &mut alone, None);
            for (((p, q), d), r) in points.iter().zip(&mapped).zip(&derivatives).zip(&alone) {
                let e = truth.evaluate(p.map(|x| x.to_f64()));
                for axis in 0..2 {
                    of_points = of_points.max((r[axis].to_f64() - e.point[axis]).abs());
                }
                let size = e.derivative.iter().flatten().fold(1f64, |a, x| a.max(x.abs()));
                for row in 0..2 {
                    of_points = of_points.max((q[row].to_f64() - e.point[row]).abs());
                    for axis in 0..2 {
                        let error = (d[row][axis].to_f64() - e.derivative[row][axis]).abs() / size;
                        assert!(error.is_finite(), "{p:?} {d:?}");
                        of_derivatives = of_derivatives.max(error);
                    }
                }
            }
        }
    }
    (of_points, of_derivatives)
}

#[test]
fn lanes_agree_with_the_reference() {
    for lanes in [Lanes::scalar(), Lanes::detect()] {
        let (points, derivatives) = worst::<f64>(lanes);
        println!("double {}: {points:e} {derivatives:e}", lanes.name());
        assert!(points < 1e-14 && derivatives < 1e-12, "{points} {derivatives}");
        let (points, derivatives) = worst::<f32>(lanes);
        println!("single {}: {points:e} {derivatives:e}", lanes.name());
        assert!(points < 5e-7 && derivatives < 5e-6, "{points} {derivatives}");
    }
}
