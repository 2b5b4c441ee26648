//! Texture transfer between the built-in characters: the kernels of its stages beside their
//! references, and the whole at three sizes, by stage, on the CPU and on a device.
//!
//! `cargo bench --bench transfer`. Seconds of wall time, and of CPU time / 2; 93 anchors, method
//! `transport` with confidence. Compilation is timed with the driver's shader cache off.

mod support;

use barymap::engine::{Backend, Engine, EngineOptions, Gpu};
use barymap::geometry::Mesh;
use barymap::models::character_pair;
use barymap::picture::Image;
use barymap::progress::Quiet;
use barymap::surface::correspondence::{CorrespondenceOptions, WeightedAverages};
use barymap::surface::gpu::DeviceMap;
use barymap::surface::{AnchorPairs, PackedImage, PackedPoint, PointMap};
use barymap::tools::transfer::atlas::{AtlasTexel, Tile, rasterize_atlas};
use barymap::tools::transfer::bins::{Atlas, Bins};
use barymap::tools::transfer::footprint::Footprint;
use barymap::tools::transfer::gpu::{Padder, Rasterizer, Sampler};
use barymap::tools::transfer::mip::MipChain;
use barymap::tools::transfer::pad::pad_seams;
use barymap::tools::transfer::sample::{SampleParams, sample_texture};
use barymap::tools::transfer::{Encoding, Filter, Layer, StageTime, TransferOptions, UvRegion, transfer_on};
use support::{Result, Spent, Surface, best, once};

/// Side of the texture that the kernels are timed on.
const SIDE: u32 = 2048;

/// The kernels beside their references, on whole textures; a device's times include bringing data
/// there and back.
fn kernels(gpu: &Gpu, target: &Mesh, texture: &Image) -> Result<()> {
    println!(
        "| stage | first dispatch, wall ms | CPU ms | reference, CPU / 2, ns per texel | device, CPU / 2, ns per texel | device / reference |"
    );
    println!("|---|---|---|---|---|---|");
    let row = |name: &str, texels: usize, first: Spent, reference: Spent, device: Spent| {
        let (a, b) = (reference.per_item(texels), device.per_item(texels));
        println!("| {name} | {:.0} | {:.0} | {a:.1} | {b:.1} | {:.2} |", 1e3 * first.wall, 1e3 * first.cpu, b / a);
    };
    let tile = Tile { x: 0, y: 0, width: SIDE, height: SIDE };
    let small = Tile { x: 0, y: 0, width: 8, height: 8 };
    let most = 1 << 24;
    let atlas = Atlas::new(target, SIDE, SIDE, UvRegion::Repeat, None, most)?;
    let bins = Bins::new(&tile, &atlas, most)?;
    let mut texels = vec![AtlasTexel::EMPTY; tile.texels()];
    let mut rasterizer = Rasterizer::new(gpu, &atlas.triangles, SIDE as usize)?;
    let few = Bins::new(&small, &atlas, most)?;
    let (done, first) = once(|| rasterizer.rasterize(&small, &few, &atlas.triangles, &mut texels));
    done?;
    let reference = best(5, || {
        rasterize_atlas(&tile, &bins, &atlas.triangles, &mut texels);
        Ok(())
    })?;
    let device = best(5, || Ok(rasterizer.rasterize(&tile, &bins, &atlas.triangles, &mut texels)?))?;
    row("rasterize_atlas", texels.len(), first, reference, device);

    // A turned and curved look at the picture, two to three of its texels to one.
    let footprints: Vec<Footprint> = texels
        .iter()
        .enumerate()
        .filter(|(_, t)| t.is_covered())
        .map(|(i, _)| {
            let (x, y) = ((i as u32 % SIDE) as f32 / SIDE as f32, (i as u32 / SIDE) as f32 / SIDE as f32);
            let step = 1.0 / SIDE as f32;
            Footprint {
                centre: [2.0 * x + y * y, 2.5 * y],
                dx: [2.0 * step, 0.0],
                dy: [2.0 * y * step, 2.5 * step],
                face: 0,
            }
        })
        .collect();
    let mut colors = vec![0.0; 4 * footprints.len()];
    let chain = MipChain::new(texture, Encoding::default())?;
    for (name, shrink) in [("sample_texture, 2 to 3 texels to one", 1.0), ("sample_texture, one to one", 0.4)] {
        let params = SampleParams { filter: Filter::Anisotropic, taps: 16, channels: 4, texture: 0 };
        let scaled = |v: [f32; 2]| v.map(|c| c * shrink);
        let places: Vec<Footprint> =
            footprints.iter().map(|f| Footprint { dx: scaled(f.dx), dy: scaled(f.dy), ..*f }).collect();
        let mut sampler = Sampler::new(gpu)?;
        let on_device = sampler.texture(&chain, params.filter, params.taps)?;
        let (done, first) =
            once(|| sampler.sample(&on_device, &chain, &params, &[0], &places[..64], &mut colors[..256]));
        done?;
        let reference = best(5, || {
            sample_texture(&chain, &params, &[0], &places, &mut colors);
            Ok(())
        })?;
        let device = best(5, || Ok(sampler.sample(&on_device, &chain, &params, &[0], &places, &mut colors)?))?;
        row(name, places.len(), first, reference, device);
    }

    let coverage: Vec<u8> = texels.iter().map(|t| if t.is_covered() { 255 } else { 0 }).collect();
    let (side, mut nearest) = (SIDE as usize, Vec::new());
    let (done, first) = once(|| Padder::new(gpu, &[0; 64], 8, 16)?.nearest(0..8, &mut nearest));
    done?;
    let reference = best(5, || {
        pad_seams(&coverage, side, 0..side, 16, &mut nearest);
        Ok(())
    })?;
    let device = best(5, || Ok(Padder::new(gpu, &coverage, side, 16)?.nearest(0..side, &mut nearest)?))?;
    row("pad_seams and pad_columns", coverage.len(), first, reference, device);
    Ok(())
}

