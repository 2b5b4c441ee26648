//! The finer stages of several frames at once, one frame a lane.
//!
//! All frames have the same rings and coefficients, so whatever is read of them serves all lanes,
//! and what is gathered at a vertex is one row of memory. Work is in single precision, about the
//! frame's own centre and in units of its own size: a position is rounded to 6e-8 of the body. No
//! lane depends on another one, so that a frame is the same bit for bit in whatever company.
//!
//! - `ring`: F and its derivative
//! - `sweeps`: the loops over rings and vertices
//! - here: vertex splits, and one step of Gauss-Newton with conjugate gradients on each stage, as
//!   `solver` does for one frame

mod ring;
mod sweeps;
mod vector;

#[cfg(test)]
mod tests;

use sweeps::{Advance, Block, Invert, Linearise, Move, NO_BLOCK, Product, Rings, SlopeRow, Split, Squares, Turn};
use vector::{Row, Row3, ZERO};

/// Frames that are worked on abreast.
pub(super) const WIDTH: usize = MAX_LANES;

use super::hierarchy::Stage;
use super::sequence::{Frame, SequenceQuality};
use super::{Encoding, Hierarchy, V3};
use crate::control;
use crate::engine::{Lanes, MAX_LANES};
use crate::error::Result;

/// Vertices of the largest mesh that is worked on this way: a group takes 3.4 kB a vertex.
pub(super) const LARGEST: usize = 40_000;
/// Part of the residual, in the preconditioner's norm, at which conjugate gradients end.
const TOLERANCE: f64 = 1e-4;
/// Smallest step of the line search.
const LEAST_STEP: f32 = 1.0 / 1024.0;

/// Coefficients in single precision of the stages after the one that is followed.
#[derive(Debug)]
pub(super) struct Abreast<'a> {
    hierarchy: &'a Hierarchy,
    first: usize,
    splits: Encoding<f32>,
    stages: Vec<Encoding<f32>>,
    lanes: Lanes,
}

/// Memory of one thread, kept from group to group.
#[derive(Default)]
pub(super) struct Workspace {
    positions: Vec<Row3>,
    trial: Vec<Row3>,
    slopes: Vec<SlopeRow>,
    z: Vec<Row3>,
    x: Vec<Row3>,
    residual: Vec<Row3>,
    direction: Vec<Row3>,
    product: Vec<Row3>,
    diagonal: Vec<Block>,
}

/// A frame as it comes from the stage that is followed, and goes to the whole mesh.
pub(super) struct Part<'a, 'b> {
    pub(super) frame: &'a Frame<'b>,
    pub(super) positions: Vec<V3<f64>>,
}

/// Where a frame lies, and its size.
struct Place {
    centre: V3<f64>,
    size: f64,
}

impl<'a> Abreast<'a> {
    /// For the stages from `first` on.
    pub(super) fn new(hierarchy: &'a Hierarchy, first: usize) -> Self {
        let stages = hierarchy.stages.iter().skip(first).map(|s| s.encoding.to_precision()).collect();
        let splits = hierarchy.split_encoding.to_precision();
        Self { hierarchy, first, splits, stages, lanes: Lanes::detect() }
    }

    /// Takes at most [`WIDTH`] frames from the stage that is followed to the whole mesh.
    ///
    /// # Errors
    /// If the work is cancelled.
    pub(super) fn finish(
        &self,
        work: &mut Workspace,
        parts: &mut [Part<'_, '_>],
        quality: &SequenceQuality,
    ) -> Result<()> {
        let h = self.hierarchy;
        let places: Vec<Place> = parts.iter().map(Place::of).collect();
        work.positions.clear();
        work.positions.resize(h.order.len(), ZERO);
        // Lanes without a frame have the first one.
        for lane in 0..WIDTH {
            let k = if lane < parts.len() { lane } else { 0 };
            for (row, p) in work.positions.iter_mut().zip(&parts[k].positions) {
                for (row, x) in row.iter_mut().zip(places[k].local(*p)) {
                    row[lane] = x;
                }
            }
        }
        for (stage, encoding) in h.stages[self.first..].iter().zip(&self.stages) {
            control::check()?;
            for level in stage.levels.clone() {
                let rows = h.level_start[level] as usize..h.level_start[level + 1] as usize;
                let rings = Rings { stencils: &h.splits, w: &self.splits.w, b: &self.splits.b };
                self.lanes.run(Split { rings, rows, positions: &mut work.positions });
            }
            let last = stage.vertices == h.order.len();
            let steps = if last { quality.fine } else { quality.middle };
            if steps > 0 && stage.vertices > h.held {
                self.minimise(work, stage, encoding, steps)?;
            }
        }
        for (lane, (part, place)) in parts.iter_mut().zip(&places).enumerate() {
            part.positions.clear();
            part.positions.extend_from_slice(part.frame.held);
            let free = &work.positions[h.held..];
            part.positions.extend(free.iter().map(|row| place.global([row[0][lane], row[1][lane], row[2][lane]])));
        }
        Ok(())
    }

