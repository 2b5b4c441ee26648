//! Decoding by the hierarchy (section 3.2): splits and, stage by stage from coarse to fine,
//! minimisation of G.

use web_time::Instant;

use super::decode::split_level;
use super::gpu::DeviceStages;
use super::hierarchy::Stage;
use super::solver::{Method, Solved, StageSolver, Stop};
use super::springs::{Springs, slot_lengths};
use super::sweeps::gauss_seidel;
use super::{Hierarchy, V3};
use crate::control;
use crate::engine::Engine;
use crate::error::{Error, Result};

/// How far the minimisation goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quality {
    /// Stages with at most so many free vertices are solved to convergence by sparse Cholesky.
    pub direct: usize,
    /// Most Gauss-Newton iterations there.
    pub direct_iterations: usize,
    /// Relative decrease of G that ends them.
    pub decrease: f64,
    /// Gauss-Newton steps on each finer stage.
    pub steps: usize,
    /// Steps of conjugate gradients in each.
    pub gradient_steps: usize,
    /// Sweeps of the paper's Gauss-Seidel over the whole mesh at the end.
    pub sweeps: usize,
    /// Stiffness of the edges' lengths, 0 for plain encoding; 1 already keeps lengths well. The
    /// term is 1/2 stiffness sum L² (|e| - s L)² over the edges, L being their rest length and s
    /// the scale of the start, about a shape of diagonal one.
    pub stiffness: f64,
}

impl Quality {
    /// Vertex splits only: what the paper calls decoding without optimisation.
    pub const SPLITS: Self =
        Self { direct: 0, direct_iterations: 0, decrease: 0.0, steps: 0, gradient_steps: 0, sweeps: 0, stiffness: 0.0 };
    /// The coarse stages alone are solved, for previews.
    pub const PREVIEW: Self = Self { direct: 1800, direct_iterations: 8, decrease: 1e-3, ..Self::SPLITS };
    /// Coarse stages converged, two inexact steps on each finer one.
    pub const DEFAULT: Self =
        Self { direct: 7000, direct_iterations: 12, decrease: 1e-2, steps: 2, gradient_steps: 150, ..Self::SPLITS };
    /// The minimum of G, by direct solves up to 30,000 free vertices.
    pub const CONVERGED: Self = Self {
        direct: 30_000,
        direct_iterations: 60,
        decrease: 1e-6,
        steps: 20,
        gradient_steps: 1000,
        sweeps: 0,
        stiffness: 0.0,
    };
}

/// What happened on one stage.
#[derive(Clone, Debug, PartialEq)]
pub struct LevelReport {
    /// Free vertices.
    pub free: usize,
    /// Gauss-Newton iterations.
    pub iterations: usize,
    /// Steps of conjugate gradients, all iterations together.
    pub gradient_steps: usize,
    /// G after the splits.
    pub before: f64,
    /// G after the minimisation.
    pub after: f64,
    /// Seconds of this stage.
    pub seconds: f64,
    /// Whether a device minimised, in single precision.
    pub on_device: bool,
}

impl LevelReport {
    pub(super) fn new(free: usize, solved: &Solved, clock: Instant) -> Self {
        Self {
            free,
            iterations: solved.iterations,
            gradient_steps: solved.gradient_steps,
            before: solved.before,
            after: solved.after,
            seconds: clock.elapsed().as_secs_f64(),
            on_device: false,
        }
    }

    /// Adds what `further` did on the same stage afterwards.
    pub(super) fn add(&mut self, further: &Self) {
        self.iterations += further.iterations;
        self.gradient_steps += further.gradient_steps;
        self.after = further.after;
        self.seconds += further.seconds;
    }
}

/// What a decode did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DecodeReport {
    /// Coarse to fine; empty if the frame before was returned.
    pub levels: Vec<LevelReport>,
}

impl DecodeReport {
    /// Gauss-Newton iterations of all stages.
    pub fn iterations(&self) -> usize {
        self.levels.iter().map(|l| l.iterations).sum()
    }
}

/// Without a frame before, stages of at most so many free vertices are first converged with this
/// stiffness. G alone has minima in which a twisted part is pinched and triangles flip: on the
/// standard tube of 2,000 vertices turned by 180 degrees, 10 of them without this start and none
/// with it.
const START_FREE: usize = 2000;
const START: f64 = 1.0;

