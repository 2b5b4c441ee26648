//! The whole picture, band after band.

use std::cell::OnceCell;

use super::band::Band;
use super::footprint::Footprints;
use super::gpu::pixels::{Finish, PixelCounts};
use super::gpu::{self, resident};
use super::placement::Placement;
use super::pyramid::{Pyramid, Texel};
use super::sight::{Sight, Squares};
use super::store::{Colors, Outside, gather_and_store, store};
use crate::control;
use crate::engine::Engine;
use crate::error::{Error, Result};
use crate::mapping::plane::{CompositeMap, Found};
use crate::picture::Filter;
use crate::picture::Image;
use crate::progress::Progress;
use crate::tools::stopwatch::{StageTime, Stopwatch};
use crate::tools::transfer::Encoding;

/// Pixels of a band, unless a single row has more.
const BAND_PIXELS: usize = 1 << 18;
/// Bytes that a pixel of a band takes meanwhile, its part of the inverse map included.
const BYTES_PER_PIXEL: u64 = 400;
/// Most evaluations of the map for the squares of the picture that the exact pre-images come from.
pub(super) const NODES: usize = 1 << 20;
/// Largest side of a canvas.
pub const LARGEST_SIDE: u32 = 1 << 20;

/// How a picture is warped.
#[derive(Clone, Debug, PartialEq)]
pub struct WarpOptions {
    /// How colours are taken from the picture.
    pub filter: Filter,
    /// What is shown outside the target cage.
    pub outside: Outside,
    /// How samples become values to average.
    pub encoding: Encoding,
    /// Columns and rows of the result; those of the picture if `None`.
    pub canvas: Option<[u32; 2]>,
    /// How the picture lies in the units of the map's source.
    pub source: Placement,
    /// How the canvas lies in the units of the map's target.
    pub target: Placement,
    /// Whether the Jacobian at every pixel is wanted.
    pub jacobian: bool,
    /// Bytes that picture, result and working memory may take.
    pub memory: u64,
}

impl Default for WarpOptions {
    fn default() -> Self {
        Self {
            filter: Filter::Ewa,
            outside: Outside::default(),
            encoding: Encoding::default(),
            canvas: None,
            source: Placement::pixels(),
            target: Placement::pixels(),
            jacobian: false,
            memory: 4 << 30,
        }
    }
}

/// What came of a warp.
#[derive(Clone, Debug)]
pub struct WarpOutput {
    /// The warped picture: depth and channels of the original, and alpha if that was asked for.
    pub image: Image,
    /// The Jacobian of the map at the pre-image of every pixel, in pixels; NaN where there is none.
    /// Row by row, if asked for.
    pub jacobian: Option<Vec<f32>>,
    /// Counts and times.
    pub stats: WarpStats,
}

/// What happened to the pixels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WarpStats {
    /// Pixels of the canvas.
    pub pixels: u64,
    /// Pixels whose pre-image was found.
    pub mapped: u64,
    /// Pixels inside the target cage whose pre-image was not found: 0 where the map does not fold.
    pub failed_inside: u64,
    /// The same outside the cage, where the map may fold.
    pub failed_outside: u64,
    /// Pixels that the map is to colour, but that see nothing of the picture.
    pub empty: u64,
    /// Whether picture and pixels stayed on a device from stage to stage.
    pub resident: bool,
    /// How often the whole map was evaluated in double precision.
    pub evaluations: Evaluations,
    /// Bytes planned for.
    pub memory: u64,
    /// Time by stage.
    pub stages: Vec<StageTime>,
}

/// Evaluations of a whole map, in double precision where nothing else is said.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Evaluations {
    /// For the squares of the picture whose polynomials give the pre-images of most pixels: one for
    /// each where single precision is enough for the rest.
    pub squares: u64,
    /// For the squares in single precision.
    pub single: u64,
    /// For pixels that no polynomial is bounded at: one for each.
    pub pixels: u64,
    /// Pixels, of those, that one was not enough for; they take ten or so.
    pub refined: u64,
}

