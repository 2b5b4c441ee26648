//! Maps of space: points, and the smallest Jacobian.

use glam::DVec3;

use super::{Check, Outcome, largest, outcome, timed};
use crate::engine::Engine;
use crate::error::Result;
use crate::mapping::space::{Frame, Samples, Step, jacobian_min_3d, map_points_3d};
use crate::models::shapes::{Random, icosphere};

pub(super) const CHECKS: &[Check] = &[
    Check {
        name: "points of space",
        kernels: &["map_points_3d"],
        unit: "cages",
        // The bound of single precision beside faces and edges (docs/cages.md).
        tolerance: 5e-6,
        measure: points,
    },
    Check {
        name: "smallest Jacobian in space",
        kernels: &["jacobian_min_3d"],
        unit: "Jacobians",
        // The kernel proposes places; the value is computed in double precision.
        tolerance: 1e-9,
        measure: jacobian,
    },
];

/// A ball of 80 faces whose vertices move.
fn step() -> (Step<f64>, Frame) {
    let ball = icosphere(1.0, 1);
    let mut random = Random::new(7);
    let moved: Vec<DVec3> = ball
        .positions
        .iter()
        .map(|p| *p + 0.2 * DVec3::new(random.signed(), random.signed(), random.signed()))
        .collect();
    let scale = Frame::common_scale([&ball.positions[..], &moved[..]]);
    (Step::new(&ball.triangles(), &ball.positions, &moved, scale), Frame::of(&ball.positions, scale))
}

fn points(engine: &Engine) -> Result<Outcome> {
    let (step, _) = step();
    let steps = std::slice::from_ref(&step);
    let mut random = Random::new(9);
    let start: Vec<[f32; 3]> = (0..20_000).map(|_| [0; 3].map(|_| 0.4 * random.signed() as f32)).collect();
    let run = |engine: &Engine| {
        let mut images = start.clone();
        map_points_3d(engine, steps, &mut images)?;
        Ok(images)
    };
    let (found, on_cpu, truth) = (timed(|| run(engine))?, timed(|| run(&Engine::cpu()))?, run(&Engine::reference())?);
    let pairs = found.value.as_flattened().iter().zip(truth.as_flattened());
    Ok(outcome(&found, &on_cpu, largest(pairs.map(|(a, b)| f64::from((a - b).abs())))))
}

fn jacobian(engine: &Engine) -> Result<Outcome> {
    let (step, frame) = step();
    let samples = Samples::new(&step, 16)?;
    let run = |engine: &Engine| jacobian_min_3d(engine, &step, &frame, &samples, &[]);
    let (found, on_cpu, truth) = (timed(|| run(engine))?, timed(|| run(&Engine::cpu()))?, run(&Engine::reference())?);
    let error = if found.value.at == truth.at { (found.value.value - truth.value).abs() } else { f64::INFINITY };
    Ok(outcome(&found, &on_cpu, error))
}
