//! Exact pre-images under composite maps, by Newton's method with the analytic derivative.

use glam::{DMat2, DVec2};

use super::composite::{CompositeMap, Mapped, matrix};
use super::step::Step;

/// Iterations of Newton's method on one step; it converges quadratically, so more mean that it does
/// not.
const ITERATIONS: usize = 40;

/// Halvings of an iteration that does not bring the image closer.
const HALVINGS: usize = 30;

/// A residual is zero when it is below this many roundings of the size of the polygons, which is 1
/// in local coordinates.
const ROUNDINGS: f64 = 64.0;

/// Most parts into which continuation divides the way to a point.
const PARTS: f64 = 1024.0;

impl CompositeMap {
    /// The point that is mapped to `q`, in double precision; the derivative is the forward one
    /// there.
    ///
    /// Step by step from the last: the step through the reversed pair of polygons gives a start
    /// whose error is quadratic in the displacement, damped Newton iterations with the analytic
    /// derivative finish, and where they stall the solution is followed along the line from an
    /// image that is known. Inside the target polygon of a map that does not fold there is exactly
    /// one pre-image. `None` where nothing is found, as can happen outside it or where the map
    /// folds.
    pub fn inverse(&self, q: DVec2) -> Option<Mapped> {
        let mut at: [f64; 2] = self.frame(self.step_count()).local(q);
        let mut derivative = DMat2::IDENTITY;
        for (step, back) in self.steps().iter().zip(self.reversed_steps()).rev() {
            at = invert(step, at, back.map(at))?;
            derivative *= matrix(step.evaluate(at).derivative);
        }
        Some(Mapped { point: self.frame(0).world(at), derivative })
    }

    /// Finishes a pre-image of `q` that is known roughly: Newton's method on the whole composite
    /// from `guess`, and [`CompositeMap::inverse`] where that stalls.
    pub fn refine(&self, q: DVec2, guess: DVec2) -> Option<Mapped> {
        let (mut p, mut image) = (guess, self.forward(guess));
        let size = self.target().size().max(self.source().size());
        // Images far from the origin round by more than the steps do.
        let tolerance = f64::EPSILON * (ROUNDINGS * self.step_count() as f64 * size + q.abs().max_element());
        let mut residual = (image.point - q).length();
        for _ in 0..8 {
            if residual <= tolerance {
                return Some(Mapped { point: p, derivative: image.derivative });
            }
            let next = p - image.derivative.inverse() * (image.point - q);
            if !next.is_finite() {
                break;
            }
            let there = self.forward(next);
            let smaller = (there.point - q).length();
            if !(smaller < residual) {
                break;
            }
            (p, image, residual) = (next, there, smaller);
        }
        self.inverse(q)
    }
}

/// Solves `step(x) = y` in local coordinates.
fn invert(step: &Step<f64>, y: [f64; 2], start: [f64; 2]) -> Option<[f64; 2]> {
    let goal = DVec2::from(y);
    let start = if start[0].is_finite() && start[1].is_finite() { DVec2::from(start) } else { goal };
    if let Some(x) = newton(step, goal, start) {
        return Some(x.into());
    }
    // Continuation from the start, whose image is known: the goal moves from there to y.
    let (mut x, from) = (start, DVec2::from(step.map(start.into())));
    let (mut done, mut part) = (0.0, 0.25);
    while done < 1.0 {
        let next = f64::min(done + part, 1.0);
        match newton(step, from.lerp(goal, next), x) {
            Some(found) => {
                (x, done) = (found, next);
                part = f64::min(2.0 * part, 1.0);
            }
            None if part * PARTS > 1.0 => part *= 0.5,
            None => return None,
        }
    }
    Some(x.into())
}

fn newton(step: &Step<f64>, goal: DVec2, start: DVec2) -> Option<DVec2> {
    let mut x = start;
    let mut image = step.evaluate(x.into());
    let mut off = DVec2::from(image.point) - goal;
    for _ in 0..ITERATIONS {
        let size = 1.0 + x.length() + goal.length();
        if off.length() <= ROUNDINGS * f64::EPSILON * size {
            return Some(x);
        }
        let derivative = matrix(image.derivative);
        if !(derivative.determinant().abs() > f64::MIN_POSITIVE) {
            return None;
        }
        let move_by = derivative.inverse() * off;
        let (mut factor, mut halved) = (1.0, 0);
        loop {
            let next = x - move_by * factor;
            let there = step.evaluate(next.into());
            let rest = DVec2::from(there.point) - goal;
            if rest.length() < off.length() {
                (x, image, off) = (next, there, rest);
                break;
            }
            halved += 1;
            if halved > HALVINGS {
                // No decrease is possible: at the rounding of the map, or at a place where its
                // derivative jumps.
                let close = ROUNDINGS * ROUNDINGS * f64::EPSILON * size;
                return (off.length() <= close).then_some(x);
            }
            factor *= 0.5;
        }
    }
    None
}
