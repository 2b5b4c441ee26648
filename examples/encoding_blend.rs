//! Figure 10 of the encoding paper: a part of one model pasted onto another by a mask. The second
//! model stands elsewhere and turned; a blend of positions, even after they were aligned (third
//! picture), mixes the forms; the average of the encodings (fourth) joins the parts without a seam
//! and keeps both in shape.
//!
//! `cargo run --release --example encoding_blend [PICTURE.png]`

use std::error::Error;

use barymap::encoding::{HierarchyOptions, MarchQuality, Similarity};
use barymap::models::shapes::icosphere;
use barymap::tools::morph::Morpher;
use glam::{DQuat, DVec3};

mod shared;

fn main() -> Result<(), Box<dyn Error>> {
    let ball = icosphere(1.0, 4);
    // An egg with gentle facets, and a ball with a grooved spiral on it.
    let mut a = ball.clone();
    for p in &mut a.positions {
        let facets = p.x.abs().powi(8) + p.y.abs().powi(8) + p.z.abs().powi(8);
        *p = *p / facets.powf(1.0 / 8.0) * DVec3::new(1.0, 1.25, 1.0);
    }
    let mut b = ball.clone();
    for p in &mut b.positions {
        let angle = p.z.atan2(p.x);
        *p *= 1.0 + 0.06 * (15.0 * p.y + 2.0 * angle).sin() * (1.0 - p.y * p.y).max(0.0);
    }
    let mut placed = b.clone();
    for p in &mut placed.positions {
        *p = DQuat::from_rotation_z(1.2) * *p + DVec3::new(3.0, 1.0, 0.0);
    }
    // The second model where the ball's front is.
    let share = |p: &DVec3| {
        let s = ((p.z - 0.15) / 0.35).clamp(0.0, 1.0);
        s * s * (3.0 - 2.0 * s)
    };
    let mask: Vec<f64> = ball.positions.iter().flat_map(|p| [1.0 - share(p), share(p)]).collect();
    let anchors: Vec<u32> =
        (0..ball.vertex_count() as u32).filter(|&v| ball.positions[v as usize].z < -0.9).step_by(9).collect();
    let mut morpher = Morpher::new(&[&a, &placed], Some(&anchors), &HierarchyOptions::default())?;
    let (blended, report) = morpher.masked(&mask, &MarchQuality::DEFAULT)?;
    println!(
        "{} vertices, {} anchors, {} iterations in the last step",
        a.vertex_count(),
        anchors.len(),
        report.iterations()
    );
    // What a blend of positions makes even after the models were aligned at the anchors.
    let pairs: Vec<(DVec3, DVec3)> =
        anchors.iter().map(|&v| (placed.positions[v as usize], a.positions[v as usize])).collect();
    let fit = Similarity::fit(&pairs);
    let linear: Vec<DVec3> = (0..a.vertex_count())
        .map(|v| a.positions[v].lerp(fit.apply(placed.positions[v]), share(&ball.positions[v])))
        .collect();
    let shapes = [a.positions.clone(), b.positions, linear, blended];
    shared::picture(&a, &shapes, 4, [400, 420], (30.0, 20.0), &shared::output("encoding_blend.png"))
}
