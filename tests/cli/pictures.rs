//! Picture files as people have them: photos that lie on their side, colour profiles, textures of
//! all kinds.

use barymap::io::image_file::{Density, DensityUnit, Metadata, read_picture, write_picture};
use barymap::picture::{Depth, Image, Pixels};
use exr::prelude::{AnyChannel, AnyChannels, FlatSamples, WritableImage};
use serde_json::json;

use crate::support::{Folder, waves};

/// A cage around a picture of this size that leaves all as it is.
fn still(width: u32, height: u32) -> String {
    let ring = json!([[0, 0], [width, 0], [width, height], [0, height]]);
    json!({"source": ring, "target": ring}).to_string()
}

/// A picture of three bands, red, green and blue from left to right.
fn bands(width: u32, height: u32) -> Image {
    let mut image = Image::zeros(width, height, 3, Depth::U8).unwrap();
    for y in 0..height {
        for x in 0..width {
            image.set(x, y, 3 * x / width, 1.0);
        }
    }
    image
}

/// Columns from bottom to top as rows: what a phone stores of `image` with orientation 6.
fn on_its_side(image: &Image) -> Image {
    let mut stored = Image::zeros(image.height, image.width, image.channels, image.depth()).unwrap();
    for y in 0..image.height {
        for x in 0..image.width {
            for c in 0..image.channels {
                stored.set(y, image.width - 1 - x, c, image.get(x, y, c));
            }
        }
    }
    stored
}

/// EXIF data: orientation, and a maker.
fn exif() -> Vec<u8> {
    let mut block = b"II*\0\x08\0\0\0\x02\0".to_vec();
    block.extend_from_slice(b"\x0f\x01\x02\0\x08\0\0\0\x26\0\0\0");
    block.extend_from_slice(b"\x12\x01\x03\0\x01\0\0\0\x01\0\0\0");
    block.extend_from_slice(b"\0\0\0\0Phonely\0");
    block
}

/// Sets the orientation of a JPEG file with [`exif`].
fn turn(f: &Folder, name: &str, orientation: u8) {
    let mut bytes = f.bytes(name);
    let tag = b"\x12\x01\x03\0\x01\0\0\0\x01\0";
    let at = bytes.windows(tag.len()).position(|w| w == tag).unwrap();
    bytes[at + 8] = orientation;
    std::fs::write(f.path(name), bytes).unwrap();
}

fn profile() -> Vec<u8> {
    let mut icc: Vec<u8> = (0..2000u32).map(|k| (k * 11 % 253) as u8).collect();
    icc[16..20].copy_from_slice(b"RGB ");
    icc
}

fn photo() -> Metadata {
    Metadata {
        icc: Some(profile()),
        exif: Some(exif()),
        density: Some(Density { x: 240.0, y: 240.0, unit: DensityUnit::Inch }),
        quality: Some(88),
        ..Metadata::default()
    }
}

#[test]
fn a_photo_on_its_side_is_warped_as_viewers_show_it() {
    let f = Folder::empty();
    write_picture(&on_its_side(&bands(96, 64)), &photo(), f.path("p.jpg")).unwrap();
    turn(&f, "p.jpg", 6);
    f.write("c.json", &still(96, 64));
    for out in ["o.png", "o.jpg", "o.tif"] {
        let ran = f.run(&format!("warp p.jpg --backend cpu --cage c.json -o {out}")).succeeds();
        assert!(!ran.stderr.contains("note: o."), "{ran:?}");
        let picture = read_picture(f.path(out)).unwrap();
        assert_eq!((picture.image.width, picture.image.height), (96, 64), "{out}");
        for (x, c) in [(16, 0), (48, 1), (80, 2)] {
            let color = [0, 1, 2].map(|k| picture.image.get(x, 32, k));
            assert!((0..3).all(|k| (color[k] - f32::from(k == c)).abs() < 0.05), "{out} at {x}: {color:?}");
        }
        let block = picture.metadata.exif.unwrap();
        assert!(block.windows(7).any(|w| w == b"Phonely"), "{out}");
        assert_eq!(picture.metadata.icc, Some(profile()), "{out}");
        let density = picture.metadata.density.unwrap();
        let inch = if density.unit == DensityUnit::Metre { 0.0254 * density.x } else { density.x };
        assert!((inch - 240.0).abs() < 0.02, "{out}: {density:?}");
        assert_eq!(picture.metadata.quality, out.ends_with("jpg").then_some(88));
    }
    // Once it is upright, it is upright.
    f.run("warp o.jpg --backend cpu --cage c.json -o again.png").succeeds();
    assert_eq!((f.image("again.png").width, f.image("again.png").height), (96, 64));
}

