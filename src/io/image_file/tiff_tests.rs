//! TIFF files of many kinds, byte by byte.

use super::*;
use crate::io::image_file::ifd::Directory;
use crate::io::image_file::tests::why;

/// A file with one strip of these bytes.
struct Kind {
    size: [u32; 2],
    bits: Vec<u16>,
    photometric: u16,
    format: u16,
    tags: Vec<(u16, Vec<u16>)>,
}

impl Kind {
    fn new(size: [u32; 2], bits: &[u16], photometric: u16) -> Self {
        Self { size, bits: bits.to_vec(), photometric, format: 1, tags: Vec::new() }
    }

    fn with(mut self, tag: u16, values: &[u16]) -> Self {
        self.tags.push((tag, values.to_vec()));
        self
    }

    fn floats(self) -> Self {
        Self { format: 3, ..self }
    }

    fn signed(self) -> Self {
        Self { format: 2, ..self }
    }

    /// The bytes of the file, with strips of the given data.
    fn file(&self, strips: &[&[u8]]) -> Vec<u8> {
        let mut bytes = b"II*\0\0\0\0\0".to_vec();
        let mut tags = Directory::default();
        let places: Vec<u32> = strips.iter().map(|s| super::super::ifd::append_even(&mut bytes, s)).collect();
        let lengths: Vec<u32> = strips.iter().map(|s| s.len() as u32).collect();
        tags.set_longs(256, &self.size[..1]);
        tags.set_longs(257, &self.size[1..]);
        tags.set_shorts(258, &self.bits);
        tags.set_shorts(259, &[1]);
        tags.set_shorts(262, &[self.photometric]);
        tags.set_longs(273, &places);
        tags.set_shorts(277, &[self.bits.len() as u16]);
        tags.set_longs(278, &self.size[1..]);
        tags.set_longs(279, &lengths);
        tags.set_shorts(339, &vec![self.format; self.bits.len()]);
        for (tag, values) in &self.tags {
            tags.set_shorts(*tag, values);
        }
        let first = tags.append(&mut bytes);
        bytes[4..8].copy_from_slice(&first.to_le_bytes());
        bytes
    }
}

fn decoded(file: &[u8]) -> Decoded {
    read(file, 1 << 30).unwrap()
}

fn pixels(file: &[u8]) -> (u32, Pixels) {
    let image = decoded(file).image;
    (image.channels, image.pixels)
}

#[test]
fn grey_of_every_number() {
    let floats: Vec<u8> = [0.25f32, -7.0].iter().flat_map(|v| v.to_le_bytes()).collect();
    assert_eq!(pixels(&Kind::new([2, 1], &[32], 1).floats().file(&[&floats])), (1, Pixels::F32(vec![0.25, -7.0])));
    let halves = [0x00, 0x3c, 0x00, 0xc2];
    assert_eq!(pixels(&Kind::new([2, 1], &[16], 1).floats().file(&[&halves])), (1, Pixels::F32(vec![1.0, -3.0])));
    let doubles: Vec<u8> = [0.5f64, 2.0].iter().flat_map(|v| v.to_le_bytes()).collect();
    assert_eq!(pixels(&Kind::new([2, 1], &[64], 1).floats().file(&[&doubles])), (1, Pixels::F32(vec![0.5, 2.0])));
    // Heights with a sign, and numbers of things, keep their values.
    let signed: Vec<u8> = [-300i16, 12].iter().flat_map(|v| v.to_le_bytes()).collect();
    assert_eq!(pixels(&Kind::new([2, 1], &[16], 1).signed().file(&[&signed])), (1, Pixels::F32(vec![-300.0, 12.0])));
    let labels: Vec<u8> = [70_000u32, 16_777_217].iter().flat_map(|v| v.to_le_bytes()).collect();
    let read = decoded(&Kind::new([2, 1], &[32], 1).file(&[&labels]));
    assert_eq!(read.image.pixels, Pixels::F32(vec![70_000.0, 16_777_216.0]));
    assert!(read.notes[0].starts_with("1 whole numbers"), "{:?}", read.notes);
}

