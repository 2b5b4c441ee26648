//! `barymap spline`: curves on a mesh by control points on it.

use std::path::{Path, PathBuf};

use glam::DVec3;
use serde_json::{Value, json};

use crate::cli::common::{Common, EmbeddingArguments, Session, Surface, check_outputs, size, usage};
use crate::cli::render::view;
use crate::geometry::{ClosestPoints, SurfacePoint};
use crate::io::finite;
use crate::io::polyline::{PointProperty, write_polyline_obj, write_polyline_ply};
use crate::tools::spline::{
    Disagreement, DrawingOptions, Evaluation, SplineKind, SplineOptions, SplineSurface, SurfaceCurve, drawing,
};
use crate::{Error, Result};

/// Distance from the mesh, in its diagonals, from which a point is called far off.
const FAR: f64 = 0.05;

#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// The mesh
    mesh: PathBuf,
    /// The control points: a JSON list of vertex indices, {"face": f, "barycentric": [b0, b1, b2]}
    /// and {"position": [x, y, z]}
    #[arg(long)]
    points: PathBuf,
    /// The curve: PLY with edges, OBJ with lines, or a drawing as SVG
    #[arg(long, short)]
    output: PathBuf,
    /// B-spline or Bezier pieces
    #[arg(long, value_enum, default_value = "bspline")]
    kind: SplineKind,
    /// Degree: 1 to 5 of a B-spline (default 3), of each Bezier piece (default: one piece; 3 where
    /// closed)
    #[arg(long)]
    degree: Option<usize>,
    /// Close the curve
    #[arg(long)]
    closed: bool,
    /// One average a point, or repeated averages of neighbouring control points first: slower, and
    /// smooth where control points are far apart
    #[arg(long, value_enum, default_value = "direct")]
    mode: Evaluation,
    /// Largest distance of the curve from its polyline, as a fraction of the mesh's diagonal
    #[arg(long, default_value_t = SplineOptions::default().tolerance)]
    tolerance: f64,
    /// Least number of segments
    #[arg(long, default_value_t = 0)]
    samples: usize,
    /// Where an SVG drawing is seen from: azimuth and elevation in degrees
    #[arg(long, default_value = "20,8", value_parser = view, allow_hyphen_values = true)]
    view: (f64, f64),
    /// Size of an SVG drawing: one number, or WIDTHxHEIGHT
    #[arg(long, default_value = "800", value_parser = size)]
    size: (u32, u32),
    #[command(flatten)]
    embedding: EmbeddingArguments,
}

#[derive(Clone, Copy, PartialEq)]
enum Format {
    Ply,
    Obj,
    Svg,
}

fn format(path: &Path) -> Result<Format> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    match extension.as_str() {
        "ply" => Ok(Format::Ply),
        "obj" => Ok(Format::Obj),
        "svg" => Ok(Format::Svg),
        _ => {
            let what = format!("{} is neither PLY, OBJ nor SVG", path.display());
            Err(usage("--output", &what, "End the name in .ply, .obj or .svg"))
        }
    }
}

pub(crate) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    let format = format(&arguments.output)?;
    check_outputs([arguments.output.as_path()])?;
    if arguments.degree == Some(0) {
        return Err(usage("--degree", "0 is no degree of a curve", "3 is usual"));
    }
    if !(1..=16384).contains(&arguments.size.0) || !(1..=16384).contains(&arguments.size.1) {
        return Err(usage("--size", "the drawing has no size or more than 16384 pixels", "Give a size such as 800"));
    }
    let mut session = Session::start_on_cpu(common)?;
    let mut surface = session.mesh(&arguments.mesh)?;
    let list = crate::io::anchors::read_places(&arguments.points)?;
    let (controls, moved) = snap(&surface, &list, &session)?;
    session.embed(&mut surface, &arguments.embedding.options())?;
    let splines = SplineSurface::new(surface.shape())?;
    session.watch.lap("prepare");
    let options = SplineOptions {
        kind: arguments.kind,
        degree: arguments.degree.unwrap_or(0),
        closed: arguments.closed,
        evaluation: arguments.mode,
        tolerance: arguments.tolerance,
        samples: arguments.samples,
    };
    let curve = splines.trace(&controls, &options)?;
    session.watch.lap("trace");
    let disagreement = splines.compare(&controls, &options)?;
    session.watch.lap("compare");
    write(&surface, &curve, &controls, format, arguments)?;
    session.watch.lap("write");
    tell(&session, &surface, &curve, &disagreement, arguments);
    let mut report = session.report("spline");
    report["spline"] = describe(&curve, &disagreement);
    report["spline"]["control_points"] = json!(controls.len());
    report["spline"]["snap_distance"] = json!(moved);
    session.write_report(&report)
}

