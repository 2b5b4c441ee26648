//! A window of rows that moves down the texture: texels, their images, and the footprints that need
//! a row on either side.

use rayon::prelude::*;

use super::atlas::{AtlasTexel, Tile, rasterize_atlas};
use super::bins::{Atlas, Bins};
use super::footprint::{Footprint, Located, footprint, locate};
use super::gpu::{Rasterizer, Seen};
use super::tables::{SourceTriangle, TargetTriangle};
use crate::error::{Error, Result};
use crate::geometry::NONE;
use crate::surface::{PackedImage, PackedPoint, PointMap, Status};
use crate::tools::stopwatch::Stopwatch;

/// A texture's grid and the rows of it at hand.
pub(super) struct Window<'a> {
    pub(super) width: usize,
    height: usize,
    atlas: Atlas,
    pub(super) target: Vec<TargetTriangle>,
    map: &'a dyn PointMap,
    source_faces: usize,
    most_entries: usize,
    device: Option<Rasterizer<'a>>,
    /// First row at hand, and the row after the last.
    rows: std::ops::Range<usize>,
    texels: Vec<AtlasTexel>,
    images: Vec<PackedImage>,
    /// Kept to be reused.
    points: Vec<PackedPoint>,
    mapped: Vec<PackedImage>,
}

impl<'a> Window<'a> {
    pub(super) fn new(
        size: [u32; 2],
        atlas: Atlas,
        target: Vec<TargetTriangle>,
        map: &'a dyn PointMap,
        source_faces: usize,
        most_entries: usize,
    ) -> Self {
        Self {
            width: size[0] as usize,
            height: size[1] as usize,
            atlas,
            target,
            map,
            source_faces,
            most_entries,
            device: None,
            rows: 0..0,
            texels: Vec::new(),
            images: Vec::new(),
            points: Vec::new(),
            mapped: Vec::new(),
        }
    }

    /// Lets a device rasterise.
    pub(super) fn rasterize_on(&mut self, device: Option<Rasterizer<'a>>) {
        self.device = device;
    }

    /// Moves on so that `rows` and a row on either side are at hand. Windows only move down.
    pub(super) fn advance(&mut self, rows: &std::ops::Range<usize>, watch: &mut Stopwatch) -> Result<()> {
        let first = rows.start.saturating_sub(1);
        let end = (rows.end + 1).min(self.height);
        let gone = (first - self.rows.start) * self.width;
        self.texels.drain(..gone);
        self.images.drain(..gone);
        let from = self.rows.end.max(first);
        self.rows = first..end;
        let kept = (from - first) * self.width;
        self.texels.resize((end - first) * self.width, AtlasTexel::EMPTY);
        self.images.resize((end - first) * self.width, PackedImage::NOWHERE);
        let tile = Tile { x: 0, y: from as u32, width: self.width as u32, height: (end - from) as u32 };
        let bins = Bins::new(&tile, &self.atlas, self.most_entries)?;
        let texels = &mut self.texels[kept..];
        match &mut self.device {
            Some(device) => device.rasterize(&tile, &bins, &self.atlas.triangles, texels)?,
            None => rasterize_atlas(&tile, &bins, &self.atlas.triangles, texels),
        }
        watch.lap("rasterize_atlas");

        self.points.clear();
        self.points.extend(self.texels[kept..].iter().filter(|t| t.is_covered()).map(AtlasTexel::point));
        self.mapped.clear();
        if !self.points.is_empty() {
            self.map.map(&self.points, &mut self.mapped)?;
        }
        if self.mapped.len() != self.points.len() {
            return Err(Error::numeric(
                format!("the map gave {} images for {} points", self.mapped.len(), self.points.len()),
                "This is a fault of the map",
            ));
        }
        let faces = self.source_faces;
        let mut next = self.mapped.iter();
        for (texel, image) in self.texels[kept..].iter().zip(&mut self.images[kept..]) {
            *image = PackedImage::NOWHERE;
            if texel.is_covered()
                && let Some(found) = next.next()
            {
                *image = found.checked(faces);
            }
        }
        watch.lap("map");
        Ok(())
    }

    /// Moves on to texels and images that were found elsewhere, which follow those at hand; `rows`
    /// and a row on either side are at hand then.
    pub(super) fn take(&mut self, rows: &std::ops::Range<usize>, seen: Seen) {
        let first = rows.start.saturating_sub(1);
        let gone = (first - self.rows.start) * self.width;
        self.texels.drain(..gone);
        self.images.drain(..gone);
        self.texels.extend(seen.texels);
        self.images.extend(seen.images);
        self.rows = first..seen.rows.end;
    }

    /// Footprints of the texels of `rows`, row after row.
    pub(super) fn footprints(
        &self,
        rows: &std::ops::Range<usize>,
        source: &[SourceTriangle],
        footprints: &mut Vec<Footprint>,
    ) {
        // Each task looks its texels up once, with a row on either side.
        const TASK: usize = 16;
        let width = self.width;
        footprints.clear();
        footprints.resize(rows.len() * width, Footprint::NOWHERE);
        footprints.par_chunks_mut(width * TASK).enumerate().for_each(|(task, out)| {
            let first = rows.start + task * TASK;
            let end = first + out.len() / width;
            let (low, high) = (first.saturating_sub(1), (end + 1).min(self.height));
            let range = (low - self.rows.start) * width..(high - self.rows.start) * width;
            let (texels, images) = (&self.texels[range.clone()], &self.images[range]);
            let located: Vec<Located> =
                texels.iter().zip(images).map(|(t, i)| locate(t, i, source, &self.target)).collect();
            for (i, out) in out.iter_mut().enumerate() {
                let (x, y) = (i % width, first + i / width);
                let at = (y - low) * width + x;
                let here = &located[at];
                if here.face == NONE {
                    continue;
                }
                let beside = |inside: bool, index: usize| if inside { &located[index] } else { &Located::NOWHERE };
                let neighbours = [
                    beside(x > 0, at.wrapping_sub(1)),
                    beside(x + 1 < width, at + 1),
                    beside(y > 0, at.wrapping_sub(width)),
                    beside(y + 1 < self.height, at + width),
                ];
                let expected = &self.target[texels[at].face as usize];
                *out = footprint(here, neighbours, &source[here.face as usize], expected);
            }
        });
    }

    /// The texels of `rows`.
    pub(super) fn texels(&self, rows: &std::ops::Range<usize>) -> &[AtlasTexel] {
        &self.texels[(rows.start - self.rows.start) * self.width..(rows.end - self.rows.start) * self.width]
    }

    /// The images of the texels of `rows`.
    pub(super) fn images(&self, rows: &std::ops::Range<usize>) -> &[PackedImage] {
        &self.images[(rows.start - self.rows.start) * self.width..(rows.end - self.rows.start) * self.width]
    }

    /// A texel at hand and its image; `None` beyond the texture's border.
    pub(super) fn at(&self, x: usize, y: usize) -> Option<(&AtlasTexel, &PackedImage)> {
        let at = y.checked_sub(self.rows.start).filter(|_| x < self.width)? * self.width + x;
        Some((self.texels.get(at)?, self.images.get(at)?))
    }

    /// Counts of the atlas.
    pub(super) fn atlas(&self) -> &Atlas {
        &self.atlas
    }

    /// Chart of a texel of the target.
    pub(super) fn chart(&self, texel: &AtlasTexel) -> u32 {
        if texel.face == NONE { NONE } else { self.target[texel.face as usize].chart }
    }

    /// Whether the map vouches for an image.
    pub(super) fn is_valid(image: &PackedImage) -> bool {
        image.status() == Status::Valid
    }
}
