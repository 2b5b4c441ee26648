//! One step of a composite map: the barycentric map from one polygon to another.

use std::sync::OnceLock;

use rayon::prelude::*;

use super::outline::{Outline, dot};
use super::vertex_limit::VertexLimit;
use super::{mean_value, wachspress};
use crate::engine::Real;
use crate::error::{Error, Result};
use crate::geometry::Polygon;
use crate::words::words;

/// The barycentric coordinates that a map is made of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Coordinates {
    /// Mean value coordinates: any polygon, with holes, the whole plane.
    #[default]
    MeanValue,
    /// Wachspress coordinates: one strictly convex loop; points inside it.
    Wachspress,
}

words! { Coordinates, "coordinates", "a kind of coordinates":
    MeanValue => "mean-value",
    Wachspress => "wachspress",
}

impl Coordinates {
    /// Whether these coordinates exist for a (valid) polygon. The polygon a step leads to may be
    /// any.
    ///
    /// # Errors
    /// [`Error::Input`] for Wachspress coordinates of what is not one strictly convex loop, naming
    /// the vertex.
    pub fn check(self, polygon: &Polygon) -> Result<()> {
        match self {
            Self::MeanValue => Ok(()),
            Self::Wachspress => wachspress::check(polygon),
        }
    }
}

/// Which of its forms an evaluation took.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Branch {
    /// The general one: inside, outside or in a hole.
    Inside,
    /// On the open edge that leaves this vertex: exact linear interpolation.
    OnEdge(usize),
    /// At this vertex: exact.
    AtVertex(usize),
}

/// A map at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evaluation<R> {
    /// The image.
    pub point: [R; 2],
    /// The derivative, row by row: d f_x / d(x, y), d f_y / d(x, y).
    pub derivative: [[R; 2]; 2],
    /// Its determinant. Positive where the map keeps the orientation.
    pub jacobian: R,
    /// The form taken.
    pub branch: Branch,
}

/// One map f from polygon `from` to polygon `to` with the same loops, prepared for the scalar `R`.
///
/// Points go in and come out in local coordinates: of `Frame::of(from, scale)` before, of
/// `Frame::of(to, scale)` after. O(n) per point. With mean value coordinates the map is defined in
/// the whole plane, and linear on edges; next to the polygon the error is a few roundings of its
/// size, at distance R from a polygon of size h it grows as (R / h)^2.
#[derive(Clone, Debug)]
pub struct Step<R> {
    pub(super) coordinates: Coordinates,
    pub(super) outline: Outline<R>,
    /// Derivatives at the vertices, once they are asked for.
    derivatives: OnceLock<Vec<[[R; 2]; 2]>>,
}

impl<R: Real> Step<R> {
    /// The step from `from` to `to`. Both must have the same loops; [`Coordinates::check`] tells
    /// whether the coordinates exist.
    pub fn new(coordinates: Coordinates, from: &Polygon, to: &Polygon, scale: f64) -> Self {
        Self { coordinates, outline: Outline::new(from, to, scale), derivatives: OnceLock::new() }
    }

    /// The same step in another precision.
    pub fn cast<T: Real>(&self) -> Step<T> {
        Step { coordinates: self.coordinates, outline: self.outline.cast(), derivatives: OnceLock::new() }
    }

    /// The image of `p`.
    pub fn map(&self, p: [R; 2]) -> [R; 2] {
        let outline = &self.outline;
        match self.coordinates {
            Coordinates::MeanValue => {
                let found = mean_value::scan(outline, p);
                if found.at_vertex() {
                    return outline.images[found.nearest];
                }
                let mut sums = Sums::new(outline, found.nearest);
                mean_value::visit::<R, false>(outline, p, &found, |i, w, _| sums.add(i, w));
                sums.image(p)
            }
            Coordinates::Wachspress => {
                let q = wachspress::pivot(outline, p);
                let mut sums = Sums::new(outline, q);
                wachspress::visit::<R, false>(outline, p, q, |i, w, _| sums.add(i, w));
                sums.image(p)
            }
        }
    }

