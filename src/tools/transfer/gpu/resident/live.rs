//! Parts of a transfer that stays on a device, done anew: what an edit of the map needs.

use std::collections::BTreeSet;
use std::ops::Range;

use super::{CHUNK, Resident, chunk_rows};
use crate::engine::{Batch, Buffer, Canvas, Gpu, Table};
use crate::error::{Error, Result};
use crate::picture::Image;
use crate::surface::{MapStage, PackedPoint, ResidentMap};
use crate::tools::transfer::atlas::AtlasTexel;
use crate::tools::transfer::gpu::Items;
use crate::tools::transfer::gpu::exchange::{Exchange, Found};
use crate::tools::transfer::gpu::locate::{Chunk, Footprints};
use crate::tools::transfer::gpu::pad_seams::Padder;
use crate::tools::transfer::gpu::padding_parts::PaddingParts;
use crate::tools::transfer::gpu::picture::Picture;
use crate::tools::transfer::gpu::runs::{COLUMN_BITS, PointRecord, RUN, Runs};
use crate::tools::transfer::gpu::shown::Shown;
use crate::tools::transfer::gpu::tally::DeviceTally;
use crate::tools::transfer::gpu::window::Rows;

/// Chunks of rows that are coloured in a frame at most: as many different dispatches as a bind
/// group may have in a batch, but for one.
const CHUNKS: usize = 15;

/// What a frame did of the work that edits left.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LiveFrame {
    /// Texels that were mapped again.
    pub mapped: usize,
    /// Texels that were coloured again.
    pub recolored: usize,
    /// Texels that wait for the next frame to be mapped or coloured, and points that kernels left
    /// and the host has not finished; with 0 the picture is that of the map.
    pub left: usize,
    /// Rows of the pictures that may have changed.
    pub rows: Range<usize>,
}

/// A transfer on a device, parts of which are done anew.
pub(in crate::tools::transfer) struct LiveDevice<'a> {
    gpu: &'a Gpu,
    rows: Rows,
    runs: Runs,
    stage: Box<dyn MapStage>,
    exchange: Exchange<'a>,
    footprints: Footprints,
    pictures: Vec<Picture<'a>>,
    shown: Vec<Shown>,
    tally: DeviceTally,
    padder: Option<(Padder<'a>, PaddingParts)>,
    margin: usize,
    faces: usize,
    /// Runs, as words of the list, that are to be mapped, and to be coloured.
    to_map: BTreeSet<u32>,
    to_color: BTreeSet<u32>,
    /// Whether a list of points that were left is on its way.
    under_way: bool,
    // Counted against the memory budget as long as bind groups refer to them.
    _buffers: (Buffer<PointRecord>, Chunk, Table),
}

impl<'a> LiveDevice<'a> {
    /// What `resident`, whose only band was coloured, holds; and what its texels show. `faces` are
    /// the triangles of the source, `backgrounds` a texel of each picture.
    ///
    /// # Errors
    /// [`Error::Memory`], [`Error::Capability`] or [`Error::Device`].
    pub(in crate::tools::transfer) fn new(
        resident: Resident<'a, '_>,
        backgrounds: &[Image],
        faces: usize,
    ) -> Result<(Self, Vec<AtlasTexel>)> {
        let Resident {
            gpu, rows, runs, stage, exchange, mut footprints, pictures, tally, whole, margin, _buffers, ..
        } = resident;
        let missing = || Error::input("no layer has a picture", "Give a layer with pictures");
        let footprints = footprints.pop().flatten().ok_or_else(missing)?;
        let size = [rows.width, rows.height];
        let shown = pictures.iter().zip(backgrounds).map(|(picture, background)| {
            Shown::new(gpu, picture.format, background, size, (&tally.covers, &picture.words))
        });
        let shown = shown.collect::<Result<_>>()?;
        let padder = match whole.filter(|_| margin > 0) {
            None => None,
            Some(padder) => {
                let words: Vec<_> = pictures.iter().map(|p| (&p.words, p.format.words())).collect();
                let parts = PaddingParts::new(gpu, &padder, &tally.covers, &words)?;
                Some((padder, parts))
            }
        };
        let texels = gpu.read(&rows.texels, 0..rows.texels.len())?;
        let live = Self {
            gpu,
            rows,
            runs,
            stage,
            exchange,
            footprints,
            pictures,
            shown,
            tally,
            padder,
            margin: margin as usize,
            faces,
            to_map: BTreeSet::new(),
            to_color: BTreeSet::new(),
            under_way: false,
            _buffers,
        };
        let mut batch = gpu.batch()?;
        live.finish_rows(&mut batch, &(0..size[1]))?;
        batch.submit()?;
        Ok((live, texels))
    }

