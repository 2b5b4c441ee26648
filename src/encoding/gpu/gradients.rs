//! Gauss-Newton steps by conjugate gradients on a device. Lengths of steps and all other scalars
//! stay there; what comes back is G for the lengths of the line search, and the shape.

use super::WORK;
use super::dot::{Dot, Vector};
use super::stage::{Bound, StageKernels, Trial};
use super::tables::{EncodingParams, PARAMS};
use crate::encoding::solver::{Solved, Stop};
use crate::engine::{Batch, BindingKind, Buffer, Gpu, Kernel, Layout, ReadbackRing, UniformBlocks};
use crate::error::Result;
use crate::kernel_layout as layout;

/// A vertex in a solve; twin of the struct in `shaders/lib/gradients.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, bytemuck::Pod, bytemuck::Zeroable)]
pub struct SolveVertex {
    solution: [f32; 3],
    unused0: f32,
    residual: [f32; 3],
    unused1: f32,
    pub(super) inverse_diagonal: [f32; 3],
    unused2: f32,
}

/// Where a step finds its scalars; twin of the struct in `shaders/lib/gradients.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, bytemuck::Pod, bytemuck::Zeroable)]
pub struct GradientParams {
    rho: u32,
    next: u32,
    tolerance: f32,
    unused: u32,
}

pub(super) const SOLVE_VERTEX: Layout =
    layout!(SolveVertex, { solution, unused0, residual, unused1, inverse_diagonal, unused2 });
const GRADIENT_PARAMS: Layout = layout!(GradientParams, { rho, next, tolerance, unused });
const PARAMS_BINDING: BindingKind = BindingKind::Uniform(size_of::<GradientParams>() as u64);

pub(super) static GRADIENT_STEP: Kernel = step(&[("START", 0.0)]);
static GRADIENT_STEP_START: Kernel = step(&[("START", 1.0)]);

const fn step(constants: &'static [(&'static str, f64)]) -> Kernel {
    Kernel {
        name: "gradient_step",
        source: include_str!("../../../shaders/gradient_step.wgsl"),
        bindings: &[PARAMS_BINDING, BindingKind::Write, BindingKind::Write, BindingKind::Read, BindingKind::Write],
        layouts: &[GRADIENT_PARAMS, SOLVE_VERTEX],
        items: 1,
        constants,
    }
}

pub(super) static GRADIENT_DIRECTION: Kernel = direction(&[("START", 0.0)]);
static GRADIENT_DIRECTION_START: Kernel = direction(&[("START", 1.0)]);

const fn direction(constants: &'static [(&'static str, f64)]) -> Kernel {
    Kernel {
        name: "gradient_direction",
        source: include_str!("../../../shaders/gradient_direction.wgsl"),
        bindings: &[PARAMS_BINDING, BindingKind::Read, BindingKind::Read, BindingKind::Write],
        layouts: &[GRADIENT_PARAMS],
        items: 1,
        constants,
    }
}

pub(super) static LINE_SEARCH: Kernel = Kernel {
    name: "line_search",
    source: include_str!("../../../shaders/line_search.wgsl"),
    bindings: &[
        BindingKind::Uniform(size_of::<EncodingParams>() as u64),
        BindingKind::Read,
        BindingKind::Read,
        BindingKind::Write,
    ],
    layouts: &[PARAMS, SOLVE_VERTEX],
    items: 1,
    constants: &[],
};

/// Places of the scalars; see `shaders/lib/gradients.wgsl`.
const CURVATURE: usize = 2;
const FIRST: usize = 3;
const STEPS: usize = 4;
/// Twice G at the start of an iteration, and after it those at the ends of the line search.
const BEFORE: usize = 5;
const TRIALS: usize = 6;

/// Lengths that the line search tries: 1, 1/2, ... 1/128.
const LENGTHS: usize = 8;

/// Relative size of what is left at which a solve ends.
const TOLERANCE: f32 = 1e-4;

/// G of a row (in squared lengths of a shape of size one) below which it is rounding: residuals are
/// differences of positions that have seven digits.
const NOISE: f64 = 1e-14;

