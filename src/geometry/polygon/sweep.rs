//! Whether loops are simple and disjoint, and how they are nested: one sweep over the plane.

use std::cmp::Ordering;
use std::collections::BTreeSet;

use glam::DVec2;

use super::locate::{between, orientation};
use super::measure::signed_area;
use super::{Defect, EdgeOf, Polygon, VertexOf};
use crate::geometry::RANGE;

/// Vertices next to one another must be this far apart, in sizes of the polygon: single precision
/// still tells them apart.
const CLOSE: f64 = 2e-7;
/// A loop whose area is below this, in squared sizes of the loop, counts as a line.
const FLAT: f64 = 1e-12;

/// Order of the sweep: by x, then by y, as if the plane were sheared a little.
fn sweep_order(a: DVec2, b: DVec2) -> Ordering {
    a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y))
}

/// An edge in the status of the sweep.
#[derive(Clone, Copy, Debug)]
struct Segment {
    /// The end that the sweep meets first.
    left: DVec2,
    right: DVec2,
    /// Whether the edge runs from `left` to `right`.
    forward: bool,
    edge: EdgeOf,
}

impl Segment {
    fn new(loops: &[Vec<DVec2>], edge: EdgeOf) -> Self {
        let ring = &loops[edge.ring];
        let (a, b) = (ring[edge.edge], ring[(edge.edge + 1) % ring.len()]);
        let forward = sweep_order(a, b).is_lt();
        let (left, right) = if forward { (a, b) } else { (b, a) };
        Self { left, right, forward, edge }
    }

    /// Whether the two have a point in common other than one end of both.
    fn meets(&self, other: &Self) -> bool {
        let (a, b, c, d) = (self.left, self.right, other.left, other.right);
        for (p, q, r, s) in [(a, b, c, d), (a, b, d, c), (b, a, c, d), (b, a, d, c)] {
            if p == r {
                // A common end: they overlap where both leave it in the same direction.
                return orientation(p, q, s) == 0.0 && (q - p).dot(s - p) > 0.0;
            }
        }
        let (of_c, of_d) = (orientation(a, b, c), orientation(a, b, d));
        let (of_a, of_b) = (orientation(c, d, a), orientation(c, d, b));
        let apart = |x: f64, y: f64| (x > 0.0 && y < 0.0) || (x < 0.0 && y > 0.0);
        (apart(of_c, of_d) && apart(of_a, of_b))
            || (of_c == 0.0 && between(a, b, c))
            || (of_d == 0.0 && between(a, b, d))
            || (of_a == 0.0 && between(c, d, a))
            || (of_b == 0.0 && between(c, d, b))
    }
}

