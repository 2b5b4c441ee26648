//! Images and pre-images of many points: single precision on the back end, finished in double
//! precision.

use glam::{DMat2, DVec2};
use rayon::prelude::*;

use super::composite::{CompositeMap, Mapped, matrix};
use super::map_points::{map_points, map_points_in_parts, map_points_on_cpu, map_points_with_derivatives};
use crate::engine::{Backend, Engine, Lanes};
use crate::error::{Error, Result};
use crate::geometry::Polygon;

/// A 2 x 2 matrix, row by row.
type Rows<R> = [[R; 2]; 2];

/// Iterations of Newton's method in single precision before a point is left to the damped one.
const ITERATIONS: usize = 6;

/// A correction below this (in local coordinates, where the largest polygon has the size 1) leaves
/// the rest to the step in double precision: convergence is quadratic, so what is left is far below
/// a rounding of single precision squared.
const SETTLED: f64 = 2.5e-4;

/// Error of a pre-image times the derivative there, as a fraction of the size of the largest
/// polygon: 0.001 pixels of a picture of 2,048.
const TOLERANCE: f64 = 4.8e-7;

/// What the estimate of the error is multiplied by: two because the kept derivative is that of the
/// point before the last correction, the rest because it may change faster where that step crosses
/// the surroundings of a vertex.
const SAFETY: f64 = 16.0;

impl CompositeMap {
    /// The images of many points, with derivatives: [`CompositeMap::forward`] on the back end of
    /// `engine`, in single precision unless it is the reference. In the order of the points.
    ///
    /// # Errors
    /// [`Error::Device`] if the device fails.
    pub fn forward_points(&self, engine: &Engine, points: &[DVec2]) -> Result<Vec<Mapped>> {
        let (first, last) = (self.frame(0), self.frame(self.step_count()));
        if engine.backend() == Backend::Reference {
            return Ok(self.forward_in_double(points));
        }
        let mut at: Vec<[f32; 2]> = points.iter().map(|p| first.local(*p)).collect();
        let mut derivatives = vec![[[0.0; 2]; 2]; at.len()];
        map_points_with_derivatives(engine, self.single_steps(), &mut at, &mut derivatives)?;
        let mapped = |(q, d): ([f32; 2], Rows<f32>)| Mapped { point: last.world(q), derivative: wide(d) };
        Ok(at.into_iter().zip(derivatives).map(mapped).collect())
    }

    /// The images of many points, with derivatives, in double precision on the CPU.
    pub(crate) fn forward_in_double(&self, points: &[DVec2]) -> Vec<Mapped> {
        let (first, last) = (self.frame(0), self.frame(self.step_count()));
        let mut at: Vec<[f64; 2]> = points.iter().map(|p| first.local(*p)).collect();
        let mut derivatives = vec![[[1.0, 0.0], [0.0, 1.0]]; at.len()];
        map_points_on_cpu(Lanes::detect(), self.steps(), &mut at, Some(&mut derivatives));
        let mapped = |(q, d)| Mapped { point: last.world(q), derivative: matrix(d) };
        at.into_iter().zip(derivatives).map(mapped).collect()
    }

    /// The images of many points, with derivatives, in single precision on the CPU but for the
    /// points themselves, which are kept in double precision from step to step: half the cost of
    /// [`CompositeMap::forward_in_double`], and no error of note where steps are short beside the
    /// polygons. Nothing bounds it: compare.
    pub(crate) fn forward_in_parts(&self, points: &[DVec2]) -> Vec<Mapped> {
        let (first, last) = (self.frame(0), self.frame(self.step_count()));
        let parts = |p: &DVec2| {
            let at: [f64; 2] = first.local(*p);
            [at.map(|x| x as f32), at.map(|x| (x - f64::from(x as f32)) as f32)]
        };
        let mut at: Vec<[[f32; 2]; 2]> = points.iter().map(parts).collect();
        let mut derivatives = vec![[[1.0, 0.0], [0.0, 1.0]]; at.len()];
        map_points_in_parts(Lanes::detect(), self.single_steps(), &mut at, &mut derivatives);
        let mapped = |([p, tail], d): ([[f32; 2]; 2], Rows<f32>)| {
            let at: [f64; 2] = std::array::from_fn(|k| f64::from(p[k]) + f64::from(tail[k]));
            Mapped { point: last.world(at), derivative: wide(d) }
        };
        at.into_iter().zip(derivatives).map(mapped).collect()
    }

