//! `barymap transfer`: the texture of one mesh on another.

use std::path::{Path, PathBuf};

use barymap::geometry::NONE;
use barymap::io::gltf_write::GlbMaterial;
use barymap::raster::Image;
use barymap::surface::AnchorPairs;
use barymap::tools::transfer::{Encoding, Filter, Layer, TransferOptions, TransferOutput, transfer_on};
use barymap::tools::vertex_map::{VertexMap, vertex_map};
use barymap::{Error, Result};
use clap::ValueEnum;
use serde_json::json;

use crate::common::{Common, EmbeddingArguments, Session, Surface, anchor_pairs, check_outputs, size, usage};
use crate::method::{MethodName, prepare};
use crate::unwrap::Charts;

#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// The mesh with the texture
    #[arg(long)]
    pub(crate) source: PathBuf,
    /// A texture of the source: FILE, or MATERIAL=FILE for one of its materials. Repeat for several layers (with as many -o) or materials.
    /// Without it the textures named by the source's materials are taken
    #[arg(long)]
    pub(crate) texture: Vec<String>,
    /// The mesh that receives it, with texture coordinates or with --unwrap
    #[arg(long)]
    pub(crate) target: PathBuf,
    /// Pairs of anchors: JSON, lines `iS iT`, or two files `S.vts,T.vts`
    #[arg(long)]
    pub(crate) anchors: String,
    /// The new texture: PNG, JPEG, TIFF or EXR; one for each layer
    #[arg(long, short, required = true)]
    pub(crate) output: Vec<PathBuf>,
    /// How points are carried
    #[arg(long, value_enum, default_value = "transport")]
    pub(crate) method: MethodName,
    #[command(flatten)]
    pub(crate) look: Look,
    #[command(flatten)]
    pub(crate) charts: Charts,
    #[command(flatten)]
    pub(crate) embedding: EmbeddingArguments,
}

/// What the result looks like.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct Look {
    /// Size of the result: one number, or WIDTHxHEIGHT
    #[arg(long, default_value = "2048", value_parser = size)]
    pub(crate) size: (u32, u32),
    /// Texels of padding around the charts
    #[arg(long, default_value_t = 16)]
    pub(crate) margin: u32,
    /// Write what is covered: 0 nothing, 64 padding, 128 doubtful, 255 valid
    #[arg(long)]
    pub(crate) coverage: Option<PathBuf>,
    /// Write the target with its new texture, ready to view (GLB)
    #[arg(long)]
    pub(crate) model: Option<PathBuf>,
    /// Average light instead of stored values
    #[arg(long)]
    pub(crate) linear_light: bool,
    /// How the source's texture is averaged
    #[arg(long, value_enum, default_value = "anisotropic")]
    pub(crate) filter: FilterName,
    /// Samples along each side of a texel, 1 to 4
    #[arg(long, default_value_t = 1)]
    pub(crate) supersample: u32,
}

/// Names of the filters.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum FilterName {
    Anisotropic,
    Trilinear,
    Bilinear,
}

impl Look {
    fn options(&self, memory: u64) -> TransferOptions {
        TransferOptions {
            width: self.size.0,
            height: self.size.1,
            margin: self.margin,
            supersample: self.supersample,
            filter: match self.filter {
                FilterName::Anisotropic => Filter::Anisotropic,
                FilterName::Trilinear => Filter::Trilinear,
                FilterName::Bilinear => Filter::Bilinear,
            },
            memory,
            ..TransferOptions::default()
        }
    }
}

/// The pictures of one layer and how the source's materials use them.
pub(crate) struct Textures {
    pub(crate) images: Vec<Image>,
    pub(crate) material_texture: Vec<u32>,
    pub(crate) default_texture: u32,
}

impl Textures {
    /// One picture for the whole source.
    pub(crate) fn single(image: Image) -> Self {
        Self { images: vec![image], material_texture: Vec::new(), default_texture: 0 }
    }
}

/// The layers that `--texture` asks for.
pub(crate) fn textures(arguments: &Arguments, source: &Surface) -> Result<Vec<Textures>> {
    if arguments.texture.is_empty() {
        return Ok(vec![own_textures(source)?]);
    }
    let named: Vec<(&str, &str)> = arguments.texture.iter().filter_map(|t| split(t, source)).collect();
    if named.is_empty() {
        return arguments.texture.iter().map(|t| barymap::io::read_image(t).map(Textures::single)).collect();
    }
    if named.len() != arguments.texture.len() {
        return Err(usage(
            "--texture",
            "some textures name a material and others do not",
            "Name a material for each, or for none",
        ));
    }
    let mut layer = Textures {
        images: Vec::new(),
        material_texture: vec![NONE; source.mesh.materials.len()],
        default_texture: NONE,
    };
    for (name, file) in named {
        for (m, material) in source.mesh.materials.iter().enumerate() {
            if material.name == name {
                layer.material_texture[m] = layer.images.len() as u32;
            }
        }
        layer.images.push(barymap::io::read_image(file)?);
    }
    Ok(vec![layer])
}

