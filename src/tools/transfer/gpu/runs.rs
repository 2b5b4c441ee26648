//! Runs of texels: the parts of rows that lie in bins with triangles. Host half of the kernel
//! `list_points`.
//!
//! About half of an atlas shows nothing. A device works on whole groups of lanes, so that kernels
//! which take texels one after the other pay for the empty ones as for the others; they take the
//! texels of runs instead. The host lists runs from the bins that it makes anyway.

use std::ops::Range;
use std::sync::Arc;

use super::locate::PARAMS;
use super::window::{Rows, WINDOW_LAYOUT};
use crate::engine::{Batch, BindGroup, BindingKind, Buffer, Gpu, Kernel, Pipeline};
use crate::error::{Error, Result};
use crate::surface::PackedPoint;
use crate::tools::transfer::atlas::BIN;
use crate::tools::transfer::bins::Bins;

/// A run has two to the power of this many texels: a row of a bin.
pub(super) const RUN_BITS: u32 = BIN.ilog2();
/// Texels of a run.
pub(super) const RUN: usize = 1 << RUN_BITS;
/// Bits of a word that hold the column of a run; those above hold its row.
pub(super) const COLUMN_BITS: u32 = 16;

pub(super) static LIST_POINTS: Kernel = Kernel {
    name: "list_points",
    source: include_str!("../../../../shaders/list_points.wgsl"),
    bindings: &[PARAMS, BindingKind::Read, BindingKind::Read, BindingKind::Write],
    layouts: &[WINDOW_LAYOUT],
    items: 1,
    constants: &[],
};

/// A point and the place of its image.
pub(super) type PointRecord = [u32; 4];
const _: () = assert!(size_of::<PointRecord>() == size_of::<PackedPoint>() + size_of::<u32>());

/// The runs of the rows that are kept on a device.
#[derive(Debug)]
pub(super) struct Runs {
    occupied: Occupied,
    listed: Listed,
    pub(super) list: Buffer<u32>,
    points: Arc<Pipeline>,
    group: BindGroup,
}

impl Runs {
    /// Without runs, with room for `lists` lists of all of them; `points` is where their points go.
    ///
    /// # Errors
    /// [`Error::Capability`] if the picture is too large for the words of the list; else as
    /// [`Gpu::buffer`].
    pub(super) fn new(gpu: &Gpu, rows: &Rows, points: &Buffer<PointRecord>, lists: usize) -> Result<Self> {
        let occupied = Occupied::new([rows.width, rows.height]);
        let most = 1_usize << COLUMN_BITS;
        if rows.height > most || occupied.columns > most {
            return Err(Error::Capability {
                limit: "rows of a picture".into(),
                required: rows.height.max(occupied.columns) as u64,
                actual: most as u64,
            });
        }
        let list = gpu.buffer("runs", lists * rows.kept * occupied.columns)?;
        let pipeline = gpu.pipeline(&LIST_POINTS)?;
        let group = gpu.bind(&pipeline, &[rows.params.bind(0), list.bind(), rows.texels.bind(), points.bind()])?;
        Ok(Self { occupied, listed: Listed::default(), list, points: pipeline, group })
    }

    /// Takes note of the bins of a tile of whole rows.
    pub(super) fn mark(&mut self, bins: &Bins) {
        self.occupied.mark(bins);
    }

    /// Lists the runs of `rows`, whose bins were marked. What was submitted before still sees the
    /// old list.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub(super) fn list(&mut self, gpu: &Gpu, rows: Range<usize>) -> Result<()> {
        let (words, listed) = self.occupied.list(rows);
        self.listed = listed;
        gpu.write(&self.list, 0, &words)
    }

    /// Items of the runs of listed rows.
    pub(super) fn texels(&self, rows: &Range<usize>) -> Range<usize> {
        self.listed.items(0, rows)
    }

    /// Items of the empty runs beside them, above and below.
    pub(super) fn border(&self, rows: &Range<usize>) -> Range<usize> {
        self.listed.items(1, rows)
    }

    /// Records the points of some items of runs, from the first record on.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub(super) fn points(&self, batch: &mut Batch<'_>, items: &Range<usize>) -> Result<()> {
        batch.dispatch_range(&self.points, &self.group, items.start as u32, items.len() as u32)
    }
}

/// Which bins of a picture have triangles.
#[derive(Debug)]
struct Occupied {
    columns: usize,
    bins: Vec<bool>,
}

