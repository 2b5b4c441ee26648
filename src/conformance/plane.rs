//! Maps of the plane: points, and the smallest Jacobian.

use glam::DVec2;

use super::{Check, Outcome, largest, outcome, timed};
use crate::engine::Engine;
use crate::error::Result;
use crate::geometry::Polygon;
use crate::mapping::plane::{Coordinates, Frame, SampleOptions, Step, jacobian_min, map_points};
use crate::models::polygons::{self, star};

pub(super) const CHECKS: &[Check] = &[
    Check {
        name: "points of the plane, 5 steps",
        kernels: &["map_points"],
        unit: "cages",
        // As the bound of one step (docs/warp.md), 2e-7 of the cage, for each of five.
        tolerance: 1e-6,
        measure: points,
    },
    Check {
        name: "smallest Jacobian",
        kernels: &["jacobian_min"],
        unit: "Jacobians",
        // The kernel proposes places; the value is computed in double precision at the same place,
        // but for a last step of a search along an edge.
        tolerance: 1e-7,
        measure: jacobian,
    },
];

/// A star whose tips turn against its notches, from one step to the next.
fn path(steps: usize) -> Vec<Polygon> {
    let polygon = |k: usize| {
        let turn = 0.3 * k as f64 / steps as f64;
        let (tips, notches) = (star(32, &[1.0], turn, DVec2::ZERO), star(32, &[0.7], 0.0, DVec2::ZERO));
        let ring = tips
            .iter()
            .zip(&notches)
            .flat_map(|(t, n)| [*t, DVec2::from_angle(std::f64::consts::PI / 32.0).rotate(*n)]);
        Polygon::from_loops(vec![ring.collect()])
    };
    (0..=steps).map(polygon).collect()
}

fn points(engine: &Engine) -> Result<Outcome> {
    let polygons = path(5);
    let scale = Frame::common_scale(&polygons);
    let steps: Vec<Step<f32>> =
        polygons.windows(2).map(|p| Step::new(Coordinates::MeanValue, &p[0], &p[1], scale)).collect();
    let start: Vec<[f32; 2]> =
        (0..200_000u32).map(|i| [(i % 500) as f32 / 1500.0 - 0.16, (i / 500) as f32 / 1200.0 - 0.16]).collect();
    let run = |engine: &Engine| {
        let mut images = start.clone();
        map_points(engine, &steps, &mut images)?;
        Ok(images)
    };
    let (found, on_cpu, truth) = (timed(|| run(engine))?, timed(|| run(&Engine::cpu()))?, run(&Engine::reference())?);
    Ok(outcome(&found, &on_cpu, apart(&found.value, &truth)))
}

/// The largest difference of coordinates.
fn apart(a: &[[f32; 2]], b: &[[f32; 2]]) -> f64 {
    largest(a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| f64::from((a - b).abs())))
}

fn jacobian(engine: &Engine) -> Result<Outcome> {
    let ends = path(1);
    let mut pairs = vec![(ends[0].clone(), ends[1].clone())];
    pairs.extend(
        [polygons::inverted_star(), polygons::twisted_star(), polygons::nested_squares()].map(|p| (p.source, p.target)),
    );
    let options = SampleOptions { resolution: 200 };
    let run = |engine: &Engine| jacobian_min(engine, Coordinates::MeanValue, &pairs, &options);
    let (found, on_cpu, truth) = (timed(|| run(engine))?, timed(|| run(&Engine::cpu()))?, run(&Engine::reference())?);
    let off = found.value.iter().zip(&truth).map(|(a, b)| {
        if a.kind == b.kind { (a.value - b.value).abs() / b.value.abs().max(1.0) } else { f64::INFINITY }
    });
    Ok(outcome(&found, &on_cpu, largest(off)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_wrong_coordinate_is_seen() {
        let a = vec![[0.25f32, 0.5]; 9];
        let mut b = a.clone();
        assert_eq!(apart(&a, &b), 0.0);
        b[4][1] += 1e-3;
        assert!(apart(&a, &b) > CHECKS[0].tolerance);
        b[4][1] = f32::NAN;
        assert_eq!(apart(&a, &b), f64::INFINITY);
    }
}
