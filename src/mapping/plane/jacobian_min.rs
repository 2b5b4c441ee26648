//! The smallest Jacobian of a step (paper, section 4.2).
//!
//! Three places are looked at, because a raster sees only one of them: vertices by their limits in
//! closed form ([`super::vertex_limit`]), where the minimum nearly always is; edges by samples; the
//! interior by the pixel centres of a raster of the polygon. The smallest samples of the last two
//! are then followed to the minimum next to them in double precision, so that the answer does not
//! depend on where the samples happened to lie.

use rayon::prelude::*;

use super::gpu;
use super::samples::{EdgeSamples, Raster, contains, on_edge};
use super::step::{Coordinates, Step};
use super::sweep::{SweepPoints, SweepStep};
use super::{Frame, Minimum, MinimumKind, SampleOptions};
use crate::control;
use crate::engine::{Backend, Engine, LaneScalar, Lanes};
use crate::error::{Error, Result};
use crate::geometry::Polygon;

/// Most samples along the longer side.
pub const MOST_RESOLUTION: u32 = 8192;

/// Samples of the interior, and of the edges, that are followed to a minimum.
const FOLLOWED: usize = 6;

/// Neighbouring pixels of which only the smallest Jacobian is kept.
pub(super) const PIECE: u32 = 16;

/// Pieces that one task takes.
const TASK: usize = 64;

/// Samples nearer to one another than this, in pixels, lead to the same minimum.
const APART: f64 = 6.0;

/// A place on the edges counts as smaller than a vertex only by more than rounding, and so does one
/// inside.
const ROUNDING: f64 = 1e-12;

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
        minima.extend(minima_of(engine, coordinates, pairs, options)?);
    }
    Ok(minima)
}

/// Steps whose samples are in memory together: of a partition of very many, a part.
const STEPS_AT_ONCE: usize = 1024;