/// The solver of one stage.
#[derive(Debug)]
pub struct StageSolver {
    kernels: StageKernels,
    trial: Trial,
    scalars: Buffer<[f32; 4]>,
    begin: (Bound, Bound),
    /// For steps that find rho in place 0 and leave it in place 1, and the other way round.
    step: [Bound; 2],
    direction: [Bound; 2],
    search: Bound,
    before: Dot,
    first: [Dot; 2],
    curvature: Dot,
    /// The sum that leaves rho in place 0, in place 1.
    rho: [Dot; 2],
    trials: Dot,
    _params: [UniformBlocks<GradientParams>; 2],
}

impl StageSolver {
    /// Everything that solves on a stage need.
    ///
    /// # Errors
    /// As [`StageKernels::new`].
    pub fn new(gpu: &Gpu, kernels: StageKernels) -> Result<Self> {
        let k = &kernels;
        let trial = Trial::new(gpu, k, LENGTHS)?;
        let scalars = gpu.buffer("scalars", TRIALS + LENGTHS)?;
        let params = |rho: u32| GradientParams { rho, next: 1 - rho, tolerance: TOLERANCE * TOLERANCE, unused: 0 };
        let params = [gpu.uniform("gradients", &params(0))?, gpu.uniform("gradients", &params(1))?];
        let step = |kernel, turn: usize| {
            let p = params[turn].bind(0);
            let bindings = [p, scalars.bind(), k.solve.bind(), k.direction.bind(), k.product.bind()];
            Bound::new(gpu, kernel, &bindings)
        };
        let direction = |kernel, turn: usize| {
            let bindings = [params[turn].bind(0), scalars.bind(), k.product.bind(), k.direction.bind()];
            Bound::new(gpu, kernel, &bindings)
        };
        let search = [trial.params.bind(0), k.positions.bind(), k.solve.bind(), trial.positions.bind()];
        let free = k.vertices - k.held;
        // In units of four numbers: a row's product is three of them, a vertex of a solve too, its
        // residual being the second.
        let rows = |binding| Vector { binding, first: 0, stride: 3 };
        let values = |binding| [rows(binding), rows(k.products.bind())];
        let rho = |to: usize| {
            let left = Vector { binding: k.solve.bind(), first: 3 * k.held as u32 + 1, stride: 3 };
            let preconditioned = Vector { binding: k.product.bind(), first: k.held as u32, stride: 1 };
            Dot::new(gpu, [left, preconditioned], free, 1, &scalars, to)
        };
        let of_rows = |to: usize| Dot::new(gpu, values(k.products.bind()), k.row_count, 1, &scalars, to);
        let trials = [rows(trial.products.bind()), rows(trial.products.bind())];
        Ok(Self {
            begin: (step(&GRADIENT_STEP_START, 0)?, direction(&GRADIENT_DIRECTION_START, 0)?),
            step: [step(&GRADIENT_STEP, 0)?, step(&GRADIENT_STEP, 1)?],
            direction: [direction(&GRADIENT_DIRECTION, 0)?, direction(&GRADIENT_DIRECTION, 1)?],
            search: Bound::new(gpu, &LINE_SEARCH, &search)?,
            before: of_rows(BEFORE)?,
            first: [rho(0)?, rho(FIRST)?],
            curvature: of_rows(CURVATURE)?,
            rho: [rho(0)?, rho(1)?],
            trials: Dot::new(gpu, trials, k.row_count, LENGTHS, &scalars, TRIALS)?,
            trial,
            scalars,
            _params: params,
            kernels,
        })
    }