fn main() -> Result<()> {
    support::without_shader_cache()?;
    let pair = character_pair();
    let texture = pair.source.texture(2048);
    let (source_points, target_points) = pair.anchors(93);
    let anchors = AnchorPairs { source: source_points, target: target_points };
    let (source, target) = (Surface::new(pair.source.mesh.clone())?, Surface::new(pair.target.mesh.clone())?);
    let options = CorrespondenceOptions::default();
    let prepare = || WeightedAverages::<f32, 8>::new(source.shape(), target.shape(), &anchors, &options);
    let (cpu, prepared) = once(prepare);
    let mut engines: Vec<(Engine, Box<dyn PointMap>)> = vec![(Engine::cpu(), Box::new(cpu?))];
    match Engine::new(EngineOptions { backend: Backend::Gpu, ..EngineOptions::default() }) {
        Ok(engine) => {
            println!("device: {}; {SIDE} x {SIDE} texels, shader cache off", engine.description());
            if let Some(gpu) = engine.gpu() {
                kernels(gpu, &target.mesh, &texture)?;
            }
            let map = DeviceMap::<WeightedAverages<f32, 8>>::new(&engine, prepare()?)?;
            engines.push((engine, Box::new(map)));
        }
        Err(e) => println!("no device: {e}"),
    }
    println!(
        "source {} faces, target {} faces; preparing the map once: {:.2} s, {:.2} s CPU / 2",
        source.mesh.triangle_count(),
        target.mesh.triangle_count(),
        prepared.wall,
        prepared.cpu / 2.0
    );
    let mut on_cpu: Vec<(u32, Vec<StageTime>)> = Vec::new();
    for (engine, map) in &engines {
        // Kernels are compiled by the first points.
        let start = PackedPoint { face: 0, b0: 0.3, b1: 0.3 };
        map.map(&vec![start; 8192], &mut Vec::<PackedImage>::new())?;
        println!("on {}", engine.description());
        for size in [512, 2048, 4096] {
            let options = TransferOptions { width: size, height: size, ..TransferOptions::default() };
            let layers = [Layer::single("color", &texture)];
            let (result, spent) =
                once(|| transfer_on(engine, &source.mesh, &layers, &target.mesh, map.as_ref(), &options, &Quiet));
            let stats = result?.stats;
            println!(
                "  {size}: {} texels covered, {:.2} s wall, {:.2} s CPU / 2, {} MiB planned",
                stats.covered,
                spent.wall,
                spent.cpu / 2.0,
                stats.memory >> 20
            );
            let half = |s: &StageTime| s.cpu_seconds.unwrap_or(0.0) / 2.0;
            let stages: Vec<String> =
                stats.stages.iter().map(|s| format!("{} {:.2} ({:.2})", s.name, s.seconds, half(s))).collect();
            println!("    wall (CPU / 2): {}", stages.join(", "));
            if let Some((_, reference)) = on_cpu.iter().find(|(s, _)| *s == size) {
                let ratios: Vec<String> = stats
                    .stages
                    .iter()
                    .filter(|s| stats.device_stages.contains(&s.name))
                    .filter_map(|s| Some((s, reference.iter().find(|r| r.name == s.name)?)))
                    .map(|(s, r)| format!("{} {:.1}", s.name, half(s) / half(r).max(1e-3)))
                    .collect();
                println!("    CPU time / the CPU's: {}", ratios.join(", "));
            } else {
                on_cpu.push((size, stats.stages));
            }
        }
    }
    Ok(())
}
