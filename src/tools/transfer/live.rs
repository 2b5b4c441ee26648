//! A transfer that follows its map: only what an edit of the anchors changed is computed anew.

use std::collections::BTreeSet;

use rayon::prelude::*;

use super::atlas::{AtlasTexel, Tile, rasterize_atlas};
use super::band::Window;
use super::bins::{Atlas, Bins};
use super::driver::check;
use super::fill::Fill;
use super::footprint::{Footprint, Located, footprint, locate};
use super::gpu::Stages;
use super::kind::LayerKind;
use super::layer::{Layer, blank};
use super::lookup::lookups;
use super::output::Output;
use super::pad::pad_seams;
use super::plan::Plan;
use super::pyramids::Pyramids;
use super::tables::{SourceTriangle, TargetTriangle, target_triangles};
use super::tally::HOLE;
use super::{TransferOptions, coverage};
use crate::engine::Engine;
use crate::error::{Error, Result};
use crate::geometry::{Mesh, NONE};
use crate::picture::{Image, Pixels};
use crate::surface::{PackedImage, PackedPoint, PointMap};

/// Bytes per texel beside the pictures: what it shows, its image, its place in the lists, coverage.
const TEXEL: u64 = 64;

/// What an update did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Followed {
    /// Texels that were mapped again.
    pub mapped: usize,
    /// Texels whose image moved, and their neighbours, whose footprints changed with them: these
    /// were coloured again.
    pub recolored: usize,
    /// Texels beyond the charts' borders that got another colour.
    pub padded: usize,
    /// Texels that wait for the next call to be mapped: more than its budget were to be.
    pub left: usize,
    /// The smallest rectangle with all of them, to bring to a screen; none if nothing changed.
    pub changed: Option<Tile>,
}

/// A transferred texture that follows its map while anchors are edited (Panozzo et al. 2013, Fig.
/// 13: on one mesh, moving anchors deforms its texture).
///
/// Colours and coverage are at all times, byte for byte, those that [`transfer`](super::transfer)
/// gives for the map as it is; texels that an edit does not reach are not touched. With
/// [`FieldSession`](crate::surface::field::FieldSession), whose edits name the triangles they
/// reach, an edit costs what changes. Colours and labels only, on the CPU; no supersampling,
/// filling or ST-map.
pub struct LiveTransfer<'a> {
    options: TransferOptions,
    source: Vec<SourceTriangle>,
    target: Vec<TargetTriangle>,
    /// What each texel shows, and its image.
    texels: Vec<AtlasTexel>,
    images: Vec<PackedImage>,
    /// Texels by triangle of the target: those of triangle t are `members[starts[t]..starts[t +
    /// 1]]`, rising.
    starts: Vec<usize>,
    members: Vec<u32>,
    outputs: Vec<Output<'a>>,
    covers: Vec<u8>,
    /// Texels that are to be mapped again.
    waiting: BTreeSet<u32>,
    /// Padded texels, each with the one its colour comes from: (from, to), rising.
    padding: Vec<[u32; 2]>,
}

impl std::fmt::Debug for LiveTransfer<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("LiveTransfer").field("options", &self.options).finish_non_exhaustive()
    }
}

