//! The smallest Jacobian of a step (paper, section 4.2).
//!
//! Three places are looked at, because a raster sees only one of them: vertices by their limits in
//! closed form ([`super::vertex_limit`]), where the minimum nearly always is; edges by samples; the
//! interior by the pixel centres of a raster of the polygon. The smallest samples of the last two
//! are then followed to the minimum next to them in double precision, so that the answer does not
//! depend on where the samples happened to lie.

use glam::DVec2;
use rayon::prelude::*;

use super::descent::{along_edges, downhill, edge_samples, least};
use super::gpu;
use super::samples::{EdgeSamples, Raster};
use super::step::{Coordinates, Step};
use super::sweep::{SweepPoints, SweepStep};
use super::{Frame, Minimum, MinimumKind, SampleOptions};
use crate::control;
use crate::engine::{Backend, Engine, LaneScalar, Lanes};
use crate::error::{Error, Result};
use crate::geometry::Polygon;

/// Most samples along the longer side.
pub const MOST_RESOLUTION: u32 = 8192;

/// Neighbouring pixels of which only the smallest Jacobian is kept.
pub(super) const PIECE: u32 = 16;

/// Pieces that one task takes.
const TASK: usize = 64;

/// Samples nearer to one another than this, in pixels, lead to the same minimum.
const APART: f64 = 6.0;

/// A place on the edges counts as smaller than a vertex only by more than rounding, and so does one
/// inside.
const ROUNDING: f64 = 1e-12;

/// How hard the minimum is looked for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Effort {
    /// Pixels along the longer side of the raster.
    pub(super) resolution: u32,
    /// Samples of the interior that are followed, and half of those on edges.
    followed: usize,
    /// Samples of an edge, at most.
    on_edge: usize,
    /// Rounds of a search along an edge.
    rounds: usize,
    /// Strides of a search inside end below this part of a pixel, and of 1 where a pixel is larger
    /// than a thousandth.
    finest: f64,
}

impl Effort {
    /// What a partition is judged by: 0.618^40 is 4e-9, and the value is known to the square of
    /// that.
    fn thorough(options: &SampleOptions) -> Self {
        Self { resolution: options.resolution, followed: 6, on_edge: 32, rounds: 40, finest: 1e-4 }
    }

    /// What a frame has time for: vertices as ever, elsewhere a sixteenth of the samples and
    /// minima to three digits.
    pub(super) fn glance(options: &SampleOptions) -> Self {
        Self { resolution: options.resolution.min(64), followed: 2, on_edge: 8, rounds: 12, finest: 0.03 }
    }
}

/// A sample: the Jacobian, and where.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    pub(super) value: f64,
    pub(super) at: [f64; 2],
}

/// The smallest Jacobian of the maps from the first to the second polygon of each pair.
///
/// Time O(n) per sample and O(n^2) for the vertices. The same input gives the same result for any
/// number of threads; ties go to vertices before edges before the interior, then to the lowest
/// index. A value that is not finite counts as a fold and is given as negative infinity.
///
/// # Errors
/// [`Error::Input`] if the polygons of a pair do not correspond, a coordinate is not finite, or the
/// coordinates do not exist ([`Coordinates::check`]); [`Error::Option`] if the resolution is 0 or
/// over [`MOST_RESOLUTION`].
pub fn jacobian_min(
    engine: &Engine,
    coordinates: Coordinates,
    pairs: &[(Polygon, Polygon)],
    options: &SampleOptions,
) -> Result<Vec<Minimum>> {
    if !(1..=MOST_RESOLUTION).contains(&options.resolution) {
        return Err(Error::option(
            "resolution",
            format!("{} samples along the longer side", options.resolution),
            format!("Give 1 to {MOST_RESOLUTION}; the default is {}", SampleOptions::default().resolution),
        ));
    }
    for (from, to) in pairs {
        check(coordinates, from, to)?;
    }
    let mut minima = Vec::with_capacity(pairs.len());
    for pairs in pairs.chunks(STEPS_AT_ONCE) {
        control::check()?;
        let steps = rasters(coordinates, pairs, options.resolution);
        let interior = interior(engine, &steps)?;
        minima.extend(judged_steps(pairs, &steps, interior, &Effort::thorough(options)));
    }
    Ok(minima)
}

