//! In-betweens: one coarse stage is followed in small steps, finer stages are solved at the last.
//!
//! The shape in the large is decided on a stage of at most [`TRACKED`] free vertices. There each
//! step begins where the one before ended, so that no step can jump to a folded shape. Finer stages
//! begin from vertex splits of that stage and depend on nothing else: in-betweens of one path are
//! finished in parallel, with the same result for any number of threads.

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use web_time::Instant;

use super::blend::Mix;
use super::cascade::{DecodeReport, LevelReport};
use super::decode::split_level;
use super::solver::{Method, StageSolver, Stop};
use super::springs::Springs;
use super::{Hierarchy, V3};
use crate::error::{Error, Result};

/// The finest stage with at most so many free vertices is followed. A step there takes a hundredth
/// of the time of one on 17,000 vertices. It leads to the minimum that steps on the whole mesh lead
/// to, on the bodies of `docs/measurements.md`.
const TRACKED: usize = 2000;
/// Most Gauss-Newton iterations of one step there.
const ITERATIONS: usize = 60;
/// Relative decrease of G that ends a step on the way.
const PASSING: f64 = 1e-3;
/// Relative decrease of G that ends the last step where the stage is the whole mesh.
const ARRIVED: f64 = 1e-6;

/// How far the finer stages of an in-between are minimised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MarchQuality {
    /// Stages with at most so many free vertices are solved by sparse Cholesky, finer ones by
    /// conjugate gradients.
    pub direct: usize,
    /// Most Gauss-Newton iterations on each stage between the one that is followed and the whole
    /// mesh.
    pub middle: usize,
    /// Most Gauss-Newton iterations on the whole mesh.
    pub fine: usize,
    /// Relative decrease of G that ends them.
    pub decrease: f64,
    /// Steps of conjugate gradients in each.
    pub gradient_steps: usize,
    /// Steps of conjugate gradients after each direct one on the whole mesh, 0 for none. They mend
    /// the few rings that hold a direct step back, and end the work where they find nothing.
    pub polish: usize,
    /// Stiffness of the edges' lengths as in [`super::Quality`]. Averages of encodings belong to no
    /// shape: without a stiffness the size of an in-between drifts along slender parts.
    pub stiffness: f64,
}

impl MarchQuality {
    /// Vertex splits from the stage that is followed.
    pub const PREVIEW: Self =
        Self { direct: 0, middle: 0, fine: 0, decrease: 0.0, gradient_steps: 0, polish: 0, stiffness: 100.0 };
    /// A direct step or a few on the whole mesh. G is within 1.01 of its minimum on the bodies of
    /// `docs/measurements.md`.
    pub const DEFAULT: Self =
        Self { direct: 30_000, middle: 3, fine: 4, decrease: 0.05, gradient_steps: 50, polish: 30, stiffness: 100.0 };
    /// For many in-betweens of one path: conjugate gradients alone. G is within 1.25 of its
    /// minimum on the same bodies.
    pub const FRAMES: Self = Self { direct: 0, ..Self::DEFAULT };
    /// The minimum of G, by direct solves up to 30,000 free vertices.
    pub const CONVERGED: Self = Self { fine: 60, decrease: 1e-6, gradient_steps: 1000, polish: 0, ..Self::DEFAULT };
}

/// The stage that was followed, after the last step of one in-between.
#[derive(Clone, Debug)]
pub(crate) struct Coarse {
    positions: Vec<V3<f64>>,
    level: LevelReport,
}

/// A hierarchy on the way from one shape to another. It owns what the in-betweens share.
#[derive(Debug)]
pub(crate) struct Marcher {
    hierarchy: Hierarchy,
    /// The stage that is followed.
    tracked: usize,
    solver: StageSolver,
    /// Positions on that stage; none before [`Marcher::begin`].
    at: Vec<V3<f64>>,
    /// Factorisations of the finer stages, for as many in-betweens as were finished at once.
    finer: Mutex<Vec<Vec<StageSolver>>>,
}

impl Marcher {
    /// # Errors
    /// [`Error::Input`] for a hierarchy without a stage.
    pub(crate) fn new(hierarchy: Hierarchy) -> Result<Self> {
        if hierarchy.stages.is_empty() {
            return Err(Error::input("the hierarchy is empty", "Make it from a mesh"));
        }
        let tracked = hierarchy.stages.iter().rposition(|s| s.vertices - hierarchy.held <= TRACKED).unwrap_or(0);
        let finer = Mutex::new(Vec::new());
        Ok(Self { hierarchy, tracked, solver: StageSolver::default(), at: Vec::new(), finer })
    }

    /// The hierarchy.
    pub(crate) fn hierarchy(&self) -> &Hierarchy {
        &self.hierarchy
    }

