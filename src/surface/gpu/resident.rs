//! Maps whose points and images stay on a device.

use std::sync::Arc;

use super::judge_image::{JUDGE_IMAGE, JudgeParams, vouch_record};
use super::map::{DeviceMap, HostMap};
use super::tile::{MOST_POINTS, Points, Work};
use crate::engine::{Batch, BindGroup, Binding, Buffer, Gpu, Pipeline, Table, UniformBlocks};
use crate::error::{Error, Result};
use crate::surface::packed::{Doubts, MapStage, PackedImage, PackedPoint, ResidentMap};

/// A map with the points that it maps: the kernels of its tiles, then the verdict.
#[derive(Debug)]
struct Stage {
    capacity: usize,
    work: Work,
    judge: (Arc<Pipeline>, BindGroup),
    // Counted against the memory budget as long as the bind group refers to them.
    _params: UniformBlocks<JudgeParams>,
    _vouching: Table,
}

impl<M: HostMap> DeviceMap<M> {
    fn stage(
        &self,
        gpu: &Gpu,
        points: Binding<'_>,
        images: &Buffer<PackedImage>,
        doubts: Doubts<'_>,
    ) -> Result<Box<dyn MapStage>> {
        let map = self.reference();
        let capacity = self.tables().capacity(gpu).min(MOST_POINTS);
        let work = self.tables().work(gpu, capacity, &Points::Records(points.clone()))?;
        let params = gpu.uniform("judge parameters", &JudgeParams::new(&map.vouching(), work.back.is_some()))?;
        let record = |t: u32| vouch_record(map.drift_of(t), doubts.0(t));
        let vouching: Vec<[u32; 4]> = (0..map.face_count() as u32).map(record).collect();
        let vouching = gpu.table("vouching", &vouching)?;
        let pipeline = gpu.pipeline(&JUDGE_IMAGE)?;
        let back = work.back.as_ref().unwrap_or(&work.forward);
        let bindings =
            [params.bind(0), points, work.forward.results.bind(), back.results.bind(), images.bind(), vouching.bind()];
        let group = gpu.bind(&pipeline, &bindings)?;
        Ok(Box::new(Stage { capacity, work, judge: (pipeline, group), _params: params, _vouching: vouching }))
    }
}

impl MapStage for Stage {
    fn capacity(&self) -> usize {
        self.capacity
    }

    fn record(&self, batch: &mut Batch<'_>, count: usize) -> Result<()> {
        self.work.record(batch, count)?;
        batch.dispatch(&self.judge.0, &self.judge.1, count)
    }
}

impl<M: HostMap> ResidentMap for DeviceMap<M> {
    fn gpu(&self) -> Option<&Gpu> {
        self.engine().gpu()
    }

    fn bind(&self, points: Binding<'_>, images: &Buffer<PackedImage>, doubts: Doubts<'_>) -> Result<Box<dyn MapStage>> {
        let gpu = self.engine().gpu().ok_or_else(|| Error::input("there is no device", "Use --backend cpu"))?;
        self.stage(gpu, points, images, doubts)
    }

    fn finish(&self, points: &[PackedPoint], images: &mut Vec<PackedImage>) -> Result<()> {
        self.count_left(points.len());
        self.reference().map(points, images)
    }
}
