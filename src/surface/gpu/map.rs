//! The map from the target to the source on a device.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use rayon::prelude::*;

use super::average_anchors::{AVERAGE_ANCHORS, AverageParams, VECTORS, anchor_block, correction_records, dispatches};
use super::project_phong::{PROJECT_PHONG, ProjectParams, Projected, SEARCH_PHONG};
use super::tables::SurfaceTables;
use crate::engine::{
    BindGroup, Buffer, Compaction, Engine, Gpu, Matching, Pipeline, ReadbackRing, Table, UniformBlocks,
};
use crate::error::{Error, Result};
use crate::geometry::NONE;
use crate::surface::correspondence::{Evidence, Trust, WeightedAverages};
use crate::surface::packed::{PackedImage, PackedPoint, PointMap};
use crate::surface::project::Found;

/// Points of a tile at most: about 25 MB of device memory.
const MOST_POINTS: usize = 131_072;
/// Points of a tile at least, below which dispatch costs more than it does.
const LEAST_POINTS: usize = 1024;
/// Points of the first tile, whose time holds the compilation of the kernels.
const FIRST_POINTS: usize = 4096;
/// Tiles are made no smaller than this for the sake of time, where one dispatch averages all anchors.
const SMALL_TILE: usize = 16_384;
/// Time two tiles, the one before included, may take before the next is made smaller.
const TILE_TIME: Duration = Duration::from_millis(400);

/// Correspondence by weighted averages with its kernels on a device; the same map as [`WeightedAverages`] in single precision.
#[derive(Debug)]
pub struct DeviceMap {
    engine: Engine,
    map: WeightedAverages<f32, 8>,
    tile: Mutex<Tile>,
    left: AtomicU64,
    // Counted against the memory budget as long as bind groups refer to them.
    _tables: Tables,
}

/// What stays the same for all points.
#[derive(Debug)]
struct Tables {
    target: SurfaceTables,
    source: SurfaceTables,
    /// Of each triangle of the target three vertices and a triangle of the source.
    starts: Table,
    /// Of each triangle of the target three vertices of the target.
    own_starts: Table,
    corrections: Table,
    anchors: UniformBlocks<[f32; 8]>,
}

/// Buffers and bindings for one tile of points.
#[derive(Debug)]
struct Tile {
    capacity: usize,
    /// Points the next tile takes.
    next: usize,
    points: Buffer<PackedPoint>,
    _averages: Buffer<[f32; 8]>,
    /// One after the other.
    average: Vec<Averaging>,
    forward: Projection,
    back: Option<Projection>,
}

/// Inverse problem and averages, or the part of it that one dispatch does.
#[derive(Debug)]
struct Averaging {
    pipeline: Arc<Pipeline>,
    group: BindGroup,
    _params: UniformBlocks<AverageParams>,
}

/// One of the two projections: the walk, the compaction of what it leaves, the search.
#[derive(Debug)]
struct Projection {
    results: Buffer<Projected>,
    walk: (Arc<Pipeline>, BindGroup),
    left: Compaction,
    search: (Arc<Pipeline>, BindGroup),
    _params: UniformBlocks<ProjectParams>,
}

impl DeviceMap {
    /// Why the kernels cannot do this work on `engine`; `None` if they can.
    pub fn obstacle(engine: &Engine, dimension: usize) -> Option<String> {
        let stages = [AVERAGE_ANCHORS.name, PROJECT_PHONG.name];
        if let Some(stage) = stages.into_iter().find(|s| engine.gpu_for(s).is_none()) {
            return Some(format!("{stage} runs on the CPU"));
        }
        (dimension > 8).then(|| format!("the kernels work in 8 dimensions, the embedding has {dimension}"))
    }

    /// Puts a map on the device of `engine`.
    ///
    /// # Errors
    /// [`Error::Input`] if there is an obstacle ([`DeviceMap::obstacle`]); [`Error::Memory`], [`Error::Capability`] or
    /// [`Error::Device`] if it does not fit.
    pub fn new(engine: &Engine, map: WeightedAverages<f32, 8>) -> Result<Self> {
        let refuse = |why: String| Error::input(why, "Use --backend cpu");
        if let Some(why) = Self::obstacle(engine, 8) {
            return Err(refuse(why));
        }
        let Some(gpu) = engine.gpu() else { return Err(refuse("there is no device".into())) };
        let target = SurfaceTables::new(gpu, "target", &map.target)?;
        let source = SurfaceTables::new(gpu, "source", &map.source)?;
        let faces = 0..map.target.triangles.len() as u32;
        let starts: Vec<[u32; 4]> = faces
            .clone()
            .map(|t| {
                let [a, b, c] = map.starts_of(t);
                [a, b, c, map.start_faces[t as usize]]
            })
            .collect();
        let starts = gpu.table("starts", &starts)?;
        let own_starts: Vec<[u32; 4]> = faces
            .filter(|_| !map.own_starts.is_empty())
            .map(|t| {
                let [a, b, c] = map.target.triangles[t as usize].v.map(|v| map.own_starts[v as usize]);
                [a, b, c, NONE]
            })
            .collect();
        let own_starts = gpu.table("own starts", &own_starts)?;
        let corrections = gpu.table("corrections", &correction_records(&map))?;
        let anchors = gpu.uniform_blocks("anchors", &anchor_block(&map))?;
        let tables = Tables { target, source, starts, own_starts, corrections, anchors };
        let tile = Tile::new(gpu, &map, &tables)?;
        Ok(Self { engine: engine.clone(), map, tile: Mutex::new(tile), left: AtomicU64::new(0), _tables: tables })
    }

