//! Mean-value encoding: hierarchy, splits and decodes of the bumpy tube, on the CPU and on a
//! device.
//!
//! `cargo bench --bench encoding`. Seconds are the least of several runs where the row says so; CPU
//! time is that of all threads, the driver's included. Baselines named in the issue: libigl's ten
//! iterations take 0.96 to 1.4 s a frame at 52k vertices.

#[path = "../tests/common/tube.rs"]
mod tube;

mod support;

use barymap::encoding::decode::split_level;
use barymap::encoding::{Connectivity, Decoder, Hierarchy, HierarchyOptions, Quality, Similarity, V3};
use barymap::engine::{Backend, Engine, EngineOptions};
use barymap::io::cache::Cache;
use barymap::tools::deform::{Deformer, Handles};
use glam::DVec3;
use support::{Result, Spent, best, once};
use tube::{Pose, Tube};

fn show(what: &str, spent: Spent) {
    println!("| {what} | {:.4} | {:.4} |", spent.wall, spent.cpu / 2.0);
}

/// Rings, hierarchy and coefficients.
fn hierarchy(name: &str, tube: &Tube) -> Result<(Hierarchy, Vec<V3<f64>>)> {
    let rest: Vec<V3<f64>> = tube.mesh.positions.iter().map(|p| p.to_array()).collect();
    let mut held = tube.points();
    held.sort_unstable();
    let build = || Hierarchy::new(&Connectivity::new(&tube.mesh), &rest, &held, &HierarchyOptions::default());
    let spent = best(2, || Ok(build().map(|_| ())?))?;
    show(&format!("{name}: rings, hierarchy, coefficients (2 runs)"), spent);
    Ok((build()?, rest))
}

/// Decoding by splits alone.
fn splits(name: &str, tube: &Tube, h: &Hierarchy, rest: &[V3<f64>], device: Option<&Engine>) -> Result<()> {
    let single = h.split_encoding.to_precision::<f32>();
    let mut x: Vec<V3<f32>> = h.order.iter().map(|&v| rest[v as usize].map(|x| x as f32)).collect();
    let kernels = best(20, || {
        h.level_start.windows(2).for_each(|l| split_level(&h.splits, &single, l[0] as usize..l[1] as usize, &mut x));
        Ok(())
    })?;
    let levels = h.level_start.len() - 1;
    show(&format!("{name}: {} splits in {levels} levels, f32 on the CPU (20 runs)", x.len() - h.base), kernels);
    let handles = tube.points();
    let moved = tube.targets(&handles, Pose::Twist(90.0));
    let pairs: Vec<(DVec3, DVec3)> =
        handles.iter().zip(&moved).map(|(&v, &q)| (tube.mesh.positions[v as usize], q)).collect();
    let fit = Similarity::fit(&pairs);
    let place = |v: &u32| handles.iter().position(|h| h == v).map_or(rest[*v as usize], |k| moved[k].to_array());
    let held: Vec<V3<f64>> = h.order[..h.held].iter().map(place).collect();
    let mut decoder = Decoder::new(h.clone(), rest);
    let run = |decoder: &mut Decoder| {
        let start = |_: usize, p: V3<f64>| fit.apply(DVec3::from(p)).to_array();
        decoder.decode(&held, start, fit.scale, &Quality::SPLITS, false).map(|_| ())
    };
    let on_cpu = best(20, || Ok(run(&mut decoder)?))?;
    show(&format!("{name}: whole decode, splits only, f64 on the CPU (20 runs)"), on_cpu);
    if let Some(engine) = device {
        decoder.decode_on(engine);
        let on_device = best(20, || Ok(run(&mut decoder)?))?;
        show(
            &format!("{name}: whole decode, splits only, on the device with upload and readback (20 runs)"),
            on_device,
        );
    }
    Ok(())
}

/// Decodes with minimisation.
fn decodes(name: &str, tube: &Tube, engine: &Engine, qualities: &[(&str, Quality)]) -> Result<()> {
    let handles = tube.points();
    let wanted = Handles { vertices: handles.clone(), region: None };
    for (label, quality) in qualities {
        let mut deformer = Deformer::new(&tube.mesh, wanted.clone(), &HierarchyOptions::default(), &Cache::disabled())?;
        deformer.decode_on(engine);
        let on = &engine.description().backend;
        let mut frame = |what: &str, degrees: f64, warm: bool| -> Result<()> {
            let (found, spent) = once(|| deformer.deform(&tube.targets(&handles, Pose::Twist(degrees)), quality, warm));
            let found = found?;
            show(&format!("{name}: {label} on {on}, {what}"), spent);
            let m = deformer.measures(&found.positions);
            println!("G {:.3e}, edges {:.4} rms {:.3} most, volume {:.3}", m.g, m.edge_rms, m.edge_max, m.volume_ratio);
            for l in &found.report.levels {
                let at = if l.on_device { ", device" } else { "" };
                println!(
                    "  {} free: {} iterations, {} steps, G {:.2e} to {:.2e}, {:.3} s{at}",
                    l.free, l.iterations, l.gradient_steps, l.before, l.after, l.seconds
                );
            }
            Ok(())
        };
        frame("first frame, factorisation's pattern and shaders included", 90.0, false)?;
        frame("the same from the start again", 90.0, false)?;
        frame("warm frame, 2 degrees on", 92.0, true)?;
    }
    Ok(())
}

fn main() -> Result<()> {
    let device = Engine::new(EngineOptions { backend: Backend::Gpu, ..EngineOptions::default() });
    match &device {
        Ok(engine) => println!("{}", engine.description()),
        Err(e) => println!("no device: {e}"),
    }
    let device = device.ok();
    println!("{} threads, twist of 90 degrees, 8 handles", rayon::current_num_threads());
    println!("| what | wall s | CPU s / 2 |\n|---|---|---|");
    for (name, tube) in [("10k", Tube::medium()), ("50k", Tube::large())] {
        let (h, rest) = hierarchy(name, &tube)?;
        splits(name, &tube, &h, &rest, device.as_ref())?;
        decodes(name, &tube, &Engine::cpu(), &[("preview", Quality::PREVIEW), ("default", Quality::DEFAULT)])?;
        if let Some(engine) = &device {
            decodes(name, &tube, engine, &[("default", Quality::DEFAULT)])?;
        }
    }
    Ok(())
}