#[test]
fn a_still_cage_keeps_every_bit_of_lossless_files_and_what_is_told_of_them() {
    let f = Folder::empty();
    f.write("c.json", &still(64, 64));
    let told = Metadata { quality: None, ..photo() };
    for (name, depth) in [
        ("p.png", Depth::U8),
        ("q.png", Depth::U16),
        ("p.tif", Depth::U16),
        ("p.webp", Depth::U8),
        ("p.tga", Depth::U8),
    ] {
        let image = waves(64).converted(3, depth).unwrap();
        let colors = if name.ends_with("tga") { Metadata::default() } else { told.clone() };
        write_picture(&image, &colors, f.path(name)).unwrap();
        let ran = f.run(&format!("warp {name} --backend cpu --cage c.json -o out-{name}")).succeeds();
        assert!(!ran.stderr.contains("note"), "{ran:?}");
        let back = read_picture(f.path(&format!("out-{name}"))).unwrap();
        assert!(back.image == image, "{name}");
        assert_eq!(back.metadata, read_picture(f.path(name)).unwrap().metadata, "{name}");
    }
    f.run("warp p.png --backend cpu --cage c.json --frames 2 -o s.png").succeeds();
    assert_eq!(read_picture(f.path("s_0001.png")).unwrap().metadata.icc, Some(profile()));
}

#[test]
fn the_quality_of_a_jpeg_stays_or_is_given() {
    let f = Folder::empty();
    f.write("c.json", &still(64, 64));
    write_picture(&waves(64), &Metadata { quality: Some(71), ..Metadata::default() }, f.path("p.jpg")).unwrap();
    let quality = |name: &str| read_picture(f.path(name)).unwrap().metadata.quality.unwrap();
    f.run("warp p.jpg --backend cpu --cage c.json -o o.jpg").succeeds();
    assert!(quality("o.jpg").abs_diff(71) <= 2);
    f.run("warp p.jpg --backend cpu --cage c.json -o o.jpg --quality 30").succeeds();
    assert_eq!(quality("o.jpg"), 30);
    f.run("warp p.jpg --backend cpu --cage c.json -o o.png --quality 30").fails(2, &["--quality", "JPEG"]);
    assert_eq!(f.run("warp p.jpg --backend cpu --cage c.json -o o.jpg --quality 101").code, Some(2));
}

#[test]
fn nothing_is_lost_without_a_word() {
    let f = Folder::empty();
    f.write("c.json", &still(8, 8));
    let warp =
        |from: &str, to: &str| f.run(&format!("warp {from} --backend cpu --cage c.json -o {to}")).succeeds().stderr;
    let mut clear = waves(8).converted(4, Depth::U8).unwrap();
    (0..8).for_each(|x| clear.set(x, 3, 3, 0.5));
    barymap::io::write_image(&clear, f.path("a.png")).unwrap();
    assert!(warp("a.png", "a.jpg").contains("a.jpg: JPEG has no transparency: 8 pixels"));
    let mut floats = Image::zeros(8, 8, 3, Depth::F32).unwrap();
    floats.set(2, 5, 1, 3.5);
    floats.set(3, 5, 1, -0.5);
    barymap::io::write_image(&floats, f.path("f.exr")).unwrap();
    for out in ["f.png", "f.jpg"] {
        assert!(warp("f.exr", out).contains("2 pixels outside"), "{out}");
    }
    assert!(!warp("f.exr", "f.tif").contains("note"));
    let bytes = waves(8).converted(1, Depth::U8).unwrap();
    barymap::io::write_image(&bytes.converted(1, Depth::U16).unwrap(), f.path("g.png")).unwrap();
    assert!(!warp("g.png", "g.jpg").contains("rounded"), "8-bit values in 16 bits are exact");
    // One of these is a multiple of 257, which 8 bits hold.
    let deep = Image::new(8, 8, 1, Pixels::U16((0..64).map(|k| 1000 + k).collect())).unwrap();
    barymap::io::write_image(&deep, f.path("d.png")).unwrap();
    assert!(warp("d.png", "d.webp").contains("63 pixels are rounded"));
    write_picture(&waves(8), &photo(), f.path("p.png")).unwrap();
    let said = warp("p.png", "p.exr");
    assert!(["colour profile", "EXIF", "resolution"].iter().all(|w| said.contains(w)), "{said}");
    f.run("warp p.png --backend cpu --cage c.json -o o.gif").fails(2, &["o.gif", ".png", ".webp"]);
}

/// The spheres' transfer with a texture.
fn transfer(f: &Folder, texture: &str, out: &str) -> Image {
    let ran = f.run(&format!(
        "transfer --source s.obj {texture} --target t.obj --anchors a.json --method closest --size 64 --margin 0 --backend cpu -o {out}"
    ));
    ran.succeeds();
    f.image(out)
}

