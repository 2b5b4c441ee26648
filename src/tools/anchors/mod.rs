//! Anchors: a full set from a few pairs or none, the pairs that contradict the others, and where
//! the next ones would help most.
//!
//! Where both meshes have the same connectivity (a character and its posed copy, whatever the
//! numbers of its vertices) the pairs are the vertices themselves.
//!
//! Else a pair taken from the current map says nothing new, so every proposal rests on the relief
//! of both surfaces: how each differs from smoothed copies of itself. The images of the map by the
//! given pairs are *registered*: they slide over the source until the relief around image and
//! vertex agree, smoothly, given pairs held; places are taken far from one another where the
//! registrations in both directions agree.

mod connectivity;
mod extremities;
mod hypotheses;
mod mirror;
mod outliers;
mod propose;
mod register;
mod seedless;
mod side;
mod suggest;

pub use extremities::Extremity;
pub use mirror::mirrored;
#[doc(hidden)]
pub use mirror::{MirrorPlane, Mirrored};
pub use outliers::{Contradictions, Outlier};
pub use suggest::{Suggestion, suggest};

use crate::error::{Error, Result};
use crate::geometry::SurfacePoint;
use crate::progress::Progress;
use crate::surface::AnchorPairs;
use crate::surface::correspondence::Shape;

/// Largest number of pairs that are proposed.
pub const MOST: usize = 1000;

/// Where a pair comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[doc(hidden)]
pub enum Origin {
    /// Given by the user.
    Given,
    /// A tip of a limb, matched without seeds.
    Limb,
    /// The same vertex of meshes of the same connectivity.
    Connectivity,
    /// Found by the relief around it.
    Relief,
}

impl Origin {
    /// The word used in files and reports.
    pub fn word(self) -> &'static str {
        match self {
            Self::Given => "given",
            Self::Limb => "limb",
            Self::Connectivity => "connectivity",
            Self::Relief => "relief",
        }
    }
}

/// A pair of a proposal.
#[derive(Clone, Debug, PartialEq)]
#[doc(hidden)]
pub struct Proposed {
    /// On the source.
    pub source: SurfacePoint,
    /// On the target.
    pub target: SurfacePoint,
    /// Where it comes from.
    pub origin: Origin,
    /// The error expected, over the square root of the source's area; 0 for given pairs.
    pub expected_error: f64,
    /// Why the pair is doubtful, in words; `None` where nothing speaks against it.
    pub flagged: Option<String>,
}

/// A proposed set.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposal {
    /// The given pairs that are kept, in their order, then the proposed ones.
    pub pairs: Vec<Proposed>,
    /// Number of given pairs among them.
    pub given: usize,
    /// What the user should know, in full sentences.
    pub notes: Vec<String>,
    /// What distances along the surface could not decide.
    pub ambiguity: Option<String>,
}

impl Proposal {
    /// The pairs as a correspondence takes them.
    pub fn anchors(&self) -> AnchorPairs {
        AnchorPairs {
            source: self.pairs.iter().map(|p| p.source).collect(),
            target: self.pairs.iter().map(|p| p.target).collect(),
        }
    }
}

/// Options of [`propose`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AnchorOptions {
    /// Pairs wanted in all, the given ones included. Default 64.
    pub count: usize,
    /// Whether meshes of the same connectivity, however numbered, get the same vertices as pairs.
    /// Default true; false goes by the shape alone.
    pub connectivity: bool,
}

impl Default for AnchorOptions {
    fn default() -> Self {
        Self { count: 64, connectivity: true }
    }
}

/// A full set of anchors from `seeds`, which may be empty: then tips of limbs are matched first
/// ([`Proposal::ambiguity`] tells what that left open).
///
/// Given pairs are kept as they are. Fewer than `count` are proposed where the surfaces have no
/// more features in common. The same input gives the same pairs for any number of threads. A few
/// maps by the method `field`, and two registrations where the connectivities differ: seconds for
/// 13,000 vertices on two cores.
///
/// # Errors
/// [`Error::Option`] for a count of 0 or above [`MOST`]; [`Error::Unusable`] without seeds if the
/// surfaces have different numbers of components and none that is most of them, or fewer than four
/// limbs; [`Error::Input`] if the seeds do not fit.
pub fn propose(
    source: Shape<'_>,
    target: Shape<'_>,
    seeds: &AnchorPairs,
    options: &AnchorOptions,
    progress: &dyn Progress,
) -> Result<Proposal> {
    if !(1..=MOST).contains(&options.count) {
        let what = format!("{} pairs", options.count);
        return Err(Error::option("count", what, format!("Give a number from 1 to {MOST}")));
    }
    let couple = propose::Couple::new(source, target)?;
    let components = [source.topology.component_count, target.topology.component_count];
    let bodies = couple.sides.iter().all(|side| side.main_component().is_some());
    if components[0] != components[1] && !bodies && seeds.is_empty() {
        return Err(Error::unusable(
            format!(
                "{} has {} components and {} has {}, and none that is most of it: without pairs it is not known which belong together",
                source.mesh.name, components[0], target.mesh.name, components[1]
            ),
            "Give pairs with --anchors, at least one on every component of the target, or join the parts",
        ));
    }
    if !seeds.is_empty() {
        seeds.check((source.mesh, source.topology), (target.mesh, target.topology))?;
        return propose::propose(&couple, seeds, Origin::Given, options, progress);
    }
    let found = seedless::match_tips(&couple)?;
    let mut proposal = propose::propose(&couple, &found.pairs, Origin::Limb, options, progress)?;
    for (p, error) in proposal.pairs.iter_mut().zip(&found.errors).filter(|(p, _)| p.origin == Origin::Limb) {
        p.expected_error = *error;
    }
    proposal.notes.insert(0, found.note);
    if let Some(text) = &found.ambiguity {
        for p in &mut proposal.pairs {
            p.flagged.get_or_insert_with(|| "limbs may be exchanged, left and right or front and back".to_owned());
        }
        proposal.notes.push(text.clone());
    }
    proposal.ambiguity = found.ambiguity;
    Ok(proposal)
}

/// The pairs that the others contradict, worst first: each is where it is sent by all others by
/// more than 0.03 of the square root of the area, four times the median and 0.8 of the distance to
/// the next pair (2.5 at tips, which no others surround). They are taken out one after the other,
/// so that one wrong pair does not accuse its neighbours. Fewer than six pairs say nothing about
/// one another, and nothing is named. Where most are wrong none can be named either:
/// [`Contradictions::at_odds`].
///
/// # Errors
/// As [`crate::surface::correspondence::correspondence`].
pub fn contradicted(source: Shape<'_>, target: Shape<'_>, pairs: &AnchorPairs) -> Result<Contradictions> {
    outliers::outliers(source, target, pairs)
}
