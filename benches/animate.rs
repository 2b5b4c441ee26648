//! A walking body by 40 markers: a thousand frames as a sequence, on the CPU.
//!
//! `cargo bench --bench animate`. The bar: 1,000 frames of 13,000 vertices in 20 s of CPU time / 2.
//! Beside the time, G of sampled frames over that of single frames with `Quality::DEFAULT`.

mod support;

use barymap::encoding::{HierarchyOptions, Quality, SequenceQuality};
use barymap::geometry::Geodesics;
use barymap::geometry::sampling::farthest_points;
use barymap::io::cache::Cache;
use barymap::models::Walker;
use barymap::tools::deform::{Deformer, Handles};
use glam::DVec3;
use support::{Result, once};

const FRAMES: usize = 1000;
const MARKERS: usize = 40;
/// Frames that are compared with single ones.
const SAMPLES: [usize; 6] = [15, 40, 47, 65, 333, 998];

fn main() -> Result<()> {
    let walker = Walker::new(0.0138);
    let n = walker.mesh.vertex_count();
    let markers =
        farthest_points(&Geodesics::new(&walker.mesh.positions, &walker.mesh.triangles()).unwrap(), 0, MARKERS);
    let tracks: Vec<Vec<DVec3>> = (0..FRAMES)
        .map(|f| {
            let shape = walker.positions(f as f64 / 30.0, (f as f64 / 30.0).min(1.0));
            markers.iter().map(|&v| shape[v as usize]).collect()
        })
        .collect();
    let handles = Handles { vertices: markers, region: None };
    let mut deformer = Deformer::new(&walker.mesh, handles, &HierarchyOptions::default(), &Cache::disabled())?;
    println!("{FRAMES} frames of {n} vertices by {MARKERS} markers, {} threads", rayon::current_num_threads());
    let mut single = Vec::new();
    let (done, spent) = once(|| -> Result<()> {
        for &f in &SAMPLES {
            single.push(deformer.deform(&tracks[f], &Quality::DEFAULT, true)?.positions);
        }
        Ok(())
    });
    done?;
    let values: Vec<f64> = single.iter().map(|x| deformer.measures(x).g).collect();
    println!(
        "| quality | CPU s / 2 | frames a second of wall time | G over single frames: mean, most | flipped triangles: mean |"
    );
    println!("|---|---|---|---|---|");
    let per_frame = spent.cpu / 2.0 / SAMPLES.len() as f64;
    println!(
        "| single frames | {:.0} (from {} frames) | {:.1} | 1, 1 | {:.1} |",
        per_frame * FRAMES as f64,
        SAMPLES.len(),
        SAMPLES.len() as f64 / spent.wall,
        flipped(&deformer, &single)
    );
    let coarser = SequenceQuality { tracked: 500, middle: 28, ..SequenceQuality::DEFAULT };
    for (name, quality) in
        [("preview", SequenceQuality::PREVIEW), ("default", SequenceQuality::DEFAULT), ("a coarser stage", coarser)]
    {
        let mut kept = Vec::new();
        let (done, spent) = once(|| {
            deformer.play(&tracks, 0..FRAMES, &quality, |f, frame| {
                if SAMPLES.contains(&f) {
                    kept.push(frame.positions);
                }
                Ok(())
            })
        });
        done?;
        let ratios: Vec<f64> = kept.iter().zip(&values).map(|(x, g)| deformer.measures(x).g / g).collect();
        let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
        let most = ratios.iter().copied().fold(0.0, f64::max);
        println!(
            "| {name} | {:.1} | {:.1} | {mean:.2}, {most:.2} | {:.1} |",
            spent.cpu / 2.0,
            FRAMES as f64 / spent.wall,
            flipped(&deformer, &kept)
        );
    }
    Ok(())
}

fn flipped(deformer: &Deformer, shapes: &[Vec<DVec3>]) -> f64 {
    shapes.iter().map(|x| deformer.measures(x).flipped as f64).sum::<f64>() / shapes.len() as f64
}
