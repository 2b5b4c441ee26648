//! `barymap transfer`: the textures of one mesh on another.

mod model;

use std::path::{Path, PathBuf};

use model::{Skin, SourceLook};
use serde_json::json;

use crate::cli::common::{Common, EmbeddingArguments, Session, Surface, anchor_pairs, check_outputs, size, usage};
use crate::cli::layer_kinds::LayerKinds;
use crate::cli::method::{MethodArguments, prepare};
use crate::cli::needs::{Room, with_what_is_left};
use crate::cli::pictures::Quality;
use crate::cli::unwrap::{Charts, Shown};
use crate::cli::verdict::Verdict;
use crate::desk::{Names, Textures, Writer, textures};
use crate::geometry::Topology;
use crate::io::{TextureName, finite};
use crate::surface::{AnchorPairs, IdentityMap, PointMap};
use crate::tools::point_cloud::{is_cloud, triangles_of_points};
use crate::tools::transfer::{
    Fill, Filter, Layer, Pyramids, TransferOptions, TransferOutput, TransferStats, check_beforehand, transfer_with,
};
use crate::tools::vertex_map::{VertexMap, vertex_map};
use crate::{Error, Result};

#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// The mesh with the texture
    #[arg(long)]
    source: PathBuf,
    /// A texture of the source: FILE, or for one of its materials MATERIAL=FILE, or in a role
    /// (base_color, roughness, normal ...) ROLE=FILE or ROLE:MATERIAL=FILE. FILE may be one file a
    /// tile: skin.<UDIM>.png, or vertex-colors for the colours of the source's vertices. Repeat for
    /// several layers. Without it the textures and colours of the source's materials are taken, or
    /// its vertex colours where no picture is named
    #[arg(long)]
    texture: Vec<String>,
    /// The mesh that receives it, with texture coordinates or with --unwrap
    #[arg(long)]
    target: PathBuf,
    /// Pairs of anchors: JSON, lines `iS iT`, or two files `S.vts,T.vts`
    #[arg(long)]
    anchors: String,
    /// The new texture: PNG, JPEG, TIFF, EXR, WebP, TGA or BMP; one for each layer, or one name
    /// with <ROLE> for all. With <UDIM> (or <UVTILE>) in the name one file a tile of the target,
    /// with <MATERIAL> one a material
    #[arg(long, short, required_unless_present = "model")]
    output: Vec<String>,
    #[command(flatten)]
    method: MethodArguments,
    #[command(flatten)]
    kinds: LayerKinds,
    #[command(flatten)]
    look: Look,
    /// End with exit code 3 if the result is not usable
    #[arg(long)]
    strict: bool,
    #[command(flatten)]
    quality: Quality,
    #[command(flatten)]
    charts: Charts,
    #[command(flatten)]
    embedding: EmbeddingArguments,
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
    /// Write what is covered: 0 nothing, 64 padding, 128 doubtful or filled, 255 valid
    #[arg(long)]
    pub(crate) coverage: Option<String>,
    /// What parts of charts get that the map leaves without colour: nothing, averages of
    /// what is around, a smooth surface through it, or the nearest colour (labels always)
    #[arg(long, value_enum, default_value = "none")]
    pub(crate) fill: Fill,
    /// Fill texels that the map does not vouch for, too
    #[arg(long)]
    pub(crate) fill_doubtful: bool,
    /// Write the map as an ST-map (EXR): the source's u and v in red and green, the coverage in
    /// blue
    #[arg(long)]
    pub(crate) stmap: Option<String>,
    /// Write the target with its new textures, ready to view (GLB)
    #[arg(long)]
    pub(crate) model: Option<PathBuf>,
    /// Average light instead of stored values
    #[arg(long)]
    pub(crate) linear_light: bool,
    /// How the source's texture is averaged
    #[arg(long, value_enum, default_value = "anisotropic")]
    pub(crate) filter: Filter,
    /// Samples along each side of a texel, 1 to 4
    #[arg(long, default_value_t = 1)]
    pub(crate) supersample: u32,
}

