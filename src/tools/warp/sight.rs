//! Where the pixels of a band look: exact pre-images, and what each sees of the picture.

use glam::{DVec2, UVec2};
use rayon::prelude::*;

use super::band::{Band, Place};
use super::cover::pixel_cover;
use super::driver::{NODES, WarpOptions, WarpStats, Work};
use super::footprint::{Footprint, Setter};
use super::gpu::place::{LeftRecord, PlaceRecord, UNMAPPED};
use super::store::Outside;
use crate::engine::{Backend, Engine};
use crate::error::Result;
use crate::mapping::plane::{CompositeMap, Evaluated, Leaf, Mapped, Maps, NOWHERE, PatchOptions, Patches, Solved};

/// Side of the coarsest squares, in pixels of the picture, unless it is huge.
const COARSEST: f64 = 64.0;
/// What is seen of the picture's border, in pixels around it.
const MARGIN: f64 = 16.0;
/// Pixels that a square is not worth dividing for: its quarters take 28 cheap evaluations and 4 in
/// double precision, and not all of them are bounded.
const WORTH: f64 = 8.0;

/// A tolerance in pixels that single precision cannot keep in squares that are worth it: that of
/// cages of a few pixels.
const SMALLEST: f64 = 1e-5;
/// Evaluations that are allowed for a picture however small.
const FEWEST: usize = 1 << 16;

/// What the pre-images of a warp depend on.
pub(super) struct Sight<'a> {
    pub(super) engine: &'a Engine,
    pub(super) map: &'a CompositeMap,
    pub(super) options: &'a WarpOptions,
    /// Columns and rows of the picture and of the result.
    pub(super) picture: [u32; 2],
    pub(super) canvas: [u32; 2],
}

/// The inverse of the map over the part of the picture that matters.
pub(super) struct Squares {
    patches: Patches,
    /// Whether that part ends where the picture ends: then what it does not reach sees nothing of
    /// the picture.
    clipped: bool,
}

impl Squares {
    pub(super) fn patches(&self) -> &Patches {
        &self.patches
    }

    /// Whether a pixel that is to be coloured has a pre-image in some square, so that one without
    /// is worth a search.
    pub(super) fn hold_all(&self) -> bool {
        !self.clipped
    }

    pub(super) fn evaluations(&self) -> Evaluated {
        self.patches.evaluations
    }
}

/// A pre-image, with how it moves when the pixel moves one to the right and one down.
#[derive(Clone, Copy)]
pub(super) struct Look {
    pub(super) at: DVec2,
    pub(super) dx: DVec2,
    pub(super) dy: DVec2,
}

fn size(of: [u32; 2]) -> DVec2 {
    UVec2::from(of).as_dvec2()
}

impl Maps for Sight<'_> {
    fn exact(&self, points: &[DVec2]) -> Result<Vec<Mapped>> {
        Ok(self.in_pixels(self.map.forward_in_double(&self.in_units(points))))
    }

    fn cheap(&self, points: &[DVec2]) -> Result<Vec<Mapped>> {
        Ok(self.in_pixels(self.map.forward_in_parts(&self.in_units(points))))
    }
}

