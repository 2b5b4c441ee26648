//! Figure 2 of the mapping paper: convex polygons between which the mean value map folds, by a little, while the Wachspress map and
//! the composite mean value map in ten steps do not.
//!
//! `cargo run --release --example warp_convex [PICTURE.png]`

use std::error::Error;

use barymap::engine::Engine;
use barymap::mapping::plane::{Cage, CompositeMap, Coordinates, PartitionKind, PartitionOptions, PathKind, partition};
use barymap::models::polygons::convex_witness;
use barymap::progress::Quiet;
use barymap::tools::warp::Placement;
use barymap::tools::warp::pictures::{in_a_row, lattice_picture};

fn main() -> Result<(), Box<dyn Error>> {
    let output = std::env::args().nth(1).unwrap_or_else(|| "warp_convex.png".into());
    let pair = convex_witness();
    let cage = Cage { source: pair.source, target: pair.target };
    let engine = Engine::cpu();
    let size = [560, 640];
    let (low, high) = cage.target.bounds();
    let placement = Placement::fitting(low, high, size, 12.0);

    let mut pictures = Vec::new();
    for (name, coordinates, kind, folds) in [
        ("Wachspress", Coordinates::Wachspress, PartitionKind::Direct, false),
        ("mean value", Coordinates::MeanValue, PartitionKind::Direct, true),
        ("mean value in ten steps", Coordinates::MeanValue, PartitionKind::Uniform(10), false),
    ] {
        let options = PartitionOptions { kind, coordinates, path: PathKind::Intrinsic, ..PartitionOptions::default() };
        let found = partition(&engine, &cage, &options, &Quiet)?;
        let least = found.steps.iter().map(|s| s.minimum.value).fold(f64::INFINITY, f64::min);
        println!("{name}: smallest Jacobian of a step {least:.4}");
        assert_eq!(least <= 0.0, folds, "{name}");
        let map = CompositeMap::new(coordinates, found.polygons)?;
        pictures.push(lattice_picture(&engine, &map, &placement, size, 60)?);
    }
    barymap::io::write_image(&in_a_row(&pictures, 20)?, &output)?;
    println!("{output}: Wachspress, mean value (magenta where it folds, lower left), composite mean value");
    Ok(())
}
