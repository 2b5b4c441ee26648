//! `barymap cage`: deforms a model by a closed cage around it.

use std::path::PathBuf;

use serde_json::{Value, json};

use crate::Result;
use crate::cli::common::{Common, Session, check_outputs};
use crate::cli::model_file::{ModelFormat, New, write_model};
use crate::geometry::Mesh;
use crate::geometry::weld::weld_alike;
use crate::mapping::space::{Cage, PartitionKind, PartitionOptions, RESOLUTION};
use crate::tools::cage::{CageOptions, Caged, PathKind, map_by_cage, pose};
use crate::{Error, io};

#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// The model: OBJ, PLY, OFF, glTF or GLB
    mesh: PathBuf,
    /// The cage around it: a closed mesh; polygons are cut into triangles
    #[arg(long)]
    from: PathBuf,
    /// The same cage, deformed
    #[arg(long)]
    to: PathBuf,
    /// The deformed model: OBJ, PLY with positions and faces, or GLB, which keeps what a glTF input
    /// has beside the mesh
    #[arg(long, short)]
    output: PathBuf,
    /// How the vertices of the cage move from one to the other: by mean-value encoding, which keeps
    /// turns, or straight
    #[arg(long, value_enum, default_value = "encoded")]
    path: PathKind,
    /// How the map is cut into steps that do not fold: binary, direct, uniform:M or continuous
    #[arg(long, default_value = "binary", value_parser = partition_kind)]
    partition: PartitionKind,
    /// Steps no longer than this are not halved any more
    #[arg(long, default_value_t = PartitionOptions::default().eps)]
    eps: f64,
    /// Cells of the grid of samples inside the cage, along its longest side, at which the Jacobian
    /// is tested
    #[arg(long, default_value_t = RESOLUTION)]
    resolution: u32,
    /// From the deformed cage back to the first, exactly
    #[arg(long)]
    inverse: bool,
    /// End with an error, and without an output, if the map folds or a cage on the way intersects
    /// itself
    #[arg(long)]
    strict: bool,
}

/// `binary`, `uniform:8` and the like.
fn partition_kind(text: &str) -> std::result::Result<PartitionKind, String> {
    Ok(match text {
        "direct" => PartitionKind::Direct,
        "binary" => PartitionKind::Binary,
        "continuous" => PartitionKind::Continuous,
        other => match other.strip_prefix("uniform:").and_then(|m| m.parse::<u32>().ok()) {
            Some(m) if m > 0 => PartitionKind::Uniform(m),
            _ => return Err(format!("{text:?} is no partition: write binary, direct, uniform:M or continuous")),
        },
    })
}

pub(crate) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    check_outputs([arguments.output.as_path()])?;
    let format = ModelFormat::of(&arguments.output, &[ModelFormat::Obj, ModelFormat::Ply, ModelFormat::Glb])?;
    let mut session = Session::start(common)?;
    let io::LoadedMesh { mesh: mut model, scene, .. } = session.load(&arguments.mesh)?;
    let mut cages = [session.read(&arguments.from)?, session.read(&arguments.to)?];
    weld_alike(&mut cages, common.weld)?;
    let cage = Cage::new(&cages[0], &cages[1])?;
    session.watch.lap("read");
    let options = CageOptions {
        path: arguments.path,
        partition: PartitionOptions { kind: arguments.partition, eps: arguments.eps, resolution: arguments.resolution },
        inverse: arguments.inverse,
    };
    if model.positions.is_empty() {
        return Err(Error::mesh(&model.name, "the model has no vertices", "Give a mesh"));
    }
    let caged = map_by_cage(&session.engine, &model.positions, &cage, &options, session.progress())
        .map_err(|error| of_model(&model, error))?;
    session.watch.lap("map");
    tell(&session, &model, &caged);
    let mut report = session.report("cage");
    describe(&mut report, arguments, &model, &cage, &caged);
    if arguments.strict && caged.bijective() == "failed" {
        session.write_report(&report)?;
        return Err(Error::numeric(
            "the map folds or its cage intersects itself, and --strict forbids that",
            "Use --partition binary with a smaller --eps, another --path, or move the cage less",
        ));
    }
    // What has no pre-image stays where it is.
    let positions = caged.positions.iter().zip(&model.positions).map(|(p, old)| p.unwrap_or(*old)).collect();
    pose(&mut model, positions)?;
    write_model(&session, &model, scene.as_deref(), New::Shape, format, &arguments.output)?;
    session.watch.lap("write");
    let mut report = session.report("cage");
    describe(&mut report, arguments, &model, &cage, &caged);
    session.write_report(&report)?;
    let steps = &caged.partition.steps;
    session.say(&format!(
        "{}: {} vertices, {} outside the cage; {} steps along the {} path, smallest Jacobian of a step {:.4}, bijective: {}, by {}",
        arguments.output.display(),
        caged.positions.len(),
        caged.outside.vertices,
        steps.len(),
        caged.path,
        steps.iter().map(|s| s.minimum.value).fold(f64::INFINITY, f64::min),
        caged.bijective(),
        session.engine.description()
    ));
    Ok(())
}

