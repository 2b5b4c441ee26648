//! A tile of points on a device: the dispatches that make their images in the embedding, and the
//! projections of those.
//!
//! The points are an array that the host fills, or records of points and places that lie there.

use std::any::Any;
use std::sync::Arc;
use std::time::Duration;

use bytemuck::Pod;

use super::project_phong::{ProjectParams, Projected, kernels};
use super::tables::SurfaceTables;
use crate::engine::{
    Batch, BindGroup, Binding, Buffer, Compaction, Gpu, Matching, Pipeline, ReadbackRing, Table, UniformBlocks,
};
use crate::error::Result;
use crate::surface::packed::PackedPoint;
use crate::surface::psi::NEWTON_STEPS;

/// Points of a tile at most: about 25 MB of device memory.
pub(super) const MOST_POINTS: usize = 131_072;
/// Points of a tile at least, below which dispatch costs more than it does.
const LEAST_POINTS: usize = 1024;
/// Points of the first tile, whose time holds the compilation of the kernels.
const FIRST_POINTS: usize = 4096;
/// Tiles are made no smaller than this for the sake of time, where one dispatch makes all images.
const SMALL_TILE: usize = 16_384;
/// Time two tiles, the one before included, may take before the next is made smaller.
const TILE_TIME: Duration = Duration::from_millis(400);

/// Points a tile holds where each takes `vectors` bytes of vectors and is projected `projections`
/// times.
pub(super) fn capacity(gpu: &Gpu, vectors: usize, projections: usize) -> usize {
    // Results with their staging copies, and a list.
    let bytes = size_of::<PackedPoint>() + vectors + projections * (3 * size_of::<Projected>() + 4);
    let free = gpu.memory_allowed().saturating_sub(gpu.memory_held()) / bytes as u64;
    usize::try_from(free).unwrap_or(usize::MAX).clamp(LEAST_POINTS, MOST_POINTS)
}

/// Where the points of a tile are.
#[derive(Clone, Debug)]
pub(super) enum Points<'a> {
    /// In an array of [`PackedPoint`].
    Own(&'a Buffer<PackedPoint>),
    /// In records of four words, the first three a [`PackedPoint`].
    Records(Binding<'a>),
}

impl Points<'_> {
    pub(super) fn bind(&self) -> Binding<'_> {
        match self {
            Self::Own(points) => points.bind(),
            Self::Records(records) => records.clone(),
        }
    }

    pub(super) fn are_records(&self) -> bool {
        matches!(self, Self::Records(_))
    }
}

/// The dispatches for points that lie somewhere.
#[derive(Debug)]
pub(super) struct Work {
    /// What makes the images, one dispatch after the other.
    pub(super) images: Vec<(Arc<Pipeline>, BindGroup)>,
    pub(super) forward: Projection,
    pub(super) back: Option<Projection>,
    /// Vectors and parameters, counted against the memory budget as long as bind groups refer to
    /// them.
    pub(super) _kept: Box<dyn Any + Send + Sync>,
}

impl Work {
    /// The images of the first `count` points, and their projections.
    pub(super) fn record(&self, batch: &mut Batch<'_>, count: usize) -> Result<()> {
        for (pipeline, group) in &self.images {
            batch.dispatch(pipeline, group, count)?;
        }
        let both = [Some(&self.forward), self.back.as_ref()];
        both.into_iter().flatten().try_for_each(|p| p.record(batch, count))
    }
}

/// A tile of points that the host fills.
#[derive(Debug)]
pub(super) struct Tile {
    pub(super) capacity: usize,
    /// Points the next tile takes.
    pub(super) next: usize,
    points: Buffer<PackedPoint>,
    work: Work,
}

/// A projection: the walk, the compaction of what it leaves, the search.
#[derive(Debug)]
pub(super) struct Projection {
    pub(super) results: Buffer<Projected>,
    walk: (Arc<Pipeline>, BindGroup),
    left: Compaction,
    search: (Arc<Pipeline>, BindGroup),
    /// Points that an invocation of the search looks for at most.
    rounds: usize,
    _params: UniformBlocks<ProjectParams>,
}

impl Tile {
    pub(super) fn new(capacity: usize, points: Buffer<PackedPoint>, work: Work) -> Self {
        Self { capacity, next: FIRST_POINTS.min(capacity), points, work }
    }