    /// Image, derivative and Jacobian at `p`.
    ///
    /// At a vertex of the polygon of mean value coordinates the image is exact and the derivative,
    /// which depends on the direction there, is the limit along the bisector of the interior angle.
    pub fn evaluate(&self, p: [R; 2]) -> Evaluation<R> {
        let outline = &self.outline;
        match self.coordinates {
            Coordinates::MeanValue => {
                let found = mean_value::scan(outline, p);
                if found.at_vertex() {
                    return self.at_vertex(found.nearest);
                }
                let mut sums = Sums::new(outline, found.nearest);
                mean_value::visit::<R, true>(outline, p, &found, |i, w, g| sums.add_gradient(i, w, g));
                let branch = match found.widest {
                    Some(k) if found.on_edge() => Branch::OnEdge(k),
                    _ => Branch::Inside,
                };
                sums.evaluation(p, branch)
            }
            Coordinates::Wachspress => {
                let q = wachspress::pivot(outline, p);
                let mut sums = Sums::new(outline, q);
                wachspress::visit::<R, true>(outline, p, q, |i, w, g| sums.add_gradient(i, w, g));
                if outline.vertices.get(q) == Some(&p) {
                    return Evaluation { point: outline.images[q], ..sums.evaluation(p, Branch::AtVertex(q)) };
                }
                sums.evaluation(p, Branch::Inside)
            }
        }
    }

    fn at_vertex(&self, k: usize) -> Evaluation<R> {
        let derivative = self.limit(k).derivative();
        Evaluation {
            point: self.outline.images[k],
            derivative,
            jacobian: determinant(derivative),
            branch: Branch::AtVertex(k),
        }
    }

    /// The map next to vertex `k`. O(n).
    pub(super) fn limit(&self, k: usize) -> VertexLimit<R> {
        let ring = self.outline.loops.iter().find(|ring| ring.contains(&k)).cloned().unwrap_or(k..k + 1);
        let before = if k == ring.start { ring.end - 1 } else { k - 1 };
        let after = if k + 1 == ring.end { ring.start } else { k + 1 };
        VertexLimit::new(&self.outline, before, k, after)
    }

    /// The derivatives along the bisectors at all vertices, from double precision. O(n^2), once.
    pub(super) fn vertex_derivatives(&self) -> &[[[R; 2]; 2]] {
        self.derivatives.get_or_init(|| {
            let wide = self.cast::<f64>();
            let derivative = |k: usize| wide.limit(k).derivative().map(|row| row.map(R::of));
            (0..self.outline.len()).into_par_iter().map(derivative).collect()
        })
    }

    /// The coordinates of `p`, vertex by vertex.
    pub(super) fn coordinates_of(&self, p: [R; 2]) -> Vec<R> {
        let mut b = vec![R::ZERO; self.outline.len()];
        let mut total = R::ZERO;
        self.visit::<false>(p, |i, w, _| {
            b[i] = w;
            total += w;
        });
        b.iter_mut().for_each(|b| *b = *b / total);
        b
    }

    /// Their gradients, by local coordinates; `p` is not at a vertex. With weights w_i and their
    /// sum W, the gradient of w_i / W is (grad w_i - w_i / W grad W) / W.
    pub(super) fn gradients_of(&self, p: [R; 2]) -> Vec<[R; 2]> {
        let mut all = vec![(R::ZERO, [R::ZERO; 2]); self.outline.len()];
        let (mut total, mut slope) = (R::ZERO, [R::ZERO; 2]);
        self.visit::<true>(p, |i, w, gradient| {
            all[i] = (w, gradient);
            total += w;
            (0..2).for_each(|axis| slope[axis] += gradient[axis]);
        });
        let gradient = |(w, g): (R, [R; 2])| std::array::from_fn(|axis| (g[axis] - w / total * slope[axis]) / total);
        all.into_iter().map(gradient).collect()
    }

    /// The weights of the coordinates at `p`, and their gradients if `GRADIENT`; at a vertex of
    /// mean value coordinates that vertex alone, without a gradient.
    fn visit<const GRADIENT: bool>(&self, p: [R; 2], mut each: impl FnMut(usize, R, [R; 2])) {
        let outline = &self.outline;
        match self.coordinates {
            Coordinates::MeanValue => {
                let found = mean_value::scan(outline, p);
                if found.at_vertex() {
                    each(found.nearest, R::ONE, [R::ZERO; 2]);
                } else {
                    mean_value::visit::<R, GRADIENT>(outline, p, &found, each);
                }
            }
            Coordinates::Wachspress => {
                wachspress::visit::<R, GRADIENT>(outline, p, wachspress::pivot(outline, p), each);
            }
        }
    }
}

/// The barycentric coordinates of `p` in `polygon`, in the order of its vertices; they sum to 1.
///
/// Exact on edges (two are not zero) and at vertices (one is 1). Mean value coordinates are defined
/// in the whole plane and may be negative outside convex polygons; Wachspress coordinates are meant
/// for points inside.
///
/// # Errors
/// [`Error::Input`] if the polygon has no vertex, if the point is not finite, or as
/// [`Coordinates::check`].
pub fn coordinates(kind: Coordinates, polygon: &Polygon, p: glam::DVec2) -> Result<Vec<f64>> {
    kind.check(polygon)?;
    if polygon.vertex_count() == 0 || !p.is_finite() {
        return Err(Error::input("barycentric coordinates need a polygon and a finite point", "Check the input"));
    }
    let scale = super::Frame::common_scale([polygon]);
    let frame = super::Frame::of(polygon, scale);
    Ok(Step::<f64>::new(kind, polygon, polygon, scale).coordinates_of(frame.local(p)))
}

