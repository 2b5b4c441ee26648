//! The vertex of a surface nearest to a point of R^D.

use std::num::NonZero;

use kiddo::{ImmutableKdTree, SquaredEuclidean};

use crate::engine::Real;
use crate::geometry::NONE;

use super::PhongSurface;
use super::vector::Vector;

/// Finds the exactly nearest vertex by a k-d tree over the embedded vertices.
pub struct NearestVertex<const D: usize> {
    tree: ImmutableKdTree<f64, D>,
    vertices: Vec<u32>,
}

impl<const D: usize> std::fmt::Debug for NearestVertex<D> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("NearestVertex").field("vertices", &self.vertices.len()).finish_non_exhaustive()
    }
}

impl<const D: usize> NearestVertex<D> {
    /// Indexes the used vertices of `surface`.
    pub fn new<S: Real>(surface: &PhongSurface<S, D>) -> Self {
        let vertices: Vec<u32> = (0..surface.vertices.len() as u32).filter(|&v| !surface.fan(v).is_empty()).collect();
        let at = |v: u32| surface.vertices[v as usize].y.map(|x| x.to_f64());
        Self::of_points(vertices, at)
    }

    /// Indexes these vertices by points that are `at` them.
    pub(crate) fn of_points(vertices: Vec<u32>, at: impl Fn(u32) -> [f64; D]) -> Self {
        let points: Vec<[f64; D]> = vertices.iter().map(|&v| at(v)).collect();
        Self { tree: ImmutableKdTree::new_from_slice(&points), vertices }
    }

    /// The nearest vertex, the lowest index of equally near ones; [`NONE`] for a point that is not
    /// finite.
    pub fn find<S: Real>(&self, y: &Vector<S, D>) -> u32 {
        let y = y.map(|x| x.to_f64());
        if !y.iter().all(|x| x.is_finite()) || self.vertices.is_empty() {
            return NONE;
        }
        // Ties are resolved by index: the few equally near ones are among the first found.
        let found = self.tree.nearest_n::<SquaredEuclidean>(&y, const { NonZero::new(4).unwrap() });
        let nearest = found.iter().map(|n| n.distance).fold(f64::INFINITY, f64::min);
        found.iter().filter(|n| n.distance <= nearest).map(|n| self.vertices[n.item as usize]).min().unwrap_or(NONE)
    }

    /// Up to `n` nearest vertices, nearest first, the lower index of equally near ones first; none
    /// for a point that is not finite.
    pub(crate) fn find_several(&self, y: &Vector<f64, D>, n: usize) -> Vec<u32> {
        let (Some(n), true) = (NonZero::new(n.min(self.vertices.len())), y.iter().all(|x| x.is_finite())) else {
            return Vec::new();
        };
        let found = self.tree.nearest_n::<SquaredEuclidean>(y, n);
        let mut found: Vec<(f64, u32)> = found.iter().map(|f| (f.distance, self.vertices[f.item as usize])).collect();
        found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        found.into_iter().map(|f| f.1).collect()
    }

    /// A nearest vertex, which of equally near ones is not told but always the same: less work than
    /// [`Self::find`]. [`NONE`] for a point that is not finite.
    pub(crate) fn find_one(&self, y: &Vector<f64, D>) -> u32 {
        if !y.iter().all(|x| x.is_finite()) || self.vertices.is_empty() {
            return NONE;
        }
        self.vertices[self.tree.nearest_one::<SquaredEuclidean>(y).item as usize]
    }
}
