//! Figure 12 of the mapping paper: the composite through the same polygons backwards comes the
//! closer to the inverse the more steps there are: m steps times the error stay constant. The exact
//! inverse is beside it.
//!
//! `cargo run --release --example warp_inverse [PICTURE.png]`

use std::error::Error;

use barymap::engine::Engine;
use barymap::geometry::Side;
use barymap::mapping::plane::{Cage, CompositeMap, PartitionKind, PartitionOptions, PathKind, partition};
use barymap::models::polygons::twisted_star;
use barymap::progress::Quiet;
use barymap::tools::warp::draw::Canvas;
use glam::DVec2;

fn main() -> Result<(), Box<dyn Error>> {
    let output = std::env::args().nth(1).unwrap_or_else(|| "warp_inverse.png".into());
    let pair = twisted_star();
    let cage = Cage { source: pair.source, target: pair.target };
    let engine = Engine::cpu();
    let raster = |i: i32| DVec2::new(f64::from(i % 60), f64::from(i / 60)) / 29.5 - 1.0;
    let points: Vec<DVec2> = (0..3600).map(raster).filter(|p| cage.source.contains(*p) == Side::Inside).collect();
    let steps: Vec<u32> = (3..=9).map(|k| 1 << k).collect();
    let mut errors = Vec::new();
    for &m in &steps {
        let options = PartitionOptions {
            kind: PartitionKind::Uniform(m),
            path: PathKind::Linear,
            samples: barymap::mapping::plane::SampleOptions { resolution: 16 },
            ..PartitionOptions::default()
        };
        let map = CompositeMap::new(options.coordinates, partition(&engine, &cage, &options, &Quiet)?.polygons)?;
        let backward = map.backward();
        let error =
            points.iter().map(|p| backward.forward(map.forward(*p).point).point.distance(*p)).fold(0.0, f64::max);
        let there_and_back =
            |p: &DVec2| map.inverse(map.forward(*p).point).map_or(f64::INFINITY, |m| m.point.distance(*p));
        // Every tenth point: the exact inverse of many steps takes its time.
        let exact = points.iter().step_by(10).map(there_and_back).fold(0.0, f64::max);
        println!("{m:4} steps: backwards {error:.2e}, times m {:.3}; exact inverse {exact:.1e}", error * f64::from(m));
        assert!(exact < 1e-9);
        errors.push(error);
    }
    let constant = |k: usize| errors[k] * f64::from(steps[k]);
    assert!((constant(6) / constant(3) - 1.0).abs() < 0.04, "the error falls like 1/m");

    // Logarithmic in both directions, with a line of slope -1 beside the points.
    let mut canvas = Canvas::new(520, 520, [255; 3]);
    let place =
        |m: f64, error: f64| DVec2::new(40.0 + 70.0 * (m / 8.0).log2(), 60.0 - 70.0 * (error / errors[0]).log2() * 0.9);
    canvas.line(DVec2::new(40.0, 480.0), DVec2::new(500.0, 480.0), 1.0, [150; 3]);
    canvas.line(DVec2::new(40.0, 20.0), DVec2::new(40.0, 480.0), 1.0, [150; 3]);
    canvas.line(place(8.0, errors[0]), place(512.0, errors[0] / 64.0), 1.0, [150; 3]);
    for (m, error) in steps.iter().zip(&errors) {
        let p = place(f64::from(*m), *error);
        canvas.disc(p, 4.0, [225, 40, 40]);
        canvas.figures(&m.to_string(), p.x as i64 - 8, 488, 2, [60; 3]);
    }
    barymap::io::write_image(&canvas.into_image()?, &output)?;
    println!("{output}: error against the number of steps; the line is 1/m");
    Ok(())
}
