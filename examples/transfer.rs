//! The main job through the library: the texture of one built-in character on a different one, and
//! how far it is from the truth.
//!
//! `cargo run --release --example transfer [PICTURE.png]`

#[path = "shared/device.rs"]
mod device;

use std::error::Error;

use barymap::geometry::Topology;
use barymap::io::write_image;
use barymap::models::character_pair;
use barymap::progress::Quiet;
use barymap::surface::correspondence::{CorrespondenceOptions, Shape};
use barymap::surface::gpu::correspondence_on;
use barymap::surface::{AnchorPairs, Embedding, EmbeddingOptions};
use barymap::tools::render::{Coloring, RenderOptions, render, side_by_side};
use barymap::tools::transfer::{Layer, TransferOptions, transfer_on};
use barymap::tools::vertex_map::vertex_map;

fn main() -> Result<(), Box<dyn Error>> {
    let output = std::env::args().nth(1).unwrap_or_else(|| "transfer.png".into());

    // Two characters that share no connectivity, and sixty pairs of corresponding points.
    let pair = character_pair();
    let (source, target) = (&pair.source.mesh, &pair.target.mesh);
    let (source_points, target_points) = pair.anchors(60);
    let anchors = AnchorPairs { source: source_points, target: target_points };

    // Distances along the surfaces become distances in eight dimensions.
    let (source_topology, target_topology) = (Topology::new(source), Topology::new(target));
    let options = EmbeddingOptions { landmarks: 400, ..EmbeddingOptions::default() };
    let source_embedding = Embedding::compute(source, &source_topology, &options, &Quiet)?;
    let target_embedding = Embedding::compute(target, &target_topology, &options, &Quiet)?;

    // The map from the target to the source: its kernels run per texel.
    let engine = device::engine()?;
    let (map, note) = correspondence_on(
        &engine,
        Shape { mesh: source, topology: &source_topology, embedding: Some(&source_embedding) },
        Shape { mesh: target, topology: &target_topology, embedding: Some(&target_embedding) },
        &anchors,
        &CorrespondenceOptions::default(),
    )?;
    note.iter().for_each(|note| println!("{note}"));

    // A colour for every texel of the target.
    let texture = pair.source.texture(1024);
    let size = TransferOptions { width: 1024, height: 1024, ..TransferOptions::default() };
    let layers = [Layer::single("colour", &texture)];
    let result = transfer_on(&engine, source, &layers, target, map.as_ref(), &size, &Quiet)?;
    println!("{} texels, {:.1} % of the area valid", result.stats.covered, 100.0 * result.stats.valid_fraction);

    // The true correspondence of the built-in characters is known.
    let vertices = vertex_map((source, &source_topology), (target, &target_topology), map.as_ref())?;
    let unit = source.area().sqrt();
    let errors = pair.truth.iter().zip(&vertices.positions).filter_map(|(truth, image)| {
        let image = (*image)?;
        Some(image.distance(truth.position(source)) / unit)
    });
    let (sum, count) = errors.fold((0.0, 0), |(sum, count), e| (sum + e, count + 1));
    let mean = sum / f64::from(count);
    println!("mean error {mean:.4} of the square root of the area, over {count} vertices");
    // Sixty anchors on shapes as different as these leave drift between them, which the statuses
    // own up to.
    assert!(mean < 0.02 && result.stats.valid_fraction > 0.6, "the transfer has gone wrong");

    let view = RenderOptions { width: 700, height: 900, ..RenderOptions::default() };
    let before = render(source, Coloring::Texture(&texture), &anchors.source, &view)?;
    let after = render(target, Coloring::Texture(&result.layers[0]), &anchors.target, &view)?;
    write_image(&side_by_side(&[before, after], 20, [255; 4])?, &output)?;
    println!("{output}: the source with its texture, the target with the one it received; dots are anchors");
    Ok(())
}
