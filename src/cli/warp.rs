//! `barymap warp`: a picture bent by a cage.

mod look;

use std::path::PathBuf;

use serde_json::{Value, json};

use crate::cli::cage_map::{CageMap, MappingArguments};
use crate::cli::common::{Common, Session, check_outputs, size, usage};
use crate::cli::needs::{Room, with_what_is_left};
use crate::cli::pictures::Quality;
use crate::cli::repeated::Repeated;
use crate::cli::shard::{Part, Shard, part, shard};
use crate::io::cage::CageUnits;
use crate::io::finite;
use crate::io::image_file::{Metadata, Picture};
use crate::mapping::plane::{CompositeMap, Coordinates, jacobian_min};
use crate::picture::Image;
use crate::tools::transfer::Encoding;
use crate::tools::warp::frames::{cut, times};
use crate::tools::warp::pictures::{heat_map, lattice_picture, overlay};
use crate::tools::warp::{Filter, Outside, Placement, WarpOptions, WarpOutput, warp_picture};
use crate::{Error, Result};
use look::{Look, Sink, animation, check_animation};

/// Most frames of a sequence.
const MOST_FRAMES: u32 = 100_000;
/// Cells along the longer side of the lattice of `--grid`.
const GRID_CELLS: u32 = 24;

#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// The picture: PNG, JPEG, TIFF, EXR, WebP, TGA, BMP, GIF, QOI, HDR or PNM; of an EXR file
    /// FILE.exr:LAYER names a layer or channel
    image: PathBuf,
    /// The warped picture: PNG, JPEG, TIFF, EXR, WebP, TGA, BMP or QOI
    #[arg(long, short)]
    output: PathBuf,
    #[command(flatten)]
    quality: Quality,
    #[command(flatten)]
    mapping: MappingArguments,
    /// How colours are taken from the picture
    #[arg(long, value_enum, default_value = "ewa")]
    filter: Filter,
    /// What is shown outside the target polygon, and in its holes: the map as it goes on there, the
    /// picture as it was, or nothing
    #[arg(long, value_enum, default_value = "map")]
    outside: Outside,
    /// Size of the result: WIDTHxHEIGHT, or one number for a square; the picture's own if not given
    #[arg(long = "size", alias = "canvas", value_parser = size)]
    canvas: Option<(u32, u32)>,
    /// Write a sequence from source to target instead: OUTPUT_0000.png and so on, which appear
    /// together at the end
    #[arg(long)]
    frames: Option<u32>,
    /// Only these frames of the sequence, counted from 0 as their files are: A..B without B, A.. or
    /// ..B; each is written when it is done
    #[arg(long, requires = "frames", value_parser = part, value_name = "A..B")]
    range: Option<Part>,
    /// Only the frames I, I + N, I + 2 N ... of the sequence or its range, counted from 1; each is
    /// written when it is done
    #[arg(long, requires = "frames", value_parser = shard, value_name = "I/N")]
    shard: Option<Shard>,
    /// Write a picture of the Jacobian, with its scale
    #[arg(long)]
    heatmap: Option<PathBuf>,
    /// Write a picture of a square lattice carried along
    #[arg(long)]
    grid: Option<PathBuf>,
    /// Write the result with the source (blue) and target (red) polygon on it
    #[arg(long)]
    overlay: Option<PathBuf>,
    /// Average light instead of stored values
    #[arg(long)]
    linear_light: bool,
    #[command(flatten)]
    look: Look,
}