    /// Most error of an exact pre-image times the derivative there, in the units of the polygons:
    /// 4.8e-7 of the size of the largest.
    pub(crate) fn tolerance(&self) -> f64 {
        TOLERANCE * self.polygons().iter().map(Polygon::size).fold(0.0, f64::max)
    }

    /// The images of many points without derivatives: [`CompositeMap::forward_points`] at half the
    /// cost.
    ///
    /// # Errors
    /// [`Error::Device`] if the device fails.
    pub fn images_of_points(&self, engine: &Engine, points: &[DVec2]) -> Result<Vec<DVec2>> {
        let (first, last) = (self.frame(0), self.frame(self.step_count()));
        if engine.backend() == Backend::Reference {
            let mut at: Vec<[f64; 2]> = points.iter().map(|p| first.local(*p)).collect();
            map_points_on_cpu(Lanes::detect(), self.steps(), &mut at, None);
            return Ok(at.into_iter().map(|p| last.world(p)).collect());
        }
        let mut at: Vec<[f32; 2]> = points.iter().map(|p| first.local(*p)).collect();
        map_points(engine, self.single_steps(), &mut at)?;
        Ok(at.into_iter().map(|p| last.world(p)).collect())
    }

    /// The images of many points by the composite through the reversed polygons: an approximation
    /// of the inverse, and the start of the exact one where nothing better is known. Single
    /// precision.
    ///
    /// # Errors
    /// [`Error::Device`] if the device fails.
    pub fn backward_points(&self, engine: &Engine, points: &[DVec2]) -> Result<Vec<DVec2>> {
        let (first, last) = (self.frame(0), self.frame(self.step_count()));
        let mut at: Vec<[f32; 2]> = points.iter().map(|p| last.local(*p)).collect();
        map_points(engine, self.backward_steps(), &mut at)?;
        Ok(at.into_iter().map(|p| first.world(p)).collect())
    }

    /// The pre-images of many points, `None` where there is none: [`CompositeMap::inverse`] for
    /// pictures.
    ///
    /// Newton's method on the whole composite with the analytic derivative, in single precision on
    /// the back end, from `guess` or else from [`CompositeMap::backward_points`]; then a step in
    /// double precision, whose size says how far off the result can be. The few points whose error
    /// may exceed 4.8e-7 of the size of the polygons (0.001 pixels of a picture of 2,048) are done
    /// by [`CompositeMap::refine`]. Derivatives have the accuracy of single precision, except with
    /// the reference.
    ///
    /// # Errors
    /// [`Error::Input`] if there are not as many guesses as points; [`Error::Device`] if the device
    /// fails.
    pub fn inverse_points(
        &self,
        engine: &Engine,
        points: &[DVec2],
        guess: Option<&[DVec2]>,
    ) -> Result<Vec<Option<Mapped>>> {
        Ok(self.inverse_points_counted(engine, points, guess)?.0)
    }

