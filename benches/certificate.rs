//! Certificates: boxes and time to prove that the steps of known partitions do not fold, beside the
//! time to sample the same minimum on a raster, in one program.
//!
//! `cargo bench --bench certificate`. Times are process CPU time / 2, the best of several rounds.
//! `bound` is what is proved, `at most` the least Jacobian met, `sampled` the minimum over a raster
//! of 1024 with vertices and edges, which proves nothing.

mod support;

use barymap::engine::Engine;
use barymap::geometry::Polygon;
use barymap::mapping::plane::certificate::certificate;
use barymap::mapping::plane::{CertifyOptions, Coordinates, SampleOptions, Verdict, jacobian_min};
use barymap::models::polygons::{
    PolygonPair, convex_witness, inverted_star, nested_squares, square_corner, star, twisted_star,
};
use barymap::progress::Quiet;
use glam::DVec2;
use support::{Result, best};

/// The pair's polygon at time `t` of the linear path.
fn at(pair: &PolygonPair, t: f64) -> Polygon {
    let mut targets = pair.target.vertices();
    let mut moved = |v: &DVec2| targets.next().map_or(*v, |w| *v + (w - *v) * t);
    Polygon::from_loops(pair.source.loops().iter().map(|l| l.iter().map(&mut moved).collect()).collect())
}

/// A jagged loop of `n` vertices that moves a little.
fn jagged(n: usize) -> PolygonPair {
    let radii = |motion: f64| {
        let radius = |i: usize| 0.6 + 0.4 * (i * 7919 % 101) as f64 / 101.0 + motion * (i as f64).sin() / n as f64;
        (0..n).map(radius).collect::<Vec<_>>()
    };
    let polygon = |motion: f64| Polygon::from_loops(vec![star(n, &radii(motion), 0.0, DVec2::ZERO)]);
    PolygonPair { source: polygon(0.0), target: polygon(0.2) }
}

fn row(engine: &Engine, name: &str, knots: [f64; 2], from: &Polygon, to: &Polygon) -> Result<()> {
    let options = CertifyOptions::default();
    let found = certificate(from, to, &options, &Quiet)?;
    let proof = best(2, || {
        certificate(from, to, &options, &Quiet)?;
        Ok(())
    })?;
    let pair = [(from.clone(), to.clone())];
    let samples = SampleOptions { resolution: 1024 };
    let sampled = jacobian_min(engine, Coordinates::MeanValue, &pair, &samples)?[0].value;
    let sampling = best(2, || {
        jacobian_min(engine, Coordinates::MeanValue, &pair, &samples)?;
        Ok(())
    })?;
    let (word, bound) = match found.verdict {
        Verdict::Certified { lower_bound } => ("certified", lower_bound),
        Verdict::Undecided { bound, .. } => ("undecided", bound),
        Verdict::Folds { value, .. } => ("folds", value),
    };
    println!(
        "| {name} | {} | {} .. {} | {word} | {bound:.4} | {:.4} | {sampled:.4} | {} | {:.1} | {:.0} | {:.1} |",
        from.vertex_count(),
        knots[0],
        knots[1],
        found.sampled,
        found.boxes,
        proof.cpu / 2.0 * 1e3,
        proof.cpu / 2.0 / (found.boxes as f64 * from.vertex_count() as f64) * 1e9,
        sampling.cpu / 2.0 * 1e3,
    );
    Ok(())
}

fn main() -> Result<()> {
    let engine = Engine::cpu();
    println!(
        "| step | vertices | from .. to | verdict | bound | at most | sampled | boxes | ms | ns per box and vertex | raster ms |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    let whole: &[f64] = &[0.0, 1.0];
    let halves: &[f64] = &[0.0, 0.5, 0.75, 0.875, 1.0];
    let cases: [(&str, PolygonPair, &[f64]); 9] = [
        ("nested squares", nested_squares(), &[0.0, 0.25, 0.5, 0.75, 0.875, 1.0]),
        ("square corner", square_corner(0.8), &[0.0, 0.5, 0.75, 0.875, 0.9375, 1.0]),
        ("inverted star", inverted_star(), halves),
        ("twisted star", twisted_star(), halves),
        ("convex witness", convex_witness(), &[0.0, 0.5, 1.0]),
        ("convex witness", convex_witness(), whole),
        ("square, s = 0.546", square_corner(0.546), whole),
        ("jagged", jagged(16), whole),
        ("jagged", jagged(64), whole),
    ];
    for (name, pair, knots) in cases {
        for ends in knots.windows(2) {
            row(&engine, name, [ends[0], ends[1]], &at(&pair, ends[0]), &at(&pair, ends[1]))?;
        }
    }
    Ok(())
}
