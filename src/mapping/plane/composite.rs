//! Composite maps: a sequence of polygons, and the points of the plane carried from each to the
//! next.

use glam::{DMat2, DVec2};

use super::Frame;
use super::step::{Coordinates, Step};
use crate::error::{Error, Result};
use crate::geometry::Polygon;

/// A point and its image under a composite map, whichever of them was asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mapped {
    /// The point sought: the image of a forward query, the pre-image of an inverse one.
    pub point: DVec2,
    /// Derivative of the *forward* map at the point of the source: column j is the derivative by
    /// coordinate j. Its determinant is the Jacobian J. One-sided at vertices of the polygons.
    pub derivative: DMat2,
}

impl Mapped {
    /// The Jacobian J of the forward map: the factor by which it scales areas, negative where it
    /// folds.
    pub fn jacobian(&self) -> f64 {
        self.derivative.determinant()
    }
}

/// f = f_{m-1} ∘ … ∘ f_0, where f_k maps polygon k to polygon k + 1 by barycentric coordinates
/// (Schneider, Hormann, Floater 2013, Definition 3).
///
/// Points are in the units and axes of the polygons. Steps are held in double and in single
/// precision, about the centre of their own polygons ([`Frame`]).
#[derive(Clone, Debug)]
pub struct CompositeMap {
    coordinates: Coordinates,
    polygons: Vec<Polygon>,
    scale: f64,
    steps: Vec<Step<f64>>,
    single: Vec<Step<f32>>,
    /// Step `k` from polygon `k + 1` back to polygon `k`.
    reversed: Vec<Step<f64>>,
    /// The composite through the reversed polygons in single precision, in the order of its steps.
    backward: Vec<Step<f32>>,
}

impl CompositeMap {
    /// The map through `polygons`, which have the same loops and are simple: a [`super::Partition`]
    /// has tested them.
    ///
    /// # Errors
    /// [`Error::Input`] if there are fewer than two polygons or their loops differ in number or
    /// length.
    pub fn new(coordinates: Coordinates, polygons: Vec<Polygon>) -> Result<Self> {
        if polygons.len() < 2 {
            return Err(Error::input(
                format!("a composite map through {} polygons", polygons.len()),
                "Give the source and the target at least",
            ));
        }
        let shape = |p: &Polygon| p.loops().iter().map(Vec::len).collect::<Vec<_>>();
        if let Some(k) = polygons.iter().position(|p| shape(p) != shape(&polygons[0])) {
            return Err(Error::input(
                format!("polygon {k} of a composite map has other loops than polygon 0"),
                "Give every polygon the same number of loops and vertices",
            ));
        }
        let scale = Frame::common_scale(&polygons);
        let pairs = polygons.windows(2);
        let steps = pairs.clone().map(|p| Step::new(coordinates, &p[0], &p[1], scale)).collect();
        let reversed = pairs.clone().map(|p| Step::new(coordinates, &p[1], &p[0], scale)).collect();
        let backward = pairs.clone().rev().map(|p| Step::new(coordinates, &p[1], &p[0], scale)).collect();
        let single = pairs.map(|p| Step::new(coordinates, &p[0], &p[1], scale)).collect();
        Ok(Self { coordinates, polygons, scale, steps, single, reversed, backward })
    }

    /// The polygon that points come from.
    pub fn source(&self) -> &Polygon {
        &self.polygons[0]
    }

    /// The polygon that points go to.
    pub fn target(&self) -> &Polygon {
        &self.polygons[self.polygons.len() - 1]
    }

    /// All polygons, from the source to the target.
    pub fn polygons(&self) -> &[Polygon] {
        &self.polygons
    }

    /// Number of steps.
    pub fn step_count(&self) -> usize {
        self.steps.len()
    }

    /// The coordinates used.
    pub fn coordinates(&self) -> Coordinates {
        self.coordinates
    }

    /// The frame of polygon `k`, in which step `k` takes its points and step `k - 1` leaves them.
    pub fn frame(&self, k: usize) -> Frame {
        Frame::of(&self.polygons[k], self.scale)
    }

    /// The steps in double precision.
    pub fn steps(&self) -> &[Step<f64>] {
        &self.steps
    }

    /// The steps through the same pairs of polygons in reverse; element `k` approximates the
    /// inverse of step `k`.
    pub(super) fn reversed_steps(&self) -> &[Step<f64>] {
        &self.reversed
    }

    /// The steps of [`CompositeMap::backward`] in single precision.
    pub(super) fn backward_steps(&self) -> &[Step<f32>] {
        &self.backward
    }

    /// The steps in single precision.
    pub fn single_steps(&self) -> &[Step<f32>] {
        &self.single
    }

    /// The composite through the same polygons in reverse: an approximation of the inverse whose
    /// error falls like 1/m with the number of steps m (section 4.4 and Figure 12 of the paper).
    /// [`CompositeMap::inverse`] is the exact one.
    pub fn backward(&self) -> Self {
        let polygons = self.polygons.iter().rev().cloned().collect();
        // The reversed polygons have passed the tests of `new`.
        Self::new(self.coordinates, polygons).unwrap_or_else(|_| self.clone())
    }

    /// The image of `p` and the derivative there, in double precision. O(m n) for m steps and n
    /// vertices.
    pub fn forward(&self, p: DVec2) -> Mapped {
        let mut at: [f64; 2] = self.frame(0).local(p);
        let mut derivative = DMat2::IDENTITY;
        for step in &self.steps {
            let e = step.evaluate(at);
            derivative = matrix(e.derivative) * derivative;
            at = e.point;
        }
        Mapped { point: self.frame(self.steps.len()).world(at), derivative }
    }
}

/// Rows as [`Step::evaluate`] gives them.
pub(super) fn matrix(rows: [[f64; 2]; 2]) -> DMat2 {
    DMat2::from_cols_array_2d(&[[rows[0][0], rows[1][0]], [rows[0][1], rows[1][1]]])
}
