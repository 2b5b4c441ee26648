//! `barymap morph`: in-betweens and blends of meshes of the same connectivity.

use std::path::{Path, PathBuf};

use barymap::Result;
use barymap::encoding::{DecodeReport, HierarchyOptions};
use barymap::geometry::Mesh;
use barymap::io::gltf_write::own_materials;
use barymap::io::{GlbAnimation, MorphForm, read_mask, read_vertex_list, write_animated_glb, write_glb};
use barymap::tools::animate::frames::{FrameFolder, FrameFormat};
use barymap::tools::morph::{Morpher, QUALITY};
use clap::ValueEnum;
use glam::DVec3;
use serde_json::{Value, json};

use crate::common::{Common, Session, check_outputs, usage};

#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// Two or more meshes of the same connectivity; with --frames they are passed through in this order. A turn by more than 180 degrees needs a mesh
    /// on the way
    #[arg(required = true, num_args = 2..)]
    meshes: Vec<PathBuf>,
    /// Number of frames from the first mesh to the last, both included; with a mask, from the mesh that rules at the anchors to the blend
    #[arg(long, conflicts_with = "weights")]
    frames: Option<usize>,
    /// One blend instead of frames: a weight a mesh, for example 0.3,0.7
    #[arg(long, value_delimiter = ',', allow_hyphen_values = true)]
    weights: Option<Vec<f64>>,
    /// One blend with weights of its own at every vertex: a text file with the share of the second mesh (0 to 1) a line, or a PLY of the mesh painted white
    /// where the second one shall be; for more meshes see the documentation
    #[arg(long, conflicts_with = "weights")]
    mask: Option<PathBuf>,
    /// Vertices that carry position, turn and size, one index a line; chosen where the meshes differ least if not given
    #[arg(long)]
    anchors: Option<PathBuf>,
    /// Format of the files in a folder
    #[arg(long, value_enum, default_value = "obj")]
    format: Format,
    /// Seconds that the animation of a GLB takes
    #[arg(long, default_value_t = 2.0)]
    seconds: f64,
    /// A folder for the frames, or an animation as OUT.glb; one blend alone may also be OUT.obj or OUT.ply
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
/// Frames without a number given.
const FRAMES: usize = 11;

/// Where the shapes go.
enum Target {
    File(PathBuf),
    Glb(Vec<Vec<DVec3>>),
    Folder(FrameFolder),
}

