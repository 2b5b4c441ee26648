//! `barymap animate`: sets a mesh in motion by markers or joints.

use std::path::{Path, PathBuf};
use std::time::Instant;

use glam::DVec3;
use serde_json::json;

use crate::Result;
use crate::cli::common::{Common, Session, Surface, check_outputs, usage};
use crate::cli::model_file::{warn_of_loss, write_animation};
use crate::cli::needs;
use crate::cli::shard::{Part, Shard, part, shard};
use crate::cli::verdict::Verdict;
use crate::encoding::{Quality, SequenceQuality};
use crate::geometry::Mesh;
use crate::io::{GlbAnimation, MorphForm, Motion, read_markers, read_motion};
use crate::tools::animate::frames::{FrameFolder, FrameFormat, contact_sheet};
use crate::tools::animate::{
    AnimateOptions, Binding, FrameQuality, GapOptions, Interpolation, Reference, animate, fullest_frame, guess,
    without_rigid_motion,
};
use crate::tools::render::{Coloring, RenderOptions};
use crate::words::words;

/// Frames per second that are written unless others are asked for.
const RATE: f64 = 30.0;
/// Pictures on a contact sheet.
const PICTURES: usize = 12;

#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// The mesh: OBJ, PLY, OFF, glTF or GLB
    mesh: PathBuf,
    /// The clip: C3D, TRC, CSV, BVH, AMC, or SKELETON.asf,CLIP.amc
    #[arg(long)]
    motion: PathBuf,
    /// Which vertices markers or joints move: JSON {"LKNE": 4711, "HEAD": [x, y, z], "LeftArm":
    /// {"vertices": [17, 29]}}; without it they are guessed
    #[arg(long)]
    markers: Option<PathBuf>,
    /// The pose of the clip that is the mesh's: a frame counted from 0, or `rest` for a skeleton
    /// with all rotations zero
    #[arg(long, value_parser = reference)]
    reference: Option<Reference>,
    /// First frame of the clip
    #[arg(long, default_value_t = 0)]
    first: usize,
    /// The frame after the last; the end of the clip if it is not given
    #[arg(long)]
    end: Option<usize>,
    /// Frames per second to make: every so manieth of the clip is taken
    #[arg(long, default_value_t = RATE)]
    rate: f64,
    /// Only the frames A, A + 1, ... B - 1 of those that are made, counted from 0; with --quality
    /// preview or default they are those of a whole run, to the last bit
    #[arg(long, value_parser = part, value_name = "A..B", conflicts_with = "shard")]
    range: Option<Part>,
    /// Only part I of N, counted from 1, of the frames that are made
    #[arg(long, value_parser = shard, value_name = "I/N")]
    shard: Option<Shard>,
    /// Longest gap that is interpolated, in seconds; over longer ones a marker moves with those
    /// around it
    #[arg(long, default_value_t = GapOptions::default().longest)]
    gap: f64,
    /// How short gaps are closed
    #[arg(long, value_enum, default_value = "cubic")]
    interpolation: Interpolation,
    /// How far the frames are minimised: preview or default follow the shape in the large and make
    /// the rest afresh; fine and converged solve each frame
    #[arg(long, value_enum, default_value = "default")]
    quality: QualityName,
    /// Keeps the lengths of edges, so that parts with few markers keep their size; 0 is plain
    /// encoding
    #[arg(long, default_value_t = 1.0)]
    stiffness: f64,
    /// Largest distance of a vertex from its place in a GLB, in the mesh's units; 0 stores every
    /// frame
    #[arg(long)]
    tolerance: Option<f64>,
    /// End with exit code 3 if the result is not usable
    #[arg(long)]
    strict: bool,
    /// A picture of twelve frames
    #[arg(long)]
    sheet: Option<PathBuf>,
    /// Camera of the picture: azimuth and elevation in degrees
    #[arg(long, default_value = "35,8", value_parser = crate::cli::render::view, allow_hyphen_values = true)]
    view: (f64, f64),
    /// The animation as OUT.glb, or a new folder of numbered OBJ or PLY files
    #[arg(long, short)]
    output: PathBuf,
    /// Format of the files in a folder
    #[arg(long, value_enum, default_value = "obj")]
    format: FrameFormat,
}

#[derive(Clone, Copy, Debug)]
enum QualityName {
    Preview,
    Default,
    Fine,
    Converged,
}

words! { QualityName, "quality", "a quality":
    Preview => "preview",
    Default => "default",
    Fine => "fine",
    Converged => "converged",
}

fn reference(text: &str) -> std::result::Result<Reference, String> {
    if text.eq_ignore_ascii_case("rest") {
        return Ok(Reference::Rest);
    }
    text.parse().map(Reference::Frame).map_err(|_| format!("{text:?} is no pose: write a frame number or rest"))
}