impl<'a> LiveTransfer<'a> {
    /// Makes the whole transfer and keeps what updates need: 64 bytes a texel beside the pictures.
    ///
    /// # Errors
    /// As [`transfer`](super::transfer), and for options and kinds of layers that cannot follow.
    pub fn new(
        source: &'a Mesh,
        layers: &[Layer<'a>],
        target: &Mesh,
        map: &dyn PointMap,
        options: &TransferOptions,
    ) -> Result<Self> {
        check(source, layers, target, options)?;
        can_follow(layers, options)?;
        let plan = Plan::new(source, layers, target, options, &Stages::none(String::new()))?;
        let (width, height) = (options.width as usize, options.height as usize);
        let required = plan.bytes + TEXEL * (width * height) as u64;
        if required > options.memory {
            let what = format!("a live transfer to {width} x {height} texels");
            return Err(Error::Memory { what, required, allowed: options.memory });
        }
        let (mut lookups, _) = lookups(source, layers)?;
        let (Some(lookup), true) = (lookups.pop(), lookups.is_empty()) else {
            let what = "the pictures of the layers lie on the source in different ways";
            return Err(Error::input(what, "Make a live transfer for each of them"));
        };
        let (w, h) = (options.width, options.height);
        let atlas = Atlas::new(target, w, h, options.region, options.material, plan.most_triangles)?;
        let mut texels = vec![AtlasTexel::EMPTY; width * height];
        for (band, texels) in texels.chunks_mut(plan.rows * width).enumerate() {
            let tile = Tile { x: 0, y: (band * plan.rows) as u32, width: w, height: (texels.len() / width) as u32 };
            let bins = Bins::new(&tile, &atlas, plan.most_entries)?;
            rasterize_atlas(&tile, &bins, &atlas.triangles, texels);
        }
        let (starts, members) = by_triangle(&texels, target.triangle_count());
        let pyramids = Pyramids::new(&Engine::cpu());
        let output = |layer| Output::new(layer, source, 0, options, None, &pyramids);
        let mut live = Self {
            options: options.clone(),
            source: lookup.table,
            target: target_triangles(target, source, w, h)?,
            images: vec![PackedImage::NOWHERE; texels.len()],
            texels,
            starts,
            members,
            outputs: layers.iter().map(output).collect::<Result<_>>()?,
            covers: vec![coverage::NOTHING; width * height],
            waiting: BTreeSet::new(),
            padding: Vec::new(),
        };
        live.refresh(map, live.members.clone(), true)?;
        Ok(live)
    }

    /// Updates the texels of these triangles of the target, in any order, from `map`. Outside them
    /// `map` must not have changed, and it must lead to the source that [`LiveTransfer::new`] was
    /// given.
    ///
    /// O(texels of the triangles), and of the charts' borders if texels gained or lost their
    /// colour.
    ///
    /// # Errors
    /// If there is no such triangle (then nothing has changed), or the map fails.
    pub fn update(&mut self, map: &dyn PointMap, triangles: &[u32]) -> Result<Followed> {
        self.follow(map, triangles, usize::MAX)
    }

    /// As [`LiveTransfer::update`], of `budget` texels at most: those that are left come first in
    /// the next call, which may name no triangle. With [`Followed::left`] 0 the pictures are those
    /// of the map.
    ///
    /// # Errors
    /// As [`LiveTransfer::update`]; what failed is left.
    pub fn follow(&mut self, map: &dyn PointMap, triangles: &[u32], budget: usize) -> Result<Followed> {
        let count = self.starts.len() - 1;
        if let Some(t) = triangles.iter().find(|t| **t as usize >= count) {
            let remedy = "Name triangles of the target";
            return Err(Error::input(format!("there is no triangle {t}, only {count}"), remedy));
        }
        let of = |t: &u32| &self.members[self.starts[*t as usize]..self.starts[*t as usize + 1]];
        self.waiting.extend(triangles.iter().flat_map(of));
        let texels: Vec<u32> = self.waiting.iter().copied().take(budget).collect();
        let end = texels.last().map(|last| last + 1);
        let done = self.refresh(map, texels, false)?;
        if let Some(end) = end {
            self.waiting = self.waiting.split_off(&end);
        }
        Ok(Followed { left: self.waiting.len(), ..done })
    }

    /// One picture per layer, as of [`TransferOutput::layers`](super::TransferOutput::layers).
    pub fn layers(&self) -> impl ExactSizeIterator<Item = &Image> {
        self.outputs.iter().map(|o| &o.image)
    }

    /// Texels that show a point of the target.
    pub fn covered(&self) -> usize {
        self.members.len()
    }

    /// 8-bit grey with the values of [`coverage`].
    pub fn coverage(&self) -> Image {
        let shown = |c: &u8| if *c == HOLE { coverage::NOTHING } else { *c };
        let pixels = Pixels::U8(self.covers.iter().map(shown).collect());
        Image { width: self.options.width, height: self.options.height, channels: 1, pixels }
    }

    /// Maps these texels, and colours those that moved; all of them if it is the first time.
    fn refresh(&mut self, map: &dyn PointMap, texels: Vec<u32>, first: bool) -> Result<Followed> {
        let points: Vec<PackedPoint> = texels.iter().map(|&i| self.texels[i as usize].point()).collect();
        let mut images = Vec::new();
        if !points.is_empty() {
            map.map(&points, &mut images)?;
        }
        if images.len() != points.len() {
            return Err(Error::numeric(
                format!("the map gave {} images for {} points", images.len(), points.len()),
                "This is a fault of the map",
            ));
        }
        let mapped = texels.len();
        let mut dirty = Vec::new();
        for (&i, image) in texels.iter().zip(&images) {
            let image = image.checked(self.source.len());
            let known = &mut self.images[i as usize];
            if first || *known != image {
                *known = image;
                dirty.push(i);
                if !first {
                    let beside = self.beside(i as usize).into_iter().flatten();
                    dirty.extend(beside.filter(|&j| self.texels[j].is_covered()).map(|j| j as u32));
                }
            }
        }
        dirty.sort_unstable();
        dirty.dedup();
        let footprints: Vec<Footprint> = dirty.par_iter().map(|&i| self.footprint(i as usize)).collect();
        self.color(&dirty, &footprints)?;
        let borders = self.cover(&dirty, &footprints);
        let padded = if first || borders { self.pad()? } else { self.copy_padding(&dirty) };
        Ok(Followed {
            mapped,
            recolored: dirty.len(),
            padded: padded.len(),
            left: 0,
            changed: self.tile(dirty.iter().chain(&padded)),
        })
    }

    /// The texels to the left, right, above and below.
    fn beside(&self, i: usize) -> [Option<usize>; 4] {
        let width = self.options.width as usize;
        let x = i % width;
        [
            (x > 0).then(|| i.wrapping_sub(1)),
            (x + 1 < width).then_some(i + 1),
            i.checked_sub(width),
            Some(i + width).filter(|&j| j < self.texels.len()),
        ]
    }

    fn footprint(&self, i: usize) -> Footprint {
        let located = |i: usize| locate(&self.texels[i], &self.images[i], &self.source, &self.target);
        let here = located(i);
        if here.face == NONE {
            return Footprint::NOWHERE;
        }
        let beside = self.beside(i).map(|j| j.map_or(Located::NOWHERE, located));
        let expected = &self.target[self.texels[i].face as usize];
        footprint(&here, beside.each_ref(), &self.source[here.face as usize], expected)
    }

    /// Colours texels, in all layers.
    fn color(&mut self, texels: &[u32], footprints: &[Footprint]) -> Result<()> {
        if texels.is_empty() {
            return Ok(());
        }
        let mut colors = Vec::new();
        for output in &mut self.outputs {
            output.colors(footprints, &self.options, &mut colors, None)?;
            let (channels, depth) = (output.image.channels, output.image.depth());
            let mut strip = blank(texels.len() as u32, 1, channels, depth, self.options.background)?;
            output.palette().write(&mut strip, 0, footprints, &colors, true);
            let places = texels.iter().map(|&i| i as usize);
            place(&strip.pixels, (0..texels.len()).zip(places), &mut output.image.pixels, channels as usize);
        }
        Ok(())
    }

    /// Marks what became of texels; whether some gained or lost their colour.
    fn cover(&mut self, texels: &[u32], footprints: &[Footprint]) -> bool {
        let textured =
            |f: &Footprint| f.face != NONE && self.outputs.iter().any(|o| o.texture_of[f.face as usize] != NONE);
        let mut borders = false;
        for (&i, f) in texels.iter().zip(footprints) {
            let cover = match () {
                () if !textured(f) => HOLE,
                () if Window::is_valid(&self.images[i as usize]) => coverage::VALID,
                () => coverage::DOUBTFUL,
            };
            let known = &mut self.covers[i as usize];
            borders |= (*known == HOLE) != (cover == HOLE);
            *known = cover;
        }
        borders
    }

    /// Finds the padding anew; gives the texels that have, or had, some.
    fn pad(&mut self) -> Result<Vec<u32>> {
        let (width, height) = (self.options.width as usize, self.options.height as usize);
        let mut touched: Vec<u32> = self.padding.drain(..).map(|[_, to]| to).collect();
        for output in &mut self.outputs {
            let (channels, depth) = (output.image.channels, output.image.depth());
            let blank = blank(1, 1, channels, depth, self.options.background)?;
            let old = touched.iter().map(|&i| (0, i as usize));
            place(&blank.pixels, old, &mut output.image.pixels, channels as usize);
        }
        touched.iter().for_each(|&i| self.covers[i as usize] = coverage::NOTHING);
        if self.options.margin > 0 {
            let mut nearest = Vec::new();
            pad_seams(&self.covers, width, 0..height, self.options.margin, &mut nearest);
            let pairs = (0..).zip(nearest).filter(|&(to, from)| from != NONE && from != to);
            self.padding = pairs.filter(|p| self.covers[p.0 as usize] != HOLE).map(|(to, from)| [from, to]).collect();
            self.padding.sort_unstable();
        }
        let all = 0..self.padding.len();
        touched.extend(self.copy(all));
        touched.sort_unstable();
        touched.dedup();
        Ok(touched)
    }

    /// Copies the colours of these texels to their padding, which it gives.
    fn copy_padding(&mut self, from: &[u32]) -> Vec<u32> {
        let mut touched = Vec::new();
        for &i in from {
            let first = self.padding.partition_point(|p| p[0] < i);
            let end = first + self.padding[first..].partition_point(|p| p[0] == i);
            touched.extend(self.copy(first..end));
        }
        touched
    }

    fn copy(&mut self, range: std::ops::Range<usize>) -> Vec<u32> {
        let pairs = &self.padding[range];
        for output in &mut self.outputs {
            let channels = output.image.channels as usize;
            copy_texels(&mut output.image.pixels, pairs, channels);
        }
        pairs.iter().for_each(|[_, to]| self.covers[*to as usize] = coverage::PADDING);
        pairs.iter().map(|p| p[1]).collect()
    }

    fn tile<'b>(&self, texels: impl Iterator<Item = &'b u32>) -> Option<Tile> {
        let width = self.options.width;
        let bounds = texels.map(|&i| [i % width, i / width]).fold(None, |b: Option<[[u32; 2]; 2]>, p| match b {
            None => Some([p, p]),
            Some([low, high]) => Some([[0, 1].map(|k| low[k].min(p[k])), [0, 1].map(|k| high[k].max(p[k]))]),
        });
        bounds.map(|[low, high]| Tile {
            x: low[0],
            y: low[1],
            width: high[0] - low[0] + 1,
            height: high[1] - low[1] + 1,
        })
    }
}

