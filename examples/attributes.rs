//! Data of vertices on a different character: normals as vectors, turned by the map's differential,
//! beside the same numbers carried as they are. Turned ones stand on the new surface as they stood
//! on the old.
//!
//! `cargo run --release --example attributes [PICTURE.png]`

use std::error::Error;

use barymap::geometry::Topology;
use barymap::io::write_image;
use barymap::models::character_pair;
use barymap::progress::Quiet;
use barymap::surface::correspondence::{CorrespondenceOptions, Shape, correspondence};
use barymap::surface::quality::vertex_normals;
use barymap::surface::{AnchorPairs, Embedding, EmbeddingOptions};
use barymap::tools::attributes::{Attribute, AttributeKind, Fill, transfer_attributes};
use barymap::tools::render::{Coloring, RenderOptions, render, side_by_side};
use glam::DVec3;

/// Directions as colours.
fn colors(directions: &[f64]) -> Vec<[u8; 3]> {
    directions.chunks_exact(3).map(|d| [0, 1, 2].map(|k| (127.5 + 127.5 * d[k].clamp(-1.0, 1.0)) as u8)).collect()
}

/// Mean angle between the directions and the normals, in degrees.
fn mean_angle(directions: &[f64], normals: &[DVec3]) -> f64 {
    let angle = |(d, n): (&[f64], &DVec3)| DVec3::from_slice(d).angle_between(*n).to_degrees();
    directions.chunks_exact(3).zip(normals).map(angle).sum::<f64>() / normals.len() as f64
}

fn main() -> Result<(), Box<dyn Error>> {
    let output = std::env::args().nth(1).unwrap_or_else(|| "attributes.png".into());
    let pair = character_pair();
    let (source, target) = (&pair.source.mesh, &pair.target.mesh);
    let (source_topology, target_topology) = (Topology::new(source), Topology::new(target));
    let (source_points, target_points) = pair.anchors(60);
    let anchors = AnchorPairs { source: source_points, target: target_points };
    let options = EmbeddingOptions { landmarks: 400, ..EmbeddingOptions::default() };
    let embeddings = [
        Embedding::compute(source, &source_topology, &options, &Quiet)?,
        Embedding::compute(target, &target_topology, &options, &Quiet)?,
    ];
    let map = correspondence(
        Shape { mesh: source, topology: &source_topology, embedding: Some(&embeddings[0]) },
        Shape { mesh: target, topology: &target_topology, embedding: Some(&embeddings[1]) },
        &anchors,
        &CorrespondenceOptions::default(),
    )?;

    let normals = vertex_normals(source, &source_topology);
    let values: Vec<f64> = normals.iter().flat_map(|n| n.to_array()).collect();
    let data = |name: &str, kind| Attribute { name: name.into(), kind, columns: 3, values: values.clone() };
    let carried = transfer_attributes(
        (source, &source_topology),
        (target, &target_topology),
        map.as_ref(),
        &[data("as they are", AttributeKind::Scalars), data("turned", AttributeKind::Normals)],
        Fill::Smooth,
    )?;
    let own = vertex_normals(target, &target_topology);
    let [plain, turned] = [0, 1].map(|k| mean_angle(&carried.attributes[k].values, &own));
    println!("mean angle with the target's own normals: {plain:.1} degrees as they are, {turned:.1} turned");
    assert!(turned < 0.5 * plain, "the differential has gone wrong");

    let view = RenderOptions { width: 500, height: 700, ..RenderOptions::default() };
    let shown = |values: &[f64]| render(target, Coloring::Vertices(&colors(values)), &[], &view);
    let pictures = [
        render(source, Coloring::Vertices(&colors(&values)), &[], &view)?,
        shown(&carried.attributes[0].values)?,
        shown(&carried.attributes[1].values)?,
    ];
    write_image(&side_by_side(&pictures, 20, [255; 4])?, &output)?;
    println!("{output}: normals as colours: on the source; carried as they are; turned by the map's differential");
    Ok(())
}