fn minima_of(
    engine: &Engine,
    coordinates: Coordinates,
    pairs: &[(Polygon, Polygon)],
    options: &SampleOptions,
) -> Result<Vec<Minimum>> {
    let steps: Vec<(Step<f64>, Raster)> = pairs
        .par_iter()
        .map(|(from, to)| {
            let step = Step::new(coordinates, from, to, Frame::common_scale([from, to]));
            let raster = Raster::new(&step.outline, options.resolution);
            (step, raster)
        })
        .collect();
    let interior = interior(engine, &steps)?;
    let found = pairs.iter().zip(steps.iter().zip(interior));
    Ok(found.map(|((from, to), ((step, raster), interior))| minimum(from, to, step, raster, interior)).collect())
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

fn minimum(from: &Polygon, to: &Polygon, step: &Step<f64>, raster: &Raster, interior: Vec<Sample>) -> Minimum {
    let frame = Frame::of(from, Frame::common_scale([from, to]));
    let mut best = vertices(step, from);
    let mut offer = |sample: Option<Sample>, kind: MinimumKind| {
        let Some(sample) = sample else { return };
        if !(best.value <= sample.value + ROUNDING * sample.value.abs().max(1.0)) {
            best = Minimum { value: sample.value, at: frame.world(sample.at), kind };
        }
    };
    offer(edges(step), MinimumKind::Edge);
    offer(follow(step, raster, interior), MinimumKind::Interior);
    best
}

/// Orders values so that a sample that is not finite is the smallest.
fn judged(value: f64) -> f64 {
    if value.is_finite() { value } else { f64::NEG_INFINITY }
}

/// The smaller sample, the first where they are equal.
fn least(samples: impl IntoIterator<Item = Sample>) -> Option<Sample> {
    samples.into_iter().reduce(|a, b| if b.value < a.value { b } else { a })
}

fn jacobian(step: &Step<f64>, p: [f64; 2]) -> Sample {
    Sample { value: judged(step.evaluate(p).jacobian), at: p }
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
    let none = Minimum { value: f64::NEG_INFINITY, at: glam::DVec2::ZERO, kind: MinimumKind::Vertex };
    worlds.map(minimum).reduce(|a, b| if b.value < a.value { b } else { a }).unwrap_or(none)
}

/// The smallest Jacobian on the edges: samples, and a search by golden section around the smallest.
fn edges(step: &Step<f64>) -> Option<Sample> {
    let outline = &step.outline;
    let samples = EdgeSamples::new(outline.len());
    let ends: Vec<(usize, usize)> = outline.edges().collect();
    let sweep = SweepStep::new(step);
    let lanes = Lanes::detect();
    let per_edge: Vec<Vec<Sample>> = ends
        .par_chunks(TASK)
        .flat_map_iter(|ends| {
            let place = |&(i, k): &(usize, usize)| samples.fractions.iter().map(move |&s| on_edge(outline, i, k, s));
            let points: Vec<[f64; 2]> = ends.iter().flat_map(place).collect();
            let jacobians = sweep.jacobians(lanes, &SweepPoints::new(&points, None));
            let all: Vec<Sample> =
                points.into_iter().zip(jacobians).map(|(at, j)| Sample { value: judged(j), at }).collect();
            all.chunks(samples.fractions.len()).map(<[Sample]>::to_vec).collect::<Vec<_>>()
        })
        .collect();
    // Samples no larger than their neighbours on the edge.
    let mut low: Vec<(f64, usize, usize)> = Vec::new();
    for (edge, values) in per_edge.iter().enumerate() {
        for (j, sample) in values.iter().enumerate() {
            let below = |other: Option<&Sample>| other.is_none_or(|o| sample.value <= o.value);
            if below(j.checked_sub(1).map(|j| &values[j])) && below(values.get(j + 1)) {
                low.push((sample.value, edge, j));
            }
        }
    }
    low.sort_by(|a, b| a.0.total_cmp(&b.0));
    low.truncate(2 * FOLLOWED);
    let found: Vec<Sample> = low
        .par_iter()
        .map(|&(_, edge, j)| {
            let (i, k) = ends[edge];
            let best = golden_section(samples.around(j), |s| jacobian(step, on_edge(outline, i, k, s)));
            if best.value < per_edge[edge][j].value { best } else { per_edge[edge][j] }
        })
        .collect();
    least(found)
}

/// The smallest of the samples met by a search in `range`.
fn golden_section(range: std::ops::Range<f64>, f: impl Fn(f64) -> Sample) -> Sample {
    let ratio = 0.5 * (5f64.sqrt() - 1.0);
    let (mut low, mut high) = (range.start, range.end);
    let (mut x, mut y) = (high - ratio * (high - low), low + ratio * (high - low));
    let (mut a, mut b) = (f(x), f(y));
    let mut best = if b.value < a.value { b } else { a };
    // 0.618^40 is 4e-9; the value is known to the square of that.
    for _ in 0..40 {
        if a.value <= b.value {
            (high, y, b) = (y, x, a);
            x = high - ratio * (high - low);
            a = f(x);
            best = if a.value < best.value { a } else { best };
        } else {
            (low, x, a) = (x, y, b);
            y = low + ratio * (high - low);
            b = f(y);
            best = if b.value < best.value { b } else { best };
        }
    }
    best
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
fn follow(step: &Step<f64>, raster: &Raster, mut samples: Vec<Sample>) -> Option<Sample> {
    // Stable: equal values stay in the order of the raster.
    samples.sort_by(|a, b| a.value.total_cmp(&b.value));
    let mut starts: Vec<Sample> = Vec::with_capacity(FOLLOWED);
    for sample in samples {
        if starts.len() == FOLLOWED {
            break;
        }
        let near = |s: &Sample| (0..2).all(|axis| (s.at[axis] - sample.at[axis]).abs() < APART * raster.pixel);
        if !starts.iter().any(near) {
            starts.push(sample);
        }
    }
    // What the device or single precision found is judged again here.
    let found: Vec<Sample> = starts.par_iter().map(|s| descend(step, jacobian(step, s.at), raster.pixel)).collect();
    least(found)
}

/// Downhill by compass search within the polygon, from a stride of one pixel.
fn descend(step: &Step<f64>, start: Sample, pixel: f64) -> Sample {
    const DIAGONAL: f64 = std::f64::consts::FRAC_1_SQRT_2;
    const COMPASS: [[f64; 2]; 8] = [
        [1.0, 0.0],
        [DIAGONAL, DIAGONAL],
        [0.0, 1.0],
        [-DIAGONAL, DIAGONAL],
        [-1.0, 0.0],
        [-DIAGONAL, -DIAGONAL],
        [0.0, -1.0],
        [DIAGONAL, -DIAGONAL],
    ];
    let mut best = start;
    let mut stride = pixel;
    // A smooth minimum is known to the square of the last stride.
    let finest = pixel.min(1e-3) * 1e-4;
    for _ in 0..200 {
        if !(stride > finest) || !best.value.is_finite() {
            break;
        }
        let around = COMPASS
            .iter()
            .map(|d| [best.at[0] + stride * d[0], best.at[1] + stride * d[1]])
            .filter(|p| contains(&step.outline, *p))
            .map(|p| jacobian(step, p));
        match least(around) {
            Some(s) if s.value < best.value => {
                best = s;
                stride *= 1.25;
            }
            _ => stride *= 0.4,
        }
    }
    best
}
