//! `barymap decal`: a picture on a part of a surface, by four anchors or more.

use std::path::{Path, PathBuf};

use serde_json::json;

use crate::cli::common::{Common, Session, Surface, check_outputs, size, usage};
use crate::cli::needs::{Room, with_what_is_left};
use crate::cli::pictures::Quality;
use crate::geometry::Placement;
use crate::io::AnchorSpec;
use crate::io::decal_anchors::read_decal_anchors;
use crate::io::finite;
use crate::io::image_file::{Metadata, Picture, check_image_extension};
use crate::picture::Image;
use crate::tools::decal::{Decal, DecalAnchors, Layout, PaintOptions, composite, decal, paint_placed, with_texcoords};
use crate::tools::transfer::{Filter, LARGEST_SIDE};
use crate::{Error, Result};

#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// The mesh that the picture is laid onto
    mesh: PathBuf,
    /// Where: JSON {"anchors": [...], "uv": [[u, v], ...]}; exactly four may be without "uv" and
    /// are the picture's corners, counter-clockwise from its lower left as seen from outside
    #[arg(long)]
    anchors: PathBuf,
    /// The picture, with alpha or without; not needed for an OBJ, whose coordinates then are for a
    /// square one
    #[arg(long)]
    image: Option<PathBuf>,
    /// The mesh's texture so far; without it the result is the decal alone on transparent ground
    #[arg(long)]
    texture: Option<PathBuf>,
    /// The texture with the decal: PNG, JPEG, TIFF, EXR, WebP, TGA or BMP; or the mesh with the
    /// decal's texture coordinates: OBJ
    #[arg(long, short)]
    output: PathBuf,
    /// How coordinates spread from the anchors
    #[arg(long, value_enum, default_value = "plate")]
    layout: Layout,
    /// Write only the faces that show the picture (OBJ)
    #[arg(long)]
    patch: bool,
    /// Size of the result without --texture: one number, or WIDTHxHEIGHT
    #[arg(long, value_parser = size, conflicts_with = "texture")]
    size: Option<(u32, u32)>,
    /// How opaque the picture is, 0 to 1
    #[arg(long, default_value_t = 1.0)]
    opacity: f32,
    /// Draw only on faces of this material, whose texture it is
    #[arg(long)]
    material: Option<String>,
    /// Texels of padding around the charts
    #[arg(long, default_value_t = 16)]
    margin: u32,
    /// How the picture is averaged
    #[arg(long, value_enum, default_value = "anisotropic")]
    filter: Filter,
    /// Samples along each side of a texel, 1 to 4
    #[arg(long, default_value_t = 1)]
    supersample: u32,
    /// Average and blend light instead of stored values
    #[arg(long)]
    linear_light: bool,
    #[command(flatten)]
    quality: Quality,
}

/// Side of the texture without a size given.
const SIZE: u32 = 2048;
/// Anchors farther off the mesh than this part of its diagonal are a mistake.
const OFF: f64 = 0.1;

impl Arguments {
    fn draws(&self) -> bool {
        !self.output.extension().is_some_and(|e| e.eq_ignore_ascii_case("obj"))
    }

    fn check(&self) -> Result<()> {
        check_outputs([self.output.as_path()])?;
        self.quality.check([&self.output])?;
        if !(0.0..=1.0).contains(&self.opacity) {
            return Err(usage("--opacity", &format!("{}", self.opacity), "Give a number from 0 to 1"));
        }
        if self.draws() {
            check_image_extension(&self.output)?;
            if self.image.is_none() {
                let remedy = "Name it, or end --output in .obj for texture coordinates alone";
                return Err(usage("--image", "there is no picture to draw", remedy));
            }
            if self.patch {
                return Err(usage(
                    "--patch",
                    "a texture shows all of the mesh",
                    "Use it with an output that ends in .obj",
                ));
            }
        } else if self.texture.is_some() || self.size.is_some() {
            let option = if self.texture.is_some() { "--texture" } else { "--size" };
            return Err(usage(option, "an OBJ holds no texture", "Leave it out, or end --output in .png"));
        }
        Ok(())
    }
}

