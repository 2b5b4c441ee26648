//! Vertex paths: how the source polyhedron becomes the target (paper, section 4.5).
//!
//! A path gives a polyhedron for every `t` in 0..1, the source at 0 and the target at 1. The
//! straight one is here; others come from those who can make them (`tools` has one by mean-value
//! encoding).

use glam::DVec3;

use crate::error::Result;

use super::Cage;

/// A continuous path from a source polyhedron (t = 0) to a target (t = 1).
pub trait VertexPath: Sync {
    /// The positions of the vertices at `t` in 0..=1, exactly the ends at 0 and 1. The same for the
    /// same `t`, whatever was asked before.
    ///
    /// # Errors
    /// Where the path has no polyhedron at `t`; the message says why.
    fn positions(&self, t: f64) -> Result<Vec<DVec3>>;

    /// The word of reports.
    fn name(&self) -> &str;
}

/// Every vertex goes straight.
#[derive(Clone, Debug)]
pub struct Linear {
    cage: Cage,
}

impl Linear {
    /// The straight path between the polyhedra of `cage`.
    pub fn new(cage: &Cage) -> Self {
        Self { cage: cage.clone() }
    }
}

impl VertexPath for Linear {
    fn positions(&self, t: f64) -> Result<Vec<DVec3>> {
        let between = |(&a, &b): (&DVec3, &DVec3)| if t == 1.0 { b } else { a * (1.0 - t) + b * t };
        Ok(self.cage.source.iter().zip(&self.cage.target).map(between).collect())
    }

    fn name(&self) -> &str {
        "linear"
    }
}
