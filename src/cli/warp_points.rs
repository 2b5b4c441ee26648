//! `barymap warp-points`: points and outlines through the map of a cage, either way.

use std::path::{Path, PathBuf};

use glam::DVec2;
use serde_json::json;

use crate::Result;
use crate::cli::cage_map::{CageMap, MappingArguments};
use crate::cli::common::{Common, Session, check_outputs, usage};
use crate::engine::Engine;
use crate::geometry::Side;
use crate::io::geojson::GeoJson;
use crate::io::outline::{MappedShape, Part, Shape, Vertex};
use crate::io::point_table::{PointRow, read_point_table, write_point_table};
use crate::io::svg::Svg;
use crate::mapping::plane::{CompositeMap, Coordinates, Mapped};
use crate::tools::warp::outline::{Curve, map_curves};

/// Outlines of drawings stay this close to the true image, as a part of the cage's size.
const TOLERANCE: f64 = 1e-4;
/// Points mapped at once.
const CHUNK: usize = 1 << 16;

#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// Points or outlines: CSV with columns x and y; GeoJSON; SVG
    points: PathBuf,
    /// The mapped points, in the same format, with everything else that the file holds
    #[arg(long, short)]
    output: PathBuf,
    #[command(flatten)]
    mapping: MappingArguments,
    /// From the target back to the source, exactly
    #[arg(long)]
    inverse: bool,
    /// Write the Jacobian of the map as well (CSV): with --inverse, that of the forward map at the
    /// pre-image
    #[arg(long)]
    jacobian: bool,
    /// Largest distance of a drawn line from the true image, in the units of the cage: SVG lines
    /// and curves are divided as far as that needs (1/10000 of the cage's size if not given),
    /// GeoJSON lines only if it is given
    #[arg(long)]
    tolerance: Option<f64>,
}

/// The formats, told by the extension.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Csv,
    GeoJson,
    Svg,
}

impl Format {
    fn by_extension(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_string_lossy().to_ascii_lowercase();
        Some(match extension.as_str() {
            "csv" | "txt" => Self::Csv,
            "geojson" | "json" => Self::GeoJson,
            "svg" => Self::Svg,
            _ => return None,
        })
    }

    fn name(self) -> &'static str {
        match self {
            Self::Csv => "CSV",
            Self::GeoJson => "GeoJSON",
            Self::Svg => "SVG",
        }
    }
}

pub(crate) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    check_outputs([arguments.output.as_path()])?;
    let format = Format::by_extension(&arguments.points).ok_or_else(|| {
        let what = format!("{} has no extension of a known format", arguments.points.display());
        usage("POINTS", &what, "Name a file that ends in .csv, .geojson, .json or .svg")
    })?;
    if let Some(other) = Format::by_extension(&arguments.output).filter(|f| *f != format) {
        let what = format!("the input is {}, the output would be {}", format.name(), other.name());
        return Err(usage("--output", &what, "Write the same format as the input"));
    }
    if arguments.jacobian && format != Format::Csv {
        let what = format!("{} has no column for the Jacobian", format.name());
        return Err(usage("--jacobian", &what, "Use CSV, or leave it out"));
    }
    if arguments.tolerance.is_some_and(|t| !(t > 0.0 && t.is_finite())) {
        return Err(usage("--tolerance", "it is not a positive number", "Give a distance in the units of the cage"));
    }
    let mut session = Session::start(common)?;
    let (made, _) = CageMap::new(&mut session, &arguments.mapping)?;
    made.refuse_folds(&session, "warp-points")?;
    let size = if arguments.inverse { made.map.source().size() } else { made.map.target().size() };
    let started = std::time::Instant::now();
    let counts = match format {
        Format::Csv => table(&session, &made.map, arguments)?,
        Format::GeoJson => geojson(&session, &made.map, arguments)?,
        Format::Svg => svg(&session, &made.map, arguments, arguments.tolerance.unwrap_or(TOLERANCE * size))?,
    };
    session.watch.lap("map");
    let mut report = session.report("warp-points");
    made.describe(&mut report);
    report["inverse"] = json!(arguments.inverse);
    report["points"] = json!(counts.points);
    report["failed"] = json!(counts.failed);
    report["seconds_per_frame"] = json!(started.elapsed().as_secs_f64());
    session.write_report(&report)?;
    session.say(&format!(
        "{}: {} points, {} failed; {}",
        arguments.output.display(),
        counts.points,
        counts.failed,
        made.summary(&session.engine)
    ));
    Ok(())
}

/// Points mapped and points, or shapes, that could not be.
#[derive(Default)]
struct Counts {
    points: usize,
    failed: usize,
}

