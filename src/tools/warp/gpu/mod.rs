//! Warping on a device: host halves of its kernels.
//!
//! | kernel | what it does | reference |
//! |---|---|---|
//! | `halve_texels` | the levels of a picture that is on the device | [`Pyramid`](super::pyramid::Pyramid) |
//! | `place_pixels` | where pixels look, by the polynomials of the map's inverse | [`Patches::find`](crate::mapping::plane::Patches::find) and `sight` |
//! | `place_left` | pixels that the host has found take their places | none: it only copies |
//! | `filter_pixels` | what they see of the picture | [`warp_image`](super::gather::warp_image) |
//! | `store_pixels` | samples of the result | [`store`](super::store::store) |
//! | `count_pixels` | what became of them | [`count_pixels`](pixels::count_pixels) |
//! | `paint_lattice`, `paint_wide` | the triangle of a lattice that each pixel of a preview shows | `Preimages` of the lattice |
//! | `show_lattice` | what the preview shows there | [`Preview`](super::Preview) |
//! | `warp_image` | as `filter_pixels`, from windows of the picture | [`warp_image`](super::gather::warp_image) |
//!
//! A picture that fits the device goes up once, as it is stored, and so do the squares of the map's
//! inverse (`resident`). Of each band then only finished pixels come down; up go the few
//! pre-images that no polynomial is bounded at, and what the target polygon covers. Other pictures
//! go up in windows, decoded, with the pre-image of every pixel ([`warp_image`]).

pub(super) mod lattice;
#[doc(hidden)]
pub mod picture;
#[doc(hidden)]
pub mod pixels;
#[doc(hidden)]
pub mod place;
pub(super) mod resident;

mod windowed;

pub use windowed::{WarpParams, WindowPlace, warp_image};

use crate::engine::Kernel;

/// The kernels of this folder.
pub const KERNELS: &[&Kernel] = &[
    windowed::KERNELS[0],
    windowed::KERNELS[1],
    windowed::KERNELS[2],
    &picture::HALVE_TEXELS[0],
    &picture::HALVE_TEXELS[1],
    &picture::HALVE_TEXELS[2],
    &place::PLACE_PIXELS,
    &place::PLACE_LEFT,
    &pixels::FILTER_PIXELS[0][0],
    &pixels::FILTER_PIXELS[1][0],
    &pixels::FILTER_PIXELS[2][0],
    &pixels::STORE_PIXELS[0][0],
    &pixels::STORE_PIXELS[1][1],
    &pixels::STORE_PIXELS[2][0],
    &pixels::COUNT_PIXELS,
    &lattice::PAINT_LATTICE,
    &lattice::PAINT_WIDE,
    &lattice::SHOW_LATTICE,
];

/// The constants of the shaders that are these of Rust.
#[cfg(test)]
pub(crate) fn twins() -> Vec<crate::twins::Twin> {
    use crate::picture::ellipse;
    use crate::twins::of;
    [
        windowed::twins(),
        lattice::twins(),
        crate::mapping::plane::patch_twins(),
        of(
            "lib/ellipse",
            [
                ("VARIANCE", ellipse::VARIANCE.into()),
                ("MOMENT", ellipse::MOMENT.into()),
                ("FINEST", ellipse::FINEST.into()),
                ("LONGEST", ellipse::LONGEST.into()),
                ("INTERPOLATED", ellipse::INTERPOLATED.into()),
                ("AVERAGED", ellipse::AVERAGED.into()),
            ],
        ),
        of("lib/halvings", [("MOST_HALVINGS", picture::MOST_LEVELS as f64)]),
        of("lib/place", [("UNMAPPED", place::UNMAPPED.into())]),
        of("place_pixels", [("RUN", place::RUN as f64)]),
        of("count_pixels", [("RUN", pixels::RUN as f64)]),
    ]
    .concat()
}
