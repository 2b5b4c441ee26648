//! Few shapes whose weighted sums are all frames of an animation, within a stated distance.
//!
//! The frames' displacements from the rest shape are taken as columns of a matrix, and a basis of
//! its range is built by pivoting: the worst frame's remainder, made orthonormal, becomes the next
//! direction (rank-revealing QR; as a compression of animations by a basis of shapes: Alexa,
//! Müller, Representing Animations by Principal Components, 2000). Unlike principal components it
//! needs no eigenvalue problem of the size of the clip, stops exactly when the largest distance of
//! any vertex is small enough, and is the same for any number of threads.

use glam::{DVec3, Vec3};
use nalgebra::{Cholesky, DMatrix, DVector};
use rayon::prelude::*;

use super::gltf_split::vertex_normals;
use crate::geometry::Mesh;

/// Frames worked on at a time where each needs memory of the size of the mesh.
const CHUNK: usize = 16;

/// Shapes and how much of each is in a frame.
pub(super) struct Components {
    /// Displacements from the rest shape, one entry a vertex.
    pub(super) shapes: Vec<Vec<Vec3>>,
    /// Changes of the normals that go with them.
    pub(super) normals: Vec<Vec<Vec3>>,
    /// For each frame one weight a shape, within -1 and 1.
    pub(super) weights: Vec<Vec<f32>>,
    /// Largest distance of a vertex of any frame from where the weighted sum puts it, with the
    /// rounding of what is written.
    pub(super) error: f64,
}

fn displacement(rest: &[DVec3], frame: &[Vec3]) -> Vec<DVec3> {
    rest.iter().zip(frame).map(|(r, p)| p.as_dvec3() - *r).collect()
}

fn dot(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum()
}

impl Components {
    /// Frames of `mesh` by shapes, with no vertex farther than `tolerance` from its place (unless
    /// all directions are used up), at most `most` shapes.
    ///
    /// O(frames * shapes * vertices); memory of the shapes in double precision.
    pub(super) fn new(mesh: &Mesh, frames: &[Vec<Vec3>], tolerance: f64, most: usize) -> Self {
        let rest = &mesh.positions;
        let mut basis: Vec<Vec<DVec3>> = Vec::new();
        let mut coordinates: Vec<Vec<f64>> = vec![Vec::new(); frames.len()];
        let total: Vec<f64> = frames
            .par_iter()
            .map(|f| {
                let d = displacement(rest, f);
                dot(&d, &d)
            })
            .collect();
        let mut left = total.clone();
        let mut spent = vec![false; frames.len()];
        // The root of the mean squared distance at which the largest one is worth looking at.
        let mut look_at = 0.5 * tolerance;
        while basis.len() < most.min(frames.len()) {
            let Some(mut worst) = largest(&left, &spent) else { break };
            if (left[worst] / rest.len().max(1) as f64).sqrt() <= look_at {
                let errors = errors(rest, frames, &basis, &coordinates);
                let Some(farthest) = largest(&errors, &spent).filter(|&f| errors[f] > tolerance) else { break };
                worst = farthest;
                look_at *= 0.7;
            }
            let mut direction = displacement(rest, &frames[worst]);
            // Twice is enough (Kahan, Parlett): the first pass leaves rounding of the size of the
            // whole displacement.
            for _ in 0..2 {
                for b in &basis {
                    let c = dot(b, &direction);
                    direction.par_iter_mut().zip(b).for_each(|(d, b)| *d -= *b * c);
                }
            }
            let length = dot(&direction, &direction).sqrt();
            if !(length > 1e-9 * total[worst].sqrt()) {
                spent[worst] = true;
                continue;
            }
            direction.iter_mut().for_each(|d| *d /= length);
            let along: Vec<f64> = frames.par_iter().map(|f| dot(&direction, &displacement(rest, f))).collect();
            for ((coordinates, left), c) in coordinates.iter_mut().zip(&mut left).zip(along) {
                *left = (*left - c * c).max(0.0);
                coordinates.push(c);
            }
            basis.push(direction);
        }
        Self::scaled(mesh, frames, basis, &coordinates)
    }

    /// In single precision, with weights within -1 and 1, the true error, and normals.
    fn scaled(mesh: &Mesh, frames: &[Vec<Vec3>], basis: Vec<Vec<DVec3>>, coordinates: &[Vec<f64>]) -> Self {
        let scales: Vec<f64> = (0..basis.len())
            .map(|k| coordinates.iter().map(|c| c[k].abs()).fold(0.0, f64::max))
            .map(|s| if s > 0.0 { s } else { 1.0 })
            .collect();
        let weights: Vec<Vec<f32>> =
            coordinates.iter().map(|c| c.iter().zip(&scales).map(|(c, s)| (c / s) as f32).collect()).collect();
        let shapes: Vec<Vec<Vec3>> =
            basis.into_iter().zip(&scales).map(|(b, s)| b.into_iter().map(|b| (b * *s).as_vec3()).collect()).collect();
        let rounded: Vec<Vec<DVec3>> = shapes.iter().map(|s| s.iter().map(|d| d.as_dvec3()).collect()).collect();
        let exact: Vec<Vec<f64>> = weights.iter().map(|w| w.iter().map(|w| f64::from(*w)).collect()).collect();
        let error = errors(&mesh.positions, frames, &rounded, &exact).into_iter().fold(0.0, f64::max);
        let normals = normals(mesh, frames, &exact);
        Self { shapes, normals, weights, error }
    }
}

/// The frame with the largest value; the first of equal ones.
fn largest(values: &[f64], spent: &[bool]) -> Option<usize> {
    let open = values.iter().enumerate().filter(|(f, v)| !spent[*f] && **v > 0.0);
    open.max_by(|a, b| a.1.total_cmp(b.1).then(b.0.cmp(&a.0))).map(|(f, _)| f)
}