pub(crate) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    let single = arguments.weights.is_some() || (arguments.mask.is_some() && arguments.frames.is_none());
    let count = if single { 1 } else { arguments.frames.unwrap_or(FRAMES) };
    if !(1..=MOST).contains(&count) {
        return Err(usage("--frames", "the number is out of range", "Give a number from 1 to 100000"));
    }
    if !(arguments.seconds > 0.0) || !arguments.seconds.is_finite() {
        return Err(usage("--seconds", &format!("{}", arguments.seconds), "Give a positive number"));
    }
    let extension = arguments.output.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let glb = extension == "glb";
    let file = single && (extension == "obj" || extension == "ply");
    if glb || file {
        check_outputs([arguments.output.as_path()])?;
    }
    let mut session = Session::start_on_cpu(common)?;
    let meshes: Vec<Mesh> = arguments.meshes.iter().map(|p| session.mesh(p).map(|s| s.mesh)).collect::<Result<_>>()?;
    let anchors = arguments.anchors.as_ref().map(read_vertex_list).transpose()?;
    let borrowed: Vec<&Mesh> = meshes.iter().collect();
    let mut morpher = Morpher::new(&borrowed, anchors.as_deref(), &HierarchyOptions::default())?;
    for warning in &morpher.warnings {
        session.warn(&format!("{}: {warning}", morpher.name()));
    }
    let mask =
        arguments.mask.as_ref().map(|path| read_mask(path, meshes[0].vertex_count(), meshes.len())).transpose()?;
    session.watch.lap("prepare");
    // Normals of an in-between would be wrong: readers make their own.
    let mut mesh = without_normals(&meshes[0]);
    let format = match arguments.format {
        Format::Obj => FrameFormat::Obj,
        Format::Ply => FrameFormat::Ply,
    };
    let mut target = match (file, glb) {
        (true, _) => Target::File(arguments.output.clone()),
        (_, true) => Target::Glb(Vec::new()),
        _ => Target::Folder(FrameFolder::create(&arguments.output, count, format)?),
    };
    session.progress().stage("morphing", count as u64);
    let mut told: Vec<Value> = Vec::new();
    let mut keep = |how: Value, positions: Vec<DVec3>, report: &DecodeReport| -> Result<()> {
        let g = report.levels.last().map_or(0.0, |l| l.after);
        told.push(json!({"weights": how, "g": g, "iterations": report.iterations()}));
        match &mut target {
            Target::Folder(folder) => folder.write(&mesh, &positions)?,
            Target::Glb(frames) => frames.push(positions),
            Target::File(path) => {
                mesh.positions = positions;
                write_mesh(&mesh, path)?;
            }
        }
        session.progress().advance(1);
        Ok(())
    };
    match &mask {
        Some(mask) => {
            let share = |k: usize| if count == 1 { 1.0 } else { k as f64 / (count - 1) as f64 };
            let times: Vec<f64> = (0..count).map(share).collect();
            morpher.toward_mask(mask, &times, &QUALITY, |k, shape, report| keep(json!(times[k]), shape, &report))?;
        }
        None => {
            let all = match &arguments.weights {
                Some(weights) => vec![weights.clone()],
                None => path(meshes.len(), count),
            };
            for weights in all {
                let (positions, report) = morpher.shape(&weights, &QUALITY)?;
                keep(json!(weights), positions, &report)?;
            }
        }
    }
    session.watch.lap("morph");
    let mut report = session.report("morph");
    let written = match target {
        Target::File(_) => "one blend".to_owned(),
        Target::Folder(folder) => format!("{} files", folder.finish()?),
        Target::Glb(frames) => {
            let what = write_frames(&arguments.output, mesh, frames, arguments.seconds)?;
            report["bytes"] = json!(std::fs::metadata(&arguments.output).map_or(0, |m| m.len()));
            what
        }
    };
    session.watch.lap("write");
    session.say(&format!("{}: {written}", arguments.output.display()));
    report["anchors"] = json!(morpher.anchors());
    report["frames"] = told.into();
    session.write_report(&report)
}

fn write_mesh(mesh: &Mesh, path: &Path) -> Result<()> {
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("ply")) {
        barymap::io::write_ply(mesh, None, path)
    } else {
        barymap::io::write_obj(mesh, path)
    }
}

/// The first frame as the mesh, the others as morph targets.
fn write_frames(path: &Path, mut mesh: Mesh, mut frames: Vec<Vec<DVec3>>, seconds: f64) -> Result<String> {
    let materials = own_materials(&mesh)?;
    if frames.len() == 1 {
        mesh.positions = frames.pop().unwrap_or_default();
        write_glb(path, &mesh, &materials)?;
        return Ok("one blend".into());
    }
    let last = (frames.len() - 1) as f64;
    let times: Vec<f32> = (0..frames.len()).map(|k| (seconds * k as f64 / last) as f32).collect();
    let frames: Vec<Vec<glam::Vec3>> = frames.iter().map(|f| f.iter().map(|p| p.as_vec3()).collect()).collect();
    let animation =
        GlbAnimation { name: "morph", times: &times, frames: &frames, placements: &[], form: MorphForm::Auto };
    let done = write_animated_glb(path, &mesh, &materials, &animation)?;
    Ok(format!("{} frames, {} morph targets, {:.1} MB", frames.len(), done.targets, done.bytes as f64 / 1e6))
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