/// Warps `image` by `map`: every pixel of the canvas gets the colour of its exact pre-image.
///
/// Pre-images come from [`Patches`](crate::mapping::plane::Patches) of the picture, whose error is
/// bounded, and from Newton's method on the map itself at the few pixels where it is not. The
/// result is the same for any number of threads. O(pixels + squares x steps x vertices); there are
/// some thousand squares, more where the cage has many vertices.
///
/// # Errors
/// [`Error::Option`] for a canvas without pixels or too large; [`Error::Memory`]; [`Error::Input`]
/// for a picture whose samples do not fit its size; what the map's device returns.
pub fn warp_picture(
    engine: &Engine,
    image: &Image,
    map: &CompositeMap,
    options: &WarpOptions,
    progress: &dyn Progress,
) -> Result<WarpOutput> {
    let ([width, height], memory) = prepared(image, options)?;
    image.check("picture")?;
    let watch = Stopwatch::on(engine);
    let sight = Sight { engine, map, options, picture: [image.width, image.height], canvas: [width, height] };
    let squares = sight.squares()?;
    let alpha = options.outside == Outside::Transparent && !image.has_alpha();
    let out = Image::zeros(width, height, image.channels + u32::from(alpha), image.depth())?;
    let jacobian = options.jacobian.then(|| vec![f32::NAN; width as usize * height as usize]);
    let mut stats = WarpStats { pixels: u64::from(width) * u64::from(height), memory, ..WarpStats::default() };
    let evaluated = squares.as_ref().map(Squares::evaluations).unwrap_or_default();
    (stats.evaluations.squares, stats.evaluations.single) = (evaluated.exact as u64, evaluated.cheap as u64);
    progress.stage("pixels", stats.pixels);
    let pyramid = OnceCell::new();
    let mut job = Job {
        engine,
        image,
        sight,
        squares: squares.as_ref(),
        pyramid,
        watch,
        work: Work::default(),
        out,
        jacobian,
        stats,
        progress,
    };
    job.watch.lap("lattice");
    if !job.on_device()? {
        job.in_bands()?;
    }
    job.stats.stages = job.watch.stages().to_vec();
    Ok(WarpOutput { image: job.out, jacobian: job.jacobian, stats: job.stats })
}

/// The size of the canvas, and the bytes that the work takes.
///
/// # Errors
/// [`Error::Option`] for a canvas without pixels or too large; [`Error::Memory`].
pub(super) fn prepared(image: &Image, options: &WarpOptions) -> Result<([u32; 2], u64)> {
    let canvas = options.canvas.unwrap_or([image.width, image.height]);
    for (name, side) in ["width", "height"].into_iter().zip(canvas) {
        if side == 0 || side > LARGEST_SIDE {
            return Err(Error::option("canvas", format!("{name} {side}"), format!("Give 1 to {LARGEST_SIDE}")));
        }
    }
    Ok((canvas, check_memory(image, canvas, options)?))
}

/// The bands of a canvas from the top down.
pub(super) fn bands(width: u32, height: u32) -> impl Iterator<Item = Band> {
    let (width, height) = (width as usize, height as usize);
    let rows = (BAND_PIXELS / width).clamp(1, height);
    (0..height).step_by(rows).map(move |first| Band { first, rows: rows.min(height - first), width })
}

/// Buffers of a band, kept to be reused.
#[derive(Default)]
pub(super) struct Work {
    /// Share of each pixel in the cage, row by row; empty where everything is shown.
    pub(super) cover: Vec<f32>,
    /// The square that each pixel lies in, row by row.
    pub(super) found: Found,
    /// Row by row; empty if not asked for.
    pub(super) jacobian: Vec<f32>,
    /// Block by block, as the next two.
    pub(super) seen: Footprints,
    pub(super) colors: Vec<Texel>,
    pub(super) bases: Vec<[i32; 2]>,
}

/// The warp of one picture.
struct Job<'a> {
    engine: &'a Engine,
    image: &'a Image,
    sight: Sight<'a>,
    squares: Option<&'a Squares>,
    /// Made where the host needs it.
    pyramid: OnceCell<Pyramid<'a>>,
    watch: Stopwatch,
    work: Work,
    out: Image,
    jacobian: Option<Vec<f32>>,
    stats: WarpStats,
    progress: &'a dyn Progress,
}