/// The anchors on their mesh.
fn anchors(path: &Path, surface: &Surface, session: &Session<'_>) -> Result<DecalAnchors> {
    let (list, uv) = read_decal_anchors(path)?;
    let points = session.find(surface, &list)?;
    let diagonal = surface.mesh.bounds().map_or(0.0, |(low, high)| low.distance(high));
    for (k, (spec, point)) in list.anchors.iter().zip(&points).enumerate() {
        let AnchorSpec::Position(p) = spec else { continue };
        let off = p.distance(point.position(&surface.mesh));
        if off > OFF * diagonal {
            return Err(Error::input(
                format!("{}: anchor {k} is {off:.3e} off {}", path.display(), surface.mesh.name),
                "Check that the anchors belong to this mesh and are in its units",
            ));
        }
    }
    Ok(DecalAnchors { points, uv })
}

pub(crate) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    arguments.check()?;
    let mut session = if arguments.draws() { Session::start(common)? } else { Session::start_on_cpu(common)? };
    let surface = session.mesh(&arguments.mesh)?;
    let picture = arguments.image.as_ref().map(|p| session.picture(p)).transpose()?;
    let texture = arguments.texture.as_ref().map(|p| session.texture(p)).transpose()?;
    let metadata = metadata(arguments, picture.as_ref(), texture.as_ref(), &session);
    let (picture, texture) = (picture.map(|p| p.image), texture.map(|t| t.image));
    if let Some(t) = texture.as_ref().filter(|t| t.width.max(t.height) > LARGEST_SIDE) {
        let what = format!("the texture has {} x {} texels", t.width, t.height);
        return Err(Error::input(what, "Sides up to 16384 are drawn on"));
    }
    let material = arguments.material.as_ref().map(|name| material(&surface, name)).transpose()?;
    if arguments.draws() {
        crate::cli::transfer::require_texcoords(&surface)?;
    }
    let anchors = anchors(&arguments.anchors, &surface, &session)?;
    session.watch.lap("read");
    let layout = arguments.layout;
    let aspect = picture.as_ref().map_or(1.0, |p| f64::from(p.width) / f64::from(p.height));
    let made = decal(&surface.mesh, &surface.topology, &anchors, layout, aspect, session.progress())?;
    session.watch.lap("layout");
    let mut texels = 0;
    match &picture {
        Some(picture) if arguments.draws() => {
            let finite = texture.iter().chain([picture]).all(finite::is_finite);
            let (image, count) = draw(&session, arguments, &surface, &made, picture, texture, material)?;
            texels = count;
            session.watch.lap("draw");
            finite::picture(&arguments.output, &image, finite)?;
            session.write_picture(&image, &metadata, &arguments.output)?;
        }
        _ => session.write_obj(&with_texcoords(&surface.mesh, &made, arguments.patch), &arguments.output)?,
    }
    session.watch.lap("write");
    tell(&session, arguments, &made, texels);
    let r = &made.report;
    let mut report = session.report("decal");
    report["layout"] = json!(arguments.layout);
    report["anchors"] = json!(anchors.points.len());
    report["faces"] = json!(made.patch.len());
    report["area"] = json!(r.area);
    report["stretch_all"] = json!(r.stretch_all);
    report["stretch_best95"] = json!(r.stretch_best95);
    report["flipped_faces"] = json!(r.flipped_faces);
    report["flipped_area"] = json!(r.flipped_area);
    report["mirrored"] = json!(r.mirrored);
    report["shown"] = json!(r.shown);
    report["shown_twice"] = json!(r.shown_twice);
    report["anchor_error"] = json!(r.anchor_error);
    report["texels"] = json!(texels);
    session.write_report(&report)
}

/// What is told of the result: what the texture's file tells, or of the decal's what its colours
/// mean.
fn metadata(
    arguments: &Arguments,
    picture: Option<&Picture>,
    texture: Option<&Picture>,
    session: &Session<'_>,
) -> Metadata {
    let decal = picture.map(|p| p.metadata.of_colors()).unwrap_or_default();
    if texture.is_some_and(|t| t.metadata.icc != decal.icc) && arguments.draws() {
        session.warn(
            "the picture and the texture have different colour profiles: the colours of the picture may look different",
        );
    }
    let mut metadata = texture.map(|t| t.metadata.clone()).unwrap_or(decal);
    arguments.quality.apply(&mut metadata);
    metadata
}

