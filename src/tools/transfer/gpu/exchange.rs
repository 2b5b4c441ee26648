//! Host half of the kernels `gather_left` and `place_images`: the few points that kernels of a map
//! leave go to the host, and their images come back.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use super::runs::PointRecord;
use super::window::{IMAGE_LAYOUT, Rows};
use crate::engine::{Batch, BindGroup, BindingKind, Buffer, Gpu, Kernel, Pipeline, Staging};
use crate::error::Result;
use crate::kernel_layout as layout;
use crate::surface::{PackedImage, PackedPoint};

/// An image and its place; twin of the struct in `shaders/place_images.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Found {
    pub(super) place: u32,
    pub(super) image: PackedImage,
}

pub(super) static GATHER_LEFT: Kernel = Kernel {
    name: "gather_left",
    source: include_str!("../../../../shaders/gather_left.wgsl"),
    bindings: &[BindingKind::Read, BindingKind::Read, BindingKind::Write],
    layouts: &[IMAGE_LAYOUT],
    items: 1,
    constants: &[],
};

pub(super) static PLACE_IMAGES: Kernel = Kernel {
    name: "place_images",
    source: include_str!("../../../../shaders/place_images.wgsl"),
    bindings: &[BindingKind::Read, BindingKind::Write],
    layouts: &[layout!(Found, { place, image }), IMAGE_LAYOUT],
    items: 1,
    constants: &[],
};

/// Points of a band that come to the host with everything else; more take a read of their own.
const FIRST: usize = 512;

/// A record of the list: a place and a point.
type Record = [u32; 4];

/// The list of points that are left.
#[derive(Debug)]
pub(super) struct Exchange<'a> {
    gpu: &'a Gpu,
    /// Their number, then the records.
    list: Buffer<Record>,
    staging: Staging<'a, Record>,
    gather: (Arc<Pipeline>, BindGroup),
    place: (Arc<Pipeline>, BindGroup),
    /// Where found images go up.
    found: Buffer<Found>,
}

impl<'a> Exchange<'a> {
    /// For the images of `rows`, which belong to `points`.
    pub(super) fn new(gpu: &'a Gpu, rows: &Rows, points: &Buffer<PointRecord>) -> Result<Self> {
        let list = gpu.buffer::<Record>("points left", 1 + room(rows))?;
        let pipeline = gpu.pipeline(&GATHER_LEFT)?;
        let group = gpu.bind(&pipeline, &[points.bind(), rows.images.bind(), list.bind()])?;
        let staging = Staging::new(gpu, "points left", (1 + FIRST).min(list.len()))?;
        let place = gpu.pipeline(&PLACE_IMAGES)?;
        let found = gpu.buffer("images found", FIRST)?;
        let placed = gpu.bind(&place, &[found.bind(), rows.images.bind()])?;
        Ok(Self { gpu, list, staging, gather: (pipeline, group), place: (place, placed), found })
    }

    /// Empties the list. What was submitted before still sees the old one.
    pub(super) fn clear(&self) -> Result<()> {
        self.gpu.write(&self.list, 0, &[[0; 4]])
    }

    /// Adds those of the first `count` points that are left.
    pub(super) fn gather(&self, batch: &mut Batch<'_>, count: usize) -> Result<()> {
        batch.dispatch(&self.gather.0, &self.gather.1, count)
    }

    /// Brings the beginning of the list to the host.
    pub(super) fn record(&mut self, batch: &mut Batch<'_>) -> Result<()> {
        let first = 0..(1 + FIRST).min(self.list.len());
        self.staging.record(batch, &self.list, &[first])
    }

    /// The points left and their places, rising; `None` if there are more than the list holds. The
    /// caller has waited for the submission.
    pub(super) fn take(&mut self) -> Result<Option<Vec<(u32, PackedPoint)>>> {
        let records = self.staging.take(<[Record]>::to_vec)?;
        self.listed(records)
    }

    /// The same without a wait: `None` while the copy has not arrived. More points than come with
    /// it take a read of their own.
    ///
    /// # Errors
    /// [`Error::Device`](crate::Error::Device); [`Error::Numeric`](crate::Error::Numeric) if there
    /// are more than the list holds.
    pub(super) fn poll(&mut self) -> Result<Option<Vec<(u32, PackedPoint)>>> {
        let Some(records) = self.staging.poll(<[Record]>::to_vec)? else { return Ok(None) };
        let overflow = || {
            crate::Error::numeric(
                "the kernels leave a quarter of all points",
                "Make the field anew, or use --backend cpu",
            )
        };
        self.listed(records)?.ok_or_else(overflow).map(Some)
    }

    fn listed(&self, mut records: Vec<Record>) -> Result<Option<Vec<(u32, PackedPoint)>>> {
        let count = records.first().map_or(0, |head| head[0] as usize);
        if count >= self.list.len() {
            return Ok(None);
        }
        if count + 1 > records.len() {
            records = self.gpu.read(&self.list, 0..count + 1)?;
        }
        let mut left: Vec<(u32, PackedPoint)> = records[1..=count]
            .iter()
            .map(|&[place, face, b0, b1]| (place, PackedPoint { face, b0: f32::from_bits(b0), b1: f32::from_bits(b1) }))
            .collect();
        left.sort_unstable_by_key(|(place, _)| *place);
        Ok(Some(left))
    }

    /// Puts images where those of `rows` lie.
    pub(super) fn place(&self, batch: &mut Batch<'_>, rows: &Rows, found: &[Found]) -> Result<()> {
        if found.is_empty() {
            return Ok(());
        }
        if found.len() <= self.found.len() {
            self.gpu.write(&self.found, 0, found)?;
            return batch.dispatch(&self.place.0, &self.place.1, found.len());
        }
        let host = self.gpu.upload("images found", found)?;
        let group = self.gpu.bind(&self.place.0, &[host.bind(), rows.images.bind()])?;
        batch.dispatch(&self.place.0, &group, found.len())
    }
}

/// Records that the list has room for: where more is left the host does the work anyway.
fn room(rows: &Rows) -> usize {
    (rows.kept * rows.width / 4).max(1024)
}
