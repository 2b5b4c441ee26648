//! Rows of texels and images on a device, of which the bands of a picture take turns.

use std::ops::Range;

use bytemuck::{Pod, Zeroable};

use crate::engine::{Buffer, Gpu, Layout, UniformBlocks};
use crate::error::Result;
use crate::kernel_layout as layout;
use crate::surface::PackedImage;
use crate::tools::transfer::atlas::AtlasTexel;

/// Parameters of the kernels that work on rows; twin of the struct in `shaders/lib/window.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct WindowParams {
    width: u32,
    height: u32,
    rows: u32,
    unused: u32,
}

pub(super) const WINDOW_LAYOUT: Layout = layout!(WindowParams, { width, height, rows, unused });
pub(super) const IMAGE_LAYOUT: Layout = layout!(PackedImage, { face, b0, b1, confidence, status });

/// Texels and images of some rows: row y is kept at place y modulo their number.
#[derive(Debug)]
pub(super) struct Rows {
    pub(super) width: usize,
    pub(super) height: usize,
    /// Rows that are kept.
    pub(super) kept: usize,
    pub(super) texels: Buffer<AtlasTexel>,
    pub(super) images: Buffer<PackedImage>,
    pub(super) params: UniformBlocks<WindowParams>,
}

impl Rows {
    /// Room for `kept` rows of a picture.
    pub(super) fn new(gpu: &Gpu, [width, height]: [usize; 2], kept: usize) -> Result<Self> {
        let params = WindowParams { width: width as u32, height: height as u32, rows: kept as u32, unused: 0 };
        Ok(Self {
            width,
            height,
            kept,
            texels: gpu.buffer("texels", kept * width)?,
            images: gpu.buffer("images", kept * width)?,
            params: gpu.uniform("window", &params)?,
        })
    }

    /// Where row `y` is kept.
    pub(super) fn place(&self, y: usize) -> usize {
        y % self.kept
    }

    /// Parts of `rows` that are kept one row after the other.
    pub(super) fn pieces(&self, rows: Range<usize>) -> Vec<Range<usize>> {
        pieces(self.kept, rows)
    }
}

fn pieces(kept: usize, rows: Range<usize>) -> Vec<Range<usize>> {
    let mut pieces = Vec::new();
    let mut first = rows.start;
    while first < rows.end {
        let end = rows.end.min(first + kept - first % kept);
        pieces.push(first..end);
        first = end;
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::pieces;

    #[test]
    fn pieces_end_where_places_begin_anew() {
        let ends = |rows| pieces(10, rows).iter().map(|p| [p.start, p.end]).collect::<Vec<_>>();
        assert_eq!(ends(3..8), [[3, 8]]);
        assert_eq!(ends(8..17), [[8, 10], [10, 17]]);
        assert_eq!(ends(10..20), [[10, 20]]);
        assert!(pieces(10, 5..5).is_empty());
    }
}