    /// The stages whose coefficients a step needs, the last one of an in-between or another.
    pub(crate) fn stages(&self, last: bool) -> Range<usize> {
        self.tracked..if last { self.hierarchy.stages.len() } else { self.tracked + 1 }
    }

    /// Puts the stage that is followed at `shape`, which has a position for every number of the
    /// hierarchy.
    ///
    /// # Panics
    /// If `shape` has too few positions.
    pub(crate) fn begin(&mut self, shape: &[V3<f64>]) {
        self.at = shape[..self.hierarchy.stages[self.tracked].vertices].to_vec();
    }

    /// Moves the held vertices to `held` and follows the minimum of G for the coefficients `mix`.
    /// `last` ends an in-between.
    ///
    /// # Errors
    /// [`Error::Input`] before [`Marcher::begin`], for a wrong number of held positions, or for one
    /// that is not finite; [`Error::Numeric`] if a system could not be set up.
    pub(crate) fn follow(&mut self, held: &[V3<f64>], mix: &Mix, quality: &MarchQuality, last: bool) -> Result<Coarse> {
        let h = &self.hierarchy;
        if held.len() != h.held || self.at.is_empty() || held.iter().flatten().any(|x| !x.is_finite()) {
            let what = format!("{} positions for {} held vertices, or none to begin with", held.len(), h.held);
            return Err(Error::input(what, "Give a finite position for each, in the order of the hierarchy"));
        }
        self.at[..h.held].copy_from_slice(held);
        let whole = self.tracked + 1 == h.stages.len();
        let decrease = if last && whole { ARRIVED } else { PASSING };
        let stop = Stop { iterations: ITERATIONS, decrease };
        let level = minimise(h, self.tracked, &mut self.solver, mix, Method::Direct, stop, quality, &mut self.at)?;
        Ok(Coarse { positions: self.at.clone(), level })
    }

    /// Positions of all vertices, in the hierarchy's numbering, of an in-between that
    /// [`Marcher::follow`] ended with the same `mix`.
    ///
    /// # Errors
    /// [`Error::Numeric`] if no finite shape was found or a system could not be set up.
    pub(crate) fn finish(
        &self,
        coarse: Coarse,
        mix: &Mix,
        quality: &MarchQuality,
    ) -> Result<(Vec<V3<f64>>, DecodeReport)> {
        let h = &self.hierarchy;
        let idle = self.finer.lock().unwrap_or_else(PoisonError::into_inner).pop();
        let mut solvers = idle.unwrap_or_else(|| h.stages.iter().map(|_| StageSolver::default()).collect());
        let mut positions = coarse.positions;
        positions.resize(h.order.len(), [0.0; 3]);
        let mut report = DecodeReport { levels: vec![coarse.level] };
        for k in self.tracked + 1..h.stages.len() {
            let stage = &h.stages[k];
            for level in stage.levels.clone() {
                let rows = h.level_start[level] as usize..h.level_start[level + 1] as usize;
                split_level(&h.splits, &mix.splits, rows, &mut positions);
            }
            let whole = k + 1 == h.stages.len();
            let iterations = if whole { quality.fine } else { quality.middle };
            // Without an iteration G alone is measured.
            if iterations > 0 || whole {
                let direct = stage.vertices - h.held <= quality.direct;
                let part = &mut positions[..stage.vertices];
                let polish = direct && whole && quality.polish > 0;
                let method = if direct { Method::Direct } else { Method::Gradients(quality.gradient_steps) };
                let once = iterations.min(1);
                let stop = Stop { iterations: if polish { once } else { iterations }, decrease: quality.decrease };
                let mut level = minimise(h, k, &mut solvers[k], mix, method, stop, quality, part)?;
                for round in 1..=if polish { iterations } else { 0 } {
                    let smooth = Method::Gradients(quality.polish);
                    let found = minimise(h, k, &mut solvers[k], mix, smooth, stop, quality, part)?;
                    let arrived = found.after >= (1.0 - quality.decrease) * found.before;
                    level.add(&found);
                    if arrived || round == iterations {
                        break;
                    }
                    level.add(&minimise(h, k, &mut solvers[k], mix, method, stop, quality, part)?);
                }
                report.levels.push(level);
            }
        }
        self.finer.lock().unwrap_or_else(PoisonError::into_inner).push(solvers);
        if positions.iter().flatten().any(|x| !x.is_finite()) {
            let what = "no finite in-between was found for these meshes";
            return Err(Error::numeric(what, "Give a mesh on the way, or anchors where the meshes differ least"));
        }
        Ok((positions, report))
    }
}

