//! Which stages of a transfer run on a device, and what memory they take there.

use super::pad_seams::{PAD_SEAMS, Padder};
use super::rasterize_atlas::{RASTERIZE_ATLAS, Rasterizer};
use super::sample_texture::{DeviceTexture, SAMPLE_TEXTURE, Sampler};
use crate::engine::{Engine, Gpu};
use crate::error::{Error, Result};
use crate::geometry::Mesh;
use crate::tools::transfer::atlas::AtlasTriangle;
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
                notes.push(format!("textures are sampled on the CPU: {why}"));
                sample = None;
            }
        }
        Self {
            rasterize: engine.gpu_for(RASTERIZE_ATLAS.name),
            sample,
            pad: engine.gpu_for(PAD_SEAMS.name).filter(|_| options.margin > 0),
            notes,
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

    /// An atlas on the device that rasterises, if any; tiles have `width` texels in a row.
    pub(in crate::tools::transfer) fn rasterizer(
        &mut self,
        triangles: &[AtlasTriangle],
        width: usize,
    ) -> Result<Option<Rasterizer<'a>>> {
        let new = |gpu| Rasterizer::new(gpu, triangles, width);
        make(&mut self.rasterize, &mut self.notes, "the atlas is rasterised", new)
    }

    /// The buffers of the device that samples, if any; `upload` brings the textures there.
    pub(in crate::tools::transfer) fn sampler(
        &mut self,
        upload: impl FnOnce(&Sampler<'a>) -> Result<()>,
    ) -> Result<Option<Sampler<'a>>> {
        let new = |gpu| {
            let sampler = Sampler::new(gpu)?;
            upload(&sampler)?;
            Ok(sampler)
        };
        make(&mut self.sample, &mut self.notes, "textures are sampled", new)
    }

    /// The coverage on the device that pads, if any.
    pub(in crate::tools::transfer) fn padder(
        &mut self,
        coverage: &[u8],
        width: usize,
        margin: u32,
    ) -> Result<Option<Padder<'a>>> {
        make(&mut self.pad, &mut self.notes, "seams are padded", |gpu| Padder::new(gpu, coverage, width, margin))
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

/// What a stage needs on its device. Where that does not fit, the stage goes to the CPU and a note
/// says why.
fn make<'a, T>(
    stage: &mut Option<&'a Gpu>,
    notes: &mut Vec<String>,
    what: &str,
    new: impl FnOnce(&'a Gpu) -> Result<T>,
) -> Result<Option<T>> {
    let Some(gpu) = *stage else { return Ok(None) };
    match new(gpu) {
        Ok(made) => Ok(Some(made)),
        Err(why @ (Error::Memory { .. } | Error::Capability { .. })) => {
            notes.push(format!("{what} on the CPU: {why}"));
            *stage = None;
            Ok(None)
        }
        Err(e) => Err(e),
    }
}
