//! A transfer whose texels, images and pictures stay on a device from stage to stage.
//!
//! Rows of texels are rasterised, mapped and judged where they lie; of each band only the few
//! points that the searches leave come to the host, and their images go back. From then on bands
//! are coloured, chunk after chunk of rows, into pictures of the result. Whole pictures are padded
//! there and read once; where they do not fit, or the host fills or pads, their rows come down with
//! the next band.

mod live;

use std::ops::Range;

use super::copy_padding::{record_bits, submit_padding};
use super::exchange::{Exchange, Found};
use super::locate::{Chunk, Footprints, LocatedRecord};
use super::pad_seams::Padder;
use super::picture::{Picture, Plate};
use super::rasterize_atlas::Rasterizer;
use super::runs::{PointRecord, Runs};
use super::sample_texture::FootprintRecord;
use super::tally::DeviceTally;
use super::window::Rows;
use crate::engine::{Buffer, Gpu, Staging, Submission, Table};
use crate::error::{Error, Result};
use crate::picture::Image;
use crate::surface::{Doubts, MapStage, ResidentMap};
use crate::surface::{PackedImage, PackedPoint};
use crate::tools::stopwatch::Stopwatch;
use crate::tools::transfer::TransferOptions;
use crate::tools::transfer::atlas::{AtlasTexel, Tile};
use crate::tools::transfer::bins::{Atlas, Bins};
use crate::tools::transfer::tables::{SourceTriangle, TargetTriangle};
use crate::tools::transfer::tally::Sums;

pub(in crate::tools::transfer) use live::LiveDevice;
pub use live::LiveFrame;

/// Texels of a chunk of rows at most.
const CHUNK: usize = 1 << 17;
/// Device memory that is left for uniforms and what else comes and goes with a band.
const SPARE: u64 = 4 << 20;

/// What a transfer works on, beside the map.
pub(in crate::tools::transfer) struct Work<'p> {
    pub(in crate::tools::transfer) size: [usize; 2],
    /// Rows of a band.
    pub(in crate::tools::transfer) band: usize,
    /// Tables of the source.
    pub(in crate::tools::transfer) lookups: Vec<&'p [SourceTriangle]>,
    pub(in crate::tools::transfer) target: &'p [TargetTriangle],
    /// Of each triangle of the source whether some layer has a colour there.
    pub(in crate::tools::transfer) colored: Vec<bool>,
    /// Whether the host looks at texels and images, too.
    pub(in crate::tools::transfer) mirrored: bool,
    /// Lists of all runs that there is room for: one, or more where parts are done anew.
    pub(in crate::tools::transfer) lists: usize,
}

/// A transfer on a device.
pub(in crate::tools::transfer) struct Resident<'a, 'm> {
    gpu: &'a Gpu,
    map: &'m dyn ResidentMap,
    rasterizer: Rasterizer<'a>,
    rows: Rows,
    runs: Runs,
    stage: Box<dyn MapStage>,
    exchange: Exchange<'a>,
    /// By tables of the source; none where no layer on the device has it.
    footprints: Vec<Option<Footprints>>,
    pictures: Vec<Picture<'a>>,
    tally: DeviceTally,
    of_covers: Staging<'a, u32>,
    of_sums: Staging<'a, Sums>,
    mirror: Option<Mirror<'a>>,
    whole: Option<Padder<'a>>,
    margin: u32,
    /// What was submitted last.
    last: Option<Submission>,
    /// Rows that were rasterised last, and rows whose pictures are under way.
    begun: Range<usize>,
    under_way: Option<Range<usize>>,
    // Counted against the memory budget as long as bind groups refer to them.
    _buffers: (Buffer<PointRecord>, Chunk, Table),
}

/// Texels and images as the host sees them.
struct Mirror<'a> {
    texels: Staging<'a, AtlasTexel>,
    images: Staging<'a, PackedImage>,
}

/// Texels and images of rows, on the host.
pub(in crate::tools::transfer) struct Seen {
    pub(in crate::tools::transfer) rows: Range<usize>,
    pub(in crate::tools::transfer) texels: Vec<AtlasTexel>,
    pub(in crate::tools::transfer) images: Vec<PackedImage>,
}