    /// Whether a second projection follows the first.
    pub(super) fn goes_back(&self) -> bool {
        self.work.back.is_some()
    }

    pub(super) fn submit(
        &self,
        gpu: &Gpu,
        points: &[PackedPoint],
        forward: &mut ReadbackRing<'_, Projected>,
        back: Option<&mut ReadbackRing<'_, Projected>>,
    ) -> Result<()> {
        gpu.write(&self.points, 0, points)?;
        let n = points.len();
        let mut batch = gpu.batch()?;
        self.work.record(&mut batch, n)?;
        forward.push(batch, &self.work.forward.results, 0..n)?;
        if let (Some(ring), Some(p)) = (back, &self.work.back) {
            ring.push(gpu.batch()?, &p.results, 0..n)?;
        }
        Ok(())
    }

    /// Doubles or halves the next tile so that it stays within its time.
    pub(super) fn learn(&mut self, points: usize, time: Duration) {
        if points < self.next {
            return;
        }
        if time > TILE_TIME {
            let least = (SMALL_TILE / self.work.images.len()).max(LEAST_POINTS);
            self.next = (self.next / 2).max(least).min(self.capacity);
        } else if time < TILE_TIME / 3 {
            self.next = (self.next * 2).min(self.capacity);
        }
    }
}

impl Projection {
    /// The dispatches for the averages of the first `count` points.
    pub(super) fn record(&self, batch: &mut Batch<'_>, count: usize) -> Result<()> {
        batch.dispatch(&self.walk.0, &self.walk.1, count)?;
        self.left.record(batch, count)?;
        batch.dispatch(&self.search.0, &self.search.1, count.div_ceil(self.rounds))
    }

    /// Projects the `averages` of points of R^D, which the kernels read from there.
    pub(super) fn new<const D: usize, T: Pod>(
        gpu: &Gpu,
        capacity: usize,
        params: ProjectParams,
        averages: &Buffer<T>,
        points: &Points<'_>,
        surface: &SurfaceTables,
        starts: &Table,
    ) -> Result<Self> {
        let [project, search] = kernels::<D>(points.are_records());
        let params = gpu.uniform("projection parameters", &params)?;
        let results = gpu.buffer::<Projected>("projections", capacity)?;
        let stride = (size_of::<Projected>() / 4) as u32;
        let matching = Matching { stride, offset: Projected::FOUND_WORD, value: Projected::LEFT, mask: Projected::HOW };
        let left = Compaction::new(gpu, &results, capacity, matching)?;
        let walk = gpu.pipeline(project)?;
        let mut bindings = vec![params.bind(0), averages.bind(), points.bind(), results.bind()];
        bindings.extend([surface.vertices.bind(), surface.triangles.bind(), surface.stops.bind(), starts.bind()]);
        let walk_group = gpu.bind(&walk, &bindings)?;
        let search = gpu.pipeline(search)?;
        let mut bindings = vec![params.bind(0), averages.bind(), left.list().bind(), results.bind()];
        bindings.extend([
            surface.vertices.bind(),
            surface.triangles.bind(),
            surface.bounds.bind(),
            surface.near.bind(),
        ]);
        let search_group = gpu.bind(&search, &bindings)?;
        let rounds = search_rounds(gpu.capabilities().loop_budget, surface.most_near);
        Ok(Self { results, walk: (walk, walk_group), left, search: (search, search_group), rounds, _params: params })
    }
}

/// How many points an invocation of `search_phong` may look for one after the other: sixteen, or as
/// many as a driver's `budget` of loops allows. Of each it tests up to `most_near` triangles, with
/// Newton's method in those that pass.
fn search_rounds(budget: u32, most_near: u32) -> usize {
    let one = most_near.max(1) * (NEWTON_STEPS as u32 + 3);
    (budget / one).clamp(1, 16) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn searches_stay_within_the_loops_of_a_driver() {
        assert_eq!(search_rounds(1 << 24, 512), 16);
        assert_eq!(search_rounds(65_535, 64), 16);
        assert!(search_rounds(65_535, 512) * 512 * (NEWTON_STEPS + 1) <= 65_535);
        assert_eq!(search_rounds(4096, 512), 1);
    }
}
