//! Files of all formats: what goes in comes out, and what cannot be read is said.

use super::*;
use crate::picture::Depth;

/// The sentence on why a picture was not read.
pub(in crate::io::image_file) fn why(read: std::result::Result<Decoded, Refused>) -> String {
    match read {
        Err(Refused::Why(what)) => what,
        Err(Refused::Memory { picture, .. }) => picture,
        Ok(_) => panic!("it was read"),
    }
}

fn pattern(channels: u32, depth: Depth) -> Image {
    let mut image = Image::zeros(7, 5, channels, depth).unwrap();
    for k in 0..7 * 5 * channels {
        let value = ((k * 37) % 256) as f32 / 255.0;
        image.set(k / channels % 7, k / channels / 7, k % channels, value);
    }
    image
}

fn bytes_of(image: &Image, format: Format) -> Vec<u8> {
    encode(image, &Metadata::default(), format, Path::new("x")).unwrap().0
}

#[test]
fn formats_keep_channels_and_depth() {
    let dir = tempfile::tempdir().unwrap();
    let cases = [
        ("png", vec![1, 2, 3, 4], vec![Depth::U8, Depth::U16]),
        ("tif", vec![1, 2, 3, 4], vec![Depth::U8, Depth::U16, Depth::F32]),
        ("tiff", vec![3, 4], vec![Depth::F32]),
        ("exr", vec![1, 2, 3, 4], vec![Depth::F32]),
        ("webp", vec![3, 4], vec![Depth::U8]),
        ("tga", vec![1, 3, 4], vec![Depth::U8]),
        ("bmp", vec![3, 4], vec![Depth::U8]),
        ("qoi", vec![3, 4], vec![Depth::U8]),
    ];
    for (extension, channels, depths) in cases {
        for &c in &channels {
            for &depth in &depths {
                let image = pattern(c, depth);
                let path = dir.path().join(format!("{c}{depth:?}.{extension}"));
                assert_eq!(write_picture(&image, &Metadata::default(), &path).unwrap(), [""; 0]);
                let back = read_picture(&path).unwrap();
                assert!(back.image == image, "{}", path.display());
                assert_eq!(back.notes, [""; 0]);
                let mut changed = image.clone();
                changed.set(3, 2, 0, 1.0 - image.get(3, 2, 0));
                assert!(back.image != changed, "the comparison must see one sample");
            }
        }
    }
}

#[test]
fn what_a_format_lacks_is_converted() {
    let dir = tempfile::tempdir().unwrap();
    for (name, channels, depth, expected) in [
        ("a.jpg", 4, Depth::U16, (3, Depth::U8)),
        ("b.jpeg", 2, Depth::U8, (1, Depth::U8)),
        ("c.png", 3, Depth::F32, (3, Depth::U16)),
        ("d.exr", 2, Depth::U8, (2, Depth::F32)),
        ("e.tif", 1, Depth::F32, (1, Depth::F32)),
        ("f.TIF", 2, Depth::U8, (2, Depth::U8)),
        ("g.bmp", 1, Depth::U16, (3, Depth::U8)),
    ] {
        let image = pattern(channels, depth);
        write_image(&image, dir.path().join(name)).unwrap();
        let back = read_image(dir.path().join(name)).unwrap();
        assert_eq!((back.channels, back.depth()), expected, "{name}");
        let tolerance = if name.contains(".j") { 0.5 } else { 1e-4 };
        assert!((back.get(2, 1, 0) - image.get(2, 1, 0)).abs() < tolerance, "{name}");
    }
    let message = write_image(&pattern(1, Depth::U8), dir.path().join("h.gif")).unwrap_err().to_string();
    assert!(message.contains("h.gif") && message.contains(".webp"), "{message}");
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 7);
}

#[test]
fn floats_beyond_one_survive_and_integers_clamp() {
    let image = Image::new(1, 1, 3, Pixels::F32(vec![-0.5, 7.25, f32::NAN])).unwrap();
    let back = decode_image(&bytes_of(&image, Format::OpenExr), "x").unwrap();
    assert_eq!((back.get(0, 0, 0), back.get(0, 0, 1)), (-0.5, 7.25));
    let png = decode_image(&encode_png(&image).unwrap(), "x").unwrap();
    assert_eq!(png.pixels, Pixels::U16(vec![0, 65535, 0]));
}

