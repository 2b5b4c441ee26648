//! Figures 8, 9 and 10 of the mapping paper: as the corner of a square moves in, the smallest
//! Jacobian falls along a straight line, 1 - (2 sqrt 2 - 1) s. The knots of the binary partition
//! appear all at once; those of the continuous one grow out of others.
//!
//! `cargo run --release --example warp_continuous [PICTURE.png]`

use std::error::Error;

use barymap::engine::Engine;
use barymap::mapping::plane::{
    Cage, CompositeMap, Coordinates, PartitionKind, PartitionOptions, PathKind, SampleOptions, jacobian_min, partition,
};
use barymap::models::polygons::square_corner;
use barymap::progress::Quiet;
use barymap::tools::warp::draw::Canvas;
use glam::DVec2;

const SIDE: u32 = 500;

fn main() -> Result<(), Box<dyn Error>> {
    let output = std::env::args().nth(1).unwrap_or_else(|| "warp_continuous.png".into());
    let engine = Engine::cpu();
    let samples = SampleOptions { resolution: 32 };
    let mut canvas = Canvas::new(3 * SIDE, SIDE, [255; 3]);
    // s from 0 to 1 goes to the right; the value, or the knot, goes up.
    let place =
        |panel: u32, s: f64, value: f64| DVec2::new(f64::from(panel * SIDE) + 25.0 + 450.0 * s, 475.0 - 450.0 * value);
    for panel in 0..3 {
        canvas.line(place(panel, 0.0, 0.0), place(panel, 1.0, 0.0), 1.0, [150; 3]);
        canvas.line(place(panel, 0.0, 0.0), place(panel, 0.0, 1.0), 1.0, [150; 3]);
    }
    let (binary, continuous) = (PartitionKind::Binary, PartitionKind::Continuous);
    // How far a point of the square jumps when the corner moves by 0.005.
    let mut jumps = [0.0_f64; 2];
    let mut before: [Option<DVec2>; 2] = [None; 2];
    for k in 0..=90 {
        let s = f64::from(k) * 0.01;
        let pair = square_corner(s);
        let cage = Cage { source: pair.source.clone(), target: pair.target.clone() };
        let least = jacobian_min(&engine, Coordinates::MeanValue, &[(pair.source, pair.target)], &samples)?[0].value;
        assert!((least - (1.0 - (8.0_f64.sqrt() - 1.0) * s)).abs() < 1e-6, "s = {s}: {least}");
        canvas.disc(place(0, s, 0.5 + 0.5 * least), 1.5, if least > 0.0 { [30, 110, 230] } else { [225, 40, 40] });
        for (panel, kind) in [(1, binary), (2, continuous)] {
            let options = PartitionOptions { kind, path: PathKind::Linear, samples, ..PartitionOptions::default() };
            let found = partition(&engine, &cage, &options, &Quiet)?;
            for &knot in &found.knots {
                canvas.disc(place(panel, s, knot), 2.0, [30, 30, 30]);
            }
            let map = CompositeMap::new(Coordinates::MeanValue, found.polygons)?;
            let now = map.forward(DVec2::new(0.7, 0.6)).point;
            let i = panel as usize - 1;
            // Past that the square is so thin that every step moves points far.
            if s > 0.75 {
                continue;
            }
            jumps[i] = jumps[i].max(before[i].replace(now).map_or(0.0, |b| b.distance(now)));
        }
    }
    println!("the smallest Jacobian is 1 - (2 sqrt 2 - 1) s, to 1e-6");
    println!("largest jump of a point while the corner moves by {:.4}:", 0.01 * 2.0_f64.sqrt());
    println!("  binary {:.4}, continuous {:.4}", jumps[0], jumps[1]);
    assert!(jumps[1] < jumps[0]);
    barymap::io::write_image(&canvas.into_image()?, &output)?;
    println!(
        "{output}: the smallest Jacobian against s (red below 0), the knots of the binary and of the continuous partition"
    );
    Ok(())
}
