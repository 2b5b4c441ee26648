//! Splines and quad remeshing on surfaces: points and frames per second.
//!
//! `cargo bench --bench spline [-- MESH.obj]`. Without a mesh, a torus of 40,000 faces; the
//! embedding is not timed. Best of several rounds, wall time and process CPU time. The baseline of
//! the splines is the same averages searched from the nearest vertex each ([`WeightedPoints`]),
//! that of the frames the same averages one by one.

mod support;

use barymap::geometry::{Corner, Mesh, MeshBuilder, NONE, SurfacePoint, Topology};
use barymap::models::shapes::{Diagonal, torus};
use barymap::progress::Quiet;
use barymap::surface::correspondence::Shape;
use barymap::surface::single::WeightedPoints;
use barymap::surface::{Embedding, EmbeddingOptions};
use barymap::tools::remesh::{Evenness, RemeshOptions, Remesher};
use barymap::tools::spline::{Evaluation, SplineOptions, SplineSurface};
use support::{Result, best};

const POINTS: usize = 100_000;
const ROUNDS: usize = 5;

/// The same torus in 24 by 16 quads.
fn ring() -> Mesh {
    let coarse = torus(1.0, 0.4, 24, 16, Diagonal::Forward);
    let mut builder = MeshBuilder::new("ring");
    builder.mesh.positions = coarse.positions;
    for (i, j) in (0..16u32).flat_map(|j| (0..24u32).map(move |i| (i, j))) {
        let v = |i: u32, j: u32| Corner { vertex: (j % 16) * 24 + i % 24, texcoord: NONE, normal: NONE };
        builder.polygon([v(i, j), v(i + 1, j), v(i + 1, j + 1), v(i, j + 1)]);
    }
    builder.build().unwrap()
}

fn main() -> Result<()> {
    // Cargo passes --bench.
    let named = std::env::args().skip(1).find(|a| !a.starts_with("--"));
    let mesh = match &named {
        Some(path) => barymap::io::read_mesh(path)?.mesh,
        None => torus(1.0, 0.4, 200, 100, Diagonal::Alternating),
    };
    let topology = Topology::new(&mesh);
    let embedding = Embedding::compute(&mesh, &topology, &EmbeddingOptions::default(), &Quiet)?;
    let shape = Shape { mesh: &mesh, topology: &topology, embedding: Some(&embedding) };
    println!("{}: {} faces, {} threads", mesh.name, mesh.triangle_count(), rayon::current_num_threads());

    let splines = SplineSurface::new(shape)?;
    // Landmarks, each the nearest of those not yet taken to the one before: neighbours are a few
    // edges apart.
    let mut rest = embedding.landmarks.clone();
    let mut order = vec![rest.swap_remove(0)];
    while order.len() < 24 {
        let at = mesh.positions[order[order.len() - 1] as usize];
        let far = |v: u32| mesh.positions[v as usize].distance(at);
        rest.retain(|&v| far(v) > 0.0);
        let k = (0..rest.len()).min_by(|&a, &b| far(rest[a]).total_cmp(&far(rest[b]))).ok_or("too few landmarks")?;
        order.push(rest.swap_remove(k));
    }
    let controls: Vec<SurfacePoint> = order.iter().filter_map(|&v| topology.vertex_point(v)).collect();
    let parameters: Vec<f64> = (0..POINTS).map(|i| i as f64 / (POINTS - 1) as f64).collect();
    for (name, evaluation) in [("direct", Evaluation::Direct), ("subdivision", Evaluation::Subdivision)] {
        let options = SplineOptions { closed: true, evaluation, ..SplineOptions::default() };
        let spent = best(ROUNDS, || {
            splines.points(&controls, &options, &parameters)?;
            Ok(())
        })?;
        println!(
            "spline, {name}: {POINTS} points in {:.3} s ({:.3} s CPU), {:.2e} points/s",
            spent.wall,
            spent.cpu,
            POINTS as f64 / spent.wall
        );
        let dense = SplineOptions { samples: POINTS, ..options };
        let spent = best(ROUNDS, || {
            splines.trace(&controls, &dense)?;
            Ok(())
        })?;
        println!(
            "spline, {name}: polyline of {POINTS} segments cut at edges in {:.3} s ({:.3} s CPU)",
            spent.wall, spent.cpu
        );
    }
    let single = WeightedPoints::new(shape, &controls)?;
    let rows: Vec<Vec<f64>> = (0..POINTS)
        .map(|i| {
            let t = i as f64 / POINTS as f64 * controls.len() as f64;
            let (k, w) = (t as usize, t.fract());
            let mut row = vec![0.0; controls.len()];
            row[k % controls.len()] = 1.0 - w;
            row[(k + 1) % controls.len()] += w;
            row
        })
        .collect();
    let spent = best(ROUNDS, || {
        single.averages(&rows)?;
        Ok(())
    })?;
    println!(
        "baseline, no warm start: {POINTS} averages of two points in {:.3} s ({:.3} s CPU)",
        spent.wall, spent.cpu
    );

    if named.is_some() {
        return Ok(());
    }
    for (smooth, evenness) in [(0, Evenness::Fixed(0.0)), (5, Evenness::Fixed(0.0)), (5, Evenness::Auto)] {
        let options = RemeshOptions { levels: 2, smooth, evenness, ..RemeshOptions::default() };
        let mut remesher = Remesher::new(shape, &ring(), &options)?;
        let vertices = remesher.frame()?.len();
        let first = remesher.base()[0];
        let mut k = 0;
        let spent = best(ROUNDS, || {
            k += 1;
            let w = 0.1 * f64::from(k % 8);
            let moved = SurfacePoint::new(first.face, [w, 0.8 - w, 0.2]);
            remesher.move_vertex(0, moved)?;
            remesher.frame()?;
            Ok(())
        })?;
        println!(
            "remesh, {vertices} vertices, {smooth} steps, {evenness:?}: {:.1} frames/s ({:.1} by CPU time of two cores)",
            1.0 / spent.wall,
            2.0 / spent.cpu
        );
        let spent = best(ROUNDS, || {
            remesher.one_by_one();
            Ok(())
        })?;
        println!("baseline, one by one: {:.1} frames/s", 1.0 / spent.wall);
    }
    Ok(())
}