#[test]
fn a_small_file_cannot_ask_for_much() {
    let mut png = encode_png(&pattern(4, Depth::U8)).unwrap();
    // Width and height of the header chunk, with its checksum made right.
    png[16..24].copy_from_slice(&[0, 0, 0x7f, 0xff, 0, 0, 0x7f, 0xff]);
    let crc = crc32fast::hash(&png[12..29]);
    png[29..33].copy_from_slice(&crc.to_be_bytes());
    let mut tga = bytes_of(&pattern(4, Depth::U8), Format::Tga);
    tga[12..16].copy_from_slice(&[0xff, 0x7f, 0xff, 0x7f]);
    let mut tiff = bytes_of(&pattern(4, Depth::U8), Format::Tiff);
    for tag in [b"\0\x01\x04\0\x01\0\0\0", b"\x01\x01\x04\0\x01\0\0\0"] {
        let at = tiff.windows(8).position(|w| w == tag).unwrap();
        tiff[at + 8..at + 12].copy_from_slice(&32767u32.to_le_bytes());
    }
    let mut exr = bytes_of(&pattern(4, Depth::F32), Format::OpenExr);
    for window in ["dataWindow", "displayWindow"] {
        let at = exr.windows(window.len()).position(|w| w == window.as_bytes()).unwrap() + window.len();
        let at = at + exr[at..].windows(4).position(|w| w == 6i32.to_le_bytes()).unwrap();
        exr[at..at + 8].copy_from_slice(&[32766i32.to_le_bytes(), 32766i32.to_le_bytes()].concat());
    }
    for (bytes, name) in [(png, "bomb.png"), (tga, "bomb.tga"), (tiff, "bomb.tif"), (exr, "bomb.exr")] {
        let message = decode_image(&bytes, name).unwrap_err().to_string();
        // The crate for OpenEXR sees by itself that there are too few blocks.
        let known = message.contains("32767 x 32767") || message.contains("chunk count");
        assert!(message.contains(name) && known, "{message}");
    }
}

#[test]
fn truncation_is_an_error() {
    for format in [Format::Png, Format::Tiff, Format::OpenExr, Format::WebP, Format::Tga, Format::Bmp, Format::Qoi] {
        let image = pattern(3, if format == Format::OpenExr { Depth::F32 } else { Depth::U8 });
        let bytes = bytes_of(&image, format);
        for length in [0, 1, 4, 8, 20, bytes.len() / 2] {
            assert!(decode_image(&bytes[..length], "cut.tga").is_err(), "{format:?} cut at {length}");
        }
        for length in 0..bytes.len() {
            drop(decode_image(&bytes[..length], "cut.tga"));
        }
    }
}

#[test]
fn damaged_files_of_all_formats_return() {
    for format in
        [Format::Png, Format::Jpeg, Format::Tiff, Format::OpenExr, Format::WebP, Format::Tga, Format::Bmp, Format::Qoi]
    {
        let image = pattern(3, if format == Format::OpenExr { Depth::F32 } else { Depth::U8 });
        let metadata = Metadata { exif: Some(exif_of(6)), xmp: Some(b"<x/>".to_vec()), ..Metadata::default() };
        let bytes = encode(&image, &metadata, format, Path::new("x")).unwrap().0;
        for k in 0..bytes.len() {
            for value in [0, 0xff, bytes[k] ^ 0x80] {
                let mut changed = bytes.clone();
                changed[k] = value;
                // Whatever it is then; what is read is whole.
                if let Ok(decoded) = decode_within(&changed, Path::new("x.tga"), None, 1 << 16) {
                    decoded.image.check("x").unwrap();
                }
            }
        }
    }
}

/// An EXIF block that says the orientation, and the maker after it.
fn exif_of(orientation: u16) -> Vec<u8> {
    let mut directory = ifd::Directory::default();
    directory.set_shorts(0x112, &[orientation]);
    directory.set(0x10f, 2, b"Camera works\0".to_vec());
    directory.to_block()
}

/// What is to be found in the EXIF data of `picture`: upright, with everything else.
fn check_exif(picture: &Picture, name: &str) {
    let block = picture.metadata.exif.as_deref().unwrap_or_else(|| panic!("{name} has no EXIF data"));
    assert_eq!(exif::orientation(block).unwrap_or(1), 1, "{name}");
    assert!(block.windows(12).any(|w| w == b"Camera works"), "{name}");
}

/// The stored picture that orientation `value` shows as `shown`: the inverse of what reading does.
fn stored(shown: &Image, value: u16) -> Image {
    // All are their own inverses, but for the quarter turns, which are each other's.
    let inverse = match value {
        6 => 8,
        8 => 6,
        other => other,
    };
    Orientation::of_tag(inverse).upright(shown.clone())
}

