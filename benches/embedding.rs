//! Embedding by stage, and the time to load one that is kept.
//!
//! `cargo bench --bench embedding`. With `BARYMAP_DATA` three large meshes too.

mod support;

use barymap::geometry::{Mesh, Topology};
use barymap::models::{stout, strider};
use barymap::progress::Quiet;
use barymap::surface::{Embedding, EmbeddingOptions};
use support::{Result, best, data, once};

fn row(name: &str, mesh: &Mesh) -> Result<()> {
    let options = EmbeddingOptions::default();
    let (topology, adjacency) = once(|| Topology::new(mesh));
    let (embedding, spent) = once(|| Embedding::compute(mesh, &topology, &options, &Quiet));
    let embedding = embedding?;
    let bytes = embedding.to_bytes();
    let reload = best(3, || {
        Embedding::from_bytes(&bytes)?;
        Ok(())
    })?;
    let s = embedding.seconds;
    println!(
        "| {name} | {} | {:.2} | {:.2} | {:.2} | {:.2} | {:.2} | {:.2} | {:.2} | {:.2} | {:.3} | {:.4} |",
        mesh.triangle_count(),
        adjacency.wall,
        s.simplification,
        s.sampling,
        s.geodesics,
        s.scaling,
        s.upsampling,
        spent.wall,
        spent.cpu / 2.0,
        embedding.relative_error(),
        reload.wall,
    );
    Ok(())
}

fn main() -> Result<()> {
    let options = EmbeddingOptions::default();
    println!(
        "{} landmarks, D = {}, {} threads; stages in wall seconds, the whole in wall seconds and in CPU time / 2",
        options.landmarks,
        options.dimension,
        rayon::current_num_threads()
    );
    println!(
        "| mesh | faces | adjacency | mid-level | landmarks | geodesics | scaling | least squares | all, wall | all, CPU / 2 | rms error | reload |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|");
    row("strider", &strider().mesh)?;
    row("stout", &stout().mesh)?;
    if let Some(folder) = data() {
        for name in ["armadillo_86k", "koala_100k", "igea_150k"] {
            row(name, &barymap::io::read_mesh(folder.join("mesh").join(format!("{name}.obj")))?.mesh)?;
        }
    }
    Ok(())
}
