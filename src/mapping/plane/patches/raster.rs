//! Which pixels lie in which square, and where.

use glam::{DVec2, UVec2};
use rayon::prelude::*;

use super::fit::MARGIN;
use super::solve::{Run, Solved};
use super::{Leaf, Open, Patch, Patches};
use crate::engine::Lanes;
use crate::mapping::plane::preimage::{self, SLACK};

/// Rows that one task fills.
const BAND: usize = 16;

/// A point this far out in a square, by the larger component, is found there whatever is rounded:
/// halfway into the margin, and 200,000 roundings from its end.
const CERTAIN: f32 = 1.0 + 0.5 * MARGIN as f32;

/// No square.
pub const NOWHERE: u32 = u32::MAX;

/// Pre-images of the pixel centres of some rows, row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Found {
    /// The leaf that each pixel lies in, or [`NOWHERE`].
    pub leaf: Vec<u32>,
    /// Its place there; in open leaves a start, without derivatives.
    pub solved: Vec<Solved>,
}

impl Found {
    /// `count` pixels that lie nowhere.
    pub fn none(&mut self, count: usize) {
        self.leaf.clear();
        self.leaf.resize(count, NOWHERE);
        self.solved.resize(count, UNSOLVED);
    }
}

/// Some rows of it.
struct Rows<'a> {
    leaf: &'a mut [u32],
    solved: &'a mut [Solved],
    width: usize,
    /// The row of the canvas that the first is.
    first: f64,
}

const UNSOLVED: Solved = Solved { at: [0.0; 2], dx: [0.0; 2], dy: [0.0; 2] };

impl Patches {
    /// The pre-images of `rows` rows of `width` pixels from row `first` of the canvas on, into
    /// `found`.
    ///
    /// Where squares overlap, as they do where a map folds, the later one is taken. O(pixels +
    /// squares), parallel over rows.
    pub fn find(&self, first: usize, size: UVec2, found: &mut Found) {
        self.find_where(first, size, found, false);
    }

    /// As [`Patches::find`], of the pixels alone that polynomials do not settle: those in and
    /// around open squares, and pixels beside these whose square depends on a rounding. The others
    /// are nowhere in `found`.
    pub fn find_open(&self, first: usize, size: UVec2, found: &mut Found) {
        self.find_where(first, size, found, true);
    }

    fn find_where(&self, first: usize, size: UVec2, found: &mut Found, open: bool) {
        let (width, height) = (size.x as usize, size.y as usize);
        found.none(width * height);
        let mut bands = vec![Vec::new(); height.div_ceil(BAND)];
        for (i, leaf) in self.leaves.iter().enumerate() {
            let rows = match leaf {
                Leaf::Bounded(patch) => patch.rows(),
                Leaf::Open(open) => open.rows(),
            };
            let [low, high] = rows.map(|y| y - first as f64 - 0.5);
            // Casts saturate, and turn NaN into 0.
            let (low, high) = (low.floor().max(0.0) as usize, high.ceil());
            if high >= 0.0 && low < height {
                let last = (high as usize).min(height - 1);
                bands[low / BAND..=last / BAND].iter_mut().for_each(|b| b.push(i as u32));
            }
        }
        let rows = BAND * width.max(1);
        let parts = found.leaf.par_chunks_mut(rows).zip(found.solved.par_chunks_mut(rows));
        parts.zip(bands).enumerate().for_each(|(band, ((leaf, solved), leaves))| {
            let mut rows = Rows { leaf, solved, width, first: (first + band * BAND) as f64 };
            let all = || leaves.iter().map(|i| &self.leaves[*i as usize]);
            let columns = if open { rows.open_columns(all()) } else { rows.all_columns() };
            for i in &leaves {
                match &self.leaves[*i as usize] {
                    Leaf::Bounded(patch) => rows.exact(*i, patch, &columns),
                    Leaf::Open(open) => rows.triangles(*i, open),
                }
            }
            for i in &leaves {
                if let Leaf::Open(open) = &self.leaves[*i as usize] {
                    rows.around(*i, open);
                }
            }
            if open {
                rows.drop_certain(&self.leaves, &columns);
            }
        });
    }
}

