//! Weighted averages on a device.

use super::average_anchors::{AVERAGE_ANCHORS, AverageParams, VECTORS, anchor_block, correction_records, dispatches};
use super::map::{DeviceMap, HostMap, MapTables, device, obstacle};
use super::project_phong::ProjectParams;
use super::tables::SurfaceTables;
use super::tile::{Points, Projection, Work, capacity};
use crate::engine::{Engine, Gpu, Table, UniformBlocks};
use crate::error::Result;
use crate::geometry::NONE;
use crate::surface::correspondence::{Evidence, Trust, Vouching, WeightedAverages};
use crate::surface::packed::{PackedImage, PackedPoint};
use crate::surface::project;

impl HostMap for WeightedAverages<f32, 8> {
    fn face_count(&self) -> usize {
        self.target.triangles.len()
    }

    fn judge(
        &self,
        point: PackedPoint,
        image: &project::Projection<f32>,
        round_trip: Option<f64>,
    ) -> Option<PackedImage> {
        let found = image.found;
        let (confidence, status) = if self.gathers_evidence() {
            let residual = f64::from(image.distance_squared).sqrt() * self.unit;
            self.trust.judge(&Evidence { residual, drift: self.drift_at(point), round_trip, found })
        } else {
            Trust::unchecked(found)
        };
        let [b0, b1, _] = image.x;
        Some(PackedImage { face: image.face, b0, b1, confidence: confidence as f32, status: status as u32 })
    }

    fn vouching(&self) -> Vouching {
        let faces = self.source.triangles.len();
        Vouching { evidence: self.gathers_evidence(), unit: self.unit, trust: self.trust, guard: None, faces }
    }

    fn drift_of(&self, face: u32) -> [f64; 3] {
        self.target.triangles[face as usize].v.map(|v| self.drift.get(v as usize).copied().unwrap_or(0.0))
    }
}

impl DeviceMap<WeightedAverages<f32, 8>> {
    /// Why the kernels cannot do this work on `engine`; `None` if they can.
    pub fn obstacle(engine: &Engine, dimension: usize) -> Option<String> {
        obstacle(engine, AVERAGE_ANCHORS.name, dimension)
    }

    /// Puts a map on the device of `engine`.
    ///
    /// # Errors
    /// [`Error::Input`](crate::Error::Input) if there is an obstacle ([`Self::obstacle`]);
    /// [`Error::Memory`](crate::Error::Memory), [`Error::Capability`](crate::Error::Capability) or
    /// [`Error::Device`](crate::Error::Device) if it does not fit.
    pub fn new(engine: &Engine, map: WeightedAverages<f32, 8>) -> Result<Self> {
        let gpu = device(engine, AVERAGE_ANCHORS.name)?;
        let target = SurfaceTables::new(gpu, "target", &map.target)?;
        let source = SurfaceTables::new(gpu, "source", &map.source)?;
        let faces = 0..map.target.triangles.len() as u32;
        // Of each triangle of the target three vertices and a triangle of the source.
        let starts: Vec<[u32; 4]> = faces
            .clone()
            .map(|t| {
                let [a, b, c] = map.starts_of(t);
                [a, b, c, map.start_faces[t as usize]]
            })
            .collect();
        let starts = gpu.table("starts", &starts)?;
        // Of each triangle of the target three vertices of the target.
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

        let params = |(_, block): (_, usize)| gpu.uniform("average parameters", &AverageParams::new(&map, block));
        let parameters =
            dispatches(map.table.len(), map.averages_own(), false).into_iter().map(params).collect::<Result<_>>()?;
        let returns = !map.own_starts.is_empty();
        let tables = AverageTables {
            anchor_count: map.table.len(),
            averages_own: map.averages_own(),
            returns,
            target,
            source,
            starts,
            own_starts,
            corrections,
            anchors,
            parameters,
        };
        Self::of(engine, gpu, map, Box::new(tables))
    }
}

/// Weighted averages, and both surfaces, on a device.
#[derive(Debug)]
struct AverageTables {
    anchor_count: usize,
    averages_own: bool,
    /// Whether the average of the target's own anchors is projected back.
    returns: bool,
    target: SurfaceTables,
    source: SurfaceTables,
    starts: Table,
    own_starts: Table,
    corrections: Table,
    anchors: UniformBlocks<[f32; 8]>,
    /// Of each dispatch.
    parameters: Vec<UniformBlocks<AverageParams>>,
}

impl MapTables for AverageTables {
    fn capacity(&self, gpu: &Gpu) -> usize {
        capacity(gpu, VECTORS * 32, 2)
    }

    fn work(&self, gpu: &Gpu, capacity: usize, points: &Points<'_>) -> Result<Work> {
        let averages = gpu.buffer::<[f32; 8]>("averages", capacity * VECTORS)?;
        let dispatches = dispatches(self.anchor_count, self.averages_own, points.are_records());
        let mut images = Vec::new();
        for ((kernel, block), params) in dispatches.into_iter().zip(&self.parameters) {
            let pipeline = gpu.pipeline(kernel)?;
            let bindings = [
                params.bind(0),
                self.anchors.bind(block),
                points.bind(),
                averages.bind(),
                self.target.vertices.bind(),
                self.target.triangles.bind(),
                self.corrections.bind(),
            ];
            let group = gpu.bind(&pipeline, &bindings)?;
            images.push((pipeline, group));
        }
        // The average onto the source, measured from the average.
        let forward = ProjectParams::new::<8>(gpu.capabilities(), &self.source, VECTORS, [0, 0])?;
        let forward = Projection::new::<8, _>(gpu, capacity, forward, &averages, points, &self.source, &self.starts)?;
        let back = if self.returns {
            // The average of the target's own anchors back onto the target, measured from the point
            // itself.
            let back = ProjectParams::new::<8>(gpu.capabilities(), &self.target, VECTORS, [1, 2])?;
            Some(Projection::new::<8, _>(gpu, capacity, back, &averages, points, &self.target, &self.own_starts)?)
        } else {
            None
        };
        Ok(Work { images, forward, back, _kept: Box::new(averages) })
    }
}