impl Look {
    fn options(&self, memory: u64) -> TransferOptions {
        TransferOptions {
            width: self.size.0,
            height: self.size.1,
            margin: self.margin,
            supersample: self.supersample,
            filter: self.filter,
            fill: self.fill,
            fill_doubtful: self.fill_doubtful,
            coordinates: self.stmap.is_some(),
            memory,
            ..TransferOptions::default()
        }
    }
}

/// The name of each layer's output, from one with `<ROLE>` or one for each.
pub(crate) fn layer_names(outputs: &[String], layers: &[Textures]) -> Result<Vec<TextureName>> {
    let names: Vec<TextureName> = outputs.iter().map(TextureName::new).collect();
    if let [name] = &names[..]
        && name.has_role()
    {
        return Ok(vec![name.clone(); layers.len()]);
    }
    if !names.is_empty() && names.len() != layers.len() {
        let roles: Vec<&str> = layers.iter().map(|l| l.role.as_str()).collect();
        return Err(usage(
            "--output",
            &format!("{} outputs for {} layers ({})", names.len(), layers.len(), roles.join(", ")),
            "Give one -o for each layer, or one with <ROLE> in its name",
        ));
    }
    Ok(names)
}

impl Look {
    /// Fails for a model that would not be what its name says.
    pub(crate) fn check_model(&self) -> Result<()> {
        let is_glb = |path: &Path| path.extension().is_some_and(|e| e.eq_ignore_ascii_case("glb"));
        match self.model.as_deref().filter(|path| !is_glb(path) && !path.starts_with("/dev")) {
            Some(path) => Err(usage(
                "--model",
                &format!("{} is written as GLB, and its name says something else", path.display()),
                "End the name in .glb; `barymap attributes` and `barymap remesh` write other formats",
            )),
            None => Ok(()),
        }
    }
}

pub(crate) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    arguments.look.check_model()?;
    check_outputs(arguments.look.model.as_deref().into_iter().chain(arguments.charts.unwrapped.as_deref()))?;
    arguments.charts.check(arguments.look.size, arguments.look.model.is_some())?;
    let pictures = arguments.output.iter().chain(&arguments.look.coverage);
    pictures.into_iter().try_for_each(crate::io::image_file::check_image_extension)?;
    arguments.quality.check(&arguments.output)?;
    let stmap = arguments.look.stmap.as_ref();
    if let Some(name) = stmap.filter(|n| !n.to_ascii_lowercase().ends_with(".exr")) {
        return Err(usage("--stmap", &format!("{name} cannot hold coordinates"), "End the name in .exr"));
    }
    if arguments.look.fill_doubtful && arguments.look.fill == Fill::None {
        return Err(usage("--fill-doubtful", "nothing is filled", "Say how, with --fill smooth or --fill pull-push"));
    }
    let early = arguments.output.iter().chain(&arguments.look.coverage).chain(stmap);
    // Places to fill in are checked once it is known with what.
    check_outputs(early.map(Path::new).filter(|p| !p.to_string_lossy().contains(['<', '%'])))?;
    let mut session = Session::start(common)?;
    let (mut source, cloud) = source(&mut session, &arguments.source)?;
    let mut target = session.target(&arguments.target)?;
    let method = if cloud { arguments.method.for_points() } else { arguments.method };
    if cloud {
        session.warn(&format!(
            "{} has points and no faces: the target's texels take the colours of the nearest points, by {}",
            source.mesh.name,
            method.name()
        ));
    }
    let all_roles = arguments.output.is_empty() || arguments.output.iter().any(|o| TextureName::new(o).has_role());
    let mut layers = textures(&arguments.texture, all_roles, &source.mesh, &|text| session.warn(text))?;
    let outputs = layer_names(&arguments.output, &layers)?;
    arguments.kinds.set(&mut layers)?;
    layers.iter_mut().for_each(|layer| arguments.quality.apply(&mut layer.metadata));
    session.watch.lap("read");
    let anchors = anchor_pairs(&arguments.anchors, &source, &target, &session)?;
    if layers.iter().any(Textures::needs_texcoords) {
        require_texcoords(&source)?;
    }
    let charts = target_charts(&mut session, &mut target, &arguments.charts, &arguments.look, &outputs)?;
    let job = Job {
        layers: &layers,
        pyramids: &Pyramids::new(&session.engine),
        anchors: &anchors,
        method,
        embedding: &arguments.embedding,
        look: &arguments.look,
        outputs: &outputs,
    };
    let (result, _, mut report) = job.run(&mut session, "transfer", &mut source, &mut target)?;
    if cloud {
        // Points have no orientation, and no surface that could be stretched.
        for key in ["flipped_area", "flipped_faces", "stretch_all", "stretch_best95"] {
            report.as_object_mut().and_then(|r| r.remove(key));
        }
    }
    add(&mut report, &charts);
    let verdict = verdict(&result, &report);
    report["verdict"] = verdict.describe();
    session.write_report(&report)?;
    let first = match &arguments.output[..] {
        [] => arguments.look.model.clone(),
        [name, ..] if name.contains(['<', '%']) => Some(listed(&report["files"]).into()),
        [name, ..] => Some(name.into()),
    };
    summary(&session, &first.unwrap_or_default(), &result, &report);
    verdict.tell(&session, arguments.strict, "Add pairs where it is wrong: barymap anchors --suggest names places")
}

