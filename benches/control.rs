//! How soon long work ends after it was cancelled: `cargo bench --bench control`.
//!
//! Each job runs once to its end and is then cancelled by another thread at nine moments spread
//! over that time; the table has the longest wait between the call and the error.

use std::time::{Duration, Instant};

use barymap::control::Control;
use barymap::engine::{Backend, Engine, EngineOptions};
use barymap::geometry::sampling::farthest_points;
use barymap::geometry::{Geodesics, Topology};
use barymap::mapping::plane::{Cage, CertifyOptions, PartitionOptions, certify, partition};
use barymap::models::character_pair;
use barymap::models::shapes::uv_sphere;
use barymap::picture::{Depth, Image};
use barymap::progress::Quiet;
use barymap::surface::anchors::vertex_point;
use barymap::surface::correspondence::{CorrespondenceOptions, Shape};
use barymap::surface::gpu::correspondence_on;
use barymap::surface::{AnchorPairs, Embedding, EmbeddingOptions};
use barymap::tools::anchors::{AnchorOptions, propose};
use barymap::tools::transfer::{Fill, Layer, TransferOptions, transfer_on};
use barymap::{Error, Result};
use glam::DVec2;

/// Moments at which a job is cancelled.
const MOMENTS: u32 = 9;

fn main() -> Result<()> {
    println!("| job | s | longest wait, s |");
    println!("|---|---|---|");
    let pair = character_pair();
    let (source, target) = (&pair.source.mesh, &pair.target.mesh);
    let around = [source, target].map(Topology::new);
    let options = EmbeddingOptions::default();
    row("embedding, 12,000 faces", || Embedding::compute(source, &around[0], &options, &Quiet).map(drop))?;
    let fine = uv_sphere(1.0, 300, 250);
    let around_fine = Topology::new(&fine);
    row("embedding, 150,000 faces", || Embedding::compute(&fine, &around_fine, &options, &Quiet).map(drop))?;
    let embedded = [(source, &around[0]), (target, &around[1])]
        .map(|(mesh, topology)| Embedding::compute(mesh, topology, &options, &Quiet));
    let [in_source, in_target] = embedded;
    let (in_source, in_target) = (in_source?, in_target?);
    let shapes = [
        Shape { mesh: source, topology: &around[0], embedding: Some(&in_source) },
        Shape { mesh: target, topology: &around[1], embedding: Some(&in_target) },
    ];
    let (on_source, on_target) = pair.anchors(93);
    let anchors = AnchorPairs { source: on_source, target: on_target };
    let mut engines = vec![("CPU", Engine::cpu())];
    if let Ok(engine) = Engine::new(EngineOptions { backend: Backend::Gpu, ..EngineOptions::default() }) {
        engines.push(("device", engine));
    }
    let picture = Image::zeros(2048, 2048, 3, Depth::U8)?;
    let layers = [Layer::single("colour", &picture)];
    for (name, engine) in &engines {
        let field = CorrespondenceOptions::default();
        let map = || correspondence_on(engine, shapes[0], shapes[1], &anchors, &field);
        row(&format!("field, {name}"), || map().map(drop))?;
        let (map, _) = map()?;
        let size = TransferOptions { width: 4096, height: 4096, fill: Fill::Smooth, ..TransferOptions::default() };
        row(&format!("transfer at 4096, {name}"), || {
            transfer_on(engine, source, &layers, target, map.as_ref(), &size, &Quiet).map(drop)
        })?;
    }
    let seeds = farthest_points(&Geodesics::new(&source.positions, &source.triangles())?, 0, 5);
    let point = |v: &u32| vertex_point(source, &around[0], *v, "anchor");
    let seeds: Vec<_> = seeds.iter().map(point).collect::<Result<_>>()?;
    let seeds = AnchorPairs { source: seeds.clone(), target: seeds };
    let shape = shapes[0];
    let propose_options = AnchorOptions { connectivity: false, ..AnchorOptions::default() };
    row("proposed anchors", || propose(shape, shape, &seeds, &propose_options, &Quiet).map(drop))?;
    let star = |turn: f64| -> Vec<Vec<DVec2>> {
        let at = |k: usize| {
            let (r, turn) = if k.is_multiple_of(2) { (0.48, turn) } else { (0.3, 0.0) };
            DVec2::splat(500.0) + 1000.0 * r * DVec2::from_angle(std::f64::consts::TAU * k as f64 / 400.0 + turn)
        };
        vec![(0..400).map(at).collect()]
    };
    let cage = Cage::new(star(0.0), star(0.005))?;
    let cpu = Engine::cpu();
    let steps = PartitionOptions::default();
    row("partition, 400 vertices", || partition(&cpu, &cage, &steps, &Quiet).map(drop))?;
    let found = partition(&cpu, &cage, &steps, &Quiet)?;
    let few = CertifyOptions { boxes: 20_000, ..CertifyOptions::default() };
    row("certificate, 400 vertices", || certify(&found.polygons[0], &found.polygons[1], &few, &Quiet).map(drop))
}

/// Runs a job, cancels it, prints.
fn row(name: &str, job: impl Fn() -> Result<()>) -> Result<()> {
    let begun = Instant::now();
    job()?;
    let whole = begun.elapsed();
    let mut longest = Duration::ZERO;
    for moment in 0..MOMENTS {
        let control = Control::new();
        let after = whole * (2 * moment + 1) / (2 * MOMENTS);
        let (result, wait) = std::thread::scope(|scope| {
            let canceller = scope.spawn(|| {
                std::thread::sleep(after);
                control.cancel();
                Instant::now()
            });
            let result = control.run(&job);
            let ended = Instant::now();
            let cancelled = canceller.join().unwrap_or(ended);
            (result, ended.saturating_duration_since(cancelled))
        });
        match result {
            Err(Error::Cancelled) => longest = longest.max(wait),
            // Faster than before: it had ended.
            Ok(()) => {}
            Err(e) => return Err(e),
        }
    }
    println!("| {name} | {:.2} | {:.3} |", whole.as_secs_f64(), longest.as_secs_f64());
    Ok(())
}
