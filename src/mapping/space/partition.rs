//! Partitions: into which steps a map in space is cut so that none folds, as far as is sampled
//! (paper, sections 3.1, 4.1, 4.4, 4.5).
//!
//! Steps are settled from the first to the last, so that the vertices of the model are where the
//! map has carried them when a step is tested: Listing 1 of the paper, depth first.

use std::collections::BTreeMap;

use glam::DVec3;

use super::jacobian_min::{Minimum, RESOLUTION, Samples, jacobian_min_3d};
use super::{Cage, Frame, Step, VertexPath, map_points_3d, self_intersections};
use crate::control;
use crate::engine::Engine;
use crate::error::{Error, Result};
use crate::mapping::knots::continuous_knots;
use crate::progress::Progress;

/// Vertices of all polyhedra of a partition, at most.
const MAX_VERTICES: u64 = 1 << 24;
/// Equal steps, at most: a vertex goes through all of them.
const MOST_EQUAL_STEPS: u32 = 10_000;
/// The smallest `eps`.
const LEAST_EPS: f64 = 1e-4;
/// Pairs of intersecting triangles that are named, per knot.
const NAMED: usize = 1 << 16;

/// How the steps are chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PartitionKind {
    /// One step, whether it folds or not.
    Direct,
    /// So many equal steps, whether they fold or not.
    Uniform(u32),
    /// A step that folds is halved (Listing 1) until it is no longer than `eps`.
    Binary,
    /// As binary, with steps that appear and move continuously with the cage (section 4.4).
    Continuous,
}

/// What a partition is to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PartitionOptions {
    /// How the steps are chosen.
    pub kind: PartitionKind,
    /// Steps no longer than this are not halved any more, 1e-4..=1.
    pub eps: f64,
    /// Cells of the grid of samples along the longest side of a polyhedron.
    pub resolution: u32,
}

impl Default for PartitionOptions {
    fn default() -> Self {
        Self { kind: PartitionKind::Binary, eps: 0.01, resolution: RESOLUTION }
    }
}

/// One step of a partition.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepReport {
    /// Its knots.
    pub from: f64,
    /// The later one.
    pub to: f64,
    /// The smallest Jacobian found.
    pub minimum: Minimum,
}

/// A polyhedron that intersects itself.
#[derive(Clone, Debug, PartialEq)]
#[doc(hidden)]
pub struct Intersection {
    /// Its knot.
    pub knot: f64,
    /// Pairs of triangles that meet.
    pub pairs: usize,
    /// The first of them.
    pub first: (u32, u32),
}

/// The polyhedra that a composite map goes through.
#[derive(Clone, Debug)]
pub struct Partition {
    /// One for each knot; the first is the source, the last the target.
    pub polyhedra: Vec<Vec<DVec3>>,
    /// From 0 to 1, rising.
    pub knots: Vec<f64>,
    /// Between successive knots.
    pub steps: Vec<StepReport>,
    /// Which of the polyhedra intersect themselves.
    pub intersections: Vec<Intersection>,
}

impl Partition {
    /// Whether a step folds, as far as was sampled.
    pub fn folds(&self) -> bool {
        self.steps.iter().any(|step| !step.minimum.positive())
    }
}