// From below to above, for segments that the sweep line cuts at the same time and that have not met
// so far. The later of the left ends decides; where it is common, the right ends do.
impl Ord for Segment {
    fn cmp(&self, other: &Self) -> Ordering {
        if self.edge == other.edge {
            return Ordering::Equal;
        }
        let sign = |x: f64| x.partial_cmp(&0.0).unwrap_or(Ordering::Equal);
        if sweep_order(self.left, other.left).is_lt() {
            // The other starts above this one: this one is less.
            sign(orientation(self.left, self.right, other.left))
                .reverse()
                .then_with(|| sign(orientation(self.left, self.right, other.right)).reverse())
        } else {
            sign(orientation(other.left, other.right, self.left))
                .then_with(|| sign(orientation(other.left, other.right, self.right)))
        }
    }
}
impl PartialOrd for Segment {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl PartialEq for Segment {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}
impl Eq for Segment {}

/// Where to look for the point two edges have in common.
fn crossing(a: &Segment, b: &Segment) -> Defect {
    let (first, second) = if a.edge < b.edge { (a, b) } else { (b, a) };
    let (u, v) = (first.right - first.left, second.right - second.left);
    let s = (second.left - first.left).perp_dot(v) / u.perp_dot(v);
    let near = if s.is_finite() { first.left + u * s.clamp(0.0, 1.0) } else { (second.left + second.right) / 2.0 };
    Defect::Crossing { first: first.edge, second: second.edge, near }
}

/// What each loop alone must be: three vertices, finite, apart, not on one line.
fn check_loops(polygon: &Polygon) -> Result<(), Defect> {
    let loops = polygon.loops();
    if loops.is_empty() {
        return Err(Defect::Empty);
    }
    for (ring, vertices) in loops.iter().enumerate() {
        if vertices.len() < 3 {
            return Err(Defect::TooFew { ring, count: vertices.len() });
        }
        if let Some(vertex) = vertices.iter().position(|v| !v.is_finite()) {
            return Err(Defect::NotFinite(VertexOf { ring, vertex }));
        }
    }
    let (low, high) = polygon.bounds();
    let size = (high - low).max_element();
    // Products of coordinates are formed as well as products of differences.
    if size > 0.0 && !(RANGE.contains(&size) && low.abs().max(high.abs()).max_element() <= *RANGE.end()) {
        return Err(Defect::Range);
    }
    for (ring, vertices) in loops.iter().enumerate() {
        let n = vertices.len();
        if let Some(i) = (0..n).find(|&i| (vertices[(i + 1) % n] - vertices[i]).length() <= CLOSE * size) {
            let (first, second) = (i.min((i + 1) % n), i.max((i + 1) % n));
            return Err(Defect::Repeated(VertexOf { ring, vertex: first }, VertexOf { ring, vertex: second }));
        }
        if vertices.iter().all(|&v| orientation(vertices[0], vertices[1], v) == 0.0) {
            return Err(Defect::Collinear { ring });
        }
    }
    Ok(())
}

/// The vertices in the order of the sweep; two at the same place are an error.
fn events(loops: &[Vec<DVec2>]) -> Result<Vec<VertexOf>, Defect> {
    let at = |v: VertexOf| loops[v.ring][v.vertex];
    let mut order: Vec<VertexOf> = loops
        .iter()
        .enumerate()
        .flat_map(|(ring, vertices)| (0..vertices.len()).map(move |vertex| VertexOf { ring, vertex }))
        .collect();
    order.sort_by(|&a, &b| sweep_order(at(a), at(b)).then(a.cmp(&b)));
    match order.windows(2).find(|pair| at(pair[0]) == at(pair[1])) {
        Some(pair) => Err(Defect::Repeated(pair[0], pair[1])),
        None => Ok(order),
    }
}

/// The loop right around each loop, `None` for outermost ones.
///
/// A sweep with neighbour tests (Shamos, Hoey 1976) with exact predicates: the first pair of edges
/// that meets is found before the sweep has passed it, so that the order of the status is a total
/// one all the time. O(n log n) for n vertices, whatever their position.
pub(super) fn parents(polygon: &Polygon) -> Result<Vec<Option<usize>>, Defect> {
    check_loops(polygon)?;
    // Negative zero sorts below zero, which would make two orders of one position.
    let loops: Vec<Vec<DVec2>> =
        polygon.loops().iter().map(|ring| ring.iter().map(|&v| v + DVec2::ZERO).collect()).collect();
    let anticlockwise: Vec<bool> = loops.iter().map(|ring| signed_area(ring) > 0.0).collect();
    let mut parents: Vec<Option<Option<usize>>> = vec![None; loops.len()];
    let mut status: BTreeSet<Segment> = BTreeSet::new();
    for v in events(&loops)? {
        let n = loops[v.ring].len();
        let (a, b) = ((v.vertex + n - 1) % n, v.vertex);
        let incident = [a, b].map(|edge| Segment::new(&loops, EdgeOf { ring: v.ring, edge }));
        let at = loops[v.ring][v.vertex];
        for segment in incident.iter().filter(|s| s.right == at) {
            status.remove(segment);
        }
        for segment in incident.iter().filter(|s| s.left == at) {
            if let Some(other) = status.replace(*segment) {
                return Err(crossing(segment, &other));
            }
        }
        if parents[v.ring].is_none() {
            // The first vertex of a loop: both edges are new, and the lower one's lower neighbour
            // is where the loop lies in.
            let lower = if incident[0] < incident[1] { &incident[0] } else { &incident[1] };
            parents[v.ring] = Some(status.range(..lower).next_back().and_then(|below| {
                let interior_above = below.forward == anticlockwise[below.edge.ring];
                if interior_above { Some(below.edge.ring) } else { parents[below.edge.ring].flatten() }
            }));
        }
        // What the change made neighbours: around each new edge, or around the place where two
        // ended.
        for segment in incident.iter().filter(|s| s.left == at) {
            let neighbours = [status.range(..segment).next_back(), status.range(segment..).nth(1)];
            if let Some(other) = neighbours.into_iter().flatten().find(|other| segment.meets(other)) {
                return Err(crossing(segment, other));
            }
        }
        let gone = &incident[0];
        if incident.iter().all(|s| s.right == at)
            && let (Some(below), Some(above)) = (status.range(..gone).next_back(), status.range(gone..).next())
            && below.meets(above)
        {
            return Err(crossing(below, above));
        }
    }
    // Only now is the area of a loop known to be one of a simple loop.
    for (ring, vertices) in loops.iter().enumerate() {
        let low = vertices.iter().fold(DVec2::INFINITY, |a, &b| a.min(b));
        let high = vertices.iter().fold(DVec2::NEG_INFINITY, |a, &b| a.max(b));
        if !(signed_area(vertices).abs() > FLAT * (high - low).length_squared()) {
            return Err(Defect::Collinear { ring });
        }
    }
    Ok(parents.into_iter().map(Option::flatten).collect())
}
