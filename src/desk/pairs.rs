//! Anchors found on their shapes.

use super::Subject;
use crate::error::{Error, Result};
use crate::geometry::{ClosestPoints, SurfacePoint};
use crate::io::anchors::{AnchorList, AnchorPairs as WrittenPairs};
use crate::surface::AnchorPairs;

/// The part of a mesh's diagonal up to which a move of a position to the surface is not mentioned:
/// the rounding of the file that it was written to.
const ROUNDING: f64 = 1e-6;

/// Anchors on a shape.
#[derive(Clone, Debug)]
pub struct Found {
    /// The points.
    pub points: Vec<SurfacePoint>,
    /// Sentences for the user: positions that were moved to the surface.
    pub notes: Vec<String>,
}

/// Pairs of anchors on two shapes.
#[derive(Clone, Debug)]
pub struct FoundPairs {
    /// Corresponding points.
    pub pairs: AnchorPairs,
    /// Sentences for the user.
    pub notes: Vec<String>,
}

impl Subject {
    /// Finds anchors on this shape. O(n log F).
    ///
    /// # Errors
    /// As [`AnchorList::resolve`].
    pub fn find(&self, list: &AnchorList) -> Result<Found> {
        let closest = ClosestPoints::new(&self.mesh, &self.topology);
        let nearest = |p| closest.nearest(p).unwrap_or((SurfacePoint::new(0, [1.0, 0.0, 0.0]), f64::INFINITY));
        let resolved = list.resolve(&self.mesh, &self.topology, &nearest)?;
        let moved = resolved.iter().map(|r| r.snap_distance).fold(0.0, f64::max);
        let diagonal = self.mesh.bounds().map_or(0.0, |(low, high)| low.distance(high));
        let mut notes = Vec::new();
        if moved > ROUNDING * diagonal {
            notes.push(format!("anchors given by position were moved by up to {moved:.3e} onto {}", self.mesh.name));
        }
        Ok(Found { points: resolved.iter().map(|r| r.point).collect(), notes })
    }
}

/// Finds pairs of anchors on their shapes.
///
/// # Errors
/// [`Error::Input`] if there are none; as [`Subject::find`] and [`AnchorPairs::check`].
pub fn find_pairs(written: &WrittenPairs, source: &Subject, target: &Subject) -> Result<FoundPairs> {
    if written.source.anchors.is_empty() && written.target.anchors.is_empty() {
        let what = format!("{}: there are no anchors", written.source.path.display());
        return Err(Error::input(what, "Give at least one pair, better twenty or more"));
    }
    let (on_source, on_target) = (source.find(&written.source)?, target.find(&written.target)?);
    let pairs = AnchorPairs { source: on_source.points, target: on_target.points };
    let mut notes = on_source.notes;
    notes.extend(on_target.notes);
    notes.extend(pairs.check((&source.mesh, &source.topology), (&target.mesh, &target.topology))?);
    Ok(FoundPairs { pairs, notes })
}
