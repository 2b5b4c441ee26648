//! `barymap remesh`: a fine quad mesh on a surface, from a coarse one.

use std::path::{Path, PathBuf};

use serde_json::json;

use crate::Result;
use crate::cli::common::{Common, EmbeddingArguments, Session, check_outputs, usage};
use crate::tools::remesh::{Evenness, RemeshOptions, RemeshReport, Remesher, automatic_base};

/// Distance from the mesh, in its diagonals, from which a vertex of the base mesh is called far
/// off.
const FAR: f64 = 0.1;

#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// The mesh
    mesh: PathBuf,
    /// The coarse mesh, best of quads, near the mesh: OBJ, PLY, OFF; its vertices are moved onto
    /// the mesh. `auto` makes one by decimation and pairs of triangles
    #[arg(long)]
    base: PathBuf,
    /// Vertices of the base mesh that `auto` makes
    #[arg(long, default_value_t = 300)]
    base_vertices: usize,
    /// Times every quad is split into four
    #[arg(long, default_value_t = RemeshOptions::default().levels)]
    levels: u32,
    /// Steps of Laplacian smoothing on the mesh
    #[arg(long, default_value_t = 0)]
    smooth: u32,
    /// How far a step goes towards the average of the neighbours: above 0, at most 1
    #[arg(long, default_value_t = RemeshOptions::default().step)]
    step: f64,
    /// Whether a step keeps lengths of edges even: auto, as far as their variance falls; 0, not at
    /// all, as in the paper; up to 1, nothing but that
    #[arg(long, default_value = "auto", value_parser = evenness)]
    even: Evenness,
    /// The quad mesh: OBJ or PLY
    #[arg(long, short)]
    output: PathBuf,
    #[command(flatten)]
    embedding: EmbeddingArguments,
}

fn evenness(text: &str) -> std::result::Result<Evenness, String> {
    if text == "auto" {
        return Ok(Evenness::Auto);
    }
    text.parse().map(Evenness::Fixed).map_err(|_| format!("{text:?} is neither auto nor a number from 0 to 1"))
}

/// Whether the output is a PLY file.
fn is_ply(path: &Path) -> Result<bool> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    match extension.as_str() {
        "obj" => Ok(false),
        "ply" => Ok(true),
        _ => {
            let what = format!("{} is neither OBJ nor PLY", path.display());
            Err(usage("--output", &what, "End the name in .obj or .ply: these hold quads"))
        }
    }
}

pub(crate) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    let ply = is_ply(&arguments.output)?;
    check_outputs([arguments.output.as_path()])?;
    let mut session = Session::start(common)?;
    let mut surface = session.mesh(&arguments.mesh)?;
    let base = if arguments.base.as_os_str() == "auto" {
        automatic_base(&surface.mesh, &surface.topology, arguments.base_vertices)?
    } else {
        session.read(&arguments.base)?
    };
    session.embed(&mut surface, &arguments.embedding.options())?;
    let options = RemeshOptions {
        levels: arguments.levels,
        smooth: arguments.smooth,
        step: arguments.step,
        evenness: arguments.even,
    };
    let mut remesher = Remesher::new(surface.shape(), &base, &options)?;
    session.watch.lap("prepare");
    if let Some(note) = remesher.compute_on(&session.engine)? {
        session.warn(&note);
    }
    remesher.frame()?;
    session.watch.lap("remesh");
    let mesh = remesher.mesh();
    if ply {
        crate::io::write_ply(&mesh, None, &arguments.output)?;
    } else {
        session.write_obj(&mesh, &arguments.output)?;
    }
    session.watch.lap("write");
    let found = remesher.report();
    session.watch.lap("measure");
    let diagonal = surface.mesh.bounds().map_or(0.0, |(low, high)| low.distance(high));
    tell(&session, &found, &remesher, diagonal, arguments);
    let mut report = session.report("remesh");
    report["remesh"] = json!(found);
    let snapped: Vec<f64> = remesher.snapped().map(|s| s.1).collect();
    report["remesh"]["snap_distance"] = json!(snapped);
    session.write_report(&report)
}

fn tell(session: &Session<'_>, r: &RemeshReport, remesher: &Remesher<'_>, diagonal: f64, arguments: &Arguments) {
    let base = arguments.base.display();
    if r.base_others > 0 {
        let then = if arguments.levels > 0 {
            "the first level makes a quad of each of their corners"
        } else {
            "they stay so, since --levels is 0"
        };
        session.warn(&format!("{base}: {} faces are no quads; {then}", r.base_others));
    }
    let far: Vec<(u32, f64)> = remesher.snapped().filter(|s| s.1 > FAR * diagonal).collect();
    if let Some(worst) = far.iter().max_by(|a, b| a.1.total_cmp(&b.1)) {
        session.warn(&format!(
            "{base}: {} vertices were moved onto the mesh by more than {:.0} % of its diagonal, vertex {} by {:.4}; check that the two fit",
            far.len(),
            100.0 * FAR,
            worst.0,
            worst.1
        ));
    }
    if r.without_projection > 0 {
        session.warn(&format!(
            "{} vertices have no projection, as beyond the boundary of a mesh; the closest points stand in",
            r.without_projection
        ));
    }
    let done = r.rest_lengths.len() as u32;
    if done < arguments.smooth {
        session.warn(&format!("smoothing ended after {done} steps: no further one makes lengths of edges more even"));
    }
    if r.turned[1].inverted > 0 {
        session.warn(&format!("{} quads are inverted: give a finer base mesh there", r.turned[1].inverted));
    }
    let last = r.edge_lengths.last().copied().unwrap_or_default();
    session.say(&format!(
        "{}: {} quads, {} vertices moved onto the mesh by up to {:.3e}; edges {:.4} to {:.4}, deviation {:.1} % of the mean (before smoothing {:.1} %); angles {:.0} to {:.0} degrees; {} inverted; quads and mesh at most {:.3e} apart",
        arguments.output.display(),
        r.faces,
        remesher.base().len(),
        r.snap_largest,
        last.least,
        last.most,
        100.0 * last.variance.sqrt() / last.mean,
        r.edge_lengths.first().map_or(0.0, |e| 100.0 * e.variance.sqrt() / e.mean),
        r.angles.least,
        r.angles.most,
        r.turned[1].inverted,
        r.distances.surface.max(r.distances.middles)
    ));
}
