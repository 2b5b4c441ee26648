//! Figure 11 of the encoding paper: a morph whose limbs turn instead of shrinking. The built-in
//! strider becomes a body of other build that stands with the arms out; above through encodings,
//! below by a blend of positions, in which the raised arm shortens on its way down.
//!
//! `cargo run --release --example encoding_morph [PICTURE.png]`

use std::error::Error;

use barymap::encoding::{HierarchyOptions, MarchQuality};
use barymap::models::strider;
use barymap::tools::morph::Morpher;
use glam::DVec3;

mod shared;

fn main() -> Result<(), Box<dyn Error>> {
    let strider = strider();
    let a = strider.mesh;
    let mut b = a.clone();
    b.positions = strider.neutral;
    let mut morpher = Morpher::new(&[&a, &b], None, &HierarchyOptions::default())?;
    let (mut morphed, mut linear) = (Vec::new(), Vec::new());
    for k in 0..6 {
        let t = f64::from(k) / 5.0;
        let (shape, report) = morpher.shape(&[1.0 - t, t], &MarchQuality::DEFAULT)?;
        println!("{t}: G {:.1e}", report.levels.last().map_or(0.0, |l| l.after));
        morphed.push(shape);
        linear.push(a.positions.iter().zip(&b.positions).map(|(p, q)| p.lerp(*q, t)).collect::<Vec<DVec3>>());
    }
    morphed.extend(linear);
    shared::picture(&a, &morphed, 6, [300, 420], (20.0, 8.0), &shared::output("encoding_morph.png"))
}