/// The names in a list, the first five.
fn listed(files: &serde_json::Value) -> String {
    let files: Vec<&str> = files.as_array().into_iter().flatten().filter_map(|f| f.as_str()).collect();
    let more = if files.len() > 5 { format!(" and {} more", files.len() - 5) } else { String::new() };
    files[..files.len().min(5)].join(", ") + &more
}

/// The source; triangles among the nearest of its points where the file has coloured points and no
/// faces.
fn source(session: &mut Session<'_>, path: &Path) -> Result<(Surface, bool)> {
    let error = match session.mesh(path) {
        Ok(surface) => return Ok((surface, false)),
        Err(error) => error,
    };
    let points = crate::io::read_points(path).ok().filter(|p| is_cloud(&p.mesh) && !p.mesh.colors.is_empty());
    let Some(points) = points else { return Err(error) };
    points.warnings.iter().for_each(|warning| session.warn(&format!("{}: {warning}", path.display())));
    let mesh = triangles_of_points(&points.mesh)?;
    let topology = Topology::new(&mesh);
    Ok((Surface { mesh, topology, embedding: None, scene: None, notes: Vec::new() }, true))
}

pub(crate) fn require_texcoords(surface: &Surface) -> Result<()> {
    if surface.mesh.has_texcoords() {
        return Ok(());
    }
    let remedy = "A source needs those of its texture; a target is given some by --unwrap --model OUT.glb, any mesh by `barymap unwrap`";
    Err(Error::mesh(&surface.mesh.name, "it has no texture coordinates", remedy))
}

/// Makes the target's charts where asked, else says what is unfit about them for pictures of these
/// names; for the report.
pub(crate) fn target_charts(
    session: &mut Session<'_>,
    target: &mut Surface,
    charts: &Charts,
    look: &Look,
    names: &[TextureName],
) -> Result<serde_json::Value> {
    if !charts.unwrap {
        require_texcoords(target)?;
    }
    let shown = Shown {
        size: look.size,
        margin: look.margin,
        repeat: !names.iter().any(TextureName::has_tile),
        by_material: names.iter().any(TextureName::has_material),
    };
    charts.apply(session, target, &shown)
}

/// Adds the entries of `extra` to a report.
pub(crate) fn add(report: &mut serde_json::Value, extra: &serde_json::Value) {
    if let (Some(report), Some(extra)) = (report.as_object_mut(), extra.as_object()) {
        report.extend(extra.clone());
    }
}

/// A transfer with everything read.
pub(crate) struct Job<'a, 'p> {
    pub(crate) layers: &'p [Textures],
    /// Of their pictures, made by the first job that needs them.
    pub(crate) pyramids: &'a Pyramids<'p>,
    pub(crate) anchors: &'a AnchorPairs,
    pub(crate) method: MethodArguments,
    pub(crate) embedding: &'a EmbeddingArguments,
    pub(crate) look: &'a Look,
    /// A name for each layer, or none at all.
    pub(crate) outputs: &'a [TextureName],
}

