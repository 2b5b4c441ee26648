//! What a picture file holds beside its pixels.

use super::format::Format;

/// What a picture file says of its picture, to be written with what becomes of it.
///
/// The orientation is not part of it: pictures are turned as it says when they are read, and
/// written upright.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Metadata {
    /// ICC profile: what the colours mean.
    pub icc: Option<Vec<u8>>,
    /// EXIF block (a TIFF header and directories): camera, date, place and the like.
    pub exif: Option<Vec<u8>>,
    /// XMP packet: what programs wrote about the picture.
    pub xmp: Option<Vec<u8>>,
    /// Pixels per length.
    pub density: Option<Density>,
    /// Quality of a JPEG file, 1 to 100, as its quantisation tables tell it; what the next one is
    /// written with.
    pub quality: Option<u8>,
    /// Whether the samples of an OpenEXR file are half floats; so are those of the next one.
    pub half: bool,
    /// Further parts of the file that its own format alone has a place for.
    pub parts: Vec<Part>,
}

/// A part of a file as it is stored.
#[derive(Clone, Debug, PartialEq)]
pub enum Part {
    /// A segment of a JPEG file: its marker and content.
    Jpeg(u8, Vec<u8>),
    /// A chunk of a PNG file: its name and content.
    Png([u8; 4], Vec<u8>),
    /// What no file gets, in words: it tells of what the picture was.
    Stale(String),
}

/// Pixels per length, to the right and down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Density {
    /// Pixels per unit in a row.
    pub x: f64,
    /// Pixels per unit in a column.
    pub y: f64,
    /// The unit.
    pub unit: DensityUnit,
}

/// Units of a [`Density`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DensityUnit {
    /// Pixels per inch.
    Inch,
    /// Pixels per metre.
    Metre,
    /// No length: only the ratio of both counts.
    Aspect,
}

impl Density {
    /// In another unit of length; a ratio stays one.
    pub(super) fn to(self, unit: DensityUnit) -> Self {
        let factor = match (self.unit, unit) {
            (DensityUnit::Inch, DensityUnit::Metre) => 1.0 / 0.0254,
            (DensityUnit::Metre, DensityUnit::Inch) => 0.0254,
            _ => return self,
        };
        Self { x: factor * self.x, y: factor * self.y, unit }
    }
}

impl Metadata {
    /// What of it holds for another picture made of these colours: a texture of another mesh, for
    /// example. Camera, date and place do not.
    pub fn of_colors(&self) -> Self {
        Self { icc: self.icc.clone(), quality: self.quality, half: self.half, ..Self::default() }
    }

    /// Exchanges rows and columns.
    pub(super) fn transpose(&mut self) {
        if let Some(density) = &mut self.density {
            (density.x, density.y) = (density.y, density.x);
        }
    }

    /// The profile, unless it is for pictures of another kind than `channels` tell.
    pub(super) fn profile_for(&self, channels: u32) -> Option<&[u8]> {
        let icc = self.icc.as_deref()?;
        let fits = match icc.get(16..20) {
            Some(b"GRAY") => channels <= 2,
            Some(b"RGB ") => channels >= 3,
            _ => false,
        };
        fits.then_some(icc)
    }

    /// Whether the colours are those that a picture without profile has.
    pub(super) fn is_srgb(&self) -> bool {
        let Some(icc) = self.icc.as_deref() else { return true };
        let wide: Vec<u8> = b"sRGB".iter().flat_map(|b| [0, *b]).collect();
        icc.windows(4).any(|w| w == b"sRGB") || icc.windows(8).any(|w| w == wide)
    }

    /// What `format` has no place for, in words.
    pub(super) fn lost_in(&self, format: Format, channels: u32) -> Vec<&str> {
        use Format::{Jpeg, OpenExr, Png, Tiff, WebP};
        let mut lost = Vec::new();
        let profile = matches!(format, Png | Jpeg | Tiff | WebP);
        if self.icc.is_some() && !(profile && self.profile_for(channels).is_some()) && !self.is_srgb() {
            lost.push("colour profile (colours may look different)");
        }
        if self.exif.is_some() && !profile {
            lost.push("EXIF data");
        }
        if self.xmp.is_some() && !matches!(format, Png | Jpeg | Tiff) {
            lost.push("XMP data");
        }
        // WebP files tell it in their EXIF data.
        if self.density.is_some() && !(matches!(format, Png | Jpeg | Tiff) || format == WebP && self.exif.is_some()) {
            lost.push("resolution");
        }
        let stays = |part: &Part| matches!((part, format), (Part::Jpeg(..), Jpeg) | (Part::Png(..), Png));
        for part in self.parts.iter().filter(|p| !stays(p)) {
            let what = match part {
                Part::Jpeg(0xfe, _) => "comment",
                Part::Jpeg(..) => "caption data (IPTC)",
                Part::Png(name, _) if name.ends_with(b"Xt") => "text",
                Part::Png([b's', b'R', b'G', b'B'], _) => continue,
                Part::Png(..) if format == OpenExr => continue,
                Part::Png(..) => "colour description (colours may look different)",
                Part::Stale(what) => what,
            };
            if !lost.contains(&what) {
                lost.push(what);
            }
        }
        lost
    }
}

/// An XMP packet that says that the picture is upright, as it is now.
pub(super) fn upright_xmp(mut packet: Vec<u8>) -> Vec<u8> {
    const NAME: &[u8] = b"tiff:Orientation";
    let found: Vec<usize> =
        packet.windows(NAME.len()).enumerate().filter(|(_, w)| *w == NAME).map(|(k, _)| k + NAME.len()).collect();
    for at in found {
        // As an attribute, ="6", or as an element, >6<.
        if let Some(b"=\"" | b"='") = packet.get(at..at + 2)
            && let Some(digit @ b'1'..=b'8') = packet.get_mut(at + 2)
        {
            *digit = b'1';
        } else if let Some(b'>') = packet.get(at)
            && let Some(digit @ b'1'..=b'8') = packet.get_mut(at + 1)
        {
            *digit = b'1';
        }
    }
    packet
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packets_say_upright_in_both_forms() {
        let packet = br#"<a tiff:Orientation="6" b="6"><tiff:Orientation>8</tiff:Orientation>"#;
        let expected = br#"<a tiff:Orientation="1" b="6"><tiff:Orientation>1</tiff:Orientation>"#;
        assert_eq!(upright_xmp(packet.to_vec()), expected);
    }

    #[test]
    fn a_profile_fits_only_its_kind_of_picture() {
        let mut icc = vec![0; 128];
        icc[16..20].copy_from_slice(b"GRAY");
        let metadata = Metadata { icc: Some(icc), ..Metadata::default() };
        assert!(metadata.profile_for(1).is_some() && metadata.profile_for(2).is_some());
        assert!(metadata.profile_for(3).is_none());
        assert_eq!(metadata.lost_in(Format::Png, 3), ["colour profile (colours may look different)"]);
        assert!(metadata.lost_in(Format::Png, 1).is_empty());
    }

    #[test]
    fn lengths_are_converted() {
        let d = Density { x: 300.0, y: 72.0, unit: DensityUnit::Inch }.to(DensityUnit::Metre);
        assert!((d.x - 11_811.023_6).abs() < 1e-3 && (d.to(DensityUnit::Inch).y - 72.0).abs() < 1e-9);
        let ratio = Density { x: 2.0, y: 1.0, unit: DensityUnit::Aspect };
        assert_eq!(ratio.to(DensityUnit::Inch), ratio);
    }
}
