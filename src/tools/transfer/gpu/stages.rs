//! Which stages of a transfer run on a device, and what memory they take there.

use super::pad_seams::{PAD_SEAMS, Padder};
use super::rasterize_atlas::{RASTERIZE_ATLAS, Rasterizer};
use super::sample_texture::{DeviceTexture, SAMPLE_TEXTURE, Sampler};
use crate::engine::{Engine, Gpu};
use crate::geometry::Mesh;
use crate::tools::transfer::{Layer, TransferOptions};

/// What the upload of pictures takes for a while.
const UPLOAD: u64 = 80 << 20;

/// The stages of one transfer.
#[derive(Debug, Default)]
pub(in crate::tools::transfer) struct Stages<'a> {
    rasterize: Option<&'a Gpu>,
    sample: Option<&'a Gpu>,
    pad: Option<&'a Gpu>,
    notes: Vec<String>,
}

impl<'a> Stages<'a> {
    /// The stages that `engine` runs on a device.
    pub(in crate::tools::transfer) fn new(engine: &'a Engine, layers: &[Layer<'_>], options: &TransferOptions) -> Self {
        let mut notes = Vec::new();
        let mut sample = engine.gpu_for(SAMPLE_TEXTURE.name);
        if let Some(gpu) = sample {
            let why = layers.iter().flat_map(|l| &l.images).find_map(|i| DeviceTexture::obstacle(gpu, i));
            if let Some(why) = why {
                notes.push(format!("sampling runs on the CPU: {why}"));
                sample = None;
            }
        }
        Self {
            rasterize: engine.gpu_for(RASTERIZE_ATLAS.name),
            sample,
            pad: engine.gpu_for(PAD_SEAMS.name).filter(|_| options.margin > 0),
            notes: notes,
        }
    }

    /// Everything on the CPU, and why.
    pub(in crate::tools::transfer) fn none(why: String) -> Self {
        Self { notes: vec![why], ..Self::default() }
    }

    /// Whether any stage runs on a device.
    pub(in crate::tools::transfer) fn any(&self) -> bool {
        self.rasterize.is_some() || self.sample.is_some() || self.pad.is_some()
    }

    /// The device that rasterises an atlas of so many records.
    pub(in crate::tools::transfer) fn rasterize_atlas(&mut self, triangles: usize) -> Option<&'a Gpu> {
        let gpu = self.rasterize?;
        if let Some(why) = Rasterizer::obstacle(gpu, triangles) {
            self.notes.push(format!("the atlas is rasterised on the CPU: {why}"));
            self.rasterize = None;
        }
        self.rasterize
    }

    /// The device that samples.
    pub(in crate::tools::transfer) fn sample_texture(&self) -> Option<&'a Gpu> {
        self.sample
    }

    /// The device that pads.
    pub(in crate::tools::transfer) fn pad_seams(&self) -> Option<&'a Gpu> {
        self.pad
    }

    /// Bytes at most of what the stages hold on devices, and of the host's copies on the way.
    pub(in crate::tools::transfer) fn bytes(
        &self,
        target: &Mesh,
        layers: &[Layer<'_>],
        options: &TransferOptions,
    ) -> u64 {
        let grids = if options.supersample > 1 { 2 } else { 1 };
        let mut bytes = 0;
        if self.rasterize.is_some() {
            bytes += grids * Rasterizer::bytes(target.triangle_count());
        }
        if self.sample.is_some() {
            let images = layers.iter().flat_map(|l| &l.images);
            bytes += Sampler::BYTES + UPLOAD + images.map(|i| DeviceTexture::bytes(i)).sum::<u64>();
        }
        if self.pad.is_some() {
            // Of the bands that are gone when padding begins, this takes a part.
            bytes = bytes.max(Padder::bytes(options.width as usize, options.height as usize));
        }
        bytes
    }

    /// Names of the stages on a device, and why others are not.
    pub(in crate::tools::transfer) fn report(&self) -> (Vec<&'static str>, Vec<String>) {
        let stages =
            [(self.rasterize, RASTERIZE_ATLAS.name), (self.sample, SAMPLE_TEXTURE.name), (self.pad, PAD_SEAMS.name)];
        (stages.into_iter().filter_map(|(gpu, name)| gpu.map(|_| name)).collect(), self.notes.clone())
    }
}