#[test]
fn few_bits_and_white_as_zero() {
    // 3 pixels a row, each row in a byte of its own.
    assert_eq!(
        pixels(&Kind::new([3, 2], &[1], 1).file(&[&[0b1010_0000, 0b0110_0000]])),
        (1, Pixels::U8(vec![255, 0, 255, 0, 255, 255]))
    );
    assert_eq!(pixels(&Kind::new([3, 1], &[1], 0).file(&[&[0b1010_0000]])), (1, Pixels::U8(vec![0, 255, 0])));
    assert_eq!(pixels(&Kind::new([3, 1], &[4], 1).file(&[&[0x0f, 0x80]])), (1, Pixels::U8(vec![0, 255, 136])));
    assert_eq!(pixels(&Kind::new([2, 1], &[2], 1).file(&[&[0b0111_0000]])), (1, Pixels::U8(vec![85, 255])));
    assert_eq!(pixels(&Kind::new([2, 1], &[16], 0).file(&[&[0, 0, 0xff, 0xfe]])), (1, Pixels::U16(vec![65535, 256])));
    // Transparency is not turned round.
    let file = Kind::new([1, 1], &[8, 8], 0).with(338, &[2]).file(&[&[10, 20]]);
    assert_eq!(pixels(&file), (2, Pixels::U8(vec![245, 20])));
}

#[test]
fn palettes() {
    let ramp = |f: fn(u16) -> u16| -> Vec<u16> {
        (0..256).map(f).chain((0..256).map(|v| f(255 - v))).chain((0..256).map(|_| f(7))).collect()
    };
    for (name, scale) in [("times 257", (|v| v * 257) as fn(u16) -> u16), ("times 256", |v| v * 256), ("bytes", |v| v)]
    {
        let file = Kind::new([2, 1], &[8], 3).with(320, &ramp(scale)).file(&[&[3, 200]]);
        assert_eq!(pixels(&file), (3, Pixels::U8(vec![3, 252, 7, 200, 55, 7])), "{name}");
    }
    let fine: Vec<u16> = [1000, 2000, 3000, 4000, 5000, 6000].to_vec();
    let file = Kind::new([3, 1], &[1], 3).with(320, &fine).file(&[&[0b0100_0000]]);
    assert_eq!(pixels(&file), (3, Pixels::U16(vec![1000, 3000, 5000, 2000, 4000, 6000, 1000, 3000, 5000])));
    let four: Vec<u16> = (0..48).map(|k| k % 16 * 257).collect();
    let file = Kind::new([2, 1], &[4], 3).with(320, &four).file(&[&[0x5f]]);
    assert_eq!(pixels(&file), (3, Pixels::U8(vec![5, 5, 5, 15, 15, 15])));
    let short = Kind::new([1, 1], &[8], 3).with(320, &fine).file(&[&[9]]);
    assert!(why(read(&short, 1 << 20)).contains("beyond the 2 of its palette"));
}

#[test]
fn transparency_straight_multiplied_and_other_channels() {
    assert_eq!(pixels(&Kind::new([1, 1], &[8, 8], 1).with(338, &[2]).file(&[&[9, 8]])), (2, Pixels::U8(vec![9, 8])));
    assert_eq!(pixels(&Kind::new([1, 1], &[8, 8], 1).file(&[&[9, 8]])), (2, Pixels::U8(vec![9, 8])));
    let rgba = Kind::new([1, 1], &[8; 4], 2);
    assert_eq!(pixels(&rgba.file(&[&[1, 2, 3, 4]])), (4, Pixels::U8(vec![1, 2, 3, 4])));
    // Half of the colour at half of the opacity is all of the colour.
    let file = Kind::new([2, 1], &[8; 4], 2).with(338, &[1]).file(&[&[100, 51, 0, 127, 0, 0, 0, 0]]);
    assert_eq!(pixels(&file), (4, Pixels::U8(vec![201, 102, 0, 127, 0, 0, 0, 0])));
    let read = decoded(&Kind::new([1, 1], &[16; 5], 2).with(338, &[0, 0]).file(&[&[1, 0, 2, 0, 3, 0, 4, 0, 5, 0]]));
    assert_eq!((read.image.channels, read.image.pixels), (3, Pixels::U16(vec![1, 2, 3])));
    assert!(read.notes[0].contains("2 further channels"), "{:?}", read.notes);
}

