//! `barymap map`: where the vertices of one mesh lie on another.

use std::path::PathBuf;

use barymap::Result;
use barymap::geometry::SurfacePoint;
use barymap::io::points::MapRow;
use barymap::surface::PackedPoint;
use barymap::tools::vertex_map::vertex_map;
use serde_json::json;

use crate::common::{Common, EmbeddingArguments, Session, anchor_pairs, check_outputs};
use crate::method::{MethodName, prepare};

#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// The mesh that points are carried to
    #[arg(long)]
    source: PathBuf,
    /// The mesh whose points are carried
    #[arg(long)]
    target: PathBuf,
    /// Pairs of anchors: JSON, lines `iS iT`, or two files `S.vts,T.vts`
    #[arg(long)]
    anchors: String,
    /// The map: CSV, a row per target vertex or per point
    #[arg(long, short)]
    output: PathBuf,
    /// Points of the target instead of its vertices: CSV with the header face,b0,b1,b2
    #[arg(long)]
    points: Option<PathBuf>,
    /// How points are carried
    #[arg(long, value_enum, default_value = "transport")]
    method: MethodName,
    #[command(flatten)]
    embedding: EmbeddingArguments,
}

pub(crate) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    check_outputs([arguments.output.as_path()])?;
    let mut session = Session::start(common)?;
    let (mut source, mut target) = (session.mesh(&arguments.source)?, session.mesh(&arguments.target)?);
    let anchors = anchor_pairs(&arguments.anchors, &source, &target, &session)?;
    let method = arguments.method.method();
    let points = arguments.points.as_ref().map(|p| barymap::io::points::read_points(p, &target.mesh)).transpose()?;
    let map = prepare(&mut session, &mut source, &mut target, &anchors, method, &arguments.embedding)?;
    let vertices = vertex_map((&source.mesh, &source.topology), (&target.mesh, &target.topology), map.as_ref())?;
    let images = match &points {
        None => vertices.images.clone(),
        Some(points) => {
            let packed: Vec<PackedPoint> = points.iter().map(|&p| p.into()).collect();
            let mut images = Vec::new();
            map.map(&packed, &mut images)?;
            images
        }
    };
    session.watch.lap("map");
    let at = |p: SurfacePoint| (p, p.position(&source.mesh));
    barymap::io::points::write_map(
        &arguments.output,
        images.iter().enumerate().map(|(i, image)| MapRow {
            index: i as u64,
            point: image.point().map(at),
            status: image.status().word(),
            confidence: f64::from(image.confidence),
        }),
    )?;
    let d = vertices.distortion;
    session.say(&format!(
        "{}: {} points by {}; of the target's area {:.1} % valid, {:.2} % flipped; stretch efficiency {:.3}, best 95 % {:.3}",
        arguments.output.display(),
        images.len(),
        method.name(),
        100.0 * vertices.valid_fraction,
        100.0 * d.flipped_area,
        d.stretch_all,
        d.stretch_best95
    ));
    let mut report = session.report("map");
    report["method"] = json!(method.name());
    report["points"] = json!(images.len());
    report["anchors"] = json!(anchors.len());
    report["valid_fraction"] = json!(vertices.valid_fraction);
    report["flipped_area"] = json!(d.flipped_area);
    report["flipped_faces"] = json!(d.flipped_faces);
    report["stretch_all"] = json!(d.stretch_all);
    report["stretch_best95"] = json!(d.stretch_best95);
    report["stress"] = json!({
        "source": source.embedding.as_ref().map(|e| e.stress),
        "target": target.embedding.as_ref().map(|e| e.stress),
    });
    session.write_report(&report)
}