/// Images, or pre-images, in double precision; `None` where there is none.
fn map_points(
    session: &Session<'_>,
    map: &CompositeMap,
    inverse: bool,
    points: &[DVec2],
) -> Result<Vec<Option<Mapped>>> {
    let reference = Engine::reference();
    session.progress().stage("points", points.len() as u64);
    // Wachspress coordinates have poles outside their polygon.
    let bounded = map.coordinates() == Coordinates::Wachspress;
    let outside = |p: DVec2| bounded && map.source().contains(p) == Side::Outside;
    let mut all = Vec::with_capacity(points.len());
    for part in points.chunks(CHUNK) {
        if inverse {
            let found = map.inverse_points(&session.engine, part, None)?;
            // Single precision finds them, double precision finishes.
            let guess: Vec<DVec2> = found.iter().zip(part).map(|(m, q)| m.map_or(*q, |m| m.point)).collect();
            let exact = map.inverse_points(&reference, part, Some(&guess))?;
            all.extend(exact.into_iter().map(|m| m.filter(|m| !outside(m.point))));
        } else {
            let images = map.forward_points(&reference, part)?;
            all.extend(images.into_iter().zip(part).map(|(m, p)| (!outside(*p)).then_some(m)));
        }
        session.progress().advance(part.len() as u64);
    }
    session.bars.finish();
    Ok(all.into_iter().map(|m| m.filter(|m| m.point.is_finite())).collect())
}

fn table(session: &Session<'_>, map: &CompositeMap, arguments: &Arguments) -> Result<Counts> {
    let table = read_point_table(&arguments.points)?;
    session.warn_of_table(&arguments.points, table.notes());
    let points = &table.points;
    let mapped = map_points(session, map, arguments.inverse, points)?;
    let failed = mapped.iter().filter(|m| m.is_none()).count();
    let rows: Vec<PointRow> = mapped.iter().map(|m| PointRow { point: m.map(|m| (m.point, m.jacobian())) }).collect();
    write_point_table(&arguments.output, &table, &rows, arguments.jacobian)?;
    if failed > 0 {
        session.warn(&format!("{failed} of {} points have no image", points.len()));
    }
    Ok(Counts { points: points.len(), failed })
}

fn geojson(session: &Session<'_>, map: &CompositeMap, arguments: &Arguments) -> Result<Counts> {
    let mut document = GeoJson::read(&arguments.points)?;
    let (images, counts) = shapes(session, map, arguments.inverse, &document.shapes(), arguments.tolerance)?;
    document.replace(&images);
    document.write(&arguments.output)?;
    Ok(counts)
}

fn svg(session: &Session<'_>, map: &CompositeMap, arguments: &Arguments, tolerance: f64) -> Result<Counts> {
    let document = Svg::read(&arguments.points)?;
    for warning in document.warnings() {
        session.warn(&format!("{}: {warning}", arguments.points.display()));
    }
    let (images, counts) = shapes(session, map, arguments.inverse, &document.shapes(), Some(tolerance))?;
    document.write(&arguments.output, &images)?;
    Ok(counts)
}

/// A part of a file as a curve to map.
struct PartCurve<'a>(&'a Part);

impl Curve for PartCurve<'_> {
    fn segments(&self) -> usize {
        self.0.segments.len()
    }

    fn at(&self, index: usize, t: f64) -> DVec2 {
        let Some(segment) = self.0.segments.get(index) else { return self.0.start };
        let start = if index == 0 { self.0.start } else { self.0.segments[index - 1].end() };
        segment.at(start, t)
    }
}

/// The images of shapes, and how many of them have none.
fn shapes(
    session: &Session<'_>,
    map: &CompositeMap,
    inverse: bool,
    shapes: &[Shape],
    tolerance: Option<f64>,
) -> Result<(Vec<Option<MappedShape>>, Counts)> {
    let parts: Vec<PartCurve<'_>> = shapes.iter().flat_map(|s| &s.parts).map(PartCurve).collect();
    let curves: Vec<&dyn Curve> = parts.iter().map(|p| p as &dyn Curve).collect();
    let mapped = map_curves(&curves, tolerance, |points| -> Result<Vec<Option<DVec2>>> {
        Ok(map_points(session, map, inverse, points)?.into_iter().map(|m| m.map(|m| m.point)).collect())
    })?;
    let mut counts = Counts::default();
    let mut rest = mapped.into_iter();
    let mut lost = Vec::new();
    let images = shapes
        .iter()
        .map(|shape| {
            let parts: Vec<_> = rest.by_ref().take(shape.parts.len()).collect();
            let image: Option<MappedShape> = parts
                .into_iter()
                .map(|part| part.map(|p| p.into_iter().map(|v| Vertex { point: v.point, from: v.from }).collect()))
                .collect();
            match &image {
                Some(parts) => counts.points += parts.iter().map(Vec::len).sum::<usize>(),
                None => {
                    counts.failed += 1;
                    lost.push(shape.name.as_str());
                }
            }
            image
        })
        .collect();
    if let Some(first) = lost.first() {
        session.warn(&format!(
            "{} shapes have points without an image and are left empty, the first: {first}",
            lost.len()
        ));
    }
    Ok((images, counts))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_are_told_by_the_extension() {
        let by = |name: &str| Format::by_extension(Path::new(name));
        assert_eq!(
            (by("a.CSV"), by("a.json"), by("a.svg"), by("a")),
            (Some(Format::Csv), Some(Format::GeoJson), Some(Format::Svg), None)
        );
    }
}
