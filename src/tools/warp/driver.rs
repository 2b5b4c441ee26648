//! The whole picture, band after band.

use glam::{DVec2, UVec2};

use super::band::Band;
use super::cover::pixel_cover;
use super::filter::Filter;
use super::footprint::{Footprint, Footprints};
use super::gpu;
use super::placement::Placement;
use super::pyramid::{Pyramid, Texel};
use super::store::{Colors, Outside, gather_and_store, store};
use crate::engine::Engine;
use crate::error::{Error, Result};
use crate::mapping::plane::{CompositeMap, Lattice, LatticeOptions, Mapped, Preimages};
use crate::progress::Progress;
use crate::raster::Image;
use crate::tools::stopwatch::{StageTime, Stopwatch};
use crate::tools::transfer::Encoding;

/// Pixels of a band, unless a single row has more.
const BAND_PIXELS: usize = 1 << 18;
/// Bytes that a pixel of a band takes meanwhile, its part of the inverse map included.
const BYTES_PER_PIXEL: u64 = 400;
/// Nodes of the lattice that the exact pre-images start from.
const NODES: usize = 1 << 20;
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
            filter: Filter::default(),
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
    /// Bytes planned for.
    pub memory: u64,
    /// Time by stage.
    pub stages: Vec<StageTime>,
}

/// Warps `image` by `map`: every pixel of the canvas gets the colour of its exact pre-image.
///
/// Starts for the pre-images come from a lattice of the picture, mapped forward and rasterised. The
/// result is the same for any number of threads. O(pixels x steps x vertices).
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
    let [width, height] = options.canvas.unwrap_or([image.width, image.height]);
    for (name, side) in [("width", width), ("height", height)] {
        if side == 0 || side > LARGEST_SIDE {
            return Err(Error::option("canvas", format!("{name} {side}"), format!("Give 1 to {LARGEST_SIDE}")));
        }
    }
    let memory = check_memory(image, [width, height], options)?;
    let mut watch = Stopwatch::on(engine);
    let pyramid = Pyramid::new(image, options.encoding)?;
    watch.lap("pyramid");
    let job = Job { engine, image, map, options, pyramid };
    let lattice = job.lattice()?;
    watch.lap("lattice");
    let alpha = options.outside == Outside::Transparent && !image.has_alpha();
    let mut out = Image::zeros(width, height, image.channels + u32::from(alpha), image.depth())?;
    let mut jacobian = options.jacobian.then(|| vec![f32::NAN; width as usize * height as usize]);
    let mut stats = WarpStats { pixels: u64::from(width) * u64::from(height), memory, ..WarpStats::default() };
    let mut work = Work::default();
    progress.stage("pixels", stats.pixels);
    let rows = (BAND_PIXELS / width as usize).clamp(1, height as usize);
    for first in (0..height as usize).step_by(rows) {
        let band = Band { first, rows: rows.min(height as usize - first), width: width as usize };
        job.preimages(band, lattice.as_ref(), &mut work, &mut stats)?;
        watch.lap("preimages");
        if let Some(jacobian) = &mut jacobian {
            for y in 0..band.rows {
                let row = &mut jacobian[(first + y) * band.width..][..band.width];
                row.iter_mut().enumerate().for_each(|(x, j)| *j = work.jacobian[band.index(x, y)]);
            }
        }
        job.colors(band, &mut work, &mut out)?;
        watch.lap("filter");
        progress.advance(band.len() as u64);
    }
    stats.stages = watch.stages().to_vec();
    Ok(WarpOutput { image: out, jacobian, stats })
}

/// Buffers of a band, kept to be reused.
#[derive(Default)]
struct Work {
    /// Share of each pixel in the cage, row by row; empty where everything is shown.
    cover: Vec<f32>,
    /// Block by block, as the next three.
    seen: Footprints,
    colors: Vec<Texel>,
    jacobian: Vec<f32>,
    bases: Vec<[i32; 2]>,
}