#[test]
fn textures_of_all_formats_give_the_same_result() {
    let f = Folder::spheres();
    let expected = transfer(&f, "--texture s.png", "e.png");
    for name in ["s.tga", "s.tif", "s.webp", "s.bmp", "s.qoi"] {
        barymap::io::write_image(&waves(128), f.path(name)).unwrap();
        assert!(transfer(&f, &format!("--texture {name}"), "o.png") == expected, "{name}");
    }
    // As the material's own texture, the only file without a mark at its beginning.
    let text = f.read("s.obj");
    f.write("s.obj", &format!("mtllib s.mtl\nusemtl skin\n{text}"));
    f.write("s.mtl", "newmtl skin\nmap_Kd s.tga\n");
    assert!(transfer(&f, "", "o.png") == expected);
}

/// An OpenEXR file of float channels, of the three colours of a picture.
fn layered(f: &Folder, name: &str, channels: &[(&str, u32)], image: &Image) {
    let plane = |c: u32| {
        let samples = (0..image.height).flat_map(|y| (0..image.width).map(move |x| (x, y)));
        FlatSamples::F32(samples.map(|(x, y)| image.get(x, y, c)).collect())
    };
    let list = channels.iter().map(|(n, c)| AnyChannel::new(*n, plane(*c))).collect();
    let size = (image.width as usize, image.height as usize);
    exr::image::Image::from_channels(size, AnyChannels::sort(list))
        .write()
        .non_parallel()
        .to_file(f.path(name))
        .unwrap();
}

#[test]
fn layers_and_single_channels_of_openexr_files() {
    let f = Folder::spheres();
    let image = waves(128).converted(3, Depth::F32).unwrap();
    barymap::io::write_image(&image, f.path("rgb.exr")).unwrap();
    let expected = transfer(&f, "--texture rgb.exr", "e.exr");
    let layers = [("V.Combined.R", 0), ("V.Combined.G", 1), ("V.Combined.B", 2), ("V.Depth.Z", 0)];
    layered(&f, "l.exr", &layers, &image);
    assert!(transfer(&f, "--texture l.exr", "o.exr") == expected);
    assert!(transfer(&f, "--texture l.exr:V.Combined", "o.exr") == expected);
    let depth = transfer(&f, "--texture l.exr:V.Depth --kind displacement", "d.exr");
    layered(&f, "y.exr", &[("Y", 0)], &image);
    let grey = transfer(&f, "--texture y.exr --kind displacement", "y2.exr");
    // Grey, and what is covered.
    assert!(grey.channels == 2 && grey == depth, "{} and {} channels", grey.channels, depth.channels);
    // The same numbers as grey floats of a TIFF file.
    let mut floats = Image::zeros(128, 128, 1, Depth::F32).unwrap();
    (0..128 * 128).for_each(|k| floats.set(k % 128, k / 128, 0, image.get(k % 128, k / 128, 0)));
    barymap::io::write_image(&floats, f.path("y.tif")).unwrap();
    assert!(transfer(&f, "--texture y.tif --kind displacement", "y3.tif") == grey);
    layered(&f, "two.exr", &[("a.R", 0), ("a.G", 1), ("a.B", 2), ("b.R", 0), ("b.G", 1), ("b.B", 2)], &image);
    f.run("transfer --source s.obj --texture two.exr --target t.obj --anchors a.json --backend cpu -o x.exr")
        .fails(1, &["two.exr", "a.R", "two.exr:a"]);
}

#[test]
fn a_transfer_keeps_the_profile_and_not_the_camera() {
    let f = Folder::spheres();
    write_picture(&waves(128), &photo(), f.path("s.jpg")).unwrap();
    transfer(&f, "--texture s.jpg", "o.jpg");
    let told = read_picture(f.path("o.jpg")).unwrap().metadata;
    assert_eq!((told.icc, told.exif, told.quality), (Some(profile()), None, Some(88)));
    // A texture is taken as stored: texture coordinates are those of its pixels. A note says so.
    turn(&f, "s.jpg", 3);
    let ran = f.run("transfer --source s.obj --texture s.jpg --target t.obj --anchors a.json --method closest --size 64 --margin 0 --backend cpu -o p.jpg");
    assert!(ran.succeeds().stderr.contains("s.jpg: viewers turn this picture (orientation 3)"));
    assert!(f.image("p.jpg") == f.image("o.jpg"));
}

#[test]
fn what_is_no_picture_is_called_by_its_name() {
    let f = Folder::empty();
    f.write("c.json", &still(8, 8));
    std::fs::write(f.path("p.heic"), b"\0\0\0\x18ftypheic\0\0\0\0mif1heic").unwrap();
    f.run("warp p.heic --backend cpu --cage c.json -o o.png").fails(1, &["p.heic", "HEIC", "JPEG"]);
}
