//! The smallest Jacobian of a step: what a search for it found, and how finely it looks.

use glam::DVec2;

/// Where in its polygon a minimum was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MinimumKind {
    /// At a sample inside the polygon.
    Interior,
    /// At a sample on an edge.
    Edge,
    /// At a vertex: the limit in the least favourable direction, in closed form.
    Vertex,
}

impl MinimumKind {
    /// The word of the reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Interior => "interior",
            Self::Edge => "edge",
            Self::Vertex => "vertex",
        }
    }
}

/// The smallest Jacobian of a step that was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Minimum {
    /// Its value. Not clamped; `-inf` where the map is not finite, which is a fold.
    pub value: f64,
    /// Where it is: in the polygon the step starts from, in the units of the file.
    pub at: DVec2,
    /// Whether that is inside, on an edge or at a vertex.
    pub kind: MinimumKind,
}

impl Minimum {
    /// Whether the step does not fold as far as was sampled: the minimum is positive. Zero and NaN
    /// are folds.
    pub fn positive(&self) -> bool {
        self.value > 0.0
    }
}

/// How finely the smallest Jacobian is searched for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleOptions {
    /// Samples along the longer side of the polygon's bounding box. Vertices and edges are looked
    /// at in any case.
    pub resolution: u32,
}

impl Default for SampleOptions {
    fn default() -> Self {
        Self { resolution: 256 }
    }
}
