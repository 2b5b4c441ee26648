//! A warp whose picture, places, colours and samples stay on a device: of each band finished pixels
//! come down once.

use super::picture::{HALVE_TEXELS, StoredPicture};
use super::pixels::{COUNT_PIXELS, FILTER_PIXELS, Finish, Finisher, PixelCounts, STORE_PIXELS};
use super::place::{LeftRecord, PLACE_LEFT, PLACE_PIXELS, Placer};
use super::windowed::ends;
use crate::engine::{Engine, Gpu, Staging, Submission};
use crate::error::{Error, Result};
use crate::mapping::plane::{Patches, TILE_SIDE};
use crate::picture::Filter;
use crate::picture::Image;
use crate::tools::stopwatch::Stopwatch;
use crate::tools::warp::band::Band;

/// Pixels of a band, unless eight rows have more: a band is one submission, which drivers of
/// desktops end after some seconds.
const BAND_PIXELS: usize = 1 << 17;

/// A warp on a device.
pub(in crate::tools::warp) struct Resident<'a> {
    gpu: &'a Gpu,
    placer: Placer<'a>,
    finisher: Finisher,
    /// Two bands are under way: one is computed while the one before is read.
    slots: [Staging<'a, u32>; 2],
    turn: usize,
    under_way: Option<(Band, Submission)>,
    rows: usize,
    _picture: StoredPicture,
}

/// What a warp on a device works on.
pub(in crate::tools::warp) struct Work<'p> {
    pub(in crate::tools::warp) image: &'p Image,
    pub(in crate::tools::warp) patches: &'p Patches,
    /// Columns and rows of the result.
    pub(in crate::tools::warp) canvas: [u32; 2],
    /// Whether the target polygon shows some pixels alone.
    pub(in crate::tools::warp) caged: bool,
    pub(in crate::tools::warp) finish: Finish,
}

/// The device that has all stages of a warp with `filter`.
pub(in crate::tools::warp) fn device(engine: &Engine, filter: Filter) -> Option<&Gpu> {
    let stages =
        [&HALVE_TEXELS[0], &PLACE_PIXELS, &PLACE_LEFT, &FILTER_PIXELS[0][0], &STORE_PIXELS[0][0], &COUNT_PIXELS];
    let able = stages.iter().all(|k| engine.gpu_for(k.name).is_some()) && Finisher::variant(filter).is_some();
    engine.gpu_for(FILTER_PIXELS[0][0].name).filter(|gpu| able && ends(gpu, filter))
}

impl<'a> Resident<'a> {
    /// `None` where picture, squares or a band do not fit the device. The upload of the picture,
    /// and that of the rest, are stages of `watch`.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub(in crate::tools::warp) fn new(gpu: &'a Gpu, work: &Work<'_>, watch: &mut Stopwatch) -> Result<Option<Self>> {
        match Self::make(gpu, work, watch) {
            Err(Error::Memory { .. } | Error::Capability { .. }) => Ok(None),
            made => made,
        }
    }

    fn make(gpu: &'a Gpu, work: &Work<'_>, watch: &mut Stopwatch) -> Result<Option<Self>> {
        let Work { image, patches, canvas, caged, finish } = work;
        let width = canvas[0] as usize;
        let rows = (BAND_PIXELS / width / TILE_SIDE).max(1) * TILE_SIDE;
        let rows = rows.min((canvas[1] as usize).next_multiple_of(TILE_SIDE));
        let picture = StoredPicture::new(gpu, image, finish.encoding, finish.filter == Filter::Ewa)?;
        watch.lap("picture");
        let placer = Placer::new(gpu, patches, *canvas, [image.width, image.height], rows, *caged)?;
        let Some(finisher) = Finisher::new(gpu, image, &picture, &placer, width, finish)? else { return Ok(None) };
        let slot = || Staging::new(gpu, "finished pixels", finisher.result.len());
        let slots = [slot()?, slot()?];
        watch.lap("squares");
        Ok(Some(Self { gpu, placer, finisher, slots, turn: 0, under_way: None, rows, _picture: picture }))
    }

    /// Rows of a band.
    pub(in crate::tools::warp) fn rows(&self) -> usize {
        self.rows
    }

    /// Begins a band whose first row begins a tile: `cover` has the share of each pixel in the
    /// target polygon if that matters, `left` the pixels that the host found. The band before is
    /// finished: its samples go into `out`.
    ///
    /// # Errors
    /// [`Error::Device`] or [`Error::Memory`].
    pub(in crate::tools::warp) fn begin(
        &mut self,
        band: Band,
        cover: &[f32],
        left: &[LeftRecord],
        out: &mut Image,
    ) -> Result<Option<PixelCounts>> {
        self.placer.write(cover, left)?;
        let mut batch = self.gpu.batch()?;
        self.placer.record(&mut batch, band.first, band.rows)?;
        self.finisher.record_colors(&mut batch, band.len())?;
        self.finisher.record_samples(&mut batch, band.first, band.len())?;
        self.slots[self.turn].record(&mut batch, &self.finisher.result, &self.finisher.ranges(band.len()))?;
        let before = self.under_way.replace((band, batch.submit()?));
        self.turn ^= 1;
        before.map(|(band, submission)| self.take(band, &submission, out)).transpose()
    }

    /// Finishes the last band.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub(in crate::tools::warp) fn end(&mut self, out: &mut Image) -> Result<Option<PixelCounts>> {
        self.turn ^= 1;
        self.under_way.take().map(|(band, submission)| self.take(band, &submission, out)).transpose()
    }

    /// The samples of the band that the slot in turn has, which goes around to the next.
    fn take(&mut self, band: Band, submission: &Submission, out: &mut Image) -> Result<PixelCounts> {
        self.gpu.wait(submission)?;
        let (finisher, words) = (&self.finisher, self.finisher.ranges(band.len())[0].len());
        self.slots[self.turn].take(|read| {
            let (samples, counts) = read.split_at(words.min(read.len()));
            finisher.unpack(samples, out, band.first * band.width);
            PixelCounts::of(counts)
        })
    }
}
