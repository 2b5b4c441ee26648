//! What a field is asked for, and what it chose.

use super::{Contradicted, Expected, Relaxation};

/// What a field is made of.
#[derive(Clone, Copy, Debug)]
pub struct FieldOptions {
    /// Whether the images of vertices are drawn onto the source. Default true; without it a change
    /// of anchors costs far less.
    pub relax: bool,
    /// How they are drawn. Default none: chosen by what anchors say that are left out. Where it is
    /// given, lambda is not chosen by strain either.
    pub relaxation: Option<Relaxation>,
    /// Weight of places in space over places in the embedding. Default none: chosen.
    pub lambda: Option<f64>,
    /// Whether points get a confidence. Default true; without it neither lambda nor the relaxation
    /// is looked at again.
    pub confidence: bool,
    /// Whether pairs that the others contradict are used as well. Default false; a field that is
    /// not relaxed has them all, and so has a mesh on itself.
    pub keep_all: bool,
    /// What pairs are off by, root mean square, over the square root of the source's area: their
    /// points on the source are moved towards where the others send them. Default 0: they are
    /// held.
    pub anchor_error: f64,
}

impl Default for FieldOptions {
    fn default() -> Self {
        Self { relax: true, relaxation: None, lambda: None, confidence: true, keep_all: false, anchor_error: 0.0 }
    }
}

impl FieldOptions {
    /// The relaxation that is asked for, the usual one where none is.
    pub(super) fn relaxation(&self) -> Relaxation {
        if self.relax { self.relaxation.unwrap_or(Relaxation::Planes) } else { Relaxation::Off }
    }
}

/// Fewer pairs say nothing about one another.
pub(crate) const FEWEST: usize = 6;
/// Pairs at odds miss one another by more than this part of the distance between pairs that share a
/// unit area evenly: sets of 6 to 40 true pairs on people, foxes and other animals reach 0.14, the
/// same shuffled 0.78 at least.
const AT_ODDS: f64 = 0.4;

/// What was chosen, for the report.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct FieldReport {
    /// Predictions in the embedding, with their weights.
    pub embedded: Vec<(&'static str, f64)>,
    /// Predictions in space, with their weights.
    pub spatial: Vec<(&'static str, f64)>,
    /// Weight of places in space.
    pub lambda: f64,
    /// Whether it is not what predictions chose, since another one strains the map much less.
    pub lambda_by_strain: bool,
    /// How images were drawn onto the source.
    pub relaxation: Option<Relaxation>,
    /// For each anchor how far the others would have missed it, over the square root of the
    /// source's area; empty where no anchor was left out.
    pub left_out: Vec<f64>,
    /// Pairs that the others contradict, rising: the field does without them.
    pub contradicted: Vec<Contradicted>,
    /// The error to be expected; none where nothing is known of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub expected: Option<Expected>,
    /// Vertices of the target that lie beyond the rim of the source, and have no image.
    pub beyond_rim: usize,
    /// Vertices whose images lay apart from those of their neighbours and took their place from
    /// these.
    pub reseated: usize,
    /// Triangles of the target that the relaxation turned over, and those that are so still after
    /// the repair.
    pub turned: [usize; 2],
    /// Of those that the relaxation turned over, the ones neither predicted beyond the source's rim
    /// nor drawn onto it.
    #[serde(skip)]
    pub(super) turned_within: usize,
}

impl FieldReport {
    /// What half of the pairs are missed by where each is left out, if that is so much that most of
    /// them must be wrong; none can be named then. Over the square root of the source's area.
    pub fn at_odds(&self) -> Option<f64> {
        let pairs = self.left_out.len();
        let usual = super::contradicted::median(&self.left_out);
        (pairs >= FEWEST && usual > AT_ODDS / (pairs as f64).sqrt()).then_some(usual)
    }
}