impl QualityName {
    fn quality(self, stiffness: f64) -> FrameQuality {
        match self {
            Self::Preview => FrameQuality::Sequence(SequenceQuality { stiffness, ..SequenceQuality::PREVIEW }),
            Self::Default => FrameQuality::Sequence(SequenceQuality { stiffness, ..SequenceQuality::DEFAULT }),
            Self::Fine => FrameQuality::Single(Quality { stiffness, ..Quality::DEFAULT }),
            Self::Converged => FrameQuality::Single(Quality { stiffness, ..Quality::CONVERGED }),
        }
    }
}

pub(crate) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    let glb = arguments.output.extension().is_some_and(|e| e.eq_ignore_ascii_case("glb"));
    check_outputs(arguments.sheet.iter().map(PathBuf::as_path).chain(glb.then_some(arguments.output.as_path())))?;
    if let Some(sheet) = &arguments.sheet {
        crate::io::image_file::check_image_extension(sheet)?;
    }
    for (name, value) in [("--rate", arguments.rate), ("--gap", arguments.gap + 1e-9)] {
        if !(value > 0.0) || !value.is_finite() {
            return Err(usage(name, &format!("{value}"), "Give a positive number"));
        }
    }
    if !(arguments.stiffness >= 0.0) || !arguments.stiffness.is_finite() {
        return Err(usage("--stiffness", &format!("{}", arguments.stiffness), "Give a number from 0"));
    }
    if let Some(tolerance) = arguments.tolerance.filter(|t| !(0.0..f64::INFINITY).contains(t)) {
        return Err(usage("--tolerance", &format!("{tolerance}"), "Give a distance, or 0 to store every frame"));
    }
    let mut session = Session::start_on_cpu(common)?;
    let whole = read_motion(&arguments.motion)?;
    for warning in &whole.warnings {
        session.warn(&format!("{}: {warning}", arguments.motion.display()));
    }
    let surface = session.mesh(&arguments.mesh)?;
    let binding = bind(arguments, &whole, &surface)?;
    session.watch.lap("bind");
    let size = surface.mesh.bounds().map_or(1.0, |(low, high)| low.distance(high));
    session.say(&format!(
        "{} points of {} on {} vertices, scale {:.4e}, {:.2} % of the mesh's diagonal between them (rms)",
        binding.points().len(),
        arguments.motion.display(),
        binding.bonds.len(),
        binding.fit.scale,
        100.0 * binding.rms() / size,
    ));
    let step = (whole.rate / arguments.rate).round().max(1.0) as usize;
    let motion = whole.part(arguments.first, arguments.end.unwrap_or(usize::MAX), 1)?;
    let total = motion.frames.len().div_ceil(step);
    let part = match (arguments.range, arguments.shard) {
        (Some(range), _) => range.of(total).unwrap_or_default(),
        (None, Some(shard)) => shard.part(total),
        (None, None) => 0..total,
    };
    if part.is_empty() {
        let (name, what) = match arguments.shard {
            Some(_) => ("--shard", "a part is empty"),
            None => ("--range", "it reaches beyond the clip"),
        };
        return Err(usage(name, what, &format!("There are {total} frames to make")));
    }
    let options = AnimateOptions {
        quality: arguments.quality.quality(arguments.stiffness),
        gaps: GapOptions { longest: arguments.gap, interpolation: arguments.interpolation },
        step,
        part: [part.start, part.end],
    };
    if !glb {
        warn_of_loss(&session, surface.scene.as_deref(), &arguments.output);
    }
    let count = part.len();
    needs::ANIMATE.check(&surface.mesh, if glb { count } else { 0 })?;
    let format = arguments.format;
    let mut folder = (!glb).then(|| FrameFolder::create(&arguments.output, total, part.start, format)).transpose()?;
    let wanted: Vec<usize> = (0..PICTURES.min(count)).map(|k| k * count / PICTURES.min(count)).collect();
    let (mut frames, mut placements, mut pictured) = (Vec::new(), Vec::new(), Vec::new());
    let clock = Instant::now();
    let mesh = &surface.mesh;
    let report =
        animate(mesh, &whole, &motion, &binding, &options, session.cache(), session.progress(), |f, shape| {
            if let Some(folder) = &mut folder {
                folder.write(mesh, &shape)?;
            } else {
                let (local, placement) = without_rigid_motion(mesh, &shape);
                frames.push(local);
                placements.push(placement);
            }
            if arguments.sheet.is_some() && wanted.contains(&(f - part.start)) {
                pictured.push(shape);
            }
            Ok(())
        })?;
    let rate = count as f64 / clock.elapsed().as_secs_f64();
    session.watch.lap("decode");
    for warning in &report.warnings {
        session.warn(warning);
    }
    for gap in &report.gaps {
        let text = format!(
            "marker {}: {} frames interpolated, {} carried by the markers around it (longest gap {})",
            gap.name, gap.interpolated, gap.released, gap.longest
        );
        session.warn(&text);
    }
    if !report.found_anew.is_empty() {
        let first: Vec<String> = report.found_anew.iter().take(8).map(usize::to_string).collect();
        let what =
            "the frame before does not lead there, so the mesh may jump (markers that jump, or few frames a second)";
        session.warn(&format!("{} frames (first: {}): {what}", report.found_anew.len(), first.join(", ")));
    }
    let mut document = session.report("animate");
    let written = match folder {
        Some(folder) => format!("{} files", folder.finish()?),
        None => {
            let times: Vec<f32> = part.clone().map(|f| (f as f64 * step as f64 / motion.rate) as f32).collect();
            let form = match arguments.tolerance {
                None => MorphForm::Auto,
                Some(tolerance) if tolerance > 0.0 => MorphForm::Components { tolerance },
                Some(_) => MorphForm::Frames,
            };
            let name = arguments.motion.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            let animation = GlbAnimation { name: &name, times: &times, frames: &frames, placements: &placements, form };
            let glb = write_animation(&session, mesh, surface.scene.as_deref(), &animation, &arguments.output)?;
            document["targets"] = json!(glb.targets);
            document["largest_error"] = json!(glb.largest_error);
            document["bytes"] = json!(glb.bytes);
            let kind = if glb.components { "components" } else { "frames" };
            format!(
                "{:.1} MB, {} {kind} as morph targets, every vertex within {:.1e} of its place",
                glb.bytes as f64 / 1e6,
                glb.targets,
                glb.largest_error
            )
        }
    };
    if let Some(sheet) = &arguments.sheet {
        // A GLB has told it.
        if !glb {
            session.warn_of_up(mesh);
        }
        picture(mesh, &pictured, arguments, sheet, &session)?;
    }
    session.watch.lap("write");
    session.say(&format!("{}: {count} frames, {rate:.1} a second; {written}", arguments.output.display()));
    for (key, value) in [
        ("frames", json!(count)),
        ("frames_per_second", json!(rate)),
        ("bound_vertices", json!(binding.bonds.len())),
        ("fit_rms", json!(binding.rms())),
        ("fit_scale", json!(binding.fit.scale)),
        ("found_anew", json!(report.found_anew)),
    ] {
        document[key] = value;
    }
    let mut verdict = Verdict::default();
    verdict.share(binding.rms() / size, 0.03, 0.15, "of the mesh's diagonal lie between markers and vertices (rms)");
    let anew = report.found_anew.len() as f64 / count as f64;
    verdict.share(anew, 0.0, 0.5, "of the frames do not follow from the one before");
    document["verdict"] = verdict.describe();
    session.write_report(&document)?;
    let remedy =
        "Name the vertices of the markers with --markers, and the frame that has the mesh's pose with --reference";
    verdict.tell(&session, arguments.strict, remedy)
}