    /// Minimises G over the free vertices from `positions` on, to where it ends: at most
    /// `stop.iterations` Gauss-Newton iterations of at most `steps` steps of conjugate gradients
    /// each. The shape has a size near one.
    ///
    /// # Errors
    /// [`Error::Device`](crate::Error::Device).
    pub(crate) fn minimise(&self, gpu: &Gpu, positions: &mut [[f32; 4]], steps: usize, stop: Stop) -> Result<Solved> {
        let k = &self.kernels;
        if positions.len() != k.vertices {
            return Err(super::fault("not one position a vertex"));
        }
        gpu.write(&k.positions, 0, positions)?;
        gpu.write(&self.trial.positions, 0, &positions.repeat(LENGTHS))?;
        let noise = NOISE * k.row_count as f64;
        let mut solved = Solved::default();
        let mut g = f64::INFINITY;
        let mut moved = false;
        while solved.iterations < stop.iterations {
            let mut batch = gpu.batch()?;
            batch.clear(&self.scalars);
            k.linearise.record(&mut batch, 0, k.row_count)?;
            if solved.iterations == 0 {
                self.before.record(&mut batch)?;
                batch.submit()?;
                g = 0.5 * f64::from(gpu.read(&self.scalars, BEFORE..BEFORE + 1)?[0][0]);
                (solved.before, solved.after) = (g, g);
                if k.held == k.vertices || !g.is_finite() || g <= noise {
                    break;
                }
                batch = gpu.batch()?;
            }
            self.record_begin(&mut batch)?;
            gpu.wait(&batch.submit()?)?;
            self.solve(gpu, steps)?;
            let mut batch = gpu.batch()?;
            self.search.record(&mut batch, k.held, k.vertices)?;
            self.trial.residual.record(&mut batch, 0, LENGTHS * k.row_count)?;
            self.trials.record(&mut batch)?;
            batch.submit()?;
            let scalars = gpu.read(&self.scalars, 0..TRIALS + LENGTHS)?;
            solved.gradient_steps += scalars[STEPS][0] as usize;
            // The lowest; of equal ones the longest step.
            let (mut best, mut new) = (None, g);
            for (length, sum) in scalars[TRIALS..].iter().enumerate() {
                let value = 0.5 * f64::from(sum[0]);
                if value < new {
                    (best, new) = (Some(length), value);
                }
            }
            let Some(length) = best else {
                solved.converged = true;
                break;
            };
            let mut batch = gpu.batch()?;
            batch.copy(&self.trial.positions, length * k.vertices, &k.positions, 0, k.vertices)?;
            batch.submit()?;
            moved = true;
            solved.iterations += 1;
            let decrease = (g - new) / g;
            g = new;
            if decrease < stop.decrease || g <= noise {
                solved.converged = true;
                break;
            }
        }
        solved.after = g;
        if moved {
            positions.copy_from_slice(&gpu.read(&k.positions, 0..k.vertices)?);
        }
        Ok(solved)
    }

    /// The gradient, the preconditioner, and the first direction.
    fn record_begin(&self, batch: &mut Batch<'_>) -> Result<()> {
        let k = &self.kernels;
        let free = k.held..k.vertices;
        k.transpose.record(batch, free.start, free.end)?;
        k.diagonal.record(batch, free.start, free.end)?;
        self.begin.0.record(batch, free.start, free.end)?;
        self.first.iter().try_for_each(|dot| dot.record(batch))?;
        self.begin.1.record(batch, free.start, free.end)
    }

    /// Steps of conjugate gradients, in submissions of limited work; after each one that is
    /// finished the scalars tell whether to go on.
    fn solve(&self, gpu: &Gpu, steps: usize) -> Result<()> {
        let k = &self.kernels;
        // Even, so that every submission but the last ends with rho in place 0.
        let at_once = (WORK / (2 * k.work).max(1)).clamp(2, 64) as usize & !1;
        let mut ring = ReadbackRing::new(gpu, "scalars", 2, TRIALS)?;
        let mut done = 0;
        while done < steps {
            let count = at_once.min(steps - done);
            let mut batch = gpu.batch()?;
            for turn in 0..count {
                self.record_step(&mut batch, turn % 2)?;
            }
            if ring.is_full() && ring.pop()?.is_some_and(|s| ended(&s)) {
                break;
            }
            ring.push(batch, &self.scalars, 0..TRIALS)?;
            done += count;
        }
        while ring.pop()?.is_some() {}
        Ok(())
    }

    fn record_step(&self, batch: &mut Batch<'_>, turn: usize) -> Result<()> {
        let k = &self.kernels;
        k.apply.record(batch, 0, k.row_count)?;
        self.curvature.record(batch)?;
        k.transpose.record(batch, k.held, k.vertices)?;
        self.step[turn].record(batch, k.held, k.vertices)?;
        self.rho[1 - turn].record(batch)?;
        self.direction[turn].record(batch, k.held, k.vertices)
    }
}

/// Whether steps change nothing any more, by the scalars after an even number of them; the kernel
/// takes the same decision.
fn ended(scalars: &[[f32; 4]]) -> bool {
    !(scalars[0][0] > TOLERANCE * TOLERANCE * scalars[FIRST][0])
}