/// The largest distance of a vertex in each frame.
fn errors(rest: &[DVec3], frames: &[Vec<Vec3>], basis: &[Vec<DVec3>], coordinates: &[Vec<f64>]) -> Vec<f64> {
    let worst = |(frame, c): (&Vec<Vec3>, &Vec<f64>)| {
        let mut d = displacement(rest, frame);
        for (b, c) in basis.iter().zip(c) {
            d.iter_mut().zip(b).for_each(|(d, b)| *d -= *b * *c);
        }
        d.iter().map(|d| d.length_squared()).fold(0.0, f64::max).sqrt()
    };
    frames.par_iter().zip(coordinates).map(worst).collect()
}

/// The changes of normals whose weighted sums are nearest to the frames' normals in the sense of
/// least squares.
fn normals(mesh: &Mesh, frames: &[Vec<Vec3>], weights: &[Vec<f64>]) -> Vec<Vec<Vec3>> {
    let (n, k) = (mesh.vertex_count(), weights.first().map_or(0, Vec::len));
    if k == 0 {
        return Vec::new();
    }
    let rest = vertex_normals(mesh, &mesh.positions);
    let mut sums = vec![vec![DVec3::ZERO; n]; k];
    for (frames, weights) in frames.chunks(CHUNK).zip(weights.chunks(CHUNK)) {
        let changes: Vec<Vec<DVec3>> = frames.par_iter().map(|f| normal_change(mesh, &rest, f)).collect();
        sums.par_iter_mut().enumerate().for_each(|(k, sum)| {
            for (change, w) in changes.iter().zip(weights) {
                sum.iter_mut().zip(change).for_each(|(s, c)| *s += *c * w[k]);
            }
        });
    }
    let w = DMatrix::from_fn(weights.len(), k, |f, k| weights[f][k]);
    let mut gram = w.transpose() * w;
    // Shapes that hardly occur have no say about normals.
    let small = 1e-6 * gram.trace() / k as f64 + f64::MIN_POSITIVE;
    for i in 0..k {
        gram[(i, i)] += small;
    }
    let Some(factor) = Cholesky::new(gram) else { return vec![vec![Vec3::ZERO; n]; k] };
    let inverse = factor.inverse();
    (0..k)
        .into_par_iter()
        .map(|i| {
            let row: DVector<f64> = inverse.column(i).into_owned();
            let mut change = vec![DVec3::ZERO; n];
            for (sum, c) in sums.iter().zip(row.iter()) {
                change.iter_mut().zip(sum).for_each(|(d, s)| *d += *s * *c);
            }
            change.iter().map(|d| d.as_vec3()).collect()
        })
        .collect()
}

/// How the normals of a frame differ from those of the rest shape.
pub(super) fn normal_change(mesh: &Mesh, rest: &[DVec3], frame: &[Vec3]) -> Vec<DVec3> {
    let positions: Vec<DVec3> = frame.iter().map(|p| p.as_dvec3()).collect();
    vertex_normals(mesh, &positions).iter().zip(rest).map(|(n, r)| *n - *r).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A strip of triangles along x.
    fn strip(n: u32) -> Mesh {
        let positions = (0..2 * n).map(|k| DVec3::new(f64::from(k / 2), f64::from(k % 2), 0.0)).collect();
        let triangles: Vec<_> =
            (0..n - 1).flat_map(|k| [[2 * k, 2 * k + 2, 2 * k + 1], [2 * k + 1, 2 * k + 2, 2 * k + 3]]).collect();
        Mesh::of_triangles("strip", positions, &triangles)
    }

    #[test]
    fn frames_in_the_span_of_two_shapes_need_two() {
        let mesh = strip(20);
        let frame = |f: u32| {
            let (a, b) = (f64::from(f).sin(), f64::from(f * f % 7));
            let moved = |p: &DVec3| *p + DVec3::new(0.0, a * p.x * p.x * 0.01, b * (p.x * 0.3).sin());
            mesh.positions.iter().map(|p| moved(p).as_vec3()).collect::<Vec<_>>()
        };
        let frames: Vec<_> = (0..30).map(frame).collect();
        let c = Components::new(&mesh, &frames, 1e-4, 99);
        assert_eq!((c.shapes.len(), c.normals.len(), c.weights.len()), (2, 2, 30));
        assert!(c.error < 1e-4 && c.weights.iter().flatten().all(|w| w.abs() <= 1.0), "{}", c.error);
        // The clip that never leaves the rest shape needs none.
        let still: Vec<Vec<Vec3>> = vec![mesh.positions.iter().map(|p| p.as_vec3()).collect(); 5];
        let c = Components::new(&mesh, &still, 1e-4, 99);
        assert_eq!((c.shapes.len(), c.error), (0, 0.0));
    }

    #[test]
    fn the_error_is_that_of_the_worst_vertex() {
        let mesh = strip(12);
        // One vertex jumps in one frame: a mean over vertices and frames would hardly see it.
        let mut frames: Vec<Vec<Vec3>> = (0..40)
            .map(|f| mesh.positions.iter().map(|p| (*p * (1.0 + 0.01 * f64::from(f))).as_vec3()).collect())
            .collect();
        frames[17][5] += Vec3::Z * 0.3;
        let c = Components::new(&mesh, &frames, 0.01, 99);
        assert!(c.error <= 0.01 && c.shapes.len() >= 2, "{} of {}", c.error, c.shapes.len());
        let one = Components::new(&mesh, &frames, 0.01, 1);
        assert!(one.shapes.len() == 1 && one.error > 0.25, "{}", one.error);
    }
}
