//! The polygons of a step as the certificate needs them, and exact decisions about them.

use glam::DVec2;

use super::interval::Interval;
use crate::error::{Error, Result};
use crate::geometry::Polygon;

/// A vector of intervals.
pub(super) type Vector = [Interval; 2];

pub(super) fn minus(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1]]
}

pub(super) fn dot(a: Vector, b: Vector) -> Interval {
    a[0] * b[0] + a[1] * b[1]
}

pub(super) fn cross(a: Vector, b: Vector) -> Interval {
    a[0] * b[1] - a[1] * b[0]
}

pub(super) fn point(p: [f64; 2]) -> Vector {
    p.map(Interval::point)
}

/// Source and target of a step, each scaled by a power of two (exactly) to a size of about 1, and
/// shifted to one of its vertices where that is exact, too: translations change no Jacobian, and
/// far from the origin enclosures would be as wide as coordinates are rounded.
#[derive(Clone, Debug)]
pub(super) struct Domain {
    /// Vertices of the source.
    pub(super) vertices: Vec<[f64; 2]>,
    /// Vertices of the target.
    pub(super) images: Vec<[f64; 2]>,
    /// The vertex after each in its loop; edge i runs from vertex i to `after[i]`.
    pub(super) after: Vec<usize>,
    /// The vertex before each in its loop.
    pub(super) before: Vec<usize>,
    /// Local units of the source in one unit of the file.
    scale: f64,
    /// The point of the file that the source is shifted by.
    origin: DVec2,
    /// What turns a Jacobian of the scaled polygons into one of the polygons as given: a power of
    /// two.
    pub(super) jacobian_unit: f64,
}

impl Domain {
    pub(super) fn new(from: &Polygon, to: &Polygon) -> Result<Self> {
        let lengths = |polygon: &Polygon| polygon.loops().iter().map(Vec::len).collect::<Vec<_>>();
        if lengths(from) != lengths(to) {
            return Err(Error::input(
                format!("certificate: the loops have {:?} and {:?} vertices", lengths(from), lengths(to)),
                "Give both polygons the same loops",
            ));
        }
        if let Some(short) = from.loops().iter().position(|l| l.len() < 3) {
            return Err(Error::input(
                format!("certificate: loop {short} has {} vertices", from.loops()[short].len()),
                "A loop needs three",
            ));
        }
        if from.vertex_count() == 0 {
            return Err(Error::input(
                "certificate: the polygons are empty",
                "Give them a loop of three vertices or more",
            ));
        }
        let (source_scale, target_scale) = (scale(from, "source")?, scale(to, "target")?);
        let origin = exact_origin(from);
        let local = |polygon: &Polygon, origin: DVec2, scale: f64| -> Vec<[f64; 2]> {
            polygon.vertices().map(|v| ((v - origin) * scale).to_array()).collect()
        };
        let domain = Self {
            vertices: local(from, origin, source_scale),
            images: local(to, exact_origin(to), target_scale),
            after: from.corners().map(|c| c.after).collect(),
            before: from.corners().map(|c| c.before).collect(),
            scale: source_scale,
            origin,
            jacobian_unit: (source_scale / target_scale).powi(2),
        };
        if let Some(i) = (0..domain.len()).find(|&i| domain.vertices[i] == domain.vertices[domain.after[i]]) {
            return Err(Error::input(
                format!("certificate: vertex {i} of the source and the next one coincide"),
                "Remove one of them from both polygons",
            ));
        }
        Ok(domain)
    }

    /// A point of the source in the coordinates of the file.
    pub(super) fn world(&self, p: [f64; 2]) -> DVec2 {
        DVec2::from(p) / self.scale + self.origin
    }

    /// Number of vertices, and of edges.
    pub(super) fn len(&self) -> usize {
        self.vertices.len()
    }

    /// Edge i as a vector.
    pub(super) fn edge(&self, i: usize) -> Vector {
        minus(point(self.vertices[self.after[i]]), point(self.vertices[i]))
    }

    /// Twice the signed area of the triangle from `p` to edge `i`: positive to the left of the
    /// edge.
    pub(super) fn side(&self, i: usize, p: Vector) -> Interval {
        cross(minus(point(self.vertices[i]), p), self.edge(i))
    }

    /// How often the loops wind around `p`: once inside of the polygon, not at all outside. None if
    /// `p` is too close to the boundary for double precision to tell.
    ///
    /// Counts the edges that cross the ray to the right of `p`: which edges meet the ray's line is
    /// decided by comparisons, on which side of `p` they do so by the sign of an interval. No
    /// rounding enters.
    pub(super) fn winding(&self, p: [f64; 2]) -> Option<i32> {
        let mut winding = 0;
        for i in 0..self.len() {
            let (a, b) = (self.vertices[i], self.vertices[self.after[i]]);
            if (a[1] <= p[1]) == (b[1] <= p[1]) {
                continue;
            }
            let side = self.side(i, point(p));
            if side.may_vanish() {
                return None;
            }
            let upwards = b[1] > a[1];
            if (side.lo > 0.0) == upwards {
                winding += if upwards { 1 } else { -1 };
            }
        }
        Some(winding)
    }

    /// Whether the rectangle of `x` and `y` shares no point with the closed edge `i`, by a
    /// separating axis: one of the coordinates, or the edge's normal. False if in doubt.
    pub(super) fn is_clear_of_edge(&self, i: usize, x: Interval, y: Interval) -> bool {
        let (a, b) = (self.vertices[i], self.vertices[self.after[i]]);
        let apart = |lo: f64, hi: f64, p: f64, q: f64| p.max(q) < lo || p.min(q) > hi;
        if apart(x.lo, x.hi, a[0], b[0]) || apart(y.lo, y.hi, a[1], b[1]) {
            return true;
        }
        !self.side(i, [x, y]).may_vanish()
    }
}

/// The first vertex, if all differences from it are exact; else the origin of the file.
fn exact_origin(polygon: &Polygon) -> DVec2 {
    let Some(origin) = polygon.vertices().next() else { return DVec2::ZERO };
    // The rounding error of a difference (Knuth's two-sum).
    let error = |a: f64, b: f64| {
        let d = a - b;
        let back = a - d;
        (a - (d + back)) + (back - b)
    };
    let exact = |v: DVec2| error(v.x, origin.x) == 0.0 && error(v.y, origin.y) == 0.0;
    if polygon.vertices().all(exact) { origin } else { DVec2::ZERO }
}

/// The power of two that brings a polygon to a size between 1/2 and 1.
fn scale(polygon: &Polygon, name: &str) -> Result<f64> {
    let bad = |what: String| Err(Error::input(format!("certificate: {what}"), "Repair the cage"));
    if let Some(i) = polygon.vertices().position(|v| !v.is_finite()) {
        return bad(format!("vertex {i} of the {name} is not finite"));
    }
    let size = polygon.size();
    let largest = polygon.vertices().map(|v| v.abs().max_element()).fold(0.0, f64::max);
    if !(size > 1e-70 && largest < 1e70) {
        return bad(format!("the {name} has the size {size:e} and coordinates up to {largest:e}"));
    }
    let scale = (-size.log2().ceil()).exp2();
    match polygon.vertices().position(|v| (v * scale) / scale != v) {
        Some(i) => bad(format!("vertex {i} of the {name} has a coordinate too small for the polygon's size")),
        None => Ok(scale),
    }
}
