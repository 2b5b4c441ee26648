//! `barymap deform`: poses a mesh by a few of its vertices.

use std::path::PathBuf;

use serde_json::json;

use crate::Result;
use crate::cli::common::{Common, Session, check_outputs, usage};
use crate::cli::model_file::{ModelFormat, New, write_model};
use crate::cli::needs;
use crate::encoding::{HierarchyOptions, Quality};
use crate::io::{check_handles, read_handles_on, read_vertices_on};
use crate::tools::deform::{Deformer, Handles};
use crate::words::words;

#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// The mesh: OBJ, PLY, OFF, glTF or GLB
    mesh: PathBuf,
    /// Handles: JSON {"handles": [{"vertex": i, "position": [x, y, z]}, ...]}, or in place of the
    /// vertex "at": [x, y, z], or "face" and "barycentric"
    #[arg(long)]
    handles: PathBuf,
    /// Vertices that may move, one index a line, or a JSON list of places; all others are held
    #[arg(long)]
    roi: Option<PathBuf>,
    /// How far the minimisation goes
    #[arg(long, value_enum, default_value = "default")]
    quality: QualityName,
    /// How strongly edges keep their lengths: 0 not at all, 1 well
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    stiffness: f64,
    /// Sweeps of Gauss-Seidel at the end, as in the paper
    #[arg(long, default_value_t = 0)]
    sweeps: usize,
    /// The posed mesh: OBJ, PLY with positions and faces, or GLB, which keeps what a glTF input has
    /// beside the mesh
    #[arg(long, short)]
    output: PathBuf,
}

/// Names of the qualities.
#[derive(Clone, Copy, Debug)]
enum QualityName {
    Splits,
    Preview,
    Default,
    Converged,
}

words! { QualityName, "quality", "a quality":
    Splits => "splits" "Vertex splits only",
    Preview => "preview" "Coarse stages solved, then splits",
    Default => "default" "Coarse stages solved, two inexact steps on finer ones",
    Converged => "converged" "To the minimum",
}

pub(crate) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    check_outputs([arguments.output.as_path()])?;
    let format = ModelFormat::of(&arguments.output, &[ModelFormat::Obj, ModelFormat::Ply, ModelFormat::Glb])?;
    if arguments.sweeps > 1000 {
        return Err(usage("--sweeps", "more than 1000", "Use --quality converged instead"));
    }
    if !(0.0..=1e6).contains(&arguments.stiffness) {
        return Err(usage("--stiffness", "the value is out of range", "Give a number from 0 to 1000000"));
    }
    let mut session = Session::start(common)?;
    let surface = session.mesh(&arguments.mesh)?;
    needs::DEFORM.check(&surface.mesh, 0)?;
    let handles = read_handles_on(&arguments.handles, &surface.mesh)?;
    let region = arguments.roi.as_ref().map(|path| read_vertices_on(path, &surface.mesh)).transpose()?;
    check_handles(&arguments.handles, &surface.mesh, &handles)?;
    let (vertices, positions): (Vec<u32>, Vec<_>) = handles.into_iter().unzip();
    let wanted = Handles { vertices, region };
    let mut deformer = Deformer::new(&surface.mesh, wanted, &HierarchyOptions::default(), session.cache())?;
    deformer.decode_on(&session.engine);
    for warning in &deformer.warnings {
        session.warn(&format!("{}: {warning}", deformer.name()));
    }
    session.watch.lap("prepare");
    let quality = match arguments.quality {
        QualityName::Splits => Quality::SPLITS,
        QualityName::Preview => Quality::PREVIEW,
        QualityName::Default => Quality::DEFAULT,
        QualityName::Converged => Quality::CONVERGED,
    };
    let quality = Quality { sweeps: arguments.sweeps, stiffness: arguments.stiffness, ..quality };
    let result = deformer.deform(&positions, &quality, false)?;
    session.watch.lap("decode");
    let device = deformer.decoder().device();
    let (device_stages, notes): (Vec<&str>, &[String]) =
        device.map_or((Vec::new(), &[]), |d| (d.ran().collect(), d.notes()));
    for note in notes {
        session.warn(note);
    }
    let m = deformer.measures(&result.positions);
    session.watch.lap("measure");
    let mut mesh = surface.mesh;
    deformer.pose(&mut mesh, result.positions)?;
    write_model(&session, &mesh, surface.scene.as_deref(), New::Shape, format, &arguments.output)?;
    session.watch.lap("write");
    session.say(&format!(
        "{}: G {:.3e}, edges {:.1} % rms and {:.1} % at most, volume {:.3}, {} triangles flipped, {} iterations",
        arguments.output.display(),
        m.g,
        100.0 * m.edge_rms,
        100.0 * m.edge_max,
        m.volume_ratio,
        m.flipped,
        result.report.iterations(),
    ));
    let mut report = session.report("deform");
    let levels = result.report.levels.iter().map(|l| {
        json!({
            "free": l.free, "iterations": l.iterations, "gradient_steps": l.gradient_steps,
            "before": l.before, "after": l.after, "seconds": l.seconds, "on_device": l.on_device,
        })
    });
    for (key, value) in [
        ("g", json!(m.g)),
        ("g_normalised", json!(m.g_normalised)),
        ("edge_rms", json!(m.edge_rms)),
        ("edge_max", json!(m.edge_max)),
        ("volume_ratio", json!(m.volume_ratio)),
        ("dihedral_rms_degrees", json!(m.dihedral_rms)),
        ("flipped", json!(m.flipped)),
        ("iterations", json!(result.report.iterations())),
        ("device_stages", json!(device_stages)),
        ("notes", json!(notes)),
        ("levels", levels.collect()),
    ] {
        report[key] = value;
    }
    session.write_report(&report)
}