    /// These texels are to be mapped again.
    pub(in crate::tools::transfer) fn map_again(&mut self, texels: impl Iterator<Item = u32>) {
        let width = self.rows.width as u32;
        self.to_map.extend(texels.map(|i| run(i / width, i % width)));
    }

    /// Records as much of the work as `budget` texels allow. `map` finishes points that the kernels
    /// of earlier frames left.
    ///
    /// # Errors
    /// Those of the map, and [`Error::Device`].
    pub(in crate::tools::transfer) fn record(
        &mut self,
        map: &dyn ResidentMap,
        batch: &mut Batch<'_>,
        budget: usize,
    ) -> Result<LiveFrame> {
        let most = budget.min(CHUNK).min(self.stage.capacity()) / RUN;
        self.take_left(map, batch)?;
        let mapped: Vec<u32> = match self.under_way {
            true => Vec::new(),
            false => take(&mut self.to_map, most.max(1), usize::MAX),
        };
        self.to_color.extend(self.around(&mapped));
        self.to_color.extend(&mapped);
        let rows = CHUNKS * chunk_rows(self.rows.width);
        let colored = take(&mut self.to_color, CHUNK / RUN, rows);
        let mut located: BTreeSet<u32> = self.around(&colored).collect();
        located.extend(&colored);
        let located: Vec<u32> = located.into_iter().collect();
        let words = [mapped.as_slice(), &colored, &located].concat();
        self.gpu.write(&self.runs.list, 0, &words)?;
        if !mapped.is_empty() {
            let count = mapped.len() * RUN;
            self.exchange.clear()?;
            self.runs.points(batch, &(0..count))?;
            self.stage.record(batch, count)?;
            self.exchange.gather(batch, count)?;
            self.exchange.record(batch)?;
            self.under_way = true;
        }
        let changed = self.record_colors(batch, &colored, mapped.len(), &located)?;
        let waiting = self.to_map.len() + self.to_color.len();
        Ok(LiveFrame {
            mapped: mapped.len() * RUN,
            recolored: colored.len() * RUN,
            left: waiting * RUN + usize::from(self.under_way),
            rows: changed,
        })
    }

    /// Pictures as they are shown.
    pub(in crate::tools::transfer) fn canvases(&self) -> impl ExactSizeIterator<Item = &Canvas> {
        self.shown.iter().map(|s| &s.canvas)
    }