/// `MATERIAL=FILE`, if the source has such a material.
fn split<'t>(text: &'t str, source: &Surface) -> Option<(&'t str, &'t str)> {
    let (name, file) = text.split_once('=')?;
    source.mesh.materials.iter().any(|m| m.name == name).then_some((name, file))
}

/// The textures that the source's own materials name.
pub(crate) fn own_textures(source: &Surface) -> Result<Textures> {
    let mut layer = Textures {
        images: Vec::new(),
        material_texture: vec![NONE; source.mesh.materials.len()],
        default_texture: NONE,
    };
    for (m, material) in source.mesh.materials.iter().enumerate() {
        let image = match (&material.embedded_texture, &material.base_color_texture) {
            (Some(bytes), _) => barymap::io::image_file::decode_image(bytes, &source.mesh.name)?,
            (None, Some(path)) => barymap::io::read_image(path)?,
            (None, None) => continue,
        };
        layer.material_texture[m] = layer.images.len() as u32;
        layer.images.push(image);
    }
    if layer.images.is_empty() {
        return Err(usage(
            "--texture",
            &format!("{} names no texture", source.mesh.name),
            "Give it with --texture FILE",
        ));
    }
    Ok(layer)
}

pub(crate) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    let outputs = arguments.output.iter().map(PathBuf::as_path);
    check_outputs(outputs.chain(arguments.look.coverage.as_deref()).chain(arguments.look.model.as_deref()))?;
    arguments.output.iter().try_for_each(barymap::io::image_file::check_image_extension)?;
    check_outputs(arguments.charts.unwrapped.as_deref())?;
    arguments.charts.check(arguments.look.size, arguments.look.model.is_some())?;
    let mut session = Session::start(common)?;
    let (mut source, mut target) = (session.mesh(&arguments.source)?, session.mesh(&arguments.target)?);
    let layers = textures(arguments, &source)?;
    if layers.len() != arguments.output.len() {
        return Err(usage(
            "--output",
            &format!("{} outputs for {} layers", arguments.output.len(), layers.len()),
            "Give one -o for each texture",
        ));
    }
    session.watch.lap("read");
    let anchors = anchor_pairs(&arguments.anchors, &source, &target, &session)?;
    require_texcoords(&source)?;
    let charts = target_charts(&mut session, &mut target, &arguments.charts, &arguments.look)?;
    let job = Job {
        layers: &layers,
        anchors: &anchors,
        method: arguments.method,
        embedding: &arguments.embedding,
        look: &arguments.look,
        outputs: &arguments.output,
    };
    let (result, _, mut report) = job.run(&mut session, "transfer", &mut source, &mut target)?;
    add(&mut report, &charts);
    session.write_report(&report)?;
    summary(&session, &arguments.output[0], &result, &report);
    Ok(())
}

pub(crate) fn require_texcoords(surface: &Surface) -> Result<()> {
    if surface.mesh.has_texcoords() {
        return Ok(());
    }
    let remedy =
        "A source needs those of its texture; a target can be given some with --unwrap, any mesh with `barymap unwrap`";
    Err(Error::mesh(&surface.mesh.name, "it has no texture coordinates", remedy))
}

/// Makes the target's charts where asked, else says what is unfit about them; for the report.
pub(crate) fn target_charts(
    session: &mut Session<'_>,
    target: &mut Surface,
    charts: &Charts,
    look: &Look,
) -> Result<serde_json::Value> {
    if !charts.unwrap {
        require_texcoords(target)?;
    }
    charts.apply(session, target, look.size, look.margin)
}

/// Adds the entries of `extra` to a report.
pub(crate) fn add(report: &mut serde_json::Value, extra: &serde_json::Value) {
    if let (Some(report), Some(extra)) = (report.as_object_mut(), extra.as_object()) {
        report.extend(extra.clone());
    }
}