/// An error about the model, with its name.
fn of_model(model: &Mesh, error: Error) -> Error {
    match error {
        Error::Input { what, remedy } => Error::mesh(&model.name, what, remedy),
        other => other,
    }
}

fn tell(session: &Session<'_>, model: &Mesh, caged: &Caged) {
    for note in &caged.notes {
        session.warn(note);
    }
    if let Some(step) = caged.partition.steps.iter().find(|s| !s.minimum.positive()) {
        session.warn(&format!(
            "the map folds: between t = {} and {} its Jacobian goes down to {:.4} at {}",
            step.from, step.to, step.minimum.value, step.minimum.at
        ));
    }
    let crossing = &caged.partition.intersections;
    if let Some(first) = crossing.first() {
        session.warn(&format!(
            "the cage intersects itself at {} of {} knots, the first t = {} ({} pairs of triangles, first {} and {}): no map avoids folds there",
            crossing.len(),
            caged.partition.knots.len(),
            first.knot,
            first.pairs,
            first.first.0,
            first.first.1
        ));
    }
    let (outside, all) = (caged.outside, caged.positions.len());
    if outside.vertices > 0 {
        session.warn(&format!(
            "{}: {} of {all} vertices lie outside the cage: they are mapped as well, and {} of them are turned over",
            model.name, outside.vertices, outside.folded
        ));
    }
    let lost = caged.positions.iter().filter(|p| p.is_none()).count();
    if lost > 0 {
        session.warn(&format!("{}: {lost} of {all} vertices have no pre-image and stay", model.name));
    }
}

fn describe(report: &mut Value, arguments: &Arguments, model: &Mesh, cage: &Cage, caged: &Caged) {
    let p = &caged.partition;
    let steps: Vec<Value> = p
        .steps
        .iter()
        .map(|s| {
            json!({
                "from": s.from,
                "to": s.to,
                "j_min": s.minimum.value,
                "at": s.minimum.at.to_array(),
                "kind": s.minimum.kind.name(),
            })
        })
        .collect();
    let crossing: Vec<Value> = p
        .intersections
        .iter()
        .map(|i| json!({"knot": i.knot, "pairs": i.pairs, "first": [i.first.0, i.first.1]}))
        .collect();
    let lengths = || p.knots.windows(2).map(|k| k[1] - k[0]);
    let vertices = model.positions.len();
    report["vertices"] = json!(vertices);
    report["cage"] = json!({"vertices": cage.source.len(), "triangles": cage.triangles.len()});
    report["inverse"] = json!(arguments.inverse);
    report["partition"] = json!(p.knots);
    report["steps"] = json!(steps);
    report["path"] = json!(caged.path);
    report["eps"] = json!(arguments.eps);
    report["resolution"] = json!(arguments.resolution);
    report["shortest_step"] = json!(lengths().fold(1.0, f64::min));
    report["bijective"] = json!(caged.bijective());
    report["self_intersections"] = json!(crossing);
    report["outside"] = json!({
        "vertices": caged.outside.vertices,
        "fraction": caged.outside.vertices as f64 / vertices.max(1) as f64,
        "folded": caged.outside.folded,
    });
    report["escaped"] = json!(caged.escaped);
    report["folded"] = json!(caged.folded);
    report["failed"] = json!(caged.positions.iter().filter(|p| p.is_none()).count());
    report["notes"] = json!(caged.notes);
}
