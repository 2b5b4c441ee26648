//! Weighted averages on a device.

use super::average_anchors::{AVERAGE_ANCHORS, AverageParams, VECTORS, anchor_block, correction_records, dispatches};
use super::map::{DeviceMap, HostMap, device, obstacle};
use super::project_phong::ProjectParams;
use super::tables::SurfaceTables;
use super::tile::{Projection, Tile, capacity};
use crate::engine::Engine;
use crate::error::Result;
use crate::geometry::NONE;
use crate::surface::correspondence::{Evidence, Trust, WeightedAverages};
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

        let capacity = capacity(gpu, VECTORS * 32, 2);
        let points = gpu.buffer::<PackedPoint>("points", capacity)?;
        let averages = gpu.buffer::<[f32; 8]>("averages", capacity * VECTORS)?;
        let mut images = Vec::new();
        let mut parameters = Vec::new();
        for (kernel, block) in dispatches(map.table.len(), map.averages_own()) {
            let pipeline = gpu.pipeline(kernel)?;
            let params = gpu.uniform("average parameters", &AverageParams::new(&map, block))?;
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
            images.push((pipeline, group));
            parameters.push(params);
        }
        // The average onto the source, measured from the average.
        let forward = ProjectParams::new::<8>(gpu.capabilities(), &source, VECTORS, [0, 0])?;
        let forward = Projection::new::<8, _>(gpu, capacity, forward, &averages, &points, &source, &starts)?;
        let back = if map.own_starts.is_empty() {
            None
        } else {
            // The average of the target's own anchors back onto the target, measured from the point
            // itself.
            let back = ProjectParams::new::<8>(gpu.capabilities(), &target, VECTORS, [1, 2])?;
            Some(Projection::new::<8, _>(gpu, capacity, back, &averages, &points, &target, &own_starts)?)
        };
        let tile = Tile::new(capacity, points, images, forward, back);
        let tables = (target, source, starts, own_starts, corrections, anchors, averages, parameters);
        Ok(Self::of(engine, map, tile, Box::new(tables)))
    }
}