impl Job<'_> {
    /// All bands of `rows` rows.
    fn bands(&self, rows: usize) -> impl Iterator<Item = Band> + use<> {
        let [width, height] = self.sight.canvas.map(|n| n as usize);
        (0..height).step_by(rows).map(move |first| Band { first, rows: rows.min(height - first), width })
    }

    /// The whole warp on a device from stage to stage; `false`, with nothing done, where there is
    /// none that has all stages, or something does not fit there.
    fn on_device(&mut self) -> Result<bool> {
        let options = self.sight.options;
        let device = resident::device(self.engine, options.filter);
        let device = device.filter(|_| self.jacobian.is_none() && self.sight.suits_device());
        let (Some(gpu), Some(squares)) = (device, self.squares) else { return Ok(false) };
        let finish = Finish {
            filter: options.filter,
            encoding: options.encoding,
            channels: self.out.channels,
            keeps: options.outside == Outside::Keep,
        };
        let work = resident::Work {
            image: self.image,
            patches: squares.patches(),
            canvas: self.sight.canvas,
            caged: options.outside != Outside::Map,
            finish,
        };
        let Some(mut resident) = resident::Resident::new(gpu, &work, &mut self.watch)? else { return Ok(false) };
        self.stats.resident = true;
        // A band with what the host did for it, which counts when the band is done.
        let mut before: Option<(Band, WarpStats)> = None;
        for band in self.bands(resident.rows()) {
            control::check()?;
            let mut own = WarpStats::default();
            let left = self.sight.left(band, squares, &mut self.work, &mut own)?;
            self.watch.lap("preimages");
            let counts = resident.begin(band, &self.work.cover, &left, &mut self.out)?;
            self.watch.lap("filter");
            if let Some(((band, own), counts)) = before.replace((band, own)).zip(counts) {
                self.settle(band, &own, &counts)?;
            }
        }
        if let Some(((band, own), counts)) = before.zip(resident.end(&mut self.out)?) {
            self.watch.lap("filter");
            self.settle(band, &own, &counts)?;
        }
        Ok(true)
    }

    /// Takes over what became of a band on a device. Where it has pixels without a pre-image that
    /// the host has not tried, the host does the band again.
    fn settle(&mut self, band: Band, own: &WarpStats, counts: &PixelCounts) -> Result<()> {
        let stats = &mut self.stats;
        stats.evaluations.pixels += own.evaluations.pixels;
        stats.evaluations.refined += own.evaluations.refined;
        let tried = own.failed_inside + own.failed_outside;
        if self.squares.is_some_and(Squares::hold_all) && counts.lost > tried {
            return self.band(band);
        }
        stats.mapped += counts.mapped;
        stats.empty += counts.empty;
        stats.failed_inside += own.failed_inside;
        stats.failed_outside += own.failed_outside;
        self.progress.advance(band.len() as u64);
        Ok(())
    }

    /// The whole warp with pre-images by the host.
    fn in_bands(&mut self) -> Result<()> {
        let [width, height] = self.sight.canvas;
        for band in bands(width, height) {
            control::check()?;
            self.band(band)?;
        }
        Ok(())
    }

    /// One band with pre-images by the host.
    fn band(&mut self, band: Band) -> Result<()> {
        self.sight.preimages(band, self.squares, &mut self.work, &mut self.stats)?;
        self.watch.lap("preimages");
        if let Some(jacobian) = &mut self.jacobian {
            jacobian[band.first * band.width..][..band.len()].copy_from_slice(&self.work.jacobian);
        }
        self.colors(band)?;
        self.watch.lap("filter");
        self.progress.advance(band.len() as u64);
        Ok(())
    }

    /// The colours of a band into the output, gathered on the device if the engine has one for this
    /// stage.
    fn colors(&mut self, band: Band) -> Result<()> {
        let options = self.sight.options;
        let pyramid = match self.pyramid.get() {
            Some(made) => made,
            None => {
                let made = Pyramid::new(self.image, options.encoding)?;
                self.watch.lap("pyramid");
                self.pyramid.get_or_init(|| made)
            }
        };
        let Work { bases, seen, colors, cover, .. } = &mut self.work;
        let seen = seen.seen();
        let keep = (options.outside == Outside::Keep).then_some(cover.as_slice());
        let pixels = Colors { band, seen, keep };
        if let Some(gpu) = self.engine.gpu_for("warp_image") {
            colors.clear();
            colors.resize(band.len(), [0.0; 4]);
            if gpu::warp_image(gpu, pyramid, options.filter, band, bases, seen, colors)? {
                store(pyramid, colors, &pixels, &mut self.out);
                return Ok(());
            }
        }
        gather_and_store(pyramid, options.filter, bases, &pixels, &mut self.out);
        Ok(())
    }
}

/// Bytes needed beside the program.
fn check_memory(image: &Image, [width, height]: [u32; 2], options: &WarpOptions) -> Result<u64> {
    let pixels = u64::from(width) * u64::from(height);
    let band = (BAND_PIXELS as u64).max(u64::from(width)).min(pixels);
    let picture = image.pixels.len() as u64 * image.depth().bytes() as u64;
    let result = pixels * u64::from(image.channels + 1) * image.depth().bytes() as u64;
    let heat = if options.jacobian { 4 * pixels } else { 0 };
    let lattice = 200 * (NODES as u64).min(1024 + u64::from(image.width) * u64::from(image.height) / 16);
    let required =
        picture + result + heat + lattice + band * BYTES_PER_PIXEL + Pyramid::bytes(image.width, image.height);
    if required > options.memory {
        let what = format!("warping {} x {} to {width} x {height} pixels", image.width, image.height);
        return Err(Error::Memory { what, required, allowed: options.memory });
    }
    Ok(required)
}

#[cfg(test)]
#[path = "driver_tests.rs"]
mod tests;
