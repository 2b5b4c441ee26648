//! What lies beyond the rim of the source has no image.
//!
//! A source may be a part of what the target shows: half a scan, a head. Images of the rest are
//! predicted beyond the source's boundary, and the relaxation draws them onto it: a whole region of
//! the target collapses to a line. What was predicted beyond and ends on the line has no
//! image, unless it lies at a boundary of the target itself.

use rayon::prelude::*;

use super::closest::{Closest, ClosestOnSurface, FLAT};
use super::pair::Shapes;
use super::{Field, framed};
use crate::engine::Real;
use crate::geometry::{NONE, Topology};
use crate::surface::vector::{Vector, cast};

/// An image is predicted beyond the rim from this distance on, over the square root of the area.
const BEYOND: f64 = 0.005;
/// A closest point lies on a side if its corner opposite weighs less; an image that was drawn onto
/// the rim lies near it.
const ON_SIDE: f64 = 1e-6;
const NEAR_SIDE: f64 = 0.25;

/// For each triangle which of its sides, by the corner opposite, are part of the boundary; nothing
/// for a closed surface.
fn sides(topology: &Topology) -> Option<Vec<[bool; 3]>> {
    if topology.boundary_edges == 0 {
        return None;
    }
    let side = |t: usize, k: usize| topology.usable[t] && topology.neighbours[t][k] == NONE;
    Some((0..topology.triangles.len()).map(|t| [side(t, 0), side(t, 1), side(t, 2)]).collect())
}

impl<S: Real, const K: usize> Field<S, K> {
    /// Takes all evidence from vertices of the target whose images lie beyond the rim of the
    /// source, and returns their number; `predicted` has the images before they were drawn. O(V)
    /// closest points for an open source.
    pub(super) fn doubt_what_is_beyond(
        &mut self,
        shapes: &Shapes<'_>,
        predicted: impl Fn(usize) -> Vector<f64, K> + Sync,
    ) -> usize {
        let Some(sides) = sides(shapes.source.topology) else { return 0 };
        let own = shapes.target.topology;
        let mut at_boundary = vec![false; self.z.len()];
        for (t, triangle) in own.triangles.iter().enumerate().filter(|(t, _)| own.usable[*t]) {
            for k in (0..3).filter(|&k| own.neighbours[t][k] == NONE) {
                at_boundary[triangle[(k + 1) % 3] as usize] = true;
                at_boundary[triangle[(k + 2) % 3] as usize] = true;
            }
        }
        let closest = ClosestOnSurface::new(&self.reference, &self.vertices);
        let (z, starts, unit) = (&self.z, &self.starts, self.unit);
        let on_rim = |c: &Closest, near: f64| (0..3).any(|k| sides[c.face as usize][k] && c.x[k] < near);
        let beyond = |v: usize| {
            if !shapes.used[v] || at_boundary[v] {
                return false;
            }
            let ends = closest.follow_from((&cast(&z[v]), &FLAT), starts[v]);
            if !ends.is_some_and(|c| on_rim(&c, NEAR_SIDE)) {
                return false;
            }
            let began = closest.near((&framed(&self.reference, predicted(v)), &FLAT), NONE);
            began.is_some_and(|c| on_rim(&c, ON_SIDE) && c.distance_squared.sqrt() * unit > BEYOND)
        };
        let beyond: Vec<bool> = (0..z.len()).into_par_iter().map(beyond).collect();
        for (drift, _) in self.drift.iter_mut().zip(&beyond).filter(|(_, beyond)| **beyond) {
            *drift = f64::INFINITY;
        }
        beyond.into_iter().filter(|b| *b).count()
    }
}
