//! Anchors as they are given, found on their meshes.

use std::path::PathBuf;

use barymap::desk::{Subject, find_pairs};
use barymap::glam::DVec3;
use barymap::io::anchors::{AnchorList, AnchorPairs as Written, AnchorSpec, read_pairs};
use barymap::surface::AnchorPairs;
use barymap::{Error, Result};
use pyo3::prelude::*;

/// Anchors of one mesh: a dictionary of the Python half. `kinds` has 0 for a vertex, 1 for a point
/// of a face, 2 for a position; `ids` the vertex or face; `values` coordinates or position.
#[derive(Clone, Debug, FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Side {
    kinds: Vec<u8>,
    ids: Vec<u32>,
    values: Vec<[f64; 3]>,
}

impl Side {
    /// The list, named `argument` in messages.
    pub(crate) fn list(&self, argument: &str) -> AnchorList {
        let all = self.kinds.iter().zip(&self.ids).zip(&self.values);
        let anchors = all.map(|((kind, &id), &value)| match kind {
            0 => AnchorSpec::Vertex(id),
            1 => AnchorSpec::Face { face: id, barycentric: value },
            _ => AnchorSpec::Position(DVec3::from(value)),
        });
        AnchorList { path: PathBuf::from(argument), anchors: anchors.collect() }
    }
}

/// Pairs as they are given: two sides, or the name of a file.
#[derive(Clone, Debug, FromPyObject)]
pub(crate) enum Given {
    /// A file.
    File(String),
    /// Source and target.
    Sides((Side, Side)),
}

impl Given {
    /// The pairs on both meshes, and sentences for the user.
    pub(crate) fn find(&self, source: &Subject, target: &Subject) -> Result<(AnchorPairs, Vec<String>)> {
        let written = match self {
            Self::File(path) => read_pairs(path)?,
            Self::Sides((s, t)) => Written { source: s.list("anchors, source"), target: t.list("anchors, target") },
        };
        let [s, t] = [&written.source, &written.target].map(|l| l.anchors.len());
        if s != t {
            let what = format!("anchors: {s} on the source and {t} on the target");
            return Err(Error::input(what, "Give as many of one as of the other, in the same order"));
        }
        let found = find_pairs(&written, source, target)?;
        Ok((found.pairs, found.notes))
    }
}