/// Where the runs of each row begin in the list: those of texels, then those of the border.
#[derive(Debug, Default)]
struct Listed {
    rows: Range<usize>,
    starts: [Vec<usize>; 2],
}

impl Occupied {
    fn new([width, height]: [usize; 2]) -> Self {
        let columns = width.div_ceil(RUN);
        Self { columns, bins: vec![false; columns * height.div_ceil(RUN)] }
    }

    fn mark(&mut self, bins: &Bins) {
        let of_row = bins.start.windows(2).map(|range| range[0] < range[1]);
        let first = bins.first[1] as usize * self.columns;
        for (bin, any) in self.bins[first..].iter_mut().zip(of_row) {
            *bin |= any;
        }
    }

    /// Whether the run at column `x` of row `y` is in a bin with triangles.
    fn at(&self, x: usize, y: usize) -> bool {
        x < self.columns && self.bins.get(y / RUN * self.columns + x).is_some_and(|any| *any)
    }

    /// Whether a run without triangles has a neighbour with some.
    fn is_border(&self, x: usize, y: usize) -> bool {
        let beside = (x > 0 && self.at(x - 1, y)) || self.at(x + 1, y);
        !self.at(x, y) && (beside || (y > 0 && self.at(x, y - 1)) || self.at(x, y + 1))
    }

    fn list(&self, rows: Range<usize>) -> (Vec<u32>, Listed) {
        let mut words = Vec::new();
        let mut part = |wanted: &dyn Fn(usize, usize) -> bool| {
            let mut starts = vec![words.len()];
            for y in rows.clone() {
                let run = |x: usize| (y as u32) << COLUMN_BITS | x as u32;
                words.extend((0..self.columns).filter(|x| wanted(*x, y)).map(run));
                starts.push(words.len());
            }
            starts
        };
        let starts = [part(&|x, y| self.at(x, y)), part(&|x, y| self.is_border(x, y))];
        (words, Listed { rows, starts })
    }
}

impl Listed {
    fn items(&self, part: usize, rows: &Range<usize>) -> Range<usize> {
        let at = |y: usize| self.starts[part][y - self.rows.start] * RUN;
        at(rows.start)..at(rows.end)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture of 5 x 3 bins, the last ones cut, of which two have triangles.
    fn occupied() -> Occupied {
        let mut occupied = Occupied::new([5 * RUN - 3, 3 * RUN - 1]);
        let bins = |row: u32, start: Vec<u32>| Bins { first: [0, row], columns: 5, start, entries: Vec::new() };
        occupied.mark(&bins(0, vec![0, 0, 2, 2, 2, 2]));
        occupied.mark(&bins(1, vec![0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1]));
        occupied
    }

    #[test]
    fn runs_are_the_rows_of_bins_with_triangles() {
        let occupied = occupied();
        let rows = RUN - 2..2 * RUN + 1;
        let (words, listed) = occupied.list(rows.clone());
        for y in rows.clone() {
            let one = y..y + 1;
            let found = |part| {
                let items = listed.items(part, &one);
                words[items.start / RUN..items.end / RUN].to_vec()
            };
            let expected: Vec<u32> = (0..5)
                .filter(|x| [(1, 0), (4, 1)].contains(&(*x, y / RUN)))
                .map(|x| (y as u32) << COLUMN_BITS | x as u32)
                .collect();
            assert_eq!(found(0), expected, "row {y}");
        }
        let all = listed.items(0, &rows);
        assert_eq!(all.len(), (2 + RUN) * RUN, "two rows of the one, all of the other");
    }

    #[test]
    fn the_border_is_what_a_texel_of_a_run_has_beside_it() {
        let occupied = occupied();
        let rows = 0..3 * RUN - 1;
        let (words, listed) = occupied.list(rows.clone());
        let in_part = |part: usize, x: usize, y: usize| {
            let items = listed.items(part, &(y..y + 1));
            words[items.start / RUN..items.end / RUN].contains(&((y as u32) << COLUMN_BITS | x as u32))
        };
        for y in rows.clone() {
            for x in 0..5_usize {
                let beside = [(x.wrapping_sub(1), y), (x + 1, y), (x, y.wrapping_sub(1)), (x, y + 1)];
                let near = beside.iter().any(|(x, y)| *x < 5 && rows.contains(y) && in_part(0, *x, *y));
                assert_eq!(in_part(1, x, y), near && !in_part(0, x, y), "{x} {y}");
            }
        }
    }
}
