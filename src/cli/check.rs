//! `barymap check`: what the anchors of a mesh cover, and where one is missing.

use std::path::PathBuf;

use serde_json::json;

use crate::Result;
use crate::cli::common::{Common, EmbeddingArguments, Session, check_outputs};
use crate::cli::side::OfPairs;
use crate::surface::correspondence::CorrespondenceOptions;
use crate::tools::cover::cover;

#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// The mesh
    mesh: PathBuf,
    /// Its anchors, or pairs, of which it has one side
    #[arg(long)]
    anchors: PathBuf,
    #[command(flatten)]
    of_pairs: OfPairs,
    /// A coloured mesh (PLY): green where points return, red where they do not
    #[arg(long, short)]
    output: Option<PathBuf>,
    /// How many vertices to propose as further anchors
    #[arg(long, default_value_t = 5)]
    suggest: usize,
    #[command(flatten)]
    embedding: EmbeddingArguments,
}

pub(crate) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    check_outputs(arguments.output.as_deref())?;
    let mut session = Session::start(common)?;
    let mut surface = session.mesh(&arguments.mesh)?;
    let list = arguments.of_pairs.read(&arguments.anchors)?;
    let anchors = session.find(&surface, &list)?;
    session.embed(&mut surface, &arguments.embedding.options())?;
    let found = cover(surface.shape(), &anchors, arguments.suggest.min(1000), &CorrespondenceOptions::default())?;
    session.watch.lap("check");
    if let Some(path) = &arguments.output {
        let colors: Vec<[u8; 3]> = found
            .round_trip
            .iter()
            .map(|&d| match d {
                d if d <= 0.1 => [60, 170, 90],
                d if d <= 1.0 => [200, 200, 80],
                _ => [210, 60, 50],
            })
            .collect();
        crate::io::write_ply(&surface.mesh, Some(&colors), path)?;
    }
    session.say(&format!(
        "{} anchors cover {:.1} % of the area (points return within one mean edge)",
        anchors.len(),
        100.0 * found.covered_fraction
    ));
    if !found.proposals.is_empty() {
        session.say("add anchors near these vertices:");
        for &v in &found.proposals {
            let p = surface.mesh.positions[v as usize];
            session.say(&format!("  {v} at ({:.4}, {:.4}, {:.4})", p.x, p.y, p.z));
        }
    }
    let mut report = session.report("check");
    report["covered_fraction"] = json!(found.covered_fraction);
    report["proposals"] = json!(found.proposals);
    let positions = found.proposals.iter().map(|&v| surface.mesh.positions[v as usize].to_array());
    report["positions"] = json!(positions.collect::<Vec<_>>());
    report["anchors"] = json!(anchors.len());
    session.write_report(&report)
}
