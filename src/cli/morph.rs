//! `barymap morph`: in-betweens and blends of meshes, of the same connectivity or brought to it.

use std::path::{Path, PathBuf};

use glam::DVec3;
use serde_json::{Value, json};

use crate::cli::common::{Common, EmbeddingArguments, Session, Surface, anchor_pairs, check_outputs, usage};
use crate::cli::method::{MethodArguments, prepare};
use crate::cli::model_file::{ModelFormat, New, warn_of_loss, write_animation, write_model};
use crate::cli::needs;
use crate::encoding::{DecodeReport, HierarchyOptions, MarchQuality};
use crate::geometry::Mesh;
use crate::geometry::weld::weld_alike;
use crate::io::{GlbAnimation, GltfScene, MorphForm, read_mask, read_vertices_on};
use crate::surface::AnchorPairs;
use crate::tools::animate::frames::{FrameFolder, FrameFormat};
use crate::tools::cage::pose;
use crate::tools::morph::{CompatibleReport, FrameReport, FrameWatch, Morpher, compatible_mesh, without_normals};
use crate::words::words;
use crate::{Error, Result};

#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// Two or more meshes of the same connectivity, or of any with --pairs; with --frames they are
    /// passed through in this order. A turn by more than 180 degrees needs a mesh on the way
    #[arg(required = true, num_args = 2..)]
    meshes: Vec<PathBuf>,
    /// Pairs of anchors of the first mesh ("source") and the second ("target"), which then may be
    /// of any connectivity: it takes that of the first. For more meshes repeat it, once for each
    /// after the first
    #[arg(long)]
    pairs: Vec<String>,
    /// With --pairs: write the first mesh in the shape of the last (OBJ or PLY)
    #[arg(long, requires = "pairs")]
    compatible: Option<PathBuf>,
    /// Number of frames from the first mesh to the last, both included; with a mask, from the mesh
    /// that rules at the anchors to the blend
    #[arg(long, conflicts_with = "weights")]
    frames: Option<usize>,
    /// One blend instead of frames: a weight a mesh, for example 0.3,0.7
    #[arg(long, value_delimiter = ',', allow_hyphen_values = true)]
    weights: Option<Vec<f64>>,
    /// One blend with weights of its own at every vertex: a text file with the share of the second
    /// mesh (0 to 1) a line, or a PLY of the mesh painted white where the second one shall be; for
    /// more meshes see the documentation
    #[arg(long, conflicts_with = "weights")]
    mask: Option<PathBuf>,
    /// Vertices that carry position, turn and size, one index a line; chosen where the meshes
    /// differ least if not given
    #[arg(long)]
    anchors: Option<PathBuf>,
    /// How far the minimisation goes
    #[arg(long, value_enum, default_value = "default")]
    quality: QualityName,
    /// Format of the files in a folder
    #[arg(long, value_enum, default_value = "obj")]
    format: FrameFormat,
    /// Seconds that the animation of a GLB takes
    #[arg(long, default_value_t = 2.0)]
    seconds: f64,
    /// A folder for the frames, or an animation as OUT.glb; one blend alone may also be OUT.obj or
    /// OUT.ply
    #[arg(long, short)]
    output: PathBuf,
    #[command(flatten)]
    method: MethodArguments,
    #[command(flatten)]
    embedding: EmbeddingArguments,
}

/// Names of the qualities.
#[derive(Clone, Copy, Debug)]
enum QualityName {
    Preview,
    Default,
    Converged,
}

words! { QualityName, "quality", "a quality":
    Preview => "preview" "Coarse stages solved, then vertex splits",
    Default => "default" "One direct step on the whole mesh; of several frames conjugate gradients",
    Converged => "converged" "To the minimum",
}

impl QualityName {
    /// For `count` in-betweens.
    fn quality(self, count: usize) -> MarchQuality {
        match self {
            Self::Preview => MarchQuality::PREVIEW,
            Self::Default if count > 1 => MarchQuality::FRAMES,
            Self::Default => MarchQuality::DEFAULT,
            Self::Converged => MarchQuality::CONVERGED,
        }
    }
}