/// A hierarchy with everything that frames share: one decoder a mesh and held set.
#[derive(Debug)]
pub struct Decoder {
    hierarchy: Hierarchy,
    /// The rest shape in the hierarchy's numbering.
    rest: Vec<V3<f64>>,
    solvers: Vec<StageSolver>,
    /// The last held positions and all that followed from them.
    last: Option<Vec<V3<f64>>>,
    device: Option<DeviceStages>,
}

impl Decoder {
    /// A decoder for `hierarchy`; `rest` is the shape it was made from, one position a mesh vertex.
    pub fn new(hierarchy: Hierarchy, rest: &[V3<f64>]) -> Self {
        let rest = hierarchy.order.iter().map(|&v| rest[v as usize]).collect();
        let solvers = hierarchy.stages.iter().map(|_| StageSolver::default()).collect();
        Self { hierarchy, rest, solvers, last: None, device: None }
    }

    /// Does on the device of `engine`, if it has one, what it is made for: splits, and stages
    /// solved by conjugate gradients, in single precision. Coarse stages are solved on the CPU, as
    /// are all with a stiffness; so is what the device cannot hold ([`DeviceStages::notes`]).
    pub fn decode_on(&mut self, engine: &Engine) {
        self.device = DeviceStages::new(engine);
    }

    /// What is done on a device, if one is in use.
    pub fn device(&self) -> Option<&DeviceStages> {
        self.device.as_ref()
    }

    /// The hierarchy.
    pub fn hierarchy(&self) -> &Hierarchy {
        &self.hierarchy
    }

    /// The rest shape in the hierarchy's numbering.
    pub fn rest(&self) -> &[V3<f64>] {
        &self.rest
    }

    /// Positions of all vertices (in the hierarchy's numbering) for given positions of the held
    /// ones (in its order).
    ///
    /// `start` moves a free vertex of the base mesh to where it begins, given its number and rest
    /// position; a similarity of the held vertices makes the result exact. `scale` is its scale,
    /// which edges keep if the quality asks for it. With `warm`, and after an earlier frame of this
    /// decoder, coarse stages begin at that frame's positions; equal held positions give equal
    /// results, bit for bit.
    ///
    /// # Errors
    /// [`Error::Input`] for a wrong number of positions or one that is not finite;
    /// [`Error::Numeric`] if no finite shape was found.
    pub fn decode(
        &mut self,
        held: &[V3<f64>],
        start: impl Fn(usize, V3<f64>) -> V3<f64>,
        scale: f64,
        quality: &Quality,
        warm: bool,
    ) -> Result<(Vec<V3<f64>>, DecodeReport)> {
        self.check(held)?;
        let h = &self.hierarchy;
        let last = self.last.take().filter(|_| warm);
        if let Some(last) = last.as_ref().filter(|l| l[..h.held] == *held) {
            let same = last.clone();
            self.last = Some(same.clone());
            return Ok((same, DecodeReport::default()));
        }
        let mut positions = vec![[0.0; 3]; h.order.len()];
        positions[..h.held].copy_from_slice(held);
        for v in h.held..h.base {
            positions[v] = start(v, self.rest[v]);
        }
        let mut report = DecodeReport::default();
        // Stages before this one have their splits.
        let mut placed = 0;
        for (k, stage) in h.stages.iter().enumerate() {
            control::check()?;
            let clock = Instant::now();
            let free = stage.vertices - h.held;
            let method = method(free, quality);
            match &last {
                Some(last) if method == Method::Direct => {
                    positions[h.held..stage.vertices].copy_from_slice(&last[h.held..stage.vertices]);
                }
                _ if k < placed => {}
                _ => {
                    let pause = h.stages[k..].iter().position(|s| pauses(s.vertices - h.held, quality));
                    placed = pause.map_or(h.stages.len(), |p| k + p + 1);
                    let levels = stage.levels.start..h.stages[placed - 1].levels.end;
                    let device = self.device.as_mut().filter(|_| method != Method::Direct);
                    split(device, h, levels, &mut positions)?;
                }
            }
            let stop = stop(method, quality);
            if stop.iterations > 0 {
                let mut started = 0;
                if last.is_none() && free <= START_FREE && method == Method::Direct && quality.stiffness < START {
                    let springs = springs(stage, &self.rest, scale, START);
                    let part = &mut positions[..stage.vertices];
                    let (stencils, encoding) = (&stage.stencils, &stage.encoding);
                    started = self.solvers[k]
                        .minimise(stencils, encoding, springs.as_ref(), h.held, method, stop, part)?
                        .iterations;
                }
                let springs = springs(stage, &self.rest, scale, quality.stiffness);
                let positions = &mut positions[..stage.vertices];
                let done = match (&mut self.device, method, &springs) {
                    (Some(device), Method::Gradients(steps), None) => device.minimise(h, k, steps, stop, positions)?,
                    _ => None,
                };
                let on_device = done.is_some();
                let mut solved = match done {
                    Some(solved) => solved,
                    None => {
                        let (s, e) = (&stage.stencils, &stage.encoding);
                        self.solvers[k].minimise(s, e, springs.as_ref(), h.held, method, stop, positions)?
                    }
                };
                solved.iterations += started;
                report.levels.push(LevelReport { on_device, ..LevelReport::new(free, &solved, clock) });
            }
            if k + 1 == h.stages.len() && quality.sweeps > 0 {
                gauss_seidel(&stage.stencils, &stage.encoding, h.held, quality.sweeps, &mut positions);
            }
        }
        if positions.iter().flatten().any(|x| !x.is_finite()) {
            return Err(Error::numeric(
                "no finite shape was found for these handles",
                "Move the handles less far at once, or add handles between them",
            ));
        }
        self.last = Some(positions.clone());
        Ok((positions, report))
    }

