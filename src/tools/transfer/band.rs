//! A window of rows that moves down the texture: texels, their images, and the footprints that need a row on either side.

use rayon::prelude::*;

use super::atlas::{AtlasTexel, Tile, rasterize_atlas};
use super::bins::{Atlas, Bins};
use super::footprint::{Footprint, MappedTexel, footprint};
use crate::tools::stopwatch::Stopwatch;
use super::tables::{SourceTriangle, TargetTriangle};
use crate::error::{Error, Result};
use crate::geometry::NONE;
use crate::surface::{PackedImage, PackedPoint, PointMap, Status};

/// Barycentric coordinates may leave the triangle by this much, as a map's rounding.
const SLACK: f32 = 1e-2;

/// A texture's grid and the rows of it at hand.
pub(super) struct Window<'a> {
    pub(super) width: usize,
    height: usize,
    atlas: Atlas,
    pub(super) target: Vec<TargetTriangle>,
    map: &'a dyn PointMap,
    source_faces: usize,
    most_entries: usize,
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
            rows: 0..0,
            texels: Vec::new(),
            images: Vec::new(),
            points: Vec::new(),
            mapped: Vec::new(),
        }
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
        rasterize_atlas(&tile, &bins, &self.atlas.triangles, &mut self.texels[kept..]);
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
                *image = checked(found, faces);
            }
        }
        watch.lap("map");
        Ok(())
    }

    fn at(&self, x: usize, y: usize) -> MappedTexel {
        let i = (y - self.rows.start) * self.width + x;
        MappedTexel { texel: self.texels[i], image: self.images[i] }
    }

    /// Footprints of the texels of `rows`, row after row.
    pub(super) fn footprints(
        &self,
        rows: &std::ops::Range<usize>,
        source: &[SourceTriangle],
        footprints: &mut Vec<Footprint>,
    ) {
        footprints.clear();
        footprints.resize(rows.len() * self.width, Footprint::NOWHERE);
        footprints.par_chunks_mut(self.width).enumerate().for_each(|(r, out)| {
            let y = rows.start + r;
            for (x, out) in out.iter_mut().enumerate() {
                let texel = self.at(x, y);
                if !texel.texel.is_covered() {
                    continue;
                }
                let neighbours = [
                    (x > 0).then(|| self.at(x - 1, y)),
                    (x + 1 < self.width).then(|| self.at(x + 1, y)),
                    (y > 0).then(|| self.at(x, y - 1)),
                    (y + 1 < self.height).then(|| self.at(x, y + 1)),
                ];
                *out = footprint(&texel, &neighbours, source, &self.target);
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

/// An image that can be looked up; what is not on a source of `faces` triangles is nowhere.
fn checked(image: &PackedImage, faces: usize) -> PackedImage {
    let b2 = 1.0 - image.b0 - image.b1;
    let inside = image.b0 >= -SLACK && image.b1 >= -SLACK && b2 >= -SLACK;
    if inside && (image.face as usize) < faces { *image } else { PackedImage::NOWHERE }
}
