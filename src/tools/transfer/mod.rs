//! Texture transfer: the picture of one mesh on another, through a map between their points.
//!
//! The stages, each a module: the target's atlas is rasterised ([`atlas`]), covered texels are
//! mapped to the source ([`PointMap`]), their footprints there are found ([`footprint`]) and
//! averaged ([`sample`], on the chains of [`mip`]), and the charts' borders are padded ([`pad`]).
//! Large textures go through in bands of rows, so that memory stays within a limit.
//!
//! Section 4.3 of Panozzo et al. 2013, with filtering (named there as future work), padding,
//! coverage, depths and layers added.

#[doc(hidden)]
pub mod atlas;
#[doc(hidden)]
pub mod bins;
#[doc(hidden)]
pub mod charts;
#[doc(hidden)]
pub mod color;
#[doc(hidden)]
pub mod footprint;
#[doc(hidden)]
pub mod gpu;
#[doc(hidden)]
pub mod mip;
#[doc(hidden)]
pub mod pad;
#[doc(hidden)]
pub mod sample;
#[doc(hidden)]
pub mod seams;
#[doc(hidden)]
pub mod tables;
#[doc(hidden)]
pub mod tiles;

mod band;
mod bands;
mod coordinates;
mod device_live;
mod driver;
mod exact;
mod fill;
mod kind;
mod layer;
mod live;
mod lookup;
mod nearest;
mod normal_code;
mod output;
mod plan;
mod pyramids;
mod rebase;
mod recognise;
mod tally;
mod vertex_colors;
mod windowed;

pub use crate::picture::Filter;
pub use crate::tools::stopwatch::StageTime;
pub use bins::UvRegion;
pub use device_live::DeviceLiveTransfer;
pub use driver::{transfer, transfer_on, transfer_with};
pub use fill::Fill;
pub use gpu::LiveFrame;
pub use kind::{LayerKind, NormalY, Relief};
pub use layer::Layer;
pub use live::{Followed, LiveTransfer};
pub use mip::{Alpha, Encoding};
#[doc(hidden)]
#[doc(hidden)]
pub use plan::check_beforehand;
pub use plan::memory_needed;
pub use pyramids::Pyramids;
#[doc(hidden)]
pub use recognise::holds_normals;
#[doc(hidden)]
pub use seams::{SeamSteps, seam_steps};
#[doc(hidden)]
pub use tiles::TilesUsed;
pub use tiles::UvTile;

use crate::picture::Image;

#[cfg(doc)]
use crate::surface::PointMap;

/// Largest side of a texture.
pub const LARGEST_SIDE: u32 = 16384;

/// Values of the coverage picture.
pub mod coverage {
    /// Background.
    pub const NOTHING: u8 = 0;
    /// Copied from the nearest covered texel.
    pub const PADDING: u8 = 64;
    /// Coloured, but the map does not vouch for it; or filled.
    pub const DOUBTFUL: u8 = 128;
    /// Coloured, and the map vouches for it.
    pub const VALID: u8 = 255;
}

/// What texels without colour get.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Background {
    /// Alpha 0; pictures without alpha get it.
    #[default]
    Transparent,
    /// A stored value (0..1 for integers), RGBA; grey pictures take the first and the last.
    /// Channels stay as they are.
    Color([f32; 4]),
}

