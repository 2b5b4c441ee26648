//! Figure 2 of the mapping paper: convex polygons between which the mean value map folds, by a
//! little, while the Wachspress map and the composite mean value map in ten steps do not.
//!
//! `cargo run --release --example warp_convex [PICTURE.png]`

use std::error::Error;

use barymap::engine::Engine;
use barymap::geometry::Side;
use barymap::mapping::plane::{
    Cage, CompositeMap, Coordinates, Mapped, PartitionKind, PartitionOptions, PathKind, partition,
};
use barymap::models::polygons::convex_witness;
use barymap::picture::Image;
use barymap::progress::Quiet;
use barymap::tools::warp::Placement;
use barymap::tools::warp::draw::Canvas;
use barymap::tools::warp::pictures::{SCALE_WIDTH, heat_map, lattice_picture};
use glam::DVec2;

/// The Jacobian over a part of the source.
fn jacobian(engine: &Engine, map: &CompositeMap, placement: &Placement, size: [u32; 2]) -> barymap::Result<Image> {
    let pixel = |i: u32| DVec2::new(f64::from(i % size[0]) + 0.5, f64::from(i / size[0]) + 0.5);
    let points: Vec<DVec2> = (0..size[0] * size[1]).map(|i| placement.to_units(pixel(i))).collect();
    let mapped = map.forward_points(engine, &points)?;
    let inside = |p: &DVec2| map.source().contains(*p) == Side::Inside;
    let value = |(m, p): (&Mapped, &DVec2)| if inside(p) { m.jacobian() as f32 } else { f32::NAN };
    heat_map(&mapped.iter().zip(&points).map(value).collect::<Vec<_>>(), size[0])
}

fn main() -> Result<(), Box<dyn Error>> {
    let output = std::env::args().nth(1).unwrap_or_else(|| "warp_convex.png".into());
    let pair = convex_witness();
    let cage = Cage { source: pair.source, target: pair.target };
    let engine = Engine::cpu();
    let size = [440, 480];
    let (low, high) = cage.target.bounds();
    let whole = Placement::fitting(low, high, size, 12.0);
    // Around the lower left vertices of the source, where the map folds.
    let corner =
        Placement::fitting(DVec2::new(-0.4, -1.0), DVec2::new(-0.2, -0.8), [size[0] - SCALE_WIDTH, size[1]], 0.0);

    let mut canvas = Canvas::new(3 * size[0], 2 * size[1], [255; 3]);
    let maps = [
        ("Wachspress", Coordinates::Wachspress, PartitionKind::Direct, false),
        ("mean value", Coordinates::MeanValue, PartitionKind::Direct, true),
        ("mean value in ten steps", Coordinates::MeanValue, PartitionKind::Uniform(10), false),
    ];
    for (column, (name, coordinates, kind, folds)) in (0i64..).zip(maps) {
        let options = PartitionOptions { kind, coordinates, path: PathKind::Intrinsic, ..PartitionOptions::default() };
        let found = partition(&engine, &cage, &options, &Quiet)?;
        let least = found.steps.iter().map(|s| s.minimum.value).fold(f64::INFINITY, f64::min);
        println!("{name}: smallest Jacobian of a step {least:.4}");
        assert_eq!(least <= 0.0, folds, "{name}");
        let map = CompositeMap::new(coordinates, found.polygons)?;
        let lattice = lattice_picture(&engine, &map, &whole, size, 60)?;
        let heat = jacobian(&engine, &map, &corner, [size[0] - SCALE_WIDTH, size[1]])?;
        canvas.paste(&Canvas::of(&lattice)?, column * i64::from(size[0]), 0);
        canvas.paste(&Canvas::of(&heat)?, column * i64::from(size[0]), size[1].into());
    }
    barymap::io::write_image(&canvas.into_image()?, &output)?;
    println!(
        "{output}: Wachspress, mean value, composite mean value; below the Jacobian near the lower left of the source, magenta where the map folds"
    );
    Ok(())
}