/// The same at a glance, on the CPU, for pairs that [`jacobian_min`] takes.
///
/// # Errors
/// As [`jacobian_min`].
pub(super) fn glance(
    coordinates: Coordinates,
    pairs: &[(Polygon, Polygon)],
    options: &SampleOptions,
) -> Result<Vec<Minimum>> {
    for (from, to) in pairs {
        check(coordinates, from, to)?;
    }
    let effort = Effort::glance(options);
    let steps = rasters(coordinates, pairs, effort.resolution);
    let interior = steps.par_iter().map(|(step, raster)| interior_samples::<f32>(step, raster)).collect();
    Ok(judged_steps(pairs, &steps, interior, &effort))
}

/// Steps whose samples are in memory together: of a partition of very many, a part.
const STEPS_AT_ONCE: usize = 1024;

/// The steps of the pairs, with what their interiors are sampled by.
fn rasters(coordinates: Coordinates, pairs: &[(Polygon, Polygon)], resolution: u32) -> Vec<(Step<f64>, Raster)> {
    let prepared = |(from, to): &(Polygon, Polygon)| {
        let step = Step::new(coordinates, from, to, Frame::common_scale([from, to]));
        let raster = Raster::new(&step.outline, resolution);
        (step, raster)
    };
    pairs.par_iter().map(prepared).collect()
}

/// The minima of the steps, from samples of their interiors.
fn judged_steps(
    pairs: &[(Polygon, Polygon)],
    steps: &[(Step<f64>, Raster)],
    interior: Vec<Vec<Sample>>,
    effort: &Effort,
) -> Vec<Minimum> {
    let all = pairs.par_iter().zip(steps).zip(interior);
    all.map(|(((from, to), step), interior)| minimum(from, to, step, interior, effort)).collect()
}

/// The smallest samples of the interiors, where `engine` works. What the kernel cannot do the CPU
/// does.
fn interior(engine: &Engine, steps: &[(Step<f64>, Raster)]) -> Result<Vec<Vec<Sample>>> {
    let device = engine.gpu_for("jacobian_min");
    if let Some(device) = device.filter(|_| steps.iter().all(|(step, _)| gpu::fits(step))) {
        let single: Vec<(Step<f32>, Raster)> = steps.iter().map(|(s, raster)| (s.cast(), raster.clone())).collect();
        return gpu::piece_minima(device, &single);
    }
    let samples = match engine.backend() {
        Backend::Reference => interior_samples::<f64>,
        _ => interior_samples::<f32>,
    };
    Ok(steps.iter().map(|(step, raster)| samples(step, raster)).collect())
}

/// Refuses pairs that cannot be mapped.
pub(super) fn check(coordinates: Coordinates, from: &Polygon, to: &Polygon) -> Result<()> {
    let remedy = "Give both polygons the same loops, of at least 3 vertices with finite coordinates";
    let sizes = |p: &Polygon| p.loops().iter().map(Vec::len).collect::<Vec<_>>();
    if sizes(from) != sizes(to) {
        return Err(Error::input("the polygons of a step have different numbers of vertices", remedy));
    }
    if from.loops().is_empty() || from.loops().iter().any(|ring| ring.len() < 3) {
        return Err(Error::input("a polygon of a step has a loop of fewer than 3 vertices", remedy));
    }
    if let Some(i) = from.vertices().zip(to.vertices()).position(|(v, w)| !(v.is_finite() && w.is_finite())) {
        return Err(Error::input(format!("vertex {i} of a step has no finite position"), remedy));
    }
    coordinates.check(from)
}

fn minimum(
    from: &Polygon,
    to: &Polygon,
    (step, raster): &(Step<f64>, Raster),
    interior: Vec<Sample>,
    effort: &Effort,
) -> Minimum {
    let frame = Frame::of(from, Frame::common_scale([from, to]));
    let sweep = SweepStep::new(step);
    let mut best = vertices(step, from);
    let mut offer = |sample: Option<Sample>, kind: MinimumKind| {
        let Some(sample) = sample else { return };
        if !(best.value <= sample.value + ROUNDING * sample.value.abs().max(1.0)) {
            best = Minimum { value: sample.value, at: frame.world(sample.at), kind };
        }
    };
    offer(edges(&sweep, effort), MinimumKind::Edge);
    offer(follow(&sweep, raster, interior, effort), MinimumKind::Interior);
    best
}

/// Orders values so that a sample that is not finite is the smallest.
pub(super) fn judged(value: f64) -> f64 {
    if value.is_finite() { value } else { f64::NEG_INFINITY }
}

