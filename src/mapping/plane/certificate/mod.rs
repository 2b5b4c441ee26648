//! Proof that a mean value map between polygons does not fold.
//!
//! Sampling a Jacobian shows folds, it never shows their absence. Here the closed source polygon,
//! holes taken out, is covered by boxes, and on each the Jacobian is bounded from below in interval
//! arithmetic with outward rounding, until all bounds are positive. No bound rests on a sample, a
//! tolerance or a computed distance without a margin proved to suffice.
//!
//! # From J > 0 to a bijection
//!
//! Let Omega be the closed polygon (one or several nested loops), f the mean value map to a polygon
//! of the same kind. f is continuous, smooth but at the vertices, and on the boundary it is the
//! piecewise linear bijection of the boundaries. The certificate shows `J >= lower_bound > 0` on
//! Omega without the vertices, on the edges too, and for the one-sided limits at the vertices. Then
//! f is an orientation-preserving local homeomorphism of the interior, and a point q off the image
//! of the boundary has as many pre-images as that image winds around q (the degree of f at q;
//! Meisters and Olech 1963 for one loop). The boundary is mapped one-to-one onto the boundary of
//! the target and in its orientation, so this number is 1 inside the target and 0 outside. No inner
//! point is mapped onto the boundary of the target: f is open, so points outside would have
//! pre-images. Hence **f is a bijection of the closed polygons**. The caller answers for both
//! polygons being simple, their loops disjoint and oriented alike, and nested alike.
//!
//! A composite map is a bijection if each of its steps is.
//!
//! # Parts
//!
//! - `interval`: outward-rounded arithmetic; `jet`: Taylor coefficients in two variables of it.
//! - `domain`: the polygons, and decisions (inside, clear of an edge) without rounding.
//! - `chart`: coordinates of the plane, and fans at vertices, in which the limits at a vertex are
//!   ordinary values.
//! - `weights`: mean value weights without poles on edges and at vertices.
//! - `bounds`: enclosure of the Jacobian over a box by Taylor's theorem about its centre.
//! - `boxes`, `search`: the cover, and its refinement.
//!
//! The natural interval extension of the Jacobian overestimates its range by an error of first
//! order in the size of a box; Taylor's form of second degree by one of third order. That is what
//! makes whole polygons provable with some hundred boxes per vertex.

mod bounds;
mod boxes;
mod chart;
mod domain;
mod interval;
mod jet;
#[cfg(test)]
mod reference;
mod search;
mod weights;

#[cfg(test)]
mod tests;

use glam::DVec2;

use crate::error::{Error, Result};
use crate::geometry::Polygon;
use crate::progress::Progress;
use boxes::Corner;
use domain::Domain;
use search::Search;

/// How much effort a proof may take.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CertifyOptions {
    /// Largest number of boxes to examine. One costs about 1.3 microseconds per vertex.
    pub boxes: u64,
    /// The proved bound is brought within this fraction of the smallest sampled Jacobian where that
    /// is cheap (no more than three times the boxes of the proof itself).
    pub tolerance: f64,
}

impl Default for CertifyOptions {
    fn default() -> Self {
        Self { boxes: 400_000, tolerance: 0.1 }
    }
}

/// What the certificate found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// The Jacobian is proved to be at least this on the closed polygon.
    Certified {
        /// Proved lower bound, in units of the target's area over the source's.
        lower_bound: f64,
    },
    /// The budget did not suffice, or the polygon is degenerate.
    Undecided {
        /// Boxes examined.
        boxes: u64,
        /// A point of the box with the lowest bound.
        worst: DVec2,
        /// That bound; infinite or NaN where there is none.
        bound: f64,
    },
    /// The Jacobian is proved to be negative at a point of the polygon, or in the limit towards
    /// one.
    Folds {
        /// The point; a vertex where the limit of some direction is negative.
        at: DVec2,
        /// An upper bound of the Jacobian there.
        value: f64,
    },
}

/// A verdict and what it took.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Certificate {
    /// The verdict.
    pub verdict: Verdict,
    /// Boxes examined.
    pub boxes: u64,
    /// The smallest upper bound of the Jacobian met at a point of the polygon: the proved bound
    /// cannot exceed it. Infinite where none was computed.
    pub sampled: f64,
}

/// Proves that the mean value map from polygon `from` to polygon `to` has a positive Jacobian on
/// all of `from`, or finds that it has not.
///
/// Both polygons must be valid (simple, disjoint loops, the domain left of every edge); what is
/// checked here is only what the proof would not survive. Work is shared between threads in rounds
/// whose results are taken in order, so that the verdict does not depend on their number. Time is
/// proportional to the boxes examined times the vertices; memory to the boxes.
///
/// Reports parts per thousand of the polygon as one stage of `progress`.
///
/// # Errors
///
/// Loops that differ in number or length, or have fewer than 3 vertices; coordinates that are not
/// finite; a polygon with no extent; consecutive vertices that coincide; loops of the wrong
/// orientation; options out of range.
pub fn certify(from: &Polygon, to: &Polygon, options: &CertifyOptions, progress: &dyn Progress) -> Result<Verdict> {
    certificate(from, to, options, progress).map(|c| c.verdict)
}

/// What [`certify`] does, with the effort told.
///
/// # Errors
///
/// Those of [`certify`].
pub fn certificate(
    from: &Polygon,
    to: &Polygon,
    options: &CertifyOptions,
    progress: &dyn Progress,
) -> Result<Certificate> {
    if !(options.tolerance > 0.0 && options.tolerance <= 1.0) {
        return Err(Error::option(
            "tolerance",
            format!("{} is no fraction", options.tolerance),
            "Use a number in (0, 1]",
        ));
    }
    let domain = Domain::new(from, to)?;
    let mut corners = Vec::with_capacity(domain.len());
    for k in 0..domain.len() {
        let Some(corner) = Corner::new(&domain, k) else {
            let worst = domain.world(domain.vertices[k]);
            let verdict = Verdict::Undecided { boxes: 0, worst, bound: f64::NEG_INFINITY };
            return Ok(Certificate { verdict, boxes: 0, sampled: f64::INFINITY });
        };
        if !corner.is_inside(&domain) {
            return Err(Error::input(
                format!("certificate: the source is not to the left of its edges at vertex {k}"),
                "Run outer loops anticlockwise and holes clockwise, and let no loops cross",
            ));
        }
        corners.push(corner);
    }
    Search::new(&domain, corners, options, progress).run()
}
