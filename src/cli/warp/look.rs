//! What photographers ask of a warp: previews, parts, soft borders, perspective, animations.

use std::path::Path;

use glam::DVec2;
use serde_json::json;

use super::{Arguments, bytes, options};
use crate::cli::common::{Session, usage};
use crate::cli::needs::{Room, with_what_is_left};
use crate::control;
use crate::io::cage::{CageUnits, read_cage};
use crate::io::finite;
use crate::io::image_file::animation::{AnimationFormat, write_animation};
use crate::io::image_file::{Metadata, Picture, write_picture};
use crate::io::output_set::OutputSet;
use crate::picture::Image;
use crate::tools::warp::feather::{blended, feather};
use crate::tools::warp::pictures::heat_map;
use crate::tools::warp::projective::warp_projective;
use crate::tools::warp::{Outside, Placement, WarpOptions};
use crate::{Error, Result};

/// Which part of the result is made, and how.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct Look {
    /// A smaller picture, to look at: 0.1 makes a tenth of each side
    #[arg(long, value_parser = scale, default_value = "1", hide_default_value = true)]
    scale: f64,
    /// Only this part of the result, in its pixels
    #[arg(long, value_parser = crop, value_name = "X,Y,WIDTH,HEIGHT")]
    crop: Option<[u32; 4]>,
    /// Fade along the border of the target polygon over so many pixels of the result, with --outside
    /// keep or transparent
    #[arg(long, value_name = "PIXELS", value_parser = pixels)]
    feather: Option<f64>,
    /// Four corners seen in perspective: straight lines stay straight. The cage has four vertices
    #[arg(long, conflicts_with_all = ["frames", "grid", "overlay", "certify", "strict"])]
    pub(super) projective: bool,
    /// Pictures a second of an animation: --frames with an output that ends in .gif or .apng
    #[arg(long, default_value_t = 25.0, requires = "frames")]
    rate: f64,
}

fn scale(text: &str) -> std::result::Result<f64, String> {
    let number = text.trim().parse::<f64>().ok().filter(|s| *s > 0.0 && *s <= 1.0);
    number.ok_or_else(|| format!("{text:?} is no scale: write a number up to 1, for example 0.1"))
}

fn pixels(text: &str) -> std::result::Result<f64, String> {
    let number = text.trim().parse::<f64>().ok().filter(|s| *s > 0.0 && *s <= 10_000.0);
    number.ok_or_else(|| format!("{text:?} is no number of pixels: write one up to 10000"))
}

fn crop(text: &str) -> std::result::Result<[u32; 4], String> {
    let numbers: Option<Vec<u32>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    let four = numbers.and_then(|n| <[u32; 4]>::try_from(n).ok()).filter(|n| n[2] > 0 && n[3] > 0);
    four.ok_or_else(|| format!("{text:?} is no part: write X,Y,WIDTH,HEIGHT in pixels"))
}

impl Look {
    /// What is wrong with the options together.
    pub(super) fn check(&self, outside: Outside) -> Result<()> {
        if self.feather.is_some() && outside == Outside::Map {
            let what = "nothing lies below the picture that it could fade into";
            return Err(usage("--feather", what, "Give --outside keep or --outside transparent"));
        }
        Ok(())
    }

    /// The canvas and how it lies in units of the cage, for a result of `full` pixels that lies there
    /// as `placed`.
    pub(super) fn canvas(&self, full: [u32; 2], placed: Placement) -> Result<([u32; 2], Placement)> {
        let [x, y, width, height] = self.crop.unwrap_or([0, 0, full[0], full[1]]);
        let within = |begin: u32, count: u32, of: u32| begin.checked_add(count).is_some_and(|end| end <= of);
        if !within(x, width, full[0]) || !within(y, height, full[1]) {
            let what = format!("{x},{y},{width},{height} reaches beyond {} x {} pixels", full[0], full[1]);
            return Err(usage("--crop", &what, "Give a part of the result"));
        }
        // Sides without pixels stay so, and are refused.
        let side = |n: u32| if n == 0 { 0 } else { (f64::from(n) * self.scale).round().max(1.0) as u32 };
        let corner = DVec2::new(f64::from(x), f64::from(y));
        Ok(([side(width), side(height)], placed.part(corner, self.scale)))
    }

    /// A warped picture with its soft border, if one is wanted; `loops` are the target polygon in
    /// pixels of the canvas.
    pub(super) fn feathered(
        &self,
        session: &Session<'_>,
        image: &Image,
        warped: Image,
        loops: &[Vec<DVec2>],
        options: &WarpOptions,
    ) -> Result<Image> {
        let Some(width) = self.feather else { return Ok(warped) };
        let below = match options.outside {
            Outside::Keep => {
                // The picture as it was, through the same filter.
                let square = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y];
                let plain = WarpOptions { outside: Outside::Map, jacobian: false, ..options.clone() };
                Some(warp_projective(image, [square; 2], &plain, session.progress())?.image)
            }
            _ => None,
        };
        blended(&warped, below.as_ref(), &feather(loops, [warped.width, warped.height], width * self.scale))
    }
}

