//! `barymap demo`: the main job on built-in characters.

use std::path::{Path, PathBuf};

use serde_json::json;

use crate::cli::common::{Common, EmbeddingArguments, Session};
use crate::cli::method::MethodArguments;
use crate::cli::transfer::{Job, Look, summary};
use crate::desk::Textures;
use crate::geometry::{Material, SurfacePoint};
use crate::io::TextureName;
use crate::models::character_pair;
use crate::surface::Sampling;
use crate::surface::quality::summarise;
use crate::surface::{AnchorPairs, EmbeddingOptions};
use crate::tools::render::{Coloring, RenderOptions, render, side_by_side};
use crate::tools::transfer::Pyramids;
use crate::tools::transfer::{Fill, Filter};
use crate::{Error, Result};

#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// Folder for the results
    #[arg(long = "output", short = 'o', alias = "out", default_value = "out")]
    out: PathBuf,
    /// Number of anchor pairs
    #[arg(long, default_value_t = 93)]
    anchors: usize,
    #[command(flatten)]
    method: MethodArguments,
    /// Side of the texture
    #[arg(long, default_value_t = 2048)]
    size: u32,
}

/// Files that the demo writes.
const FILES: [&str; 9] = [
    "texture.png",
    "coverage.png",
    "model.glb",
    "demo.png",
    "source_texture.png",
    "source.obj",
    "target.obj",
    "pairs.json",
    "report.json",
];

/// Fails for a folder with files that would be overwritten, unless a demo wrote them.
fn check_folder(folder: &Path, overwrite: bool) -> Result<()> {
    let report = std::fs::read(folder.join("report.json")).unwrap_or_default();
    let own = serde_json::from_slice::<serde_json::Value>(&report).is_ok_and(|r| r["command"] == "demo");
    if own || overwrite {
        return Ok(());
    }
    match FILES.iter().map(|name| folder.join(name)).find(|file| file.exists()) {
        Some(file) => {
            let what = format!("{} is there already, and no demo wrote it", file.display());
            Err(Error::option("--output", what, "Name another folder, or give --overwrite"))
        }
        None => Ok(()),
    }
}

pub(crate) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    check_folder(&arguments.out, common.overwrite)?;
    std::fs::create_dir_all(&arguments.out)
        .map_err(|e| Error::io(&arguments.out, e, "Choose a folder that can be written with --output"))?;
    let path = |name: &str| arguments.out.join(name);
    let mut session = Session::start(common)?;
    let pair = character_pair();
    let texture = pair.source.texture(arguments.size.clamp(256, 2048));
    let (source_points, target_points) = pair.anchors(arguments.anchors);
    let anchors = AnchorPairs { source: source_points, target: target_points };
    let (mut source, mut target) =
        (session.surface(pair.source.mesh.clone())?, session.surface(pair.target.mesh.clone())?);
    anchors.check((&source.mesh, &source.topology), (&target.mesh, &target.topology))?;
    session.watch.lap("models");
    let texture_file = path("texture.png");
    let outputs = [TextureName::new(texture_file.display().to_string())];
    let layers = [Textures::single(texture.clone())];
    let job = Job {
        layers: &layers,
        pyramids: &Pyramids::new(&session.engine),
        anchors: &anchors,
        method: arguments.method,
        embedding: &EmbeddingArguments {
            landmarks: EmbeddingOptions::default().landmarks,
            sampling: Sampling::Decimation,
            dimension: 8,
        },
        look: &Look {
            size: (arguments.size, arguments.size),
            margin: 16,
            coverage: Some(path("coverage.png").display().to_string()),
            fill: Fill::None,
            fill_doubtful: false,
            stmap: None,
            model: Some(path("model.glb")),
            linear_light: false,
            filter: Filter::Anisotropic,
            supersample: 1,
        },
        outputs: &outputs,
    };
    let (result, vertices, mut report) = job.run(&mut session, "demo", &mut source, &mut target)?;

    let unit = source.mesh.area().sqrt();
    let errors: Vec<f64> = pair
        .truth
        .iter()
        .zip(&vertices.positions)
        .filter_map(|(truth, image)| image.map(|p| p.distance(truth.position(&source.mesh)) / unit))
        .collect();
    let e = summarise(&errors);
    report["error"] = json!({"mean": e.mean, "median": e.median, "p95": e.p95, "max": e.max});

    let view = RenderOptions { width: 900, height: 1100, ..RenderOptions::default() };
    let before = render(&source.mesh, Coloring::Texture(&texture), &anchors.source, &view)?;
    let after = render(&target.mesh, Coloring::Texture(&result.layers[0]), &[] as &[SurfacePoint], &view)?;
    let picture = side_by_side(&[before, after], 20, [255; 4])?;
    crate::io::write_image(&picture, path("demo.png"))?;
    crate::io::write_image(&texture, path("source_texture.png"))?;
    // The same as files, so that the commands of the documentation have something to work on.
    let mut painted = source.mesh.clone();
    painted.set_material(Material {
        name: "skin".into(),
        base_color_texture: Some(path("source_texture.png")),
        ..Material::default()
    });
    session.write_obj(&painted, &path("source.obj"))?;
    session.write_obj(&target.mesh, &path("target.obj"))?;
    crate::io::anchors::write_pairs(
        path("pairs.json"),
        (&source.mesh, &anchors.source),
        (&target.mesh, &anchors.target),
        &[],
    )?;
    crate::io::report::write_report(path("report.json"), &report)?;
    session.write_report(&report)?;
    summary(&session, &texture_file, &result, &report);
    session.say(&format!(
        "true error over the square root of the area: mean {:.4}, median {:.4}, 95 % {:.4}, largest {:.3}",
        e.mean, e.median, e.p95, e.max
    ));
    session.say(&format!("look at {} and {}", path("demo.png").display(), path("model.glb").display()));
    session.say(&format!(
        "its input, for your own first tries: {}, {} and {}",
        path("source.obj").display(),
        path("target.obj").display(),
        path("pairs.json").display()
    ));
    Ok(())
}
