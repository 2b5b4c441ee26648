//! Cutting boxes until the Jacobian is proved positive on all of them.

use glam::DVec2;
use rayon::prelude::*;

use super::bounds::{Bounds, Workspace, enclose};
use super::boxes::{Cell, Corner, Fate, leads_inside};
use super::chart::{Chart, Fan};
use super::domain::Domain;
use super::interval::Interval;
use super::{Certificate, CertifyOptions, Verdict};
use crate::control;
use crate::error::Error;
use crate::progress::Progress;

/// Parts of the progress: of the limits at the vertices, and of the proof.
const LIMITS: u64 = 50;
const PARTS: u64 = 950;
/// Boxes times vertices between two looks at the control and reports of progress, about 0.2 s of
/// one thread; and boxes at least, so that all threads have some.
const SLICE: usize = 1 << 17;
const LEAST: usize = 64;

/// What became of a cell.
#[derive(Clone, Copy, Debug)]
enum Outcome {
    Dropped,
    /// Too large to be examined.
    Cut,
    /// The bounds, and whether the centre is a point of the polygon.
    Bounded(Bounds, bool),
}

/// What became of many.
#[derive(Clone, Debug, Default)]
struct Round {
    proved: Vec<Cell>,
    open: Vec<Cell>,
}

/// The search over one step.
pub(super) struct Search<'a> {
    domain: &'a Domain,
    options: &'a CertifyOptions,
    progress: &'a dyn Progress,
    corners: Vec<Corner>,
    /// The smallest upper bound of the Jacobian at a point of the polygon.
    sampled: f64,
    /// Boxes examined.
    boxes: u64,
    /// Share of the polygon that is proved.
    done: f64,
    /// Parts of the proof that were reported.
    told: u64,
}

/// How a search ends before it has proved its cells.
enum End {
    Verdict(Verdict),
    Cancelled,
}

impl From<Verdict> for End {
    fn from(verdict: Verdict) -> Self {
        Self::Verdict(verdict)
    }
}

impl<'a> Search<'a> {
    /// The search over a domain with these corners.
    pub(super) fn new(
        domain: &'a Domain,
        corners: Vec<Corner>,
        options: &'a CertifyOptions,
        progress: &'a dyn Progress,
    ) -> Self {
        Self { domain, options, progress, corners, sampled: f64::INFINITY, boxes: 0, done: 0.0, told: 0 }
    }

    pub(super) fn run(mut self) -> crate::Result<Certificate> {
        self.progress.stage("certificate", LIMITS + PARTS);
        let verdict = self.vertices().and_then(|()| self.prove()).and_then(|proved| self.sharpen(proved));
        let verdict = match verdict {
            Ok(bound) => Verdict::Certified { lower_bound: bound * self.domain.jacobian_unit },
            Err(End::Verdict(verdict)) => verdict,
            Err(End::Cancelled) => return Err(Error::Cancelled),
        };
        Ok(Certificate { verdict, boxes: self.boxes, sampled: self.sampled * self.domain.jacobian_unit })
    }

    /// Cuts the roots until all cells are proved positive.
    fn prove(&mut self) -> Result<Vec<Cell>, End> {
        let (mut open, mut proved) = (self.roots(), Vec::new());
        while !open.is_empty() {
            let room = self.options.boxes.saturating_sub(self.boxes);
            if room == 0 {
                return Err(self.undecided(&open).into());
            }
            let later = open.split_off(open.len().min(usize::try_from(room).unwrap_or(usize::MAX)));
            let mut round = self.round(&open)?;
            proved.append(&mut round.proved);
            open.clear();
            for cell in round.open {
                match cell.halves() {
                    Some(halves) => open.extend(halves),
                    None => return Err(self.undecided(&[cell]).into()),
                }
            }
            open.extend(later);
        }
        self.settle(1.0);
        Ok(proved)
    }

    /// Reports that `share` more of the polygon is settled.
    fn settle(&mut self, share: f64) {
        self.done = (self.done + share).min(1.0);
        let parts = (self.done * PARTS as f64) as u64;
        self.progress.advance(parts - self.told);
        self.told = parts;
    }

