//! A pair of polygons as the maps read them: vertices and displacements in local coordinates.

use std::ops::Range;

use super::Frame;
use crate::engine::Real;
use crate::geometry::Polygon;

/// Radius of that circle in diagonals of the bounding box, whose centre is the origin.
const FAR: f64 = 0.6;

/// Vertices of the polygon a step starts from, and what they are moved by.
#[derive(Clone, Debug)]
pub(super) struct Outline<R> {
    /// The vertices, in the frame of the polygon.
    pub(super) vertices: Vec<[R; 2]>,
    /// Their images, in the frame of the polygon the step leads to.
    pub(super) images: Vec<[R; 2]>,
    /// Images minus vertices. Errors of the weights are multiplied by these, not by coordinates.
    pub(super) displacements: Vec<[R; 2]>,
    /// The loops as ranges of vertices; each has at least one.
    pub(super) loops: Vec<Range<usize>>,
    /// Squared distance from the origin beyond which a point is far away: a circle around the
    /// polygon with a margin.
    pub(super) far: R,
}

impl<R: Real> Outline<R> {
    /// The pair in local coordinates of both frames at `scale`. Vertices are rounded to `R` first
    /// and displacements are differences of rounded vertices, so that a vertex lands on the next
    /// polygon's own rounding of its image.
    pub(super) fn new(from: &Polygon, to: &Polygon, scale: f64) -> Self {
        let local = |polygon: &Polygon| -> Vec<[R; 2]> {
            let frame = Frame::of(polygon, scale);
            polygon.vertices().map(|v| frame.local(v)).collect()
        };
        let (vertices, images) = (local(from), local(to));
        let displacements = vertices
            .iter()
            .zip(&images)
            .map(|(v, w)| std::array::from_fn(|c| R::of(w[c].to_f64() - v[c].to_f64())))
            .collect();
        let mut first = 0;
        let mut loops = Vec::with_capacity(from.loops().len());
        for ring in from.loops().iter().filter(|ring| !ring.is_empty()) {
            loops.push(first..first + ring.len());
            first += ring.len();
        }
        let radius = FAR * from.size() * scale;
        Self { vertices, images, displacements, loops, far: R::of(radius * radius) }
    }

    /// The same in another precision.
    pub(super) fn cast<T: Real>(&self) -> Outline<T> {
        let all = |list: &[[R; 2]]| list.iter().map(|v| v.map(|x| T::of(x.to_f64()))).collect();
        Outline {
            vertices: all(&self.vertices),
            images: all(&self.images),
            displacements: all(&self.displacements),
            loops: self.loops.clone(),
            far: T::of(self.far.to_f64()),
        }
    }

    /// Number of vertices.
    pub(super) fn len(&self) -> usize {
        self.vertices.len()
    }

    /// All edges: of each the vertex it leaves and the one it leads to. Edge `i` leaves vertex `i`.
    #[inline(always)]
    pub(super) fn edges(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.loops.iter().flat_map(|ring| ring.clone().map(|i| (i, if i + 1 == ring.end { ring.start } else { i + 1 })))
    }
}

/// a x b.
#[inline(always)]
pub(super) fn cross<R: Real>(a: [R; 2], b: [R; 2]) -> R {
    a[0] * b[1] - a[1] * b[0]
}

/// a . b.
#[inline(always)]
pub(super) fn dot<R: Real>(a: [R; 2], b: [R; 2]) -> R {
    a[0] * b[0] + a[1] * b[1]
}

/// a - b.
#[inline(always)]
pub(super) fn sub<R: Real>(a: [R; 2], b: [R; 2]) -> [R; 2] {
    [a[0] - b[0], a[1] - b[1]]
}
