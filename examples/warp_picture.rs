//! Figure 7 of the mapping paper: a picture warped by a map that folds, and by a composite map that
//! does not. The picture is painted here; name a file of your own to see it bent.
//!
//! `cargo run --release --example warp_picture [OUTPUT.png [PICTURE.png]]`

#[path = "shared/device.rs"]
mod device;

use std::error::Error;

use barymap::mapping::plane::{Cage, CompositeMap, PartitionKind, PartitionOptions, partition};
use barymap::picture::{Depth, Image};
use barymap::progress::Quiet;
use barymap::tools::warp::pictures::{in_a_row, overlay};
use barymap::tools::warp::{Outside, Placement, WarpOptions, warp_picture};
use glam::DVec2;

/// Rings and spokes on a chequered ground.
fn painted(side: u32) -> Result<Image, barymap::Error> {
    let mut image = Image::zeros(side, side, 3, Depth::U8)?;
    for y in 0..side {
        for x in 0..side {
            let p = (DVec2::new(f64::from(x), f64::from(y)) + 0.5) / f64::from(side) - 0.5;
            let (r, angle) = (p.length(), p.y.atan2(p.x));
            let check = f64::from((x / 24 + y / 24) % 2);
            let color = if r < 0.36 {
                let ring = 0.5 + 0.5 * (r * 70.0).cos();
                let spoke = 0.5 + 0.5 * (angle * 9.0).cos();
                [0.95 - 0.5 * ring, 0.35 + 0.5 * spoke, 0.25 + 0.5 * ring * spoke]
            } else {
                [0.82 + 0.1 * check, 0.86 + 0.06 * check, 0.93]
            };
            (0..3).for_each(|c| image.set(x, y, c, color[c as usize] as f32));
        }
    }
    Ok(image)
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let output = arguments.next().unwrap_or_else(|| "warp_picture.png".into());
    let image = match arguments.next() {
        Some(path) => barymap::io::read_image(path)?.converted(3, Depth::U8)?,
        None => painted(480)?,
    };
    let (w, h) = (f64::from(image.width), f64::from(image.height));

    // A frame with a handle in the middle of each side; the handles are pushed inwards and around.
    let at = |x: f64, y: f64| DVec2::new(x * w, y * h);
    let source = vec![
        at(0.0, 0.0),
        at(0.5, 0.0),
        at(1.0, 0.0),
        at(1.0, 0.5),
        at(1.0, 1.0),
        at(0.5, 1.0),
        at(0.0, 1.0),
        at(0.0, 0.5),
    ];
    let mut target = source.clone();
    (target[1], target[3], target[5], target[7]) = (at(0.6, 0.36), at(0.64, 0.6), at(0.4, 0.64), at(0.36, 0.4));
    let cage = Cage::new(vec![source], vec![target])?;

    let engine = device::engine()?;
    let mut pictures = vec![image.clone()];
    for kind in [PartitionKind::Direct, PartitionKind::Binary] {
        let options = PartitionOptions { kind, ..PartitionOptions::default() };
        let found = partition(&engine, &cage, &options, &Quiet)?;
        println!("{} steps, folds: {}", found.steps.len(), found.folds);
        assert_eq!(found.folds, kind == PartitionKind::Direct);
        let map = CompositeMap::new(options.coordinates, found.polygons)?;
        let outside = WarpOptions { outside: Outside::Transparent, ..WarpOptions::default() };
        let warped = warp_picture(&engine, &image, &map, &outside, &Quiet)?;
        println!("  {} pixels inside have no pre-image", warped.stats.failed_inside);
        pictures.push(overlay(&warped.image, &map, &Placement::pixels(), &Placement::pixels())?);
    }
    barymap::io::write_image(&in_a_row(&pictures, 12)?, &output)?;
    println!("{output}: the picture, warped in one step (it folds), and without folds");
    Ok(())
}