#[test]
fn planes_inks_and_colour_differences() {
    let planes = Kind::new([2, 1], &[8; 3], 2).with(284, &[2]).file(&[&[1, 2], &[3, 4], &[5, 6]]);
    assert_eq!(pixels(&planes), (3, Pixels::U8(vec![1, 3, 5, 2, 4, 6])));
    let wide = Kind::new([2, 1], &[16; 2], 1).with(284, &[2]).with(338, &[2]).file(&[&[1, 0, 2, 0], &[3, 0, 4, 0]]);
    assert_eq!(pixels(&wide), (2, Pixels::U16(vec![1, 3, 2, 4])));
    let read = decoded(&Kind::new([2, 1], &[8; 4], 5).file(&[&[255, 0, 0, 0, 0, 0, 0, 255]]));
    assert_eq!(read.image.pixels, Pixels::U8(vec![0, 255, 255, 0, 0, 0]));
    assert!(read.notes[0].contains("CMYK"), "{:?}", read.notes);
    let file = Kind::new([1, 1], &[8; 3], 6).with(530, &[1, 1]).file(&[&[76, 85, 255]]);
    assert_eq!(pixels(&file), (3, Pixels::U8(vec![254, 0, 0])));
}

#[test]
fn jpeg_inside() {
    use image::codecs::jpeg::JpegEncoder;
    let samples: Vec<u8> = (0..16 * 16).flat_map(|k| [200u8, 40, (k / 2) as u8]).collect();
    let mut strip = Vec::new();
    JpegEncoder::new_with_quality(&mut strip, 100).encode(&samples, 16, 16, image::ExtendedColorType::Rgb8).unwrap();
    let file = Kind::new([16, 16], &[8; 3], 6).with(259, &[7]).with(530, &[1, 1]).file(&[&strip]);
    let image = decoded(&file).image;
    let worst = (0..samples.len()).map(|k| (image.sample(k) * 255.0 - f32::from(samples[k])).abs()).fold(0.0, f32::max);
    assert!(image.channels == 3 && worst <= 4.0, "{worst}");
}

#[test]
fn big_tiff() {
    // 2 x 1, 8 bits, grey: tags of 20 bytes, places of 64 bits.
    let mut bytes = b"II+\0\x08\0\0\0\x18\0\0\0\0\0\0\0\x2a\x99\0\0\0\0\0\0".to_vec();
    let tags: [(u16, u16, u64); 8] =
        [(256, 3, 2), (257, 3, 1), (258, 3, 8), (259, 3, 1), (262, 3, 1), (273, 16, 16), (278, 3, 1), (279, 16, 2)];
    bytes.extend_from_slice(&(tags.len() as u64).to_le_bytes());
    for (tag, kind, value) in tags {
        bytes.extend_from_slice(&tag.to_le_bytes());
        bytes.extend_from_slice(&kind.to_le_bytes());
        bytes.extend_from_slice(&1u64.to_le_bytes());
        bytes.extend_from_slice(&value.to_le_bytes());
    }
    bytes.extend_from_slice(&[0; 8]);
    assert_eq!(pixels(&bytes), (1, Pixels::U8(vec![0x2a, 0x99])));
}

#[test]
fn what_is_not_read_is_said_in_words() {
    let message = |kind: Kind| why(read(&kind.file(&[&[0; 64]]), 1 << 20));
    let grey = |bits: u16| Kind::new([1, 1], &[bits], 1);
    for (kind, word) in [
        (grey(8).with(259, &[34925]), "LZMA"),
        (grey(8).with(259, &[6]), "old kind of JPEG"),
        (grey(12), "12 bits"),
        (Kind::new([1, 1], &[5, 6, 5], 2), "different sizes"),
        (Kind::new([1, 1], &[8; 3], 8), "Lab"),
        (Kind::new([1, 1], &[8; 3], 6), "subsampled"),
        (grey(1).with(266, &[2]), "fill order"),
        (Kind::new([1, 1], &[8], 32803), "raw photos"),
    ] {
        let message = message(kind);
        assert!(message.contains(word) && !message.contains("Unknown"), "{message}");
    }
}

#[test]
fn pages_are_told_from_smaller_copies() {
    for (subfile, notes) in [(0u16, 1), (1, 0)] {
        let mut bytes = Kind::new([1, 1], &[8], 1).file(&[&[5]]);
        let (block, first) = Block::open(&bytes).unwrap();
        let next_at = block.directory(first).unwrap().next_at;
        let next = bytes.len() as u32;
        bytes[next_at..next_at + 4].copy_from_slice(&next.to_le_bytes());
        let mut second = Directory::default();
        second.set_shorts(254, &[subfile]);
        second.append(&mut bytes);
        assert_eq!(decoded(&bytes).notes.len(), notes);
    }
}