    /// Reads the pictures into `images`, and the coverage.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub(in crate::tools::transfer) fn read(&self, images: &mut [Image]) -> Result<Vec<u8>> {
        for (picture, image) in self.pictures.iter().zip(images) {
            let words = self.gpu.read(&picture.words, 0..picture.words.len())?;
            picture.format.unpack(&words, image, 0);
        }
        let words = self.gpu.read(&self.tally.covers, 0..self.tally.covers.len())?;
        let rows = words.chunks_exact(self.rows.width.div_ceil(4));
        Ok(rows.flat_map(|w| &bytemuck::cast_slice::<u32, u8>(w)[..self.rows.width]).copied().collect())
    }

    /// Points that kernels left and whose list has arrived get the images of the map.
    fn take_left(&mut self, map: &dyn ResidentMap, batch: &mut Batch<'_>) -> Result<()> {
        if !self.under_way {
            return Ok(());
        }
        let Some(left) = self.exchange.poll()? else { return Ok(()) };
        self.under_way = false;
        let points: Vec<PackedPoint> = left.iter().map(|(_, point)| *point).collect();
        let mut images = Vec::new();
        if !points.is_empty() {
            map.finish(&points, &mut images)?;
        }
        if images.len() != points.len() {
            return Err(Error::numeric(
                format!("the map gave {} images for {} points", images.len(), points.len()),
                "This is a fault of the map",
            ));
        }
        let placed = left.iter().zip(&images);
        let found: Vec<Found> =
            placed.map(|((place, _), image)| Found { place: *place, image: image.checked(self.faces) }).collect();
        self.exchange.place(batch, &self.rows, &found)?;
        // All rows are kept, so that a place is a texel.
        let width = self.rows.width as u32;
        let runs: Vec<u32> = left.iter().map(|(place, _)| run(place / width, place % width)).collect();
        self.to_color.extend(self.around(&runs));
        self.to_color.extend(&runs);
        Ok(())
    }

    /// The runs on all four sides of some.
    fn around<'r>(&self, runs: &'r [u32]) -> impl Iterator<Item = u32> + use<'r> {
        let (columns, height) = (self.rows.width.div_ceil(RUN) as u32, self.rows.height as u32);
        runs.iter().flat_map(move |word| {
            let (x, y) = (word & ((1 << COLUMN_BITS) - 1), word >> COLUMN_BITS);
            [
                (x > 0).then(|| word - 1),
                (x + 1 < columns).then(|| word + 1),
                (y > 0).then(|| word - (1 << COLUMN_BITS)),
                (y + 1 < height).then(|| word + (1 << COLUMN_BITS)),
            ]
            .into_iter()
            .flatten()
        })
    }

    /// Colours runs, which stand in the list after `before` others; those located follow them.
    fn record_colors(
        &self,
        batch: &mut Batch<'_>,
        colored: &[u32],
        before: usize,
        located: &[u32],
    ) -> Result<Range<usize>> {
        let (Some(first), Some(last)) = (colored.first(), colored.last()) else { return Ok(0..0) };
        let (first, end) = (row(*first), row(*last) + 1);
        let around = first.saturating_sub(self.margin)..(end + self.margin).min(self.rows.height);
        self.tally.record(batch, &self.rows, &around)?;
        let step = chunk_rows(self.rows.width);
        for start in (first..end).step_by(step) {
            let chunk = start..(start + step).min(end);
            let near = chunk.start.saturating_sub(1)..chunk.end + 1;
            let texels = listed(colored, &chunk, before);
            let seen = listed(located, &near, before + colored.len());
            if texels.is_empty() {
                continue;
            }
            self.footprints.record_listed(batch, &seen, &texels, near.start)?;
            for picture in &self.pictures {
                picture.record(batch, &texels, 0)?;
            }
        }
        self.finish_rows(batch, &around)
    }

    /// Background, padding and canvas of rows whose texels were coloured and tallied; rows around
    /// those that changed are among them.
    fn finish_rows(&self, batch: &mut Batch<'_>, rows: &Range<usize>) -> Result<Range<usize>> {
        self.shown.iter().try_for_each(|s| s.record_blank(batch, rows))?;
        let all = match &self.padder {
            Some((padder, parts)) => parts.record(batch, padder, rows)?,
            None => rows.clone(),
        };
        self.shown.iter().try_for_each(|s| s.record_show(batch, &all))?;
        Ok(all)
    }
}

/// The word of the run with a texel.
fn run(y: u32, x: u32) -> u32 {
    (y << COLUMN_BITS) | (x / RUN as u32)
}

fn row(word: u32) -> usize {
    (word >> COLUMN_BITS) as usize
}

/// Takes up to `most` words from `queue`, of no more than `rows` rows.
fn take(queue: &mut BTreeSet<u32>, most: usize, rows: usize) -> Vec<u32> {
    let Some(first) = queue.first().copied() else { return Vec::new() };
    let end = row(first).saturating_add(rows);
    let taken: Vec<u32> = queue.iter().copied().take(most).take_while(|w| row(*w) < end).collect();
    if let Some(last) = taken.last() {
        *queue = queue.split_off(&(last + 1));
    }
    taken
}

/// Items of the runs in `rows`, which rise; `before` runs stand before them in the list.
fn listed(runs: &[u32], rows: &Range<usize>, before: usize) -> Items {
    let first = runs.partition_point(|w| row(*w) < rows.start);
    let end = runs.partition_point(|w| row(*w) < rows.end);
    (before + first) * RUN..(before + end) * RUN
}