    /// How many boxes are examined between two reports.
    fn slice(&self) -> usize {
        (SLICE / self.domain.len()).max(LEAST)
    }

    /// Cuts cells whose bound is far below the sampled minimum, the lowest first, as long as that
    /// is cheap; returns the least bound.
    fn sharpen(&mut self, mut proved: Vec<Cell>) -> Result<f64, End> {
        let limit = (self.boxes.saturating_mul(3) + 4096).min(self.options.boxes);
        loop {
            let target = self.sampled * (1.0 - self.options.tolerance);
            proved.sort_by(|a, b| a.proved.total_cmp(&b.proved));
            let room = usize::try_from(limit.saturating_sub(self.boxes) / 2).unwrap_or(usize::MAX);
            let count = proved.partition_point(|c| c.proved < target).min(room);
            let halves: Vec<Cell> = proved[..count].iter().filter_map(Cell::halves).flatten().collect();
            if halves.is_empty() || halves.len() < 2 * count {
                return Ok(proved.first().map_or(f64::INFINITY, |c| c.proved));
            }
            let mut round = self.round(&halves)?;
            proved.drain(..count);
            proved.append(&mut round.proved);
        }
    }

    /// Examines cells, in parallel, and takes the outcomes in order. A cell proved already stays
    /// so.
    fn round(&mut self, cells: &[Cell]) -> Result<Round, End> {
        let mut round = Round::default();
        for cells in cells.chunks(self.slice()) {
            let here = control::current();
            let examine = |work: &mut Workspace, cell: &Cell| here.check().map(|()| self.examine(cell, work));
            let outcomes: crate::Result<Vec<Outcome>> =
                cells.par_iter().map_init(Workspace::default, examine).collect();
            let outcomes = outcomes.map_err(|_| End::Cancelled)?;
            let mut settled = 0.0;
            for (cell, outcome) in cells.iter().zip(outcomes) {
                settled += self.take(cell, outcome, &mut round)?;
            }
            self.settle(settled);
        }
        Ok(round)
    }

    /// Sorts a cell by its outcome; returns the share of the polygon that it settles.
    fn take(&mut self, cell: &Cell, outcome: Outcome, round: &mut Round) -> Result<f64, End> {
        let mut cell = Cell { cut: cell.wider_parameter(), ..*cell };
        match outcome {
            Outcome::Dropped => return Ok(cell.weight),
            Outcome::Cut => {}
            Outcome::Bounded(bounds, inside) => {
                self.boxes += 1;
                if inside && bounds.centre.hi < 0.0 {
                    return Err(self.fold(&cell, bounds.centre).into());
                }
                if inside && bounds.centre.is_known() {
                    self.sampled = self.sampled.min(bounds.centre.hi);
                }
                if bounds.range.is_known() {
                    cell.proved = cell.proved.max(bounds.range.lo);
                    cell.cut = bounds.cut;
                }
            }
        }
        if cell.proved > 0.0 {
            round.proved.push(cell);
            return Ok(cell.weight);
        }
        round.open.push(cell);
        Ok(0.0)
    }

    /// The fans of all corners, and the bounding box of the polygon.
    fn roots(&self) -> Vec<Cell> {
        let unit = Interval::new(0.0, 1.0);
        let fans: Vec<Fan> = self.corners.iter().flat_map(|c| c.fans.iter().copied()).collect();
        let weight = 0.5 / fans.len() as f64;
        let mut cells: Vec<Cell> = fans.into_iter().map(|f| Cell::new(Chart::Fan(f), [unit; 2], weight)).collect();
        let bounds = [0, 1].map(|d| {
            let along = || self.domain.vertices.iter().map(move |v| v[d]);
            Interval::new(along().fold(f64::INFINITY, f64::min), along().fold(f64::NEG_INFINITY, f64::max))
        });
        cells.push(Cell::new(Chart::Plane, bounds, 0.5));
        cells
    }

    fn examine(&self, cell: &Cell, work: &mut Workspace) -> Outcome {
        match cell.fate(self.domain, &self.corners) {
            Fate::Drop => Outcome::Dropped,
            Fate::Cut => Outcome::Cut,
            Fate::Examine => {
                let bounds = enclose(self.domain, &cell.chart, cell.at, cell.centre(), work);
                Outcome::Bounded(bounds, cell.centre_is_inside(self.domain))
            }
        }
    }