pub(crate) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    arguments.look.check(arguments.outside)?;
    check_animation(arguments)?;
    let chosen = chosen(arguments)?;
    // An animation is one file, whatever its frames are called.
    let animated = animation(arguments).is_some();
    let outputs: Vec<PathBuf> = chosen.iter().filter(|_| !animated).map(|(_, output)| output.clone()).collect();
    let more = [&arguments.heatmap, &arguments.grid, &arguments.overlay];
    let pictures = || outputs.iter().chain(more.iter().copied().flatten()).map(PathBuf::as_path);
    let report = common.report.as_ref().into_iter();
    if let Some(file) = more.iter().copied().flatten().chain(report).find(|file| outputs.contains(file)) {
        let what = format!("{} is a frame of the sequence, too", file.display());
        return Err(usage("--frames", &what, "Give each output a name of its own"));
    }
    pictures().try_for_each(crate::io::image_file::check_image_extension)?;
    arguments.quality.check(pictures())?;
    // One of a sequence stands for all: they are in the same folder.
    check_outputs(animated.then_some(arguments.output.as_path()))?;
    check_outputs(outputs.iter().take(1).chain(more.into_iter().flatten()).map(PathBuf::as_path))?;
    let mut session = Session::start(common)?;
    let mut picture = session.picture(&arguments.image)?;
    arguments.quality.apply(&mut picture.metadata);
    if arguments.look.projective {
        return look::projective(&mut session, arguments, picture);
    }
    let Picture { image, metadata, .. } = picture;
    let (made, units) = CageMap::new(&mut session, &arguments.mapping)?;
    made.refuse_folds(&session, "warp")?;
    let options = options(&session, arguments, &image, units.unwrap_or(CageUnits::Pixel))?;
    // The frames of a whole sequence appear together, when the last one is done; those of a part
    // one by one.
    let whole = arguments.range.is_none() && arguments.shard.is_none();
    let first = outputs.first().filter(|_| arguments.frames.is_some() && whole);
    let mut sink = Sink::new(arguments, first.map(PathBuf::as_path))?;
    let frames = Frames::new(&session, &made, chosen)?;
    let (mut stats, mut seconds) = (Vec::new(), 0.0);
    let mut last: Option<WarpOutput> = None;
    // The frame whose notes stand for those of all.
    let mut told = None;
    let progress = Repeated::new(&session.bars, frames.list.len());
    for (k, frame) in frames.list.iter().enumerate() {
        let started = std::time::Instant::now();
        let jacobian = arguments.heatmap.is_some() && k + 1 == frames.list.len();
        let mut options = WarpOptions { jacobian, ..options.clone() };
        let mut warped = with_what_is_left(common, Room { there: bytes(&image), after: 0 }, |memory| {
            options.memory = memory;
            warp_picture(&session.engine, &image, &frame.map, &options, &progress)
        })?;
        let loops = options.target.loops(frame.map.target());
        warped.image = arguments.look.feathered(&session, &image, warped.image, &loops, &options)?;
        seconds += started.elapsed().as_secs_f64();
        session.watch.lap("warp");
        finite::picture(&frame.output, &warped.image, finite::is_finite(&image))?;
        let notes = sink.put(&warped.image, &metadata, &frame.output)?;
        if told.is_none() {
            session.warn_of(&notes, &frame.output);
        }
        told = told.or((!notes.is_empty()).then_some(k));
        session.watch.lap("write");
        stats.push(warped.stats.clone());
        last = Some(warped);
    }
    session.warn_of(&sink.finish(&metadata)?, &arguments.output);
    session.watch.lap("write");
    if let Some(k) = told.filter(|k| k + 1 < frames.list.len()) {
        session.warn(&format!("the {} frames after this one may lose as much", frames.list.len() - k - 1));
    }
    let Some(last) = last else { return Err(Error::option("--frames", "0", "Ask for one frame at least")) };
    let map = &frames.list[frames.list.len() - 1].map;
    about(&session, arguments, &options, map, &last, &metadata)?;
    session.watch.lap("pictures");

    let failed: u64 = stats.iter().map(|s| s.failed_inside).sum();
    if failed > 0 {
        session.warn(&format!("{failed} pixels inside the cage have no pre-image: the map folds there"));
    }
    let mut report = session.report("warp");
    made.describe(&mut report);
    session.report_stages(&mut report, "warp.", &last.stats.stages);
    let s = &last.stats;
    report["filter"] = json!(options.filter.word());
    report["outside"] = json!(options.outside.word());
    report["canvas"] = json!([last.image.width, last.image.height]);
    report["pixels"] = json!(s.pixels);
    report["mapped"] = json!(s.mapped);
    report["empty"] = json!(s.empty);
    report["failed"] = json!({"inside": s.failed_inside, "outside": s.failed_outside});
    let e = s.evaluations;
    report["resident"] = json!(s.resident);
    report["evaluations"] = json!({
        "squares": e.squares,
        "single": e.single,
        "pixels": e.pixels,
        "refined": e.refined,
        "per_pixel": (e.squares + e.pixels) as f64 / s.pixels as f64,
    });
    report["memory"] = json!(s.memory);
    report["seconds_per_frame"] = json!(seconds / frames.list.len() as f64);
    if arguments.frames.is_some() {
        report["frames"] = frames.list.iter().map(Frame::describe).collect();
    }
    session.write_report(&report)?;
    session.say(&format!(
        "{}: {} x {}, {}",
        if animated {
            format!("{} ({} frames)", arguments.output.display(), frames.list.len())
        } else {
            written(&frames.list)
        },
        last.image.width,
        last.image.height,
        made.summary(&session.engine)
    ));
    Ok(())
}

/// Bytes of a picture's samples.
fn bytes(image: &Image) -> u64 {
    (image.pixels.len() * image.depth().bytes()) as u64
}

/// The names of what was written.
fn written(frames: &[Frame]) -> String {
    match frames {
        [first, .., last] => {
            format!("{} to {} ({} files)", first.output.display(), last.output.display(), frames.len())
        }
        _ => frames.iter().map(|f| f.output.display().to_string()).collect(),
    }
}