/// By the file, or by shape alone.
fn bind(arguments: &Arguments, motion: &Motion, surface: &Surface) -> Result<Binding> {
    let all: Vec<usize> = (0..motion.point_count()).collect();
    match &arguments.markers {
        Some(path) => {
            let places = read_markers(path)?;
            let named: Vec<usize> = places.iter().map(|(name, _)| motion.index_of(name)).collect::<Result<_>>()?;
            let reference = arguments.reference.unwrap_or_else(|| Reference::Frame(fullest_frame(motion, &named)));
            Binding::given(motion, &surface.mesh, &places, reference)
        }
        None => {
            if let Some(reference) = arguments.reference {
                return guess(motion, &surface.mesh, reference);
            }
            let first = guess(motion, &surface.mesh, Reference::Frame(fullest_frame(motion, &all)))?;
            if motion.skeleton.is_none() {
                return Ok(first);
            }
            // Of a skeleton's first pose and its rest the one that lies nearer to the mesh.
            let rest = guess(motion, &surface.mesh, Reference::Rest)?;
            Ok(if rest.rms() < first.rms() { rest } else { first })
        }
    }
}

/// The contact sheet, in plain grey: what counts is the shape.
fn picture(
    mesh: &Mesh,
    shapes: &[Vec<DVec3>],
    arguments: &Arguments,
    path: &Path,
    session: &Session<'_>,
) -> Result<()> {
    let options = RenderOptions {
        width: 360,
        height: 480,
        up: session.up(),
        azimuth: arguments.view.0,
        elevation: arguments.view.1,
        ..RenderOptions::default()
    };
    let sheet = contact_sheet(mesh, Coloring::Plain([190, 190, 196]), shapes, 6, &options)?;
    crate::io::write_image(&sheet, path)
}
