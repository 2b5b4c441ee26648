//! One step of a composite map in space: from one polyhedron to the next.

use glam::DVec3;
use rayon::prelude::*;

use super::Frame;
use super::face::Face;
use super::mean_value::{AT_VERTEX, Closest, Sums, add_face, closest, corner_weights, nearest_vertex};
use crate::engine::{Lane, LaneScalar, Lanes, Real, Sweep, TILE};
use crate::error::{Error, Result};

/// Points of one task.
const CHUNK: usize = 512;

/// Faces whose terms are added up by themselves before they are added to the rest: every term costs
/// single precision a rounding of what the sum has grown to so far.
const BLOCK: usize = 32;

/// On edges derivatives depend on the direction. Within so many roundings of one the derivative
/// given is that a little farther inside: by the square root of a rounding, in local units.
const ON_EDGE: f64 = 16.0;

/// The map of a step at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evaluation<R> {
    /// The image.
    pub point: [R; 3],
    /// Derivative, row by row: row r, column c is that of coordinate r by coordinate c.
    pub derivative: [[R; 3]; 3],
    /// Its determinant.
    pub jacobian: R,
    /// Whether `p` lies in the polyhedron, faces included: the sum of the weights is positive there
    /// and negative outside.
    pub inside: bool,
}

/// The mean value map from one polyhedron to another with the same faces.
///
/// Points are local coordinates in the [`Frame`] of the first, images in that of the second.
#[derive(Clone, Debug)]
pub struct Step<R> {
    pub(super) faces: Vec<Face<R>>,
    pub(super) vertices: Vec<[R; 3]>,
    pub(super) displacements: Vec<[R; 3]>,
    triangles: Vec<[u32; 3]>,
}

impl Step<f64> {
    /// The step from `from` to `to`, whose frames have the scale `scale`; `triangles` are oriented
    /// outwards. Faces without an area do not count.
    pub fn new(triangles: &[[u32; 3]], from: &[DVec3], to: &[DVec3], scale: f64) -> Self {
        let (here, there) = (Frame::of(from, scale), Frame::of(to, scale));
        let local: Vec<DVec3> = from.iter().map(|&p| DVec3::from(here.local::<f64>(p))).collect();
        let moved: Vec<DVec3> = to.iter().zip(&local).map(|(&p, &q)| DVec3::from(there.local::<f64>(p)) - q).collect();
        let mut faces = Vec::with_capacity(triangles.len());
        let mut used = Vec::with_capacity(triangles.len());
        for triangle in triangles {
            let corner = triangle.map(|v| v as usize);
            let Some(face) = Face::new(corner.map(|v| local[v]), corner.map(|v| moved[v])) else { continue };
            faces.push(face);
            used.push(*triangle);
        }
        Self {
            faces,
            vertices: local.iter().map(|p| p.to_array()).collect(),
            displacements: moved.iter().map(|p| p.to_array()).collect(),
            triangles: used,
        }
    }

    /// The same step in another precision.
    pub fn cast<T: Real>(&self) -> Step<T> {
        let all = |list: &[[f64; 3]]| list.iter().map(|v| v.map(T::of)).collect();
        Step {
            faces: self.faces.iter().map(Face::cast).collect(),
            vertices: all(&self.vertices),
            displacements: all(&self.displacements),
            triangles: self.triangles.clone(),
        }
    }

    /// The mean value coordinates of `x`, vertex by vertex; they sum to 1.
    pub(super) fn coordinates_of(&self, x: [f64; 3]) -> Vec<f64> {
        let mut all = vec![0.0; self.vertices.len()];
        let far = |v: &[f64; 3]| (0..3).map(|k| (v[k] - x[k]).powi(2)).sum::<f64>();
        if let Some(v) = self.vertices.iter().position(|v| far(v) < AT_VERTEX * AT_VERTEX) {
            all[v] = 1.0;
            return all;
        }
        for (face, triangle) in self.faces.iter().zip(&self.triangles) {
            for (v, w) in triangle.iter().zip(corner_weights(face, x)) {
                all[*v as usize] += w;
            }
        }
        let total: f64 = all.iter().sum();
        all.iter_mut().for_each(|w| *w /= total);
        all
    }
}

/// Image and derivative in lanes.
struct Image<L> {
    moved: [L; 3],
    /// Derivative minus identity.
    change: [[L; 3]; 3],
    /// Squared distance to the nearest place of all edges.
    edge: L,
    /// Sum of the weights.
    weight: L,
}