/// Where the pictures of a command go.
pub(super) enum Sink<'a> {
    /// Each to its place.
    Files,
    /// All at once, when the last is done.
    Sequence(OutputSet),
    /// Into one file.
    Animation { path: &'a Path, format: AnimationFormat, rate: f64, frames: Vec<Image> },
}

impl<'a> Sink<'a> {
    /// For the options of a command; `first` is the first file of a whole sequence.
    pub(super) fn new(arguments: &'a Arguments, first: Option<&Path>) -> Result<Self> {
        if let Some(format) = animation(arguments) {
            let (path, rate) = (arguments.output.as_path(), arguments.look.rate);
            return Ok(Self::Animation { path, format, rate, frames: Vec::new() });
        }
        Ok(first.map(OutputSet::beside).transpose()?.map_or(Self::Files, Self::Sequence))
    }

    /// Takes a picture; returns what its format has no place for.
    pub(super) fn put(&mut self, image: &Image, metadata: &Metadata, path: &Path) -> Result<Vec<String>> {
        match self {
            Self::Files => write_picture(image, metadata, path),
            Self::Sequence(set) => write_picture(image, metadata, set.file(path)?),
            Self::Animation { frames, .. } => {
                frames.push(image.clone());
                Ok(Vec::new())
            }
        }
    }

    /// Writes what waits; returns what its format has no place for.
    pub(super) fn finish(self, metadata: &Metadata) -> Result<Vec<String>> {
        match self {
            Self::Files => Ok(Vec::new()),
            Self::Sequence(set) => set.finish().map(|()| Vec::new()),
            Self::Animation { path, format, rate, frames } => write_animation(path, format, &frames, metadata, rate),
        }
    }
}

/// The format of the animation that is asked for.
pub(super) fn animation(arguments: &Arguments) -> Option<AnimationFormat> {
    arguments.frames.and_then(|_| AnimationFormat::of_name(&arguments.output))
}

/// Fails for animations that are not written, or take too much.
pub(super) fn check_animation(arguments: &Arguments) -> Result<()> {
    let Some(count) = arguments.frames else { return Ok(()) };
    if arguments.output.extension().is_some_and(|e| e.eq_ignore_ascii_case("webp")) {
        let stem = arguments.output.file_stem().unwrap_or_default().display().to_string();
        let line = format!("ffmpeg -framerate {} -i {stem}_%04d.png -loop 0 {stem}.webp", arguments.look.rate);
        let remedy = format!("Write a sequence, -o {stem}.png, and run: {line}");
        return Err(usage("--output", "animated WebP is not written", &remedy));
    }
    if animation(arguments).is_some() && (arguments.range.is_some() || arguments.shard.is_some()) {
        let what = "an animation is one file, and a part of it would be another";
        return Err(usage("--range", what, "Write a sequence: end --output in .png"));
    }
    if animation(arguments).is_some()
        && let Some((w, h)) = arguments.canvas
    {
        let bytes = u64::from(count) * u64::from(w) * u64::from(h) * 4;
        control::require(bytes, || format!("an animation of {count} frames of {w} x {h} pixels"))?;
    }
    Ok(())
}

/// `warp --projective`.
pub(super) fn projective(session: &mut Session<'_>, arguments: &Arguments, picture: Picture) -> Result<()> {
    let Picture { image, metadata, .. } = picture;
    let cage = &arguments.mapping.cage;
    let file = read_cage(cage)?;
    let corners = |loops: &[Vec<DVec2>]| match loops {
        [one] => <[DVec2; 4]>::try_from(one.as_slice()).ok(),
        _ => None,
    };
    let (Some(source), Some(target)) = (corners(&file.source), corners(&file.target)) else {
        let what = "--projective takes four corners, and the cage has others";
        return Err(Error::format(cage, None, what, "Give two polygons of four vertices, or leave --projective out"));
    };
    let mut options = options(session, arguments, &image, file.units.unwrap_or(CageUnits::Pixel))?;
    options.jacobian = arguments.heatmap.is_some();
    session.watch.lap("read");
    let warped = with_what_is_left(session.common, Room { there: bytes(&image), after: 0 }, |memory| {
        options.memory = memory;
        warp_projective(&image, [source, target], &options, session.progress())
    })?;
    let loops = [target.map(|p| options.target.to_pixels(p)).to_vec()];
    let result = arguments.look.feathered(session, &image, warped.image, &loops, &options)?;
    session.watch.lap("warp");
    finite::picture(&arguments.output, &result, finite::is_finite(&image))?;
    session.write_picture(&result, &metadata, &arguments.output)?;
    if let (Some(path), Some(jacobian)) = (&arguments.heatmap, &warped.jacobian) {
        session.write_image(&heat_map(jacobian, result.width)?, path)?;
    }
    session.watch.lap("write");
    session.say(&format!(
        "{}: {} x {}, four corners in perspective",
        arguments.output.display(),
        result.width,
        result.height
    ));
    let mut report = session.report("warp");
    report["projective"] = json!(true);
    report["canvas"] = json!([result.width, result.height]);
    report["pixels"] = json!(warped.stats.pixels);
    report["mapped"] = json!(warped.stats.mapped);
    report["empty"] = json!(warped.stats.empty);
    session.write_report(&report)
}
