//! Figure 5 of the mapping paper: the Jacobian of the direct map to intermediate polygons, which
//! turns negative (magenta) as the target moves away, at the vertices first; and at the end that of
//! the composite map, which does not.
//!
//! `cargo run --release --example warp_jacobian [PICTURE.png]`

#[path = "shared/device.rs"]
mod device;

use std::error::Error;

use barymap::engine::Engine;
use barymap::geometry::Side;
use barymap::mapping::plane::path::{Linear, VertexPath};
use barymap::mapping::plane::{Cage, CompositeMap, Coordinates, PartitionOptions, PathKind, partition};
use barymap::models::polygons::twisted_star;
use barymap::picture::Image;
use barymap::progress::Quiet;
use barymap::tools::warp::Placement;
use barymap::tools::warp::pictures::{heat_map, in_a_row};
use glam::DVec2;

const SIZE: [u32; 2] = [340, 340];

/// The Jacobian over the source polygon.
fn picture(engine: &Engine, map: &CompositeMap) -> barymap::Result<(f32, Image)> {
    let placement = Placement::fitting(DVec2::splat(-1.0), DVec2::ONE, SIZE, 4.0);
    let pixel = |i: u32| DVec2::new(f64::from(i % SIZE[0]) + 0.5, f64::from(i / SIZE[0]) + 0.5);
    let points: Vec<DVec2> = (0..SIZE[0] * SIZE[1]).map(|i| placement.to_units(pixel(i))).collect();
    let mapped = map.forward_points(engine, &points)?;
    let inside = |p: &DVec2| map.source().contains(*p) == Side::Inside;
    let values: Vec<f32> =
        mapped.iter().zip(&points).map(|(m, p)| if inside(p) { m.jacobian() as f32 } else { f32::NAN }).collect();
    let least = values.iter().copied().filter(|j| !j.is_nan()).fold(f32::INFINITY, f32::min);
    Ok((least, heat_map(&values, SIZE[0])?))
}

fn main() -> Result<(), Box<dyn Error>> {
    let output = std::env::args().nth(1).unwrap_or_else(|| "warp_jacobian.png".into());
    let pair = twisted_star();
    let cage = Cage { source: pair.source, target: pair.target };
    let engine = device::engine()?;
    let path = Linear::new(&cage);
    let mut pictures = Vec::new();
    for t in [0.25, 0.5, 0.75, 1.0] {
        let map = CompositeMap::new(Coordinates::MeanValue, vec![cage.source.clone(), path.polygon(t)?])?;
        let (least, picture) = picture(&engine, &map)?;
        println!("directly to t = {t}: smallest Jacobian of all pixels {least:.3}");
        pictures.push(picture);
    }
    let options = PartitionOptions { path: PathKind::Linear, ..PartitionOptions::default() };
    let found = partition(&engine, &cage, &options, &Quiet)?;
    let (least, picture) = picture(&engine, &CompositeMap::new(Coordinates::MeanValue, found.polygons)?)?;
    println!("in {} steps to t = 1: {least:.3}", found.steps.len());
    assert!(least > 0.0);
    pictures.push(picture);
    barymap::io::write_image(&in_a_row(&pictures, 6)?, &output)?;
    println!("{output}: the direct map for t = 0.25, 0.5, 0.75 and 1, and the composite map");
    Ok(())
}