/// Minimises G with the coefficients `mix` on stage `k`.
#[expect(clippy::too_many_arguments, reason = "the parts of one problem")]
fn minimise(
    h: &Hierarchy,
    k: usize,
    solver: &mut StageSolver,
    mix: &Mix,
    method: Method,
    stop: Stop,
    quality: &MarchQuality,
    positions: &mut [V3<f64>],
) -> Result<LevelReport> {
    let clock = Instant::now();
    let (encoding, lengths) = mix.stage(k);
    // The lengths are blended as they are, at the shapes' own size.
    let springs = Springs::new(lengths, quality.stiffness, 1.0);
    let stencils = &h.stages[k].stencils;
    let solved = solver.minimise(stencils, encoding, springs.as_ref(), h.held, method, stop, positions)?;
    Ok(LevelReport::new(h.stages[k].vertices - h.held, &solved, clock))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::encoding::{Blend, Connectivity, HierarchyOptions};
    use crate::models::Walker;

    /// A walking body of some 3,400 vertices in two poses.
    fn poses() -> (Marcher, Blend, [Vec<V3<f64>>; 2]) {
        let walker = Walker::new(0.026);
        let (low, high) = walker.mesh.bounds().unwrap();
        let size = low.distance(high);
        let local = |p: Vec<glam::DVec3>| -> Vec<V3<f64>> { p.iter().map(|p| (*p / size).to_array()).collect() };
        let (a, b) = (local(walker.positions(0.1, 0.0)), local(walker.positions(0.6, 1.0)));
        let options = HierarchyOptions { stages: vec![100, 400, 1500] };
        let h = Hierarchy::new(&Connectivity::new(&walker.mesh), &a, &[0, 1, 2, 3], &options).unwrap();
        let shapes = [a, b].map(|x| h.order.iter().map(|&v| x[v as usize]).collect::<Vec<_>>());
        let blend = Blend::new(&h, &shapes).unwrap();
        (Marcher::new(h).unwrap(), blend, shapes)
    }

    fn in_between(quality: &MarchQuality) -> (Vec<V3<f64>>, DecodeReport) {
        let (mut marcher, blend, [a, b]) = poses();
        marcher.begin(&a);
        let steps = 8;
        for step in 1..=steps {
            let (t, last) = (0.5 * f64::from(step) / f64::from(steps), step == steps);
            let weights = [1.0 - t, t];
            let mix = blend.mix(marcher.hierarchy(), marcher.stages(last), |_| &weights);
            let held: Vec<V3<f64>> =
                (0..marcher.hierarchy().held).map(|v| [0, 1, 2].map(|c| a[v][c] * (1.0 - t) + b[v][c] * t)).collect();
            let coarse = marcher.follow(&held, &mix, quality, last).unwrap();
            if last {
                return marcher.finish(coarse, &mix, quality).unwrap();
            }
        }
        unreachable!()
    }

    #[test]
    fn few_steps_on_finer_stages_end_near_the_minimum() {
        let value = |report: &DecodeReport| report.levels.last().unwrap().after;
        let (shape, report) = in_between(&MarchQuality::CONVERGED);
        let least = value(&report);
        assert!(report.levels.len() == 2 && least > 0.0, "{report:?}");
        for (quality, most) in [(MarchQuality::DEFAULT, 1.1), (MarchQuality { direct: 0, ..MarchQuality::FRAMES }, 1.3)]
        {
            let (_, report) = in_between(&quality);
            assert!(value(&report) < most * least, "{} of {least}", value(&report));
        }
        // What the bound is for: splits alone and a single step of conjugate gradients are far off.
        let (splits, report) = in_between(&MarchQuality::PREVIEW);
        assert!(splits.len() == shape.len() && value(&report) > 1.3 * least, "{report:?}");
        let (_, again) = in_between(&MarchQuality { direct: 0, gradient_steps: 1, ..MarchQuality::FRAMES });
        assert!(value(&again) > 1.3 * least, "{} of {least}", value(&again));
    }

    #[test]
    fn an_input_is_its_own_minimum() {
        let (mut marcher, blend, [a, _]) = poses();
        marcher.begin(&a);
        let mix = blend.mix(marcher.hierarchy(), marcher.stages(true), |_| &[1.0, 0.0]);
        let held = a[..marcher.hierarchy().held].to_vec();
        let coarse = marcher.follow(&held, &mix, &MarchQuality::DEFAULT, true).unwrap();
        let (shape, _) = marcher.finish(coarse, &mix, &MarchQuality::DEFAULT).unwrap();
        let off = shape.iter().zip(&a).flat_map(|(p, q)| [0, 1, 2].map(|c| (p[c] - q[c]).abs())).fold(0.0, f64::max);
        assert!(off < 1e-9, "{off}");
        assert!(marcher.follow(&held[1..], &mix, &MarchQuality::DEFAULT, true).is_err());
    }
}