struct Job<'a> {
    engine: &'a Engine,
    image: &'a Image,
    map: &'a CompositeMap,
    options: &'a WarpOptions,
    pyramid: Pyramid<'a>,
}

/// The map sampled forward over the part of the picture that matters.
struct Starts {
    lattice: Lattice,
    /// Whether that part ends where the picture ends: then what it does not reach sees nothing of
    /// the picture.
    clipped: bool,
}

impl Job<'_> {
    /// `None` if no part of the picture matters.
    fn lattice(&self) -> Result<Option<Starts>> {
        let o = self.options;
        let size = DVec2::new(f64::from(self.image.width), f64::from(self.image.height));
        // A cell around the picture, for what is seen of its border.
        let cell = (size.x * size.y * 8.0 / NODES as f64).sqrt().max(16.0);
        let margin = DVec2::splat(cell);
        let (mut low, mut high, mut clipped) = (-margin, size + margin, true);
        if o.outside != Outside::Map {
            let loops = o.source.loops(self.map.source());
            let points = || loops.iter().flatten().copied();
            let (a, b) =
                (points().fold(low.max(high), DVec2::min) - margin, points().fold(low.min(high), DVec2::max) + margin);
            clipped = a.cmplt(low).any() || b.cmpgt(high).any();
            (low, high) = (low.max(a), high.min(b));
            if !low.cmplt(high).all() {
                return Ok(None);
            }
        }
        let cell = ((high - low).element_product() * 8.0 / NODES as f64).sqrt().max(cell.min(16.0));
        let options = LatticeOptions { cell, nodes: NODES, ..LatticeOptions::default() };
        let lattice = Lattice::new(low, high, &options, |points| {
            let units: Vec<DVec2> = points.iter().map(|p| o.source.to_units(*p)).collect();
            let mapped = self.map.forward_points(self.engine, &units)?;
            Ok(mapped.into_iter().map(|m| o.target.to_pixels(m.point)).collect())
        })?;
        Ok(Some(Starts { lattice, clipped }))
    }

    /// The colours of a band into the output, gathered on the device if the engine has one for this
    /// stage.
    fn colors(&self, band: Band, work: &mut Work, out: &mut Image) -> Result<()> {
        let (pyramid, filter) = (&self.pyramid, self.options.filter);
        let Work { bases, seen, colors, cover, .. } = work;
        let seen = seen.seen();
        let keep = (self.options.outside == Outside::Keep).then_some(cover.as_slice());
        let pixels = Colors { band, seen, keep };
        if let Some(gpu) = self.engine.gpu_for("warp_image") {
            colors.clear();
            colors.resize(band.len(), [0.0; 4]);
            if gpu::warp_image(gpu, pyramid, filter, band, bases, seen, colors)? {
                store(pyramid, colors, &pixels, out);
                return Ok(());
            }
        }
        gather_and_store(pyramid, filter, bases, &pixels, out);
        Ok(())
    }

    /// Pre-images of all pixels of a band that show something of the picture.
    fn preimages(&self, band: Band, starts: Option<&Starts>, work: &mut Work, stats: &mut WarpStats) -> Result<()> {
        let o = self.options;
        work.cover = match o.outside {
            Outside::Map => Vec::new(),
            _ => pixel_cover(&o.target.loops(self.map.target()), band.width, band.first, band.rows),
        };
        let cover = |x: usize, y: usize| if work.cover.is_empty() { 1.0 } else { work.cover[y * band.width + x] };
        let origin = DVec2::new(0.0, band.first as f64);
        let rough = starts.map(|s| Preimages::of(&s.lattice, origin, UVec2::new(band.width as u32, band.rows as u32)));
        // Pixels with a start, and those that are inside the cage but were missed by the lattice.
        let (mut near, mut guesses, mut lost) = (Vec::new(), Vec::new(), Vec::new());
        let places = band.places();
        let mut at = 0;
        let mut pixel = Vec::with_capacity(band.len());
        for place in &places {
            for y in place.y..place.y + place.height {
                for x in place.x..place.x + place.width {
                    pixel.push([x as u32, y as u32]);
                    if cover(x, y) > 0.0 {
                        let row = y * band.width + x;
                        match rough.as_ref().filter(|r| r.covered[row]) {
                            Some(r) => {
                                near.push(at);
                                guesses.push(o.source.to_units(DVec2::from(r.points[row].map(f64::from))));
                            }
                            None if starts.is_some_and(|s| !s.clipped) => lost.push(at),
                            None => {}
                        }
                    }
                    at += 1;
                }
            }
        }
        let units = |at: &usize| {
            let [x, y] = pixel[*at].map(f64::from);
            o.target.to_units(DVec2::new(x + 0.5, y + 0.5) + origin)
        };
        let mut found: Vec<Option<Mapped>> = vec![None; band.len()];
        for (list, guesses) in [(&near, Some(guesses.as_slice())), (&lost, None)] {
            if list.is_empty() {
                continue;
            }
            let points: Vec<DVec2> = list.iter().map(units).collect();
            let mapped = self.map.inverse_points(self.engine, &points, guesses)?;
            for ((at, point), mapped) in list.iter().zip(&points).zip(mapped) {
                found[*at] = mapped;
                if mapped.is_none() {
                    let inside = self.map.target().contains(*point) != crate::geometry::Side::Outside;
                    *(if inside { &mut stats.failed_inside } else { &mut stats.failed_outside }) += 1;
                }
            }
        }
        work.seen.reset(band.len(), o.filter == Filter::Ewa);
        work.jacobian.clear();
        work.jacobian.resize(band.len(), f32::NAN);
        work.bases.clear();
        for place in &places {
            let range = place.start..place.start + place.width * place.height;
            let at = |m: &Mapped| o.source.to_pixels(m.point);
            let middle = found[range.clone()].iter().flatten().map(at).find(|p| p.is_finite()).unwrap_or(DVec2::ZERO);
            let base = middle.clamp(DVec2::splat(-1e9), DVec2::splat(1e9)).floor();
            work.bases.push([base.x as i32, base.y as i32]);
            for i in range {
                let Some(mapped) = &found[i] else { continue };
                let [x, y] = pixel[i].map(|v| v as usize);
                stats.mapped += 1;
                let forward = o.source.derivative(&o.target, mapped.derivative);
                work.jacobian[i] = forward.determinant() as f32;
                work.seen.set(i, self.look(at(mapped), base, forward, cover(x, y)));
            }
        }
        let blank = |(seen, [x, y]): &(&f32, &[u32; 2])| **seen == 0.0 && cover(*x as usize, *y as usize) > 0.0;
        stats.empty += work.seen.seen().cover().iter().zip(&pixel).filter(blank).count() as u64;
        Ok(())
    }

    /// Where a pixel looks, with its share in the result.
    fn look(&self, at: DVec2, base: DVec2, forward: glam::DMat2, cover: f32) -> Footprint {
        let backward = forward.inverse();
        let (dx, dy) = (backward.x_axis, backward.y_axis);
        // How much of the pixel sees the picture, from the distance to its sides in output pixels:
        // no jagged borders. Where the cage ends with the picture, both say the same about the same
        // border.
        let side = |p: f64, n: u32, gradient: f64| {
            let gradient = gradient.max(1e-9);
            (0.5 + p / gradient).clamp(0.0, 1.0) * (0.5 + (f64::from(n) - p) / gradient).clamp(0.0, 1.0)
        };
        let seen = side(at.x, self.image.width, dx.x.hypot(dy.x)) * side(at.y, self.image.height, dx.y.hypot(dy.y));
        if !(at.is_finite() && dx.is_finite() && dy.is_finite() && seen > 0.0) {
            return Footprint::default();
        }
        let single = |v: DVec2| v.as_vec2().to_array();
        Footprint { at: single(at - base), dx: single(dx), dy: single(dy), cover: cover.min(seen as f32) }
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
