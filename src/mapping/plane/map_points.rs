//! Many points through the steps of a composite map (paper, section 4.3).

use rayon::prelude::*;

use super::gpu;
use super::step::Step;
use super::sweep::{SweepPoints, SweepStep};
use crate::engine::{Backend, Engine, LaneScalar, Lanes};
use crate::error::{Error, Result};

/// Points of one task.
const CHUNK: usize = 512;

/// No change.
const IDENTITY: [[f32; 2]; 2] = [[1.0, 0.0], [0.0, 1.0]];

/// Takes `points` through all `steps` in turn, in place.
///
/// Points are local coordinates: in the frame of the first step's polygon before, in that of the
/// last step's image after ([`Step`]). Points on edges and at vertices stay on them exactly. Time
/// O(n) per point and step. On a device the steps of a tile of points run in one submission; on the
/// CPU on SIMD lanes in parallel; the back end `reference` works in double precision between the
/// points it is given and those it returns.
///
/// # Errors
/// [`Error::Device`] if the device fails, [`Error::Memory`] past its budget.
pub fn map_points(engine: &Engine, steps: &[Step<f32>], points: &mut [[f32; 2]]) -> Result<()> {
    run(engine, steps, points, None)
}

/// As [`map_points`], with the derivative of the whole map at each point: the product of those of
/// the steps, row by row (d f_x / d(x, y), d f_y / d(x, y)). What `derivatives` held before does
/// not matter.
///
/// # Errors
/// As [`map_points`]; [`Error::Input`] if the lists differ in length.
pub fn map_points_with_derivatives(
    engine: &Engine,
    steps: &[Step<f32>],
    points: &mut [[f32; 2]],
    derivatives: &mut [[[f32; 2]; 2]],
) -> Result<()> {
    if points.len() != derivatives.len() {
        let what = format!("{} points and room for {} derivatives", points.len(), derivatives.len());
        return Err(Error::input(what, "Give lists of the same length"));
    }
    derivatives.fill(IDENTITY);
    run(engine, steps, points, Some(derivatives))
}

fn run(
    engine: &Engine,
    steps: &[Step<f32>],
    points: &mut [[f32; 2]],
    derivatives: Option<&mut [[[f32; 2]; 2]]>,
) -> Result<()> {
    if engine.backend() == Backend::Reference {
        let wide: Vec<Step<f64>> = steps.iter().map(Step::cast).collect();
        let mut at: Vec<[f64; 2]> = points.iter().map(|p| p.map(f64::from)).collect();
        let mut products = vec![[[1.0, 0.0], [0.0, 1.0]]; if derivatives.is_some() { points.len() } else { 0 }];
        map_points_on_cpu(Lanes::detect(), &wide, &mut at, derivatives.is_some().then_some(&mut products));
        for (p, at) in points.iter_mut().zip(&at) {
            *p = at.map(|x| x as f32);
        }
        for (d, product) in derivatives.into_iter().flatten().zip(&products) {
            *d = product.map(|row| row.map(|x| x as f32));
        }
        return Ok(());
    }
    if let Some(device) = engine.gpu_for("map_points").filter(|_| steps.iter().all(gpu::fits)) {
        return gpu::map_on_device(device, steps, points, derivatives);
    }
    map_points_on_cpu(Lanes::detect(), steps, points, derivatives);
    Ok(())
}

/// As [`map_points_on_cpu`] with derivatives in single precision, for points in two parts, whose
/// sum is the point: displacements have the digits of single precision, points those of both parts.
/// Where steps are short, that is accurate to a small part of what the size of the polygons is
/// rounded to.
pub(super) fn map_points_in_parts(
    lanes: Lanes,
    steps: &[Step<f32>],
    points: &mut [[[f32; 2]; 2]],
    derivatives: &mut [[[f32; 2]; 2]],
) {
    let steps: Vec<SweepStep<'_, f32>> = steps.iter().map(SweepStep::new).collect();
    let chunks = points.par_chunks_mut(CHUNK).zip(derivatives.par_chunks_mut(CHUNK));
    chunks.for_each(|(points, derivatives)| {
        let mut tile = SweepPoints::in_parts(points, derivatives);
        steps.iter().for_each(|step| step.apply(lanes, &mut tile));
        let mut first = vec![[0.0; 2]; points.len()];
        tile.store(&mut first, Some(derivatives));
        points.iter_mut().zip(first).for_each(|(p, first)| p[0] = first);
        tile.store_tails(points);
    });
}

/// As [`map_points`] on the CPU, in either precision. With `derivatives`, as long as `points`, each
/// is multiplied from the left by the derivative of the map: start from the identity. The same
/// result for any number of threads.
pub fn map_points_on_cpu<E: LaneScalar>(
    lanes: Lanes,
    steps: &[Step<E>],
    points: &mut [[E; 2]],
    derivatives: Option<&mut [[[E; 2]; 2]]>,
) {
    let steps: Vec<SweepStep<'_, E>> = steps.iter().map(SweepStep::new).collect();
    let advance = |points: &mut [[E; 2]], mut derivatives: Option<&mut [[[E; 2]; 2]]>| {
        let mut tile = SweepPoints::new(points, derivatives.as_deref());
        for step in &steps {
            step.apply(lanes, &mut tile);
        }
        tile.store(points, derivatives.take());
    };
    match derivatives {
        None => points.par_chunks_mut(CHUNK).for_each(|points| advance(points, None)),
        Some(derivatives) => points
            .par_chunks_mut(CHUNK)
            .zip(derivatives.par_chunks_mut(CHUNK))
            .for_each(|(points, derivatives)| advance(points, Some(derivatives))),
    }
}
