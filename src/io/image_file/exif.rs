//! EXIF blocks: what they say of a picture, and what must change when the picture does.
//!
//! A block is changed in place. Makers' notes count places from the beginning of the block, so that
//! one whose parts move would lose them.

use super::ifd::{Block, EXIF_DIRECTORY, Field, Fields, GPS_DIRECTORY, LONG, SHORT};
use super::metadata::{Density, DensityUnit};

const WIDTH: u16 = 0x100;
const HEIGHT: u16 = 0x101;
const ORIENTATION: u16 = 0x112;
const X_RESOLUTION: u16 = 0x11a;
const Y_RESOLUTION: u16 = 0x11b;
const RESOLUTION_UNIT: u16 = 0x128;
const THUMBNAIL: u16 = 0x201;
const THUMBNAIL_LENGTH: u16 = 0x202;
const PHOTO_WIDTH: u16 = 0xa002;
const PHOTO_HEIGHT: u16 = 0xa003;

/// How the picture is to be shown, 1 to 8.
pub(super) fn orientation(block: &[u8]) -> Option<u16> {
    let (block, first) = Block::open(block)?;
    let fields = block.directory(first)?;
    block.first(&fields, ORIENTATION).and_then(|v| u16::try_from(v).ok())
}

/// Pixels per length.
pub(super) fn density(bytes: &[u8]) -> Option<Density> {
    let (block, first) = Block::open(bytes)?;
    density_of(&block, &block.directory(first)?)
}

/// Pixels per length, by the tags of a directory.
pub(super) fn density_of(block: &Block<'_>, fields: &Fields) -> Option<Density> {
    let x = block.fraction(fields, X_RESOLUTION).filter(|x| *x > 0.0)?;
    let y = block.fraction(fields, Y_RESOLUTION).filter(|y| *y > 0.0).unwrap_or(x);
    match block.first(fields, RESOLUTION_UNIT).unwrap_or(2) {
        1 if x == y => None,
        1 => Some(Density { x, y, unit: DensityUnit::Aspect }),
        3 => Some(Density { x: 100.0 * x, y: 100.0 * y, unit: DensityUnit::Metre }),
        _ => Some(Density { x, y, unit: DensityUnit::Inch }),
    }
}

/// The block for the upright picture of this size: orientation normal, no thumbnail, sizes as they
/// are.
pub(super) fn finished(bytes: &[u8], width: u32, height: u32) -> Vec<u8> {
    let mut out = bytes.to_vec();
    let Some((block, first)) = Block::open(bytes) else { return out };
    let Some(fields) = block.directory(first) else { return out };
    let mut set = |field: &Field, value: u32| {
        let value = match field.kind {
            SHORT => {
                u16::try_from(value).ok().map(|v| if block.little { v.to_le_bytes() } else { v.to_be_bytes() }.to_vec())
            }
            LONG => Some(if block.little { value.to_le_bytes() } else { value.to_be_bytes() }.to_vec()),
            _ => None,
        };
        if let Some(value) = value.filter(|v| v.len() <= field.length) {
            out[field.at..field.at + value.len()].copy_from_slice(&value);
        }
    };
    let inside = |tag: u16| block.first(&fields, tag).and_then(|place| block.directory(place));
    let photo = inside(EXIF_DIRECTORY);
    for field in fields.list.iter().chain(photo.iter().flat_map(|p| &p.list)) {
        match field.tag {
            ORIENTATION => set(field, 1),
            WIDTH | PHOTO_WIDTH => set(field, width),
            HEIGHT | PHOTO_HEIGHT => set(field, height),
            _ => {}
        }
    }
    if let Some(thumbnail) = Some(fields.next).filter(|n| *n != 0).and_then(|n| block.directory(n)) {
        out[fields.next_at..fields.end].fill(0);
        let kept = [Some(&fields), photo.as_ref(), inside(GPS_DIRECTORY).as_ref()]
            .into_iter()
            .flatten()
            .flat_map(|d| d.list.iter().map(|f| f.at + f.length).chain([d.end]))
            .max()
            .unwrap_or(out.len());
        // Usually everything behind what is kept is the thumbnail.
        if fields.next as usize >= kept {
            out.truncate(kept);
        } else if let (Some(at), Some(length)) =
            (block.first(&thumbnail, THUMBNAIL), block.first(&thumbnail, THUMBNAIL_LENGTH))
            && let Some(picture) = out.get_mut(at as usize..at.saturating_add(length) as usize)
        {
            picture.fill(0);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::image_file::ifd::{Directory, RATIONAL};

    /// A block with orientation 6, 300 dots per inch, a photo directory and a thumbnail of 5 bytes.
    fn photo(thumbnail: bool) -> Vec<u8> {
        let mut main = Directory::default();
        main.set(0x10f, 2, b"Maker of cameras\0".to_vec());
        main.set_shorts(ORIENTATION, &[6]);
        main.set(X_RESOLUTION, RATIONAL, [300u32.to_le_bytes(), 1u32.to_le_bytes()].concat());
        main.set(Y_RESOLUTION, RATIONAL, [600u32.to_le_bytes(), 2u32.to_le_bytes()].concat());
        main.set_shorts(WIDTH, &[96]);
        let mut bytes = main.to_block();
        if thumbnail {
            let next = bytes.len() as u32;
            let next_at = 8 + 2 + 12 * 5;
            bytes[next_at..next_at + 4].copy_from_slice(&next.to_le_bytes());
            let mut second = Directory::default();
            second.set_longs(THUMBNAIL, &[next + 2 + 24 + 4]);
            second.set_longs(THUMBNAIL_LENGTH, &[5]);
            second.append(&mut bytes);
            bytes.extend_from_slice(b"THUMB");
        }
        bytes
    }

    #[test]
    fn the_finished_block_is_upright_without_thumbnail() {
        let before = photo(true);
        assert_eq!((orientation(&before), density(&before).map(|d| (d.x, d.y))), (Some(6), Some((300.0, 300.0))));
        let after = finished(&before, 64, 48);
        assert_eq!(orientation(&after), Some(1));
        let (block, first) = Block::open(&after).unwrap();
        let fields = block.directory(first).unwrap();
        assert_eq!((fields.next, block.first(&fields, WIDTH)), (0, Some(64)));
        assert!(!after.windows(5).any(|w| w == b"THUMB"));
        assert!(after.windows(16).any(|w| w == b"Maker of cameras"));
        // Nothing else changes: the same as a block that never had one.
        assert_eq!(after, finished(&photo(false), 64, 48));
    }

    #[test]
    fn damaged_blocks_stay_as_they_are() {
        let bytes = photo(true);
        for length in 0..bytes.len() {
            drop((orientation(&bytes[..length]), density(&bytes[..length]), finished(&bytes[..length], 1, 1)));
        }
        for k in 0..bytes.len() {
            let mut changed = bytes.clone();
            changed[k] ^= 0xff;
            drop((orientation(&changed), density(&changed), finished(&changed, 1, 1)));
        }
        assert_eq!(finished(b"no block", 1, 1), b"no block");
    }
}
