//! `barymap morph`: in-betweens and blends of meshes of the same connectivity.

use std::path::PathBuf;

use barymap::encoding::HierarchyOptions;
use barymap::geometry::Mesh;
use barymap::io::read_vertex_list;
use barymap::tools::morph::{Morpher, QUALITY};
use barymap::{Error, Result};
use clap::ValueEnum;
use serde_json::json;

use crate::common::{Common, Session, usage};

#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// Two or more meshes of the same connectivity; with --frames they are passed through in this order
    #[arg(required = true, num_args = 2..)]
    meshes: Vec<PathBuf>,
    /// Number of frames from the first mesh to the last, both included
    #[arg(long, default_value_t = 11, conflicts_with = "weights")]
    frames: usize,
    /// One blend instead of frames: a weight a mesh, for example 0.3,0.7
    #[arg(long, value_delimiter = ',', allow_hyphen_values = true)]
    weights: Option<Vec<f64>>,
    /// Vertices that carry position, turn and size, one index a line; chosen where the meshes differ least if not given
    #[arg(long)]
    anchors: Option<PathBuf>,
    /// Format of the frames
    #[arg(long, value_enum, default_value = "obj")]
    format: Format,
    /// The folder for the frames
    #[arg(long, short)]
    output: PathBuf,
}

/// Formats of the frames.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Format {
    Obj,
    Ply,
}

/// Most frames of one run.
const MOST: usize = 100_000;

pub(crate) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    if !(1..=MOST).contains(&arguments.frames) {
        return Err(usage("--frames", "the number is out of range", "Give a number from 1 to 100000"));
    }
    let extension = match arguments.format {
        Format::Obj => "obj",
        Format::Ply => "ply",
    };
    let mut session = Session::start_on_cpu(common)?;
    let meshes: Vec<Mesh> = arguments.meshes.iter().map(|p| session.mesh(p).map(|s| s.mesh)).collect::<Result<_>>()?;
    let anchors = arguments.anchors.as_ref().map(read_vertex_list).transpose()?;
    let borrowed: Vec<&Mesh> = meshes.iter().collect();
    let mut morpher = Morpher::new(&borrowed, anchors.as_deref(), &HierarchyOptions::default())?;
    for warning in &morpher.warnings {
        session.warn(&format!("{}: {warning}", morpher.name()));
    }
    session.watch.lap("prepare");
    let frames = match &arguments.weights {
        Some(weights) => vec![weights.clone()],
        None => path(meshes.len(), arguments.frames),
    };
    std::fs::create_dir_all(&arguments.output)
        .map_err(|e| Error::io(&arguments.output, e, "Name a folder that can be made"))?;
    session.progress().stage("morphing", frames.len() as u64);
    let mut written = Vec::new();
    let mut mesh = meshes[0].clone();
    // Normals of an in-between would be wrong: readers make their own.
    mesh = without_normals(&mesh);
    for (k, weights) in frames.iter().enumerate() {
        let (positions, report) = morpher.shape(weights, &QUALITY)?;
        mesh.positions = positions;
        let file = arguments.output.join(format!("frame_{k:04}.{extension}"));
        match arguments.format {
            Format::Obj => barymap::io::write_obj(&mesh, &file)?,
            Format::Ply => barymap::io::write_ply(&mesh, None, &file)?,
        }
        let g = report.levels.last().map_or(0.0, |l| l.after);
        written.push(json!({"weights": weights, "g": g, "iterations": report.iterations()}));
        session.progress().advance(1);
    }
    session.watch.lap("morph");
    session.say(&format!("{}: {} frames", arguments.output.display(), frames.len()));
    let mut report = session.report("morph");
    report["anchors"] = json!(morpher.anchors());
    report["frames"] = written.into();
    session.write_report(&report)
}

/// Weights of `count` frames that pass through `meshes` meshes at equal distances.
fn path(meshes: usize, count: usize) -> Vec<Vec<f64>> {
    let last = (meshes - 1) as f64;
    (0..count)
        .map(|k| {
            let t = if count == 1 { 0.0 } else { last * k as f64 / (count - 1) as f64 };
            (0..meshes).map(|m| (1.0 - (t - m as f64).abs()).max(0.0)).collect()
        })
        .collect()
}

/// The same mesh with corners that name no normal.
fn without_normals(mesh: &Mesh) -> Mesh {
    use barymap::geometry::{Corner, MeshBuilder, NONE};
    let mut builder = MeshBuilder::new(mesh.name.clone());
    builder.mesh.positions = mesh.positions.clone();
    builder.mesh.texcoords = mesh.texcoords.clone();
    builder.mesh.materials = mesh.materials.clone();
    builder.mesh.groups = mesh.groups.clone();
    for p in 0..mesh.polygon_count() {
        (builder.material, builder.group) = (mesh.polygon_material(p), mesh.polygon_group(p));
        builder.polygon(mesh.polygon(p).iter().map(|c| Corner { normal: NONE, ..*c }));
    }
    builder.build()
}
