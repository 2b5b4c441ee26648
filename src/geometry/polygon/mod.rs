//! Polygons in the plane: one or several nested loops.

mod defect;
mod locate;
mod measure;
mod nesting;
mod sweep;

use glam::DVec2;

pub use defect::Defect;
#[doc(hidden)]
pub use defect::{EdgeOf, VertexOf};
pub use locate::Side;
#[doc(hidden)]
pub use measure::{barycentre, signed_area};
#[doc(hidden)]
pub use nesting::Nesting;

/// One or several closed loops of vertices; the domain lies to the left of every edge.
///
/// Outer loops run anticlockwise (y up), the holes in them clockwise, and so on inwards. Edge `i`
/// of a loop goes from its vertex `i` to the next, the last one back to the first. Vertices are
/// numbered through all loops in order.
#[derive(Clone, Debug, PartialEq)]
pub struct Polygon {
    loops: Vec<Vec<DVec2>>,
}

/// A corner of the polygon with its neighbours along its loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corner {
    /// Number of the vertex through all loops.
    pub index: usize,
    /// Number of the vertex before it in its loop.
    pub before: usize,
    /// Number of the vertex after it in its loop.
    pub after: usize,
    /// Its loop.
    pub ring: usize,
}

impl Polygon {
    /// The loops as they are given, unchecked: orientation and simplicity are the caller's.
    pub fn from_loops(loops: Vec<Vec<DVec2>>) -> Self {
        Self { loops }
    }

    /// The loops.
    pub fn loops(&self) -> &[Vec<DVec2>] {
        &self.loops
    }

    /// Number of vertices of all loops.
    pub fn vertex_count(&self) -> usize {
        self.loops.iter().map(Vec::len).sum()
    }

    /// All vertices in order.
    pub fn vertices(&self) -> impl Iterator<Item = DVec2> + '_ {
        self.loops.iter().flatten().copied()
    }

    /// The corners in the order of the vertices.
    pub fn corners(&self) -> impl Iterator<Item = Corner> + '_ {
        let mut first = 0;
        self.loops.iter().enumerate().flat_map(move |(ring, vertices)| {
            let (start, n) = (first, vertices.len());
            first += n;
            (0..n).map(move |i| Corner {
                index: start + i,
                before: start + (i + n - 1) % n,
                after: start + (i + 1) % n,
                ring,
            })
        })
    }

    /// Smallest and largest coordinates of the vertices.
    pub fn bounds(&self) -> (DVec2, DVec2) {
        self.vertices().fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
    }

    /// Centre of the bounding box.
    pub fn centre(&self) -> DVec2 {
        let (low, high) = self.bounds();
        low + (high - low) * 0.5
    }

    /// Length of the diagonal of the bounding box: the size that tolerances refer to.
    pub fn size(&self) -> f64 {
        let (low, high) = self.bounds();
        (high - low).length()
    }
}
