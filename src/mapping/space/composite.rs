//! Composite maps in space: a sequence of polyhedra, and points carried from each to the next.

use glam::{DMat3, DVec3};

use super::{Frame, Step, map_points_3d};
use crate::engine::{Backend, Engine, Lanes};
use crate::error::{Error, Result};

/// Steps whose faces are held at once.
const TOGETHER: usize = 32;

/// A point and its image under a composite map, whichever of them was asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mapped {
    /// The point sought: the image of a forward query, the pre-image of an inverse one.
    pub point: DVec3,
    /// Derivative of the *forward* map at the point of the source; one-sided on edges.
    pub derivative: DMat3,
}

impl Mapped {
    /// The Jacobian of the forward map: the factor by which it scales volumes, negative where it
    /// folds.
    pub fn jacobian(&self) -> f64 {
        self.derivative.determinant()
    }
}

/// f = f_{m-1} ∘ … ∘ f_0, where f_k maps polyhedron k to polyhedron k + 1 by mean value coordinates
/// (section 4.5).
#[derive(Clone, Debug)]
pub struct CompositeMap {
    triangles: Vec<[u32; 3]>,
    polyhedra: Vec<Vec<DVec3>>,
    scale: f64,
}

impl CompositeMap {
    /// The map through `polyhedra`, positions of the vertices of `triangles`, which run
    /// anticlockwise seen from outside.
    ///
    /// # Errors
    /// [`Error::Input`] if there are fewer than two polyhedra, or a vertex is missing or not
    /// finite.
    pub fn new(triangles: Vec<[u32; 3]>, polyhedra: Vec<Vec<DVec3>>) -> Result<Self> {
        let wrong = |what: String| Err(Error::input(what, "Make the polyhedra by a partition of a cage"));
        if polyhedra.len() < 2 {
            return wrong(format!("a composite map through {} polyhedra", polyhedra.len()));
        }
        let most = triangles.iter().flatten().max().map_or(0, |&v| v as usize + 1);
        let count = polyhedra[0].len();
        if let Some(k) = polyhedra.iter().position(|p| p.len() != count || p.len() < most) {
            return wrong(format!("polyhedron {k} of a composite map has {} vertices", polyhedra[k].len()));
        }
        if let Some(k) = polyhedra.iter().position(|p| p.iter().any(|v| !v.is_finite())) {
            return wrong(format!("polyhedron {k} of a composite map has a vertex that is not finite"));
        }
        let scale = Frame::common_scale(polyhedra.iter().map(Vec::as_slice));
        Ok(Self { triangles, polyhedra, scale })
    }

    /// All polyhedra, from the source to the target.
    pub fn polyhedra(&self) -> &[Vec<DVec3>] {
        &self.polyhedra
    }

    /// Number of steps.
    pub fn step_count(&self) -> usize {
        self.polyhedra.len() - 1
    }

    /// The frame of polyhedron `k`, in which step `k` takes its points and step `k - 1` leaves
    /// them.
    pub fn frame(&self, k: usize) -> Frame {
        Frame::of(&self.polyhedra[k], self.scale)
    }

    /// Step `k`. O(faces).
    pub fn step(&self, k: usize) -> Step<f64> {
        Step::new(&self.triangles, &self.polyhedra[k], &self.polyhedra[k + 1], self.scale)
    }

    /// The step from polyhedron `k + 1` back to `k`: close to the inverse of step `k`.
    pub(super) fn step_back(&self, k: usize) -> Step<f64> {
        Step::new(&self.triangles, &self.polyhedra[k + 1], &self.polyhedra[k], self.scale)
    }

    /// The composite through the same polyhedra in reverse: an approximation of the inverse whose
    /// error falls like 1/m with the number of steps m. [`CompositeMap::inverse`] is the exact one.
    pub fn backward(&self) -> Self {
        Self { polyhedra: self.polyhedra.iter().rev().cloned().collect(), ..self.clone() }
    }

    /// The images of `points`: in single precision, on the device of `engine` if it has one, or in
    /// double precision by the back end `reference`.
    ///
    /// # Errors
    /// As [`map_points_3d`].
    pub fn forward_points(&self, engine: &Engine, points: &[DVec3]) -> Result<Vec<DVec3>> {
        let (first, last) = (self.frame(0), self.frame(self.step_count()));
        if engine.backend() == Backend::Reference {
            let mut at: Vec<[f64; 3]> = points.iter().map(|&p| first.local(p)).collect();
            (0..self.step_count()).for_each(|k| self.step(k).map_all(Lanes::detect(), &mut at));
            return Ok(at.into_iter().map(|p| last.world(p)).collect());
        }
        let mut at: Vec<[f32; 3]> = points.iter().map(|&p| first.local(p)).collect();
        let all: Vec<usize> = (0..self.step_count()).collect();
        for some in all.chunks(TOGETHER) {
            let steps: Vec<Step<f64>> = some.iter().map(|&k| self.step(k)).collect();
            map_points_3d(engine, &steps, &mut at)?;
        }
        Ok(at.into_iter().map(|p| last.world(p)).collect())
    }

    /// Images and derivatives of `points` in double precision.
    pub fn forward(&self, points: &[DVec3]) -> Vec<Mapped> {
        let (first, last) = (self.frame(0), self.frame(self.step_count()));
        let mut at: Vec<[f64; 3]> = points.iter().map(|&p| first.local(p)).collect();
        let mut derivatives = vec![DMat3::IDENTITY; points.len()];
        for k in 0..self.step_count() {
            let found = self.step(k).evaluate_all(Lanes::detect(), &at);
            for ((p, d), e) in at.iter_mut().zip(&mut derivatives).zip(found) {
                (*p, *d) = (e.point, matrix(e.derivative) * *d);
            }
        }
        at.into_iter().zip(derivatives).map(|(p, derivative)| Mapped { point: last.world(p), derivative }).collect()
    }

    /// Whether each of `points` lies in polyhedron `k`, faces included.
    pub fn inside(&self, k: usize, points: &[DVec3]) -> Vec<bool> {
        let frame = self.frame(k);
        let step = Step::new(&self.triangles, &self.polyhedra[k], &self.polyhedra[k], self.scale);
        let at: Vec<[f64; 3]> = points.iter().map(|&p| frame.local(p)).collect();
        step.inside_all(Lanes::detect(), &at)
    }
}

/// Rows as [`Step::evaluate`] gives them.
pub(super) fn matrix(rows: [[f64; 3]; 3]) -> DMat3 {
    DMat3::from_cols_array_2d(&rows).transpose()
}
