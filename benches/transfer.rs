//! A whole transfer between the built-in characters at three sizes, by stage, with the map on the CPU and on a device.
//!
//! `cargo bench --bench transfer`. Seconds of wall time, and of CPU time / 2; 93 anchors, method `transport` with confidence.

mod support;

use barymap::engine::{Backend, Engine, EngineOptions};
use barymap::models::character_pair;
use barymap::progress::Quiet;
use barymap::raster::{Image, Pixels};
use barymap::surface::correspondence::{CorrespondenceOptions, WeightedAverages};
use barymap::surface::gpu::DeviceMap;
use barymap::surface::{AnchorPairs, PackedImage, PackedPoint, PointMap};
use barymap::tools::transfer::{Layer, TransferOptions, transfer};
use support::{Result, Surface, once};

fn main() -> Result<()> {
    let pair = character_pair();
    let texture = pair.source.texture(2048);
    let texture = Image::new(texture.width(), texture.height(), 4, Pixels::U8(texture.into_raw()))?;
    let (source_points, target_points) = pair.anchors(93);
    let anchors = AnchorPairs { source: source_points, target: target_points };
    let (source, target) = (Surface::new(pair.source.mesh.clone())?, Surface::new(pair.target.mesh.clone())?);
    let options = CorrespondenceOptions::default();
    let prepare = || WeightedAverages::<f32, 8>::new(source.shape(), target.shape(), &anchors, &options);
    let (cpu, prepared) = once(prepare);
    let mut maps: Vec<(String, Box<dyn PointMap>)> = vec![(Engine::cpu().description().to_string(), Box::new(cpu?))];
    match Engine::new(EngineOptions { backend: Backend::Gpu, ..EngineOptions::default() }) {
        Ok(engine) => maps.push((engine.description().to_string(), Box::new(DeviceMap::new(&engine, prepare()?)?))),
        Err(e) => println!("no device: {e}"),
    }
    println!(
        "source {} faces, target {} faces; preparing the map once: {:.2} s, {:.2} s CPU / 2",
        source.mesh.triangle_count(),
        target.mesh.triangle_count(),
        prepared.wall,
        prepared.cpu / 2.0
    );
    for (name, map) in &maps {
        // Kernels are compiled by the first points.
        let start = PackedPoint { face: 0, b0: 0.3, b1: 0.3 };
        map.map(&vec![start; 8192], &mut Vec::<PackedImage>::new())?;
        println!("map on {name}");
        for size in [512, 2048, 4096] {
            let options = TransferOptions { width: size, height: size, ..TransferOptions::default() };
            let layers = [Layer::single("color", &texture)];
            let (result, spent) =
                once(|| transfer(&source.mesh, &layers, &target.mesh, map.as_ref(), &options, &Quiet));
            let stats = result?.stats;
            println!(
                "  {size}: {} texels covered, {:.2} s wall, {:.2} s CPU / 2",
                stats.covered,
                spent.wall,
                spent.cpu / 2.0
            );
            let stages: Vec<String> = stats
                .stages
                .iter()
                .map(|s| format!("{} {:.2} ({:.2})", s.name, s.seconds, s.cpu_seconds.unwrap_or(0.0) / 2.0))
                .collect();
            println!("    wall (CPU / 2): {}", stages.join(", "));
        }
    }
    Ok(())
}
