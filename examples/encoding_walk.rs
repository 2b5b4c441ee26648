//! Figure 8 of the encoding paper: a body walks by 40 markers alone. Above the body the markers
//! were taken from, below what was made of the mesh at rest and the tracks of the 40 vertices.
//!
//! `cargo run --release --example encoding_walk [PICTURE.png]`

use std::error::Error;

use barymap::encoding::{HierarchyOptions, SequenceQuality};
use barymap::geometry::Geodesics;
use barymap::geometry::sampling::farthest_points;
use barymap::io::Cache;
use barymap::models::Walker;
use barymap::tools::deform::{Deformer, Handles};
use glam::DVec3;

mod shared;

fn main() -> Result<(), Box<dyn Error>> {
    let walker = Walker::new(0.022);
    let markers = farthest_points(&Geodesics::new(&walker.mesh.positions, &walker.mesh.triangles())?, 0, 40);
    let truth: Vec<Vec<DVec3>> =
        (0..60).map(|f| walker.positions(f64::from(f) / 30.0, (f64::from(f) / 20.0).min(1.0))).collect();
    let tracks: Vec<Vec<DVec3>> =
        truth.iter().map(|shape| markers.iter().map(|&v| shape[v as usize]).collect()).collect();
    let handles = Handles { vertices: markers, region: None };
    let deformer = Deformer::new(&walker.mesh, handles, &HierarchyOptions::default(), &Cache::disabled())?;
    let clock = std::time::Instant::now();
    let mut made = Vec::new();
    deformer.play(
        &tracks,
        0..tracks.len(),
        &SequenceQuality { stiffness: 1.0, ..SequenceQuality::DEFAULT },
        |_, frame| {
            made.push(frame.positions);
            Ok(())
        },
    )?;
    let seconds = clock.elapsed().as_secs_f64();
    println!("{} frames of {} vertices in {seconds:.1} s", made.len(), walker.mesh.vertex_count());
    let wanted = [0, 12, 24, 32, 40, 48, 56];
    let mut shapes: Vec<Vec<DVec3>> = wanted.iter().map(|&f| truth[f].clone()).collect();
    shapes.extend(wanted.iter().map(|&f| made[f].clone()));
    shared::picture(&walker.mesh, &shapes, 7, [260, 400], (60.0, 8.0), &shared::output("encoding_walk.png"))
}
