//! The parts of a decode that a device does.

use std::collections::BTreeSet;
use std::ops::Range;

use glam::DVec3;

use super::gradients::StageSolver;
use super::split_level::{SPLIT_LEVEL, SplitLevels};
use super::stage::{ENCODING_APPLY, StageKernels};
use crate::encoding::solver::{Solved, Stop};
use crate::encoding::{Hierarchy, V3};
use crate::engine::{Engine, Gpu};
use crate::error::{Error, Result};

/// A part of the work, made ready when it is first wanted.
#[derive(Debug, Default)]
enum Part<T> {
    #[default]
    Untried,
    Ready(T),
    /// The device cannot hold it.
    Refused,
}

impl<T> Part<T> {
    /// The part, made by `new` if it was not tried yet. What does not fit the device is left to the
    /// CPU, and a note says why.
    fn get(
        &mut self,
        what: impl FnOnce() -> String,
        notes: &mut Vec<String>,
        new: impl FnOnce() -> Result<T>,
    ) -> Result<Option<&T>> {
        if let Self::Untried = self {
            *self = match new() {
                Ok(made) => Self::Ready(made),
                Err(why @ (Error::Memory { .. } | Error::Capability { .. })) => {
                    notes.push(format!("{} on the CPU: {why}", what()));
                    Self::Refused
                }
                Err(e) => return Err(e),
            };
        }
        Ok(if let Self::Ready(made) = self { Some(made) } else { None })
    }
}

/// What a decoder has on a device: the splits, and the stages that conjugate gradients solve.
///
/// Positions go there about the held vertices' mean and at a size near one, in single precision.
#[derive(Debug)]
pub struct DeviceStages {
    engine: Engine,
    splits: Part<SplitLevels>,
    solvers: Vec<Part<StageSolver>>,
    ran: BTreeSet<&'static str>,
    notes: Vec<String>,
}

impl DeviceStages {
    /// Nothing on the device of `engine` yet; `None` if it has none, or keeps these kernels on the
    /// CPU.
    pub(crate) fn new(engine: &Engine) -> Option<Self> {
        let wanted = [SPLIT_LEVEL.name, ENCODING_APPLY.name].iter().any(|k| engine.gpu_for(k).is_some());
        wanted.then(|| Self {
            engine: engine.clone(),
            splits: Part::Untried,
            solvers: Vec::new(),
            ran: BTreeSet::new(),
            notes: Vec::new(),
        })
    }

    /// What ran on the device so far.
    pub fn ran(&self) -> impl Iterator<Item = &'static str> {
        self.ran.iter().copied()
    }

    /// What the device could not hold, a sentence each.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Splits of some levels; `false` if the CPU must do them.
    pub(crate) fn split(&mut self, h: &Hierarchy, levels: Range<usize>, positions: &mut [V3<f64>]) -> Result<bool> {
        let Some(gpu) = self.engine.gpu_for(SPLIT_LEVEL.name) else { return Ok(false) };
        let new = || SplitLevels::new(gpu, h, 1);
        let Some(splits) = self.splits.get(|| "vertex splits".into(), &mut self.notes, new)? else {
            return Ok(false);
        };
        let known = h.base + h.level_start[levels.start] as usize;
        let frame = Frame::new(&positions[..h.held], &positions[..known]);
        let mut local = vec![[0.0; 4]; positions.len()];
        local[..known].iter_mut().zip(&positions[..known]).for_each(|(x, p)| *x = frame.local(*p));
        let end = h.base + h.level_start[levels.end] as usize;
        splits.place(gpu, levels, &mut local)?;
        positions[known..end].iter_mut().zip(&local[known..end]).for_each(|(p, x)| *p = frame.back(*x));
        self.ran.insert(SPLIT_LEVEL.name);
        Ok(true)
    }

    /// Gauss-Newton with conjugate gradients on stage `k`; `None` if the CPU must do it.
    pub(crate) fn minimise(
        &mut self,
        h: &Hierarchy,
        k: usize,
        steps: usize,
        stop: Stop,
        positions: &mut [V3<f64>],
    ) -> Result<Option<Solved>> {
        let Some(gpu) = self.engine.gpu_for(ENCODING_APPLY.name) else { return Ok(None) };
        self.solvers.resize_with(h.stages.len(), Part::default);
        let new = || stage_solver(gpu, h, k);
        let what = || format!("the stage of {} vertices is solved", h.stages[k].vertices);
        let Some(solver) = self.solvers[k].get(what, &mut self.notes, new)? else { return Ok(None) };
        let frame = Frame::new(&positions[..h.held], positions);
        let mut local: Vec<[f32; 4]> = positions.iter().map(|&p| frame.local(p)).collect();
        let mut solved = solver.minimise(gpu, &mut local, steps, stop)?;
        if solved.iterations > 0 {
            // Given positions stay as they were given.
            positions.iter_mut().zip(&local).skip(h.held).for_each(|(p, x)| *p = frame.back(*x));
        }
        let unit = 1.0 / (frame.scale * frame.scale);
        (solved.before, solved.after) = (solved.before * unit, solved.after * unit);
        self.ran.insert("conjugate_gradients");
        Ok(Some(solved))
    }
}

fn stage_solver(gpu: &Gpu, h: &Hierarchy, k: usize) -> Result<StageSolver> {
    let stage = &h.stages[k];
    StageSolver::new(gpu, StageKernels::new(gpu, &stage.stencils, &stage.encoding, h.held)?)
}

/// Where single precision has its origin, and its unit: a power of two, so that scaling rounds
/// nothing.
struct Frame {
    origin: DVec3,
    scale: f64,
}

impl Frame {
    fn new(centred: &[V3<f64>], all: &[V3<f64>]) -> Self {
        let origin = centred.iter().map(|&p| DVec3::from(p)).sum::<DVec3>() / centred.len().max(1) as f64;
        let extent = all.iter().map(|&p| (DVec3::from(p) - origin).abs().max_element()).fold(0.0, f64::max);
        let exponent = extent.log2().floor();
        let scale = if exponent.abs() < 900.0 { 0.5 * (-exponent).exp2() } else { 1.0 };
        Self { origin, scale }
    }

    fn local(&self, p: V3<f64>) -> [f32; 4] {
        let [x, y, z] = ((DVec3::from(p) - self.origin) * self.scale).as_vec3().to_array();
        [x, y, z, 0.0]
    }

    fn back(&self, [x, y, z, _]: [f32; 4]) -> V3<f64> {
        (DVec3::new(x.into(), y.into(), z.into()) / self.scale + self.origin).to_array()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_bring_shapes_near_one_and_back() {
        for size in [1e-30, 1e-3, 1.0, 3.0, 1e20] {
            let shape: Vec<V3<f64>> =
                [[0.0, 1.0, 2.0], [0.5, -1.0, 0.25]].map(|p| p.map(|x| (100.0 + x) * size)).to_vec();
            let frame = Frame::new(&shape, &shape);
            for &p in &shape {
                let local = frame.local(p);
                assert!(local.iter().all(|x| x.abs() <= 1.0), "{local:?}");
                assert!(DVec3::from(frame.back(local)).distance(p.into()) <= 3e-7 * size);
            }
            assert!(frame.local(shape[0]).iter().any(|x| x.abs() >= 0.25));
        }
        for odd in [vec![], vec![[0.0; 3]], vec![[f64::NAN; 3]]] {
            assert_eq!(Frame::new(&odd, &odd).scale, 1.0);
        }
    }
}
