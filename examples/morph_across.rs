//! Figure 14 of the surface paper, with the in-betweens of the encoding paper: two built-in
//! characters that share no connectivity. The strider's triangles take the stout one's shape
//! through the correspondence, and the way there goes through their encodings, so that the raised
//! arm turns down instead of shrinking.
//!
//! `cargo run --release --example morph_across [PICTURE.png]`

use std::error::Error;

use barymap::encoding::{HierarchyOptions, MarchQuality};
use barymap::geometry::Topology;
use barymap::models::character_pair;
use barymap::progress::Quiet;
use barymap::surface::correspondence::{CorrespondenceOptions, Shape, correspondence};
use barymap::surface::{AnchorPairs, Embedding, EmbeddingOptions};
use barymap::tools::morph::{FrameWatch, Morpher, compatible_mesh};

mod shared;

fn main() -> Result<(), Box<dyn Error>> {
    let pair = character_pair();
    let (a, b) = (&pair.source.mesh, &pair.target.mesh);
    let (on_a, on_b) = pair.anchors(60);
    let (around_a, around_b) = (Topology::new(a), Topology::new(b));
    let options = EmbeddingOptions { landmarks: 400, ..EmbeddingOptions::default() };
    let in_a = Embedding::compute(a, &around_a, &options, &Quiet)?;
    let in_b = Embedding::compute(b, &around_b, &options, &Quiet)?;

    // From the mesh whose triangles are kept to the one whose shape they take.
    let map = correspondence(
        Shape { mesh: b, topology: &around_b, embedding: Some(&in_b) },
        Shape { mesh: a, topology: &around_a, embedding: Some(&in_a) },
        &AnchorPairs { source: on_b, target: on_a.clone() },
        &CorrespondenceOptions::default(),
    )?;
    let made = compatible_mesh((a, &around_a), (b, &around_b), map.as_ref(), &on_a)?;
    println!("{:?}", made.report);
    assert!(made.report.bad_area < 1e-3, "the mesh is folded");

    let mut morpher = Morpher::new(&[a, &made.mesh], None, &HierarchyOptions::default())?;
    let watch = FrameWatch::new(a);
    let ends = [a, &made.mesh].map(|m| watch.measure(&m.positions).volume);
    let mut frames = Vec::new();
    for k in 0..5 {
        let t = f64::from(k) / 4.0;
        let (shape, _) = morpher.shape(&[1.0 - t, t], &MarchQuality::DEFAULT)?;
        let m = watch.measure(&shape);
        println!("{t}: volume {:.4}, stretch efficiency {:.3}, {} inverted", m.volume, m.stretch_all, m.inverted);
        assert!(m.volume > 0.8 * ends[0].min(ends[1]) && m.volume < 1.2 * ends[0].max(ends[1]), "it collapses");
        frames.push(shape);
    }
    shared::picture(a, &frames, 5, [260, 420], (20.0, 8.0), &shared::output("morph_across.png"))
}
