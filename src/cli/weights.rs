//! `barymap weights` and `barymap average`: the inverse and the forward problem themselves.

use std::path::{Path, PathBuf};

use serde_json::json;

use crate::Result;
use crate::cli::common::{Common, EmbeddingArguments, Session, check_outputs};
use crate::geometry::SurfacePoint;
use crate::surface::single::WeightedPoints;

#[derive(Debug, clap::Args)]
pub(crate) struct InverseArguments {
    /// The mesh
    mesh: PathBuf,
    /// Its anchors
    #[arg(long)]
    anchors: PathBuf,
    /// The points whose weights are wanted: CSV with the columns face, b0, b1 and b2
    #[arg(long)]
    points: PathBuf,
    /// The weights: an array with a row per point and a column per anchor
    #[arg(long, short)]
    output: PathBuf,
    #[command(flatten)]
    embedding: EmbeddingArguments,
}

#[derive(Debug, clap::Args)]
pub(crate) struct ForwardArguments {
    /// The mesh
    mesh: PathBuf,
    /// Its anchors
    #[arg(long)]
    anchors: PathBuf,
    /// Weights: CSV, a row per average and a column per anchor
    #[arg(long)]
    weights: PathBuf,
    /// The averages: CSV with the header face,b0,b1,b2, and the columns of text of the weights
    #[arg(long, short)]
    output: PathBuf,
    #[command(flatten)]
    embedding: EmbeddingArguments,
}

fn prepare(
    session: &mut Session<'_>,
    mesh: &Path,
    anchors: &Path,
    e: &EmbeddingArguments,
) -> Result<(crate::cli::common::Surface, Vec<SurfacePoint>)> {
    let mut surface = session.mesh(mesh)?;
    let list = crate::io::anchors::read_single(anchors)?;
    let points = session.find(&surface, &list)?;
    session.embed(&mut surface, &e.options())?;
    Ok((surface, points))
}

pub(crate) fn inverse(common: &Common, arguments: &InverseArguments) -> Result<()> {
    check_outputs([arguments.output.as_path()])?;
    let mut session = Session::start(common)?;
    let (surface, anchors) = prepare(&mut session, &arguments.mesh, &arguments.anchors, &arguments.embedding)?;
    let (points, table) = crate::io::points::read_points(&arguments.points, &surface.mesh)?;
    session.warn_of_table(&arguments.points, table.notes());
    if !table.others().is_empty() {
        session.warn(&format!(
            "{}: columns that are not read: {}",
            arguments.points.display(),
            table.others().join(", ")
        ));
    }
    let weights = WeightedPoints::new(surface.shape(), &anchors)?.weights(&points)?;
    session.watch.lap("inverse");
    crate::io::npy::write_npy(&arguments.output, anchors.len(), &weights, |_| false)?;
    session.say(&format!(
        "{}: weights of {} points, {} anchors",
        arguments.output.display(),
        points.len(),
        anchors.len()
    ));
    let mut report = session.report("weights");
    report["points"] = json!(points.len());
    report["anchors"] = json!(anchors.len());
    session.write_report(&report)
}

pub(crate) fn forward(common: &Common, arguments: &ForwardArguments) -> Result<()> {
    check_outputs([arguments.output.as_path()])?;
    let mut session = Session::start(common)?;
    let (surface, anchors) = prepare(&mut session, &arguments.mesh, &arguments.anchors, &arguments.embedding)?;
    let (weights, table) = crate::io::points::read_weights(&arguments.weights, anchors.len())?;
    session.warn_of_table(&arguments.weights, table.notes());
    let found = WeightedPoints::new(surface.shape(), &anchors)?.averages(&weights)?;
    session.watch.lap("forward");
    let missing = found.iter().filter(|p| !p.found).count();
    if missing > 0 {
        session.warn(&format!("{missing} averages have no projection nearby; their nearest vertex stands in"));
    }
    let points: Vec<SurfacePoint> = found.iter().map(|p| surface.mesh.point_in_file(p.point)).collect();
    crate::io::points::write_points(&arguments.output, &points, &table)?;
    session.say(&format!("{}: {} averages of {} anchors", arguments.output.display(), points.len(), anchors.len()));
    let mut report = session.report("average");
    report["points"] = json!(points.len());
    report["not_found"] = json!(missing);
    session.write_report(&report)
}
