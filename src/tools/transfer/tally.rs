//! What became of the texels: counts, areas, and the coverage picture.

use rayon::prelude::*;

use super::atlas::AtlasTexel;
use super::band::Window;
use super::footprint::Footprint;
use super::{TransferStats, coverage};
use crate::geometry::NONE;

/// Coverage of a texel of a chart without colour, until all is done: neither background, which is
/// padded, nor covered.
pub(super) const HOLE: u8 = 1;

/// Counts of texels, and areas of the target that they stand for.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Tally {
    covered: u64,
    centre: u64,
    overlapping: u64,
    valid: u64,
    doubtful: u64,
    area: f64,
    valid_area: f64,
    doubtful_area: f64,
}

impl Tally {
    /// Counts a band and writes its coverage; `shown` holds the footprints of each layer and the
    /// picture of each triangle.
    pub(super) fn add(
        &mut self,
        rows: &std::ops::Range<usize>,
        window: &Window<'_>,
        shown: &[(&[Footprint], &[u32])],
        covers: &mut [u8],
    ) {
        let width = window.width;
        let (texels, images) = (window.texels(rows), window.images(rows));
        let textured = |i: usize| {
            shown.iter().any(|(footprints, texture_of)| {
                let face = footprints[i].face;
                face != NONE && texture_of[face as usize] != NONE
            })
        };
        let count_row = |(y, covers): (usize, &mut [u8])| {
            let mut sum = Self::default();
            for (x, cover) in covers.iter_mut().enumerate() {
                let i = y * width + x;
                let texel = &texels[i];
                if !texel.is_covered() {
                    continue;
                }
                sum.covered += 1;
                sum.centre += u64::from(texel.is_centre());
                sum.overlapping += u64::from(texel.cover & AtlasTexel::OVERLAP != 0);
                // A texel seen at its centre stands for its area; the others' is counted by their
                // neighbours.
                let area =
                    if texel.is_centre() { f64::from(window.target[texel.face as usize].texel_area) } else { 0.0 };
                sum.area += area;
                if !textured(i) {
                    *cover = HOLE;
                    continue;
                }
                if Window::is_valid(&images[i]) {
                    *cover = coverage::VALID;
                    sum.valid += 1;
                    sum.valid_area += area;
                } else {
                    *cover = coverage::DOUBTFUL;
                    sum.doubtful += 1;
                    sum.doubtful_area += area;
                }
            }
            sum
        };
        let rows: Vec<Self> = covers.par_chunks_mut(width).enumerate().map(count_row).collect();
        for row in rows {
            self.covered += row.covered;
            self.centre += row.centre;
            self.overlapping += row.overlapping;
            self.valid += row.valid;
            self.doubtful += row.doubtful;
            self.area += row.area;
            self.valid_area += row.valid_area;
            self.doubtful_area += row.doubtful_area;
        }
    }

    pub(super) fn stats(&self) -> TransferStats {
        let fraction = |area: f64, count: u64| {
            if self.area > 0.0 {
                area / self.area
            } else if self.covered > 0 {
                count as f64 / self.covered as f64
            } else {
                0.0
            }
        };
        TransferStats {
            covered: self.covered,
            covered_centre: self.centre,
            overlapping: self.overlapping,
            valid: self.valid,
            doubtful: self.doubtful,
            colorless: self.covered - self.valid - self.doubtful,
            covered_area: self.area,
            valid_fraction: fraction(self.valid_area, self.valid),
            doubtful_fraction: fraction(self.doubtful_area, self.doubtful),
            ..TransferStats::default()
        }
    }
}

impl TransferStats {
    /// Adds those of another picture of the same target: another tile or material. Counts and times
    /// are added, shares weighted by area, and of memory the larger is taken.
    pub fn merge(&mut self, other: &Self) {
        let area = self.covered_area + other.covered_area;
        let share = |a: f64, b: f64| {
            let both = a * self.covered_area + b * other.covered_area;
            if area > 0.0 { both / area } else { a.max(b) }
        };
        self.valid_fraction = share(self.valid_fraction, other.valid_fraction);
        self.doubtful_fraction = share(self.doubtful_fraction, other.doubtful_fraction);
        self.covered_area = area;
        let counts = [
            (&mut self.texels, other.texels),
            (&mut self.covered, other.covered),
            (&mut self.covered_centre, other.covered_centre),
            (&mut self.overlapping, other.overlapping),
            (&mut self.valid, other.valid),
            (&mut self.doubtful, other.doubtful),
            (&mut self.colorless, other.colorless),
            (&mut self.filled, other.filled),
            (&mut self.padded, other.padded),
            (&mut self.bands, other.bands),
        ];
        for (sum, more) in counts {
            *sum += more;
        }
        // Counted over the whole target each time, whatever a picture shows of it.
        let largest = [
            (&mut self.missing_texcoords, other.missing_texcoords),
            (&mut self.degenerate_texcoords, other.degenerate_texcoords),
            (&mut self.mirrored_texcoords, other.mirrored_texcoords),
            (&mut self.memory, other.memory),
        ];
        for (most, more) in largest {
            *most = (*most).max(more);
        }
        for stage in &other.stages {
            match self.stages.iter_mut().find(|s| s.name == stage.name) {
                Some(known) => known.add(stage),
                None => self.stages.push(stage.clone()),
            }
        }
        self.device_stages.retain(|s| other.device_stages.contains(s));
        for note in &other.notes {
            if !self.notes.contains(note) {
                self.notes.push(note.clone());
            }
        }
    }
}
