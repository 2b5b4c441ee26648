//! How much memory a transfer takes, and the bands of rows that keep it within a limit.

use super::bins::Atlas;
use super::gpu::Stages;
use super::mip::MipChain;
use super::tables::{SourceTriangle, TargetTriangle};
use super::{Layer, TransferOptions, rebase};
use crate::error::{Error, Result};
use crate::geometry::Mesh;

/// Bytes per texel of a band and of each of its samples: texel, image, point and its image,
/// footprint, colour, spare.
const BAND_TEXEL: u64 = 128;
/// Bytes per triangle in a bin while bins are sorted.
pub(super) const BIN_ENTRY: u64 = 64;
/// Bytes per triangle corner while charts are found.
const CHART_CORNER: u64 = 96;
/// Bytes per triangle of a copy of the source with other texture coordinates.
const PLACED: u64 = 256;
/// Texels of a band beyond which nothing is gained.
const LARGEST_BAND: u64 = 1 << 20;

/// How a transfer goes about its work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Plan {
    /// Rows of a band.
    pub(super) rows: usize,
    /// Most records of triangles in the texture.
    pub(super) most_triangles: usize,
    /// Most triangles in the bins of a band.
    pub(super) most_entries: usize,
    /// Bytes at most.
    pub(super) bytes: u64,
}

/// Bytes that stay allocated throughout: results, mip chains, tables of triangles.
pub(super) fn fixed(source: &Mesh, layers: &[Layer<'_>], target: &Mesh, options: &TransferOptions) -> u64 {
    let texels = u64::from(options.width) * u64::from(options.height);
    let (s, t) = (source.triangle_count() as u64, target.triangle_count() as u64);
    let mut bytes = texels * if options.coordinates { 17 } else { 1 };
    for layer in layers {
        let (channels, depth) = layer.output_format(options.background);
        bytes += texels * u64::from(channels) * depth.bytes() as u64 + 4 * s;
        bytes += layer.images.iter().map(|i| MipChain::bytes(i.width, i.height, i.channels)).sum::<u64>();
    }
    let grids = if options.supersample > 1 { 2 } else { 1 };
    // Tables of layers that lie differently on the source, with texture coordinates of their own.
    let placed = layers.iter().filter(|l| l.vertices.is_some() || !l.placements.is_empty()).count() as u64;
    bytes += placed * s * (size_of::<SourceTriangle>() as u64 + PLACED);
    bytes += s * size_of::<SourceTriangle>() as u64 + grids * t * size_of::<TargetTriangle>() as u64;
    // Triangles in the texture, once each; repeats come out of what is left.
    bytes += grids * t * Atlas::RECORD as u64;
    if layers.iter().any(|l| rebase::needs_frames(l.kind)) {
        bytes += rebase::bytes(source, target);
    }
    bytes + 3 * s.max(t) * CHART_CORNER
}

/// Bytes per row of a band; bins take as much again.
fn row(options: &TransferOptions) -> u64 {
    let samples = u64::from(options.supersample) * u64::from(options.supersample);
    let per_texel = if samples > 1 { 1 + samples } else { 1 };
    let padding = 16;
    u64::from(options.width) * (BAND_TEXEL * per_texel).max(padding) * 2
}

/// Rows at hand beside a band's own: one on either side, at each resolution.
const HALO: u64 = 2;

/// The least memory with which [`super::transfer`] does this work, in bytes: results, mip chains of
/// the sources, tables, and the smallest bands. More makes larger bands, and lets a device work:
/// its copies count, too. Meshes whose triangles crowd a few rows may need more for their bins.
pub fn memory_needed(source: &Mesh, layers: &[Layer<'_>], target: &Mesh, options: &TransferOptions) -> u64 {
    fixed(source, layers, target, options) + (1 + HALO) * row(options) + least_bins(target)
}

/// Fails where [`super::transfer`] would for options, pictures and meshes that do not fit, or for
/// what takes more than `options.memory`: before a map is made.
///
/// # Errors
/// As [`super::transfer`].
pub fn check_beforehand(source: &Mesh, layers: &[Layer<'_>], target: &Mesh, options: &TransferOptions) -> Result<()> {
    super::driver::check(source, layers, target, options)?;
    within(memory_needed(source, layers, target, options), options)
}

/// Fails if a transfer takes more than is allowed.
fn within(required: u64, options: &TransferOptions) -> Result<()> {
    if required <= options.memory {
        return Ok(());
    }
    let what = format!("a transfer to {} x {} texels", options.width, options.height);
    Err(Error::Memory { what, required, allowed: options.memory })
}

/// Every triangle in at least a few bins of one band.
fn least_bins(target: &Mesh) -> u64 {
    (target.triangle_count() as u64 * 2 + 1024) * BIN_ENTRY
}

impl Plan {
    pub(super) fn new(
        source: &Mesh,
        layers: &[Layer<'_>],
        target: &Mesh,
        options: &TransferOptions,
        stages: &Stages<'_>,
    ) -> Result<Self> {
        let device = stages.bytes(target, layers, options);
        let needed = memory_needed(source, layers, target, options) + device;
        within(needed, options)?;
        let base = fixed(source, layers, target, options) + least_bins(target) + device;
        let row = row(options);
        let band = LARGEST_BAND.div_ceil(u64::from(options.width)).clamp(1, u64::from(options.height));
        let rows = ((options.memory - base) / row - HALO).clamp(1, band);
        let bands = (rows + HALO) * row;
        let spare = options.memory - base - bands;
        let entries = (bands / 2 + least_bins(target) + spare / 2) / BIN_ENTRY;
        let triangles = target.triangle_count() as u64 + spare / 4 / Atlas::RECORD as u64;
        Ok(Self {
            rows: rows as usize,
            most_triangles: triangles as usize,
            most_entries: entries as usize,
            bytes: base + bands,
        })
    }
}