impl<'p> Job<'_, 'p> {
    /// Maps, samples, writes pictures, coverage and model, and makes the report.
    pub(crate) fn run(
        &self,
        session: &mut Session<'_>,
        command: &str,
        source: &mut Surface,
        target: &mut Surface,
    ) -> Result<(TransferOutput, VertexMap, serde_json::Value)> {
        let name = |text: &Option<String>| text.as_ref().map(TextureName::new);
        let names = Names {
            layers: self.outputs.to_vec(),
            coverage: name(&self.look.coverage),
            stmap: name(&self.look.stmap),
            model: self.look.model.as_deref(),
        };
        let roles: Vec<&str> = self.layers.iter().map(|l| l.role.as_str()).collect();
        let parts = names.parts(&target.mesh, &|text| session.warn(text))?;
        names.check(&parts, &roles, &target.mesh)?;
        let layers: Vec<Layer<'p>> = self.layers.iter().map(|t| t.layer(self.look.linear_light)).collect();
        with_what_is_left(session.common, Room::default(), |memory| {
            check_beforehand(&source.mesh, &layers, &target.mesh, &self.look.options(memory))
        })?;
        let method = self.method;
        let map: Box<dyn PointMap + Send> = if IdentityMap::fits(&source.mesh, &target.mesh, self.anchors) {
            session.warn("source and target are the same surface with the same anchors: every point stays where it is");
            (session.field, session.alignment) = (None, None);
            Box::new(IdentityMap)
        } else {
            prepare(session, source, target, self.anchors, method, self.embedding)?
        };
        let vertices = vertex_map((&source.mesh, &source.topology), (&target.mesh, &target.topology), map.as_ref())?;
        session.watch.lap("vertices");
        let mut writer = Writer::default();
        let mut skins = Vec::new();
        let mut result: Option<TransferOutput> = None;
        for part in &parts {
            let (material, region) = (part.material, part.region());
            let (from, to, progress) = (&source.mesh, &target.mesh, session.progress());
            let mut output = with_what_is_left(session.common, Room::default(), |memory| {
                let options = TransferOptions { material, region, ..self.look.options(memory) };
                transfer_with(self.pyramids, from, &layers, to, map.as_ref(), &options, progress)
            })?;
            session.watch.lap("transfer");
            for (k, (image, role)) in output.layers.iter().zip(&roles).enumerate() {
                if let Some(path) = names.layer(k, role, part, to) {
                    let sources_are = layers[k].images.iter().all(|image| finite::is_finite(image));
                    finite::picture(&path, image, sources_are)?;
                    session.warn_of(&writer.picture(image, &self.layers[k].metadata, &path)?, &path);
                }
            }
            if let Some(path) = names.coverage(part, to) {
                writer.image(&output.coverage, &path)?;
            }
            if let (Some(path), Some(image)) = (names.stmap(part, to), &output.coordinates) {
                finite::picture(&path, image, true)?;
                writer.image(image, &path)?;
            }
            if names.model.is_some() {
                skins.push(Skin::new(self.layers, &output.layers)?);
            }
            if let Some(before) = &result {
                let mut stats: TransferStats = before.stats.clone();
                stats.merge(&output.stats);
                output.stats = stats;
            }
            result = Some(output);
            session.watch.lap("write");
        }
        let Some(result) = result else {
            return Err(Error::mesh(&target.mesh.name, "nothing of it is textured", "Give it texture coordinates"));
        };
        if let Some(path) = names.model {
            let look = SourceLook::new(&source.mesh, self.layers, session);
            writer.bytes(&model::glb(session, target, &parts, &skins, &look, path)?, path)?;
        }
        let files = writer.finish()?;
        session.watch.lap("write");
        for note in &result.stats.notes {
            session.warn(note);
        }
        self.notes(session, &roles, &result);
        let s = &result.stats;
        // Where texels stay on the device the stages overlap: the whole is what there is to
        // measure.
        let stays = s.device_stages.contains(&"locate");
        let counted = |name: &str| name == "map" || (stays && !["prepare", "frames", "mip"].contains(&name));
        let spent: Option<f64> = s.stages.iter().filter(|t| counted(t.name)).map(|t| t.cpu_seconds).sum();
        let per_texel = spent.filter(|_| s.covered > 0).map(|t| 1e9 * t / 2.0 / s.covered as f64);
        let d = vertices.distortion;
        session.handed_back = map.handed_back();
        let mut report = session.report(command);
        session.report_stages(&mut report, "transfer.", &s.stages);
        let extra = json!({
            "method": method.name(),
            "anchors": self.anchors.len(),
            "texels": s.texels,
            "covered": s.covered,
            "valid": s.valid,
            "doubtful": s.doubtful,
            "colorless": s.colorless,
            "filled": s.filled,
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
            "size_ratio": s.size_ratio,
            "roles": roles,
            "files": files,
            "device_stages": s.device_stages,
        });
        add(&mut report, &extra);
        Ok((result, vertices, report))
    }

    /// What the user should know of the result.
    fn notes(&self, session: &Session<'_>, roles: &[&str], result: &TransferOutput) {
        let s = &result.stats;
        let left = s.colorless.saturating_sub(s.filled);
        if s.colorless > 0 && self.look.fill == Fill::None {
            session.warn(&format!("{} texels of charts have no colour; --fill smooth gives them one", s.colorless));
        } else if left > 0 {
            session.warn(&format!("{left} texels of charts have no colour: nothing around them has one"));
        }
        for (n, what) in [
            (s.degenerate_texcoords, "without area in the texture"),
            (s.missing_texcoords, "without texture coordinates"),
        ] {
            if n > 0 {
                session.warn(&format!("{n} triangles of the target are {what}: no texel shows them"));
            }
        }
        if self.look.stmap.is_some() && !self.layers.iter().any(Textures::needs_texcoords) {
            session.warn("the ST-map is empty: no picture of the source is transferred");
        }
        if self.layers.iter().map(|l| l.images.len()).max() > Some(1)
            && self.look.stmap.is_some()
            && self.layers.iter().all(|l| l.face_texture.is_none())
        {
            session.warn("the ST-map tells where in a texture, not in which of the source's");
        }
        let places = ["base_color", "metallic_roughness", "roughness", "metallic", "normal", "occlusion", "emissive"];
        let left_out: Vec<&str> = roles.iter().skip(1).filter(|r| !places.contains(r)).copied().collect();
        if self.look.model.is_some() && !left_out.is_empty() {
            session.warn(&format!("glTF has no place for {}: not in the model", left_out.join(", ")));
        }
    }
}

