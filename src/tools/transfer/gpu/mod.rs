//! Texture transfer on a device: host halves of its kernels.
//!
//! | kernel | what it does | reference |
//! |---|---|---|
//! | `rasterize_atlas` | which point of the target a texel shows | [`rasterize_atlas`](super::atlas::rasterize_atlas) |
//! | `sample_texture` | the colour of a footprint | [`sample_texture`](super::sample::sample_texture) |
//! | `pad_columns`, `pad_seams` | the nearest covered texel, in the column and in the row | [`pad_seams`](super::pad::pad_seams) |
//!
//! Each of these takes from the host and gives back to it. With a map that works on the same device
//! texels stay there from the atlas to the finished pictures; then these come in between:
//!
//! | kernel | what it does | reference |
//! |---|---|---|
//! | `list_points` | points of texels, without those that show nothing | none: it only copies |
//! | `gather_left`, `place_images` | exchange of the points that searches leave | none: they only copy |
//! | `locate` | where a texel lies on the source | [`locate`](super::footprint::locate) |
//! | `footprint` | how its square is stretched there | [`footprint`](super::footprint::footprint) |
//! | `fill_background` | a picture of background | none: it only writes |
//! | `store_texel` | samples of the result, exact texels | `layer::store`, `exact::copy_coinciding` |
//! | `tally` | coverage, counts and areas | `tally::Tally` |
//! | `coverage_bits` | covered texels as bits | `pad_seams::column_bits` |
//! | `copy_padding` | colours of the padding | `layer::copy_padding` |
//! | `blank_texels`, `show_texels` | what a live transfer clears and shows | none: they write |
//!
//! What is decided in integers (coverage, padding) is the reference's to the bit.

mod copy_padding;
mod device_picture;
mod exchange;
mod locate;
mod pad_seams;
mod padding_parts;
mod picture;
mod rasterize_atlas;
mod resident;
mod runs;
mod sample_texture;
mod shown;
mod stages;
mod store_texel;
mod tally;
mod window;

use std::ops::Range;

pub use copy_padding::{CopyParams, CoverParams};
pub use device_picture::DevicePicture;
pub(in crate::tools) use device_picture::{light_of_samples, stored_samples};
pub use exchange::Found;
pub use pad_seams::{PadParams, Padder};
pub(super) use picture::Plate;
pub use rasterize_atlas::{MOST_ENTRIES, RasterizeParams, Rasterizer};
pub use resident::LiveFrame;
pub(super) use resident::{LiveDevice, Resident, Seen, Work};
pub use sample_texture::{DeviceTexture, FootprintRecord, Sampler, TextureParams};
pub(super) use stages::Stages;
pub use store_texel::{BackgroundParams, StoreParams};
pub(in crate::tools) use store_texel::{Format, step_table};
pub use window::WindowParams;

use crate::engine::Kernel;
use crate::error::{Error, Result};

/// The kernels of this folder.
pub const KERNELS: &[&Kernel] = &[
    &rasterize_atlas::RASTERIZE_ATLAS,
    &runs::LIST_POINTS,
    &exchange::GATHER_LEFT,
    &exchange::PLACE_IMAGES,
    &locate::LOCATE,
    &locate::FOOTPRINT,
    &sample_texture::SAMPLE_TEXTURE,
    &store_texel::FILL_BACKGROUND,
    &store_texel::STORE_TEXEL,
    &tally::TALLY,
    &copy_padding::COVERAGE_BITS,
    &pad_seams::PAD_COLUMNS,
    &pad_seams::PAD_SEAMS,
    &copy_padding::COPY_PADDING,
    &shown::BLANK_TEXELS,
    &shown::SHOW_TEXELS,
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
    use super::coverage::{DOUBTFUL, PADDING, VALID};
    use super::footprint::{AGREE, JUMP};
    use super::pad::COVERED;
    use super::{exact, tally as sums};
    use crate::geometry::Wrap;
    use crate::picture::taps::{FAR, LARGEST_FOOTPRINT, SLACK};
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
        of("lib/atlas", [("BIN", BIN.into()), ("SUBTEXEL", SUBTEXEL.into())]),
        of(
            "lib/footprint",
            [
                ("SLACK", SLACK.into()),
                ("TRILINEAR", sample_texture::filtering(super::Filter::Trilinear).into()),
                ("BILINEAR", sample_texture::filtering(super::Filter::Bilinear).into()),
                ("LARGEST_FOOTPRINT", LARGEST_FOOTPRINT.into()),
            ],
        ),
        of(
            "lib/wrap",
            [
                ("CLAMP", sample_texture::mode(Wrap::Clamp).into()),
                ("MIRROR", sample_texture::mode(Wrap::Mirror).into()),
                ("FAR", FAR.into()),
            ],
        ),
        of("lib/runs", [("RUN_BITS", runs::RUN_BITS.into())]),
        of("locate", [("CENTRE", AtlasTexel::CENTRE.into())]),
        of("footprint", [("JUMP", JUMP.into()), ("AGREE", AGREE.into())]),
        of("store_texel", [("NEAR", exact::NEAR.into()), ("ALIKE", exact::ALIKE.into())]),
        of(
            "tally",
            [
                ("WORDS", sums::WORDS.into()),
                ("HOLE", sums::HOLE.into()),
                ("COVER_DOUBTFUL", DOUBTFUL.into()),
                ("COVER_VALID", VALID.into()),
                ("CENTRE", AtlasTexel::CENTRE.into()),
                ("OVERLAP", AtlasTexel::OVERLAP.into()),
            ],
        ),
        of("coverage_bits", [("COVERED", COVERED.into())]),
        of("blank_texels", [("COVERED", COVERED.into())]),
        of("copy_padding", [("HOLE", sums::HOLE.into()), ("PADDING", PADDING.into())]),
    ]
    .concat()
}
