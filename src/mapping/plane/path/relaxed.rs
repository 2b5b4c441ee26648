//! A path that depends continuously on its ends.
//!
//! The intrinsic and the linear path are continuous in source and target, but may meet themselves
//! on the way; a change to another path there is a jump of the map. Here nothing is changed for
//! another: source and target are relaxed ([`Relaxation`]), each by the same part `T`, and the path
//! leads from the source to the relaxed source, along the path to the relaxed target, and from
//! there to the target. `T` is 0 where the path itself keeps off itself.
//!
//! Which `T`: let `m(T)` be how far the path between the ends relaxed by `T` keeps off itself (1 as
//! far as its ends, 0 not at all), and `need` fall from 1 to 0 as `m` grows. Then `T = need(m(0))
//! max over T' of T' need(m(T'))` is continuous in the ends, since the maximum of continuous
//! functions is. Where the path itself is of no use, `m(T) > 0`: where `m(T')` is too small, `T` is
//! no less than `T'`.

use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::geometry::Polygon;
use crate::geometry::polygon::Nesting;
use crate::mapping::plane::Cage;

use super::clearance::{Pair, TIMES, distances, pairs};
use super::relaxation::Relaxation;
use super::{Intrinsic, Linear, PathKind, VertexPath};

/// Parts by which source and target are relaxed, for trial.
const LEVELS: usize = 16;
/// A path that keeps this part of the distances of its ends needs no relaxation.
const FREE: f64 = 0.35;
/// One that keeps less than this part is of no use.
const CLOSE: f64 = 0.1;
/// Vertices of the cage, at most: all vertices are looked at with all edges.
const MOST_VERTICES: usize = 1_024;

/// The path between relaxed polygons.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Base {
    /// [`Intrinsic`], its corrections weighted continuously.
    Intrinsic,
    /// [`Linear`].
    Linear,
}

impl Base {
    fn between(self, cage: &Cage) -> Box<dyn VertexPath> {
        match self {
            Self::Intrinsic => Box::new(Intrinsic::steady(cage)),
            Self::Linear => Box::new(Linear::new(cage)),
        }
    }
}

/// The intrinsic or the linear path between relaxed polygons, as far as they have to be relaxed:
/// continuous in source and target as long as no loop turns by half a turn against the outermost
/// one. The polygons are to be checked: loops within loops may find no way, and thin parts of
/// double precision neither.
///
/// Building it takes O(n^2) time and memory for n vertices.
#[derive(Debug)]
pub struct Relaxed {
    cage: Cage,
    /// The relaxations of source and target; none if they need none.
    ends: Option<[Relaxation; 2]>,
    /// The part of them that is needed.
    part: f64,
    middle: Box<dyn VertexPath>,
}

/// How much a path that keeps off itself by this much has to be relaxed.
fn need(clearance: f64) -> f64 {
    ((FREE - clearance) / (FREE - CLOSE)).clamp(0.0, 1.0)
}

impl Relaxed {
    /// The path between the polygons of `cage`.
    ///
    /// # Errors
    /// [`Error::Numeric`] where the polygons have parts so thin that double precision does not hold
    /// their distances.
    pub fn new(cage: &Cage, base: Base) -> Result<Self> {
        let plain = || Self { cage: cage.clone(), ends: None, part: 0.0, middle: base.between(cage) };
        if cage.source.vertex_count() > MOST_VERTICES || cage.source == cage.target {
            return Ok(plain());
        }
        let failure = |what: String| {
            Error::numeric(format!("the relaxed path fails: {what}"), "Remove very thin parts of source and target")
        };
        let nesting = cage.source.nesting().map_err(|defect| failure(defect.to_string()))?;
        let outermost = nesting.parents.iter().position(Option::is_none).unwrap_or(0);
        let pairs = pairs(&cage.source);
        let cleared = |cage: &Cage| clearance(base.between(cage).as_ref(), cage, &nesting, &pairs, outermost);
        let wanted = need(cleared(cage));
        if wanted == 0.0 {
            return Ok(plain());
        }
        let relax = |polygon: &Polygon| Relaxation::new(polygon, &pairs, outermost);
        let (Some(source), Some(target)) = rayon::join(|| relax(&cage.source), || relax(&cage.target)) else {
            return Err(failure("it has parts too thin to relax".to_owned()));
        };
        let relaxed = |part: f64| Cage { source: source.at(part), target: target.at(part) };
        // A level that is too close asks for the next one.
        let level = |level: usize| level as f64 / LEVELS as f64;
        let further = |k: usize| level(k + 1) * need(cleared(&relaxed(level(k))));
        let part = wanted * (1..LEVELS).into_par_iter().map(further).reduce(|| level(1) * wanted, f64::max);
        let middle = base.between(&relaxed(part));
        Ok(Self { cage: cage.clone(), ends: Some([source, target]), part, middle })
    }

    /// By how much source and target are relaxed, 0..=1.
    pub fn part(&self) -> f64 {
        self.part
    }
}

/// The least distance of a vertex from an edge along a path, in the lesser of their distances at
/// its ends: at most 1, 0 if the path meets itself.
fn clearance(path: &dyn VertexPath, cage: &Cage, nesting: &Nesting, pairs: &[Pair], outermost: usize) -> f64 {
    let [from, to] = [&cage.source, &cage.target].map(|polygon| distances(polygon, pairs, outermost));
    let ends: Vec<f64> = from.iter().zip(&to).map(|(a, b)| a.min(*b)).collect();
    let mut least = 1.0_f64;
    for k in 1..TIMES {
        let Ok(polygon) = super::polygon_at(path, f64::from(k) / f64::from(TIMES), nesting) else { return 0.0 };
        let here = distances(&polygon, pairs, outermost);
        least = here.iter().zip(&ends).map(|(here, end)| here / end).fold(least, f64::min);
        if least <= CLOSE * CLOSE {
            return 0.0;
        }
    }
    least.sqrt()
}

impl VertexPath for Relaxed {
    fn polygon(&self, t: f64) -> Result<Polygon> {
        if t == 0.0 || t == 1.0 {
            return Ok(if t == 0.0 { self.cage.source.clone() } else { self.cage.target.clone() });
        }
        let Some([source, target]) = &self.ends else { return self.middle.polygon(t) };
        // The time a relaxation takes is in proportion to its part: 1 / 3 at most.
        let leg = self.part / (1.0 + 2.0 * self.part);
        if t < leg {
            Ok(source.at(self.part * t / leg))
        } else if 1.0 - t < leg {
            Ok(target.at(self.part * (1.0 - t) / leg))
        } else {
            self.middle.polygon(((t - leg) / (1.0 - 2.0 * leg)).clamp(0.0, 1.0))
        }
    }

    fn kind(&self) -> PathKind {
        if self.ends.is_some() { PathKind::Relaxed } else { self.middle.kind() }
    }
}
