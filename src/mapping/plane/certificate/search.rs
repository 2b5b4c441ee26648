//! Cutting boxes until the Jacobian is proved positive on all of them.

use glam::DVec2;
use rayon::prelude::*;

use super::bounds::{Bounds, Workspace, enclose};
use super::boxes::{Cell, Corner, Fate, leads_inside};
use super::chart::{Chart, Fan};
use super::domain::Domain;
use super::interval::Interval;
use super::{CertifyOptions, Verdict};
use crate::progress::Progress;

/// Parts of the progress.
const PARTS: f64 = 1000.0;

/// What became of a cell.
#[derive(Clone, Copy, Debug)]
enum Outcome {
    Dropped,
    /// Too large to be examined: to be cut along this parameter.
    Cut(usize),
    /// The bounds, and whether the centre is a point of the polygon.
    Bounded(Bounds, bool),
}

/// The search over one step.
#[derive(Debug)]
pub(super) struct Search<'a> {
    domain: &'a Domain,
    options: &'a CertifyOptions,
    corners: Vec<Corner>,
    /// The smallest upper bound of the Jacobian at a point of the polygon.
    sampled: f64,
    /// Boxes examined.
    boxes: u64,
    /// Share of the polygon that is proved.
    done: f64,
}

impl<'a> Search<'a> {
    /// The search; an undecided verdict where a vertex cannot be covered.
    pub(super) fn new(domain: &'a Domain, options: &'a CertifyOptions) -> Result<Self, Verdict> {
        let mut corners = Vec::with_capacity(domain.len());
        for k in 0..domain.len() {
            let corner = Corner::new(domain, k).ok_or_else(|| Verdict::Undecided {
                boxes: 0,
                worst: DVec2::from(domain.vertices[k]) / domain.scale,
                bound: f64::NEG_INFINITY,
            })?;
            corners.push(corner);
        }
        Ok(Self { domain, options, corners, sampled: f64::INFINITY, boxes: 0, done: 0.0 })
    }

    pub(super) fn run(mut self, progress: &dyn Progress) -> Verdict {
        progress.stage("certificate", PARTS as u64);
        if let Some(fold) = self.vertices() {
            return fold;
        }
        let mut pending = self.roots();
        // Proved positive, but the bound may be sharpened.
        let mut proved: Vec<Cell> = Vec::new();
        let mut first_pass = None;
        loop {
            while !pending.is_empty() {
                let room = self.options.boxes.saturating_sub(self.boxes);
                if room == 0 {
                    if first_pass.is_none() {
                        return self.undecided(&pending);
                    }
                    // Out of budget while sharpening: what is pending is proved as it stands.
                    proved.append(&mut pending);
                    break;
                }
                let later = pending.split_off(pending.len().min(usize::try_from(room).unwrap_or(usize::MAX)));
                let outcomes: Vec<Outcome> =
                    pending.par_iter().map_init(Workspace::default, |work, cell| self.examine(cell, work)).collect();
                let mut next = Vec::new();
                for (cell, outcome) in pending.iter().zip(outcomes) {
                    let side = match outcome {
                        Outcome::Dropped => {
                            self.settle(cell.weight, progress);
                            continue;
                        }
                        Outcome::Cut(side) => side,
                        Outcome::Bounded(bounds, inside) => {
                            self.boxes += 1;
                            if inside {
                                if bounds.centre.hi < 0.0 {
                                    return self.fold(cell, bounds.centre);
                                }
                                if bounds.centre.is_known() {
                                    self.sampled = self.sampled.min(bounds.centre.hi);
                                }
                            }
                            let lower = if bounds.range.lo > cell.proved { bounds.range.lo } else { cell.proved };
                            let cell = Cell { proved: lower, ..*cell };
                            if lower > 0.0 {
                                if first_pass.is_none() {
                                    self.settle(cell.weight, progress);
                                }
                                proved.push(cell);
                                continue;
                            }
                            if bounds.range.is_known() { bounds.cut } else { cell.wider_parameter() }
                        }
                    };
                    match cell.halves(side) {
                        Some(halves) => next.extend(halves),
                        None => return self.undecided(&[*cell]),
                    }
                }
                next.extend(later);
                pending = next;
            }
            // All is positive. Sharpen the bound where it is far below the sampled minimum, as long as that is cheap.
            let spent = *first_pass.get_or_insert(self.boxes);
            let limit = (spent.saturating_mul(3) + 4096).min(self.options.boxes);
            let target = self.sampled * (1.0 - self.options.tolerance);
            let (loose, sharp): (Vec<Cell>, Vec<Cell>) = proved
                .iter()
                .partition(|c| c.proved < target && self.boxes < limit && c.halves(c.wider_parameter()).is_some());
            if loose.is_empty() || self.boxes + loose.len() as u64 * 2 > limit {
                let bound = proved.iter().map(|c| c.proved).fold(f64::INFINITY, f64::min);
                return Verdict::Certified { lower_bound: bound * self.domain.jacobian_unit };
            }
            proved = sharp;
            pending = loose.iter().flat_map(|c| c.halves(c.wider_parameter())).flatten().collect();
        }
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
            Fate::Cut => Outcome::Cut(cell.wider_parameter()),
            Fate::Examine => {
                let bounds = enclose(self.domain, &cell.chart, cell.at, cell.centre(), work);
                Outcome::Bounded(bounds, cell.centre_is_inside(self.domain))
            }
        }
    }

    /// Limits of the Jacobian at the vertices: the minimum is nearly always among them.
    ///
    /// As a function of the direction's angle the limit is a sinusoid plus a constant, so three values in a fan predict where it is
    /// least; rigour needs no more than that the values themselves are enclosures at points of the polygon.
    fn vertices(&mut self) -> Option<Verdict> {
        let fans: Vec<Fan> = self.corners.iter().flat_map(|c| c.fans.iter().copied()).collect();
        let samples: Vec<Vec<(f64, Interval)>> =
            fans.par_iter().map_init(Workspace::default, |work, fan| self.limits(fan, work)).collect();
        for (fan, samples) in fans.iter().zip(samples) {
            for (mu, value) in samples {
                let cell = Cell::new(Chart::Fan(*fan), [Interval::ZERO, Interval::point(mu)], 0.0);
                self.boxes += 1;
                if value.hi < 0.0 {
                    return Some(self.fold(&cell, value));
                }
                if value.is_known() {
                    self.sampled = self.sampled.min(value.hi);
                }
            }
        }
        None
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

    fn settle(&mut self, weight: f64, progress: &dyn Progress) {
        let before = (self.done * PARTS) as u64;
        self.done += weight;
        progress.advance((self.done * PARTS) as u64 - before);
    }

    fn world(&self, cell: &Cell) -> DVec2 {
        let p = cell.chart.position(self.domain, cell.centre().map(Interval::point)).map(Interval::mid);
        DVec2::from(p) / self.domain.scale
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