/// How a texture is transferred.
#[derive(Clone, Debug, PartialEq)]
pub struct TransferOptions {
    /// Texels per row of the result, 1 to 16384.
    pub width: u32,
    /// Rows of the result, 1 to 16384.
    pub height: u32,
    /// Texels around the charts that are padded, by Euclidean distance of centres; 0 for none.
    pub margin: u32,
    /// Samples along a texel's side, 1 to 4: each is rasterised, mapped and filtered for itself.
    /// The map is evaluated (n^2 + 1) times as often for n > 1; meant as a reference of quality.
    pub supersample: u32,
    /// How the source's textures are averaged.
    pub filter: Filter,
    /// Largest number of taps of the anisotropic filter, 1 to 16.
    pub taps: u32,
    /// What texels without colour get.
    pub background: Background,
    /// What texels of charts without colour get: those whose map failed or led to a triangle
    /// without texture.
    pub fill: Fill,
    /// Fill texels that the map does not vouch for, too.
    pub fill_doubtful: bool,
    /// Whether an ST-map is made: [`TransferOutput::coordinates`].
    pub coordinates: bool,
    /// Which part of the target's texture coordinates the result shows.
    pub region: UvRegion,
    /// Only the target's triangles of this material, if given.
    pub material: Option<u32>,
    /// Bytes that may be allocated at any time, the result included, the caller's meshes and
    /// pictures not.
    pub memory: u64,
}

impl Default for TransferOptions {
    fn default() -> Self {
        Self {
            width: 2048,
            height: 2048,
            margin: 16,
            supersample: 1,
            filter: Filter::Anisotropic,
            taps: 16,
            background: Background::default(),
            fill: Fill::default(),
            fill_doubtful: false,
            coordinates: false,
            region: UvRegion::default(),
            material: None,
            memory: 4 << 30,
        }
    }
}

/// What a transfer gives.
#[derive(Clone, Debug, PartialEq)]
pub struct TransferOutput {
    /// One picture per layer, in the depth of its textures.
    pub layers: Vec<Image>,
    /// 8-bit grey with the values of [`coverage`].
    pub coverage: Image,
    /// The ST-map, if [`TransferOptions::coordinates`] asks for it: a float picture with the
    /// source's texture coordinates u (right) and v (up) in red and green, the coverage over 255 in
    /// blue, and alpha 1 where there are coordinates. They are 0..1 in the source's picture; for
    /// sources with UDIM tiles ([`Layer::face_texture`]) those of the file. Sampled at the texels'
    /// centres, padded like the pictures, never filled.
    pub coordinates: Option<Image>,
    /// Counts, fractions and times.
    pub stats: TransferStats,
}

/// Counts, fractions and times of a transfer.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TransferStats {
    /// Texels of the result.
    pub texels: u64,
    /// Texels that show a point of the target; these were mapped.
    pub covered: u64,
    /// Of these, texels whose centre lies in a chart; of the others only a part of their square
    /// does.
    pub covered_centre: u64,
    /// Texels whose centre lies in several triangles; the lowest one is shown.
    pub overlapping: u64,
    /// Coloured texels that the map vouches for.
    pub valid: u64,
    /// Coloured texels that it does not vouch for.
    pub doubtful: u64,
    /// Covered texels whose map failed or led to a triangle without texture.
    pub colorless: u64,
    /// Texels filled by [`TransferOptions::fill`], in some layer.
    pub filled: u64,
    /// Texels filled by padding.
    pub padded: u64,
    /// Covered area of the target, in units of the square of the longest side of the source's box;
    /// areas of the target are scaled to the source's whole area.
    pub covered_area: f64,
    /// Valid share of the covered area of the target.
    pub valid_fraction: f64,
    /// Doubtful share of the covered area of the target.
    pub doubtful_fraction: f64,
    /// Triangles of the target without texture coordinates.
    pub missing_texcoords: u64,
    /// Triangles of the target without area in the texture (on its 1/256 texel grid).
    pub degenerate_texcoords: u64,
    /// Triangles of the target that are clockwise in texture coordinates.
    pub mirrored_texcoords: u64,
    /// Length on the target per length on the source, over all, where normals or heights were
    /// carried: the strength of a displacement map is to be multiplied by it.
    pub size_ratio: Option<f64>,
    /// Bytes planned for, at most the limit.
    pub memory: u64,
    /// Bands of rows the result was made in.
    pub bands: u64,
    /// Time of each stage.
    pub stages: Vec<StageTime>,
    /// Stages that ran on a device, the map aside.
    pub device_stages: Vec<&'static str>,
    /// Why stages that were to run on a device did not, or holes were not filled, a line each.
    pub notes: Vec<String>,
}
