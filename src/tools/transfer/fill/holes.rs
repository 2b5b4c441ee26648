//! Which texels are without colour, and which border on them.

use rayon::prelude::*;

use crate::geometry::NONE;
use crate::surface::{PackedImage, Status};
use crate::tools::transfer::band::Window;
use crate::tools::transfer::tables::SourceTriangle;

/// A texel in a hole, or beside one in the same chart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::tools::transfer) struct Texel {
    /// Row times width plus column.
    pub(in crate::tools::transfer) index: u32,
    /// Chart of the target.
    pub(in crate::tools::transfer) chart: u32,
    /// Whether it has no colour.
    pub(in crate::tools::transfer) hole: bool,
}

/// The holes of a layer with the texels around them, in the order of their indices.
#[derive(Clone, Debug, Default)]
pub(in crate::tools::transfer) struct Holes {
    pub(in crate::tools::transfer) texels: Vec<Texel>,
}

impl Holes {
    /// Whether there is nothing to fill.
    pub(in crate::tools::transfer) fn is_empty(&self) -> bool {
        !self.texels.iter().any(|t| t.hole)
    }

    /// Adds the holes of a band. With `doubtful`, texels that the map does not vouch for are holes,
    /// too.
    pub(in crate::tools::transfer) fn collect(
        &mut self,
        rows: &std::ops::Range<usize>,
        height: usize,
        window: &Window<'_>,
        source: &[SourceTriangle],
        texture_of: &[u32],
        doubtful: bool,
    ) {
        let width = window.width;
        let around = rows.start.saturating_sub(1)..(rows.end + 1).min(height);
        let (texels, images) = (window.texels(&around), window.images(&around));
        let colored = |i: &PackedImage| {
            i.face != NONE
                && texture_of[i.face as usize] != NONE
                && source[i.face as usize].chart != NONE
                && (i.status() == Status::Valid || (!doubtful && i.status() == Status::Doubtful))
        };
        let found: Vec<Vec<Texel>> = rows
            .clone()
            .into_par_iter()
            .map(|y| {
                let row = (y - around.start) * width;
                let mut found = Vec::new();
                for x in 0..width {
                    let i = row + x;
                    let chart = window.chart(&texels[i]);
                    if chart == NONE {
                        continue;
                    }
                    let hole = !colored(&images[i]);
                    let beside =
                        |inside: bool, j: usize| inside && window.chart(&texels[j]) == chart && !colored(&images[j]);
                    let wanted = hole
                        || beside(x > 0, i.wrapping_sub(1))
                        || beside(x + 1 < width, i + 1)
                        || beside(y > around.start, i.wrapping_sub(width))
                        || beside(y + 1 < around.end, i + width);
                    if wanted {
                        found.push(Texel { index: (y * width + x) as u32, chart, hole });
                    }
                }
                found
            })
            .collect();
        self.texels.extend(found.into_iter().flatten());
    }
}