    /// Fails unless there is a finite position for every held vertex.
    pub(super) fn check(&self, held: &[V3<f64>]) -> Result<()> {
        let h = &self.hierarchy;
        if held.len() != h.held {
            let what = format!("{} positions for {} held vertices", held.len(), h.held);
            return Err(Error::input(what, "Give one each, in the order of the hierarchy"));
        }
        if let Some(k) = held.iter().position(|p| p.iter().any(|x| !x.is_finite())) {
            let what = format!("the position of held vertex {} is not finite", h.order[k]);
            return Err(Error::input(what, "Give numbers"));
        }
        Ok(())
    }

    /// Minimises G on the whole mesh alone, from `positions` (in the hierarchy's numbering, held
    /// ones in place) to where it ends.
    ///
    /// # Errors
    /// [`Error::Input`] for a wrong number of positions; [`Error::Numeric`] if a system could not
    /// be set up.
    pub fn refine(&mut self, positions: &mut [V3<f64>], scale: f64, quality: &Quality) -> Result<LevelReport> {
        let h = &self.hierarchy;
        let (Some(stage), Some(solver)) = (h.stages.last(), self.solvers.last_mut()) else {
            return Err(Error::input("the hierarchy is empty", "Make it from a mesh"));
        };
        if positions.len() != stage.vertices {
            let what = format!("{} positions for {} vertices", positions.len(), stage.vertices);
            return Err(Error::input(what, "Give one each, in the hierarchy's numbering"));
        }
        let clock = Instant::now();
        let free = stage.vertices - h.held;
        let method = method(free, quality);
        let springs = springs(stage, &self.rest, scale, quality.stiffness);
        let stop = stop(method, quality);
        let solved =
            solver.minimise(&stage.stencils, &stage.encoding, springs.as_ref(), h.held, method, stop, positions)?;
        Ok(LevelReport::new(free, &solved, clock))
    }
}

/// Splits of some levels, on the device if one is in use and can hold them.
fn split(
    device: Option<&mut DeviceStages>,
    h: &Hierarchy,
    levels: std::ops::Range<usize>,
    positions: &mut [V3<f64>],
) -> Result<()> {
    if let Some(device) = device
        && device.split(h, levels.clone(), positions)?
    {
        return Ok(());
    }
    for level in levels {
        let rows = h.level_start[level] as usize..h.level_start[level + 1] as usize;
        split_level(&h.splits, &h.split_encoding, rows, positions);
    }
    Ok(())
}

/// Whether a stage with so many free vertices is minimised, so that splits of finer ones must wait
/// for it.
fn pauses(free: usize, quality: &Quality) -> bool {
    stop(method(free, quality), quality).iterations > 0
}

/// The springs of a stage over the lengths at rest times the scale.
pub(super) fn springs(stage: &Stage, rest: &[V3<f64>], scale: f64, stiffness: f64) -> Option<Springs> {
    (stiffness > 0.0).then(|| Springs::new(&slot_lengths(&stage.stencils, rest, scale), stiffness, scale)).flatten()
}

fn method(free: usize, quality: &Quality) -> Method {
    if free <= quality.direct { Method::Direct } else { Method::Gradients(quality.gradient_steps) }
}

fn stop(method: Method, quality: &Quality) -> Stop {
    let iterations = match method {
        Method::Direct => quality.direct_iterations,
        Method::Gradients(_) => quality.steps,
    };
    Stop { iterations, decrease: quality.decrease }
}
