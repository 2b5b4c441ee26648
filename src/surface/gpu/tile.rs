//! A tile of points on a device: the dispatches that make their images in the embedding, and the
//! projections of those.

use std::sync::Arc;
use std::time::Duration;

use bytemuck::Pod;

use super::project_phong::{ProjectParams, Projected, kernels};
use super::tables::SurfaceTables;
use crate::engine::{
    Batch, BindGroup, Buffer, Compaction, Gpu, Matching, Pipeline, ReadbackRing, Table, UniformBlocks,
};
use crate::error::Result;
use crate::surface::packed::PackedPoint;

/// Points of a tile at most: about 25 MB of device memory.
const MOST_POINTS: usize = 131_072;
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

/// Buffers and bindings for one tile of points.
#[derive(Debug)]
pub(super) struct Tile {
    pub(super) capacity: usize,
    /// Points the next tile takes.
    pub(super) next: usize,
    points: Buffer<PackedPoint>,
    /// What makes the images, one dispatch after the other.
    images: Vec<(Arc<Pipeline>, BindGroup)>,
    forward: Projection,
    back: Option<Projection>,
}

/// A projection: the walk, the compaction of what it leaves, the search.
#[derive(Debug)]
pub(super) struct Projection {
    pub(super) results: Buffer<Projected>,
    walk: (Arc<Pipeline>, BindGroup),
    left: Compaction,
    search: (Arc<Pipeline>, BindGroup),
    _params: UniformBlocks<ProjectParams>,
}

impl Tile {
    pub(super) fn new(
        capacity: usize,
        points: Buffer<PackedPoint>,
        images: Vec<(Arc<Pipeline>, BindGroup)>,
        forward: Projection,
        back: Option<Projection>,
    ) -> Self {
        Self { capacity, next: FIRST_POINTS.min(capacity), points, images, forward, back }
    }

    /// Whether a second projection follows the first.
    pub(super) fn goes_back(&self) -> bool {
        self.back.is_some()
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
        for (pipeline, group) in &self.images {
            batch.dispatch(pipeline, group, n)?;
        }
        let stages = || [Some(&self.forward), self.back.as_ref()].into_iter().flatten();
        for p in stages() {
            p.record(&mut batch, n)?;
        }
        forward.push(batch, &self.forward.results, 0..n)?;
        if let (Some(ring), Some(p)) = (back, &self.back) {
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
            let least = (SMALL_TILE / self.images.len()).max(LEAST_POINTS);
            self.next = (self.next / 2).max(least).min(self.capacity);
        } else if time < TILE_TIME / 3 {
            self.next = (self.next * 2).min(self.capacity);
        }
    }
}

impl Projection {
    /// The dispatches for the first `n` averages.
    pub(super) fn record(&self, batch: &mut Batch<'_>, n: usize) -> Result<()> {
        batch.dispatch(&self.walk.0, &self.walk.1, n)?;
        self.left.record(batch, n)?;
        batch.dispatch(&self.search.0, &self.search.1, n)
    }

    /// Projects the `averages` of points of R^D, which the kernels read from there.
    pub(super) fn new<const D: usize, T: Pod>(
        gpu: &Gpu,
        capacity: usize,
        params: ProjectParams,
        averages: &Buffer<T>,
        points: &Buffer<PackedPoint>,
        surface: &SurfaceTables,
        starts: &Table,
    ) -> Result<Self> {
        let [project, search] = kernels::<D>();
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
        Ok(Self { results, walk: (walk, walk_group), left, search: (search, search_group), _params: params })
    }
}
