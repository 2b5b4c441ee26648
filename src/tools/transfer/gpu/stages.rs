//! Which stages of a transfer run on a device, and what memory they take there.

use super::copy_padding::{COPY_PADDING, COVERAGE_BITS};
use super::exchange::{GATHER_LEFT, PLACE_IMAGES};
use super::locate::{FOOTPRINT, LOCATE};
use super::pad_seams::{PAD_COLUMNS, PAD_SEAMS, Padder};
use super::rasterize_atlas::{RASTERIZE_ATLAS, Rasterizer};
use super::resident::{Resident, Work};
use super::runs::LIST_POINTS;
use super::sample_texture::{DeviceTexture, SAMPLE_TEXTURE, Sampler, runs};
use super::shown::{BLANK_TEXELS, SHOW_TEXELS};
use super::store_texel::{FILL_BACKGROUND, Format, STORE_TEXEL};
use super::tally::TALLY;
use crate::engine::{Engine, Gpu, Kernel};
use crate::error::{Error, Result};
use crate::geometry::Mesh;
use crate::surface::PointMap;
use crate::surface::ResidentMap;
use crate::tools::transfer::atlas::AtlasTriangle;
use crate::tools::transfer::{Layer, TransferOptions};

/// The stages between map, sampling and padding.
const IN_BETWEEN: [&Kernel; 8] =
    [&LIST_POINTS, &GATHER_LEFT, &PLACE_IMAGES, &LOCATE, &FOOTPRINT, &FILL_BACKGROUND, &STORE_TEXEL, &TALLY];
/// The stages of padding.
const PADDING: [&Kernel; 4] = [&COVERAGE_BITS, &PAD_COLUMNS, &PAD_SEAMS, &COPY_PADDING];

/// What the upload of pictures takes for a while.
const UPLOAD: u64 = 80 << 20;

/// The stages of one transfer.
#[derive(Default)]
pub(in crate::tools::transfer) struct Stages<'a> {
    rasterize: Option<&'a Gpu>,
    sample: Option<&'a Gpu>,
    pad: Option<&'a Gpu>,
    /// The map where all stages run on its device.
    resident: Option<(&'a Gpu, &'a dyn ResidentMap)>,
    /// Whether whole pictures can be padded there.
    pads_resident: bool,
    notes: Vec<String>,
}

impl<'a> Stages<'a> {
    /// The stages that `engine` runs on a device.
    pub(in crate::tools::transfer) fn new(
        engine: &'a Engine,
        layers: &[Layer<'_>],
        map: &'a dyn PointMap,
        options: &TransferOptions,
    ) -> Self {
        let mut notes = Vec::new();
        let mut sample = engine.gpu_for(SAMPLE_TEXTURE.name);
        if let Some(gpu) = sample {
            let why = layers.iter().flat_map(|l| &l.images).find_map(|i| DeviceTexture::obstacle(gpu, i));
            let ends = || format!("loops of filter {} may not end on this device", options.filter);
            if let Some(why) = why.or_else(|| (!runs(gpu, options.filter)).then(ends)) {
                notes.push(format!("textures are sampled on the CPU: {why}"));
                sample = None;
            }
        }
        let rasterize = engine.gpu_for(RASTERIZE_ATLAS.name);
        // Of a texel's samples each is mapped and averaged for itself, by the host so far.
        let all = IN_BETWEEN.iter().all(|k| engine.gpu_for(k.name).is_some()) && options.supersample == 1;
        let resident = sample.and(rasterize).filter(|_| all).and_then(|gpu| {
            map.resident().filter(|m| m.gpu().is_some_and(|own| std::ptr::eq(own, gpu))).map(|map| (gpu, map))
        });
        Self {
            rasterize,
            sample,
            pad: engine.gpu_for(PAD_SEAMS.name).filter(|_| options.margin > 0),
            resident,
            pads_resident: PADDING.iter().all(|k| engine.gpu_for(k.name).is_some()),
            notes,
        }
    }

    /// Lets texels return to the host between stages.
    pub(in crate::tools::transfer) fn leave_resident(&mut self) {
        self.resident = None;
    }

    /// The transfer on a device, if all its stages run there. `new` makes it, with whole pictures
    /// of the result if so told.
    pub(in crate::tools::transfer) fn resident<T>(
        &mut self,
        work: &Work<'_>,
        new: impl Fn(&'a Gpu, &'a dyn ResidentMap, bool) -> Result<T>,
    ) -> Result<Option<T>> {
        let Some((gpu, map)) = self.resident else { return Ok(None) };
        let lacks_room = |e: &Error| matches!(e, Error::Memory { .. } | Error::Capability { .. });
        let made = match new(gpu, map, !work.mirrored && self.pads_resident) {
            Err(e) if lacks_room(&e) => new(gpu, map, false),
            made => made,
        };
        match made {
            Ok(made) => Ok(Some(made)),
            Err(why) if lacks_room(&why) => {
                self.notes.push(format!("texels return to the host between stages: {why}"));
                self.resident = None;
                Ok(None)
            }
            Err(e) => Err(e),
        }
    }

    /// Whether whole pictures can stay on the device of `engine` and be shown from there.
    pub(in crate::tools::transfer) fn keep_whole(&self, engine: &Engine) -> bool {
        let shown = [&BLANK_TEXELS, &SHOW_TEXELS].iter().all(|k| engine.gpu_for(k.name).is_some());
        self.resident.is_some() && self.pads_resident && shown
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
        if self.resident.is_some() {
            let words = |layer: &Layer<'_>| {
                let (channels, depth) = layer.output_format(options.background);
                Format { channels, depth }.words()
            };
            let size = [options.width as usize, options.height as usize];
            bytes += Resident::bytes(size, layers.iter().map(words).sum(), target.triangle_count());
        }
        if self.pad.is_some() {
            // Of the bands that are gone when padding begins, this takes a part.
            bytes = bytes.max(Padder::bytes(options.width as usize, options.height as usize));
        }
        bytes
    }

    /// Names of the stages on a device, and why others are not.
    pub(in crate::tools::transfer) fn report(&self) -> (Vec<&'static str>, Vec<String>) {
        let between: Vec<&'static str> =
            IN_BETWEEN.iter().filter(|_| self.resident.is_some()).map(|k| k.name).collect();
        let of = |gpu: Option<&Gpu>, name| gpu.map(|_| name);
        let stages = of(self.rasterize, RASTERIZE_ATLAS.name)
            .into_iter()
            .chain(between)
            .chain(of(self.sample, SAMPLE_TEXTURE.name))
            .chain(of(self.pad, PAD_SEAMS.name));
        (stages.collect(), self.notes.clone())
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