/// ad - bc.
#[inline(always)]
pub(super) fn determinant<R: Real>(m: [[R; 2]; 2]) -> R {
    m[0][0] * m[1][1] - m[0][1] * m[1][0]
}

/// Sums over the vertices.
#[derive(Clone, Copy)]
struct Terms<R> {
    weight: R,
    /// Sum of the weights times the vertices.
    moment: [R; 2],
    moved: [R; 2],
    weight_gradient: [R; 2],
    moved_gradient: [[R; 2]; 2],
}

impl<R: Real> Terms<R> {
    fn none() -> Self {
        let zero = [R::ZERO; 2];
        Self { weight: R::ZERO, moment: zero, moved: zero, weight_gradient: zero, moved_gradient: [zero; 2] }
    }

    fn join(&mut self, other: &Self) {
        self.weight += other.weight;
        for axis in 0..2 {
            self.moment[axis] += other.moment[axis];
            self.moved[axis] += other.moved[axis];
            self.weight_gradient[axis] += other.weight_gradient[axis];
            for row in 0..2 {
                self.moved_gradient[row][axis] += other.moved_gradient[row][axis];
            }
        }
    }
}

/// Sums over the vertices as they come, [`mean_value::BLOCK`] of them at a time. Displacements are
/// taken relative to that of the vertex with the largest weight, whose own gradient, the only one
/// that grows next to it, then drops out.
struct Sums<'a, R> {
    outline: &'a Outline<R>,
    base: [R; 2],
    all: Terms<R>,
    /// Those of the last vertices, and how many they are.
    block: Terms<R>,
    count: usize,
}

impl<'a, R: Real> Sums<'a, R> {
    fn new(outline: &'a Outline<R>, pivot: usize) -> Self {
        let base = outline.displacements.get(pivot).copied().unwrap_or([R::ZERO; 2]);
        Self { outline, base, all: Terms::none(), block: Terms::none(), count: 0 }
    }

    #[inline(always)]
    fn add(&mut self, i: usize, w: R) {
        if self.count == mean_value::BLOCK {
            self.all.join(&self.block);
            (self.block, self.count) = (Terms::none(), 0);
        }
        self.count += 1;
        let (v, u) = (self.outline.vertices[i], self.outline.displacements[i]);
        self.block.weight += w;
        for axis in 0..2 {
            self.block.moment[axis] += w * v[axis];
            self.block.moved[axis] += w * (u[axis] - self.base[axis]);
        }
    }

    #[inline(always)]
    fn add_gradient(&mut self, i: usize, w: R, gradient: [R; 2]) {
        self.add(i, w);
        let u = self.outline.displacements[i];
        for axis in 0..2 {
            self.block.weight_gradient[axis] += gradient[axis];
            for row in 0..2 {
                self.block.moved_gradient[row][axis] += (u[row] - self.base[row]) * gradient[axis];
            }
        }
    }

    fn all(&self) -> Terms<R> {
        let mut all = self.all;
        all.join(&self.block);
        all
    }

    /// The sum W of the weights. Far away it cancels, to (h / R)^2 of its terms; there it is taken
    /// from W p = sum w_i v_i, the linear precision of the coordinates, whose terms cancel to h / R
    /// only.
    fn total(&self, all: &Terms<R>, p: [R; 2]) -> R {
        let square = dot(p, p);
        if square > self.outline.far { dot(all.moment, p) / square } else { all.weight }
    }

    fn image(&self, p: [R; 2]) -> [R; 2] {
        let all = self.all();
        let total = self.total(&all, p);
        std::array::from_fn(|axis| p[axis] + (self.base[axis] + all.moved[axis] / total))
    }

    fn evaluation(&self, p: [R; 2], branch: Branch) -> Evaluation<R> {
        let all = self.all();
        let inverse = R::ONE / self.total(&all, p);
        let mut derivative = [[R::ONE, R::ZERO], [R::ZERO, R::ONE]];
        for row in 0..2 {
            let mean = all.moved[row] * inverse;
            for axis in 0..2 {
                derivative[row][axis] += (all.moved_gradient[row][axis] - mean * all.weight_gradient[axis]) * inverse;
            }
        }
        Evaluation { point: self.image(p), derivative, jacobian: determinant(derivative), branch }
    }
}
