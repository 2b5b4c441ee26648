//! What lies beyond the rim of the source has no image.
//!
//! A source may be a part of what the target shows: half a scan, a head. Images of the rest are
//! predicted beyond the source's boundary, and the relaxation draws them onto it: a whole region of
//! the target collapses to a line. What was predicted beyond by more than predictions miss, or ends
//! on the line, has no image, unless it lies at a boundary of the target itself.

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

/// Vertices of the target that have no image on a source that is only a part.
#[derive(Debug, Default)]
pub(super) struct BeyondRim {
    /// Whether each is predicted beyond the rim or was drawn onto it; empty for a closed source.
    there: Vec<bool>,
    /// How many of them have no image.
    without: usize,
}

impl BeyondRim {
    /// Whether a corner of the triangle is predicted beyond the rim or was drawn onto it.
    pub(super) fn has(&self, triangle: [u32; 3]) -> bool {
        triangle.iter().any(|&v| self.there.get(v as usize) == Some(&true))
    }

    /// How many vertices have no image.
    pub(super) fn count(&self) -> usize {
        self.without
    }
}

impl<S: Real, const K: usize> Field<S, K> {
    /// Takes all evidence from vertices of the target whose images lie beyond the rim of the
    /// source; `predicted` has the images before they were drawn. O(V) closest points for an open
    /// source.
    pub(super) fn doubt_what_is_beyond(
        &mut self,
        shapes: &Shapes<'_>,
        predicted: impl Fn(usize) -> Vector<f64, K> + Sync,
    ) -> BeyondRim {
        let Some(sides) = sides(shapes.source.topology) else { return BeyondRim::default() };
        let own = shapes.target.topology;
        let mut at_boundary = vec![false; self.z.len()];
        for (t, triangle) in own.triangles.iter().enumerate().filter(|(t, _)| own.usable[*t]) {
            for k in (0..3).filter(|&k| own.neighbours[t][k] == NONE) {
                at_boundary[triangle[(k + 1) % 3] as usize] = true;
                at_boundary[triangle[(k + 2) % 3] as usize] = true;
            }
        }
        let closest = ClosestOnSurface::new(&self.reference, &self.vertices);
        let (z, starts, unit, drift) = (&self.z, &self.starts, self.unit, &self.drift);
        let on_rim = |c: &Closest, near: f64| (0..3).any(|k| sides[c.face as usize][k] && c.x[k] < near);
        // How far beyond each is predicted.
        let beyond = |v: usize| {
            if !shapes.used[v] || at_boundary[v] {
                return 0.0;
            }
            let began = closest.near((&framed(&self.reference, predicted(v)), &FLAT), NONE);
            began.filter(|c| on_rim(c, ON_SIDE)).map_or(0.0, |c| c.distance_squared.sqrt() * unit)
        };
        let beyond: Vec<f64> = (0..z.len()).into_par_iter().map(beyond).collect();
        let ends_on_rim = |v: usize| {
            let ends = closest.follow_from((&cast(&z[v]), &FLAT), starts[v]);
            shapes.used[v] && ends.is_some_and(|c| on_rim(&c, NEAR_SIDE))
        };
        let on_rim: Vec<bool> = (0..z.len()).into_par_iter().map(ends_on_rim).collect();
        // A prediction that is off by less than that cannot be on the source; and what was drawn
        // onto the rim itself found nothing else.
        let without: Vec<bool> =
            (0..z.len()).map(|v| beyond[v] > BEYOND && (beyond[v] > drift[v] || on_rim[v])).collect();
        for (drift, _) in self.drift.iter_mut().zip(&without).filter(|(_, without)| **without) {
            *drift = f64::INFINITY;
        }
        BeyondRim {
            there: beyond.iter().zip(on_rim).map(|(b, on_rim)| on_rim || *b > BEYOND).collect(),
            without: without.into_iter().filter(|b| *b).count(),
        }
    }
}
