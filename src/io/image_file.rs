//! Pictures: PNG, JPEG, TIFF, OpenEXR, WebP, TGA, BMP, GIF and QOI; HDR and PNM are read.
//!
//! A picture stays in memory as the file stores it: its channels, and 8-bit, 16-bit or float
//! samples. Values are the stored ones; no colour space is applied. Row 0 is the top.
//!
//! Photos are turned as their orientation says, so that places in them are those that a viewer
//! shows. What else a file tells of its picture is [`Metadata`], which is written with what becomes
//! of it.

pub mod animation;
mod cmyk;
mod convert;
mod exif;
mod exr_channels;
mod exr_read;
mod exr_write;
mod format;
mod ifd;
mod jpeg;
mod metadata;
mod orientation;
mod other;
mod png;
mod tiff_read;
mod tiff_write;

use std::path::{Path, PathBuf};

use image::ExtendedColorType;

use self::format::{Content, Format};
use self::orientation::Orientation;
use super::{output, source};
use crate::picture::{Image, Pixels};
use crate::{Error, Result, control};

#[doc(hidden)]
pub use self::metadata::{Density, DensityUnit};
pub use self::metadata::{Metadata, Part};

/// More samples than this in one picture are not read: 32768 x 32768 pixels of 8-bit RGBA, or 16384
/// x 16384 of float RGBA.
const LARGEST: u64 = 4 << 30;

/// A picture with what its file tells of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// The pixels.
    pub image: Image,
    /// What the file tells of them.
    pub metadata: Metadata,
    /// What was passed over or changed on the way, in sentences without the name of the file.
    pub notes: Vec<String>,
}

/// What the decoders return.
struct Decoded {
    image: Image,
    metadata: Metadata,
    /// How the picture is to be shown, 1 to 8.
    orientation: u16,
    notes: Vec<String>,
}

/// Reads a picture upright, as viewers show it; the format is told by the content. Palettes are
/// expanded, 1, 2 and 4 bits become 8.
///
/// Behind the name of an OpenEXR file a layer or channel may stand:
/// `render.exr:ViewLayer.Combined`.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] if the file is damaged, of another kind, empty, or declares a
/// size that its bytes cannot hold.
pub fn read_picture(path: impl AsRef<Path>) -> Result<Picture> {
    let mut decoded = read(path.as_ref())?;
    let orientation = Orientation::of_tag(decoded.orientation);
    if orientation.is_transposed() {
        decoded.metadata.transpose();
    }
    Ok(Picture { image: orientation.upright(decoded.image), metadata: decoded.metadata, notes: decoded.notes })
}

/// [`read_picture`] for the texture of a mesh: as it is stored, whatever orientation the file
/// tells, because texture coordinates are those of the stored pixels to most renderers. A note says
/// so where it makes a difference.
///
/// # Errors
/// As [`read_picture`].
pub fn read_texture(path: impl AsRef<Path>) -> Result<Picture> {
    let Decoded { image, metadata, orientation, mut notes } = read(path.as_ref())?;
    if !Orientation::of_tag(orientation).is_normal() {
        notes.push(format!(
            "viewers turn this picture (orientation {orientation}); as a texture it is taken as it is stored, as most renderers do"
        ));
    }
    Ok(Picture { image, metadata, notes })
}

/// The pixels of [`read_picture`].
///
/// # Errors
/// As [`read_picture`].
pub fn read_image(path: impl AsRef<Path>) -> Result<Image> {
    Ok(read_picture(path)?.image)
}

/// Decodes the bytes of a picture file (an embedded texture, for example) as they are stored;
/// `name` stands in messages.
///
/// # Errors
/// As [`read_image`].
#[doc(hidden)]
pub fn decode_image(bytes: &[u8], name: impl AsRef<Path>) -> Result<Image> {
    Ok(decode(bytes, name.as_ref(), None)?.image)
}

fn read(path: &Path) -> Result<Decoded> {
    let (file, layer) = layer_of(path);
    decode(&source::read_all(&file)?, &file, layer.as_deref())
}

/// The file and the layer of a name like `render.exr:ViewLayer.Combined`, unless a file has that
/// name.
fn layer_of(path: &Path) -> (PathBuf, Option<String>) {
    if let Some(text) = path.to_str()
        && let Some(at) = text.to_ascii_lowercase().rfind(".exr:")
        && !path.exists()
    {
        return (PathBuf::from(&text[..at + 4]), Some(text[at + 5..].to_owned()));
    }
    (path.to_path_buf(), None)
}

fn decode(bytes: &[u8], name: &Path, layer: Option<&str>) -> Result<Decoded> {
    // No codec packs more than about 4000 bytes into one: a tiny file must not ask for gigabytes.
    let most = LARGEST.min((bytes.len() as u64).saturating_mul(4096).saturating_add(64 << 20));
    decode_within(bytes, name, layer, most)
}

/// [`decode`] of a picture that may take `most` bytes.
fn decode_within(bytes: &[u8], name: &Path, layer: Option<&str>, most: u64) -> Result<Decoded> {
    let fail = |what: String| {
        Error::format(name, None, what, format!("Use a {} file, or save the picture again", format::READABLE))
    };
    if bytes.is_empty() {
        return Err(fail("the picture file is empty".into()));
    }
    let decoded = match format::content(bytes, name).map_err(fail)? {
        Content::Tiff => tiff_read::read(bytes, most),
        Content::OpenExr => exr_read::read(bytes, layer, &name.to_string_lossy(), most),
        Content::Other(format) => other::read(bytes, format, most),
    };
    decoded.map_err(|refused| match refused {
        Refused::Why(what) => fail(what),
        Refused::Memory { picture, required, allowed } => {
            Error::Memory { what: format!("{}: {picture}", name.display()), required, allowed }
        }
    })
}