/// The smallest limit at a vertex; coordinates other than mean value ones are smooth there.
fn vertices(step: &Step<f64>, from: &Polygon) -> Minimum {
    let values: Vec<f64> = (0..step.outline.len())
        .into_par_iter()
        .map(|k| {
            judged(match step.coordinates {
                Coordinates::MeanValue => step.limit(k).smallest(),
                Coordinates::Wachspress => step.evaluate(step.outline.vertices[k]).jacobian,
            })
        })
        .collect();
    let worlds = from.vertices().zip(values);
    let minimum = |(at, value)| Minimum { value, at, kind: MinimumKind::Vertex };
    let none = Minimum { value: f64::NEG_INFINITY, at: DVec2::ZERO, kind: MinimumKind::Vertex };
    worlds.map(minimum).reduce(|a, b| if b.value < a.value { b } else { a }).unwrap_or(none)
}

/// The smallest Jacobian on the edges: samples, and a search by golden section around the smallest.
fn edges(sweep: &SweepStep<'_, f64>, effort: &Effort) -> Option<Sample> {
    let outline = &sweep.step.outline;
    let samples = EdgeSamples::new(outline.len(), effort.on_edge);
    let ends: Vec<(usize, usize)> = outline.edges().collect();
    let found: Vec<Sample> = ends.par_chunks(TASK).flat_map_iter(|ends| edge_samples(sweep, ends, &samples)).collect();
    // Samples no larger than their neighbours on the edge.
    let mut low: Vec<(Sample, usize, usize)> = Vec::new();
    for (edge, values) in found.chunks_exact(samples.fractions.len()).enumerate() {
        for (j, sample) in values.iter().enumerate() {
            let below = |other: Option<&Sample>| other.is_none_or(|o| sample.value <= o.value);
            if below(j.checked_sub(1).map(|j| &values[j])) && below(values.get(j + 1)) {
                low.push((*sample, edge, j));
            }
        }
    }
    low.sort_by(|a, b| a.0.value.total_cmp(&b.0.value));
    low.truncate(2 * effort.followed);
    let starts: Vec<_> = low.iter().map(|&(_, edge, j)| (ends[edge], samples.around(j))).collect();
    let followed = along_edges(sweep, &starts, effort.rounds);
    least(low.iter().zip(followed).map(|(start, found)| if found.value < start.0.value { found } else { start.0 }))
}

/// The smallest sample of every piece of the raster, on lanes.
fn interior_samples<E: LaneScalar>(step: &Step<f64>, raster: &Raster) -> Vec<Sample> {
    let step = step.cast::<E>();
    let sweep = SweepStep::new(&step);
    let lanes = Lanes::detect();
    raster
        .pieces(PIECE)
        .par_chunks(TASK)
        .flat_map_iter(|pieces| {
            let centres = pieces.iter().flat_map(|run| (0..run.count).map(|i| raster.centre(run.row, run.first + i)));
            let points: Vec<[E; 2]> = centres.map(|p| p.map(E::of)).collect();
            let jacobians = sweep.jacobians(lanes, &SweepPoints::new(&points, None));
            let mut samples = points
                .into_iter()
                .zip(jacobians)
                .map(|(p, j)| Sample { value: judged(j.to_f64()), at: p.map(E::to_f64) });
            pieces.iter().filter_map(|run| least(samples.by_ref().take(run.count as usize))).collect::<Vec<_>>()
        })
        .collect()
}

/// The smallest Jacobian inside: from the smallest samples downhill.
fn follow(sweep: &SweepStep<'_, f64>, raster: &Raster, mut samples: Vec<Sample>, effort: &Effort) -> Option<Sample> {
    // Stable: equal values stay in the order of the raster.
    samples.sort_by(|a, b| a.value.total_cmp(&b.value));
    let mut starts: Vec<[f64; 2]> = Vec::with_capacity(effort.followed);
    for sample in samples {
        if starts.len() == effort.followed {
            break;
        }
        let near = |s: &[f64; 2]| (0..2).all(|axis| (s[axis] - sample.at[axis]).abs() < APART * raster.pixel);
        if !starts.iter().any(near) {
            starts.push(sample.at);
        }
    }
    // What the device or single precision found is judged again there.
    let finest = raster.pixel.min(1e-3) * effort.finest;
    least(downhill(sweep, &starts, raster.pixel, finest))
}