    /// One step of Gauss-Newton.
    fn minimise(&self, work: &mut Workspace, stage: &Stage, encoding: &Encoding<f32>, steps: usize) -> Result<()> {
        let (n, held) = (stage.vertices, self.hierarchy.held);
        let stencils = &stage.stencils;
        let rings = Rings { stencils, w: &encoding.w, b: &encoding.b };
        work.slopes.resize(stencils.row_count(), SlopeRow::NONE);
        work.z.resize(stencils.neighbour.len(), ZERO);
        for list in [&mut work.x, &mut work.residual, &mut work.direction] {
            list.clear();
            list.resize(n, ZERO);
        }
        work.product.resize(n, ZERO);
        work.trial.resize(n, ZERO);
        work.diagonal.clear();
        work.diagonal.resize(n, NO_BLOCK);
        let mut before = [0.0; WIDTH];
        self.lanes.run(Linearise {
            rings,
            positions: &work.positions[..n],
            slopes: &mut work.slopes,
            z: &mut work.z,
            gradient: &mut work.residual,
            diagonal: &mut work.diagonal,
            squares: &mut before,
        });
        work.residual[..held].fill(ZERO);
        self.lanes.run(Invert { row_of: &stencils.row_of, diagonal: &mut work.diagonal });
        self.gradients(work, rings, n, held, steps)?;

        let mut alpha: Row = [1.0; WIDTH];
        let mut open = [true; WIDTH];
        loop {
            let mut after = [0.0; WIDTH];
            let (positions, x) = (&work.positions[..n], &work.x);
            self.lanes.run(Move { alpha: &alpha, positions, x, trial: &mut work.trial[..n] });
            self.lanes.run(Squares { rings, positions: &work.trial[..n], squares: &mut after });
            for lane in 0..WIDTH {
                if open[lane] && after[lane] < before[lane] {
                    open[lane] = false;
                } else if open[lane] {
                    alpha[lane] *= 0.5;
                    if alpha[lane] < LEAST_STEP {
                        (alpha[lane], open[lane]) = (0.0, false);
                    }
                    open[lane] &= before[lane] > 0.0;
                }
            }
            if !open.contains(&true) {
                break;
            }
        }
        let (positions, x) = (&work.positions[..n], &work.x);
        self.lanes.run(Move { alpha: &alpha, positions, x, trial: &mut work.trial[..n] });
        work.positions[..n].copy_from_slice(&work.trial[..n]);
        Ok(())
    }

    /// Conjugate gradients from zero, with the inverse blocks of the diagonal as preconditioner.
    fn gradients(&self, work: &mut Workspace, rings: Rings<'_>, n: usize, held: usize, steps: usize) -> Result<()> {
        let mut rho = [0.0; WIDTH];
        // Steps of length zero: the direction and the first product.
        let none: Row = [0.0; WIDTH];
        let inverse = &work.diagonal[held..];
        self.lanes.run(Advance {
            alpha: &none,
            direction: &work.direction[held..],
            product: &work.direction[held..],
            inverse,
            x: &mut work.x[held..],
            residual: &mut work.residual[held..],
            products: &mut rho,
        });
        let residual = &work.residual[held..];
        self.lanes.run(Turn { beta: &none, residual, inverse, direction: &mut work.direction[held..] });
        let stop = rho.map(|r| r * TOLERANCE * TOLERANCE);
        let mut active = rho.map(|r| r > 0.0);
        for _ in 0..steps {
            control::check()?;
            let mut curvature = [0.0; WIDTH];
            work.product[..n].fill(ZERO);
            self.lanes.run(Product {
                rings,
                positions: &work.positions[..n],
                slopes: &work.slopes,
                z: &work.z,
                direction: &work.direction,
                product: &mut work.product[..n],
                squares: &mut curvature,
            });
            let mut alpha: Row = [0.0; WIDTH];
            for lane in 0..WIDTH {
                active[lane] &= curvature[lane] > 0.0 && curvature[lane].is_finite();
                if active[lane] {
                    alpha[lane] = (rho[lane] / curvature[lane]) as f32;
                }
            }
            let mut next = [0.0; WIDTH];
            self.lanes.run(Advance {
                alpha: &alpha,
                direction: &work.direction[held..],
                product: &work.product[held..n],
                inverse: &work.diagonal[held..],
                x: &mut work.x[held..],
                residual: &mut work.residual[held..],
                products: &mut next,
            });
            let mut beta: Row = [0.0; WIDTH];
            for lane in 0..WIDTH {
                beta[lane] = (next[lane] / rho[lane]) as f32;
                active[lane] &= next[lane] > stop[lane];
            }
            rho = next;
            if !active.contains(&true) {
                break;
            }
            let (residual, inverse) = (&work.residual[held..], &work.diagonal[held..]);
            self.lanes.run(Turn { beta: &beta, residual, inverse, direction: &mut work.direction[held..] });
        }
        Ok(())
    }
}

impl Place {
    /// The middle of the positions of a frame.
    fn of(part: &Part<'_, '_>) -> Self {
        let inverse = 1.0 / part.positions.len() as f64;
        let centre = part.positions.iter().fold([0.0; 3], |a, p| std::array::from_fn(|c| a[c] + p[c] * inverse));
        let size = part.frame.scale;
        Self { centre, size: if size > 0.0 && size.is_finite() { size } else { 1.0 } }
    }

    fn local(&self, p: V3<f64>) -> V3<f32> {
        std::array::from_fn(|c| ((p[c] - self.centre[c]) / self.size) as f32)
    }

    fn global(&self, p: V3<f32>) -> V3<f64> {
        std::array::from_fn(|c| f64::from(p[c]) * self.size + self.centre[c])
    }
}