/// Most frames of one run.
const MOST: usize = 10_000;
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
        return Err(usage("--frames", "the number is out of range", "Give a number from 1 to 10000"));
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
    check_outputs(arguments.compatible.as_deref())?;
    let others = arguments.meshes.len().saturating_sub(1);
    if !arguments.pairs.is_empty() && arguments.pairs.len() != others {
        let what = format!("{} files for {others} meshes after the first", arguments.pairs.len());
        return Err(usage("--pairs", &what, "Give one for each, in their order"));
    }
    let mut session = Session::start_on_cpu(common)?;
    let mut surfaces: Vec<Surface> = arguments.meshes.iter().map(|p| session.mesh(p)).collect::<Result<_>>()?;
    let mut brought: Vec<Value> = Vec::new();
    for (k, pairs) in arguments.pairs.iter().enumerate() {
        let (first, rest) = surfaces.split_at_mut(1);
        let report = bring(&mut session, &mut first[0], &mut rest[k], pairs, arguments)?;
        brought.push(describe(&report));
    }
    if let (Some(path), Some(last)) = (&arguments.compatible, surfaces.last()) {
        write_mesh(&session, &last.mesh, path)?;
    }
    let scene = surfaces.first().and_then(|s| s.scene.clone());
    if !glb {
        warn_of_loss(&session, scene.as_deref(), &arguments.output);
    }
    let mut meshes: Vec<Mesh> = surfaces.into_iter().map(|s| s.mesh).collect();
    if arguments.pairs.is_empty() {
        weld_alike(&mut meshes, common.weld)?;
    }
    let anchors = arguments.anchors.as_ref().map(|path| read_vertices_on(path, &meshes[0])).transpose()?;
    let borrowed: Vec<&Mesh> = meshes.iter().collect();
    // Ends of a sequence are there already.
    let need = if single || count > 2 { needs::MORPH } else { needs::ENDS };
    need.check(&meshes[0], if glb { count } else { 0 })?;
    let mut morpher = Morpher::new(&borrowed, anchors.as_deref(), &HierarchyOptions::default())?;
    for warning in &morpher.warnings {
        session.warn(&format!("{}: {warning}", morpher.name()));
    }
    let mask =
        arguments.mask.as_ref().map(|path| read_mask(path, meshes[0].vertex_count(), meshes.len())).transpose()?;
    session.watch.lap("prepare");
    // Normals of an in-between would be wrong: readers make their own.
    let mut mesh = without_normals(&meshes[0]);
    let format = arguments.format;
    let mut target = match (file, glb) {
        (true, _) => Target::File(arguments.output.clone()),
        (_, true) => Target::Glb(Vec::new()),
        _ => Target::Folder(FrameFolder::create(&arguments.output, count, 0, format)?),
    };
    session.progress().stage("morphing", count as u64);
    let quality = arguments.quality.quality(count);
    let watch = FrameWatch::new(&meshes[0]);
    let ends: Vec<f64> = meshes.iter().map(|m| watch.measure(&m.positions).volume).collect();
    let (mut told, mut measured): (Vec<Value>, Vec<FrameReport>) = (Vec::new(), Vec::new());
    let mut keep = |how: Value, positions: Vec<DVec3>, report: &DecodeReport| -> Result<()> {
        let g = report.levels.last().map_or(0.0, |l| l.after);
        let m = watch.measure(&positions);
        let levels = report.levels.iter().map(|l| {
            json!({"free": l.free, "iterations": l.iterations, "gradient_steps": l.gradient_steps, "before": l.before, "after": l.after})
        });
        let levels: Vec<Value> = levels.collect();
        told.push(json!({
            "weights": how, "g": g, "iterations": report.iterations(), "levels": levels, "volume": m.volume, "stretch_all": m.stretch_all,
            "stretch_best95": m.stretch_best95, "inverted": m.inverted, "inverted_area": m.inverted_area,
        }));
        measured.push(m);
        match &mut target {
            Target::Folder(folder) => folder.write(&mesh, &positions)?,
            Target::Glb(frames) => frames.push(positions),
            Target::File(path) => {
                mesh.positions = positions;
                write_mesh(&session, &mesh, path)?;
            }
        }
        session.progress().advance(1);
        Ok(())
    };
    match &mask {
        Some(mask) => {
            let share = |k: usize| if count == 1 { 1.0 } else { k as f64 / (count - 1) as f64 };
            let times: Vec<f64> = (0..count).map(share).collect();
            morpher.toward_mask(mask, &times, &quality, |k, shape, report| keep(json!(times[k]), shape, &report))?;
        }
        None => {
            let all = match &arguments.weights {
                Some(weights) => vec![weights.clone()],
                None => path(meshes.len(), count),
            };
            morpher.frames(&all, &quality, |k, shape, report| keep(json!(all[k]), shape, &report))?;
        }
    }
    session.watch.lap("morph");
    let mut report = session.report("morph");
    let written = match target {
        Target::File(_) => "one blend".to_owned(),
        Target::Folder(folder) => format!("{} files", folder.finish()?),
        Target::Glb(frames) => {
            let what =
                write_frames(&session, &arguments.output, &meshes[0], scene.as_deref(), frames, arguments.seconds)?;
            report["bytes"] = json!(std::fs::metadata(&arguments.output).map_or(0, |m| m.len()));
            what
        }
    };
    session.watch.lap("write");
    let inverted = measured.iter().map(|m| m.inverted).max().unwrap_or(0);
    session.say(&format!("{}: {written}; at most {inverted} triangles inverted", arguments.output.display()));
    warn_of_volumes(&session, &ends, &measured);
    if !brought.is_empty() {
        report["compatible"] = brought.into();
    }
    report["volumes"] = json!(ends);
    report["anchors"] = json!(morpher.anchors());
    report["frames"] = told.into();
    session.write_report(&report)
}