/// The pictures that are written, with their times: one, or one for each frame that was asked for.
fn chosen(arguments: &Arguments) -> Result<Vec<(f64, PathBuf)>> {
    let Some(count) = arguments.frames else { return Ok(vec![(1.0, arguments.output.clone())]) };
    if !(1..=MOST_FRAMES).contains(&count) {
        return Err(usage("--frames", &format!("{count} frames"), &format!("Give 1 to {MOST_FRAMES}")));
    }
    let all = 0..count as usize;
    let Some(range) = arguments.range.map_or(Some(all), |part| part.of(count as usize)) else {
        return Err(usage("--range", "it reaches beyond the sequence", &format!("Give frames of 0..{count}")));
    };
    let stem = arguments.output.file_stem().unwrap_or_default().to_string_lossy();
    let extension = arguments.output.extension().unwrap_or_default().to_string_lossy();
    let times = times(count);
    let frame = |k: usize| (times[k], arguments.output.with_file_name(format!("{stem}_{k:04}.{extension}")));
    let frames: Vec<(f64, PathBuf)> = range.map(frame).collect();
    let frames = match arguments.shard {
        Some(shard) => shard.of(frames),
        None => frames,
    };
    if frames.is_empty() {
        return Err(usage("--shard", "it has no frame", "Use no more shards than there are frames"));
    }
    Ok(frames)
}

fn options(session: &Session<'_>, arguments: &Arguments, image: &Image, units: CageUnits) -> Result<WarpOptions> {
    let full = arguments.canvas.map_or([image.width, image.height], |(w, h)| [w, h]);
    let placement = |height: u32| match units {
        CageUnits::Pixel => Placement::pixels(),
        CageUnits::Unit => Placement::upward(image.height, height),
    };
    let mut outside = arguments.outside;
    if outside == Outside::Map && arguments.mapping.coordinates == Coordinates::Wachspress {
        session.warn("Wachspress coordinates end at the polygon: what is outside is transparent");
        outside = Outside::Transparent;
    }
    let (canvas, target) = arguments.look.canvas(full, placement(full[1]))?;
    Ok(WarpOptions {
        filter: arguments.filter,
        outside,
        encoding: Encoding { linear_light: arguments.linear_light, ..Encoding::default() },
        canvas: Some(canvas),
        source: placement(image.height),
        target,
        ..WarpOptions::default()
    })
}

/// A picture of the sequence, or the only one.
struct Frame {
    t: f64,
    map: CompositeMap,
    /// The smallest Jacobian of its last step, where that is not one of the partition's.
    least: Option<f64>,
    output: PathBuf,
}

struct Frames {
    list: Vec<Frame>,
}

impl Frames {
    /// The maps of all frames; those that are cut off within a step are tested for folds of their
    /// own.
    fn new(session: &Session<'_>, made: &CageMap, chosen: Vec<(f64, PathBuf)>) -> Result<Self> {
        let mut list = Vec::new();
        let mut pairs = Vec::new();
        for (t, output) in chosen {
            let polygons = cut(&made.cage, &made.partition, t)?;
            let known = made.partition.knots.contains(&t);
            if !known {
                pairs.push((polygons[polygons.len() - 2].clone(), polygons[polygons.len() - 1].clone()));
            }
            let map = CompositeMap::new(made.map.coordinates(), polygons)?;
            list.push(Frame { t, map, least: if known { None } else { Some(f64::NAN) }, output });
        }
        let found = jacobian_min(&session.engine, made.map.coordinates(), &pairs, &made.options.samples)?;
        for (frame, minimum) in list.iter_mut().filter(|f| f.least.is_some()).zip(found) {
            frame.least = Some(minimum.value);
        }
        let folding: Vec<f64> = list.iter().filter(|f| f.least.is_some_and(|j| !(j > 0.0))).map(|f| f.t).collect();
        if let Some(first) = folding.first() {
            session.warn(&format!(
                "{} frames within a step of the map fold, the first at t = {first:.4}: use --partition continuous, or more steps",
                folding.len()
            ));
        }
        Ok(Self { list })
    }
}

impl Frame {
    fn describe(&self) -> Value {
        let mut frame = json!({"t": self.t, "file": self.output.file_name().map(|n| n.to_string_lossy())});
        if let Some(least) = self.least {
            frame["j_min"] = json!(least);
        }
        frame
    }
}

/// The pictures about the warp.
fn about(
    session: &Session<'_>,
    arguments: &Arguments,
    options: &WarpOptions,
    map: &CompositeMap,
    warped: &WarpOutput,
    metadata: &Metadata,
) -> Result<()> {
    if let (Some(path), Some(jacobian)) = (&arguments.heatmap, &warped.jacobian) {
        session.write_image(&heat_map(jacobian, warped.image.width)?, path)?;
    }
    if let Some(path) = &arguments.grid {
        let size = [warped.image.width, warped.image.height];
        session.write_image(&lattice_picture(&session.engine, map, &options.target, size, GRID_CELLS)?, path)?;
    }
    if let Some(path) = &arguments.overlay {
        let picture = overlay(&warped.image, map, &options.source, &options.target)?;
        session.write_picture(&picture, &metadata.of_colors(), path)?;
    }
    Ok(())
}
