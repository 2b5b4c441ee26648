//! Figure 1 of the mapping paper: a square with a square hole that turns by a quarter. In one step
//! the map folds (magenta); in the steps of a binary partition it does not, and close to the hole
//! it stays smooth.
//!
//! `cargo run --release --example warp_holes [PICTURE.png]`

use std::error::Error;

use barymap::engine::Engine;
use barymap::mapping::plane::{Cage, CompositeMap, PartitionKind, PartitionOptions, PathKind, partition};
use barymap::models::polygons::nested_squares;
use barymap::progress::Quiet;
use barymap::tools::warp::Placement;
use barymap::tools::warp::pictures::{in_a_row, lattice_picture};
use glam::DVec2;

fn main() -> Result<(), Box<dyn Error>> {
    let output = std::env::args().nth(1).unwrap_or_else(|| "warp_holes.png".into());
    let pair = nested_squares();
    let cage = Cage { source: pair.source, target: pair.target };
    let engine = Engine::cpu();
    let size = [600, 600];
    let whole = Placement::fitting(DVec2::splat(-1.0), DVec2::ONE, size, 10.0);
    let corner = Placement::fitting(DVec2::new(0.15, -0.65), DVec2::new(0.65, -0.15), size, 0.0);

    let mut pictures = Vec::new();
    for kind in [PartitionKind::Direct, PartitionKind::Binary] {
        let options = PartitionOptions { kind, path: PathKind::Linear, ..PartitionOptions::default() };
        let found = partition(&engine, &cage, &options, &Quiet)?;
        let least = found.steps.iter().map(|s| s.minimum.value).fold(f64::INFINITY, f64::min);
        println!("{} steps {:?}: smallest Jacobian {least:.3}", found.steps.len(), found.knots);
        assert_eq!(found.folds, kind == PartitionKind::Direct);
        let map = CompositeMap::new(options.coordinates, found.polygons)?;
        pictures.push(lattice_picture(&engine, &map, &whole, size, 40)?);
        if kind == PartitionKind::Binary {
            // Four times as fine a lattice, four times as near.
            pictures.push(lattice_picture(&engine, &map, &corner, size, 160)?);
        }
    }
    barymap::io::write_image(&in_a_row(&pictures, 20)?, &output)?;
    println!("{output}: one step, the binary partition, and a corner of its hole");
    Ok(())
}
