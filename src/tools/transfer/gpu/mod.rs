//! Texture transfer on a device: host halves of its kernels.
//!
//! | kernel | what it does | reference |
//! |---|---|---|
//! | `rasterize_atlas` | which point of the target a texel shows | [`rasterize_atlas`](super::atlas::rasterize_atlas) |
//! | `sample_texture` | the colour of a footprint | [`sample_texture`](super::sample::sample_texture) |
//! | `pad_columns`, `pad_seams` | the nearest covered texel, in the column and in the row | [`pad_seams`](super::pad::pad_seams) |
//!
//! What is decided in integers (coverage, padding) is the reference's to the bit. Footprints,
//! between map and sampling, are found on the host, where the map's images are judged.

mod pad_seams;
mod rasterize_atlas;
mod sample_texture;
mod stages;

use std::ops::Range;

pub use pad_seams::{PadParams, Padder};
pub use rasterize_atlas::{MOST_ENTRIES, RasterizeParams, Rasterizer};
pub use sample_texture::{DevicePicture, DeviceTexture, FootprintRecord, Sampler, TextureParams};
pub(super) use stages::Stages;

use crate::engine::Kernel;
use crate::error::{Error, Result};

/// The kernels of this folder.
pub const KERNELS: &[&Kernel] = &[
    &rasterize_atlas::RASTERIZE_ATLAS,
    &sample_texture::SAMPLE_TEXTURE,
    &pad_seams::PAD_COLUMNS,
    &pad_seams::PAD_SEAMS,
];

/// Items of one dispatch.
type Items = Range<usize>;

/// First item and count of a dispatch.
fn items(range: &Items) -> Result<(u32, u32)> {
    match (u32::try_from(range.start), u32::try_from(range.len())) {
        (Ok(first), Ok(count)) => Ok((first, count)),
        _ => Err(Error::Capability {
            limit: "items of a kernel".into(),
            required: range.end as u64,
            actual: u64::from(u32::MAX),
        }),
    }
}

/// The constants of the shaders that are these of Rust.
#[cfg(test)]
pub(crate) fn twins() -> Vec<crate::twins::Twin> {
    use super::atlas::{AtlasTexel, BIN, SUBTEXEL};
    use super::sample::{FAR, SLACK};
    use crate::geometry::{NONE, Wrap};
    use crate::twins::of;
    [
        of(
            "rasterize_atlas",
            [
                ("CENTRE", AtlasTexel::CENTRE.into()),
                ("FOOTPRINT", AtlasTexel::FOOTPRINT.into()),
                ("OVERLAP", AtlasTexel::OVERLAP.into()),
            ],
        ),
        of("lib/atlas", [("BIN", BIN.into()), ("SUBTEXEL", SUBTEXEL.into()), ("NONE", NONE.into())]),
        of(
            "lib/footprint",
            [
                ("SLACK", SLACK.into()),
                ("TRILINEAR", sample_texture::filtering(super::Filter::Trilinear).into()),
                ("BILINEAR", sample_texture::filtering(super::Filter::Bilinear).into()),
                ("CLAMP", sample_texture::mode(Wrap::Clamp).into()),
                ("MIRROR", sample_texture::mode(Wrap::Mirror).into()),
                ("FAR", FAR.into()),
            ],
        ),
    ]
    .concat()
}