/// Why a picture is not read.
#[derive(Debug)]
enum Refused {
    /// In a sentence.
    Why(String),
    /// It takes more memory than there is.
    Memory { picture: String, required: u64, allowed: u64 },
}

impl From<String> for Refused {
    fn from(what: String) -> Self {
        Self::Why(what)
    }
}

/// Refuses a picture of `bytes` bytes if they, and a copy on the way from the decoder's form to
/// ours, are more than is allowed.
fn require(width: u64, height: u64, bytes: u64) -> std::result::Result<(), Refused> {
    match control::require(bytes.saturating_mul(2), || format!("a picture of {width} x {height} pixels")) {
        Err(Error::Memory { what: picture, required, allowed }) => Err(Refused::Memory { picture, required, allowed }),
        Err(error) => Err(error.to_string().into()),
        Ok(()) => Ok(()),
    }
}

/// The sentence on a picture whose size does not fit its file.
fn too_large(width: u64, height: u64, bytes: usize) -> String {
    format!("the declared size {width} x {height} does not fit a file of {bytes} bytes")
}

/// Writes a picture in the format of the file's extension (`png`, `jpg`, `tif`, `exr`, `webp`,
/// `tga`, `bmp`, `qoi`), whole or not at all.
///
/// Channels and depth are kept where the format has them. Otherwise: float becomes 16-bit in PNG;
/// everything becomes 8-bit without alpha in JPEG (quality 95), 8-bit in WebP (lossless), TGA, BMP
/// and QOI; OpenEXR is float. [`write_picture`] says what that changes.
///
/// # Errors
/// [`Error::Option`] on another extension; [`Error::Io`].
pub fn write_image(image: &Image, path: impl AsRef<Path>) -> Result<()> {
    write_picture(image, &Metadata::default(), path).map(drop)
}

/// [`write_image`] with what is told of the picture; returns sentences on what the format has no
/// place for, without the name of the file.
///
/// Sizes in the EXIF data become those of the picture, the orientation normal, and a thumbnail is
/// left out.
///
/// # Errors
/// As [`write_image`].
pub fn write_picture(image: &Image, metadata: &Metadata, path: impl AsRef<Path>) -> Result<Vec<String>> {
    let path = path.as_ref();
    let (bytes, notes) = encode(image, metadata, Format::of_name(path)?, path)?;
    output::write_bytes(path, &bytes)?;
    Ok(notes)
}

/// Fails unless [`write_image`] knows the extension of `path`.
///
/// # Errors
/// [`Error::Option`].
pub fn check_image_extension(path: impl AsRef<Path>) -> Result<()> {
    Format::of_name(path.as_ref()).map(drop)
}

/// Whether [`write_image`] writes JPEG to this name.
pub fn is_jpeg(path: impl AsRef<Path>) -> bool {
    Format::of_name(path.as_ref()).is_ok_and(|f| f == Format::Jpeg)
}

/// The bytes of a PNG file.
///
/// # Errors
/// [`Error::Format`] on a picture without pixels.
pub fn encode_png(image: &Image) -> Result<Vec<u8>> {
    Ok(encode(image, &Metadata::default(), Format::Png, Path::new("PNG"))?.0)
}

fn encode(image: &Image, metadata: &Metadata, format: Format, path: &Path) -> Result<(Vec<u8>, Vec<String>)> {
    let fail = |what: String| {
        Error::format(path, None, format!("the picture cannot be encoded: {what}"), "Use another format or size")
    };
    image.check(&path.display().to_string())?;
    let (fitted, mut notes) = convert::fitted(image, format)?;
    let image = fitted.as_ref();
    let lost = metadata.lost_in(format, image.channels);
    if !lost.is_empty() {
        notes.push(format!("not kept in {}: {} of the source", format.name(), lost.join(", ")));
    }
    let size = [image.width, image.height];
    let bytes = match (format, &image.pixels) {
        (Format::Tiff, _) => tiff_write::write(image, metadata).map_err(fail)?,
        (Format::OpenExr, _) => exr_write::write(image, metadata.half).map_err(fail)?,
        (Format::Jpeg, Pixels::U8(samples)) => {
            let (bytes, more) =
                jpeg::write(samples, size, image.channels, metadata).map_err(|e| fail(e.to_string()))?;
            notes.extend(more);
            bytes
        }
        (Format::Png, Pixels::U8(samples)) => {
            png::write(samples, size, color(image), metadata).map_err(|e| fail(e.to_string()))?
        }
        (Format::Png, Pixels::U16(samples)) => {
            png::write(bytemuck::cast_slice(samples), size, color(image), metadata).map_err(|e| fail(e.to_string()))?
        }
        (_, Pixels::U8(samples)) => {
            other::write(samples, size, color(image), format, metadata).map_err(|e| fail(e.to_string()))?
        }
        _ => return Err(fail(format!("{} does not hold {:?} samples", format.name(), image.depth()))),
    };
    Ok((bytes, notes))
}

/// The kind of pixels, in the words of the encoders.
fn color(image: &Image) -> ExtendedColorType {
    match (&image.pixels, image.channels) {
        (Pixels::U16(_), 1) => ExtendedColorType::L16,
        (Pixels::U16(_), 2) => ExtendedColorType::La16,
        (Pixels::U16(_), 3) => ExtendedColorType::Rgb16,
        (Pixels::U16(_), _) => ExtendedColorType::Rgba16,
        (_, 1) => ExtendedColorType::L8,
        (_, 2) => ExtendedColorType::La8,
        (_, 3) => ExtendedColorType::Rgb8,
        _ => ExtendedColorType::Rgba8,
    }
}

#[cfg(test)]
#[path = "image_file/tests.rs"]
mod tests;