/// Finds the steps of a map between the polyhedra of `cage` along `path`; `model` are points in the
/// source whose images are tested in every step, next to the samples of the inside.
///
/// # Errors
/// [`Error::Option`] for options outside their ranges or too many steps, [`Error::Numeric`] where
/// the path has no polyhedron, what the device returns.
pub fn partition(
    engine: &Engine,
    cage: &Cage,
    path: &dyn VertexPath,
    model: &[DVec3],
    options: &PartitionOptions,
    progress: &dyn Progress,
) -> Result<Partition> {
    check(cage, options)?;
    let mut walk = Walk {
        engine,
        cage,
        path,
        resolution: options.resolution,
        scale: Frame::common_scale([&cage.source[..], &cage.target[..]]),
        polyhedra: BTreeMap::new(),
    };
    let most = (4.0 / options.eps) as usize;
    progress.stage("partition", 0);
    let start = match options.kind {
        PartitionKind::Direct | PartitionKind::Binary => vec![0.0, 1.0],
        PartitionKind::Uniform(m) => (0..=m).map(|k| f64::from(k) / f64::from(m)).collect(),
        PartitionKind::Continuous => continuous_knots(options.eps, most, |intervals: &[(f64, f64)]| {
            intervals.iter().map(|&(a, b)| Ok(walk.minimum(a, b)?.1.value)).collect::<Result<Vec<f64>>>()
        })?,
    };
    let refine = matches!(options.kind, PartitionKind::Binary | PartitionKind::Continuous);
    let frame = walk.frame(0.0)?;
    let mut at: Vec<[f32; 3]> = model.iter().map(|&p| frame.local(p)).collect();
    let mut left: Vec<(f64, f64)> = start.windows(2).rev().map(|w| (w[0], w[1])).collect();
    let mut steps = Vec::new();
    while let Some((a, b)) = left.pop() {
        control::check()?;
        let c = (a + b) / 2.0;
        let finer = b - a > options.eps && steps.len() + left.len() < most && a < c && c < b;
        let (step, mut minimum) = walk.minimum(a, b)?;
        progress.advance(1);
        // Where the samples of the inside fold already, the model need not be asked.
        if minimum.positive() || !(refine && finer) {
            let found = jacobian_min_3d(engine, &step, &walk.frame(a)?, &Samples::none(), &at)?;
            minimum = if found.value < minimum.value { found } else { minimum };
        }
        if refine && finer && !minimum.positive() {
            left.extend([(c, b), (a, c)]);
            continue;
        }
        map_points_3d(engine, std::slice::from_ref(&step), &mut at)?;
        steps.push(StepReport { from: a, to: b, minimum });
    }
    let knots: Vec<f64> = std::iter::once(0.0).chain(steps.iter().map(|s| s.to)).collect();
    let polyhedra = knots.iter().map(|&t| walk.at(t).map(<[DVec3]>::to_vec)).collect::<Result<Vec<_>>>()?;
    let intersections = knots
        .iter()
        .zip(&polyhedra)
        .filter_map(|(&knot, p)| {
            let found = self_intersections(&cage.triangles, p, NAMED);
            found.first().map(|&first| Intersection { knot, pairs: found.len(), first })
        })
        .collect();
    Ok(Partition { polyhedra, knots, steps, intersections })
}

fn check(cage: &Cage, options: &PartitionOptions) -> Result<()> {
    if !(LEAST_EPS..=1.0).contains(&options.eps) {
        return Err(Error::option("eps", format!("{} is not in {LEAST_EPS}..=1", options.eps), "Take 0.01"));
    }
    let steps = match options.kind {
        PartitionKind::Direct => 1,
        PartitionKind::Uniform(0) => {
            return Err(Error::option("partition", "a uniform partition has no steps", "Give at least 1"));
        }
        PartitionKind::Uniform(steps) if steps > MOST_EQUAL_STEPS => {
            let remedy = format!("Give at most {MOST_EQUAL_STEPS}; binary makes as many as are needed");
            return Err(Error::option("partition", format!("{steps} steps are too many"), remedy));
        }
        PartitionKind::Uniform(steps) => u64::from(steps),
        _ => (4.0 / options.eps).ceil() as u64,
    };
    let vertices = cage.source.len() as u64;
    if (steps + 1).saturating_mul(vertices) > MAX_VERTICES {
        return Err(Error::option(
            "partition",
            format!("{steps} steps of {vertices} vertices are more than {MAX_VERTICES} vertices in all"),
            "Take fewer steps or a larger eps",
        ));
    }
    Ok(())
}

/// What was found along a path so far. Times are not negative: their bits are ordered as they are.
struct Walk<'a> {
    engine: &'a Engine,
    cage: &'a Cage,
    path: &'a dyn VertexPath,
    resolution: u32,
    scale: f64,
    polyhedra: BTreeMap<u64, Vec<DVec3>>,
}

impl Walk<'_> {
    fn at(&mut self, t: f64) -> Result<&[DVec3]> {
        if !self.polyhedra.contains_key(&t.to_bits()) {
            let positions = self.path.positions(t)?;
            if positions.len() != self.cage.source.len() || positions.iter().any(|p| !p.is_finite()) {
                return Err(Error::numeric(
                    format!("the {} path has no finite polyhedron at t = {t}", self.path.name()),
                    "Take another --path",
                ));
            }
            self.polyhedra.insert(t.to_bits(), positions);
        }
        Ok(&self.polyhedra[&t.to_bits()])
    }

    fn frame(&mut self, t: f64) -> Result<Frame> {
        let scale = self.scale;
        Ok(Frame::of(self.at(t)?, scale))
    }

    /// The step over an interval and the smallest Jacobian of its samples.
    fn minimum(&mut self, a: f64, b: f64) -> Result<(Step<f64>, Minimum)> {
        let frame = self.frame(a)?;
        let (from, to) = (self.at(a)?.to_vec(), self.at(b)?.to_vec());
        let step = Step::new(&self.cage.triangles, &from, &to, self.scale);
        let samples = Samples::new(&step, self.resolution)?;
        let minimum = jacobian_min_3d(self.engine, &step, &frame, &samples, &[])?;
        Ok((step, minimum))
    }
}
