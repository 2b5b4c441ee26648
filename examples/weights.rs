//! The inverse problem: the weight of one anchor at every vertex of a character, as colours. The
//! weights of all anchors sum to one at each vertex, and each is one at its own anchor and zero at
//! the others (Panozzo et al. 2013, section 3.2).
//!
//! `cargo run --release --example weights [PICTURE.png]`

use std::error::Error;

use barymap::geometry::{SurfacePoint, Topology};
use barymap::io::write_image;
use barymap::models::character_pair;
use barymap::progress::Quiet;
use barymap::surface::anchors::vertex_point;
use barymap::surface::correspondence::Shape;
use barymap::surface::single::WeightedPoints;
use barymap::surface::{Embedding, EmbeddingOptions};
use barymap::tools::render::{Coloring, RenderOptions, render, side_by_side};

const ANCHORS: usize = 27;

fn main() -> Result<(), Box<dyn Error>> {
    let output = std::env::args().nth(1).unwrap_or_else(|| "weights.png".into());
    let pair = character_pair();
    let mesh = &pair.target.mesh;
    let topology = Topology::new(mesh);
    let options = EmbeddingOptions { landmarks: 400, ..EmbeddingOptions::default() };
    let embedding = Embedding::compute(mesh, &topology, &options, &Quiet)?;
    let (_, anchors) = pair.anchors(ANCHORS);

    let shape = Shape { mesh, topology: &topology, embedding: Some(&embedding) };
    let weighted = WeightedPoints::new(shape, &anchors)?;
    let vertices: Vec<SurfacePoint> = (0..mesh.vertex_count() as u32)
        .map(|v| vertex_point(mesh, &topology, v, "vertex"))
        .collect::<Result<_, _>>()?;
    let weights = weighted.weights(&vertices)?;

    let partition = weights.chunks(ANCHORS).map(|row| (row.iter().sum::<f64>() - 1.0).abs()).fold(0.0, f64::max);
    println!("{} vertices, {ANCHORS} anchors: sums differ from one by at most {partition:.1e}", vertices.len());
    let at_anchors = weighted.weights(&anchors)?;
    let lagrange = (0..ANCHORS * ANCHORS)
        .map(|k| (at_anchors[k] - f64::from(u8::from(k / ANCHORS == k % ANCHORS))).abs())
        .fold(0.0, f64::max);
    println!("at the anchors they are one and zero within {lagrange:.1e}");
    assert!(partition < 1e-9 && lagrange < 1e-6, "the weights have gone wrong");

    // The anchor that is highest up, and the one farthest in front.
    let at = |i: usize| anchors[i].position(mesh);
    let top = (0..ANCHORS).max_by(|&a, &b| at(a).y.total_cmp(&at(b).y)).unwrap_or(0);
    let front = (0..ANCHORS).max_by(|&a, &b| at(a).z.total_cmp(&at(b).z)).unwrap_or(0);
    let view = RenderOptions { width: 700, height: 900, ..RenderOptions::default() };
    let pictures = [top, front].map(|anchor| {
        let colors: Vec<[u8; 3]> = weights.chunks(ANCHORS).map(|row| color(row[anchor])).collect();
        render(mesh, Coloring::Vertices(&colors), &anchors, &view)
    });
    let [left, right] = pictures;
    write_image(&side_by_side(&[left?, right?], 20, [255; 4])?, &output)?;
    println!("{output}: weights of anchors {top} and {front}: red is one, white zero, blue negative");
    Ok(())
}

/// White at zero, red towards one, blue below zero.
fn color(weight: f64) -> [u8; 3] {
    let strength = weight.abs().min(1.0).sqrt();
    let fade = |to: f64| 255.0 + (to - 255.0) * strength;
    let rgb = if weight >= 0.0 { [fade(200.0), fade(30.0), fade(40.0)] } else { [fade(30.0), fade(70.0), fade(200.0)] };
    rgb.map(|c| c as u8)
}
