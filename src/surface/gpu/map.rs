//! A map from the target to the source on a device.

use std::fmt::Debug;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;
use web_time::Instant;

use super::judge_image::JUDGE_IMAGE;
use super::project_phong::{PROJECT_PHONG, Projected, SEARCH_PHONG};
use super::tile::{Points, Tile, Work};
use crate::engine::{Engine, Gpu, ReadbackRing, Table};
use crate::error::{Error, Result};
use crate::surface::correspondence::{Vouching, check_faces};
use crate::surface::field::FieldReport;
use crate::surface::packed::{PackedImage, PackedPoint, PointMap, ResidentMap};
use crate::surface::project::Projection;

/// CPU half of a device map: it judges what the kernels projected, and computes the points that
/// they left ([`PointMap::map`]).
pub trait HostMap: PointMap + Debug {
    /// Triangles of the target.
    fn face_count(&self) -> usize;

    /// The image of a point that was projected to `image`, `round_trip` being the distance of its
    /// second projection from where it should be, in edges. `None` where it needs the reference.
    fn judge(&self, point: PackedPoint, image: &Projection<f32>, round_trip: Option<f64>) -> Option<PackedImage>;

    /// What [`HostMap::judge`] goes by, for the kernel that does it on the device.
    fn vouching(&self) -> Vouching;

    /// The error to be expected at the corners of a triangle of the target; zeros without evidence.
    fn drift_of(&self, face: u32) -> [f64; 3];
}

/// What a map looks up on a device, and the kernels that do so.
pub(super) trait MapTables: Debug + Send + Sync {
    /// Points that a tile holds.
    fn capacity(&self, gpu: &Gpu) -> usize;

    /// The tables of images of vertices and of starts, where a field has them.
    fn of_field(&self) -> Option<[&Table; 2]> {
        None
    }

    /// The dispatches for up to `capacity` points at a time.
    fn work(&self, gpu: &Gpu, capacity: usize, points: &Points<'_>) -> Result<Work>;
}

/// A map with its kernels on a device; the same as the map `M` in single precision.
#[derive(Debug)]
pub struct DeviceMap<M> {
    engine: Engine,
    map: M,
    tile: Mutex<Tile>,
    left: AtomicU64,
    tables: Box<dyn MapTables>,
}

/// The device of `engine`, for surfaces in R^D.
///
/// # Errors
/// [`Error::Input`] if there is an obstacle ([`obstacle`]).
pub(super) fn device<'a>(engine: &'a Engine, first: &str) -> Result<&'a Gpu> {
    let refuse = |why: String| Error::input(why, "Use --backend cpu");
    if let Some(why) = obstacle(engine, first, 8) {
        return Err(refuse(why));
    }
    engine.gpu().ok_or_else(|| refuse("there is no device".into()))
}

/// Why `engine` cannot run a map whose images the kernel `first` makes, over embeddings of this
/// dimension; `None` if it can.
pub(super) fn obstacle(engine: &Engine, first: &str, dimension: usize) -> Option<String> {
    if let Some(stage) =
        [first, PROJECT_PHONG.name, SEARCH_PHONG.name].into_iter().find(|s| engine.gpu_for(s).is_none())
    {
        return Some(format!("{stage} runs on the CPU"));
    }
    (dimension > 8).then(|| format!("the kernels work in 8 dimensions, the embedding has {dimension}"))
}

impl<M: HostMap> DeviceMap<M> {
    pub(super) fn of(engine: &Engine, gpu: &Gpu, map: M, tables: Box<dyn MapTables>) -> Result<Self> {
        let capacity = tables.capacity(gpu);
        let points = gpu.buffer::<PackedPoint>("points", capacity)?;
        let work = tables.work(gpu, capacity, &Points::Own(&points))?;
        let tile = Mutex::new(Tile::new(capacity, points, work));
        Ok(Self { engine: engine.clone(), map, tile, left: AtomicU64::new(0), tables })
    }

    pub(super) fn engine(&self) -> &Engine {
        &self.engine
    }

    pub(super) fn tables(&self) -> &dyn MapTables {
        self.tables.as_ref()
    }

    pub(super) fn count_left(&self, points: usize) {
        self.left.fetch_add(points as u64, Ordering::Relaxed);
    }

    /// The same map on the CPU.
    pub fn reference(&self) -> &M {
        &self.map
    }

    pub(super) fn reference_mut(&mut self) -> &mut M {
        &mut self.map
    }

    /// Points so far that the kernels left to the references.
    pub fn left_to_reference(&self) -> u64 {
        self.left.load(Ordering::Relaxed)
    }

    /// What the kernels found for a point, judged; `None` where they left it to the reference.
    fn judge(&self, point: PackedPoint, image: &Projected, back: Option<&Projected>) -> Option<PackedImage> {
        let image = image.projection()?;
        let round_trip = match back {
            None => None,
            Some(b) => Some(f64::from(b.projection()?.distance_squared).sqrt()),
        };
        self.map.judge(point, &image, round_trip)
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
        self.count_left(left.len());
        let mut rest = Vec::new();
        self.map.map(&left, &mut rest)?;
        let mut rest = rest.into_iter();
        images.extend(judged.into_iter().map(|j| j.or_else(|| rest.next()).unwrap_or(PackedImage::NOWHERE)));
        Ok(())
    }
}

impl<M: HostMap> PointMap for DeviceMap<M> {
    fn map(&self, points: &[PackedPoint], images: &mut Vec<PackedImage>) -> Result<()> {
        check_faces(points, self.map.face_count())?;
        images.clear();
        let Some(gpu) = self.engine.gpu() else { return Ok(()) };
        let mut tile = self.tile.lock().unwrap_or_else(PoisonError::into_inner);
        let mut forward = ReadbackRing::new(gpu, "images", 2, tile.capacity)?;
        let mut back =
            if tile.goes_back() { Some(ReadbackRing::new(gpu, "round trips", 2, tile.capacity)?) } else { None };
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

    fn resident(&self) -> Option<&dyn ResidentMap> {
        self.engine.gpu_for(JUDGE_IMAGE.name).map(|_| self as &dyn ResidentMap)
    }

    fn handed_back(&self) -> Option<u64> {
        Some(self.left_to_reference())
    }

    fn field(&self) -> Option<&FieldReport> {
        self.map.field()
    }
}
