//! Every vertex goes straight.

use crate::error::Result;
use crate::geometry::Polygon;
use crate::mapping::plane::Cage;

use super::{PathKind, VertexPath};

/// `phi_i(t) = (1 - t) v_i + t v^_i` (paper, section 3).
#[derive(Clone, Debug)]
pub struct Linear {
    cage: Cage,
}

impl Linear {
    /// The straight path between the polygons of `cage`.
    pub fn new(cage: &Cage) -> Self {
        Self { cage: cage.clone() }
    }
}

impl VertexPath for Linear {
    fn polygon(&self, t: f64) -> Result<Polygon> {
        let between = |(a, b): (&Vec<_>, &Vec<_>)| a.iter().zip(b).map(|(&a, &b)| a * (1.0 - t) + b * t).collect();
        Ok(Polygon::from_loops(self.cage.source.loops().iter().zip(self.cage.target.loops()).map(between).collect()))
    }

    fn kind(&self) -> PathKind {
        PathKind::Linear
    }
}