impl Sight<'_> {
    fn in_units(&self, points: &[DVec2]) -> Vec<DVec2> {
        points.iter().map(|p| self.options.source.to_units(*p)).collect()
    }

    fn in_pixels(&self, mapped: Vec<Mapped>) -> Vec<Mapped> {
        let o = self.options;
        let in_pixels = |m: Mapped| Mapped {
            point: o.target.to_pixels(m.point),
            derivative: o.source.derivative(&o.target, m.derivative),
        };
        mapped.into_iter().map(in_pixels).collect()
    }

    /// Most error of a pre-image times the derivative there, in pixels of the result.
    fn tolerance(&self) -> f64 {
        let o = self.options;
        let unit = (o.target.to_pixels(DVec2::X) - o.target.to_pixels(DVec2::ZERO)).length();
        self.map.tolerance() * unit
    }

    /// Whether a device keeps the bound of the squares: there an image is rounded by 2^-25 of a
    /// pixel beside what they allow for, less than a hundredth of the tolerance.
    pub(super) fn suits_device(&self) -> bool {
        self.tolerance() > SMALLEST
    }

    /// `None` if no part of the picture matters.
    pub(super) fn squares(&self) -> Result<Option<Squares>> {
        let o = self.options;
        let size = size(self.picture);
        // The coarsest squares take an eighth of the evaluations that are allowed at most.
        let fewest = |area: f64| (area * 64.0 / FEWEST as f64).sqrt();
        let margin = DVec2::splat((size.element_product() * 8.0 / NODES as f64).sqrt().max(MARGIN));
        let (mut low, mut high, mut clipped) = (-margin, size + margin, true);
        let vertices: Vec<DVec2> = o.source.loops(self.map.source()).into_iter().flatten().collect();
        if o.outside != Outside::Map {
            let points = || vertices.iter().copied();
            let (a, b) =
                (points().fold(low.max(high), DVec2::min) - margin, points().fold(low.min(high), DVec2::max) + margin);
            clipped = a.cmplt(low).any() || b.cmpgt(high).any();
            (low, high) = (low.max(a), high.min(b));
            if !low.cmplt(high).all() {
                return Ok(None);
            }
        }
        let tolerance = self.tolerance();
        // Where no square is ever bounded the pixels still have to be done.
        let pixels = self.canvas.map(|n| n as usize).iter().product::<usize>();
        let more = if tolerance > SMALLEST { pixels / 2 } else { 0 };
        let options = PatchOptions {
            cell: fewest((high - low).element_product()).max(COARSEST),
            tolerance,
            worth: WORTH,
            canvas: [DVec2::ZERO, self::size(self.canvas)],
            vertices,
            evaluations: NODES.min(FEWEST + more),
        };
        let patches = Patches::new(low, high, &options, self)?;
        Ok(Some(Squares { patches, clipped }))
    }

    /// Pre-images of all pixels of a band that show something of the picture.
    pub(super) fn preimages(
        &self,
        band: Band,
        squares: Option<&Squares>,
        work: &mut Work,
        stats: &mut WarpStats,
    ) -> Result<()> {
        let o = self.options;
        work.cover = self.cover(band);
        match squares {
            Some(s) => s.patches.find(band.first, UVec2::new(band.width as u32, band.rows as u32), &mut work.found),
            None => work.found.none(band.len()),
        }
        let search = squares.is_some_and(Squares::hold_all);
        let finished = self.finish(band, squares, search, work, stats)?;
        let mut seen = std::mem::take(&mut work.seen);
        seen.reset(band.len(), o.filter.averages());
        let look = |i: usize| self.look(squares, work, &finished, i);
        let places = band.places();
        let setters = seen.parts(places.iter().map(|p| p.width * p.height));
        let block = |place: &Place, mut setter: Setter<'_>| {
            let rows = || (place.y..place.y + place.height).map(|y| y * band.width + place.x);
            let middle = rows()
                .flat_map(|row| (row..row + place.width).filter_map(look).map(|l| l.at).find(|p| p.is_finite()))
                .next();
            let base = middle.unwrap_or_default().clamp(DVec2::splat(-1e9), DVec2::splat(1e9)).floor();
            let (mut mapped, mut empty) = (0, 0);
            for (k, i) in rows().flat_map(|row| row..row + place.width).enumerate() {
                let share = if work.cover.is_empty() { 1.0 } else { work.cover[i] };
                if let Some(look) = look(i) {
                    mapped += 1;
                    setter.set(k, footprint(self.picture, &look, base, share));
                }
                empty += u64::from(setter.cover[k] == 0.0 && share > 0.0);
            }
            ([base.x as i32, base.y as i32], mapped, empty)
        };
        let blocks: Vec<([i32; 2], u64, u64)> = places.par_iter().zip(setters).map(|(p, s)| block(p, s)).collect();
        stats.mapped += blocks.iter().map(|b| b.1).sum::<u64>();
        stats.empty += blocks.iter().map(|b| b.2).sum::<u64>();
        let jacobian = |i: usize| look(i).map_or(f32::NAN, |l| 1.0 / l.dx.perp_dot(l.dy) as f32);
        work.jacobian = if o.jacobian { (0..band.len()).map(jacobian).collect() } else { Vec::new() };
        work.bases.clear();
        work.bases.extend(blocks.iter().map(|b| b.0));
        work.seen = seen;
        Ok(())
    }

    /// The pixels of a band whose pre-images polynomials do not settle, with these: a device has
    /// the others. The share of each pixel in the target polygon is in `work`.
    pub(super) fn left(
        &self,
        band: Band,
        squares: &Squares,
        work: &mut Work,
        stats: &mut WarpStats,
    ) -> Result<Vec<LeftRecord>> {
        work.cover = self.cover(band);
        let size = UVec2::new(band.width as u32, band.rows as u32);
        squares.patches.find_open(band.first, size, &mut work.found);
        let shown = |i: &usize| work.found.leaf[*i] != NOWHERE && work.cover.get(*i).is_none_or(|c| *c > 0.0);
        let list: Vec<usize> = (0..band.len()).filter(shown).collect();
        let finished = self.finish(band, Some(squares), false, work, stats)?;
        let record = |i: usize| {
            let mut record = LeftRecord { pixel: i as u32, share: UNMAPPED, ..LeftRecord::default() };
            if let Some(look) = self.look(Some(squares), work, &finished, i) {
                let base = look.at.clamp(DVec2::splat(-1e9), DVec2::splat(1e9)).floor();
                let share = work.cover.get(i).copied().unwrap_or(1.0);
                let Footprint { at, dx, dy, cover } = footprint(self.picture, &look, base, share);
                record.share = cover;
                record.place = PlaceRecord { whole: [base.x as i32, base.y as i32], part: at, dx, dy };
            }
            record
        };
        Ok(list.into_iter().map(record).collect())
    }

    /// The share of each pixel in the target polygon; empty where everything is shown.
    fn cover(&self, band: Band) -> Vec<f32> {
        let o = self.options;
        match o.outside {
            Outside::Map => Vec::new(),
            _ => pixel_cover(&o.target.loops(self.map.target()), band.width, band.first, band.rows),
        }
    }

    /// Where pixel `i` of a band looks, by its square or by what was `finished`.
    #[inline(always)]
    fn look(&self, squares: Option<&Squares>, work: &Work, finished: &[Look], i: usize) -> Option<Look> {
        let leaves = squares.map_or(&[][..], |s| s.patches.leaves.as_slice());
        match work.found.leaf[i] {
            NOWHERE => None,
            leaf => Some(match leaves.get(leaf as usize) {
                Some(leaf) => self.exact(leaf, &work.found.solved[i]),
                None => finished[leaf as usize - leaves.len()],
            }),
        }
    }

    /// Newton's method on the map for the pixels of a band that have no exact pre-image: those in
    /// open squares, and, where `search` says so, those that no square has. Their leaves become
    /// places in the list that is returned, after those of the squares; pixels that are not shown,
    /// or have no pre-image, are nowhere.
    fn finish(
        &self,
        band: Band,
        squares: Option<&Squares>,
        search: bool,
        work: &mut Work,
        stats: &mut WarpStats,
    ) -> Result<Vec<Look>> {
        let o = self.options;
        // The reference evaluates the map itself at every pixel. Otherwise they are so few that a
        // device would be waited for longer than they take here.
        let all = self.engine.backend() == Backend::Reference;
        let host = Engine::cpu();
        let engine = if all { self.engine } else { &host };
        let leaves = squares.map_or(&[][..], |s| s.patches.leaves.as_slice());
        let (mut near, mut guesses, mut lost) = (Vec::new(), Vec::new(), Vec::new());
        for i in 0..band.len() {
            if !work.cover.is_empty() && !(work.cover[i] > 0.0) {
                work.found.leaf[i] = NOWHERE;
                continue;
            }
            match leaves.get(work.found.leaf[i] as usize) {
                Some(Leaf::Bounded(_)) if !all => {}
                Some(leaf) => {
                    near.push(i);
                    guesses.push(o.source.to_units(leaf.point(work.found.solved[i].at)));
                }
                None if search => lost.push(i),
                None => {}
            }
        }
        let mut finished = Vec::new();
        for (list, guesses) in [(near, Some(guesses.as_slice())), (lost, None)] {
            if list.is_empty() {
                continue;
            }
            let unit = |i: &usize| {
                let pixel = DVec2::new((i % band.width) as f64, (i / band.width + band.first) as f64);
                o.target.to_units(pixel + 0.5)
            };
            let points: Vec<DVec2> = list.iter().map(unit).collect();
            let (mapped, refined) = self.map.inverse_points_counted(engine, &points, guesses)?;
            stats.evaluations.pixels += points.len() as u64;
            stats.evaluations.refined += refined;
            for ((i, point), mapped) in list.into_iter().zip(&points).zip(mapped) {
                work.found.leaf[i] = NOWHERE;
                match mapped {
                    Some(m) => {
                        work.found.leaf[i] = (leaves.len() + finished.len()) as u32;
                        let backward = o.source.derivative(&o.target, m.derivative).inverse();
                        let at = o.source.to_pixels(m.point);
                        finished.push(Look { at, dx: backward.x_axis, dy: backward.y_axis });
                    }
                    None => {
                        let inside = self.map.target().contains(*point) != crate::geometry::Side::Outside;
                        *(if inside { &mut stats.failed_inside } else { &mut stats.failed_outside }) += 1;
                    }
                }
            }
        }
        Ok(finished)
    }

    /// What the patch of a square found.
    #[inline(always)]
    fn exact(&self, leaf: &Leaf, solved: &Solved) -> Look {
        let slope = |d: [f32; 2]| leaf.half() * DVec2::from(d.map(f64::from));
        Look { at: leaf.point(solved.at), dx: slope(solved.dx), dy: slope(solved.dy) }
    }
}

