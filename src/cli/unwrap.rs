//! `barymap unwrap`: texture coordinates for a mesh without, and the same for the targets of other
//! commands.

use std::path::PathBuf;

use serde_json::{Value, json};

use crate::Result;
use crate::cli::common::{Common, Session, Surface, check_outputs, usage};
use crate::cli::model_file::{ModelFormat, New, write_model};
use crate::cli::needs;
use crate::geometry::texcoords::{Findings, Islands, findings};
use crate::geometry::{Mesh, NONE};
use crate::picture::{Image, Pixels};
use crate::tools::unwrap::{UnwrapOptions, UnwrapReport, unwrap};

#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// The mesh
    mesh: PathBuf,
    /// The mesh with its new texture coordinates: OBJ or GLB
    #[arg(long, short)]
    output: PathBuf,
    /// Side of the square texture that the margin is meant for, in texels
    #[arg(long, default_value_t = 2048)]
    size: u32,
    /// Texels between charts
    #[arg(long, default_value_t = 16)]
    margin: u32,
    #[command(flatten)]
    angle: Angle,
    /// Write a picture of the charts
    #[arg(long)]
    layout: Option<PathBuf>,
}

/// How charts are made.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(crate) struct Angle {
    /// Largest angle between a face and the mean of its chart, in degrees: smaller makes flatter
    /// charts and more seams
    #[arg(long, default_value_t = 70.0)]
    chart_angle: f64,
}

/// Charts for a target, as an option of other commands.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct Charts {
    /// Make texture coordinates for the target, whether it has any or not; --unwrapped or --model
    /// has them
    #[arg(long)]
    pub(crate) unwrap: bool,
    /// Write the target with the texture coordinates that --unwrap made: OBJ or GLB
    #[arg(long, requires = "unwrap")]
    pub(crate) unwrapped: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) angle: Angle,
}

/// The texture that a target's charts are for.
pub(crate) struct Shown {
    pub(crate) size: (u32, u32),
    pub(crate) margin: u32,
    /// Coordinates outside 0..1 wrap around.
    pub(crate) repeat: bool,
    /// Each material has its own.
    pub(crate) by_material: bool,
}

impl Charts {
    /// Checks what can be checked before the work; `has_model` if a file with the texture
    /// coordinates is written anyway.
    pub(crate) fn check(&self, size: (u32, u32), has_model: bool) -> Result<()> {
        if !self.unwrap {
            return Ok(());
        }
        if size.0 != size.1 {
            let what = format!("charts of equal texel density need a square texture, not {} x {}", size.0, size.1);
            return Err(usage("--size", &what, "Give one number"));
        }
        if self.unwrapped.is_none() && !has_model {
            let remedy = "Name a file for them: --unwrapped OUT.obj or --model OUT.glb";
            return Err(usage("--unwrap", "the new texture fits only the new texture coordinates", remedy));
        }
        self.unwrapped.as_deref().map_or(Ok(()), |path| ModelFormat::of(path, FORMATS).map(|_| ()))
    }

    /// Unwraps the target where that is asked for, writes it, and says what is unfit about texture
    /// coordinates that are kept. What the report should have comes back.
    pub(crate) fn apply(&self, session: &mut Session<'_>, target: &mut Surface, shown: &Shown) -> Result<Value> {
        let size = shown.size;
        if !self.unwrap {
            let texels = u64::from(size.0) * u64::from(size.1);
            let found = findings(&target.mesh, texels, shown.repeat, shown.by_material);
            for sentence in found.sentences(&target.mesh) {
                session.warn(&sentence);
            }
            session.watch.lap("charts");
            return Ok(json!({ "charts": describe(&found) }));
        }
        let report = unwrap_surface(session, target, size.0, shown.margin, self.angle)?;
        if let Some(path) = &self.unwrapped {
            let format = ModelFormat::of(path, FORMATS)?;
            write_model(session, &target.mesh, target.scene.as_deref(), New::Texcoords, format, path)?;
        }
        Ok(json!({ "unwrap": describe_unwrap(&report) }))
    }
}

/// Gives the surface charts, and tells what they are like.
fn unwrap_surface(
    session: &mut Session<'_>,
    surface: &mut Surface,
    size: u32,
    margin: u32,
    angle: Angle,
) -> Result<UnwrapReport> {
    needs::UNWRAP.check(&surface.mesh, 0)?;
    // On a small texture a wide margin would leave no room for the charts.
    let gap = margin.clamp(1, (size / 64).max(2));
    if gap < margin {
        session.warn(&format!(
            "the charts are {gap} texels apart, not {margin}: more would take too much of {size} texels"
        ));
    }
    let options = UnwrapOptions { size, gap, angle: angle.chart_angle };
    let made = unwrap(&surface.mesh, &surface.topology, &options)?;
    surface.mesh = made.mesh;
    session.watch.lap("unwrap");
    let report = made.report;
    let name = surface.mesh.name.clone();
    let listed = |triangles: &[u32]| {
        let first: Vec<String> = triangles.iter().take(5).map(u32::to_string).collect();
        first.join(" ") + if triangles.len() > 5 { " ..." } else { "" }
    };
    if !report.flat.is_empty() {
        let (count, which) = (report.flat.len(), listed(&report.flat));
        session.warn(&format!(
            "{name}: {count} faces without area or too thin for it have a single point of the texture ({which})"
        ));
    }
    if report.copies > 0 {
        session.warn(&format!(
            "{name}: {} faces have the same corners as others and share their place in the texture",
            report.copies
        ));
    }
    if report.cut_polygons > 0 {
        session.warn(&format!("{name}: {} bent polygons are cut into triangles", report.cut_polygons));
    }
    if !report.faulty.is_empty() {
        let (count, which) = (report.faulty.len(), listed(&report.faulty));
        session.warn(&format!("{name}: {count} faces overlap in the texture in spite of all attempts ({which})"));
    }
    Ok(report)
}

