//! Anchors proposed.
pub mod register;
pub mod side;
pub mod extremities;
pub mod marks;
pub mod outliers;
pub mod propose;

use crate::error::Result;
use crate::geometry::SurfacePoint;
use crate::progress::Progress;
use crate::surface::AnchorPairs;
use crate::surface::correspondence::Shape;

/// Where a pair comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin { Given, Mark, Relief }
#[derive(Clone, Debug)]
pub struct Proposed { pub source: SurfacePoint, pub target: SurfacePoint, pub origin: Origin, pub expected_error: f64, pub flagged: Option<String> }
pub struct Proposal { pub pairs: Vec<Proposed>, pub given: usize, pub outliers: Vec<outliers::Outlier>, pub notes: Vec<String>, pub ambiguity: Option<String> }
pub struct AnchorOptions { pub count: usize, pub registrations: usize, pub registration: register::Options, pub sigma: f64, pub cycle: f64 }

pub fn propose_anchors(source: Shape<'_>, target: Shape<'_>, pairs: &AnchorPairs, o: &AnchorOptions, p: &dyn Progress) -> Result<Proposal> {
    propose::propose(&propose::Couple::new(source, target)?, pairs, o, p)
}