/// What the result is worth. A pair of shapes that differ leaves some parts doubtful, which is worth
/// a look; where half of the target shows nothing that can be trusted, nobody would use it.
pub(crate) fn verdict(result: &TransferOutput, report: &serde_json::Value) -> Verdict {
    let s = &result.stats;
    let mut verdict = Verdict::default();
    verdict.share(1.0 - s.valid_fraction, 0.05, 0.5, "of the covered area cannot be trusted (--coverage shows where)");
    if let Some(flipped) = report["flipped_area"].as_f64() {
        verdict.share(flipped, 0.01, 0.25, "of the target is turned over");
    }
    let covered = s.covered.max(1) as f64;
    verdict.share(s.overlapping as f64 / covered, 0.01, 1.0, "of the texels belong to several triangles");
    verdict.share(s.colorless.saturating_sub(s.filled) as f64 / covered, 0.05, 0.5, "of the texels have no colour");
    if s.covered == 0 {
        verdict.unusable.push("nothing of the target is covered".to_owned());
    }
    verdict
}

/// What the user is told at the end.
pub(crate) fn summary(session: &Session<'_>, output: &Path, result: &TransferOutput, report: &serde_json::Value) {
    let s = &result.stats;
    let distortion = match (report["flipped_area"].as_f64(), report["stretch_best95"].as_f64()) {
        (Some(flipped), Some(stretch)) => {
            format!("{:.2} % of the target flipped, stretch efficiency (best 95 %) {stretch:.3}, ", 100.0 * flipped)
        }
        _ => String::new(),
    };
    session.say(&format!(
        "{}: {} x {}, {} texels covered, {:.1} % of the covered area valid, {}by {}",
        output.display(),
        result.coverage.width,
        result.coverage.height,
        s.covered,
        100.0 * s.valid_fraction,
        distortion,
        session.engine.description(),
    ));
    if s.overlapping > 0 {
        session.warn(&format!(
            "{} texels ({:.1} %) belong to several triangles of the target; the lowest one is shown",
            s.overlapping,
            100.0 * s.overlapping as f64 / s.covered.max(1) as f64
        ));
    }
}
