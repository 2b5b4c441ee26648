//! Kinds of picture files: told by content when they are read, by the extension of the name when
//! they are written.

use std::path::Path;

use image::ImageFormat;

use crate::{Error, Result};

/// How a TGA file of version 2 ends, but for a dot and a zero. The format has nothing at its
/// beginning.
const TGA_FOOTER: &[u8] = b"TRUEVISION-XFILE";

/// What can be read, in words.
pub(super) const READABLE: &str = "PNG, JPEG, TIFF, OpenEXR, WebP, TGA, BMP, GIF, QOI, HDR or PNM";

/// Extensions that can be written, with their formats.
const WRITABLE: [(&str, Format); 11] = [
    ("png", Format::Png),
    ("jpg", Format::Jpeg),
    ("jpeg", Format::Jpeg),
    ("tif", Format::Tiff),
    ("tiff", Format::Tiff),
    ("exr", Format::OpenExr),
    ("webp", Format::WebP),
    ("tga", Format::Tga),
    ("bmp", Format::Bmp),
    ("qoi", Format::Qoi),
    ("dib", Format::Bmp),
];

/// A kind of picture file that can be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    Png,
    Jpeg,
    Tiff,
    OpenExr,
    WebP,
    Tga,
    Bmp,
    Qoi,
}

impl Format {
    /// The format of a name's extension.
    ///
    /// # Errors
    /// [`Error::Option`] that lists the extensions there are.
    pub(super) fn of_name(path: &Path) -> Result<Self> {
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
        WRITABLE.iter().find(|(e, _)| *e == extension).map(|(_, format)| *format).ok_or_else(|| {
            let what = format!("{} has no extension of a picture format that can be written", path.display());
            let all: Vec<String> = WRITABLE.iter().map(|(e, _)| format!(".{e}")).collect();
            Error::option("output", what, format!("End the name in one of {}", all.join(" ")))
        })
    }

    /// The name in messages.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Png => "PNG",
            Self::Jpeg => "JPEG",
            Self::Tiff => "TIFF",
            Self::OpenExr => "OpenEXR",
            Self::WebP => "WebP",
            Self::Tga => "TGA",
            Self::Bmp => "BMP",
            Self::Qoi => "QOI",
        }
    }
}

/// How a file is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Content {
    Tiff,
    OpenExr,
    /// By the crate `image`.
    Other(ImageFormat),
}

/// The kind of a file, by its first bytes; for TGA by its last or by its name.
///
/// # Errors
/// What it is instead, in words.
pub(super) fn content(bytes: &[u8], name: &Path) -> std::result::Result<Content, String> {
    let is_tiff = [&b"II*\0"[..], b"MM\0*", b"II+\0", b"MM\0+"].iter().any(|magic| bytes.starts_with(magic));
    // A camera's raw file is a TIFF file whose first picture is a preview.
    if is_tiff && bytes.get(8..10) != Some(b"CR") {
        return Ok(Content::Tiff);
    }
    if bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
        return Ok(Content::OpenExr);
    }
    if let Some(kind) = foreign(bytes) {
        return Err(format!("this is a {kind}, which is not read"));
    }
    let tail = &bytes[bytes.len().saturating_sub(64)..];
    let is_tga = tail.windows(TGA_FOOTER.len()).any(|w| w == TGA_FOOTER)
        || name.extension().is_some_and(|e| ["tga", "icb", "vda", "vst"].iter().any(|x| e.eq_ignore_ascii_case(x)));
    match image::guess_format(bytes) {
        Ok(format) if format.reading_enabled() => Ok(Content::Other(format)),
        _ if is_tga => Ok(Content::Other(ImageFormat::Tga)),
        Ok(format) => Err(format!("this is a {format:?} picture, which is not read")),
        Err(_) => Err("this is not a picture of a known kind".into()),
    }
}

/// Common files that are not read, by name.
fn foreign(bytes: &[u8]) -> Option<&'static str> {
    let at = |k: usize, magic: &[u8]| bytes.get(k..k + magic.len()) == Some(magic);
    let brands: [(&[u8], &str); 6] = [
        (b"heic", "HEIC photo"),
        (b"heix", "HEIC photo"),
        (b"mif1", "HEIF photo"),
        (b"avif", "AVIF picture"),
        (b"avis", "AVIF picture"),
        (b"crx ", "raw photo of a camera (CR3)"),
    ];
    if at(4, b"ftyp")
        && let Some((_, kind)) = brands.iter().find(|(brand, _)| at(8, brand))
    {
        return Some(kind);
    }
    let magics: [(&[u8], &str); 12] = [
        (b"8BPS", "Photoshop document (PSD)"),
        (b"DDS ", "DDS texture"),
        (b"\xabKTX 20\xbb", "KTX2 texture"),
        (b"\xabKTX 11\xbb", "KTX texture"),
        (b"\xff\x0a", "JPEG XL picture"),
        (b"\0\0\0\x0cJXL ", "JPEG XL picture"),
        (b"\0\0\0\x0cjP  ", "JPEG 2000 picture"),
        (b"\xff\x4f\xff\x51", "JPEG 2000 picture"),
        (b"%PDF", "PDF document"),
        (b"gimp xcf", "GIMP document (XCF)"),
        (b"<svg", "vector picture (SVG)"),
        (b"II*\0\x10\0\0\0CR", "raw photo of a camera (CR2)"),
    ];
    magics.iter().find(|(magic, _)| at(0, magic)).map(|(_, kind)| *kind)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_are_told_by_content_and_tga_by_its_name_or_end() {
        let of = |bytes: &[u8], name: &str| content(bytes, Path::new(name));
        assert_eq!(of(b"MM\0+abc", "x.png"), Ok(Content::Tiff));
        assert_eq!(of(b"\x89PNG\r\n\x1a\n", "x.tga"), Ok(Content::Other(ImageFormat::Png)));
        assert_eq!(of(&[0; 30], "T.TGA"), Ok(Content::Other(ImageFormat::Tga)));
        assert_eq!(of(b"abcTRUEVISION-XFILE.\0", "embedded"), Ok(Content::Other(ImageFormat::Tga)));
        assert!(of(&[0; 30], "t.dat").unwrap_err().contains("known kind"));
    }

    #[test]
    fn foreign_kinds_are_named() {
        for (bytes, word) in [
            (&b"\0\0\0\x18ftypheic"[..], "HEIC"),
            (b"DDS \x7c", "DDS"),
            (b"8BPS\0\x01", "PSD"),
            (b"\xabKTX 20\xbb\r\n", "KTX2"),
            (b"II*\0\x10\0\0\0CR\x02\0", "CR2"),
        ] {
            let message = content(bytes, Path::new("p.tga")).unwrap_err();
            assert!(message.contains(word), "{message}");
        }
    }

    #[test]
    fn an_unknown_extension_lists_the_known_ones() {
        assert_eq!(Format::of_name(Path::new("a.WebP")).unwrap(), Format::WebP);
        let message = Format::of_name(Path::new("a.gif")).unwrap_err().to_string();
        assert!(message.contains("a.gif") && message.contains(".png") && message.contains(".bmp"), "{message}");
    }
}