/// Where a pixel of a picture of this size looks, with its share in the result.
#[inline(always)]
pub(super) fn footprint(picture: [u32; 2], look: &Look, base: DVec2, cover: f32) -> Footprint {
    let Look { at, dx, dy } = *look;
    // How much of the pixel sees the picture, from the distance to its sides in output pixels:
    // no jagged borders. Where the cage ends with the picture, both say the same about the same
    // border.
    let side = |p: f64, n: f64, dx: f64, dy: f64| {
        // Far from both sides the length of the gradient does not matter.
        let most = 0.5 * (dx.abs() + dy.abs());
        if p >= most && n - p >= most {
            return 1.0;
        }
        let gradient = dx.hypot(dy).max(1e-9);
        (0.5 + p / gradient).clamp(0.0, 1.0) * (0.5 + (n - p) / gradient).clamp(0.0, 1.0)
    };
    let size = size(picture);
    let seen = side(at.x, size.x, dx.x, dy.x) * side(at.y, size.y, dx.y, dy.y);
    if !(at.is_finite() && dx.is_finite() && dy.is_finite() && seen > 0.0) {
        return Footprint::default();
    }
    let single = |v: DVec2| v.as_vec2().to_array();
    Footprint { at: single(at - base), dx: single(dx), dy: single(dy), cover: cover.min(seen as f32) }
}
