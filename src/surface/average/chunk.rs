//! A chunk of surface points carried through frames and sweep, with the layout of tiles hidden.

use super::frames::frame_tiles;
use super::sweep::{SweepAnchors, average_tiles, point_of};
use crate::engine::{LaneScalar, Lanes, TILE};
use crate::surface::{PackedPoint, PhongSurface};

/// The averages of a chunk of points of a surface; reuse one per thread or task.
#[derive(Clone, Debug, Default)]
pub struct AveragedChunk<E, const D: usize> {
    input: Vec<E>,
    mean: Vec<E>,
    lists: usize,
}

impl<E: LaneScalar, const D: usize> AveragedChunk<E, D> {
    /// An empty chunk.
    pub fn new() -> Self {
        Self { input: Vec::new(), mean: Vec::new(), lists: 0 }
    }

    /// Solves the inverse problem for each point of `surface` and averages each list of
    /// `anchors.images`.
    ///
    /// Works on the calling thread: call it inside each rayon task, on some hundreds of points
    /// (whole multiples of [`TILE`] waste no lanes). Points whose face does not exist get averages
    /// that mean nothing.
    pub fn compute(
        &mut self,
        lanes: Lanes,
        surface: &PhongSurface<E, D>,
        anchors: SweepAnchors<'_, E, D>,
        points: &[PackedPoint],
    ) {
        frame_tiles(lanes, surface, points, &mut self.input);
        let tiles = points.len().div_ceil(TILE);
        self.lists = anchors.images.len();
        self.mean.resize(tiles * self.lists * D * TILE, E::ZERO);
        average_tiles(lanes, anchors, &self.input, &mut self.mean);
    }

    /// Point `i` in the embedding.
    #[inline(always)]
    pub fn point(&self, i: usize) -> [E; D] {
        point_of(&self.input[i / TILE * 2 * D * TILE..], i)
    }

    /// The average of list `list` of images at point `i`.
    #[inline(always)]
    pub fn mean(&self, list: usize, i: usize) -> [E; D] {
        let skip = i / TILE * (self.lists - 1) + list;
        point_of(&self.mean[skip * D * TILE..], i)
    }
}