#[inline(always)]
fn image<L: Lane, const GRADIENT: bool>(cpu: L::Cpu, step: &Step<L::E>, x: [L; 3]) -> Image<L> {
    let near: Closest<L> = if GRADIENT {
        closest(cpu, &step.faces, &step.vertices, &step.displacements, x)
    } else {
        nearest_vertex(cpu, &step.vertices, &step.displacements, x)
    };
    let mut all = Sums::none(cpu);
    for block in step.faces.chunks(BLOCK) {
        let mut sums = Sums::none(cpu);
        for face in block {
            add_face::<L, GRADIENT>(cpu, face, x, near.base, &mut sums);
        }
        all.join(&sums);
    }
    let inverse = L::num(cpu, 1.0) / all.weight;
    let mean = all.moved.map(|m| m * inverse);
    let mut moved = mean;
    let mut change = all.moved_gradient;
    // At a vertex its image.
    let at = near.vertex.lt(L::num(cpu, AT_VERTEX * AT_VERTEX));
    for row in 0..3 {
        moved[row] = L::select(at, near.corner[row], near.base[row] + mean[row]);
        if GRADIENT {
            for axis in 0..3 {
                change[row][axis] = (change[row][axis] - mean[row] * all.weight_gradient[axis]) * inverse;
            }
        }
    }
    Image { moved, change, edge: near.edge, weight: all.weight }
}

/// Determinant of rows.
#[inline(always)]
pub(super) fn determinant<T>(m: [[T; 3]; 3]) -> T
where
    T: Copy + std::ops::Mul<Output = T> + std::ops::Sub<Output = T> + std::ops::Add<Output = T>,
{
    let minor = |a: usize, b: usize| m[1][a] * m[2][b] - m[1][b] * m[2][a];
    m[0][0] * minor(1, 2) - m[0][1] * minor(0, 2) + m[0][2] * minor(0, 1)
}

impl<R: LaneScalar + Lane<Cpu = (), E = R>> Step<R> {
    /// The image of `p`, one number at a time.
    pub fn map(&self, p: [R; 3]) -> [R; 3] {
        let image = image::<R, false>((), self, p);
        std::array::from_fn(|k| p[k] + image.moved[k])
    }

    /// Image, derivative and Jacobian at `p`. On an edge or at a vertex, where the derivative
    /// depends on the direction, it is that a hair's breadth inside along the mean of the normals.
    pub fn evaluate(&self, p: [R; 3]) -> Evaluation<R> {
        let mut found = image::<R, true>((), self, p);
        if found.edge < on_edge::<R>() {
            let mut aside = DVec3::ZERO;
            let tolerance = R::EPSILON.to_f64().sqrt();
            for face in self.faces.iter().filter(|face| touches(face, p, tolerance)) {
                aside -= DVec3::from(face.normal.map(|x| Real::to_f64(x)));
            }
            let off = (aside.normalize_or_zero() * tolerance).to_array();
            found.change = image::<R, true>((), self, std::array::from_fn(|k| p[k] + R::of(off[k]))).change;
        }
        evaluation(p, &found)
    }
}

/// Squared distance to an edge under which a point is on it.
fn on_edge<R: Real>() -> R {
    R::of((ON_EDGE * R::EPSILON.to_f64()).powi(2))
}

/// Whether a point is that close to a face.
fn touches<R: Real>(face: &Face<R>, p: [R; 3], tolerance: f64) -> bool {
    let wide = |v: [R; 3]| DVec3::from(v.map(|x| Real::to_f64(x)));
    let to = |k: usize| wide(face.corners[k]) - wide(p);
    let beside = |j: usize| wide(face.inward[j]).dot(to((j + 1) % 3)) > tolerance;
    wide(face.normal).dot(to(0)).abs() < tolerance && !(0..3).any(beside)
}

fn evaluation<R: LaneScalar>(p: [R; 3], found: &Image<R>) -> Evaluation<R> {
    let mut derivative = found.change;
    (0..3).for_each(|k| derivative[k][k] += R::ONE);
    Evaluation {
        point: std::array::from_fn(|k| p[k] + found.moved[k]),
        derivative,
        jacobian: determinant(derivative),
        inside: found.weight > R::ZERO,
    }
}

/// Points through one step on the calling thread's lanes; padded to whole tiles.
struct Work<'a, E, const GRADIENT: bool> {
    step: &'a Step<E>,
    /// Component by component, in and out.
    points: &'a mut [Vec<E>; 3],
    derivatives: &'a mut [Vec<E>; 9],
    /// Sums of the weights; empty where they are not wanted.
    weights: &'a mut [E],
    /// Whether a point is on an edge, where the lanes have no derivative.
    edge: &'a mut [bool],
}

