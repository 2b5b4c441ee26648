//! Figure 4 of the mapping paper: a binary partition, step by step. Each picture shows the star
//! after one more step; only the steps that would fold have been halved.
//!
//! `cargo run --release --example warp_binary [PICTURE.png]`

use std::error::Error;

use barymap::engine::Engine;
use barymap::mapping::plane::{Cage, CompositeMap, PartitionOptions, partition};
use barymap::models::polygons::twisted_star;
use barymap::progress::Quiet;
use barymap::tools::warp::Placement;
use barymap::tools::warp::pictures::{in_a_row, lattice_picture};
use glam::DVec2;

fn main() -> Result<(), Box<dyn Error>> {
    let output = std::env::args().nth(1).unwrap_or_else(|| "warp_binary.png".into());
    let pair = twisted_star();
    let cage = Cage { source: pair.source, target: pair.target };
    let engine = Engine::cpu();
    let options = PartitionOptions::default();
    let found = partition(&engine, &cage, &options, &Quiet)?;
    println!("knots {:?} along the {} path", found.knots, found.path.word());
    for step in &found.steps {
        println!("  {} to {}: smallest Jacobian {:.3}", step.from, step.to, step.minimum.value);
    }
    assert!(!found.folds && found.steps.len() <= 4);

    let size = [400, 400];
    let placement = Placement::fitting(DVec2::splat(-1.05), DVec2::splat(1.05), size, 4.0);
    let mut pictures = Vec::new();
    for end in 0..found.polygons.len() {
        let polygons = found.polygons[..=end].to_vec();
        // Before the first step nothing has moved.
        let polygons = if end == 0 { vec![found.polygons[0].clone(); 2] } else { polygons };
        let map = CompositeMap::new(options.coordinates, polygons)?;
        pictures.push(lattice_picture(&engine, &map, &placement, size, 50)?);
    }
    barymap::io::write_image(&in_a_row(&pictures, 8)?, &output)?;
    println!("{output}: the star at each knot");
    Ok(())
}
