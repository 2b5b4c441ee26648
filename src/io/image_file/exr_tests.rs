//! OpenEXR files with channels of any name, written by the crate.

use std::io::Cursor;

use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image as Exr, ImageAttributes, IntegerBounds, Layer,
    LayerAttributes, WritableImage, f16,
};

use super::*;
use crate::io::image_file::tests::why;

const MOST: u64 = 1 << 30;

fn channels(list: Vec<(&str, FlatSamples)>) -> AnyChannels<FlatSamples> {
    AnyChannels::sort(list.into_iter().map(|(name, data)| AnyChannel::new(name, data)).collect())
}

/// A file of 2 x 1 pixels.
fn file(list: Vec<(&str, FlatSamples)>) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    Exr::from_channels((2, 1), channels(list)).write().non_parallel().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

fn floats(a: f32, b: f32) -> FlatSamples {
    FlatSamples::F32(vec![a, b])
}

fn pixels(bytes: &[u8], wanted: Option<&str>) -> (u32, Vec<f32>) {
    let image = read(bytes, wanted, "t.exr", MOST).unwrap().image;
    let samples = (0..image.pixels.len()).map(|k| image.sample(k)).collect();
    (image.channels, samples)
}

#[test]
fn single_channels_of_any_name_and_number() {
    assert_eq!(pixels(&file(vec![("Y", floats(0.5, -2.0))]), None), (1, vec![0.5, -2.0]));
    let half = FlatSamples::F16(vec![f16::from_f32(0.25), f16::from_f32(8.0)]);
    let read_half = read(&file(vec![("height", half)]), None, "t.exr", MOST).unwrap();
    assert_eq!((read_half.image.pixels, read_half.metadata.half), (Pixels::F32(vec![0.25, 8.0]), true));
    let labels = read(&file(vec![("id", FlatSamples::U32(vec![7, 16_777_219]))]), None, "t.exr", MOST).unwrap();
    assert_eq!(labels.image.pixels, Pixels::F32(vec![7.0, 16_777_220.0]));
    assert!(labels.notes[0].starts_with("1 whole numbers"), "{:?}", labels.notes);
    assert_eq!(
        pixels(&file(vec![("A", floats(1.0, 0.5)), ("Y", floats(3.0, 4.0))]), None),
        (2, vec![3.0, 1.0, 4.0, 0.5])
    );
}

#[test]
fn layers_of_blender_and_a_wish() {
    let list = || {
        vec![
            ("V.Combined.R", floats(1.0, 2.0)),
            ("V.Combined.G", floats(3.0, 4.0)),
            ("V.Combined.B", floats(5.0, 6.0)),
            ("V.Combined.A", floats(7.0, 8.0)),
            ("V.Depth.Z", floats(9.0, 10.0)),
        ]
    };
    assert_eq!(pixels(&file(list()), None), (4, vec![1.0, 3.0, 5.0, 7.0, 2.0, 4.0, 6.0, 8.0]));
    assert!(read(&file(list()), None, "t.exr", MOST).unwrap().notes[0].contains("V.Depth.Z"));
    assert_eq!(pixels(&file(list()), Some("depth")), (1, vec![9.0, 10.0]));
    assert_eq!(pixels(&file(list()), Some("V.Combined.G")), (1, vec![3.0, 4.0]));
    let message = why(read(&file(list()), Some("Mist"), "t.exr", MOST));
    assert!(message.contains("V.Combined.A") && message.contains("t.exr:V.Combined"), "{message}");
}

#[test]
fn parts_with_names_are_layers() {
    let layer =
        |name: &str, list| Layer::new((2, 1), LayerAttributes::named(name), Encoding::FAST_LOSSLESS, channels(list));
    let parts = vec![
        layer("Z", vec![("Z", floats(9.0, 10.0))]),
        layer("beauty", vec![("R", floats(1.0, 2.0)), ("G", floats(3.0, 4.0)), ("B", floats(5.0, 6.0))]),
    ];
    let attributes = ImageAttributes::new(IntegerBounds::from_dimensions((2, 1)));
    let mut bytes = Cursor::new(Vec::new());
    Exr::from_layers(attributes, parts).write().non_parallel().to_buffered(&mut bytes).unwrap();
    let bytes = bytes.into_inner();
    assert_eq!(pixels(&bytes, None), (3, vec![1.0, 3.0, 5.0, 2.0, 4.0, 6.0]));
    assert_eq!(pixels(&bytes, Some("z")), (1, vec![9.0, 10.0]));
}

#[test]
fn luminance_and_chroma_become_colours() {
    // Red 2, green 1, blue 0.5 of Rec. 709.
    let (r, g, b) = (2.0f32, 1.0f32, 0.5f32);
    let y = 0.2126 * r + 0.7152 * g + 0.0722 * b;
    let list = vec![("Y", floats(y, 1.0)), ("RY", floats((r - y) / y, 0.0)), ("BY", floats((b - y) / y, 0.0))];
    let (count, found) = pixels(&file(list), None);
    let expected = [r, g, b, 1.0, 1.0, 1.0];
    assert!(count == 3 && found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 2e-3), "{found:?}");
}

#[test]
fn the_display_window_is_the_picture() {
    let mut layer =
        Layer::new((2, 1), LayerAttributes::default(), Encoding::UNCOMPRESSED, channels(vec![("Y", floats(1.0, 2.0))]));
    let written = |layer: Layer<AnyChannels<FlatSamples>>, window: IntegerBounds| {
        let mut bytes = Cursor::new(Vec::new());
        let image = Exr::new(ImageAttributes::new(window), layer);
        image.write().non_parallel().to_buffered(&mut bytes).unwrap();
        read(&bytes.into_inner(), None, "t.exr", MOST).unwrap()
    };
    layer.attributes.layer_position = Vec2(1, 1);
    let inside = written(layer.clone(), IntegerBounds::from_dimensions((4, 2)));
    assert_eq!((inside.image.width, inside.image.height), (4, 2));
    assert_eq!(inside.image.pixels, Pixels::F32(vec![0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 0.0]));
    layer.attributes.layer_position = Vec2(-1, 0);
    let cut = written(layer, IntegerBounds::from_dimensions((1, 1)));
    assert_eq!(cut.image.pixels, Pixels::F32(vec![2.0]));
    assert!(cut.notes[0].starts_with("1 pixels outside"), "{:?}", cut.notes);
}
