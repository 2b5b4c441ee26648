//! `barymap map`: where the vertices of one mesh lie on another.

use std::path::PathBuf;

use serde_json::json;

use crate::Result;
use crate::cli::common::{Common, EmbeddingArguments, Session, anchor_pairs, check_outputs};
use crate::cli::method::{MethodArguments, prepare};
use crate::geometry::SurfacePoint;
use crate::io::points::{Answered, MapRow};
use crate::surface::quality::{ErrorSummary, summarise};
use crate::surface::{AnchorPairs, PackedImage, PackedPoint};
use crate::tools::inverse_map::{PreImage, cycle, inverse_map};
use crate::tools::vertex_map::vertex_map;

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
    /// Points of the target instead of its vertices: CSV with the columns face, b0, b1 and b2;
    /// others are kept
    #[arg(long)]
    points: Option<PathBuf>,
    #[command(flatten)]
    method: MethodArguments,
    /// The inverse: for every vertex of the source the point of the target that goes there; its own
    /// residual counts against it
    #[arg(long, conflicts_with = "points")]
    inverse: bool,
    /// Make the map from the source to the target too, and report how far points come back from
    /// where they were
    #[arg(long)]
    cycle: bool,
    #[command(flatten)]
    embedding: EmbeddingArguments,
}

pub(crate) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    check_outputs([arguments.output.as_path()])?;
    let mut session = Session::start(common)?;
    let (mut source, mut target) = (session.mesh(&arguments.source)?, session.target(&arguments.target)?);
    let anchors = anchor_pairs(&arguments.anchors, &source, &target, &session)?;
    let method = arguments.method;
    let (points, table) = match &arguments.points {
        Some(path) => {
            let (points, table) = crate::io::points::read_points(path, &target.mesh)?;
            session.warn_of_table(path, table.notes());
            (Some(points), table)
        }
        None => (None, Answered::default()),
    };
    let map = prepare(&mut session, &mut source, &mut target, &anchors, method, &arguments.embedding)?;
    let vertices = vertex_map((&source.mesh, &source.topology), (&target.mesh, &target.topology), map.as_ref())?;
    let mut residuals = None;
    let images = match &points {
        None if arguments.inverse => {
            let points: Vec<Option<SurfacePoint>> = (0..source.mesh.vertex_count() as u32)
                .map(|v| source.topology.vertex_point(source.mesh.representative(v)))
                .collect();
            let used: Vec<SurfacePoint> = points.iter().flatten().copied().collect();
            let mut found = inverse_map(&source.mesh, &target.mesh, map.as_ref(), &vertices, &used)?.into_iter();
            let found: Vec<Option<PreImage>> = points.iter().map(|p| p.and_then(|_| found.next())).collect();
            let missed: Vec<f64> = found.iter().flatten().map(|f| f.residual).filter(|r| r.is_finite()).collect();
            residuals = Some(summarise(&missed));
            found.into_iter().map(|f| f.map_or(PackedImage::NOWHERE, |f| f.point)).collect()
        }
        None => vertices.images.clone(),
        Some(points) => {
            let packed: Vec<PackedPoint> = points.iter().map(|&p| p.into()).collect();
            let mut images = Vec::new();
            map.map(&packed, &mut images)?;
            images
        }
    };
    session.watch.lap("map");
    let onto = if arguments.inverse { &target.mesh } else { &source.mesh };
    let at = |p: SurfacePoint| (onto.point_in_file(p), p.position(onto));
    let rows: Vec<MapRow> = images
        .iter()
        .enumerate()
        .map(|(i, image)| MapRow {
            index: i as u64,
            point: image.point().map(at),
            status: image.status().word(),
            confidence: f64::from(image.confidence),
        })
        .collect();
    crate::io::points::write_map(&arguments.output, &rows, &table)?;
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
    let cycled = if arguments.cycle {
        let turned = AnchorPairs { source: anchors.target.clone(), target: anchors.source.clone() };
        let chosen = (session.field.take(), session.alignment.take());
        let back = prepare(&mut session, &mut target, &mut source, &turned, method, &arguments.embedding)?;
        let c = cycle(&target.mesh, &target.topology, &vertices, back.as_ref())?;
        (session.field, session.alignment) = chosen;
        session.watch.lap("cycle");
        session.say(&format!(
            "there and back: mean {:.5}, 95 % within {:.5}, largest {:.5} of the square root of the area; {:.1} % within an edge",
            c.error.mean,
            c.error.p95,
            c.error.max,
            100.0 * c.within_edge
        ));
        Some(c)
    } else {
        None
    };
    session.handed_back = map.handed_back();
    let mut report = session.report("map");
    let summary = |e: ErrorSummary| json!({"mean": e.mean, "median": e.median, "p95": e.p95, "max": e.max});
    if let Some(c) = cycled {
        report["cycle"] = summary(c.error);
        report["cycle"]["returned"] = json!(c.returned);
        report["cycle"]["within_edge"] = json!(c.within_edge);
    }
    if let Some(r) = residuals {
        report["residual"] = summary(r);
    }
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