#[test]
fn photos_are_read_upright_in_every_format_that_tells_how() {
    let dir = tempfile::tempdir().unwrap();
    let shown = pattern(3, Depth::U8);
    for value in 1..=8 {
        let image = stored(&shown, value);
        assert_eq!(image.width, if value < 5 { 7 } else { 5 });
        for format in [Format::Png, Format::Jpeg, Format::WebP, Format::Tiff] {
            let metadata = Metadata { exif: Some(exif_of(1)), quality: Some(100), ..Metadata::default() };
            let mut bytes = encode(&image, &metadata, format, Path::new("x")).unwrap().0;
            // The writer says upright; the camera did not. Tag 274, a short, one value.
            let tag: &[u8] = &[0x12, 1, 3, 0, 1, 0, 0, 0, 1, 0];
            let at = bytes.windows(10).position(|w| w == tag).unwrap();
            bytes[at + 8] = value as u8;
            if format == Format::Png {
                let chunk = bytes.windows(4).position(|w| w == b"eXIf").unwrap();
                let length = u32::from_be_bytes(bytes[chunk - 4..chunk].try_into().unwrap()) as usize;
                let crc = crc32fast::hash(&bytes[chunk..chunk + 4 + length]);
                bytes[chunk + 4 + length..][..4].copy_from_slice(&crc.to_be_bytes());
            }
            let name = format!("{value}.{}", format.name());
            let path = dir.path().join(&name);
            std::fs::write(&path, &bytes).unwrap();
            let picture = read_picture(&path).unwrap();
            let worst = (0..picture.image.pixels.len())
                .map(|k| (picture.image.sample(k) - shown.sample(k)).abs())
                .fold(0.0, f32::max);
            assert_eq!((picture.image.width, picture.image.height), (7, 5), "{name}");
            assert!(worst <= if format == Format::Jpeg { 6.0 / 255.0 } else { 0.0 }, "{name}: {worst}");
            // As a texture it is as it was stored, with a word on it.
            let texture = read_texture(&path).unwrap();
            assert_eq!((texture.image.width, texture.notes.len()), (image.width, usize::from(value > 1)), "{name}");
            // What is written again is upright and says so.
            let again = dir.path().join(format!("again.{}", ["png", "tif"][usize::from(value % 2 == 0)]));
            write_picture(&picture.image, &picture.metadata, &again).unwrap();
            let back = read_picture(&again).unwrap();
            assert!(back.image == picture.image);
            check_exif(&back, &name);
        }
    }
}

fn profile(kind: &[u8; 4]) -> Vec<u8> {
    let mut icc: Vec<u8> = (0..3000u32).map(|k| (k * 7 % 251) as u8).collect();
    icc[16..20].copy_from_slice(kind);
    icc
}

#[test]
fn what_is_told_of_a_photo_goes_from_any_format_to_any() {
    let dir = tempfile::tempdir().unwrap();
    let metadata = Metadata {
        icc: Some(profile(b"RGB ")),
        exif: Some(exif_of(1)),
        xmp: Some(b"<x:xmpmeta/>".to_vec()),
        density: Some(Density { x: 300.0, y: 150.0, unit: DensityUnit::Inch }),
        quality: Some(83),
        ..Metadata::default()
    };
    let image = pattern(3, Depth::U8);
    for from in ["jpg", "png", "tif"] {
        let first = dir.path().join(format!("a.{from}"));
        assert_eq!(write_picture(&image, &metadata, &first).unwrap(), [""; 0]);
        for to in ["jpg", "png", "tif"] {
            let picture = read_picture(&first).unwrap();
            let second = dir.path().join(format!("b.{to}"));
            assert_eq!(write_picture(&picture.image, &picture.metadata, &second).unwrap(), [""; 0]);
            let back = read_picture(&second).unwrap();
            let name = format!("{from} to {to}");
            assert_eq!(back.metadata.icc, metadata.icc, "{name}");
            assert_eq!(back.metadata.xmp, metadata.xmp, "{name}");
            check_exif(&back, &name);
            let density = back.metadata.density.unwrap().to(DensityUnit::Inch);
            assert!((density.x - 300.0).abs() < 0.02 && (density.y - 150.0).abs() < 0.02, "{name}: {density:?}");
            assert_eq!(back.metadata.quality, (to == "jpg").then_some(if from == "jpg" { 83 } else { 95 }), "{name}");
        }
    }
    let lost = write_picture(&image, &metadata, dir.path().join("c.exr")).unwrap();
    assert!(["colour profile", "EXIF", "XMP", "resolution"].iter().all(|w| lost[0].contains(w)), "{lost:?}");
    let lost = write_picture(&pattern(1, Depth::U8), &metadata, dir.path().join("d.png")).unwrap();
    assert!(lost[0].contains("colour profile") && !lost[0].contains("EXIF"), "{lost:?}");
}