    /// Limits of the Jacobian at the vertices: the minimum is nearly always among them.
    ///
    /// As a function of the direction's angle the limit is a sinusoid plus a constant, so three
    /// values in a fan predict where it is least; rigour needs no more than that the values
    /// themselves are enclosures at points of the polygon.
    fn vertices(&mut self) -> Result<(), End> {
        let fans: Vec<Fan> = self.corners.iter().flat_map(|c| c.fans.iter().copied()).collect();
        let mut samples: Vec<Vec<(f64, Interval)>> = Vec::with_capacity(fans.len());
        for part in fans.chunks(self.slice()) {
            let here = control::current();
            let limits = |work: &mut Workspace, fan: &Fan| here.check().map(|()| self.limits(fan, work));
            let found: crate::Result<Vec<_>> = part.par_iter().map_init(Workspace::default, limits).collect();
            let before = LIMITS * samples.len() as u64 / fans.len() as u64;
            samples.extend(found.map_err(|_| End::Cancelled)?);
            self.progress.advance(LIMITS * samples.len() as u64 / fans.len() as u64 - before);
        }
        for (fan, samples) in fans.iter().zip(samples) {
            for (mu, value) in samples {
                let cell = Cell::new(Chart::Fan(*fan), [Interval::ZERO, Interval::point(mu)], 0.0);
                self.boxes += 1;
                if value.hi < 0.0 {
                    return Err(self.fold(&cell, value).into());
                }
                if value.is_known() {
                    self.sampled = self.sampled.min(value.hi);
                }
            }
        }
        Ok(())
    }

    fn limits(&self, fan: &Fan, work: &mut Workspace) -> Vec<(f64, Interval)> {
        let mut at = |mu: f64| {
            let here = [Interval::ZERO, Interval::point(mu)];
            enclose(self.domain, &Chart::Fan(*fan), here, [0.0, mu], work).centre
        };
        // Just inside of the pads.
        let ends = [1e-9, 0.5, 1.0 - 1e-9];
        let mut samples: Vec<(f64, Interval)> = ends.map(|mu| (mu, at(mu))).to_vec();
        let [a, b, c] = [0, 1, 2].map(|i| samples[i].1.mid());
        let turn = |mu: f64| {
            let q = fan.direction(Interval::point(mu)).map(Interval::mid);
            (fan.first[0] * q[1] - fan.first[1] * q[0]).atan2(fan.first[0] * q[0] + fan.first[1] * q[1])
        };
        // J = p + q cos(x) + r sin(x) with x from the middle direction, by symmetry of the ends.
        let half = 0.5 * turn(1.0);
        let q = (0.5 * (a + c) - b) / (half.cos() - 1.0);
        let r = 0.5 * (c - a) / half.sin();
        let x = (-r).atan2(-q);
        if x.abs() < half {
            // Along the chord the distance from its middle goes with the tangent.
            let mu = 0.5 + 0.5 * x.tan() / half.tan();
            samples.push((mu, at(mu)));
        }
        samples.retain(|(mu, _)| leads_inside(self.domain, fan, *mu));
        samples
    }

    fn world(&self, cell: &Cell) -> DVec2 {
        let p = cell.chart.position(self.domain, cell.centre().map(Interval::point)).map(Interval::mid);
        self.domain.world(p)
    }

    fn fold(&self, cell: &Cell, value: Interval) -> Verdict {
        Verdict::Folds { at: self.world(cell), value: value.hi * self.domain.jacobian_unit }
    }

    fn undecided(&self, pending: &[Cell]) -> Verdict {
        let worst = pending.iter().min_by(|a, b| a.proved.total_cmp(&b.proved));
        Verdict::Undecided {
            boxes: self.boxes,
            worst: worst.map_or(DVec2::NAN, |c| self.world(c)),
            bound: worst.map_or(f64::NAN, |c| c.proved) * self.domain.jacobian_unit,
        }
    }
}
