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
use barymap::tools::warp::draw::Canvas;
use barymap::tools::warp::pictures::lattice_picture;
use glam::DVec2;

fn main() -> Result<(), Box<dyn Error>> {
    let output = std::env::args().nth(1).unwrap_or_else(|| "warp_convex.png".into());
    let pair = convex_witness();
    let cage = Cage { source: pair.source, target: pair.target };
    let engine = Engine::cpu();
    let size = [440, 480];
    let (low, high) = cage.target.bounds();
    let whole = Placement::fitting(low, high, size, 12.0);
    // Next to a short edge of the target; the fold is a hundredth of its size.
    let corner = Placement::fitting(DVec2::new(0.655, -0.69), DVec2::new(0.72, -0.625), size, 0.0);

    let mut canvas = Canvas::new(3 * size[0], 2 * size[1], [255; 3]);
    for (column, (name, coordinates, kind, folds)) in [
        ("Wachspress", Coordinates::Wachspress, PartitionKind::Direct, false),
        ("mean value", Coordinates::MeanValue, PartitionKind::Direct, true),
        ("mean value in ten steps", Coordinates::MeanValue, PartitionKind::Uniform(10), false),
    ]
    .into_iter()
    .enumerate()
    {
        let options = PartitionOptions { kind, coordinates, path: PathKind::Intrinsic, ..PartitionOptions::default() };
        let found = partition(&engine, &cage, &options, &Quiet)?;
        let least = found.steps.iter().map(|s| s.minimum.value).fold(f64::INFINITY, f64::min);
        println!("{name}: smallest Jacobian of a step {least:.4}");
        assert_eq!(least <= 0.0, folds, "{name}");
        let map = CompositeMap::new(coordinates, found.polygons)?;
        for (row, (placement, cells)) in [(&whole, 60), (&corner, 500)].into_iter().enumerate() {
            let picture = lattice_picture(&engine, &map, placement, size, cells)?;
            canvas.paste(&Canvas::of(&picture)?, (column as u32 * size[0]).into(), (row as u32 * size[1]).into());
        }
    }
    barymap::io::write_image(&canvas.into_image()?, &output)?;
    println!(
        "{output}: Wachspress, mean value, composite mean value; below the lower right corner, magenta where the map folds"
    );
    Ok(())
}
