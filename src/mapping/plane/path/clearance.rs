//! How far polygons keep off themselves.

use glam::DVec2;

use crate::geometry::Polygon;
use crate::geometry::polygon::signed_area;

/// Times at which a path is looked at, less one.
pub(super) const TIMES: u32 = 48;

/// A vertex, by number, and an edge that does not end there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pair {
    pub(super) vertex: usize,
    pub(super) edge: [usize; 2],
    /// Whether the edge is of the vertex' own loop.
    pub(super) same: bool,
}

/// All vertices of a polygon with all edges that do not end there: O(n^2).
pub(super) fn pairs(polygon: &Polygon) -> Vec<Pair> {
    let corners: Vec<_> = polygon.corners().collect();
    let with = |vertex: usize, ring: usize| {
        let edges = corners.iter().filter(move |c| c.index != vertex && c.after != vertex);
        edges.map(move |c| Pair { vertex, edge: [c.index, c.after], same: c.ring == ring })
    };
    corners.iter().flat_map(|c| with(c.index, c.ring)).collect()
}

/// The place on an edge closest to a vertex, as a fraction of its length, and the way from there to
/// the vertex.
pub(super) fn closest(points: &[DVec2], pair: &Pair) -> (f64, DVec2) {
    let [a, b] = pair.edge.map(|v| points[v]);
    let (edge, to) = (b - a, points[pair.vertex] - a);
    let along = (to.dot(edge) / edge.length_squared()).clamp(0.0, 1.0);
    (along, to - edge * along)
}

/// Squared distances of the pairs of a polygon, for an area of 1 within loop `outermost`.
pub(super) fn distances(polygon: &Polygon, pairs: &[Pair], outermost: usize) -> Vec<f64> {
    let points: Vec<DVec2> = polygon.vertices().collect();
    let area = signed_area(&polygon.loops()[outermost]).abs();
    pairs.iter().map(|pair| closest(&points, pair).1.length_squared() / area).collect()
}
