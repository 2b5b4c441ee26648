//! The filters by name.

use crate::words::words;

/// How the colour of a pixel is taken from a picture, of which it covers a footprint: a
/// parallelogram that may be smaller or larger than a pixel of the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Filter {
    /// Averages over the ellipse in the footprint (EWA, Heckbert 1989); Lanczos-3 where that is no
    /// larger than a pixel. No aliasing.
    Ewa,
    /// Averages over the footprint: boxes of a mip chain as wide as its narrow side, up to 16 of
    /// them along the wide one. Bilinear where it is no larger than a pixel.
    Anisotropic,
    /// One box of a mip chain by the wide side of the footprint: blurs where it is much wider than
    /// narrow.
    Trilinear,
    /// The four nearest pixels whatever the footprint: aliases where the picture is reduced.
    Bilinear,
    /// The pixel that holds the centre: no colour that the picture does not have; steps.
    Nearest,
    /// 6 x 6 pixels, windowed sinc with three lobes: sharp; aliases where the picture is reduced.
    Lanczos,
    /// The same with four lobes, 8 x 8 pixels.
    Lanczos4,
}

impl Filter {
    /// Whether it averages over the footprint: the others need its centre alone.
    pub const fn averages(self) -> bool {
        matches!(self, Self::Ewa | Self::Anisotropic | Self::Trilinear)
    }
}

words! { Filter, "filter", "a filter":
    Ewa => "ewa" "Averages over the ellipse that a pixel sees; sharp where nothing is reduced",
    Anisotropic => "anisotropic" "Averages of boxes along what a pixel sees",
    Trilinear => "trilinear" "One average as wide as what a pixel sees; blurs at a slant",
    Bilinear => "bilinear" "The four nearest pixels; aliases where the picture is reduced",
    Nearest => "nearest" "The nearest pixel: no new colours",
    Lanczos => "lanczos" "6 x 6 pixels: sharp; aliases where the picture is reduced",
    Lanczos4 => "lanczos4" "8 x 8 pixels: as lanczos, a little sharper",
}