fn describe_unwrap(r: &UnwrapReport) -> Value {
    let d = r.distortion;
    json!({
        "charts": r.charts,
        "not_disks": r.not_disks,
        "angle_distortion": {"median": d.angle_median, "p95": d.angle_p95},
        "stretch": {"median": d.stretch_median, "p95": d.stretch_p95},
        "packing_efficiency": d.texture_area,
        "seam_length": r.seam_length,
        "texels_per_unit": r.texels_per_unit,
        "gap": r.gap,
        "flat_faces": r.flat,
        "overlapping_faces": r.faulty,
        "repeated_faces": r.copies,
        "cut_polygons": r.cut_polygons,
        "rounds": r.rounds,
    })
}

fn describe(found: &Findings) -> Value {
    let pairs: Vec<Value> = found
        .overlaps
        .iter()
        .take(100)
        .map(|o| {
            let faces = o.islands.map(|i| found.islands.islands[i as usize].first);
            json!({"islands": o.islands, "first_faces": faces, "share_of_texture": o.area})
        })
        .collect();
    json!({
        "islands": found.islands.islands.len(),
        "overlapping_pairs": found.overlaps.len(),
        "overlapping_area": found.overlapping_area,
        "overlaps": pairs,
        "overlaps_complete": found.complete,
        "mirrored": found.mirrored,
        "mirrored_area": found.mirrored_area,
        "missing_area": found.missing_area,
    })
}

/// The formats that hold texture coordinates.
const FORMATS: &[ModelFormat] = &[ModelFormat::Obj, ModelFormat::Glb];

pub(crate) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    let format = ModelFormat::of(&arguments.output, FORMATS)?;
    check_outputs([Some(arguments.output.as_path()), arguments.layout.as_deref()].into_iter().flatten())?;
    if let Some(layout) = &arguments.layout {
        crate::io::image_file::check_image_extension(layout)?;
    }
    let mut session = Session::start_on_cpu(common)?;
    let mut surface = session.mesh(&arguments.mesh)?;
    let report = unwrap_surface(&mut session, &mut surface, arguments.size, arguments.margin, arguments.angle)?;
    write_model(&session, &surface.mesh, surface.scene.as_deref(), New::Texcoords, format, &arguments.output)?;
    if let Some(path) = &arguments.layout {
        session.write_image(&layout(&surface.mesh, arguments.size.min(2048))?, path)?;
    }
    session.watch.lap("write");
    let d = report.distortion;
    session.say(&format!(
        "{}: {} charts, {:.1} % of the texture used, seams {:.2} long, angles distorted by {:.3} (95 % below {:.3}), lengths by {:.3} ({:.3})",
        arguments.output.display(),
        report.charts,
        100.0 * d.texture_area,
        report.seam_length,
        d.angle_median,
        d.angle_p95,
        d.stretch_median,
        d.stretch_p95
    ));
    let mut written = session.report("unwrap");
    written["faces"] = json!(surface.mesh.file_triangle_count());
    written["unwrap"] = describe_unwrap(&report);
    session.write_report(&written)
}

/// The charts in colours that tell neighbours apart, with the edges of their triangles.
fn layout(mesh: &Mesh, size: u32) -> Result<Image> {
    let islands = Islands::new(mesh);
    let n = size as usize;
    let mut samples = vec![255u8; 3 * n * n];
    for t in (0..mesh.triangle_count()).filter(|&t| islands.island_of[t] != NONE) {
        let Some(uv) = mesh.triangle_texcoords(t) else { continue };
        // The golden ratio spreads hues.
        let hue = f64::from(islands.island_of[t]) * 0.618_033_988_749_895 * 6.0;
        let color = [0.0, 4.0, 2.0].map(|shift| ((hue + shift).rem_euclid(6.0) - 3.0).abs().clamp(1.0, 2.0) - 1.0);
        let p = uv.map(|q| [q.x * f64::from(size), (1.0 - q.y) * f64::from(size)]);
        let range = |axis: usize| {
            let values = p.map(|q| q[axis]);
            let low = values[0].min(values[1]).min(values[2]).floor().max(0.0) as usize;
            let high = values[0].max(values[1]).max(values[2]).ceil().max(0.0) as usize;
            low..high.min(n)
        };
        for y in range(1) {
            for x in range(0) {
                let c = [x as f64 + 0.5, y as f64 + 0.5];
                // Distances from the edges, positive inside: y points down here.
                let nearest = (0..3).map(|k| {
                    let (a, b) = (p[k], p[(k + 1) % 3]);
                    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
                    (dy * (c[0] - a[0]) - dx * (c[1] - a[1])) / dx.hypot(dy)
                });
                let nearest = nearest.fold(f64::INFINITY, f64::min);
                if nearest >= 0.0 {
                    let shade = if nearest < 0.5 { 110.0 } else { 170.0 };
                    for (k, part) in color.iter().enumerate() {
                        samples[3 * (y * n + x) + k] = (shade + 75.0 * part) as u8;
                    }
                }
            }
        }
    }
    Image::new(size, size, 3, Pixels::U8(samples))
}