pub(super) fn can_follow(layers: &[Layer<'_>], options: &TransferOptions) -> Result<()> {
    let refuse = |option: &str, value: String, remedy: &str| Err(Error::option(option, value, remedy));
    if options.supersample != 1 {
        return refuse("--supersample", options.supersample.to_string(), "A live transfer takes one sample a texel");
    }
    if options.fill != Fill::None || options.coordinates {
        return refuse("--fill or --stmap", "given".into(), "Make them by a whole transfer when editing is done");
    }
    match layers.iter().find(|l| !matches!(l.kind, LayerKind::Color | LayerKind::Labels)) {
        Some(l) => refuse("--kind", format!("of layer {}", l.name), "A live transfer carries colours and labels"),
        None => Ok(()),
    }
}

/// Covered texels by triangle.
pub(super) fn by_triangle(texels: &[AtlasTexel], triangles: usize) -> (Vec<usize>, Vec<u32>) {
    let mut starts = vec![0_usize; triangles + 1];
    let covered = || (0_u32..).zip(texels).filter(|(_, t)| t.is_covered());
    covered().for_each(|(_, t)| starts[t.face as usize + 1] += 1);
    for t in 0..triangles {
        starts[t + 1] += starts[t];
    }
    let mut next = starts.clone();
    let mut members = vec![0; starts[triangles]];
    for (i, t) in covered() {
        members[next[t.face as usize]] = i;
        next[t.face as usize] += 1;
    }
    (starts, members)
}

/// Copies texels from one picture to places in another of the same format.
fn place(from: &Pixels, pairs: impl Iterator<Item = (usize, usize)>, to: &mut Pixels, channels: usize) {
    fn run<T: Copy>(from: &[T], pairs: impl Iterator<Item = (usize, usize)>, to: &mut [T], n: usize) {
        pairs.for_each(|(a, b)| to[b * n..(b + 1) * n].copy_from_slice(&from[a * n..(a + 1) * n]));
    }
    match (from, to) {
        (Pixels::U8(from), Pixels::U8(to)) => run(from, pairs, to, channels),
        (Pixels::U16(from), Pixels::U16(to)) => run(from, pairs, to, channels),
        (Pixels::F32(from), Pixels::F32(to)) => run(from, pairs, to, channels),
        _ => unreachable!("both pictures were made in one format"),
    }
}

/// Copies texels (from, to) within a picture.
fn copy_texels(pixels: &mut Pixels, pairs: &[[u32; 2]], channels: usize) {
    fn run<T: Copy>(samples: &mut [T], pairs: &[[u32; 2]], n: usize) {
        for &[from, to] in pairs {
            samples.copy_within(from as usize * n..(from as usize + 1) * n, to as usize * n);
        }
    }
    match pixels {
        Pixels::U8(v) => run(v, pairs, channels),
        Pixels::U16(v) => run(v, pairs, channels),
        Pixels::F32(v) => run(v, pairs, channels),
    }
}