    /// As [`CompositeMap::inverse_points`]; and how many of the points the step in double precision
    /// did not finish, which [`CompositeMap::refine`] did.
    ///
    /// # Errors
    /// As there.
    pub(crate) fn inverse_points_counted(
        &self,
        engine: &Engine,
        points: &[DVec2],
        guess: Option<&[DVec2]>,
    ) -> Result<(Vec<Option<Mapped>>, u64)> {
        if guess.is_some_and(|g| g.len() != points.len()) {
            return Err(Error::input("there is not one guess for every point", "Give as many guesses as points"));
        }
        if engine.backend() == Backend::Reference {
            let one = |i: usize| guess.map_or_else(|| self.inverse(points[i]), |g| self.refine(points[i], g[i]));
            return Ok(((0..points.len()).into_par_iter().map(one).collect(), points.len() as u64));
        }
        let from_back;
        let guess = match guess {
            Some(guess) => guess,
            None => {
                from_back = self.backward_points(engine, points)?;
                &from_back
            }
        };
        let (first, last) = (self.frame(0), self.frame(self.step_count()));
        let mut found: Vec<Newton> = guess
            .iter()
            .map(|p| Newton { at: first.local::<f64>(*p), derivative: DMat2::ZERO, correction: f64::INFINITY })
            .collect();
        let mut active: Vec<usize> =
            (0..points.len()).filter(|&i| points[i].is_finite() && guess[i].is_finite()).collect();
        for _ in 0..ITERATIONS {
            if active.is_empty() {
                break;
            }
            let mut at: Vec<[f32; 2]> = active.iter().map(|&i| found[i].at.map(|x| x as f32)).collect();
            let starts = at.clone();
            let mut derivatives = vec![[[0.0; 2]; 2]; at.len()];
            map_points_with_derivatives(engine, self.single_steps(), &mut at, &mut derivatives)?;
            for (k, &i) in active.iter().enumerate() {
                let start = DVec2::from(starts[k].map(f64::from));
                let off = DVec2::from(at[k].map(f64::from)) - DVec2::from(last.local::<f64>(points[i]));
                found[i].step(start, off, wide(derivatives[k]));
            }
            active.retain(|&i| found[i].correction > SETTLED && found[i].correction.is_finite());
        }
        Ok(self.finish(points, &found))
    }

    /// The step in double precision, and the points that need more.
    fn finish(&self, points: &[DVec2], found: &[Newton]) -> (Vec<Option<Mapped>>, u64) {
        let (first, last) = (self.frame(0), self.frame(self.step_count()));
        let mut at: Vec<[f64; 2]> =
            found.iter().map(|n| if n.correction <= SETTLED { n.at } else { [0.0; 2] }).collect();
        map_points_on_cpu(Lanes::detect(), self.steps(), &mut at, None);
        let one = |i: usize| {
            let (q, mut n) = (points[i], found[i]);
            if n.correction <= SETTLED {
                let off = DVec2::from(at[i]) - DVec2::from(last.local::<f64>(q));
                let before = n.correction;
                n.step(DVec2::from(n.at), off, n.derivative);
                // With the derivative kept, errors fall by the ratio of successive corrections.
                let left = n.correction * f64::min(1.0, n.correction / before.max(f64::MIN_POSITIVE));
                if SAFETY * left * norm(n.derivative) <= TOLERANCE {
                    return (Some(Mapped { point: first.world(n.at), derivative: n.derivative }), 0);
                }
            }
            if !q.is_finite() {
                return (None, 0);
            }
            let start = first.world(n.at);
            let settled = n.correction <= SETTLED && start.is_finite();
            (if settled { self.refine(q, start) } else { self.inverse(q) }, 1)
        };
        let all: Vec<(Option<Mapped>, u64)> = (0..points.len()).into_par_iter().map(one).collect();
        let left = all.iter().map(|(_, left)| left).sum();
        (all.into_iter().map(|(found, _)| found).collect(), left)
    }
}

/// Newton's method at one point, in local coordinates of the source.
#[derive(Clone, Copy)]
struct Newton {
    at: [f64; 2],
    derivative: DMat2,
    /// Length of the last correction; infinite before the first, and NaN where there is none.
    correction: f64,
}

impl Newton {
    /// From `start`, whose image is `off` the goal.
    fn step(&mut self, start: DVec2, off: DVec2, derivative: DMat2) {
        let by = derivative.inverse() * off;
        *self = Self { at: (start - by).into(), derivative, correction: by.length() };
    }
}

/// Frobenius norm.
fn norm(m: DMat2) -> f64 {
    (m.x_axis.length_squared() + m.y_axis.length_squared()).sqrt()
}

fn wide(rows: Rows<f32>) -> DMat2 {
    matrix(rows.map(|row| row.map(f64::from)))
}