impl<E: LaneScalar, const GRADIENT: bool> Sweep<E> for Work<'_, E, GRADIENT> {
    #[inline(always)]
    fn run<L: Lane<E = E>>(self, cpu: L::Cpu) {
        for at in (0..self.points[0].len()).step_by(L::N) {
            let x = [
                L::load(cpu, &self.points[0][at..]),
                L::load(cpu, &self.points[1][at..]),
                L::load(cpu, &self.points[2][at..]),
            ];
            let found = image::<L, GRADIENT>(cpu, self.step, x);
            if GRADIENT {
                if L::any(cpu, found.edge.lt(L::splat(cpu, on_edge::<E>()))) {
                    self.edge[at..at + L::N].fill(true);
                }
                for k in 0..9 {
                    let mut d = found.change[k / 3][k % 3];
                    if k % 4 == 0 {
                        d = d + L::num(cpu, 1.0);
                    }
                    d.store(&mut self.derivatives[k][at..]);
                }
            }
            if !self.weights.is_empty() {
                found.weight.store(&mut self.weights[at..]);
            }
            for k in 0..3 {
                (x[k] + found.moved[k]).store(&mut self.points[k][at..]);
            }
        }
    }
}

impl<E: LaneScalar + Lane<Cpu = (), E = E>> Step<E> {
    /// Moves `points` on lanes, in parallel; the same result for any number of threads.
    pub fn map_all(&self, lanes: Lanes, points: &mut [[E; 3]]) {
        points.par_chunks_mut(CHUNK).for_each(|points| {
            let mut columns = columns(points);
            lanes.run(Work::<E, false> {
                step: self,
                points: &mut columns,
                derivatives: &mut Default::default(),
                weights: &mut [],
                edge: &mut [],
            });
            for (i, p) in points.iter_mut().enumerate() {
                *p = [columns[0][i], columns[1][i], columns[2][i]];
            }
        });
    }

    /// Whether each of `points` lies in the polyhedron the step starts from, faces included: the
    /// sum of the weights is positive there and negative outside.
    pub fn inside_all(&self, lanes: Lanes, points: &[[E; 3]]) -> Vec<bool> {
        let inside = |points: &[[E; 3]]| {
            let mut columns = columns(points);
            let mut weights = vec![E::ZERO; columns[0].len()];
            lanes.run(Work::<E, false> {
                step: self,
                points: &mut columns,
                derivatives: &mut Default::default(),
                weights: &mut weights,
                edge: &mut [],
            });
            weights.truncate(points.len());
            weights.into_iter().map(|w| w > E::ZERO).collect::<Vec<_>>()
        };
        points.par_chunks(CHUNK).flat_map_iter(inside).collect()
    }

    /// As [`Step::evaluate`] for many points, on lanes, in parallel.
    pub fn evaluate_all(&self, lanes: Lanes, points: &[[E; 3]]) -> Vec<Evaluation<E>> {
        points
            .par_chunks(CHUNK)
            .flat_map_iter(|points| {
                let mut moved = columns(points);
                let count = moved[0].len();
                let mut derivatives: [Vec<E>; 9] = std::array::from_fn(|_| vec![E::ZERO; count]);
                let mut weights = vec![E::ZERO; count];
                let mut edge = vec![false; count];
                lanes.run(Work::<E, true> {
                    step: self,
                    points: &mut moved,
                    derivatives: &mut derivatives,
                    weights: &mut weights,
                    edge: &mut edge,
                });
                let one = |(i, p): (usize, &[E; 3])| {
                    if edge[i] {
                        return self.evaluate(*p);
                    }
                    let derivative = std::array::from_fn(|r| std::array::from_fn(|c| derivatives[3 * r + c][i]));
                    let point = [moved[0][i], moved[1][i], moved[2][i]];
                    let inside = weights[i] > E::ZERO;
                    Evaluation { point, derivative, jacobian: determinant(derivative), inside }
                };
                points.iter().enumerate().map(one).collect::<Vec<_>>()
            })
            .collect()
    }
}

/// Component by component, padded to whole tiles by the last point.
fn columns<E: Real>(points: &[[E; 3]]) -> [Vec<E>; 3] {
    let whole = points.len().next_multiple_of(TILE);
    std::array::from_fn(|k| (0..whole).map(|i| points[i.min(points.len() - 1)][k]).collect())
}

/// The mean value coordinates of `p` in a closed polyhedron, in the order of its vertices; they sum
/// to 1. O(faces).
///
/// Exact on faces (three are not zero), edges (two) and at vertices (one). Defined in all of space;
/// some may be negative inside polyhedra that are not convex, and outside.
///
/// # Errors
/// [`Error::Input`] if no triangle has an area, or the point is not finite.
pub fn coordinates(triangles: &[[u32; 3]], vertices: &[DVec3], p: DVec3) -> Result<Vec<f64>> {
    let scale = Frame::common_scale([vertices]);
    let step = Step::new(triangles, vertices, vertices, scale);
    if step.faces.is_empty() || !p.is_finite() {
        return Err(Error::input("barycentric coordinates need a polyhedron and a finite point", "Check the input"));
    }
    Ok(step.coordinates_of(Frame::of(vertices, scale).local(p)))
}