/// A transfer with everything read.
pub(crate) struct Job<'a> {
    pub(crate) layers: &'a [Textures],
    pub(crate) anchors: &'a AnchorPairs,
    pub(crate) method: MethodName,
    pub(crate) embedding: &'a EmbeddingArguments,
    pub(crate) look: &'a Look,
    pub(crate) outputs: &'a [PathBuf],
}

impl Job<'_> {
    /// Maps, samples, writes pictures, coverage and model, and makes the report.
    pub(crate) fn run(
        &self,
        session: &mut Session<'_>,
        command: &str,
        source: &mut Surface,
        target: &mut Surface,
    ) -> Result<(TransferOutput, VertexMap, serde_json::Value)> {
        let method = self.method.method();
        let map = prepare(session, source, target, self.anchors, method, self.embedding)?;
        let vertices = vertex_map((&source.mesh, &source.topology), (&target.mesh, &target.topology), map.as_ref())?;
        session.watch.lap("vertices");
        let layers: Vec<Layer<'_>> = self
            .layers
            .iter()
            .enumerate()
            .map(|(i, t)| Layer {
                name: format!("{i}"),
                images: t.images.iter().collect(),
                material_texture: t.material_texture.clone(),
                default_texture: t.default_texture,
                encoding: Encoding { linear_light: self.look.linear_light, ..Encoding::default() },
            })
            .collect();
        let options = self.look.options(session.common.memory);
        let (from, to, progress) = (&source.mesh, &target.mesh, session.progress());
        let result = transfer_on(&session.engine, from, &layers, to, map.as_ref(), &options, progress)?;
        for note in &result.stats.notes {
            session.warn(note);
        }
        session.watch.lap("transfer");
        for (image, path) in result.layers.iter().zip(self.outputs) {
            barymap::io::write_image(image, path)?;
        }
        if let Some(path) = &self.look.coverage {
            barymap::io::write_image(&result.coverage, path)?;
        }
        if let Some(path) = &self.look.model {
            let texture = Some(barymap::io::image_file::encode_png(&result.layers[0])?);
            let material = GlbMaterial { name: "transferred".into(), base_color: [1.0; 4], texture };
            barymap::io::gltf_write::write_glb(path, &target.mesh, &[material])?;
        }
        session.watch.lap("write");
        let s = &result.stats;
        let stage = |name: &str| s.stages.iter().find(|t| t.name == name).and_then(|t| t.cpu_seconds);
        let per_texel = stage("map").filter(|_| s.covered > 0).map(|t| 1e9 * t / 2.0 / s.covered as f64);
        let d = vertices.distortion;
        let mut report = session.report(command);
        for t in &s.stages {
            report["seconds"][format!("transfer.{}", t.name)] = json!(t.seconds);
            report["cpu_seconds"][format!("transfer.{}", t.name)] = json!(t.cpu_seconds);
        }
        let extra = json!({
            "method": method.name(),
            "anchors": self.anchors.len(),
            "texels": s.texels,
            "covered": s.covered,
            "valid": s.valid,
            "doubtful": s.doubtful,
            "padded": s.padded,
            "overlapping": s.overlapping,
            "valid_fraction": s.valid_fraction,
            "flipped_area": d.flipped_area,
            "flipped_faces": d.flipped_faces,
            "stretch_all": d.stretch_all,
            "stretch_best95": d.stretch_best95,
            "stress": {
                "source": source.embedding.as_ref().map(|e| e.stress),
                "target": target.embedding.as_ref().map(|e| e.stress),
            },
            "nanoseconds_per_texel": per_texel,
            "memory": s.memory,
            "bands": s.bands,
            "device_stages": s.device_stages,
        });
        add(&mut report, &extra);
        Ok((result, vertices, report))
    }
}

/// What the user is told at the end.
pub(crate) fn summary(session: &Session<'_>, output: &Path, result: &TransferOutput, report: &serde_json::Value) {
    let s = &result.stats;
    session.say(&format!(
        "{}: {} x {}, {} texels covered, {:.1} % of the covered area valid, {:.2} % of the target flipped, stretch efficiency (best 95 %) {:.3}, by {}",
        output.display(),
        result.coverage.width,
        result.coverage.height,
        s.covered,
        100.0 * s.valid_fraction,
        100.0 * report["flipped_area"].as_f64().unwrap_or(0.0),
        report["stretch_best95"].as_f64().unwrap_or(0.0),
        session.engine.description(),
    ));
    if s.overlapping > 0 {
        session.warn(&format!(
            "{} texels belong to several triangles of the target; the lowest one is shown",
            s.overlapping
        ));
    }
}
