//! A lobed sphere with quads from a coarse cube (Panozzo et al. 2013, Figure 7): the base mesh on
//! the surface, three levels finer, and smoothed.
//!
//! `cargo run --release --example remesh [PICTURE.png]`

#[path = "shared/lines.rs"]
mod lines;

use std::error::Error;

use barymap::geometry::{Corner, Mesh, MeshBuilder, NONE, Topology};
use barymap::io::write_image;
use barymap::models::shapes::lobed_sphere;
use barymap::progress::Quiet;
use barymap::surface::correspondence::Shape;
use barymap::surface::{Embedding, EmbeddingOptions};
use barymap::tools::remesh::{RemeshOptions, Remesher};
use barymap::tools::render::{Coloring, RenderOptions, render, side_by_side};
use glam::DVec3;
use lines::{Line, with_lines};

/// The surface of a cube of `n` by `n` by `n` cells, around the origin.
fn cube(n: u32, side: f64) -> barymap::Result<Mesh> {
    let mut builder = MeshBuilder::new("cube");
    let mut number = std::collections::BTreeMap::new();
    for axis in 0..3 {
        for (end, i, j) in [0, n].into_iter().flat_map(|e| (0..n).flat_map(move |i| (0..n).map(move |j| (e, i, j)))) {
            let mut corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)].map(|(i, j)| {
                let mut cell = [0; 3];
                (cell[axis], cell[(axis + 1) % 3], cell[(axis + 2) % 3]) = (end, i, j);
                *number.entry(cell).or_insert_with(|| {
                    builder
                        .mesh
                        .positions
                        .push(DVec3::from_array(cell.map(|c| side * (f64::from(c) / f64::from(n) - 0.5))));
                    builder.mesh.positions.len() as u32 - 1
                })
            });
            if end == 0 {
                corners.reverse();
            }
            builder.polygon(corners.map(|vertex| Corner { vertex, texcoord: NONE, normal: NONE }));
        }
    }
    builder.build()
}

/// The edges of a polygon mesh as lines.
fn edges(mesh: &Mesh, radius: f64, color: [u8; 3]) -> Vec<Line> {
    let mut all = std::collections::BTreeSet::new();
    for p in 0..mesh.polygon_count() {
        let c = mesh.polygon(p);
        for k in 0..c.len() {
            let (a, b) = (c[k].vertex, c[(k + 1) % c.len()].vertex);
            all.insert([a.min(b), a.max(b)]);
        }
    }
    let line = |e: [u32; 2]| Line { points: e.map(|v| mesh.positions[v as usize]).to_vec(), radius, color };
    all.into_iter().map(line).collect()
}

fn main() -> Result<(), Box<dyn Error>> {
    let output = std::env::args().nth(1).unwrap_or_else(|| "remesh.png".into());
    let mesh = lobed_sphere(5, 0.35);
    let topology = Topology::new(&mesh);
    let embedding = Embedding::compute(
        &mesh,
        &topology,
        &EmbeddingOptions { landmarks: 600, ..EmbeddingOptions::default() },
        &Quiet,
    )?;
    let shape = Shape { mesh: &mesh, topology: &topology, embedding: Some(&embedding) };
    let base = cube(2, 1.6)?;

    let mut pictures = Vec::new();
    for (levels, smooth) in [(0, 0), (3, 0), (3, 5)] {
        let mut remesher = Remesher::new(shape, &base, &RemeshOptions { levels, smooth, ..RemeshOptions::default() })?;
        remesher.frame()?;
        let report = remesher.report();
        let quads = remesher.mesh();
        let deviation: Vec<String> =
            report.edge_lengths.iter().map(|e| format!("{:.1}", 100.0 * e.variance.sqrt() / e.mean)).collect();
        println!(
            "{levels} levels, {smooth} steps: {} quads, {} inverted; lengths of edges deviate by {} % of the mean; angles {:.0} to {:.0} degrees; at most {:.4} off the mesh",
            report.faces,
            report.turned[1].inverted,
            deviation.join(", "),
            report.angles.least,
            report.angles.most,
            report.distances.middles
        );
        let falls = report.edge_lengths.windows(2).all(|w| w[1].variance < w[0].variance);
        assert!(falls && report.turned[1].inverted == 0, "the remeshing has gone wrong");
        let radius = if levels == 0 { 0.012 } else { 0.005 };
        let (drawn, colors) = with_lines(&quads, [222, 222, 226], &edges(&quads, radius, [30, 60, 140]))?;
        let options =
            RenderOptions { width: 520, height: 520, azimuth: 30.0, elevation: 20.0, ..RenderOptions::default() };
        pictures.push(render(&drawn, Coloring::Vertices(&colors), &[], &options)?);
    }
    write_image(&side_by_side(&pictures, 12, [255; 4])?, &output)?;
    println!("{output}");
    Ok(())
}