/// The number of a material.
fn material(surface: &Surface, name: &str) -> Result<u32> {
    let all = &surface.mesh.materials;
    all.iter().position(|m| m.name == name).map(|k| k as u32).ok_or_else(|| {
        let names: Vec<&str> = all.iter().take(12).map(|m| m.name.as_str()).collect();
        usage("--material", &format!("{name:?} is no material of the mesh"), &format!("It has: {}", names.join(", ")))
    })
}

/// The texture with the decal, and how many texels show it.
fn draw(
    session: &Session<'_>,
    arguments: &Arguments,
    surface: &Surface,
    made: &Decal,
    picture: &Image,
    texture: Option<Image>,
    material: Option<u32>,
) -> Result<(Image, u64)> {
    let (width, height) = match &texture {
        Some(texture) => (texture.width, texture.height),
        None => arguments.size.unwrap_or((SIZE, SIZE)),
    };
    let options = PaintOptions {
        width,
        height,
        margin: arguments.margin,
        filter: arguments.filter,
        supersample: arguments.supersample,
        linear_light: arguments.linear_light,
        material,
        memory: u64::MAX,
    };
    // A decal is drawn where the material shows the texel.
    let mesh = &surface.mesh;
    let placements: Vec<Placement> = mesh.materials.iter().map(|m| m.base_color_placement).collect();
    // The decal is laid upon a texture, which makes a third picture.
    let texels = u64::from(width) * u64::from(height);
    let [base_channels, depth] = match &texture {
        Some(t) => [u64::from(t.channels), t.depth().bytes() as u64],
        None => [4, picture.depth().bytes() as u64],
    };
    let made_here = if texture.is_some() { 0 } else { texels * base_channels * depth };
    let room = Room { after: made_here + texels * base_channels.max(3) * depth, ..Room::default() };
    let painted = with_what_is_left(session.common, room, |memory| {
        let options = PaintOptions { memory, ..options };
        paint_placed(&session.engine, mesh, &placements, made, picture, &options, session.progress())
    })?;
    for note in &painted.stats.notes {
        session.warn(note);
    }
    if painted.stats.overlapping > 0 {
        session.warn(&format!(
            "{} texels of the texture show several faces: what is drawn there appears more than once",
            painted.stats.overlapping
        ));
    }
    let materials: std::collections::BTreeSet<u32> =
        made.patch.iter().map(|&t| surface.mesh.triangle_material(t as usize)).collect();
    if materials.len() > 1 && material.is_none() {
        session.warn(&format!(
            "the picture lies on {} materials; if each has its own texture, make them one by one with --material",
            materials.len()
        ));
    }
    let base = match texture {
        Some(texture) => texture,
        None => Image::zeros(width, height, 4, painted.image.depth())?,
    };
    let image = composite(&base, &painted.image, arguments.opacity, arguments.linear_light)?;
    Ok((image, painted.texels))
}

fn tell(session: &Session<'_>, arguments: &Arguments, made: &Decal, texels: u64) {
    let r = &made.report;
    session.say(&format!(
        "{}: {} faces{} show {:.1} % of the picture, stretch efficiency {:.3} (best 95 %: {:.3}), {} turned over",
        arguments.output.display(),
        made.patch.len(),
        if texels > 0 { format!(", {texels} texels,") } else { String::new() },
        100.0 * r.shown,
        r.stretch_all,
        r.stretch_best95,
        r.flipped_faces
    ));
    if r.mirrored {
        session.warn("the picture appears as in a mirror: give its corners counter-clockwise, seen from outside");
    }
    if r.shown < 0.99 {
        session.warn(&format!("{:.1} % of the picture lies beyond the surface or its folds", 100.0 * (1.0 - r.shown)));
    }
    if r.shown_twice > 0.01 {
        session.warn(&format!("{:.1} % of the picture is shown more than once", 100.0 * r.shown_twice));
    }
    if r.anchor_error > 0.01 {
        session.warn(&format!("an anchor is {:.3} of the picture's side off its place", r.anchor_error));
    }
}
