//! What became of the texels: counts, areas, and the coverage picture.
//!
//! Rows are cut into runs of [`RUN`] texels, each of which is added up in single precision in the
//! order of the kernel `tally`: 64 lanes take words of four texels in turn, then the lanes are
//! taken in order. Runs are added up in double precision. So counts and areas are the same to the
//! last bit on every back end and for any number of threads.

use bytemuck::{Pod, Zeroable};
use rayon::prelude::*;

use super::atlas::AtlasTexel;
use super::band::Window;
use super::footprint::Footprint;
use super::{TransferStats, coverage};
use crate::engine::GROUP;
use crate::geometry::NONE;

/// Coverage of a texel of a chart without colour, until all is done: neither background, which is
/// padded, nor covered.
pub(super) const HOLE: u8 = 1;

/// Words of four texels that a lane of a run takes.
pub(super) const WORDS: u32 = 4;
/// Texels of a run.
pub(super) const RUN: usize = (4 * WORDS * GROUP) as usize;

/// Counts and areas of a run.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(super) struct Sums {
    pub(super) covered: u32,
    pub(super) centre: u32,
    pub(super) overlapping: u32,
    pub(super) valid: u32,
    pub(super) doubtful: u32,
    pub(super) area: f32,
    pub(super) valid_area: f32,
    pub(super) doubtful_area: f32,
}

/// What became of a texel.
#[derive(Clone, Copy, Debug)]
struct Became {
    /// The value of its coverage; nothing where it shows nothing.
    cover: u8,
    /// The area that it stands for.
    area: f32,
}

impl Sums {
    /// Counts a run of texels; `became` tells what became of each.
    fn of(texels: &[AtlasTexel], became: impl Fn(usize) -> Became) -> Self {
        let mut sum = Self::default();
        let mut lanes = [[0.0_f32; 3]; GROUP as usize];
        for (i, texel) in texels.iter().enumerate().filter(|(_, t)| t.is_covered()) {
            let Became { cover, area } = became(i);
            sum.covered += 1;
            sum.centre += u32::from(texel.is_centre());
            sum.overlapping += u32::from(texel.cover & AtlasTexel::OVERLAP != 0);
            let lane = &mut lanes[i / 4 % GROUP as usize];
            lane[0] += area;
            match cover {
                coverage::VALID => {
                    sum.valid += 1;
                    lane[1] += area;
                }
                coverage::DOUBTFUL => {
                    sum.doubtful += 1;
                    lane[2] += area;
                }
                _ => {}
            }
        }
        let add = |a: [f32; 3], b: &[f32; 3]| [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
        [sum.area, sum.valid_area, sum.doubtful_area] = lanes[1..].iter().fold(lanes[0], add);
        sum
    }
}

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
        let became = |i: usize| {
            let texel = &texels[i];
            let cover = match () {
                () if !textured(i) => HOLE,
                () if Window::is_valid(&images[i]) => coverage::VALID,
                () => coverage::DOUBTFUL,
            };
            // A texel seen at its centre stands for its area; the others' is counted by their
            // neighbours.
            let area = if texel.is_centre() { window.target[texel.face as usize].texel_area } else { 0.0 };
            Became { cover, area }
        };
        let count_row = |(y, covers): (usize, &mut [u8])| {
            let row = y * width..(y + 1) * width;
            for (i, cover) in row.clone().zip(covers).filter(|(i, _)| texels[*i].is_covered()) {
                *cover = became(i).cover;
            }
            let runs = texels[row.clone()].chunks(RUN).zip(row.step_by(RUN));
            runs.map(|(run, first)| Sums::of(run, |i| became(first + i))).collect()
        };
        let rows: Vec<Vec<Sums>> = covers.par_chunks_mut(width).enumerate().map(count_row).collect();
        self.add_sums(rows.iter().flatten());
    }

    /// Adds runs, row after row.
    pub(super) fn add_sums<'s>(&mut self, sums: impl IntoIterator<Item = &'s Sums>) {
        for sum in sums {
            self.covered += u64::from(sum.covered);
            self.centre += u64::from(sum.centre);
            self.overlapping += u64::from(sum.overlapping);
            self.valid += u64::from(sum.valid);
            self.doubtful += u64::from(sum.doubtful);
            self.area += f64::from(sum.area);
            self.valid_area += f64::from(sum.valid_area);
            self.doubtful_area += f64::from(sum.doubtful_area);
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
