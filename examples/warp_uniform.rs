//! Figure 3 of the mapping paper: the same map in more and more equal steps. A star whose tips and
//! notches change places folds in one, two and four steps, and no longer in eight.
//!
//! `cargo run --release --example warp_uniform [PICTURE.png]`

use std::error::Error;

use barymap::engine::Engine;
use barymap::mapping::plane::{Cage, CompositeMap, PartitionKind, PartitionOptions, PathKind, partition};
use barymap::models::polygons::inverted_star;
use barymap::progress::Quiet;
use barymap::tools::warp::Placement;
use barymap::tools::warp::pictures::{in_a_row, lattice_picture};
use glam::DVec2;

fn main() -> Result<(), Box<dyn Error>> {
    let output = std::env::args().nth(1).unwrap_or_else(|| "warp_uniform.png".into());
    let pair = inverted_star();
    let cage = Cage { source: pair.source, target: pair.target };
    let engine = Engine::cpu();
    let size = [440, 440];
    let placement = Placement::fitting(DVec2::splat(-1.0), DVec2::ONE, size, 8.0);

    let mut pictures = Vec::new();
    for steps in [1, 2, 4, 8] {
        let kind = PartitionKind::Uniform(steps);
        let options = PartitionOptions { kind, path: PathKind::Linear, ..PartitionOptions::default() };
        let found = partition(&engine, &cage, &options, &Quiet)?;
        let least = found.steps.iter().map(|s| s.minimum.value).fold(f64::INFINITY, f64::min);
        println!("{steps} steps: smallest Jacobian {least:.3}");
        assert_eq!(found.folds, steps < 8);
        let map = CompositeMap::new(options.coordinates, found.polygons)?;
        pictures.push(lattice_picture(&engine, &map, &placement, size, 60)?);
    }
    barymap::io::write_image(&in_a_row(&pictures, 16)?, &output)?;
    println!("{output}: 1, 2, 4 and 8 steps, magenta where the map folds");
    Ok(())
}