impl<'a, 'm> Resident<'a, 'm> {
    /// Buffers on the device of `map`. Whole pictures stay there if they are to be padded and the
    /// host does not look at them before; where they do not fit, an error says so.
    ///
    /// # Errors
    /// [`Error::Memory`], [`Error::Capability`] or [`Error::Device`].
    pub(in crate::tools::transfer) fn new(
        gpu: &'a Gpu,
        map: &'m dyn ResidentMap,
        work: &Work<'_>,
        plates: Vec<Plate<'_>>,
        atlas: &Atlas,
        options: &TransferOptions,
        whole: bool,
    ) -> Result<Self> {
        let [width, height] = work.size;
        let rows = Rows::new(gpu, work.size, (work.band + 2).min(height))?;
        let points = gpu.buffer("points", CHUNK)?;
        let runs = Runs::new(gpu, &rows, &points, work.lists)?;
        let stage = map.bind(points.bind(), &rows.images, Doubts::NONE)?;
        let chunk = chunk_rows(width).min(work.band);
        let buffers = Chunk::new(gpu, chunk, width)?;
        let target = gpu.table("target triangles", work.target)?;
        let used = |lookup: usize| plates.iter().any(|p| p.lookup == lookup);
        let table = |(k, source): (usize, &&[SourceTriangle])| {
            used(k).then(|| Footprints::new(gpu, &rows, &runs, source, &target, &buffers)).transpose()
        };
        let by_lookup = work.lookups.iter().enumerate().map(table).collect::<Result<Vec<_>>>()?;
        let texels = width * if whole { height } else { work.band };
        let picture = |plate: Plate<'_>| Picture::new(gpu, &plate, (texels, width), &runs, &buffers, options);
        let mirror = |kept: usize| -> Result<Mirror<'a>> {
            let texels = kept * width;
            Ok(Mirror { texels: Staging::new(gpu, "texels", texels)?, images: Staging::new(gpu, "images", texels)? })
        };
        let padder = || -> Result<Padder<'a>> {
            Padder::of(gpu, gpu.buffer("coverage", Padder::words(work.size))?, work.size, options.margin)
        };
        let tally = DeviceTally::new(gpu, &rows, &target, &work.colored)?;
        let made = Self {
            gpu,
            map,
            rasterizer: Rasterizer::new(gpu, &atlas.triangles, 1)?,
            stage,
            exchange: Exchange::new(gpu, &rows, &points)?,
            footprints: by_lookup,
            pictures: plates.into_iter().map(picture).collect::<Result<_>>()?,
            of_covers: Staging::new(gpu, "coverage", tally.covers.len())?,
            of_sums: Staging::new(gpu, "sums", tally.sums.len())?,
            tally,
            mirror: work.mirrored.then(|| mirror(rows.kept)).transpose()?,
            whole: whole.then(padder).transpose()?,
            margin: options.margin,
            rows,
            runs,
            last: None,
            begun: 0..0,
            under_way: None,
            _buffers: (points, buffers, target),
        };
        // Bins of a band, or its texels where the host rasterises them, come and go.
        let spare = (work.band * width * size_of::<AtlasTexel>()) as u64 + SPARE;
        let required = gpu.memory_held().saturating_add(spare);
        if required > gpu.memory_allowed() {
            let what = "a band of a transfer on the device".into();
            return Err(Error::Memory { what, required, allowed: gpu.memory_allowed() });
        }
        Ok(made)
    }

    /// Bytes on the device, and of the host's copies on the way, beside those of bands: of the
    /// map's tiles, of chunks, and of whole pictures with `words` words a texel in all.
    pub(in crate::tools::transfer) fn bytes(size: [usize; 2], words: usize, triangles: usize) -> u64 {
        let texels = (size[0] * size[1]) as u64;
        let chunk = size_of::<PointRecord>()
            + size_of::<LocatedRecord>()
            + size_of::<FootprintRecord>()
            + size_of::<[f32; 4]>();
        const TILE: u64 = 256;
        2 * texels * (4 * words as u64 + 1)
            + (CHUNK as u64) * (chunk as u64 + TILE)
            + 4 * (triangles * size_of::<TargetTriangle>()) as u64
    }

    /// Rasterises and maps the rows that come next, up to `end`.
    ///
    /// # Errors
    /// As [`Resident::new`].
    pub(in crate::tools::transfer) fn begin(
        &mut self,
        end: usize,
        atlas: &Atlas,
        most_entries: usize,
        watch: &mut Stopwatch,
    ) -> Result<()> {
        let width = self.rows.width;
        self.begun = self.begun.end..end;
        let pieces = self.rows.pieces(self.begun.clone());
        self.exchange.clear()?;
        let mut batch = self.gpu.batch()?;
        for piece in &pieces {
            let tile = Tile { x: 0, y: piece.start as u32, width: width as u32, height: piece.len() as u32 };
            let bins = Bins::new(&tile, atlas, most_entries)?;
            self.runs.mark(&bins);
            let place = self.rows.place(piece.start) * width;
            self.rasterizer.record(&mut batch, &tile, &bins, &atlas.triangles, &self.rows.texels, place)?;
        }
        batch.submit()?;
        watch.lap("rasterize_atlas");
        self.runs.list(self.gpu, end.saturating_sub(self.rows.kept)..end)?;
        let texels = self.runs.texels(&self.begun);
        let most = CHUNK.min(self.stage.capacity());
        for first in texels.clone().step_by(most) {
            let tile = first..(first + most).min(texels.end);
            let mut batch = self.gpu.batch()?;
            self.runs.points(&mut batch, &tile)?;
            self.stage.record(&mut batch, tile.len())?;
            self.exchange.gather(&mut batch, tile.len())?;
            batch.submit()?;
        }
        let mut batch = self.gpu.batch()?;
        self.exchange.record(&mut batch)?;
        if let Some(mirror) = &mut self.mirror {
            let places = places(&self.rows, &self.begun);
            mirror.texels.record(&mut batch, &self.rows.texels, &places)?;
            mirror.images.record(&mut batch, &self.rows.images, &places)?;
        }
        self.last = Some(batch.submit()?);
        watch.lap("map");
        Ok(())
    }

    /// Waits for what was begun, and finds the images of what the kernels left; they come with what
    /// the host sees of the rows, if it looks at them. Rows of pictures that were under way go into
    /// `images`.
    ///
    /// # Errors
    /// Those of the map, and [`Error::Device`].
    pub(in crate::tools::transfer) fn collect(
        &mut self,
        images: &mut [&mut Image],
        faces: usize,
    ) -> Result<(Vec<Found>, Option<Seen>)> {
        self.wait()?;
        self.take_rows(images)?;
        let places = places(&self.rows, &self.begun);
        let left = match self.exchange.take()? {
            Some(left) => left,
            None => self.all_left(&places)?,
        };
        let points: Vec<PackedPoint> = left.iter().map(|(_, point)| *point).collect();
        let mut found = Vec::new();
        if !points.is_empty() {
            self.map.finish(&points, &mut found)?;
        }
        if found.len() != points.len() {
            return Err(Error::numeric(
                format!("the map gave {} images for {} points", found.len(), points.len()),
                "This is a fault of the map",
            ));
        }
        let found: Vec<Found> = left
            .iter()
            .zip(&found)
            .map(|((place, _), image)| Found { place: *place, image: image.checked(faces) })
            .collect();
        let Some(mirror) = &mut self.mirror else { return Ok((found, None)) };
        let texels = mirror.texels.take(<[AtlasTexel]>::to_vec)?;
        let mut images = mirror.images.take(<[PackedImage]>::to_vec)?;
        // The kernels give images to texels that show something; other places hold what was there.
        for (_, image) in texels.iter().zip(&mut images).filter(|(t, _)| !t.is_covered()) {
            *image = PackedImage::NOWHERE;
        }
        let mut before = 0;
        for place in &places {
            for f in found.iter().filter(|f| place.contains(&(f.place as usize))) {
                images[before + f.place as usize - place.start] = f.image;
            }
            before += place.len();
        }
        Ok((found, Some(Seen { rows: self.begun.clone(), texels, images })))
    }

    /// Colours a band, whose rows and those around them were collected.
    ///
    /// # Errors
    /// [`Error::Memory`] or [`Error::Device`].
    pub(in crate::tools::transfer) fn color(
        &mut self,
        band: &Range<usize>,
        found: &[Found],
        watch: &mut Stopwatch,
    ) -> Result<()> {
        let width = self.rows.width;
        let mut batch = self.gpu.batch()?;
        self.exchange.place(&mut batch, &self.rows, found)?;
        self.tally.record(&mut batch, &self.rows, band)?;
        if self.whole.is_none() || band.start == 0 {
            self.pictures.iter().try_for_each(|p| p.clear(&mut batch))?;
        }
        self.last = Some(batch.submit()?);
        watch.lap("coverage");
        let origin = if self.whole.is_some() { 0 } else { band.start };
        for first in band.clone().step_by(chunk_rows(width)) {
            let chunk = first..(first + chunk_rows(width)).min(band.end);
            let texels = self.runs.texels(&chunk);
            for (lookup, footprints) in self.footprints.iter().enumerate() {
                let Some(footprints) = footprints else { continue };
                let mut batch = self.gpu.batch()?;
                footprints.record(&mut batch, &self.runs, self.rows.height, &chunk)?;
                self.last = Some(batch.submit()?);
                watch.lap("footprint");
                for picture in self.pictures.iter().filter(|p| p.lookup == lookup) {
                    self.last = Some(picture.submit(self.gpu, &texels, origin)?);
                    watch.lap("sample_texture");
                }
            }
        }
        if self.whole.is_none() {
            let texels = band.len() * width;
            let mut batch = self.gpu.batch()?;
            for picture in &mut self.pictures {
                let words = 0..texels * picture.format.words();
                picture.staging.record(&mut batch, &picture.words, &[words])?;
            }
            self.last = Some(batch.submit()?);
            self.under_way = Some(band.clone());
        }
        Ok(())
    }

    /// Ends the transfer: pads whole pictures, reads what is still on the device, and gives the
    /// coverage, row after row, and the sums of the runs. Coverage of padding is marked where
    /// pictures are padded here.
    ///
    /// # Errors
    /// [`Error::Memory`] or [`Error::Device`].
    pub(in crate::tools::transfer) fn finish(
        &mut self,
        images: &mut [&mut Image],
        covers: &mut [u8],
        watch: &mut Stopwatch,
    ) -> Result<Vec<Sums>> {
        let (width, height) = (self.rows.width, self.rows.height);
        if let Some(padder) = self.whole.as_ref().filter(|_| self.margin > 0) {
            let mut batch = self.gpu.batch()?;
            record_bits(self.gpu, &mut batch, &self.tally.covers, [width, height], padder.bits())?;
            batch.submit()?;
            let pictures: Vec<_> = self.pictures.iter().map(|p| (&p.words, p.format.words())).collect();
            submit_padding(self.gpu, padder, &self.tally.covers, &pictures)?;
            watch.lap("pad_seams");
        }
        let mut batch = self.gpu.batch()?;
        self.of_covers.record_all(&mut batch, &self.tally.covers)?;
        self.of_sums.record_all(&mut batch, &self.tally.sums)?;
        if self.whole.is_some() {
            for picture in &mut self.pictures {
                picture.staging.record_all(&mut batch, &picture.words)?;
            }
            self.under_way = Some(0..height);
        }
        self.last = Some(batch.submit()?);
        self.wait()?;
        self.take_rows(images)?;
        let stride = width.div_ceil(4);
        self.of_covers.take(|words| {
            for (row, words) in covers.chunks_exact_mut(width).zip(words.chunks_exact(stride)) {
                row.copy_from_slice(&bytemuck::cast_slice::<u32, u8>(words)[..width]);
            }
        })?;
        let sums = self.of_sums.take(<[Sums]>::to_vec)?;
        watch.lap("read");
        Ok(sums)
    }

    /// Whether pictures and coverage were padded.
    pub(in crate::tools::transfer) fn pads(&self) -> bool {
        self.whole.is_some()
    }

    fn wait(&mut self) -> Result<()> {
        self.last.take().map_or(Ok(()), |last| self.gpu.wait(&last))
    }

    /// All points that were left, where they are more than the list holds.
    fn all_left(&self, places: &[Range<usize>]) -> Result<Vec<(u32, PackedPoint)>> {
        let mut left = Vec::new();
        for place in places {
            let texels = self.gpu.read(&self.rows.texels, place.clone())?;
            let images = self.gpu.read(&self.rows.images, place.clone())?;
            let both = (place.start as u32..).zip(texels.iter().zip(&images));
            left.extend(
                both.filter(|(_, (t, i))| t.is_covered() && i.status == PackedImage::LEFT)
                    .map(|(p, (t, _))| (p, t.point())),
            );
        }
        left.sort_unstable_by_key(|(place, _)| *place);
        Ok(left)
    }

    /// Takes the rows of pictures that are under way, after they were waited for.
    fn take_rows(&mut self, images: &mut [&mut Image]) -> Result<()> {
        let Some(rows) = self.under_way.take() else { return Ok(()) };
        for (picture, image) in self.pictures.iter_mut().zip(images) {
            let (format, first) = (picture.format, rows.start * self.rows.width);
            picture.staging.take(|words| format.unpack(words, image, first))?;
        }
        Ok(())
    }
}

/// Places of some rows.
fn places(rows: &Rows, some: &Range<usize>) -> Vec<Range<usize>> {
    let place = |piece: Range<usize>| {
        let first = rows.place(piece.start);
        first * rows.width..(first + piece.len()) * rows.width
    };
    rows.pieces(some.clone()).into_iter().map(place).collect()
}

/// Rows of a chunk.
fn chunk_rows(width: usize) -> usize {
    (CHUNK / width.max(1)).max(1)
}