/// The control points on the mesh, and how far each was moved onto it.
fn snap(
    surface: &Surface,
    list: &crate::io::AnchorList,
    session: &Session<'_>,
) -> Result<(Vec<SurfacePoint>, Vec<f64>)> {
    let closest = ClosestPoints::new(&surface.mesh, &surface.topology);
    let nearest = |p| closest.nearest(p).unwrap_or((SurfacePoint::new(0, [1.0, 0.0, 0.0]), f64::INFINITY));
    let resolved = list.resolve(&surface.mesh, &surface.topology, &nearest)?;
    let diagonal = surface.mesh.bounds().map_or(0.0, |(low, high)| low.distance(high));
    for (k, r) in resolved.iter().enumerate().filter(|(_, r)| r.snap_distance > FAR * diagonal) {
        session.warn(&format!(
            "{}: point {k} lies {:.4} off {} ({:.0} % of its diagonal) and was moved there; check its units",
            list.path.display(),
            r.snap_distance,
            surface.mesh.name,
            100.0 * r.snap_distance / diagonal
        ));
    }
    Ok((resolved.iter().map(|r| r.point).collect(), resolved.iter().map(|r| r.snap_distance).collect()))
}

fn write(
    surface: &Surface,
    curve: &SurfaceCurve,
    controls: &[SurfacePoint],
    format: Format,
    arguments: &Arguments,
) -> Result<()> {
    let path = &arguments.output;
    let runs: Vec<Vec<DVec3>> = curve.runs.iter().map(|r| r.iter().map(|p| p.position).collect()).collect();
    match format {
        Format::Obj => write_polyline_obj(&runs, path),
        Format::Ply => {
            let values = |f: &dyn Fn(&crate::tools::spline::CurvePoint) -> f64| curve.points().map(f).collect();
            let in_file = |p: &crate::tools::spline::CurvePoint| surface.mesh.point_in_file(p.point);
            let mut properties = vec![
                PointProperty { name: "parameter", values: values(&|p| p.parameter) },
                PointProperty { name: "face", values: values(&|p| f64::from(in_file(p).face)) },
            ];
            for (k, name) in ["b0", "b1", "b2"].into_iter().enumerate() {
                properties.push(PointProperty { name, values: values(&|p| in_file(p).barycentric[k]) });
            }
            write_polyline_ply(&runs, &properties, path)
        }
        Format::Svg => {
            let options = DrawingOptions {
                azimuth: arguments.view.0,
                elevation: arguments.view.1,
                size: [arguments.size.0, arguments.size.1],
            };
            if !(options.azimuth.is_finite() && options.elevation.is_finite()) {
                return Err(Error::option(
                    "--view",
                    "the angles are not finite",
                    "Give azimuth and elevation in degrees",
                ));
            }
            finite::positions(path, &runs.concat(), "point")?;
            let text = drawing(&surface.mesh, &surface.topology, curve, controls, &options);
            crate::io::output::write_bytes(path, text.as_bytes())
        }
    }
}

fn tell(session: &Session<'_>, surface: &Surface, curve: &SurfaceCurve, d: &Disagreement, arguments: &Arguments) {
    let diagonal = surface.mesh.bounds().map_or(1.0, |(low, high)| low.distance(high));
    if let Some(longest) = curve.jumps.iter().max_by(|a, b| a.length.total_cmp(&b.length)) {
        let open = curve.jumps.iter().filter(|j| !j.bridged).count();
        let gaps = if open > 0 { format!("; {open} of them are gaps") } else { String::new() };
        session.warn(&format!(
            "averages of control points so far apart jump at {} places, by up to {:.4} at parameter {:.4}, which the curve crosses along the surface{gaps}; add control points, or use --mode subdivision",
            curve.jumps.len(), longest.length, longest.parameter
        ));
    }
    let off = curve.without_projection();
    if off > 0 {
        session.warn(&format!(
            "{off} points have no projection, as beyond the boundary of a mesh; the closest ones stand in"
        ));
    }
    session.say(&format!(
        "{}: {} points, {:.4} long{}; direct and subdivided curves differ by up to {:.2e} ({:.2} % of the diagonal) at parameter {:.4}, {:.2e} in the mean",
        arguments.output.display(),
        curve.points().count(),
        curve.length(),
        if curve.closed { ", closed" } else { "" },
        d.distance,
        100.0 * d.distance / diagonal,
        d.parameter,
        d.mean
    ));
}

fn describe(curve: &SurfaceCurve, d: &Disagreement) -> Value {
    let jumps: Vec<Value> = curve
        .jumps
        .iter()
        .map(|j| json!({"parameter": j.parameter, "length": j.length, "bridged": j.bridged}))
        .collect();
    let intervals: Vec<Value> =
        d.intervals.iter().map(|i| json!({"parameters": i.parameters, "distance": i.distance})).collect();
    json!({
        "points": curve.points().count(),
        "length": curve.length(),
        "closed": curve.closed,
        "spans": curve.spans,
        "levels": curve.levels,
        "jumps": jumps,
        "without_projection": curve.without_projection(),
        "disagreement": {
            "distance": d.distance,
            "parameter": d.parameter,
            "mean": d.mean,
            "compared": d.compared,
            "intervals": intervals,
        },
    })
}
