//! What can be wrong with a polygon, in words.

use glam::DVec2;

/// A vertex by its loop and its number in that loop, both counted from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct VertexOf {
    /// The loop.
    pub ring: usize,
    /// The vertex within it.
    pub vertex: usize,
}

/// An edge by its loop and the vertex it starts from, both counted from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct EdgeOf {
    /// The loop.
    pub ring: usize,
    /// The edge within it: from this vertex to the next.
    pub edge: usize,
}

/// Why loops of vertices do not bound a domain. Loops, vertices and edges are counted from 0.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Defect {
    /// There is no loop.
    #[error("it has no loop")]
    Empty,
    /// A loop with fewer than three vertices.
    #[error("loop {ring} has {count} vertices, fewer than 3")]
    TooFew {
        /// The loop.
        ring: usize,
        /// Number of its vertices.
        count: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("vertex {} of loop {} is not finite", .0.vertex, .0.ring)]
    NotFinite(VertexOf),
    /// Coordinates whose products leave the range of double precision.
    #[error("its coordinates leave the range that can be computed with (sizes from 1e-100 to 1e100)")]
    Range,
    /// Two vertices at the same place, or next to one another and closer than single precision can
    /// tell.
    #[error("vertices {} of loop {} and {} of loop {} coincide", .0.vertex, .0.ring, .1.vertex, .1.ring)]
    Repeated(VertexOf, VertexOf),
    /// All vertices of a loop lie on one line, or so nearly that its area is nothing.
    #[error("the vertices of loop {ring} lie on one line")]
    Collinear {
        /// The loop.
        ring: usize,
    },
    /// Two edges cross, touch or overlap.
    #[error(
        "edge {} of loop {} meets edge {} of loop {} near ({:.6}, {:.6})",
        first.edge, first.ring, second.edge, second.ring, near.x, near.y
    )]
    Crossing {
        /// One of the edges.
        first: EdgeOf,
        /// The other.
        second: EdgeOf,
        /// A point close to where they meet.
        near: DVec2,
    },
    /// Two loops lie next to one another, where all should lie in one.
    #[error("loop {ring} lies outside loop {outer}")]
    Outside {
        /// The loop.
        ring: usize,
        /// The first outermost loop.
        outer: usize,
    },
    /// A loop runs the wrong way round for its nesting depth.
    #[error("loop {ring}, inside {depth} others, runs the wrong way round")]
    Orientation {
        /// The loop.
        ring: usize,
        /// Number of loops around it.
        depth: usize,
    },
}
