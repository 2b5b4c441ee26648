//! `barymap transfer --kind`: labels, normals and heights.

use barymap::picture::{Depth, Image, Pixels};

use crate::support::{Folder, difference};

const TRANSFER: &str = "transfer --backend cpu --source s.obj --target t.obj --anchors a.json --size 128";

#[test]
fn each_layer_has_its_own_kind() {
    let f = Folder::spheres();
    let samples: Vec<u16> = (0..64 * 64).map(|i| if (i / 16) % 2 == 0 { 300 } else { 41_000 }).collect();
    barymap::io::write_image(&Image::new(64, 64, 1, Pixels::U16(samples)).unwrap(), f.path("l.png")).unwrap();
    let flat = Image::new(32, 32, 3, Pixels::U8([128, 128, 255].repeat(32 * 32))).unwrap();
    barymap::io::write_image(&flat, f.path("n.png")).unwrap();
    let outputs = "-o ol.png -o on.png -o oh.png -o oc.png";
    let textures = "--texture l.png --texture n.png --texture n.png --texture s.png";
    let kinds = "--kind labels --kind normal --kind displacement";
    f.run(&format!("{TRANSFER} {textures} {kinds} {outputs} --coverage c.png --report r.json")).succeeds();
    let (labels, cover) = (f.image("ol.png"), f.image("c.png"));
    assert_eq!(labels.depth(), Depth::U16);
    let Pixels::U16(values) = &labels.pixels else { panic!() };
    let n = labels.channels as usize;
    let shown: Vec<u16> = (0..128 * 128).filter(|&i| cover.sample(i) == 1.0).map(|i| values[i * n]).collect();
    assert!(shown.iter().all(|v| [300, 41_000].contains(v)) && shown.contains(&300) && shown.contains(&41_000));
    // What is flat stays flat, to the byte.
    let normals = f.image("on.png");
    let n = normals.channels as usize;
    let Pixels::U8(values) = &normals.pixels else { panic!() };
    assert!((0..128 * 128).filter(|&i| cover.sample(i) == 1.0).all(|i| values[i * n..i * n + 3] == [128, 128, 255]));
    assert!(difference(&f.image("oc.png"), &crate::support::waves(128), &cover) < 0.03);
    // A sphere of radius 1 became an ellipsoid of about 1.1.
    let ratio = f.json("r.json")["size_ratio"].as_f64().unwrap();
    assert!((1.02..1.2).contains(&ratio), "{ratio}");
}

#[test]
fn kinds_that_do_not_fit_are_refused() {
    let f = Folder::spheres();
    f.run(&format!("{TRANSFER} --texture s.png --kind color --kind labels -o o.png"))
        .fails(2, &["--kind", "2 kinds for 1"]);
    assert_eq!(f.run(&format!("{TRANSFER} --texture s.png --kind bumps -o o.png")).code, Some(2));
    barymap::io::write_image(&Image::zeros(4, 4, 1, Depth::U8).unwrap(), f.path("g.png")).unwrap();
    f.run(&format!("{TRANSFER} --texture g.png --kind normal -o o.png")).fails(1, &["normal map of 1 channels"]);
    assert!(!f.path("o.png").exists());
}