    /// The same map on the CPU.
    pub fn reference(&self) -> &WeightedAverages<f32, 8> {
        &self.map
    }

    /// Points so far that the kernels left to the references.
    pub fn left_to_reference(&self) -> u64 {
        self.left.load(Ordering::Relaxed)
    }

    /// What the kernels found for a point, judged; `None` where they left it to the reference.
    fn judge(&self, point: PackedPoint, image: &Projected, back: Option<&Projected>) -> Option<PackedImage> {
        let found = |p: &Projected| match p.found & Projected::HOW {
            1 => Some(Found::Walk),
            2 => Some(Found::Search),
            _ => None,
        };
        let f = found(image)?;
        let round_trip = match back {
            None => None,
            Some(b) => {
                found(b)?;
                Some(f64::from(b.distance_squared).sqrt())
            }
        };
        let (confidence, status) = if self.map.gathers_evidence() {
            let residual = f64::from(image.distance_squared).sqrt() * self.map.unit;
            self.map.trust.judge(&Evidence { residual, drift: self.map.drift_at(point), round_trip, found: f })
        } else {
            Trust::unchecked(f)
        };
        Some(PackedImage {
            face: image.face,
            b0: image.b0,
            b1: image.b1,
            confidence: confidence as f32,
            status: status as u32,
        })
    }

    /// Judges a tile and appends its images; what the kernels left goes through the reference.
    fn finish(
        &self,
        points: &[PackedPoint],
        found: &[Projected],
        back: Option<&[Projected]>,
        images: &mut Vec<PackedImage>,
    ) -> Result<()> {
        let judged: Vec<Option<PackedImage>> =
            (0..points.len()).into_par_iter().map(|i| self.judge(points[i], &found[i], back.map(|b| &b[i]))).collect();
        let left: Vec<PackedPoint> = points.iter().zip(&judged).filter(|(_, j)| j.is_none()).map(|(p, _)| *p).collect();
        self.left.fetch_add(left.len() as u64, Ordering::Relaxed);
        let mut rest = Vec::new();
        self.map.map(&left, &mut rest)?;
        let mut rest = rest.into_iter();
        images.extend(judged.into_iter().map(|j| j.or_else(|| rest.next()).unwrap_or(PackedImage::NOWHERE)));
        Ok(())
    }
}

impl PointMap for DeviceMap {
    fn map(&self, points: &[PackedPoint], images: &mut Vec<PackedImage>) -> Result<()> {
        let count = self.map.target.triangles.len();
        if let Some(i) = points.iter().position(|p| p.face as usize >= count) {
            return Err(Error::input(
                format!("point {i} lies on face {}, the target has {count}", points[i].face),
                "Faces are counted from 0 after fan triangulation",
            ));
        }
        images.clear();
        let Some(gpu) = self.engine.gpu() else { return Ok(()) };
        let mut tile = self.tile.lock().unwrap_or_else(PoisonError::into_inner);
        let mut forward = ReadbackRing::new(gpu, "images", 2, tile.capacity)?;
        let mut back = match tile.back {
            Some(_) => Some(ReadbackRing::new(gpu, "round trips", 2, tile.capacity)?),
            None => None,
        };
        let mut rest = points;
        let mut pending: Option<(&[PackedPoint], Instant)> = None;
        // One tile computes while the one before is brought back and judged.
        while !rest.is_empty() || pending.is_some() {
            let submitted = if rest.is_empty() {
                None
            } else {
                let (now, later) = rest.split_at(tile.next.min(rest.len()));
                rest = later;
                let begun = Instant::now();
                tile.submit(gpu, now, &mut forward, back.as_mut())?;
                Some((now, begun))
            };
            if let Some((now, begun)) = std::mem::replace(&mut pending, submitted) {
                let found = forward.pop()?.unwrap_or_default();
                let returned = back.as_mut().map(ReadbackRing::pop).transpose()?.flatten();
                tile.learn(now.len(), begun.elapsed());
                self.finish(now, &found, returned.as_deref(), images)?;
            }
        }
        Ok(())
    }
}