fn write_mesh(session: &Session<'_>, mesh: &Mesh, path: &Path) -> Result<()> {
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("ply")) {
        crate::io::write_ply(mesh, None, path)
    } else {
        session.write_obj(mesh, path)
    }
}

/// The first frame as the mesh, the others as morph targets.
fn write_frames(
    session: &Session<'_>,
    path: &Path,
    first: &Mesh,
    scene: Option<&GltfScene>,
    mut frames: Vec<Vec<DVec3>>,
    seconds: f64,
) -> Result<String> {
    if frames.len() == 1 {
        let mut blend = first.clone();
        pose(&mut blend, frames.pop().unwrap_or_default())?;
        write_model(session, &blend, scene, New::Shape, ModelFormat::Glb, path)?;
        return Ok("one blend".into());
    }
    let last = (frames.len() - 1) as f64;
    let times: Vec<f32> = (0..frames.len()).map(|k| (seconds * k as f64 / last) as f32).collect();
    let frames: Vec<Vec<glam::Vec3>> = frames.iter().map(|f| f.iter().map(|p| p.as_vec3()).collect()).collect();
    let animation =
        GlbAnimation { name: "morph", times: &times, frames: &frames, placements: &[], form: MorphForm::Auto };
    // Normals of an in-between would be wrong in the mesh itself; a scene turns those that it has.
    let mesh = without_normals(first);
    let done = write_animation(session, &mesh, scene, &animation, path)?;
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

/// Fewest pairs of anchors between meshes of different connectivity.
const FEWEST: usize = 4;

/// Gives `other` the connectivity of `first`, by pairs of anchors.
fn bring(
    session: &mut Session<'_>,
    first: &mut Surface,
    other: &mut Surface,
    pairs: &str,
    arguments: &Arguments,
) -> Result<CompatibleReport> {
    // The correspondence goes from the mesh that receives to the one that is looked up: from the
    // first to the other.
    let anchors = anchor_pairs(pairs, first, other, session)?;
    if anchors.len() < FEWEST {
        let what = format!("{pairs}: {} pairs are too few", anchors.len());
        return Err(Error::input(what, "Give four or more, better twenty, on all limbs"));
    }
    let anchors = AnchorPairs { source: anchors.target, target: anchors.source };
    let map = prepare(session, other, first, &anchors, arguments.method, &arguments.embedding)?;
    let (from, to) = ((&first.mesh, &first.topology), (&other.mesh, &other.topology));
    let made = compatible_mesh(from, to, map.as_ref(), &anchors.target)?;
    session.watch.lap("compatible");
    let r = made.report;
    session.say(&format!(
        "{}: stretch efficiency (best 95 %) {:.3}, {} triangles turned over or collapsed, {} after mending ({:.2} % of the area), {} edges more than {} times as long",
        made.mesh.name,
        r.stretch_best95,
        r.bad_before,
        r.bad,
        100.0 * r.bad_area,
        r.long_edges,
        crate::tools::morph::LONG
    ));
    if r.bad_area > 0.05 {
        session.warn("much of it is folded: check that the pairs do not contradict one another, or give more");
    }
    // Its own embedding belongs to the other connectivity.
    *other = Surface {
        topology: crate::geometry::Topology::new(&made.mesh),
        mesh: made.mesh,
        embedding: None,
        scene: None,
        notes: Vec::new(),
    };
    Ok(r)
}

fn describe(r: &CompatibleReport) -> Value {
    json!({
        "valid": r.valid, "doubtful": r.doubtful, "filled": r.filled, "bad_before": r.bad_before, "bad": r.bad, "bad_area": r.bad_area,
        "moved": r.moved, "off": r.off, "stretch_all": r.stretch_all, "stretch_best95": r.stretch_best95, "long_edges": r.long_edges,
    })
}

/// Tells of in-betweens that collapse or swell.
fn warn_of_volumes(session: &Session<'_>, ends: &[f64], frames: &[FrameReport]) {
    let least = ends.iter().copied().fold(f64::INFINITY, f64::min);
    let most = ends.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if !(least > 0.0) {
        return;
    }
    let outside = frames.iter().filter(|f| !(f.volume >= 0.8 * least && f.volume <= 1.2 * most)).count();
    if outside > 0 {
        session.warn(&format!("{outside} frames have a volume far from those of the meshes: see the report"));
    }
}
