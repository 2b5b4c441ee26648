//! `barymap render`: a shaded picture of a mesh.

use std::path::PathBuf;

use crate::cli::common::{Common, Session, check_outputs, size};
use crate::cli::side::OfPairs;
use crate::desk::{Textures, own_textures};
use crate::tools::render::{Coloring, PlacedTexture, RenderOptions, render};
use crate::{Error, Result};

#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// The mesh
    mesh: PathBuf,
    /// Its texture; without it the textures of its materials are taken
    #[arg(long)]
    texture: Option<PathBuf>,
    /// Anchors to draw: those of this mesh, or pairs of which --side is drawn
    #[arg(long)]
    anchors: Option<PathBuf>,
    #[command(flatten)]
    of_pairs: OfPairs,
    /// Write each anchor's number beside it
    #[arg(long)]
    numbers: bool,
    /// Where the camera stands: azimuth and elevation in degrees
    #[arg(long, default_value = "20,8", value_parser = view, allow_hyphen_values = true)]
    view: (f64, f64),
    /// Size of the picture: one number, or WIDTHxHEIGHT
    #[arg(long, default_value = "800", value_parser = size)]
    size: (u32, u32),
    /// Draw the edges of the polygons
    #[arg(long)]
    wireframe: bool,
    /// The picture: PNG, JPEG, TIFF or EXR
    #[arg(long, short)]
    output: PathBuf,
}

pub(crate) fn view(text: &str) -> std::result::Result<(f64, f64), String> {
    let wrong = || format!("{text:?} is no view: write azimuth,elevation in degrees, for example 20,8");
    let (a, e) = text.split_once(',').ok_or_else(wrong)?;
    Ok((a.trim().parse().map_err(|_| wrong())?, e.trim().parse().map_err(|_| wrong())?))
}

pub(crate) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    check_outputs([arguments.output.as_path()])?;
    crate::io::image_file::check_image_extension(&arguments.output)?;
    let mut session = Session::start_on_cpu(common)?;
    let surface = session.mesh(&arguments.mesh)?;
    session.warn_of_up(&surface.mesh);
    let anchors = match &arguments.anchors {
        Some(path) => session.find(&surface, &arguments.of_pairs.read(path)?)?,
        None => Vec::new(),
    };
    let single = arguments.texture.as_ref().map(|p| Ok(session.texture(p)?.image)).transpose()?;
    let own = match (&single, own_textures(&surface.mesh)) {
        (None, Ok(own)) => Some(own),
        // A file without textures and colours is no fault; one whose textures cannot be read is
        // told.
        (None, Err(error)) if !matches!(error, Error::Option { .. }) => {
            session.warn(&format!("shown without its textures: {error}"));
            None
        }
        _ => None,
    };
    fn placed(t: &Textures, i: u32) -> Option<PlacedTexture<'_>> {
        let placement = t.placements.get(i as usize).copied().unwrap_or_default();
        Some(PlacedTexture { image: t.images.get(i as usize)?, placement })
    }
    let materials: Vec<Option<PlacedTexture<'_>>> =
        own.iter().flat_map(|t| t.material_texture.iter().map(move |&i| placed(t, i))).collect();
    let byte = |c: f32| (c.clamp(0.0, 1.0) * 255.0 + 0.5) as u8;
    let vertices = own.as_ref().and_then(|t| t.vertices.as_ref());
    let vertices: Option<Vec<[u8; 3]>> = vertices.map(|v| v.iter().map(|c| [c[0], c[1], c[2]].map(byte)).collect());
    let coloring = match (&single, &vertices) {
        (Some(image), _) => Coloring::Texture(image),
        (None, Some(colors)) => Coloring::Vertices(colors),
        (None, None) if !materials.is_empty() => Coloring::Materials(&materials),
        (None, None) => Coloring::Plain([190, 190, 196]),
    };
    let options = RenderOptions {
        width: arguments.size.0,
        height: arguments.size.1,
        up: session.up(),
        azimuth: arguments.view.0,
        elevation: arguments.view.1,
        wireframe: arguments.wireframe,
        anchor_numbers: arguments.numbers,
        ..RenderOptions::default()
    };
    let picture = render(&surface.mesh, coloring, &anchors, &options)?;
    session.watch.lap("render");
    crate::io::write_image(&picture, &arguments.output)?;
    session.say(&format!("{}: {} x {}", arguments.output.display(), options.width, options.height));
    let report = session.report("render");
    session.write_report(&report)
}