impl Tile {
    fn new(gpu: &Gpu, map: &WeightedAverages<f32, 8>, tables: &Tables) -> Result<Self> {
        let Tables { target, source, starts, own_starts, corrections, anchors } = tables;
        // Points, averages, two results with their staging copies, two lists.
        let bytes = size_of::<PackedPoint>() + VECTORS * 32 + 2 * (3 * size_of::<Projected>() + 4);
        let free = gpu.memory_allowed().saturating_sub(gpu.memory_held()) / bytes as u64;
        let capacity = usize::try_from(free).unwrap_or(usize::MAX).clamp(LEAST_POINTS, MOST_POINTS);
        let points = gpu.buffer::<PackedPoint>("points", capacity)?;
        let averages = gpu.buffer::<[f32; 8]>("averages", capacity * VECTORS)?;
        let average = dispatches(map.table.len(), map.averages_own()).into_iter().map(|(kernel, block)| {
            let pipeline = gpu.pipeline(kernel)?;
            let params = gpu.uniform("average parameters", &AverageParams::new(map, block))?;
            let bindings = [
                params.bind(0),
                anchors.bind(block),
                points.bind(),
                averages.bind(),
                target.vertices.bind(),
                target.triangles.bind(),
                corrections.bind(),
            ];
            let group = gpu.bind(&pipeline, &bindings)?;
            Ok(Averaging { pipeline, group, _params: params })
        });
        let average = average.collect::<Result<Vec<_>>>()?;
        let forward = ProjectParams::forward(gpu.capabilities(), source)?;
        let forward = Projection::new(gpu, capacity, forward, &averages, &points, source, starts)?;
        let back = if !map.own_starts.is_empty() {
            let back = ProjectParams::back(gpu.capabilities(), target)?;
            Some(Projection::new(gpu, capacity, back, &averages, &points, target, own_starts)?)
        } else {
            None
        };
        let next = FIRST_POINTS.min(capacity);
        Ok(Self { capacity, next, points, _averages: averages, average, forward, back })
    }

    fn submit(
        &self,
        gpu: &Gpu,
        points: &[PackedPoint],
        forward: &mut ReadbackRing<'_, Projected>,
        back: Option<&mut ReadbackRing<'_, Projected>>,
    ) -> Result<()> {
        gpu.write(&self.points, 0, points)?;
        let n = points.len();
        let mut batch = gpu.batch()?;
        for part in &self.average {
            batch.dispatch(&part.pipeline, &part.group, n)?;
        }
        let stages = || [Some(&self.forward), self.back.as_ref()].into_iter().flatten();
        for p in stages() {
            batch.dispatch(&p.walk.0, &p.walk.1, n)?;
            p.left.record(&mut batch, n)?;
            batch.dispatch(&p.search.0, &p.search.1, n)?;
        }
        forward.push(batch, &self.forward.results, 0..n)?;
        if let (Some(ring), Some(p)) = (back, &self.back) {
            ring.push(gpu.batch()?, &p.results, 0..n)?;
        }
        Ok(())
    }

    /// Doubles or halves the next tile so that it stays within its time.
    fn learn(&mut self, points: usize, time: Duration) {
        if points < self.next {
            return;
        }
        if time > TILE_TIME {
            let least = (SMALL_TILE / self.average.len()).max(LEAST_POINTS);
            self.next = (self.next / 2).max(least).min(self.capacity);
        } else if time < TILE_TIME / 3 {
            self.next = (self.next * 2).min(self.capacity);
        }
    }
}

impl Projection {
    fn new(
        gpu: &Gpu,
        capacity: usize,
        params: ProjectParams,
        averages: &Buffer<[f32; 8]>,
        points: &Buffer<PackedPoint>,
        surface: &SurfaceTables,
        starts: &Table,
    ) -> Result<Self> {
        let params = gpu.uniform("projection parameters", &params)?;
        let results = gpu.buffer::<Projected>("projections", capacity)?;
        let stride = (size_of::<Projected>() / 4) as u32;
        let matching = Matching { stride, offset: Projected::FOUND_WORD, value: Projected::LEFT, mask: Projected::HOW };
        let left = Compaction::new(gpu, &results, capacity, matching)?;
        let walk = gpu.pipeline(&PROJECT_PHONG)?;
        let mut bindings = vec![params.bind(0), averages.bind(), points.bind(), results.bind()];
        bindings.extend([surface.vertices.bind(), surface.triangles.bind(), surface.stops.bind(), starts.bind()]);
        let walk_group = gpu.bind(&walk, &bindings)?;
        let search = gpu.pipeline(&SEARCH_PHONG)?;
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