#[test]
fn half_floats_stay_half_floats() {
    let image = Image::new(2, 1, 1, Pixels::F32(vec![0.5, -3.0])).unwrap();
    let half = Metadata { half: true, ..Metadata::default() };
    let dir = tempfile::tempdir().unwrap();
    write_picture(&image, &half, dir.path().join("h.exr")).unwrap();
    let back = read_picture(dir.path().join("h.exr")).unwrap();
    assert!(back.metadata.half && back.image == image);
    // 1e6 has no half float.
    let large = Image::new(2, 1, 1, Pixels::F32(vec![0.5, 1e6])).unwrap();
    write_picture(&large, &half, dir.path().join("f.exr")).unwrap();
    let back = read_picture(dir.path().join("f.exr")).unwrap();
    assert!(!back.metadata.half && back.image == large);
}

#[test]
fn a_jpeg_of_four_inks_becomes_rgb_with_a_word() {
    // Grey of one component, said to be four: the frame and the scan name three more components
    // with the same tables, and the data of one 8 x 8 block repeat. An all-zero block is one code
    // for its DC and one for its end.
    let mut bytes = b"\xff\xd8\xff\xee\0\x0eAdobe\0\x64\0\0\0\0\0".to_vec();
    bytes.extend_from_slice(b"\xff\xdb\0\x43\0");
    bytes.extend_from_slice(&[8; 64]);
    bytes.extend_from_slice(b"\xff\xc0\0\x14\x08\0\x08\0\x08\x04");
    (1..=4).for_each(|id| bytes.extend_from_slice(&[id, 0x11, 0]));
    // Tables with two codes each: 00 for no difference or the end of a block, 01 for a difference
    // of seven bits.
    for class in [0u8, 0x10] {
        bytes.extend_from_slice(&[0xff, 0xc4, 0, 21, class, 0, 2]);
        bytes.extend_from_slice(&[0; 14]);
        bytes.extend_from_slice(&[0, 7]);
    }
    bytes.extend_from_slice(b"\xff\xda\0\x0e\x04");
    (1..=4).for_each(|id| bytes.extend_from_slice(&[id, 0]));
    bytes.extend_from_slice(&[0, 63, 0]);
    // Cyan: difference +100 (code 01, bits 1100100), end 00: stored 228. Magenta, yellow: none:
    // 128. Black: +127: 255.
    let code = "01".to_owned() + "1100100" + "00" + "00" + "00" + "00" + "00" + "01" + "1111111" + "00";
    let padded = format!("{code:1<32}");
    for k in 0..padded.len() / 8 {
        let byte = u8::from_str_radix(&padded[8 * k..8 * k + 8], 2).unwrap();
        bytes.push(byte);
        if byte == 0xff {
            bytes.push(0);
        }
    }
    bytes.extend_from_slice(b"\xff\xd9");
    let decoded = decode(&bytes, Path::new("ink.jpg"), None).unwrap();
    assert_eq!((decoded.image.width, decoded.image.channels), (8, 3));
    assert!(decoded.notes[0].contains("CMYK"), "{:?}", decoded.notes);
    // Stored numbers count the light that is left: 228, 128, 128, of 255 by black.
    assert_eq!(decoded.image.pixels, Pixels::U8([228, 128, 128].repeat(64)));
}

#[test]
fn animations_are_read_as_their_first_frame() {
    use image::codecs::gif::GifEncoder;
    let frame = |v: u8| image::Frame::new(image::RgbaImage::from_pixel(3, 2, image::Rgba([v, v, v, 255])));
    let gif = |frames: Vec<image::Frame>| {
        let mut bytes = Vec::new();
        GifEncoder::new(&mut bytes).encode_frames(frames).unwrap();
        bytes
    };
    let single = decode(&gif(vec![frame(200)]), Path::new("a.gif"), None).unwrap();
    assert_eq!((single.image.channels, single.notes.len()), (3, 0));
    assert_eq!(single.image.pixels, Pixels::U8(vec![200; 18]));
    let moving = decode(&gif(vec![frame(10), frame(200)]), Path::new("b.gif"), None).unwrap();
    assert_eq!(moving.image.pixels, Pixels::U8(vec![10; 18]));
    assert!(moving.notes[0].contains("first frame"), "{:?}", moving.notes);
}

#[test]
fn a_layer_is_named_behind_the_file() {
    assert_eq!(layer_of(Path::new("a/b.EXR:V.Depth")), ("a/b.EXR".into(), Some("V.Depth".into())));
    assert_eq!(layer_of(Path::new("a/b.exr")), ("a/b.exr".into(), None));
    assert_eq!(layer_of(Path::new("c:/b.png")), ("c:/b.png".into(), None));
}
