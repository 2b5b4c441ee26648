//! Mean-value encoding: hierarchy, splits and decodes of the bumpy tube, on the CPU.
//!
//! `cargo bench --bench encoding`. Baselines named in the issue: libigl's ten iterations 0.96-1.4 s a frame at 52k vertices.

#[path = "../tests/common/tube.rs"]
mod tube;

mod support;

use barymap::encoding::decode::split_level;
use barymap::encoding::{Connectivity, Hierarchy, HierarchyOptions, Quality, V3};
use barymap::io::cache::Cache;
use barymap::tools::deform::{Deformer, Handles};
use support::{Result, Spent, best, once};
use tube::{Pose, Tube};

fn show(spent: Spent) -> String {
    format!("{:.4} | {:.4}", spent.wall, spent.cpu / 2.0)
}

fn row(name: &str, tube: &Tube) -> Result<()> {
    let handles = tube.points();
    let rest: Vec<V3<f64>> = tube.mesh.positions.iter().map(|p| p.to_array()).collect();
    let (made, build) = once(|| {
        let connectivity = Connectivity::new(&tube.mesh);
        let mut held = handles.clone();
        held.sort_unstable();
        Hierarchy::new(&connectivity, &rest, &held, &HierarchyOptions::default())
    });
    let h = made?;
    println!("| {name}: rings, hierarchy, encoding (seconds, CPU / 2) | {} |", show(build));
    let single = h.split_encoding.to_precision::<f32>();
    let mut x: Vec<V3<f32>> = h.order.iter().map(|&v| rest[v as usize].map(|x| x as f32)).collect();
    let splits = best(20, || {
        h.level_start.windows(2).for_each(|l| split_level(&h.splits, &single, l[0] as usize..l[1] as usize, &mut x));
        Ok(())
    })?;
    println!("| {name}: {} splits in {} levels, f32 | {} |", x.len() - h.base, h.level_start.len() - 1, show(splits));
    let wanted = Handles { vertices: handles.clone(), region: None };
    let mut deformer = Deformer::new(&tube.mesh, wanted, &HierarchyOptions::default(), &Cache::disabled())?;
    for (label, quality) in [("preview", Quality::PREVIEW), ("default", Quality::DEFAULT)] {
        let mut frame = |degrees: f64, warm: bool| {
            once(|| deformer.deform(&tube.targets(&handles, Pose::Twist(degrees)), &quality, warm))
        };
        let (first, cold) = frame(90.0, false);
        first?;
        let (again, repeated) = frame(90.0, false);
        again?;
        let (next, warm) = frame(92.0, true);
        let next = next?;
        println!("| {name}: {label}, first | {} |", show(cold));
        println!("| {name}: {label}, factorisation's pattern at hand | {} |", show(repeated));
        println!("| {name}: {label}, warm frame | {} |", show(warm));
        let m = deformer.measures(&next.positions);
        println!("G {:.2e}, edges {:.4} rms {:.3} most, volume {:.3}", m.g, m.edge_rms, m.edge_max, m.volume_ratio);
    }
    Ok(())
}

fn main() -> Result<()> {
    println!("{} threads, twist of 90 degrees, 8 handles", rayon::current_num_threads());
    println!("| what | wall s | CPU s / 2 |\n|---|---|---|");
    row("10k", &Tube::medium())?;
    row("50k", &Tube::large())
}
