//! From samples of the Jacobian to the minima beside them, several at a time: each round of all
//! searches is one sweep on lanes, in double precision.

use std::ops::Range;

use super::jacobian_min::{Sample, judged};
use super::samples::{EdgeSamples, contains, on_edge};
use super::sweep::{SweepPoints, SweepStep};
use crate::engine::Lanes;

/// Rounds of a search downhill, at most.
const ROUNDS: usize = 200;

/// The Jacobian at points, at least one.
pub(super) fn judge(step: &SweepStep<'_, f64>, points: &[[f64; 2]]) -> Vec<Sample> {
    let jacobians = step.jacobians(Lanes::detect(), &SweepPoints::few(points));
    points.iter().zip(jacobians).map(|(&at, j)| Sample { value: judged(j), at }).collect()
}

/// The smaller sample, the first where they are equal.
pub(super) fn least(samples: impl IntoIterator<Item = Sample>) -> Option<Sample> {
    samples.into_iter().reduce(|a, b| if b.value < a.value { b } else { a })
}

/// A search downhill: the best place so far, and how far it looks around.
struct Walk {
    best: Sample,
    stride: f64,
}

/// Downhill by compass search within the polygon, from `starts` with a stride of `pixel` until
/// strides are shorter than `finest`: a smooth minimum is known to the square of that.
pub(super) fn downhill(step: &SweepStep<'_, f64>, starts: &[[f64; 2]], pixel: f64, finest: f64) -> Vec<Sample> {
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
    if starts.is_empty() {
        return Vec::new();
    }
    let mut walks: Vec<Walk> = judge(step, starts).into_iter().map(|best| Walk { best, stride: pixel }).collect();
    for _ in 0..ROUNDS {
        let mut points = Vec::with_capacity(COMPASS.len() * walks.len());
        let mut ranges = Vec::with_capacity(walks.len());
        for (number, walk) in walks.iter().enumerate() {
            if !(walk.stride > finest) || !walk.best.value.is_finite() {
                continue;
            }
            let first = points.len();
            let around = COMPASS.iter().map(|d| std::array::from_fn(|k| walk.best.at[k] + walk.stride * d[k]));
            points.extend(around.filter(|p| contains(&step.step.outline, *p)));
            ranges.push((number, first..points.len()));
        }
        if ranges.is_empty() {
            break;
        }
        let samples = if points.is_empty() { Vec::new() } else { judge(step, &points) };
        for (number, range) in ranges {
            let walk = &mut walks[number];
            match least(samples[range].iter().copied()) {
                Some(s) if s.value < walk.best.value => {
                    walk.best = s;
                    walk.stride *= 1.25;
                }
                _ => walk.stride *= 0.4,
            }
        }
    }
    walks.into_iter().map(|walk| walk.best).collect()
}

/// A search by golden section on an edge.
struct Section {
    edge: (usize, usize),
    range: Range<f64>,
    /// Two fractions inside of the range, rising, and what is there.
    inner: [(f64, Sample); 2],
    best: Sample,
}

/// The smallest samples that searches by golden section meet, on edges (i, k) in ranges of
/// fractions of their lengths. After `rounds` a range is 0.618^rounds of what it was; the value is
/// known to the square of that.
pub(super) fn along_edges(
    step: &SweepStep<'_, f64>,
    starts: &[((usize, usize), Range<f64>)],
    rounds: usize,
) -> Vec<Sample> {
    let ratio = 0.5 * (5f64.sqrt() - 1.0);
    let outline = &step.step.outline;
    let at = |(i, k): (usize, usize), s: f64| on_edge(outline, i, k, s);
    if starts.is_empty() {
        return Vec::new();
    }
    let fractions = |r: &Range<f64>| {
        let part = ratio * (r.end - r.start);
        [r.end - part, r.start + part]
    };
    let first: Vec<[f64; 2]> = starts.iter().flat_map(|(edge, range)| fractions(range).map(|s| at(*edge, s))).collect();
    let samples = judge(step, &first);
    let mut sections: Vec<Section> = starts
        .iter()
        .zip(samples.chunks_exact(2))
        .map(|((edge, range), pair)| {
            let [x, y] = fractions(range);
            let (a, b) = (pair[0], pair[1]);
            let best = if b.value < a.value { b } else { a };
            Section { edge: *edge, range: range.clone(), inner: [(x, a), (y, b)], best }
        })
        .collect();
    for _ in 0..rounds {
        // Which of the two is new, and where.
        let next: Vec<(usize, f64)> = sections
            .iter_mut()
            .map(|s| {
                let [(x, a), (y, b)] = s.inner;
                let side = usize::from(a.value > b.value);
                if side == 0 {
                    s.range.end = y;
                    s.inner[1] = (x, a);
                } else {
                    s.range.start = x;
                    s.inner[0] = (y, b);
                }
                (side, fractions(&s.range)[side])
            })
            .collect();
        let points: Vec<[f64; 2]> = sections.iter().zip(&next).map(|(s, &(_, f))| at(s.edge, f)).collect();
        for ((section, (side, fraction)), sample) in sections.iter_mut().zip(next).zip(judge(step, &points)) {
            section.inner[side] = (fraction, sample);
            if sample.value < section.best.value {
                section.best = sample;
            }
        }
    }
    sections.into_iter().map(|section| section.best).collect()
}

/// Samples of the edges, `samples.fractions.len()` on each.
pub(super) fn edge_samples(step: &SweepStep<'_, f64>, ends: &[(usize, usize)], samples: &EdgeSamples) -> Vec<Sample> {
    let outline = &step.step.outline;
    let place = |&(i, k): &(usize, usize)| samples.fractions.iter().map(move |&s| on_edge(outline, i, k, s));
    let points: Vec<[f64; 2]> = ends.iter().flat_map(place).collect();
    judge(step, &points)
}