impl Rows<'_> {
    fn height(&self) -> usize {
        self.leaf.len() / self.width.max(1)
    }

    /// Columns from and to; none in a picture without any.
    fn all_columns(&self) -> Vec<[f64; 2]> {
        let last = self.width as f64 - 1.0;
        if last < 0.0 { Vec::new() } else { vec![[0.0, last]] }
    }

    /// Those that open squares and what is around them may reach, in order, none twice.
    fn open_columns<'l>(&self, leaves: impl Iterator<Item = &'l Leaf>) -> Vec<[f64; 2]> {
        let last = self.width as f64 - 1.0;
        let reached = |leaf: &Leaf| match leaf {
            Leaf::Bounded(_) => None,
            Leaf::Open(open) => {
                let [low, high] = open.columns();
                Some([(low - 0.5).floor().max(0.0), (high - 0.5).ceil().min(last)])
            }
        };
        let mut all: Vec<[f64; 2]> = leaves.filter_map(reached).filter(|[low, high]| low <= high).collect();
        all.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let mut apart: Vec<[f64; 2]> = Vec::with_capacity(all.len());
        for [low, high] in all {
            match apart.last_mut() {
                Some(before) if low <= before[1] + 1.0 => before[1] = before[1].max(high),
                _ => apart.push([low, high]),
            }
        }
        apart
    }

    /// Takes back the pixels whose square does not depend on a rounding.
    fn drop_certain(&mut self, leaves: &[Leaf], columns: &[[f64; 2]]) {
        for y in 0..self.height() {
            for [from, to] in columns {
                for i in y * self.width + *from as usize..=y * self.width + *to as usize {
                    let [u, v] = self.solved[i].at;
                    let bounded = matches!(leaves.get(self.leaf[i] as usize), Some(Leaf::Bounded(_)));
                    if bounded && u.abs().max(v.abs()) <= CERTAIN {
                        self.leaf[i] = NOWHERE;
                    }
                }
            }
        }
    }

    /// The pixels of a patch in some columns.
    fn exact(&mut self, index: u32, patch: &Patch, of: &[[f64; 2]]) {
        let lanes = Lanes::detect();
        let [low, high] = patch.rows().map(|y| y - self.first - 0.5);
        let last = high.floor().min(self.height() as f64 - 1.0);
        let mut y = low.ceil().max(0.0);
        while y <= last {
            let row = self.first + y + 0.5;
            if let Some(columns) = patch.columns(row) {
                let [from, to] = columns.map(|x| x - 0.5);
                for [low, high] in of {
                    let (from, to) = (from.ceil().max(*low), to.floor().min(*high));
                    if from <= to {
                        let start = y as usize * self.width + from as usize;
                        let count = (to - from) as usize + 1;
                        let (leaf, solved) = (&mut *self.leaf, &mut *self.solved);
                        let found = |k: usize, s: Solved| {
                            leaf[start + k] = index;
                            solved[start + k] = s;
                        };
                        let from = (DVec2::new(from + 0.5, row) - patch.image).as_vec2().to_array();
                        lanes.run(Run { patch, from, count, found });
                    }
                }
            }
            y += 1.0;
        }
    }

    /// The pixels of an open square: linear in the triangles around its centre.
    fn triangles(&mut self, index: u32, open: &Open) {
        const RING: [usize; 8] = [0, 1, 2, 5, 8, 7, 6, 3];
        let corner = DVec2::new(0.5, 0.5 + self.first);
        let place = |k: usize| DVec2::new((k % 3) as f64 - 1.0, (k / 3) as f64 - 1.0);
        for k in 0..8 {
            let nodes = [4, RING[k], RING[(k + 1) % 8]];
            let (leaf, solved) = (&mut *self.leaf, &mut *self.solved);
            let count = leaf.len();
            let images = nodes.map(|n| open.images[n] - corner);
            preimage::fill(images, nodes.map(place), self.width, count, |run, start, step| {
                leaf[run.clone()].fill(index);
                for (k, solved) in solved[run].iter_mut().enumerate() {
                    *solved = Solved { at: (start + step * k as f64).as_vec2().to_array(), ..UNSOLVED };
                }
            });
        }
    }

    /// The pixels next to an open square that no square has: they lie between its straight sides
    /// and the curves that they stand for.
    fn around(&mut self, index: u32, open: &Open) {
        let Some([low, high]) = open.surroundings() else { return };
        let [low, high] = [low, high].map(|p| p - DVec2::new(0.5, 0.5 + self.first));
        let last = high.min(DVec2::new(self.width as f64, self.height() as f64) - 1.0);
        let first = low.ceil().max(DVec2::ZERO);
        if !first.cmple(last).all() {
            return;
        }
        for y in first.y as usize..=last.y as usize {
            for i in y * self.width + first.x as usize..=y * self.width + last.x as usize {
                if self.leaf[i] == super::NOWHERE {
                    self.leaf[i] = index;
                    self.solved[i] = UNSOLVED;
                }
            }
        }
    }
}

/// An open square that shows larger than this is one of a map that is not a number, or of no
/// interest.
const LARGEST: f64 = 256.0;

impl Open {
    fn bounds(&self) -> [DVec2; 2] {
        self.images.iter().fold([self.images[0]; 2], |[a, b], p| [a.min(*p), b.max(*p)])
    }

    fn rows(&self) -> [f64; 2] {
        let [low, high] = self.bounds().map(|p| p.y);
        match self.surroundings() {
            Some([a, b]) => [a.y, b.y],
            None => [low - SLACK, high + SLACK],
        }
    }

    fn columns(&self) -> [f64; 2] {
        let [low, high] = self.bounds().map(|p| p.x);
        match self.surroundings() {
            Some([a, b]) => [a.x, b.x],
            None if self.images.iter().all(|p| p.is_finite()) => [low - SLACK, high + SLACK],
            None => [f64::NEG_INFINITY, f64::INFINITY],
        }
    }

    /// What is less than a quarter of its size away; at least a pixel.
    fn surroundings(&self) -> Option<[DVec2; 2]> {
        let [low, high] = self.bounds();
        let reach = DVec2::splat(0.25 * (high - low).max_element() + 1.0);
        (self.images.iter().all(|p| p.is_finite()) && reach.x <= LARGEST).then_some([low - reach, high + reach])
    }
}
