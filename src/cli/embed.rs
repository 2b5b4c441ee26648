//! `barymap embed`: the embedding of a mesh as an array.

use std::path::PathBuf;

use serde_json::json;

use crate::Result;
use crate::cli::common::{Common, EmbeddingArguments, Session, check_outputs};

#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// The mesh: OBJ, PLY, OFF, glTF or GLB
    mesh: PathBuf,
    /// The array: one row per vertex, f64
    #[arg(long, short)]
    output: PathBuf,
    #[command(flatten)]
    embedding: EmbeddingArguments,
}

pub(crate) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    check_outputs([arguments.output.as_path()])?;
    let mut session = Session::start(common)?;
    let mut surface = session.mesh(&arguments.mesh)?;
    session.embed(&mut surface, &arguments.embedding.options())?;
    let Some(embedding) = &mut surface.embedding else { return Ok(()) };
    surface.mesh.spread_rows(embedding.dimension, &mut embedding.points);
    // Vertices without a triangle have no place.
    let blank = |v: usize| surface.topology.vertex_triangles(surface.mesh.representative(v as u32)).is_empty();
    crate::io::npy::write_npy(&arguments.output, embedding.dimension, &embedding.points, blank)?;
    session.say(&format!(
        "{}: {} vertices in {} dimensions, {} landmarks, stress {:.5} (relative error of distances {:.1} %)",
        arguments.output.display(),
        surface.mesh.vertex_count(),
        embedding.dimension,
        embedding.landmarks.len(),
        embedding.stress,
        100.0 * embedding.relative_error()
    ));
    let mut report = session.report("embed");
    report["stress"] = json!(embedding.stress);
    report["landmarks"] = json!(embedding.landmarks.len());
    report["vertices"] = json!(surface.mesh.vertex_count());
    session.write_report(&report)
}
