//! What a field is asked for, and what it chose.

use super::Contradicted;

/// What a field is made of.
#[derive(Clone, Copy, Debug)]
pub struct FieldOptions {
    /// Whether the images of vertices are drawn onto the source. Default true; without it a change
    /// of anchors costs far less.
    pub relax: bool,
    /// Whether points get a confidence. Default true.
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
        Self { relax: true, confidence: true, keep_all: false, anchor_error: 0.0 }
    }
}

/// What was chosen, for the report.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct FieldReport {
    /// Predictions in the embedding, with their weights.
    pub embedded: Vec<(&'static str, f64)>,
    /// Predictions in space, with their weights.
    pub spatial: Vec<(&'static str, f64)>,
    /// Weight of places in space.
    pub lambda: f64,
    /// For each anchor how far the others would have missed it, over the square root of the
    /// source's area; empty where no anchor was left out.
    pub left_out: Vec<f64>,
    /// Pairs that the others contradict, rising: the field does without them.
    pub contradicted: Vec<Contradicted>,
    /// Vertices whose images lay apart from those of their neighbours and took their place from
    /// these.
    pub reseated: usize,
    /// Triangles of the target that the relaxation turned over, and those that are so still after
    /// the repair.
    pub turned: [usize; 2],
}
